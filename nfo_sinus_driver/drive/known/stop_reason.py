# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Why a motor stopped: few kinds, and the causes of each; the codes are those of DriveStatus."""

from __future__ import annotations

from collections.abc import Mapping
import enum

from nfo_sinus_driver.catalog import Meaning, StatusCode
from nfo_sinus_driver.drive.known.events import Cause, Report


class StopReason(enum.IntEnum):
    """Kinds of reasons; the causes of each are in one table."""

    NONE = 0
    STOP = 1
    DISABLE = 2
    QUICK_STOP = 3
    STOP_ALL = 4
    LIFECYCLE = 5
    DRIVER_ENDS = 6
    SETPOINT_TIMEOUT = 7
    FAULT = 8
    RUN_INPUT = 9
    CONTROL_TAKEN = 10
    DRIVE_LOST = 11
    POWER_CYCLE = 12
    SETPOINT_REFUSED = 13
    NOT_FOLLOWING = 14
    DRIVE_TIMEOUT = 15
    BY_ITSELF = 16
    PROCEDURE = 17
    CONTROL_MODE = 18
    ENABLE_FAILED = 19
    ACKNOWLEDGE = 20
    NOT_ENABLED = 21
    STOP_WITH = 22
    JAM = 23
    OTHER = 255


_CAUSES: Mapping[StopReason, tuple[Cause, ...]] = {
    StopReason.STOP: (Cause.STOP_REQUESTED,),
    StopReason.DISABLE: (Cause.DISABLE_REQUESTED,),
    StopReason.QUICK_STOP: (Cause.QUICK_STOP_REQUESTED,),
    StopReason.STOP_ALL: (Cause.STOP_ALL_REQUESTED,),
    StopReason.LIFECYCLE: (Cause.TRANSITION_REQUESTED,),
    StopReason.DRIVER_ENDS: (Cause.DRIVER_ENDS,),
    StopReason.SETPOINT_TIMEOUT: (Cause.SETPOINT_TIMED_OUT,),
    StopReason.FAULT: (Cause.FAULT,),
    StopReason.RUN_INPUT: (Cause.RUN_INPUT_LOST,),
    StopReason.CONTROL_TAKEN: (
        Cause.TERMINALS_IN_CONTROL,
        Cause.KEYPAD_IN_CONTROL,
        Cause.OTHERS_IN_CONTROL,
        Cause.CONTROL_WITHHELD,
        Cause.CONTROL_LOST,
    ),
    StopReason.DRIVE_LOST: (Cause.LOST, Cause.LINE_FAILED),
    StopReason.POWER_CYCLE: (
        Cause.POWER_CYCLED,
        Cause.DRIVE_STARTING,
        Cause.RESTARTED,
        Cause.SLOWER_AFTER_SILENCE,
        Cause.MAY_HAVE_RESTARTED,
        Cause.CONTROL_LOST_WHILE_AWAY,
    ),
    StopReason.SETPOINT_REFUSED: (Cause.SETPOINT_REFUSED, Cause.SETPOINT_UNACKNOWLEDGED),
    StopReason.NOT_FOLLOWING: (
        Cause.TURNS_BACKWARDS,
        Cause.NOT_SLOWER_AFTER_TIME_OUT,
        Cause.NOTHING_CHANGES,
    ),
    StopReason.DRIVE_TIMEOUT: (Cause.DRIVER_PAUSED,),
    StopReason.BY_ITSELF: (Cause.STOPPED_BY_ITSELF,),
    StopReason.PROCEDURE: (Cause.PROCEDURE_ENDED, Cause.PROCEDURE_CANCELLED),
    StopReason.CONTROL_MODE: (Cause.CONTROL_MODE_CHANGED,),
    StopReason.ENABLE_FAILED: (Cause.ENABLE_FAILED,),
    StopReason.ACKNOWLEDGE: (Cause.ACKNOWLEDGE_REQUESTED,),
    StopReason.STOP_WITH: (Cause.STOPPED_WITH,),
    StopReason.JAM: (Cause.JAMMED,),
    StopReason.NOT_ENABLED: (Cause.RUNS_UNASKED, Cause.FOUND_RUNNING),
}
_REASON_OF = {cause: reason for reason, causes in _CAUSES.items() for cause in causes}
#: The faults of a drive after its own communication time-out.
_OF_THE_LINE = (Meaning.SERIAL_FAILURE, Meaning.FIELDBUS_FAILURE)


def reason_of(report: Report | None) -> StopReason:
    """Return which kind of reason a report of a stop is."""
    if report is None:
        return StopReason.NONE
    fault = report.values.get('fault')
    if isinstance(fault, StatusCode) and not fault.meanings.isdisjoint(_OF_THE_LINE):
        return StopReason.DRIVE_TIMEOUT
    return _REASON_OF.get(report.cause, StopReason.OTHER)
