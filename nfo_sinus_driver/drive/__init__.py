# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
One drive in engineering units. No ROS.

**Whether the motor may turn is known in one place**, the table of :mod:`.control_state`: every
command, status, loss and refusal is an event of it, and set-points are followed in ENABLED alone.
With flags in several classes, two events in an unforeseen order went wrong again and again;
``test_control_table`` goes through all states of the table with a model of drive and line.

**What counts is the status, never what was written.** What a drive has taken, a terminal may have
undone; what got no answer, it may have carried out. So an enable ends with a status that shows the
run, and a stop with one from after the stop that shows that the drive stops.

**A stop is a sequence of its own** (:mod:`.stopping`), which all reasons share. It takes the run
command first, each step by itself, and goes on until the status confirms it, over a lost line and a
new connection, too. What shaped it:

- A drive refuses every command in a fault: it waits for the fault to end, and removes the run
  command then, for the drive may run on.
- The line returns between a stop and the read after it: that stop is repeated at once.
- A stop is taken and the motor does not slow down: it is stopped by every means left [C126].
- A PLC shows the status from before the stop: what confirms it has to be newer.
- A released motor shows a speed that does not fall: it is reported as not clear.

**Nothing is written to a drive that was not recognised** (:mod:`.recognition`). After a silence in
which a plug can be moved, another drive may be at the address; to it, a stop may be a run command.

**The driver takes only what it needs from the drive.** It polls without side effects, writes a
setting only on change and reads it back, and puts back the drive's own time-out at its end, after a
kill at the next start (:mod:`.communication_watchdog`).

What a public call of :class:`Drive` guarantees when its future has a result:

=============================  ===================================================================
``connect``                    The drive is recognised and polled. A run command by the bus that
                               this driver did not give is being removed.
``enable``                     Control, set-point 0 and a run command were written; the status
                               shows the run. The motor turns with the first set-point that comes
                               from now on; by a reference of the drive's own at once. On an error
                               a stop has begun, if anything was written.
``set_setpoint`` (no future)   It waits for nothing. The newest value goes out in its turn, limited,
                               while the motor is enabled; one from before never counts.
``stop``, ``rapid_stop``,      The run command is removed, and the status confirms that the drive
``deactivate``,                stops; the motor may be on its ramp. Or a fault keeps it still, in
``cancel_tuning``              which the drive refuses that: it follows when the fault is over. On
                               an error it was not confirmed in time: it is written until it is.
``quick_stop``                 The same, and the motor is released, where the drive can: it coasts.
``acknowledge``                The fault is over. What would run the motor by the bus was removed
                               before, as far as a drive takes that in a fault, or by the very
                               next frame: nothing turns by it.
``disconnect``                 As ``stop``; control was given back at standstill, or the motor is
                               left to its ramp. Nothing is sent any more, unless a stop was not
                               confirmed.
``stop_for_good``              As ``deactivate``; nothing can start the motor any more.
``tune``                       The motor was energised, and may have turned. What was commanded is
                               removed, as by ``stop``.
``set_drive_timeout``,         The drive holds what was requested: it was read back.
those of ``parameters``
``erase_error_log``,           It is done, and checked. No motor turned by it.
``reset_energy``
other futures                  They read, and no motor turns by them.
=============================  ===================================================================

Rejected: a retry of every request in one place (a stop and a set-point need other patience than a
read); asking the drive for what it allows before each command (it may change in between: a refusal
is handled where it occurs).
"""

from nfo_sinus_driver.catalog import InverterStatus, Procedure
from nfo_sinus_driver.drive.changes import ParameterChange
from nfo_sinus_driver.drive.drive import Drive
from nfo_sinus_driver.drive.events import Cause, DriveError, Event, Report, Severity
from nfo_sinus_driver.drive.identity import Identity
from nfo_sinus_driver.drive.settings import CONTROL_METHODS, DriveSettings
from nfo_sinus_driver.drive.snapshot import Listener, LogEntry, Snapshot, Telemetry
from nfo_sinus_driver.drive.stop_reason import StopReason
from nfo_sinus_driver.drive.tuning import Tuned

__all__ = [
    'CONTROL_METHODS',
    'Cause',
    'Drive',
    'DriveError',
    'DriveSettings',
    'Event',
    'Identity',
    'InverterStatus',
    'Listener',
    'LogEntry',
    'ParameterChange',
    'Procedure',
    'Report',
    'Severity',
    'Snapshot',
    'StopReason',
    'Telemetry',
    'Tuned',
]
