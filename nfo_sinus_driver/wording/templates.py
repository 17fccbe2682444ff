# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The sentence for each cause; a field is a value of the report, ``call`` is :class:`.Calls`.

Short and active, the important word first: what happened, why, and what to do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import string
from typing import Any

from nfo_sinus_driver.drive.events import Cause, Report

_NO_TIMEOUT = (
    'the drive has no time-out of its own ({why}): if this {{call.program}} is killed or the cable '
    'is cut, the motor runs on; {remedy}'
)
_REMEDY = '{fault.description}. {fault.remedy}'
_GO_ON = 'then {call.enable} to go on'
_EMERGENCY = 'Use the {enable_input} or the emergency stop if it turns'

TEMPLATES: Mapping[Cause, str] = {
    # --- the line and who answers
    Cause.CONNECTED: 'connected: {drive}',
    Cause.DRIVER_ERROR: 'error in the driver: {error}',
    Cause.LINE_FAILED: '{error}',
    Cause.NOT_REACHED: '{error}: check the cable and that the drive has power',
    Cause.NO_RESPONSE: 'no response from address {address}{behind}: check in this order: '
    '{check}',
    Cause.NO_VALID_ANSWER: 'what comes from address {address} is no answer ({error}): check baud '
    'rate and parity, that no other master is on the line, and the wiring',
    Cause.TOO_LATE: 'no answer within {timeout:g} s',
    Cause.LOST: 'lost: {why}; retrying',
    Cause.LOST_IN_USE: f'lost: {{why}}; retrying, and stopped as soon as it answers; {_GO_ON}',
    Cause.OLD_DATA: 'the data from the drive stand still in the PLC for {seconds:g} s or more (its '
    'life counter does not change): check the fieldbus between them and that the program of the '
    'PLC runs',
    Cause.RESTARTED: 'the drive has started anew, as its boot-up message says: check its mains',
    Cause.HELD_BY_LINE: 'only watched, and yet {why}: a motor that the terminals ran has stopped',
    Cause.OTHER_MODEL: '{error}: every {model} has it; is this another model? {call.set_model}',
    Cause.NOT_THE_MODEL: '{drive} answers, but not as a {model} does ({why}): is --model right?',
    Cause.UNEXPECTED_IDENTITY: 'this drive says that it is a {model}; no {title} says anything: '
    '{call.set_model}',
    Cause.SEVERAL_MODELS: 'the drive at address {address} does not tell what it is: '
    'set model to {models}',
    Cause.FIRMWARE_NOT_ASKED: 'its firmware is not asked for while the bus has control, which '
    'firmware before {before:g} takes for a fault: it is treated like that one until it is '
    'connected to while the bus has no control; set classic_dialect to v2.03 or {dialect} to know '
    'it at once',
    # --- why a command is not carried out
    Cause.MONITOR_ONLY: 'control_method is monitor: this driver only reads; set control_method to '
    'another one',
    Cause.NOT_CONNECTED: 'the drive at address {address} is not connected',
    Cause.NOT_ACTIVE: 'the drive is not active',
    Cause.ENDING: 'this {call.program} is ending',
    Cause.NOT_POSSIBLE: '{why}',
    Cause.ENABLING_ALREADY: 'it is being enabled already',
    Cause.STOP_PENDING: 'a stop is on its way and not confirmed yet: wait for it, then enable',
    Cause.STOPPED_SINCE_ASKED: (
        'a stop was confirmed after this was asked for: ask again if the motor shall run'
    ),
    Cause.PROCEDURE_GOES_ON: '{what} is going on: wait for its end, or stop it',
    Cause.FAULT_FORBIDS: f'fault {{status}} is active: {_REMEDY}; then {{call.acknowledge}}',
    Cause.OTHER_METHOD_RUNS: 'the motor still runs by control_method {method} ({status}): another '
    'one has to wait until it stands',
    Cause.WRONG_CONTROL_MODE: 'the drive is in control mode {mode}, expected is {expected}: set '
    '{key} in the drive or {call.set_control_mode}',
    Cause.NO_RUN_INPUT: 'the drive stays in standby: its {enable_input} is not active: close '
    'it, or its safety contact',
    Cause.START_FAULTED: 'the drive did not start: {status}',
    Cause.NOT_STARTED: 'the drive does not start: {status}',
    Cause.STOPPED_WHILE_ENABLING: 'it was stopped while it was being enabled',
    Cause.NOT_CONFIRMED: 'the drive does not do it; it says {status}',
    # --- enable, stop, acknowledge, release
    Cause.ENABLED: 'enabled; it follows set-points that arrive from now on',
    Cause.ENABLED_BY_OWN_REFERENCE: 'enabled; it follows its own reference ({reference})',
    Cause.ENABLED_ALREADY: 'is enabled already',
    Cause.STOPPED: 'stopped ({status})',
    Cause.STOPPED_BY_FAULT: 'stopped by fault {status}',
    Cause.STOP_BLOCKED: 'stopped by fault {status}; what the drive refuses now is done when it is '
    'over',
    Cause.STOPPING: 'stopping ({status})',
    Cause.COASTING: 'stopping: it coasts',
    Cause.RAMPING: 'stopping: it ramps down',
    Cause.QUICK_STOPPED: 'released: the motor coasts',
    Cause.NO_QUICK_STOP: '{stop} (this drive has no quick stop)',
    Cause.QUICK_STOP_UNCONFIRMED: 'the quick stop is NOT confirmed: {why} ({status}); trying a '
    'stop',
    Cause.NO_CONTROL: 'the bus has no control of this drive ({status}), and it does not run',
    Cause.RUN_BY_OTHERS: 'the bus has no control of this drive ({status}): stop it where it is '
    'controlled, by keypad or {enable_input}',
    Cause.STOP_UNCONFIRMED: 'the stop is NOT confirmed: {why}; retrying',
    Cause.STOP_UNCONFIRMED_AT_END: 'the stop is NOT confirmed: this {call.program} is ending',
    Cause.CANNOT_STOP: f'CANNOT STOP THE MOTOR: {{why}}; retrying. {_EMERGENCY}',
    Cause.CANNOT_STOP_BUT_STANDS: 'the stop is NOT confirmed: {why}; retrying. The drive shows '
    'that the motor stands ({status}); the {enable_input} or the emergency stop keeps it so',
    Cause.STOP_CONFIRMED_LATE: 'the stop is confirmed now: {status}',
    Cause.STOP_FORCED: 'an ordinary stop did not do ({why}): control was taken from the drive, or '
    'its motor was released ({status}). Find out why it did not stop, and whether another master '
    'commands it',
    Cause.NOTHING_TO_ACKNOWLEDGE: 'nothing to acknowledge ({status})',
    Cause.ACKNOWLEDGED: 'acknowledged {status}',
    Cause.ACKNOWLEDGED_DETAILED: 'acknowledged {status} ({details})',
    Cause.STILL_FAULTED: f'{{status}} is still active: {_REMEDY}',
    Cause.NEXT_FAULT: 'acknowledged {acknowledged}, but {still}',
    Cause.NOT_IN_CONTROL: 'not under bus control',
    Cause.CONTROL_RELEASED: '{stop}; control released',
    Cause.COASTED_FOR_TIMEOUT: 'released to coast, for the time-out of the drive would end the '
    'ramp',
    Cause.CONTROL_KEPT: '{stop}; the bus keeps control: {why}',
    Cause.LEFT_TO_RAMP: '{stop}; it was left to its ramp, under bus control',
    Cause.RELEASE_BLOCKED: 'fault {status} is active and the drive takes no command: a run command '
    'may still stand in it when the fault is acknowledged',
    Cause.ONLY_WATCHED: 'only watched',
    # --- what a stop that is not confirmed waits for
    Cause.NO_ANSWER_YET: 'no answer yet',
    Cause.TUNING_ENERGISES: 'the motor is energised by a tuning ({status})',
    Cause.TUNING_REFUSES: 'the motor is energised by a tuning ({status}): {error}',
    Cause.DRIVE_SAYS: 'the drive says {status}',
    # --- the motor is stopped without a command, and why
    Cause.STOPPED_BECAUSE: f'stopped: {{why}}; {_GO_ON}',
    Cause.STOPPED_BECAUSE_OF_FAULT: f'stopped: {{why}}; then {{call.acknowledge}}, {_GO_ON}',
    Cause.STOPPING_BECAUSE: 'stopping: {why}',
    Cause.FAULT: f'fault {{status}}: {_REMEDY}',
    Cause.FAULT_APPEARED: '{fault}; then {call.acknowledge}',
    Cause.CONTROL_MODE_CHANGED: 'the control mode was changed to {mode} at the drive, and '
    'set-points are in {unit} now: check what sends them',
    Cause.DRIVE_STARTING: 'the drive is starting ({status}): it was switched off and on; check its '
    'mains',
    Cause.RUN_INPUT_LOST: 'the {enable_input} of the drive was lost ({status}): close it',
    Cause.STOPPED_BY_ITSELF: 'the drive stopped by itself ({status}). Either its {enable_input} '
    'was lost or another master stopped it: close the input',
    Cause.TERMINALS_IN_CONTROL: 'the terminals have control now ({status}): press STOP at the '
    'drive',
    Cause.KEYPAD_IN_CONTROL: 'the keypad has control now and runs the motor ({status}): press STOP '
    'there',
    Cause.OTHERS_IN_CONTROL: 'keypad or terminals have control now and run the motor ({status}): '
    'press STOP there',
    Cause.POWER_CYCLED: 'the drive did not answer for a moment, and the bus has lost control '
    '({status}). It was switched off and on: check its mains',
    Cause.SLOWER_AFTER_SILENCE: 'the drive did not answer for a moment, and the motor turns slower '
    'than it was told to ({now:g} Hz, before {before:g} Hz; {status}). It may have been switched '
    'off and on: check its mains and the line',
    Cause.TURNS_BACKWARDS: 'the motor turns in the other direction than its set-points say '
    '({now:.4g} Hz, {status}). Another master may command the drive: find out which',
    Cause.NOT_SLOWER_AFTER_TIME_OUT: 'no set-points arrive, and the motor does not slow down at '
    'set-point 0 ({now:.4g} Hz, {status}). Check the least frequency that the drive is set to, and '
    'whether another master commands it',
    Cause.CONTROL_LOST: 'the bus has lost control ({status}). Somebody pressed STOP at the keypad, '
    'or another master took it away: find out who',
    Cause.CONTROL_LOST_WHILE_AWAY: 'the bus has lost control meanwhile ({status}). The drive was '
    f'switched off and on, or somebody used its keypad: check its mains; {_GO_ON}',
    Cause.CONTROL_WITHHELD: 'the PLC has taken the release to ROS back ({status}): give it in the '
    'PLC',
    Cause.RUNS_UNASKED: 'it runs under bus control although nobody enabled it: find out whether '
    'another master commands it',
    Cause.FOUND_RUNNING: 'the motor runs under bus control, started by an earlier session '
    f'({{status}}): stopping it; {_GO_ON}',
    Cause.STARTED_AFTER_FAULT: 'the fault ended by itself or at the drive, and the motor started '
    f'by the run command that stood there ({{status}}): stopping it; {_GO_ON}',
    # --- set-points
    Cause.SETPOINT_REFUSED: 'it refused set-point {value:g}: {error}',
    Cause.OWN_REFERENCE: 'set-point refused: reference is {reference}, so the drive follows none; '
    'set reference to fieldbus, where its control method has that',
    Cause.SETPOINT_LIMITED: 'set-point {value:g} is limited to {limited:g} (setpoint_max, or the '
    'limit of the drive)',
    Cause.SETPOINT_BEYOND_NOMINAL: 'set-point {value:g} is limited to {limited:g} {unit}, which is '
    'nominal for this motor: check in which unit it was meant; if the motor may go beyond, '
    '{call.set_setpoint_max}',
    Cause.SETPOINT_TIMED_OUT: 'no set-point for {timeout:g} s: the motor ramps to a stop until the '
    'next one arrives; check what publishes them',
    Cause.SETPOINTS_AGAIN: 'set-points arrive again',
    Cause.FASTER_THAN_TOLD: 'the motor turns at {now:.4g} {unit}, and its set-point is {told:g} '
    '({status}): the set-point is written again. Check whether the load drives the motor, and '
    'whether another master commands the drive',
    Cause.BROADCAST_MISSED: 'it did not take the set-point for all drives: it keeps {value:g}; it '
    'is given its own',
    Cause.NO_BROADCAST: 'only the Classic protocol has set-points for all drives at once: publish '
    'one to each drive',
    Cause.MEMBER_MONITORED: '{name} is only monitored',
    Cause.MEMBER_BY_OWN_REFERENCE: '{name} follows a reference of its own ({reference})',
    Cause.MEMBER_NOT_ENABLED: '{name} is not enabled',
    Cause.MEMBER_TAKES_SEVERAL_WRITES: '{name} takes a set-point in several writes',
    Cause.MEMBERS_DIFFER: 'it would not mean the same to all drives ({meanings})',
    Cause.MEMBERS_WRITTEN_DIFFERENTLY: 'it would not be written alike to all drives ({names})',
    Cause.SHARED_SETPOINT_LIMITED: '{value:g} is limited to {limited:g}, the least that a drive '
    'allows ({name})',
    # --- what the drive says of itself
    Cause.CURRENT_LIMITED: 'the current limit holds the motor back ({status}). {limit.remedy}',
    Cause.ALARM: 'alarm {status}: {alarm.description}. {alarm.remedy}',
    Cause.ALARM_UNNAMED: 'alarm, the status does not say which ({status}): see its display',
    Cause.ASLEEP: 'the drive sleeps ({status}), for its set-point is below its sleep frequency: a '
    'greater one wakes it',
    Cause.IMPOSSIBLE_VALUE: 'it says that {key} is {value}, which cannot be: that is not '
    'published; check motor and scaling in the drive, and that no other master is on the line',
    # --- the time-out of the drive itself
    Cause.NO_OWN_TIMEOUT: _NO_TIMEOUT.format(
        why='none is known of this model', remedy='use the {enable_input}'
    ),
    Cause.OWN_TIMEOUT_OFF: _NO_TIMEOUT.format(
        why='{name} is 0', remedy='{call.set_drive_timeout}'
    ),
    Cause.OWN_TIMEOUT_STOPS_NOTHING: _NO_TIMEOUT.format(
        why='{name} is OFF', remedy='{call.set_drive_timeout}'
    ),
    Cause.OWN_TIMEOUT_UNKNOWN: 'the PLC stops the motor if this {call.program} dies; what the '
    'drive does if the PLC does, nobody here can read: {what}',
    Cause.OWN_TIMEOUT_SHORT: 'the time-out of the drive itself ({name} {timeout:g} s) is less than '
    'lost_after + {margin:g} s: noise that this {call.program} waits out may stop the '
    'motor; {call.set_drive_timeout}, at least {least:g} s',
    Cause.OWN_TIMEOUT_LATER: '{call.drive_timeout} cannot be set yet, and will be when it is '
    'enabled: {why}',
    Cause.OWN_TIMEOUT_IMPOSSIBLE: '{call.drive_timeout}: this model has no time-out of its own '
    'that can be set, so it must be 0',
    Cause.OWN_TIMEOUT_OF_PLC: '{call.drive_timeout}: through a PLC nothing is set at the drive; '
    'the PLC watches this {call.program}, and stops the motor {seconds:g} s after its last word, '
    'so it must be 0',
    Cause.OWN_TIMEOUT_NOT_TAKEN: _NO_TIMEOUT.format(
        why='{why}', remedy='use the {enable_input}'
    ),
    Cause.OWN_TIMEOUT_LEFT: 'control stays with the bus, and the time-out of the drive itself '
    '({name} {timeout:g} s) goes on: {why}. So it will have a fault when nothing is said to it for '
    'so long; set {key} to 0 if it shall not',
    Cause.OWN_TIMEOUT_NOT_OURS: 'this {call.program} has not set it, and leaves it as it is',
    Cause.WATCH_LEFT: 'the drive may go on watching over this {call.program} ({by}): {why}. So it '
    'may have a fault {seconds:g} s after this end, which is acknowledged as any other',
    # --- procedures
    Cause.UNKNOWN_PROCEDURE: '{what} is not known of this model ({model}): its manual lists no '
    'command for it; do it at the keypad',
    Cause.OTHER_METHOD_NEEDED: '{what} needs {means}, and one session does not mix control '
    'methods: clean up, set control_method to {method} and configure again',
    Cause.OTHER_PROCEDURE_GOES_ON: '{what}: {other} is going on already',
    Cause.MOTOR_ENABLED: '{what}: the motor is enabled: stop it first',
    Cause.STOP_NOT_CONFIRMED_YET: '{what}: a stop is not confirmed yet',
    Cause.MOTOR_RUNS: '{what}: the motor runs ({status}): stop it first',
    Cause.CONTROL_INHIBITED: '{what}: the drive lets nobody take control now ({status}; '
    '{name} is Inhibit)',
    Cause.CONTROLLED_LOCALLY: '{what}: keypad or terminals have control ({status}), and giving it '
    'back to them could start the motor: press STOP at the drive first',
    Cause.NO_STANDBY: '{what}: the drive does not stand by: {status}',
    Cause.PROCEDURE_STOPPED: '{what} was stopped',
    Cause.PROCEDURE_NOT_BEGUN: '{what} was stopped before it began',
    Cause.INTERRUPTED: '{signal}: not begun',
    Cause.SPEED_SCALE: 'the drive multiplies the speeds of the bus by {scale}: the driver takes '
    'that into account, and set-points and values are in rpm',
    Cause.TUNING_BEGINS: '{what} begins: the motor is energised',
    Cause.TUNING_NEEDS: '{what} needs {key}: set it as the motor plate says',
    Cause.TUNED: '{what} finished ({status})',
    Cause.TUNING_WITHOUT_RESULT: '{what} ended in standby ({status}) and has changed no parameter: '
    'the {enable_input} may have been lost meanwhile; repeat it if it was',
    Cause.TUNING_FAILED: f'{{what}} failed, {{status}}: {_REMEDY}; {{call.acknowledge}} first',
    Cause.TUNING_STOPPED: '{what} was stopped before it was finished ({status})',
    Cause.TUNING_CUT_SHORT: '{what} ended, and the drive does not say that it has finished '
    '({status}): was the {enable_input} lost, or STOP pressed?',
    Cause.TUNING_DOES_NOT_BEGIN: '{what} does not begin ({status}): is its {enable_input} '
    'active?',
    Cause.TUNING_ENDLESS: '{what} has no end ({status}): stopping it',
    Cause.TUNING_CHANGED: '{how}; changed: {changes}',
    Cause.LOG_ERASED: 'the error log is erased',
    Cause.LOG_NOT_ERASED: 'the drive took the command, but its error log is not empty',
    Cause.ENERGY_RESET: '{key}: {before:.3f} -> {after:.3f} kWh',
    Cause.ENERGY_NOT_RESET: 'the drive took the command, but {key} is {energy:g} kWh',
    Cause.ENERGY_RESET_UNKNOWN: '{what} came with firmware {since:.2f}; this drive has {firmware}',
    # --- the error log
    Cause.LOG_ENTRY: 'error log: {entry}',
    Cause.LOG_ENTRY_UNSEEN: 'error log: {entry}; no poll saw it',
    Cause.LOG_UNDOCUMENTED: 'the error log of this model ({model}) is not documented [M1]',
    Cause.LOG_NOT_WATCHED: 'its error log is not watched: {error}',
    Cause.LOG_CHANGES: 'the drive writes into its error log all the time: try again',
    # --- the settings of the drive
    Cause.SETTINGS_READ: 'parameters: {progress} in {seconds:.1f} s',
    Cause.SETTINGS_BEING_READ: 'parameters: {progress}',
    Cause.SETTINGS_REFRESHED: '{count} parameters read, changed: {changed}',
    Cause.SETTING_UNREADABLE: '{key} cannot be read: {error}',
    Cause.OPTIONS_MISSING: (
        'parameters: {count} are left out, for the drive has none of the option cards that they '
        'need ({options})'
    ),
    Cause.BAD_VALUE: '{error}',
    Cause.CHANGED: '{change}',
    Cause.CHANGED_FOR_TIMEOUT: '{change} ({call.drive_timeout})',
    Cause.STORED: '{key} ({name}) was changed to take control, and is stored in the drive: '
    '{old} -> {new}',
    Cause.CHANGED_AS_WANTED: '{change}, as the parameter file says',
    Cause.CHANGED_AT_DRIVE: 'changed at the drive: {change}',
    Cause.NOT_AS_WANTED: '{key} is {has} in the drive, but {wanted} was asked for: it is left so',
    Cause.WANTED_BUT_MISSING: 'this drive has no {keys}: not applied',
    Cause.WANTED_BUT_REFUSED: 'not applied from the parameter file: {why}',
    Cause.NO_SETTING: '{key} is no parameter that can be changed here',
    Cause.NOT_CHANGED: '{key}: {why}',
    Cause.CHANGE_WHILE_TUNING: 'the drive is tuning: wait for its end, or stop it',
    Cause.COMMUNICATION_PROTECTED: 'communication settings are not changed unless '
    'allow_communication_changes is true, for the driver may lose the drive',
    Cause.CODES_UNCERTAIN: 'what its codes mean in firmware {firmware:.2f} is not known for sure: '
    'change it at the keypad',
    Cause.FOLLOW_THE_LINE: 'the drive uses the new settings of the line from its next power-up on, '
    'or at once: then start this driver with the {settings} that it has',
    Cause.STANDSTILL_NEEDED: 'only while the motor is stopped, but it is not ({status})',
    Cause.NOT_WHILE_ENABLED: 'the motor is enabled, and might not do what it is told after that: '
    'stop it first',
    Cause.VALUE_NOT_ACCEPTED: 'the drive does not accept {value}{behind}',
    Cause.REFUSED_WHILE_RUNNING: '{why}: the motor must be stopped for this, and it runs',
    Cause.REFUSED_WHILE_FAULTED: '{why}; fault {status} is active: {call.acknowledge} first',
    Cause.DRIVE_KEEPS: 'the drive keeps {value}',
    Cause.DRIVE_KEEPS_OTHER: 'the drive keeps {value} where {written} was written',
    Cause.AS_BEFORE: 'it is {value} as before',
    Cause.PERHAPS_CHANGED: 'whether the drive took {value} is not known',
    Cause.PUT_BACK: 'put back: {keys}',
    Cause.NOT_PUT_BACK: '{key} is NOT put back to {value}: {why}',
    Cause.NOT_TRIED_ANY_MORE: 'not tried any more',
    Cause.ENDED_HALF_WAY: 'ended half-way, NOT put back: {changes}',
    Cause.SEVERAL: '{reports}',
}


#: What stands for a value that is empty, by its name.
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
    :ivar program: what this is that speaks.
    :ivar drive_timeout: the name of that setting.
    :ivar set_drive_timeout: such as ``set drive_timeout``.
    :ivar set_setpoint_max: how to let set-points go beyond what is nominal.
    :ivar set_control_mode: how to expect another control mode.
    :ivar set_model: how to correct the model.
    """

    acknowledge: str
    enable: str
    program: str
    drive_timeout: str
    set_drive_timeout: str
    set_setpoint_max: str
    set_control_mode: str
    set_model: str


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
    """Return what an operator reads of a report."""
    values = {**report.values, 'call': calls}
    return _Formatter(calls).vformat(TEMPLATES[report.cause], (), values)
