# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What changes a drive and lasts: its parameters, its tuning, its own time-out.

Many drives keep a written value in a memory that wears out, and a half-written set of values may
move a motor otherwise than meant. So a value is written only where it differs, all of a set or
none, and what is read back is what it is (:mod:`.parameter_writer`).

**The driver takes only what it needs from the drive.** It puts back the drive's own time-out at its
end, after a kill at the next start (:mod:`.drive_timeout_writer`, :mod:`.memory`).
"""
