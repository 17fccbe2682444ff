# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
One drive in engineering units. No ROS.

:class:`Drive` is the door. Behind it are four rooms, each with its reasons at its head, and none
imports one above it:

===============  =================================================================================
:mod:`.watch`    when to look at the drive
:mod:`.change`   what changes it and lasts: parameters, tuning, its own time-out
:mod:`.motion`   what makes its motor turn, and what stops it
:mod:`.known`    what is known of it, and what the driver does with it
===============  =================================================================================

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
from nfo_sinus_driver.drive.change.tuning import Tuned
from nfo_sinus_driver.drive.drive import Drive
from nfo_sinus_driver.drive.known.changes import ParameterChange
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Event, Report, Severity
from nfo_sinus_driver.drive.known.identity import Identity
from nfo_sinus_driver.drive.known.settings import CONTROL_METHODS, DriveSettings
from nfo_sinus_driver.drive.known.snapshot import Listener, LogEntry, Snapshot, Telemetry
from nfo_sinus_driver.drive.known.stop_reason import StopReason

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
