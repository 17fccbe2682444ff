# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What there is to say of a drive, as values; the sentences are made where they are shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import enum


class Severity(enum.Enum):
    """How grave an event is; it becomes the level of a log line."""

    INFO = 'info'
    WARNING = 'warning'
    ERROR = 'error'


#: What happened, what was done, or what went wrong; the wording has a sentence for each.
Cause = enum.Enum(
    'Cause',
    # the line and who answers
    'CONNECTED DRIVER_ERROR LINE_FAILED NOT_REACHED NO_RESPONSE NO_VALID_ANSWER TOO_LATE LOST '
    'LOST_IN_USE OLD_DATA RESTARTED HELD_BY_LINE NOT_THE_MODEL OTHER_MODEL UNEXPECTED_IDENTITY '
    'SEVERAL_MODELS FIRMWARE_NOT_ASKED '
    # why a command is not carried out
    'MONITOR_ONLY NOT_CONNECTED NOT_ACTIVE ENDING NOT_POSSIBLE ENABLING_ALREADY STOP_PENDING '
    'STOPPED_SINCE_ASKED PROCEDURE_GOES_ON FAULT_FORBIDS OTHER_METHOD_RUNS WRONG_CONTROL_MODE '
    'NO_RUN_INPUT START_FAULTED NOT_STARTED STOPPED_WHILE_ENABLING NOT_CONFIRMED '
    # enable, stop, acknowledge, release
    'ENABLED ENABLED_BY_OWN_REFERENCE ENABLED_ALREADY STOPPED STOPPED_BY_FAULT STOP_BLOCKED '
    'STOPPING COASTING RAMPING QUICK_STOPPED NO_QUICK_STOP QUICK_STOP_UNCONFIRMED NO_CONTROL '
    'RUN_BY_OTHERS STOP_UNCONFIRMED STOP_UNCONFIRMED_AT_END CANNOT_STOP STOP_CONFIRMED_LATE '
    'CANNOT_STOP_BUT_STANDS STOP_FORCED '
    'NOTHING_TO_ACKNOWLEDGE ACKNOWLEDGED ACKNOWLEDGED_DETAILED STILL_FAULTED NEXT_FAULT '
    'NOT_IN_CONTROL CONTROL_RELEASED COASTED_FOR_TIMEOUT CONTROL_KEPT LEFT_TO_RAMP RELEASE_BLOCKED '
    'ONLY_WATCHED '
    # what a stop that is not confirmed waits for
    'NO_ANSWER_YET TUNING_ENERGISES TUNING_REFUSES DRIVE_SAYS '
    # the motor is stopped without a command, and why
    'STOPPED_BECAUSE STOPPED_BECAUSE_OF_FAULT STOPPING_BECAUSE FAULT FAULT_APPEARED '
    'CONTROL_MODE_CHANGED DRIVE_STARTING RUN_INPUT_LOST STOPPED_BY_ITSELF TERMINALS_IN_CONTROL '
    'KEYPAD_IN_CONTROL OTHERS_IN_CONTROL POWER_CYCLED SLOWER_AFTER_SILENCE CONTROL_LOST '
    'CONTROL_LOST_WHILE_AWAY CONTROL_WITHHELD TURNS_BACKWARDS NOT_SLOWER_AFTER_TIME_OUT '
    'RUNS_UNASKED FOUND_RUNNING STARTED_AFTER_FAULT '
    # set-points
    'SETPOINT_REFUSED OWN_REFERENCE SETPOINT_LIMITED SETPOINT_BEYOND_NOMINAL '
    'SPEED_SCALE SETPOINT_TIMED_OUT SETPOINTS_AGAIN FASTER_THAN_TOLD '
    'BROADCAST_MISSED NO_BROADCAST MEMBER_MONITORED MEMBER_BY_OWN_REFERENCE MEMBER_NOT_ENABLED '
    'MEMBER_TAKES_SEVERAL_WRITES MEMBERS_DIFFER MEMBERS_WRITTEN_DIFFERENTLY '
    'SHARED_SETPOINT_LIMITED '
    # what the drive says of itself
    'CURRENT_LIMITED ALARM ALARM_UNNAMED ASLEEP IMPOSSIBLE_VALUE '
    # the time-out of the drive itself
    'NO_OWN_TIMEOUT OWN_TIMEOUT_OFF OWN_TIMEOUT_STOPS_NOTHING OWN_TIMEOUT_SHORT OWN_TIMEOUT_LATER '
    'OWN_TIMEOUT_IMPOSSIBLE OWN_TIMEOUT_NOT_TAKEN OWN_TIMEOUT_LEFT OWN_TIMEOUT_NOT_OURS WATCH_LEFT '
    'OWN_TIMEOUT_UNKNOWN OWN_TIMEOUT_OF_PLC '
    # procedures
    'UNKNOWN_PROCEDURE OTHER_METHOD_NEEDED OTHER_PROCEDURE_GOES_ON MOTOR_ENABLED '
    'STOP_NOT_CONFIRMED_YET MOTOR_RUNS CONTROL_INHIBITED CONTROLLED_LOCALLY NO_STANDBY '
    'PROCEDURE_STOPPED PROCEDURE_NOT_BEGUN INTERRUPTED TUNING_BEGINS TUNING_NEEDS TUNED '
    'TUNING_FAILED TUNING_STOPPED TUNING_WITHOUT_RESULT TUNING_CUT_SHORT '
    'TUNING_DOES_NOT_BEGIN TUNING_ENDLESS '
    'TUNING_CHANGED LOG_ERASED LOG_NOT_ERASED ENERGY_RESET ENERGY_NOT_RESET ENERGY_RESET_UNKNOWN '
    # the error log
    'LOG_ENTRY LOG_ENTRY_UNSEEN LOG_UNDOCUMENTED LOG_NOT_WATCHED LOG_CHANGES '
    # the settings of the drive
    'SETTINGS_READ SETTINGS_BEING_READ SETTINGS_REFRESHED SETTING_UNREADABLE OPTIONS_MISSING '
    'BAD_VALUE CHANGED CHANGED_FOR_TIMEOUT STORED CHANGED_AS_WANTED CHANGED_AT_DRIVE NOT_AS_WANTED '
    'WANTED_BUT_MISSING WANTED_BUT_REFUSED NO_SETTING NOT_CHANGED CHANGE_WHILE_TUNING '
    'COMMUNICATION_PROTECTED CODES_UNCERTAIN FOLLOW_THE_LINE STANDSTILL_NEEDED VALUE_NOT_ACCEPTED '
    'NOT_WHILE_ENABLED '
    'REFUSED_WHILE_RUNNING REFUSED_WHILE_FAULTED DRIVE_KEEPS DRIVE_KEEPS_OTHER AS_BEFORE '
    'PERHAPS_CHANGED PUT_BACK NOT_PUT_BACK NOT_TRIED_ANY_MORE ENDED_HALF_WAY SEVERAL',
)


@dataclass(frozen=True, init=False)
class Report:
    """
    Something to be told, and what its sentence needs.

    :ivar values: by name: numbers, names and texts from elsewhere, other reports, and tuples of
        these.
    """

    cause: Cause
    values: Mapping[str, object]

    def __init__(self, cause: Cause, /, **values: object) -> None:
        object.__setattr__(self, 'cause', cause)
        object.__setattr__(self, 'values', values)

    def __str__(self) -> str:
        return f'{self.cause.name} {self.values}'


@dataclass(frozen=True)
class Event:
    """A report nobody asked for, and the inverter status shown at last, if there was one."""

    severity: Severity
    report: Report
    code: int | None

    @property
    def cause(self) -> Cause:
        """What it reports."""
        return self.report.cause


class DriveError(Exception):
    """A command was not carried out; made of a report, or of its cause and values."""

    def __init__(self, why: Report | Cause, /, **values: object) -> None:
        self.report = why if isinstance(why, Report) else Report(why, **values)
        super().__init__(self.report)

    @property
    def cause(self) -> Cause:
        """Why not."""
        return self.report.cause
