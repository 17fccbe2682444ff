# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The reports of a drive: a report has values, and its cause is the sentence for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import enum
import string
from typing import Any


class Severity(enum.Enum):
    """The severity of an event: the level of its log line."""

    INFO = 'info'
    WARNING = 'warning'
    ERROR = 'error'


_RUNS_ON = (
    '({why}): if this {{call.program}} is killed or the cable is cut, the motor runs on; {remedy}'
)
_NO_TIMEOUT = f'the drive has no time-out of its own {_RUNS_ON}'
_REMEDY = '{fault.description}. {fault.remedy}'
_GO_ON = 'then {call.enable} to go on'
_EMERGENCY = 'Use the {enable_input} or the emergency stop if it turns'


@enum.unique
class Cause(enum.Enum):
    """
    What happened, what was done, or what went wrong: the sentence for it.

    A field is a value of the report, ``call`` is :class:`Calls`. Short and active, the important
    word first: what happened, why, and what to do.
    """

    # --- the line, and what answers
    CONNECTED = 'connected: {drive}'
    DRIVER_ERROR = 'error in the driver: {error}'
    LINE_FAILED = '{error}'
    NOT_REACHED = '{error}: check the cable and that the drive has power'
    NO_RESPONSE = 'no response from address {address}{behind}: check in this order: {check}'
    NO_VALID_ANSWER = (
        'what comes from address {address} is no answer ({error}): check baud rate and parity, '
        'that no other master is on the line, and in this order: {check}'
    )
    TOO_LATE = 'no answer within {timeout:g} s'
    LOST = 'lost: {why}; retrying'
    LOST_IN_USE = f'lost: {{why}}; retrying; it is stopped as soon as it answers; {_GO_ON}'
    OLD_DATA = (
        "the drive's data in the PLC have not changed for {seconds:g} s or more (its life "
        'counter stands still): check the fieldbus between them and that the program of the '
        'PLC runs'
    )
    RESTARTED = 'the drive has started anew, as its boot-up message says: check its mains'
    TAKES_CONTROL = '{why}: a motor that the terminals run stops now'
    HELD_BY_LINE = (
        'control_method is monitor, but {why}: a motor that the terminals ran has stopped'
    )
    NOT_RECOGNISED = (
        'it is not known what is at address {address} ({why}): nothing is written there, no stop '
        'either, which could start another drive. Use its {enable_input} if its motor turns; check '
        'mains and cable, and that it is the drive that model or family says'
    )
    NONE_RECOGNISED = (
        'no stop was broadcast: no drive of this line was recognised since its port was opened'
    )
    OTHER_MODEL = '{error}: every {model} has {what}; is this another model? {call.set_model}'
    ANOTHER_DRIVE = 'this is no {title}: {why}; {call.set_model}'
    MADE_BY = 'it says that {vendor} has made it'
    IS_NOT = 'its {name} is {value}, and should be {values}'
    CANNOT_BE = 'its {name} is {value}, which cannot be'
    NOT_THE_MODEL = '{drive} answers, but not as a {model} does ({why}): is --model right?'
    METHOD_NEEDS = (
        'this drive has no {names}, which control_method {method} needs: {call.set_method} '
        '({others})'
    )
    NO_MAILBOX = 'parameters, error log and the names of faults are not reached: {why}'
    UNEXPECTED_IDENTITY = (
        'this drive identifies itself as a {model}, which no {title} does: {call.set_model}'
    )
    UNLISTED_MODEL = (
        'this drive says that it is a {model}, which the manual of the {title} does not list: '
        'check the model before the motor runs'
    )
    SEVERAL_MODELS = (
        'the drive at address {address} does not identify itself: set model to {models}'
    )
    FIRMWARE_NOT_ASKED = (
        'its firmware is not read while the bus has control, because firmware before {before:g} '
        'takes that for a fault: it is treated as older until it is connected to while the bus '
        'has no control; set classic_dialect to v2.03 or {dialect} to know it at once'
    )
    # --- why a command is not carried out
    MONITOR_ONLY = (
        'control_method is monitor: this driver only reads; set control_method to another one'
    )
    NOT_CONNECTED = 'the drive at address {address} is not connected'
    NOT_ACTIVE = 'the drive is not active'
    ENDING = 'this {call.program} is ending'
    NOT_POSSIBLE = '{why}'
    ENABLING_ALREADY = 'it is being enabled already'
    STOP_PENDING = 'a stop is on its way and not confirmed yet: wait for it, then enable'
    STOPPED_SINCE_ASKED = (
        'a stop was confirmed after this was requested: request it again if the motor shall run'
    )
    PROCEDURE_GOES_ON = '{what} is going on: wait for its end, or stop it'
    FAULT_FORBIDS = f'fault {{status}} is active: {_REMEDY}; then {{call.acknowledge}}'
    OTHER_METHOD_RUNS = (
        'the motor still runs by control_method {method} ({status}): another one has to wait '
        'until it stands still'
    )
    WRONG_CONTROL_MODE = (
        'the drive is in control mode {mode}, expected is {expected}: set {key} in the drive or '
        '{call.set_control_mode}'
    )
    NO_RUN_INPUT = (
        'the drive stays in standby: its {enable_input} is not active: close it, or its safety '
        'contact'
    )
    STAYS_IN_STANDBY = (
        'the drive stays in standby after the run command ({status}): check its enable input, and '
        'whether it takes the run command from the line'
    )
    START_FAULTED = 'the drive did not start: {status}'
    NOT_STARTED = 'the drive does not start: {status}'
    STOPPED_WHILE_ENABLING = 'it was stopped while it was being enabled'
    NOT_CONFIRMED = 'the drive did not carry out the command; its status is {status}'
    # --- enable, stop, acknowledge, release
    ENABLED = 'enabled; it follows set-points that arrive from now on'
    ENABLED_BY_OWN_REFERENCE = 'enabled; it follows its own reference ({reference})'
    ENABLED_ALREADY = 'is enabled already'
    STOPPED = 'stopped ({status})'
    STOPPED_BY_FAULT = 'stopped by fault {status}'
    STOP_BLOCKED = 'stopped by fault {status}; the drive refuses the stop until the fault is over'
    STOPPING = 'stopping ({status})'
    COASTING = 'stopping: it coasts'
    RAMPING = 'stopping: it ramps down'
    QUICK_STOPPED = 'released: the motor coasts'
    NO_QUICK_STOP = '{stop} (this drive has no quick stop)'
    RAPID_STOPPING = 'stopping: by its stop ramp ({status})'
    NOT_RAPID = (
        '{stop} (the drive takes its ordinary ramp, {status}: for the stop ramp open its '
        '{enable_input})'
    )
    NO_RAPID_STOP = '{stop} (this drive has no stop ramp of its own)'
    QUICK_STOP_UNCONFIRMED = 'the quick stop is NOT confirmed: {why} ({status}); trying a stop'
    NO_CONTROL = 'the bus has no control of this drive ({status}), and it does not run'
    RUN_BY_OTHERS = (
        'the bus has no control of this drive ({status}): stop it where it is controlled, by '
        'keypad or {enable_input}'
    )
    STOP_UNCONFIRMED = 'the stop is NOT confirmed: {why}; retrying'
    STOP_UNCONFIRMED_AT_END = 'the stop is NOT confirmed: this {call.program} is ending'
    CANNOT_STOP = f'CANNOT STOP THE MOTOR: {{why}}; retrying. {_EMERGENCY}'
    CANNOT_STOP_BUT_STANDS = (
        'the stop is NOT confirmed: {why}; retrying. The drive shows that the motor stands still '
        '({status}); the {enable_input} or the emergency stop keeps it so'
    )
    STOP_CONFIRMED_LATE = 'the stop is confirmed now: {status}'
    STOP_UNCLEAR = (
        'the stop is NOT confirmed: {why}, although its run command was removed and it was '
        'released. Look whether the motor turns: a load may drive it, or what is measured is not '
        'its speed. Use the {enable_input} or the emergency stop if it is driven'
    )
    STOP_FORCED = (
        'a normal stop had no effect ({why}): control was taken from the drive, or its motor was '
        'released ({status}). Find out why it did not stop, and whether another master commands '
        'it'
    )
    NOTHING_TO_ACKNOWLEDGE = 'nothing to acknowledge ({status})'
    ACKNOWLEDGED = 'acknowledged {status}'
    ACKNOWLEDGED_DETAILED = 'acknowledged {status} ({details})'
    STILL_FAULTED = f'{{status}} is still active: {_REMEDY}'
    NEXT_FAULT = 'acknowledged {acknowledged}, but {still}'
    NOT_IN_CONTROL = 'nothing to stop: the bus has no control of the drive'
    CONTROL_RELEASED = '{stop}; control released'
    COASTED_FOR_TIMEOUT = 'the motor coasts, for the time-out of the drive would end the ramp'
    CONTROL_KEPT = '{stop}; the bus keeps control: {why}'
    LEFT_TO_RAMP = '{stop}; it was left to its ramp, under bus control'
    RELEASE_BLOCKED = (
        'fault {status} is active and the drive takes no command: a run command may still be '
        'active when the fault is acknowledged'
    )
    ONLY_WATCHED = 'only watched'
    # --- what a stop that is not confirmed waits for
    NO_ANSWER_YET = 'no answer yet'
    TUNING_ENERGISES = 'the motor is energised by a tuning ({status})'
    TUNING_REFUSES = 'the motor is energised by a tuning ({status}): {error}'
    DRIVE_SAYS = 'the drive says {status}'
    UNKNOWN_STATUS = (
        'its status ({status}) is none that its manual or its file lists, and shows nothing: look '
        'at the drive what it does, and check that it is of this model'
    )
    RUN_COMMAND_STANDS = (
        'the run command stands in the drive ({status}), and the next set-point would turn the '
        'motor'
    )
    STILL_TURNS = (
        'the drive says {status}, and yet the motor turns at {now:.4g} {unit} and does not slow '
        'down'
    )
    # --- the motor is stopped by a command, and whose
    STOP_REQUESTED = 'a stop was requested: {by}'
    DISABLE_REQUESTED = 'a disable was requested: {by}'
    QUICK_STOP_REQUESTED = 'a quick stop was requested: {by}'
    STOP_ALL_REQUESTED = 'a stop of all drives was requested: {by}'
    ACKNOWLEDGE_REQUESTED = 'an acknowledgement stops the motor first: {by}'
    TRANSITION_REQUESTED = 'a transition was requested: {by}'
    DRIVER_ENDS = 'this {call.program} ends: {by}'
    STOPPED_WITH = 'it stops with {drive}: {why}'
    ENABLE_FAILED = 'the enable failed: {why}'
    PROCEDURE_ENDED = '{what} has ended'
    PROCEDURE_CANCELLED = '{what} was cancelled'
    # --- the motor is stopped without a command, and why
    STOPPED_BECAUSE = f'stopped: {{why}}; {_GO_ON}'
    STOPPED_BECAUSE_OF_FAULT = f'stopped: {{why}}; then {{call.acknowledge}}, {_GO_ON}'
    STOPPING_BECAUSE = 'stopping: {why}'
    FAULT = f'fault {{status}}: {_REMEDY}'
    FAULT_APPEARED = '{fault}; then {call.acknowledge}'
    CONTROL_MODE_CHANGED = (
        'the control mode was changed to {mode} at the drive, and set-points are in {unit} now: '
        'check what sends them'
    )
    SCALE_IMPOSSIBLE = (
        '{key} is {value:g}, and set-points or measured values are multiplied by it: set it first'
    )
    SCALE_NOT_FOLLOWED = (
        '{above} and {below} are {value}, and behind a PLC the driver does not take into account '
        'that speeds are multiplied by it: set both to 1, or {key} to Freque'
    )
    SCALE_CHANGED = (
        'what set-points or measured values are multiplied by was changed at the drive ({change}): '
        'check that it is right'
    )
    DRIVE_STARTING = 'the drive is starting ({status}): it was switched off and on; check its mains'
    RUN_INPUT_LOST = 'the {enable_input} of the drive was lost ({status}): close it'
    STOPPED_BY_ITSELF = (
        'the drive stopped by itself ({status}). Either its {enable_input} was lost or another '
        'master stopped it: close the input'
    )
    TERMINALS_IN_CONTROL = 'the terminals have control now ({status}): press STOP at the drive'
    KEYPAD_IN_CONTROL = 'the keypad has control now and runs the motor ({status}): press STOP there'
    OTHERS_IN_CONTROL = (
        'keypad or terminals have control now and run the motor ({status}): press STOP there'
    )
    POWER_CYCLED = (
        'the drive did not answer for a moment, and the bus has lost control ({status}). It was '
        'switched off and on: check its mains'
    )
    SLOWER_AFTER_SILENCE = (
        'the drive did not answer for a moment, and the motor turns slower than commanded '
        '({now:.4g} {unit}, before {before:.4g} {unit}; {status}). It may have been switched off '
        'and on: check its mains and the line'
    )
    MAY_HAVE_RESTARTED = (
        'the drive did not answer for so long that it may have been switched off and on, and it '
        'keeps its run command without power: check its mains and the line'
    )
    DRIVER_PAUSED = (
        'this {call.program} did not run for longer than the time-out of the drive itself '
        '({seconds:g} s), after which the drive stops the motor ({status}): check the load of the '
        'computer'
    )
    TURNS_BACKWARDS = (
        'the motor turns in the other direction than its set-points say ({now:.4g} {unit}, '
        '{status}). Another master may command the drive: find out which'
    )
    NOT_SLOWER_AFTER_TIME_OUT = (
        'no set-points arrive, and the motor does not slow down at set-point 0 ({now:.4g} '
        '{unit}, {status}). Check the least frequency that the drive is set to, and whether '
        'another master commands it'
    )
    CONTROL_LOST = (
        'the bus has lost control ({status}). STOP was pressed at the keypad, or another '
        'master took it away: find out which'
    )
    CONTROL_LOST_WHILE_AWAY = (
        'the bus has lost control meanwhile ({status}). The drive was '
        f'switched off and on, or its keypad was used: check its mains; {_GO_ON}'
    )
    CONTROL_WITHHELD = (
        'the PLC has withdrawn its release to ROS ({status}): set it again in the PLC'
    )
    RUNS_UNASKED = (
        'it runs under bus control although it was not enabled: find out whether another master '
        'commands it'
    )
    FOUND_RUNNING = (
        'the motor runs under bus control, started by an earlier session '
        f'({{status}}): stopping it; {_GO_ON}'
    )
    STARTED_AFTER_FAULT = (
        'the fault ended by itself or at the drive, and the motor started '
        f'by the run command that was still active ({{status}}): stopping it; {_GO_ON}'
    )
    # --- set-points
    SETPOINT_REFUSED = 'it refused set-point {value:g}: {error}'
    OWN_REFERENCE = (
        'set-point refused: reference is {reference}, so the drive follows none; set reference to '
        'fieldbus, where its control method has that'
    )
    SETPOINT_LIMITED = (
        'set-point {value:g} is limited to {limited:g} (setpoint_max, or the limit of the drive)'
    )
    SETPOINT_BEYOND_NOMINAL = (
        'set-point {value:g} is limited to {limited:g} {unit}, which is nominal for this motor: '
        'check in which unit it was meant; if the motor may go beyond, {call.set_setpoint_max}'
    )
    SETPOINT_TIMED_OUT = (
        'no set-point for {timeout:g} s: the motor ramps to a stop until the next one arrives; '
        'check what publishes them'
    )
    SETPOINTS_AGAIN = 'set-points arrive again'
    FASTER_THAN_SETPOINT = (
        'the motor turns at {now:.4g} {unit}, and its set-point is {setpoint:g} ({status}): the '
        'set-point is written again. Check whether the load drives the motor, and whether another '
        'master commands the drive'
    )
    # --- what the drive says of itself
    CURRENT_LIMITED = 'the current limit holds the motor back ({status}). {limit.remedy}'
    ALARM = 'alarm {status}: {alarm.description}. {alarm.remedy}'
    ALARM_UNNAMED = 'alarm, the status does not say which ({status}): see its display'
    ASLEEP = (
        'the drive sleeps ({status}), for its set-point is below its sleep frequency: a greater '
        'one wakes it'
    )
    IMPOSSIBLE_VALUE = (
        'implausible {key} = {value}: not published; check motor and scaling in the drive, and '
        'that no other master is on the line'
    )
    # --- the time-out of the drive itself
    NO_OWN_TIMEOUT = _NO_TIMEOUT.format(
        why='none is known of this model', remedy='use the {enable_input}'
    )
    OWN_TIMEOUT_OFF = _NO_TIMEOUT.format(
        why='{name} is 0, and {call.drive_timeout} {asked:g} leaves it so',
        remedy='{call.set_drive_timeout}',
    )
    OWN_TIMEOUT_STOPS_NOTHING = (
        'the time-out of the drive itself does not stop the motor '
        + _RUNS_ON.format(
            why='{found}', remedy='{call.set_drive_timeout}, which sets {wanted}'
        )
    )
    OWN_TIMEOUT_KEPT = (
        '{call.drive_timeout} is 0: the time-out of the drive itself ({name} {timeout:g} s) stays '
        'as it is'
    )
    OWN_TIMEOUT_SET = (
        'if this {call.program} is killed or the cable is cut, the drive stops the motor after '
        '{timeout:g} s ({name})'
    )
    OWN_TIMEOUT_UNKNOWN = (
        'the PLC stops the motor if this {call.program} dies; what the drive does if the PLC '
        'fails cannot be read here: {what}'
    )
    OWN_TIMEOUT_SHORT = (
        'the time-out of the drive itself ({name} {timeout:g} s) is less than lost_after + '
        '{margin:g} s: noise that this {call.program} waits out may stop the motor; '
        '{call.set_drive_timeout}, at least {least:g} s'
    )
    OWN_TIMEOUT_IMPOSSIBLE = (
        '{call.drive_timeout}: this model has no time-out of its own that can be set, so it must '
        'be 0'
    )
    OWN_TIMEOUT_OF_PLC = (
        '{call.drive_timeout}: through a PLC nothing is set at the drive; the PLC watches this '
        '{call.program}, and stops the motor {seconds:g} s after its last word, so it must be 0'
    )
    OWN_TIMEOUT_NOT_TAKEN = _NO_TIMEOUT.format(why='{why}', remedy='use the {enable_input}')
    OWN_TIMEOUT_LEFT = (
        'control stays with the bus, and the time-out of the drive itself ({name} {timeout:g} s) '
        'goes on: {why}. So it will have a fault after so long without requests; set {key} to 0 '
        'to prevent that'
    )
    OWN_TIMEOUT_NOT_PUT_BACK = (
        'the time-out of the drive itself ({name}) stays {timeout:g} s, which this {call.program} '
        'has set: {why}. The next clean end puts it back; set {key} as it was before, if another '
        'master needs that at once'
    )
    OWN_TIMEOUT_RECALLED = (
        'an earlier {call.program} was ended before it could put back the time-out of the drive '
        'itself ({names}): the end of this one does'
    )
    NOT_REMEMBERED = (
        'what this {call.program} sets in the drive and puts back at its end is not remembered '
        'elsewhere ({why}): if it is killed, or one before it was, check {keys}'
    )
    OWN_TIMEOUT_NOT_OURS = 'this {call.program} has not set it, and leaves it as it is'
    WATCH_LEFT = (
        'the drive may go on watching over this {call.program} ({by}): {why}. So it may have a '
        'fault {seconds:g} s after this end, which is acknowledged as any other'
    )
    # --- procedures
    UNKNOWN_PROCEDURE = (
        '{what} is not known of this model ({model}): its manual lists no command for it; do it '
        'at the keypad'
    )
    OTHER_METHOD_NEEDED = (
        '{what} needs {means}, and one session does not mix control methods: clean up, set '
        'control_method to {method} and configure again'
    )
    OTHER_PROCEDURE_GOES_ON = '{what}: {other} is going on already'
    MOTOR_ENABLED = '{what}: the motor is enabled: stop it first'
    STOP_NOT_CONFIRMED_YET = '{what}: a stop is not confirmed yet'
    MOTOR_RUNS = '{what}: the motor runs ({status}): stop it first'
    CONTROL_INHIBITED = (
        '{what}: the drive lets no one take control now ({status}; {name} is Inhibit)'
    )
    CONTROLLED_LOCALLY = (
        '{what}: keypad or terminals have control ({status}), and giving it back to them could '
        'start the motor: press STOP at the drive first'
    )
    NO_STANDBY = '{what}: the drive does not stand by: {status}'
    PROCEDURE_STOPPED = '{what} was stopped'
    PROCEDURE_NOT_BEGUN = '{what} was stopped before it began'
    INTERRUPTED = '{signal}: not begun'
    SPEED_SCALE = (
        'the drive multiplies the speeds of the bus by {scale}: the driver takes that into '
        'account, and set-points and values are in rpm'
    )
    TUNING_BEGINS = '{what} begins: the motor is energised'
    TUNING_NEEDS = '{what} needs {key}: set it as the motor plate says'
    TUNED = '{what} finished ({status})'
    TUNING_WITHOUT_RESULT = (
        '{what} ended in standby ({status}) and has changed no parameter: the {enable_input} may '
        'have been lost meanwhile; repeat it if it was'
    )
    TUNING_FAILED = f'{{what}} failed, {{status}}: {_REMEDY}; {{call.acknowledge}} first'
    TUNING_STOPPED = '{what} was stopped before it was finished ({status})'
    TUNING_CUT_SHORT = (
        '{what} ended, and the drive does not say that it has finished ({status}): was the '
        '{enable_input} lost, or STOP pressed?'
    )
    TUNING_DOES_NOT_BEGIN = '{what} does not begin ({status}): is its {enable_input} active?'
    TUNING_ENDLESS = '{what} has not finished in time ({status}): stopping it'
    TUNING_CHANGED = '{how}; changed: {changes}'
    LOG_ERASED = 'the error log is erased'
    LOG_NOT_ERASED = 'the drive took the command, but its error log is not empty'
    ENERGY_RESET = '{key}: {before:.3f} -> {after:.3f} kWh'
    ENERGY_NOT_RESET = 'the drive took the command, but {key} is {energy:g} kWh'
    ENERGY_RESET_UNKNOWN = '{what} came with firmware {since:.2f}; this drive has {firmware}'
    # --- the error log
    LOG_ENTRY = 'error log: {entry}'
    LOG_ENTRY_UNSEEN = 'error log: {entry} (missed by polling)'
    LOG_UNDOCUMENTED = 'the error log of this model ({model}) is not documented'
    LOG_NOT_WATCHED = 'its error log is not watched: {error}'
    LOG_CHANGES = 'the drive writes into its error log all the time: try again'
    # --- the settings of the drive
    SETTINGS_READ = 'parameters: {progress} in {seconds:.1f} s'
    SETTINGS_BEING_READ = 'parameters: {progress}'
    SETTINGS_REFRESHED = '{count} parameters read, changed: {changed}'
    SETTING_UNREADABLE = '{key} cannot be read: {error}'
    OPTIONS_MISSING = (
        'parameters: {count} are left out, for the drive has none of the option cards that they '
        'need ({options})'
    )
    CHANGED = '{change}'
    CHANGED_FOR_TIMEOUT = '{change} ({call.drive_timeout})'
    STORED = (
        '{key} ({name}) was changed to take control, and stays so: {old} -> {new}'
    )
    CHANGED_AS_WANTED = '{change}, as the parameter file says'
    CHANGED_AT_DRIVE = 'changed at the drive: {change}'
    NOT_AS_WANTED = '{key} is {has} in the drive, but {wanted} was given: not changed'
    WANTED_BUT_MISSING = 'this drive has no {keys}: not applied'
    WANTED_BUT_REFUSED = 'not applied from the parameter file: {why}'
    NO_SETTING = '{key} is no parameter that can be changed here'
    NOT_CHANGED = '{key}: {why}'
    CHANGE_WHILE_TUNING = 'the drive is tuning: wait for its end, or stop it'
    COMMUNICATION_PROTECTED = (
        'communication settings are not changed unless allow_communication_changes is true, for '
        'the driver may lose the drive'
    )
    CODES_UNCERTAIN = (
        'what its codes mean in firmware {firmware:.2f} is not known for sure: change it at the '
        'keypad'
    )
    FOLLOW_THE_LINE = (
        'the drive uses the new settings of the line from its next power-up on, or at once: then '
        'start this driver with the {settings} that it has'
    )
    STANDSTILL_NEEDED = 'only while the motor is stopped, but it is not ({status})'
    NOT_WHILE_ENABLED = (
        'the motor is enabled, and might not follow its commands after that: stop it first'
    )
    VALUE_NOT_ACCEPTED = 'the drive does not accept {value}{behind}'
    RELEASE_NEEDED = '{why}; {call.quick_stop}, then change it before it is enabled again'
    REFUSED_WHILE_RUNNING = '{why}: the motor must be stopped for this, and it runs'
    REFUSED_WHILE_FAULTED = '{why}; fault {status} is active: {call.acknowledge} first'
    DRIVE_KEEPS = 'the drive keeps {value}'
    DRIVE_KEEPS_OTHER = 'the drive keeps {value} where {written} was written'
    AS_BEFORE = 'it is {value} as before'
    PERHAPS_CHANGED = 'whether the drive took {value} is not known'
    PUT_BACK = 'put back: {keys}'
    NOT_PUT_BACK = '{key} is NOT put back to {value}: {why}'
    NOT_TRIED_ANY_MORE = 'not tried any more'
    ENDED_HALF_WAY = 'ended half-way, NOT put back: {changes}'
    SEVERAL = '{reports}'


