# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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


class Cause(enum.Enum):
    """What happened, what was done, or what went wrong; the wording has a sentence for each."""

    # --- the line and who answers
    CONNECTED = enum.auto()
    DRIVER_ERROR = enum.auto()
    #: What the link says needs nothing added.
    LINE_FAILED = enum.auto()
    #: The same of a drive that has answered before.
    NOT_REACHED = enum.auto()
    NO_RESPONSE = enum.auto()
    NO_VALID_ANSWER = enum.auto()
    #: The command takes longer than whoever gave it waits.
    TOO_LATE = enum.auto()
    LOST = enum.auto()
    LOST_IN_USE = enum.auto()
    #: It answers, but not as one of its model.
    NOT_THE_MODEL = enum.auto()
    #: It lacks a parameter that every drive of its model has.
    OTHER_MODEL = enum.auto()
    #: It says who it is, and no drive of its model does.
    UNEXPECTED_IDENTITY = enum.auto()
    SEVERAL_MODELS = enum.auto()
    FIRMWARE_NOT_ASKED = enum.auto()

    # --- why a command is not carried out
    MONITOR_ONLY = enum.auto()
    NOT_CONNECTED = enum.auto()
    NOT_ACTIVE = enum.auto()
    ENDING = enum.auto()
    #: What the profile of the family says of it.
    NOT_POSSIBLE = enum.auto()
    ENABLING_ALREADY = enum.auto()
    STOP_PENDING = enum.auto()
    PROCEDURE_GOES_ON = enum.auto()
    FAULT_FORBIDS = enum.auto()
    OTHER_METHOD_RUNS = enum.auto()
    WRONG_CONTROL_MODE = enum.auto()
    NO_RUN_INPUT = enum.auto()
    START_FAULTED = enum.auto()
    NOT_STARTED = enum.auto()
    STOPPED_WHILE_ENABLING = enum.auto()
    #: The status does not become what it should.
    NOT_CONFIRMED = enum.auto()

    # --- enable, stop, acknowledge, release
    ENABLED = enum.auto()
    ENABLED_BY_OWN_REFERENCE = enum.auto()
    ENABLED_ALREADY = enum.auto()
    STOPPED = enum.auto()
    STOPPED_BY_FAULT = enum.auto()
    #: The same, and the drive takes no command until the fault is over.
    STOP_BLOCKED = enum.auto()
    STOPPING = enum.auto()
    COASTING = enum.auto()
    RAMPING = enum.auto()
    QUICK_STOPPED = enum.auto()
    NO_QUICK_STOP = enum.auto()
    QUICK_STOP_UNCONFIRMED = enum.auto()
    NO_CONTROL = enum.auto()
    #: Others run the motor.
    RUN_BY_OTHERS = enum.auto()
    STOP_UNCONFIRMED = enum.auto()
    STOP_UNCONFIRMED_AT_END = enum.auto()
    CANNOT_STOP = enum.auto()
    STOP_CONFIRMED_LATE = enum.auto()
    NOTHING_TO_ACKNOWLEDGE = enum.auto()
    ACKNOWLEDGED = enum.auto()
    #: The drive has said more of the fault.
    ACKNOWLEDGED_DETAILED = enum.auto()
    STILL_FAULTED = enum.auto()
    NEXT_FAULT = enum.auto()
    NOT_IN_CONTROL = enum.auto()
    CONTROL_RELEASED = enum.auto()
    #: Instead of another stop, when control is released.
    COASTED_FOR_TIMEOUT = enum.auto()
    #: The motor stands, and the bus keeps control for a reason of the family's.
    CONTROL_KEPT = enum.auto()
    LEFT_TO_RAMP = enum.auto()
    RELEASE_BLOCKED = enum.auto()
    ONLY_WATCHED = enum.auto()

    # --- what a stop that is not confirmed waits for
    NO_ANSWER_YET = enum.auto()
    TUNING_ENERGISES = enum.auto()
    TUNING_REFUSES = enum.auto()
    DRIVE_SAYS = enum.auto()

    # --- the motor is stopped without a command, and why
    STOPPED_BECAUSE = enum.auto()
    STOPPED_BECAUSE_OF_FAULT = enum.auto()
    #: Said before the drive is lost, so that no status can tell a better reason.
    STOPPING_BECAUSE = enum.auto()
    FAULT = enum.auto()
    FAULT_APPEARED = enum.auto()
    CONTROL_MODE_CHANGED = enum.auto()
    DRIVE_STARTING = enum.auto()
    RUN_INPUT_LOST = enum.auto()
    STOPPED_BY_ITSELF = enum.auto()
    TERMINALS_IN_CONTROL = enum.auto()
    KEYPAD_IN_CONTROL = enum.auto()
    OTHERS_IN_CONTROL = enum.auto()
    POWER_CYCLED = enum.auto()
    CONTROL_LOST = enum.auto()
    CONTROL_LOST_WHILE_AWAY = enum.auto()
    RUNS_UNASKED = enum.auto()
    FOUND_RUNNING = enum.auto()
    STARTED_AFTER_FAULT = enum.auto()

    # --- set-points
    SETPOINT_REFUSED = enum.auto()
    OWN_REFERENCE = enum.auto()
    SETPOINT_LIMITED = enum.auto()
    SETPOINT_TIMED_OUT = enum.auto()
    SETPOINTS_AGAIN = enum.auto()
    BROADCAST_MISSED = enum.auto()
    NO_BROADCAST = enum.auto()
    MEMBER_MONITORED = enum.auto()
    MEMBER_BY_OWN_REFERENCE = enum.auto()
    MEMBER_NOT_ENABLED = enum.auto()
    MEMBER_TAKES_SEVERAL_WRITES = enum.auto()
    MEMBERS_DIFFER = enum.auto()
    MEMBERS_WRITTEN_DIFFERENTLY = enum.auto()
    SHARED_SETPOINT_LIMITED = enum.auto()

    # --- what the drive says of itself
    CURRENT_LIMITED = enum.auto()
    ALARM = enum.auto()
    ALARM_UNNAMED = enum.auto()
    ASLEEP = enum.auto()
    IMPOSSIBLE_VALUE = enum.auto()

    # --- the time-out of the drive itself
    NO_OWN_TIMEOUT = enum.auto()
    OWN_TIMEOUT_OFF = enum.auto()
    OWN_TIMEOUT_STOPS_NOTHING = enum.auto()
    OWN_TIMEOUT_SHORT = enum.auto()
    OWN_TIMEOUT_LATER = enum.auto()
    OWN_TIMEOUT_IMPOSSIBLE = enum.auto()

    # --- procedures
    UNKNOWN_PROCEDURE = enum.auto()
    OTHER_METHOD_NEEDED = enum.auto()
    OTHER_PROCEDURE_GOES_ON = enum.auto()
    MOTOR_ENABLED = enum.auto()
    STOP_NOT_CONFIRMED_YET = enum.auto()
    MOTOR_RUNS = enum.auto()
    CONTROL_INHIBITED = enum.auto()
    CONTROLLED_LOCALLY = enum.auto()
    NO_STANDBY = enum.auto()
    PROCEDURE_STOPPED = enum.auto()
    PROCEDURE_NOT_BEGUN = enum.auto()
    #: By a signal, before it was begun.
    INTERRUPTED = enum.auto()
    TUNING_BEGINS = enum.auto()
    TUNING_NEEDS = enum.auto()
    TUNED = enum.auto()
    TUNING_FAILED = enum.auto()
    TUNING_STOPPED = enum.auto()
    TUNING_CUT_SHORT = enum.auto()
    TUNING_DOES_NOT_BEGIN = enum.auto()
    TUNING_ENDLESS = enum.auto()
    TUNING_CHANGED = enum.auto()
    LOG_ERASED = enum.auto()
    LOG_NOT_ERASED = enum.auto()
    ENERGY_RESET = enum.auto()
    ENERGY_NOT_RESET = enum.auto()
    ENERGY_RESET_UNKNOWN = enum.auto()

    # --- the error log
    LOG_ENTRY = enum.auto()
    LOG_ENTRY_UNSEEN = enum.auto()
    LOG_UNDOCUMENTED = enum.auto()
    LOG_NOT_WATCHED = enum.auto()
    LOG_CHANGES = enum.auto()

    # --- the settings of the drive
    SETTINGS_READ = enum.auto()
    SETTINGS_BEING_READ = enum.auto()
    SETTINGS_REFRESHED = enum.auto()
    SETTING_UNREADABLE = enum.auto()
    OPTIONS_MISSING = enum.auto()
    #: What the drive has means nothing, or it cannot have what was asked for.
    BAD_VALUE = enum.auto()
    CHANGED = enum.auto()
    CHANGED_FOR_TIMEOUT = enum.auto()
    #: By taking control, to a memory that wears out.
    STORED = enum.auto()
    CHANGED_AS_WANTED = enum.auto()
    CHANGED_AT_DRIVE = enum.auto()
    NOT_AS_WANTED = enum.auto()
    WANTED_BUT_MISSING = enum.auto()
    WANTED_BUT_REFUSED = enum.auto()
    NO_SETTING = enum.auto()
    #: One setting was not changed, for what reason.
    NOT_CHANGED = enum.auto()
    CHANGE_WHILE_TUNING = enum.auto()
    COMMUNICATION_PROTECTED = enum.auto()
    CODES_UNCERTAIN = enum.auto()
    FOLLOW_THE_LINE = enum.auto()
    STANDSTILL_NEEDED = enum.auto()
    VALUE_NOT_ACCEPTED = enum.auto()
    REFUSED_WHILE_RUNNING = enum.auto()
    REFUSED_WHILE_FAULTED = enum.auto()
    DRIVE_KEEPS = enum.auto()
    DRIVE_KEEPS_OTHER = enum.auto()
    AS_BEFORE = enum.auto()
    PERHAPS_CHANGED = enum.auto()
    PUT_BACK = enum.auto()
    NOT_PUT_BACK = enum.auto()
    NOT_TRIED_ANY_MORE = enum.auto()
    ENDED_HALF_WAY = enum.auto()
    #: Several reports, one after the other.
    SEVERAL = enum.auto()


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
    """
    A report on a drive that nobody has asked for.

    :ivar code: the inverter status that the drive showed at last; ``None`` before it has any.
    """

    severity: Severity
    report: Report
    code: int | None

    @property
    def cause(self) -> Cause:
        """What it reports."""
        return self.report.cause


class DriveError(Exception):
    """A command was not carried out."""

    def __init__(self, report: Report) -> None:
        super().__init__(report)
        self.report = report

    @property
    def cause(self) -> Cause:
        """Why not."""
        return self.report.cause
