# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""All ways to break the laws of the house in the driver."""

from __future__ import annotations

from histories import HISTORIES
from laws import LAWS

MUTANTS = (*LAWS, *HISTORIES)