@dataclass(frozen=True, init=False)
class Report:
    """
    What is reported: a cause, and the values of its sentence.

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
    """A report that no command requested, and the last inverter status, if there was one."""

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


#: The text for an empty value, by its name.
_IF_EMPTY = {
    'status': 'its status is not known',
    'mode': '?',
    'unit': 'another unit',
    'firmware': 'an older one',
    'changed': 'none',
    'changes': 'no parameter',
}


@dataclass(frozen=True)
class Calls:
    """
    What an operator calls, types or sets, as parts of sentences; by full names, to be pasted.

    :ivar acknowledge: such as ``call /infeed/fault_ack``.
    :ivar enable: likewise.
    :ivar quick_stop: likewise; it leaves the motor released.
    :ivar program: what this program is called.
    :ivar drive_timeout: the name of that setting.
    :ivar set_drive_timeout: such as ``set drive_timeout``.
    :ivar set_setpoint_max: how to let set-points go beyond what is nominal.
    :ivar set_control_mode: how to expect another control mode.
    :ivar set_model: how to correct the model.
    :ivar set_method: how to choose another control method.
    """

    acknowledge: str
    enable: str
    quick_stop: str
    program: str
    drive_timeout: str
    set_drive_timeout: str
    set_setpoint_max: str
    set_control_mode: str
    set_model: str
    set_method: str


class _Formatter(string.Formatter):
    def __init__(self, calls: Calls) -> None:
        self._calls = calls

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> Any:
        value, name = super().get_field(field_name, args, kwargs)
        return (_IF_EMPTY.get(field_name, value) if value in ('', ()) else value), name

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, Report):
            return sentence(value, self._calls)
        if isinstance(value, tuple):
            between = '; ' if isinstance(value[0], Report) else ', '
            return between.join(self.format_field(one, format_spec) for one in value)
        return str(super().format_field(value, format_spec))


def sentence(report: Report, calls: Calls) -> str:
    """Return the sentence of a report."""
    values = {**report.values, 'call': calls}
    return _Formatter(calls).vformat(report.cause.value, (), values)
