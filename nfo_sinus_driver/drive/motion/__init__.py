# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What makes a motor turn, and what stops it: enable, set-point, stop, and the judge of all three.

**An enable ends with a status that shows the run, and a stop with one from after the stop** that
shows that the drive stops: an echo of a write is no proof.

**A stop is a sequence of its own** (:mod:`.stopping`), which all reasons share. It takes the run
command first, each step by itself, and goes on until the status confirms it, over a lost line and a
new connection, too. What shaped it:

- A drive refuses every command in a fault: it waits for the fault to end, and removes the run
  command then, for the drive may run on.
- The line returns between a stop and the read after it: that stop is repeated at once.
- A stop is taken and the motor does not slow down: it is stopped by every means left [C126].
- A PLC shows the status from before the stop: what confirms it has to be newer.
- A released motor shows a speed that does not fall: it is reported as not clear.

:mod:`.controller` gets every status and command, and dispatches the events of
:mod:`..known.control_state`; what to write, the control method of the family says.
"""
