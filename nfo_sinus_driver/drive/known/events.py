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

    Below a sentence, or several, is what more there is to know and to do: their row of
    docs/troubleshooting.md, in the section that the group is named after. ``make pages`` reads it
    from this source; no running driver has it in memory.
    """

    # --- No response
    NO_RESPONSE = 'no response from address {address}{behind}: check in this order: {check}'
    """No power, a wrong line setting or a wrong wire: [the
    list](serial_line.md#when-a-drive-is-silent). `nfo-sinus --port /dev/ttyUSB0 scan --addresses
    1-10 --all-settings` tries every baud rate and parity"""
    NO_VALID_ANSWER = (
        'what comes from address {address} is no answer ({error}): check baud rate and parity, '
        'that no other master is on the line, and in this order: {check}'
    )
    """The wires are right. Compare `baud_rate` and `char_format` with the drive; leave one drive on
    the line; end other masters"""
    NOT_REACHED = '{error}: check the cable and that the drive has power'
    """The drive responded before. Check its mains and the cable. The motor stands still until
    `~/enable`"""
    NOT_CONNECTED = 'the drive at address {address} is not connected'
    """Not yet, or lost: the log before it has the reason"""
    LOST = 'lost: {why}; retrying'
    """No valid frame for `lost_after`. Check mains and cable. The driver reconnects"""
    TOO_LATE = 'no answer within {timeout:g} s'
    """Check the cable; try again"""

    LINE_TOO_SLOW = (
        'the line is slow: to ask each of its drives once takes {seconds:.1f} s, longer than '
        'lost_after ({lost_after:g} s), so one lost answer may pass for the loss of a drive: raise '
        'the baud rate, or lost_after'
    )
    """A drive counts as lost that was asked in vain and sent nothing for `lost_after`, and there is
    no time to ask it again before. Raise the baud rate, or `lost_after`"""
    PAUSES_TOO_LONG = (
        'the pauses before requests take {seconds:.2f} s for one round of the drives of this line, '
        'longer than lost_after or half of a time-out ({most:g} s): lower request_gap, or line: '
        'gap in the files of the drives; or raise lost_after and drive_timeout'
    )
    """`request_gap`, `line: {gap: S}` of a described drive and pauses that were learnt add up over
    the drives of a line. Lower them, spread the drives over more lines, or raise what is named"""
    # --- Another drive than expected
    OTHER_MODEL = '{error}: every {model} has {what}; is this another model? {call.set_model}'
    """The drive refuses what every drive of `model` has. In unconfigured: `ros2 param set
    /nfo_sinus model auto`"""
    ANOTHER_DRIVE = 'this is no {title}: {why}; {call.set_model}'
    IS_NOT = 'its {name} is {value}, and should be {values}'
    CANNOT_BE = 'its {name} is {value}, which cannot be'
    MADE_BY = 'it reports {vendor} as its maker'
    """Another drive answers than `model` or `family` says: nothing is written to it. Set the right
    one, or connect the right drive. `should be` is what `identify` in [the file of the
    drive](your_own_drive.md) says"""
    METHOD_NEEDS = (
        'this drive has no {names}, which control_method {method} needs: {call.set_method} '
        '({others})'
    )
    """The CANopen module does not have these objects. Choose one of the control methods that the
    message lists ([control methods](serial_line.md#control-methods-on-canopen))"""
    UNEXPECTED_IDENTITY = (
        'this drive identifies itself as a {model}, which no {title} does: {call.set_model}'
    )
    """Set the right `model`. The drive is used all the same"""
    SEVERAL_MODELS = (
        'the drive at address {address} does not identify itself: set model to {models}'
    )
    """Set `model` to one that is named"""
    NOT_THE_MODEL = '{drive} answers, but not as a {model} does ({why}): is --model right?'
    """Give the right `--model`"""
    FIRMWARE_NOT_ASKED = (
        'its firmware is not read while the bus has control, because firmware before {before:g} '
        'takes that for a fault: it is treated as older until it is connected to while the bus '
        'has no control; set classic_dialect to v2.03 or {dialect} to know it at once'
    )
    """Some values and settings are missing. Stop the motor, clean up and configure; or [set
    `classic_dialect`](serial_line.md#firmware-before-428)"""
    TAKES_CONTROL = '{why}: a motor that the terminals run stops now'
    """A warning before the first request to a drive on CANopen: [any request takes
    control](drives/sinus_g2.md#what-differs), a read too. Where terminals have to run the motor, do
    not connect to that drive over CANopen"""
    HELD_BY_LINE = (
        'control_method is monitor, but {why}: a motor that the terminals ran has stopped'
    )
    """Over CANopen [any request takes control](drives/sinus_g2.md#what-differs). Do not monitor
    such a drive over CANopen"""
    UNLISTED_MODEL = (
        'this drive identifies itself as a {model}, which the manual of the {title} does not list: '
        'check the model before the motor runs'
    )
    """Compare its nameplate with `model`. It is connected all the same"""

    # --- It does not enable
    NO_RUN_INPUT = (
        'the drive stays in standby: its {enable_input} is not active: close it, or its safety '
        'contact'
    )
    """Close the safety contact, release the emergency stop, check the wire of the input; enable"""
    FAULT_FORBIDS = f'fault {{status}} is active: {_REMEDY}; then {{call.acknowledge}}'
    """Remove the cause, `ros2 service call /nfo_sinus/fault_ack std_srvs/srv/Trigger`, enable"""
    STAYS_IN_STANDBY = (
        'the drive stays in standby after the run command ({status}): check its enable input, and '
        'whether it takes the run command from the line'
    )
    """Close the input and the safety contact; set the drive to commands from the line; let [no
    cache](serial_line.md#modbus-tcp) answer in its place. Of a drive that a file describes, compare
    `run` and `running` of `status` with its manual"""
    START_FAULTED = 'the drive did not start: {status}'
    NOT_STARTED = 'the drive does not start: {status}'
    """Acknowledge; check the enable input"""
    STOP_PENDING = 'a stop is on its way and not confirmed yet: wait for it, then enable'
    """If the stop is not confirmed soon: [It does not stop](#it-does-not-stop)"""
    STOPPED_SINCE_ASKED = (
        'a stop was confirmed after this was requested: request it again if the motor shall run'
    )
    """Enable and stop were called together; the stop has priority. Enable again, if the motor may
    run"""
    STOPPED_WHILE_ENABLING = 'it was stopped while it was being enabled'
    """A stop, a fault or a loss came in between; the log has it. Enable"""
    ENABLING_ALREADY = 'it is being enabled already'
    """The first enable still waits, perhaps for the start delay of the drive. Wait, or stop"""
    PROCEDURE_GOES_ON = '{what} is going on: wait for its end, or stop it'
    """Wait, or call `/nfo_sinus/stop`"""
    MONITOR_ONLY = (
        'control_method is monitor: this driver only reads; set control_method to another one'
    )
    """Clean up, set `control_method` to `''`, configure"""
    NOT_ACTIVE = 'the drive is not active'
    """`ros2 lifecycle set /nfo_sinus activate`, then enable"""
    ENDING = 'this {call.program} is ending'
    """Start the driver again"""
    SCALE_IMPOSSIBLE = (
        '{key} is {value:g}, and set-points or measured values are multiplied by it: set it first'
    )
    """Such as a greatest frequency of 0, of which set-points are parts. Set it in the drive,
    enable"""
    WRONG_CONTROL_MODE = (
        'the drive is in control mode {mode}, expected is {expected}: set {key} in the drive or '
        '{call.set_control_mode}'
    )
    """Set-points would have another unit. Set the control mode of the drive, or
    `expected_control_mode`"""
    OTHER_METHOD_RUNS = (
        'the motor still runs by control_method {method} ({status}): another one has to wait '
        'until it stands still'
    )
    """`control_method` was changed while the motor ramped. Wait, configure again"""
    SCALE_NOT_FOLLOWED = (
        '{above} and {below} are {value}, and behind a PLC the driver does not take into account '
        'that speeds are multiplied by it: set both to 1, or {key} to Freque'
    )
    """The motor would turn by that factor faster than its set-point. Set SpdScl with the tool that
    changed it"""
    NOT_CONFIRMED = 'the drive did not carry out the command; its status is {status}'
    """The state did not follow for 2 s. Check the drive and its enable input"""
    ENABLED_BY_OWN_REFERENCE = 'enabled; it follows its own reference ({reference})'
    """**The motor runs now**, because of `reference`. For set-points set it to `fieldbus`"""

    # --- It stopped by itself
    STOPPED_BECAUSE = f'stopped: {{why}}; {_GO_ON}'
    """Remove the cause, enable"""
    STOPPED_BECAUSE_OF_FAULT = f'stopped: {{why}}; then {{call.acknowledge}}, {_GO_ON}'
    STOPPED_BY_FAULT = 'stopped by fault {status}'
    """A fault of the drive. Remove its cause, acknowledge, enable"""
    FAULT = f'fault {{status}}: {_REMEDY}'
    FAULT_APPEARED = '{fault}; then {call.acknowledge}'
    """The message has number, text, meaning and remedy. Remove the cause, acknowledge, enable"""
    LOST_IN_USE = f'lost: {{why}}; retrying; it is stopped as soon as it answers; {_GO_ON}'
    """**The motor runs on** until the line is back or `drive_timeout` is over. Use the enable
    input; repair the line; enable"""
    STOPPING_BECAUSE = 'stopping: {why}'
    """The stop is on its way, for that reason"""
    RUN_INPUT_LOST = 'the {enable_input} of the drive was lost ({status}): close it'
    """The safety contact opened. Close it, enable"""
    STOPPED_BY_ITSELF = (
        'the drive stopped by itself ({status}). Either its {enable_input} was lost or another '
        'master stopped it: close the input'
    )
    """The status does not show which. Check the enable input and other masters, enable"""
    CONTROL_LOST = (
        'the bus has lost control ({status}). STOP was pressed at the keypad, or another '
        'master took it away: find out which'
    )
    """Find out which, enable"""
    CONTROL_LOST_WHILE_AWAY = (
        'the bus has lost control meanwhile ({status}). The drive was '
        f'switched off and on, or its keypad was used: check its mains; {_GO_ON}'
    )
    """The drive was lost; now it stands, without bus control. Check its mains, enable"""
    POWER_CYCLED = (
        'the drive did not answer for a moment, and the bus has lost control ({status}). It was '
        'switched off and on: check its mains'
    )
    """A short power failure. Check mains and contactors, enable"""
    DRIVER_PAUSED = (
        'this {call.program} did not run for longer than the time-out of the drive itself '
        '({seconds:g} s), after which the drive stops the motor ({status}): check the load of the '
        'computer'
    )
    """The computer was suspended or overloaded. Enable again"""
    SLOWER_AFTER_SILENCE = (
        'the drive did not answer for a moment, and the motor turns slower than commanded '
        '({now:.4g} {unit}, before {before:.4g} {unit}; {status}). It may have been switched off '
        'and on: check its mains and the line'
    )
    """A short power failure; the drive started again by its old run command. Check its mains,
    enable"""
    MAY_HAVE_RESTARTED = (
        'the drive did not answer for so long that it may have been switched off and on, and its '
        'motor would run again then: check its mains and the line'
    )
    """The file of the drive says `keeps_run: true` or `run_by`, and no answer came for 0.4 s. Check
    its mains and the line, enable"""
    DRIVE_STARTING = 'the drive is starting ({status}): it was switched off and on; check its mains'
    RESTARTED = 'the drive restarted: its boot-up message was received; check its mains'
    """The drive lost its power. Check its mains, enable"""
    KEYPAD_IN_CONTROL = 'the keypad has control now and runs the motor ({status}): press STOP there'
    OTHERS_IN_CONTROL = (
        'keypad or terminals have control now and run the motor ({status}): press STOP there'
    )
    TERMINALS_IN_CONTROL = 'the terminals have control now ({status}): press STOP at the drive'
    """The driver leaves that motor alone. Press STOP at the drive, enable"""
    SCALE_CHANGED = (
        'what set-points or measured values are multiplied by was changed at the drive ({change}): '
        'check that it is right'
    )
    """The same set-point would be another speed. Put the parameter back, or check what sends
    set-points; enable reads it again"""
    CONTROL_MODE_CHANGED = (
        'the control mode was changed to {mode} at the drive, and set-points are in {unit} now: '
        'check what sends them'
    )
    """Set-points would have another unit. Change the mode back, or send the new unit; enable"""
    TURNS_BACKWARDS = (
        'the motor turns in the other direction than its set-points say ({now:.4g} {unit}, '
        '{status}). Another master may command the drive: find out which'
    )
    """Another master commands the drive, or a load drives the motor back. Find out which, enable"""
    NOT_SLOWER_AFTER_TIME_OUT = (
        'no set-points arrive, and the motor does not slow down at set-point 0 ({now:.4g} '
        '{unit}, {status}). Check the least frequency that the drive is set to, and whether '
        'another master commands it'
    )
    """Set the least frequency of the drive to 0; look for another master, and for [a
    cache](serial_line.md#modbus-tcp) that answers in place of the drive; enable"""
    NOTHING_CHANGES = (
        'set-points ask for standstill or the other direction, and neither the status ({status}) '
        'nor the speed ({now:.4g} {unit}) has changed for {seconds:g} s: the drive does not '
        'follow, or something on the way answers in its place, such as a gateway or proxy with a '
        'cache'
    )
    """The motor is stopped, and a drive that has stopped shows that; what answers from a cache does
    not: use the enable input. Let [no cache](serial_line.md#modbus-tcp) be between; enable"""
    FASTER_THAN_SETPOINT = (
        'the motor turns at {now:.4g} {unit}, and its set-point is {setpoint:g} ({status}): the '
        'set-point is written again. Check whether the load drives the motor, and whether another '
        'master commands the drive'
    )
    """Nothing is stopped. Does the load drive the motor? Does another master command the drive?"""
    OTHER_SCALE = (
        'the motor turns at {now:.4g} {unit}, steadily {share} its set-point of {setpoint:g} '
        '({status}): one of both has another scale in the drive. Check factor and unit of the '
        'set-point and of what is measured, and least and greatest frequency of the drive'
    )
    """Nothing is stopped. Correct `factor` or `unit` in [the file of the
    drive](your_own_drive.md#what-a-file-can-say). If both are right, a limit of the drive is that
    speed"""
    CURRENT_LIMITED = 'the current limit holds the motor back ({status}). {limit.remedy}'
    """Nothing is stopped. Check the mechanics, use a longer ramp or a lower set-point"""

    JAMMED = (
        'its motor has taken {current:.3g} A at {speed:.3g} {unit} for {seconds:.1f} s '
        '(jam_current {jam_current:g} A, jam_speed {jam_speed:g} {unit}): free what is stuck'
    )
    """`on_jam` is `stop`. Switch off, free what is stuck; enable. If nothing was, raise
    `jam_current` or lower `jam_speed` ([a jam](faults_and_stops.md#a-motor-that-is-jammed))"""
    JAM_SEEN = 'jammed: {why}; nothing is stopped, for on_jam is warn'
    """`on_jam` is `warn`. Stop the motor, free what is stuck; or let the driver stop it: `on_jam:
    stop`"""
    JAM_UNSEEN = (
        'no jam is noticed: current and speed were not measured in a row for {seconds:.0f} s; '
        'lower poll_rate, so that the line has time for telemetry'
    )
    """The line is too full for `telemetry_rate`, or the drive does not tell its current (NaN in
    `~/telemetry`). Lower `poll_rate` of all drives of the line; or set `jam_current` to 0"""
    JAM_NOT_JUDGED = (
        'no jam is noticed: in control mode {mode} no speed is controlled; set jam_current to 0'
    )
    """`jam_current` is for the control modes Freque and Speed"""
    JAM_NOT_MEASURED = (
        'jam_current is set, and this drive does not tell its current ({why}): make it do so, or '
        'set jam_current to 0'
    )
    """Configure is refused. Behind a PLC: its longer telegram, or a mailbox; else `jam_current: 0`
    """

    # --- It does not stop
    CANNOT_STOP = f'CANNOT STOP THE MOTOR: {{why}}; retrying. {_EMERGENCY}'
    """Retried until confirmed. Use the enable input or the emergency stop; then remove the cause"""
    MAY_RUN_ON = (
        'the drive is left alone, so that its own time-out of {seconds:g} s stops the motor, but '
        'other drives of the line are still asked: if it counts their messages, its motor runs '
        'on. Use its {enable_input} or the emergency stop'
    )
    """A drive that is lost may not be written to any more, and no manual says whether messages to
    others keep its time-out from striking. Repair the line"""
    CANNOT_STOP_BUT_STANDS = (
        'the stop is NOT confirmed: {why}; retrying. The drive shows that the motor stands still '
        '({status}); the {enable_input} or the emergency stop keeps it so'
    )
    """The drive refuses the stop, but shows no motion and no run command. Remove the cause; only
    then close the enable input"""
    STOP_UNCONFIRMED = 'the stop is NOT confirmed: {why}; retrying'
    """Answer of `~/stop` in that case"""
    STOP_UNCONFIRMED_AT_END = 'the stop is NOT confirmed: this {call.program} is ending'
    """The driver ended before. Use the enable input; the exit status is 1"""
    STOP_FORCED = (
        'a normal stop had no effect ({why}): control was taken from the drive, or its motor was '
        'released ({status}). Find out why it did not stop, and whether another master commands '
        'it'
    )
    """The motor may have coasted, and the bus may have lost control. Look for another master or a
    setting of the drive; enable"""
    NOT_RECOGNISED = (
        'it is not known what is at address {address} ({why}): nothing is written there, no stop '
        'either, which could start another drive. Use its {enable_input} if its motor turns; check '
        'mains and cable, and that it is the drive that model or family says'
    )
    """[Before a drive is recognised](control.md#before-a-drive-is-recognised) nothing is written.
    If a motor turns, use its enable input. The reason is in brackets: the drive is silent, or
    another one answers. Connect the right drive, or set `model` or `family`"""
    NONE_RECOGNISED = (
        'no stop was broadcast: no drive of this line was recognised since its port was opened'
    )
    """`stop_all` on a Classic line whose drives have not answered. Use the enable inputs; check
    port and cable"""
    NO_ANSWER_YET = 'no answer yet'
    """The stop did not reach the drive. Check the line"""
    DRIVE_SAYS = 'the drive still runs: its status is {status}'
    """The drive has the stop and still runs: another master or its terminals command it, or [a
    cache](serial_line.md#modbus-tcp) on the way answers in its place"""
    UNKNOWN_STATUS = (
        'its status ({status}) is none that its manual or its file lists, and shows nothing: look '
        'at the drive what it does, and check that it is of this model'
    )
    """Such a status confirms neither a start, a stop nor standstill. Of a [described
    drive](your_own_drive.md#what-a-file-can-say) add it to the file"""
    RUN_COMMAND_STANDS = (
        'the run command is still active ({status}), and the next set-point would turn the '
        'motor'
    )
    """The drive answered the stop and did not carry it out, or its status shows a run for another
    reason, or [a cache](serial_line.md#modbus-tcp) on the way answers in its place. The driver
    releases the motor if it can"""
    STILL_TURNS = (
        'the status is {status}, yet the motor turns at {now:.4g} {unit} and does not slow down'
    )
    """Does a load drive the motor? Does the drive measure something else, or run by other bits? The
    driver releases the motor"""
    STOP_UNCLEAR = (
        'the stop is NOT confirmed: {why}, although its run command was removed and it was '
        'released. Look whether the motor turns: a load may drive it, or what is measured is not '
        'its speed. Use the {enable_input} or the emergency stop if it is driven'
    )
    """The end of the tries: the drive has taken all there is. Look at the motor; enable is
    possible"""
    QUICK_STOP_UNCONFIRMED = 'the quick stop is NOT confirmed: {why} ({status}); trying a stop'
    """Use the enable input if it turns"""
    NO_RAPID_STOP = '{stop} (this drive has no stop ramp of its own)'
    NOT_RAPID = (
        '{stop} (the drive takes its ordinary ramp, {status}: for the stop ramp open its '
        '{enable_input})'
    )
    """Answers of `~/rapid_stop`: the motor was stopped by its ordinary ramp. Where it must be
    faster, open what is named"""
    NO_QUICK_STOP = '{stop} (this drive has no quick stop)'
    """The motor was stopped by its ramp. Where it must be faster, use the enable input"""
    RUN_BY_OTHERS = (
        'the bus has no control of this drive ({status}): stop it where it is controlled, by '
        'keypad or {enable_input}'
    )
    """Press STOP at the keypad, or open the enable input"""
    NO_CONTROL = 'the bus has no control of this drive ({status}), and it does not run'
    """There was nothing to stop"""
    TUNING_ENERGISES = 'the motor is energised by a tuning ({status})'
    TUNING_REFUSES = 'the motor is energised by a tuning ({status}): {error}'
    """It may refuse every command. If you cannot wait: STOP at the keypad, or the enable input"""
    STOP_BLOCKED = 'stopped by fault {status}; the drive refuses the stop until the fault is over'
    """A fault keeps the motor still. Acknowledge: the run command is then removed"""
    RELEASE_BLOCKED = (
        'fault {status} is active and the drive takes no command: a run command may still be '
        'active when the fault is acknowledged'
    )
    """Open the enable input before the fault is acknowledged at the keypad"""
    RUNS_UNASKED = (
        'it runs under bus control although it was not enabled: find out whether another master '
        'commands it'
    )
    """Another master started it, or the drive [restarted by
    itself](control.md#faults-and-the-drive-that-restarts-by-itself). The driver stops it"""
    FOUND_RUNNING = (
        'the motor runs under bus control, started by an earlier session '
        f'({{status}}): stopping it; {_GO_ON}'
    )
    """The driver was killed or the line lost while the motor ran. Enable to go on. Set
    `drive_timeout`"""
    STARTED_AFTER_FAULT = (
        'the fault ended by itself or at the drive, and the motor started '
        f'by the run command that was still active ({{status}}): stopping it; {_GO_ON}'
    )
    """A G2 restarted by itself. Set its ErrCnt parameters (`error.overload_err_cnt` …) to 0"""
    LEFT_TO_RAMP = '{stop}; it was left to its ramp, under bus control'
    """The ramp is longer than `shutdown_timeout`: make that longer"""
    COASTED_FOR_TIMEOUT = 'the motor coasts, for the time-out of the drive would end the ramp'
    """The ramp is longer than `shutdown_timeout`, and `drive_timeout` would have ended it by a
    fault: make `shutdown_timeout` longer"""
    CONTROL_KEPT = '{stop}; the bus keeps control: {why}'
    """To release control do what the message says"""
    NOT_IN_CONTROL = 'nothing to stop: the bus has no control of the drive'
    """There was nothing to release"""

    # --- Set-points are ignored
    STOPPED_WITH = 'it stops with {drive}: {why}'
    """Another drive, whose `stop_with` names this one, was stopped: the sentence has its reason.
    Remedy that, then enable both"""
    SETPOINT_TIMED_OUT = (
        'no set-point for {timeout:g} s: the motor ramps to a stop until the next one arrives; '
        'check what publishes them'
    )
    """None for `setpoint_timeout`. **The next one moves the motor.** Publish several times within
    it; check topic and QoS: `ros2 topic info -v /nfo_sinus/setpoint`"""
    OWN_REFERENCE = (
        'set-point refused: reference is {reference}, so the drive follows none; set reference to '
        'fieldbus, where its control method has that'
    )
    """Clean up, set `reference` to `fieldbus`, configure"""
    SETPOINT_LIMITED = (
        'set-point {value:g} is limited to {limited:g} (setpoint_max, or the limit of the drive)'
    )
    """Raise `setpoint_max`, or send less"""
    SETPOINT_BEYOND_NOMINAL = (
        'set-point {value:g} is limited to {limited:g} {unit}, which is nominal for this motor: '
        'check in which unit it was meant; if the motor may go beyond, {call.set_setpoint_max}'
    )
    """`setpoint_max` is 0, so the nominal value limits. Check `unit` in `~/status`: rpm for a drive
    in Freque? If the motor may go beyond: `ros2 param set /nfo_sinus setpoint_max 60.0`"""
    SPEED_SCALE = (
        'the drive multiplies the speeds of the bus by {scale}: the driver takes that into '
        'account, and set-points and values are in rpm'
    )
    """Logged once. After a change of SpdScl (G2) stop and call `~/enable`"""
    SETPOINT_REFUSED = 'it refused set-point {value:g}: {error}'
    """The motor was stopped. Check the limits of the drive, enable"""
    SETPOINT_HELD = (
        'the drive answers {held:g} {unit} where set-point {value:g} was written: it limits or '
        'rounds what it takes; check its limits'
    )
    """Nothing is stopped; `setpoint` of `~/status` is what the drive answers. Check the least and
    the greatest set-point in the drive, and `setpoint_max`"""
    SETPOINT_UNACKNOWLEDGED = (
        'set-point {value:g} was not acknowledged for {seconds:.1f} s: if the drive answers reads, '
        'something on the way lets no writes pass, such as a gateway that is set to read only, or '
        'a filter'
    )
    """The motor is stopped, if a stop passes; if not, [It does not stop](#it-does-not-stop). Let
    gateways and filters pass writes, enable"""

    # --- Faults, alarms and values
    STILL_FAULTED = f'{{status}} is still active: {_REMEDY}'
    """Remove the cause as the message says; acknowledge again"""
    NEXT_FAULT = 'acknowledged {acknowledged}, but {still}'
    """Another fault was active, too. Acknowledge again"""
    NOTHING_TO_ACKNOWLEDGE = 'nothing to acknowledge ({status})'
    """No fault is active"""
    ALARM = 'alarm {status}: {alarm.description}. {alarm.remedy}'
    """Nothing is stopped. Do what the message says"""
    ALARM_UNNAMED = 'alarm, the status does not say which ({status}): see its display'
    """See the display of the drive"""
    IMPOSSIBLE_VALUE = (
        'implausible {key} = {value}: not published; check motor and scaling in the drive, and '
        'that no other master is on the line'
    )
    """Reported twice; the topics have NaN. Check motor data and scale of the drive, and other
    masters"""

    # --- The time-out of the drive
    OWN_TIMEOUT_STOPS_NOTHING = (
        'the time-out of the drive itself does not stop the motor '
        + _RUNS_ON.format(
            why='{found}', remedy='{call.set_drive_timeout}, which sets {wanted}'
        )
    )
    """The default leaves AutoStop, or what a described drive has for it, as it is; `?` is a value
    that cannot be read. `ros2 param set /nfo_sinus drive_timeout 2.0`, and in the parameter file"""
    OWN_TIMEOUT_OFF = _NO_TIMEOUT.format(
        why='{name} is 0, and {call.drive_timeout} {asked:g} leaves it so',
        remedy='{call.set_drive_timeout}',
    )
    """Set it, if that is not what you want. With -1: `lost_after` is longer than the drive can
    wait"""
    OWN_TIMEOUT_KEPT = (
        '{call.drive_timeout} is 0: the time-out of the drive itself ({name} {timeout:g} s) stays '
        'as it is'
    )
    """Nothing, if that is what you want"""
    OWN_TIMEOUT_SET = (
        'if this {call.program} is killed or the cable is cut, the drive stops the motor after '
        '{timeout:g} s ({name})'
    )
    """Nothing: its own time-out is set"""
    OWN_TIMEOUT_NOT_PUT_BACK = (
        'the time-out of the drive itself ({name}) stays {timeout:g} s, which this {call.program} '
        'has set: {why}. The next clean end puts it back; set {key} as it was before, if another '
        'master needs that at once'
    )
    """The drive did not take the old value at the end. It matters to a master that polls it more
    seldom"""
    OWN_TIMEOUT_RECALLED = (
        'an earlier {call.program} was ended before it could put back the time-out of the drive '
        'itself ({names}): the end of this one does'
    )
    """Nothing: [After a driver that was
    killed](faults_and_stops.md#after-a-driver-that-was-killed)"""
    NOT_REMEMBERED = (
        'what this {call.program} sets in the drive and puts back at its end is not remembered '
        'elsewhere ({why}): if it is killed, or one before it was, check {keys}'
    )
    """Give it a folder that it can write: HOME, or XDG_STATE_HOME. Enable works without; after a
    kill compare those parameters with what they were"""
    NO_OWN_TIMEOUT = _NO_TIMEOUT.format(
        why='none is known of this model', remedy='use the {enable_input}'
    )
    OWN_TIMEOUT_NOT_TAKEN = _NO_TIMEOUT.format(why='{why}', remedy='use the {enable_input}')
    """This drive has none, or refused it. Wire the enable input so that an operator can open it"""
    OWN_TIMEOUT_SHORT = (
        'the time-out of the drive itself ({name} {timeout:g} s) is less than lost_after + '
        '{margin:g} s: noise that this {call.program} waits out may stop the motor; '
        '{call.set_drive_timeout}, at least {least:g} s'
    )
    """Noise would become a fault. Set `drive_timeout` to that value, or `lost_after` to less"""
    OWN_TIMEOUT_IMPOSSIBLE = (
        '{call.drive_timeout}: this model has no time-out of its own that can be set, so it must '
        'be 0'
    )
    OWN_TIMEOUT_OF_PLC = (
        '{call.drive_timeout}: through a PLC nothing is set at the drive; the PLC watches this '
        '{call.program}, and stops the motor {seconds:g} s after its last word, so it must be 0'
    )
    """Set `drive_timeout` to 0, or do what the reason says"""
    OWN_TIMEOUT_LEFT = (
        'control stays with the bus, and the time-out of the drive itself ({name} {timeout:g} s) '
        'goes on: {why}. So it will have a fault after so long without requests; set {key} to 0 '
        'to prevent that'
    )
    OWN_TIMEOUT_NOT_OURS = 'this {call.program} has not set it, and leaves it as it is'
    """A fault follows. Acknowledge it with the next driver; to avoid it set that parameter to 0"""
    WATCH_LEFT = (
        'the drive may go on watching over this {call.program} ({by}): {why}. So it may have a '
        'fault {seconds:g} s after this end, which is acknowledged as any other'
    )
    """CANopen: the last message was not confirmed. Acknowledge the fault with the next driver"""
    OWN_TIMEOUT_UNKNOWN = (
        'the PLC stops the motor if this {call.program} dies; what the drive does if the PLC '
        'fails cannot be read here: {what}'
    )
    """Sinus H: from the factory its motor runs on without the fieldbus. Set PRT-12 and PRT-13: [Set
    at the drive](drives/sinus_h.md#set-at-the-drive)"""

    # --- Parameters
    NO_SETTING = '{key} is no parameter that can be changed here'
    """Not over this line. Change it at the keypad"""
    VALUE_NOT_ACCEPTED = 'the drive does not accept {value}{behind}'
    """Another setting may forbid it, such as I-magn and I-limt of a G2. Set both with
    `set_parameters_atomically`"""
    NOT_WHILE_ENABLED = (
        'the motor is enabled, and might not follow its commands after that: stop it first'
    )
    """It decides whether the motor follows the line, or what a set-point means. Stop, then set
    it"""
    RELEASE_NEEDED = '{why}; {call.quick_stop}, then change it before it is enabled again'
    """MOVITRAC, return codes 1C and 2B: the drive takes this setting only while its output stage is
    inhibited"""
    STANDSTILL_NEEDED = 'only while the motor is stopped, but it is not ({status})'
    REFUSED_WHILE_RUNNING = '{why}: the motor must be stopped for this, and it runs'
    """Stop, wait until the motor stands still, set it"""
    REFUSED_WHILE_FAULTED = '{why}; fault {status} is active: {call.acknowledge} first'
    """The drive accepts no setting during a fault. Acknowledge, set it again"""
    CHANGE_WHILE_TUNING = 'the drive is tuning: wait for its end, or stop it'
    """Wait"""
    COMMUNICATION_PROTECTED = (
        'communication settings are not changed unless allow_communication_changes is true, for '
        'the driver may lose the drive'
    )
    """`ros2 param set /nfo_sinus allow_communication_changes true`, if you mean it"""
    ENDS_COMMUNICATION = (
        '{value} ends all communication with the drive, which its keypad alone can begin again: '
        'set it at the keypad'
    )
    """BusType None of a G2, master-slave operation of a MOVITRAC. Use the keypad"""
    CODES_UNCERTAIN = (
        'what its codes mean in firmware {firmware:.2f} is not known for sure: change it at the '
        'keypad'
    )
    """`serial.si_prot` of old G2 firmware. Use the keypad"""
    FOLLOW_THE_LINE = (
        'the drive uses the new settings of the line from its next power-up on, or at once: then '
        'start this driver with the {settings} that it has'
    )
    """Switch the drive off and on, start the driver with these settings"""
    DRIVE_KEEPS_OTHER = 'the drive keeps {value} where {written} was written'
    DRIVE_KEEPS = 'the drive keeps {value}'
    """Rounded, limited by another setting, or locked: check the drive"""
    AS_BEFORE = 'it is {value} as before'
    PUT_BACK = 'put back: {keys}'
    """The old value is in the drive again"""
    PERHAPS_CHANGED = 'whether the drive took {value} is not known'
    NOT_PUT_BACK = '{key} is NOT put back to {value}: {why}'
    NOT_TRIED_ANY_MORE = 'not tried any more'
    """The line failed; the value may be either. `ros2 service call /nfo_sinus/refresh_parameters
    std_srvs/srv/Trigger`, then set it again"""
    ENDED_HALF_WAY = 'ended half-way, NOT put back: {changes}'
    """The driver ended meanwhile. Compare: `nfo-sinus diff`"""
    WANTED_BUT_REFUSED = 'not applied from the parameter file: {why}'
    """The rest was written. Do what the reason says; clean up, start the driver again"""
    NOT_AS_WANTED = '{key} is {has} in the drive, the parameter file has {wanted}: not changed'
    """It was changed elsewhere, or `apply_parameters` is false. Set it, or correct the file"""
    WANTED_BUT_MISSING = 'this drive has no {keys}: not applied'
    """Remove it from the file"""
    SETTING_UNREADABLE = '{key} cannot be read: {error}'
    """The drive refuses it, so there is no ROS parameter. Check `model` and firmware"""

    # --- Tuning and the error log
    TUNING_NEEDS = '{what} needs {key}: set it as the motor plate says'
    """A value of the motor plate is 0. Set it"""
    MOTOR_ENABLED = '{what}: the motor is enabled: stop it first'
    MOTOR_RUNS = '{what}: the motor runs ({status}): stop it first'
    STOP_NOT_CONFIRMED_YET = '{what}: a stop is not confirmed yet'
    """Stop the motor, wait until it stands still"""
    OTHER_PROCEDURE_GOES_ON = '{what}: {other} is going on already'
    """Wait, or call `/nfo_sinus/stop`"""
    CONTROLLED_LOCALLY = (
        '{what}: keypad or terminals have control ({status}), and giving it back to them could '
        'start the motor: press STOP at the drive first'
    )
    """Press STOP at the drive"""
    CONTROL_INHIBITED = '{what}: control of the drive cannot be taken now ({status}; {why})'
    """It tunes already, perhaps by its keypad: wait. Firmware before 4.28: release it where it is
    controlled"""
    NO_STANDBY = '{what}: the drive does not stand by: {status}'
    """No standby within 2 s under bus control. Check the state that is named"""
    OTHER_METHOD_NEEDED = (
        '{what} needs {means}, and one session does not mix control methods: clean up, set '
        'control_method to {method} and configure again'
    )
    """Do what the message says"""
    UNKNOWN_PROCEDURE = (
        '{what} is not known of this model ({model}): its manual lists no command for it; do it '
        'at the keypad'
    )
    """Use the keypad"""
    TUNING_DOES_NOT_BEGIN = '{what} does not begin ({status}): is its {enable_input} active?'
    """The drive took the command and does nothing. Close the enable input"""
    TUNING_WITHOUT_RESULT = (
        '{what} ended in standby ({status}) and has changed no parameter: the {enable_input} may '
        'have been lost meanwhile; repeat it if it was'
    )
    """The same values again, or interrupted. If interrupted: close the enable input, tune again"""
    TUNING_CUT_SHORT = (
        '{what} ended, and the drive does not say that it has finished ({status}): was the '
        '{enable_input} lost, or STOP pressed?'
    )
    """Interrupted at the drive. Close the enable input, tune again"""
    TUNING_FAILED = f'{{what}} failed, {{status}}: {_REMEDY}; {{call.acknowledge}} first'
    """Such as a motor plate that does not fit. Acknowledge, do what the message says, tune again"""
    TUNING_STOPPED = '{what} was stopped before it was finished ({status})'
    PROCEDURE_NOT_BEGUN = '{what} was stopped before it began'
    PROCEDURE_STOPPED = '{what} was stopped'
    """Tune again"""
    TUNING_ENDLESS = '{what} has not finished in time ({status}): stopping it'
    """It lasted 15 minutes. Check motor and wiring"""
    TUNING_CHANGED = '{how}; changed: {changes}'
    """Also after a failure. Compare the values with the motor plate"""
    LOG_ENTRY_UNSEEN = 'error log: {entry} (missed by polling)'
    """It came and went between two polls. Look up the fault; a higher `poll_rate` catches more"""
    LOG_UNDOCUMENTED = 'the error log of this model ({model}) is not documented'
    """Read it at the keypad of the drive"""
    LOG_CHANGES = 'the drive writes into its error log all the time: try again'
    """Remove the cause of the faults, try again"""
    LOG_NOT_ERASED = 'the drive took the command, but its error log is not empty'
    ENERGY_NOT_RESET = 'the drive took the command, but {key} is {energy:g} kWh'
    """Try again with a standing motor"""
    ENERGY_RESET_UNKNOWN = '{what} came with firmware {since:.2f}; this drive has {firmware}'
    """The firmware is too old for it"""

    # --- Behind a PLC or a gateway
    OLD_DATA = (
        "the drive's data in the PLC have not changed for {seconds:g} s or more (its life "
        'counter stands still): check the fieldbus between them and that the program of the '
        'PLC runs'
    )
    """Set the PLC to RUN; check the fieldbus"""
    CONTROL_WITHHELD = (
        'the PLC has withdrawn its release to ROS ({status}): set it again in the PLC'
    )
    """`Release` is FALSE in the PLC. Set it; enable"""
    NO_MAILBOX = 'parameters, error log and the names of faults are not reached: {why}'
    """The drive runs without them. The reason follows"""

    # --- Errors in the driver
    DRIVER_ERROR = 'error in the driver: {error}'
    """A command, a callback or a transition failed. Check that the motor stands still"""

    # --- Nothing is wrong, or the sentence is that of another
    CONNECTED = 'connected: {drive}'
    CONNECTED_UNIDENTIFIED = (
        'connected: {drive}, recognised by nothing of its own: any drive with the same registers '
        'is taken for one'
    )
    LINE_FAILED = '{error}'
    NOT_POSSIBLE = '{why}'
    ENABLED = 'enabled; it follows set-points that arrive from now on'
    ENABLED_ALREADY = 'is enabled already'
    STOPPED = 'stopped ({status})'
    STOPPING = 'stopping ({status})'
    COASTING = 'stopping: it coasts'
    RAMPING = 'stopping: it ramps down'
    RAMPING_SO_FAR = (
        'stopping: it ramps down; that its run command is gone shows only once it stands'
    )
    QUICK_STOPPED = 'released: the motor coasts'
    RAPID_STOPPING = 'stopping: by its stop ramp ({status})'
    STOP_CONFIRMED_LATE = 'the stop is confirmed now: {status}'
    ACKNOWLEDGED = 'acknowledged {status}'
    ACKNOWLEDGED_DETAILED = 'acknowledged {status} ({details})'
    CONTROL_RELEASED = '{stop}; control released'
    ONLY_WATCHED = 'only watched'
    STOP_REQUESTED = 'a stop was requested: {by}'
    DISABLE_REQUESTED = 'a disable was requested: {by}'
    QUICK_STOP_REQUESTED = 'a quick stop was requested: {by}'
    STOP_ALL_REQUESTED = 'a stop of all drives was requested: {by}'
    ACKNOWLEDGE_REQUESTED = 'an acknowledgement stops the motor first: {by}'
    TRANSITION_REQUESTED = 'a transition was requested: {by}'
    DRIVER_ENDS = 'this {call.program} ends: {by}'
    ENABLE_FAILED = 'the enable failed: {why}'
    PROCEDURE_ENDED = '{what} has ended'
    PROCEDURE_CANCELLED = '{what} was cancelled'
    SETPOINTS_AGAIN = 'set-points arrive again'
    ASLEEP = (
        'the drive sleeps ({status}), for its set-point is below its sleep frequency: a greater '
        'one wakes it'
    )
    TUNING_BEGINS = '{what} begins: the motor is energised'
    TUNED = '{what} finished ({status})'
    LOG_ERASED = 'the error log is erased'
    ENERGY_RESET = '{key}: {before:.3f} -> {after:.3f} kWh'
    LOG_ENTRY = 'error log: {entry}'
    LOG_NOT_WATCHED = 'its error log is not watched: {error}'
    SETTINGS_READ = 'parameters: {progress} in {seconds:.1f} s'
    SETTINGS_BEING_READ = 'parameters: {progress}'
    SETTINGS_REFRESHED = '{count} parameters read, changed: {changed}'
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
    NOT_CHANGED = '{key}: {why}'
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
            return between.join(self.format_field(item, format_spec) for item in value)
        return str(super().format_field(value, format_spec))


def sentence(report: Report, calls: Calls) -> str:
    """Return the sentence of a report."""
    values = {**report.values, 'call': calls}
    return _Formatter(calls).vformat(report.cause.value, (), values)
