# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A drive made of software, on a line made of software. No code of the driver but the catalog.

**It is the far end of nearly every test, so its mistakes must not be the driver's.** It imports
tables and words of the families, and no link, bus, profile or drive control. Its frames are coded
by pymodbus or by code of its own, its PLC runs the Structured Text that is shipped, its motor has
ramps, slip and coasting. Most wrong readings of a manual were found because both ends, written
from it apart from each other, have to agree on the wire.

**It is stricter than a kind drive.** It refuses what a manual forbids, ignores what it does not
mention, and on request it answers late, twice, damaged or not at all (:mod:`.injections`). No test
of the driver fails by a drive that is kinder, so ``test/unit/simulator`` tests that strictness.

**Time is given, not read.** Drive, line and PLC are advanced to a moment (``advance_to``). The same
objects run in virtual time under a test, and by the clock behind a pty, a TCP port or a CAN bus in
the program ``simulator``. Bytes take as long as on the wire, because what goes wrong depends on it.

- ``drive.py``: a drive of any family: memory, control unit, motor, faults. A folder for each family
  has its control unit and what its firmware does; ``_declared/`` reads a file that describes one.
- ``line.py``, ``wire.py``, ``can_line.py``: bytes and their times; a codec for each protocol.
- ``plc.py``, ``telegram1.py``, ``parameter_channel.py``: a PLC between, and the drive behind it.
- ``injections.py``, ``control.py``: what can go wrong, and how another program asks for it.

Rejected: one engine for all drives (the families differ in what they do in a fault, which is what
is tested); the profile turned round as the drive (it would agree with every mistake).
"""
