# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Where the two packages are, on main and on the branch that tools/release_branch makes."""

from __future__ import annotations

from pathlib import Path

#: The folder of nfo_sinus_driver.
ROOT = Path(__file__).resolve().parents[2]
#: The folder of nfo_sinus_msgs: inside on main, beside on the branch.
MSG_DEFS = next(
    path for path in (ROOT / 'msg_defs', ROOT.parent / 'nfo_sinus_msgs') if path.is_dir()
)
