# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How many examples of hypothesis a test has."""

from __future__ import annotations

import os

#: Set by ``make unit FULL=1``.
FULL = bool(os.environ.get('FULL'))
_SHARE = 4


def examples(number: int) -> int:
    """Return the number itself in a full run, and a share of it in a normal one."""
    return number if FULL else number // _SHARE
