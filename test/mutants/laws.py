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

"""Ways to break the laws of the house in the driver, and the tests that have to notice."""

from __future__ import annotations

from mutant import ADVICE
from mutant import COMMANDS
from mutant import CONTROLLER
from mutant import DRIVE
from mutant import ECHO
from mutant import EVERY_STEP
from mutant import G2
from mutant import INTERFACE
from mutant import MAIN
from mutant import NO_RESTART
from mutant import NODE
from mutant import PROFILE
from mutant import RTU_LINK
from mutant import SEQUENCE
from mutant import SETPOINT
from mutant import SIGNALS
from mutant import TABLE
from mutant import TRACE
from mutant import TUNING
from mutant import WATCH
from mutant import WAYS_OUT
from mutant import WRITER
from mutant import Mutant

#: What the laws ask of a MOVITRAC alone.
MOVITRAC_LAWS = 'test/unit/drive/test_movitrac_laws.py'

LAWS = (
    Mutant(
        1,
        'polling acknowledges faults',
        'nfo_sinus_driver/drive/drive_state.py',
        'read_reply(key, priority, once=once',
        "read_reply('fieldbus.inv_st_with_ack', priority, once=once",
        (TRACE,),
    ),
    Mutant(
        2,
        'a fault does not disarm',
        ADVICE,
        '    if seen.faulted:\n        return explain_fault',
        '    if False:\n        return explain_fault',
        (NO_RESTART, '-k', 'fault_and_ack'),
    ),
    Mutant(
        2,
        'a keypad STOP does not disarm',
        ADVICE,
        '    elif not seen.from_bus:\n        cause = _why',
        '    elif False:\n        cause = _why',
        (NO_RESTART, '-k', 'keypad or mode_changed'),
    ),
    Mutant(
        2,
        'a lost RUN input does not disarm',
        ADVICE,
        '    elif not seen.runs:\n        cause =',
        '    elif False:\n        cause =',
        (NO_RESTART, '-k', 'run_input'),
    ),
    Mutant(
        2,
        'a control mode that was changed does not disarm',
        ADVICE,
        '    if inverter.control_mode != control_mode:',
        '    if False:',
        ('test/unit/drive/test_setpoint_modes.py', '-k', 'at_the_keypad'),
    ),
    Mutant(
        2,
        'a fault that a refused set-point shows first is not told',
        CONTROLLER,
        'if seen.faulted else reason)',
        'if False else reason)',
        ('test/unit/drive/test_watching.py', '-k', 'shows_first'),
    ),
    Mutant(
        6,
        'another control method takes over a motor that still ramps down',
        DRIVE,
        '        if seen.driven and seen.from_bus:',
        '        if False:',
        ('test/unit/drive/test_control_methods.py', '-k', 'until_the_motor_stands'),
    ),
    Mutant(
        6,
        'a session changes its control method',
        'nfo_sinus_driver/drive/drive_state.py',
        '            if getattr(settings, name) != getattr(self.settings, name):',
        '            if False:',
        ('test/unit/drive/test_control_methods.py', '-k', 'never_changes'),
    ),
    Mutant(
        2,
        'a lost line does not disarm',
        WATCH,
        'self._controller is not None and self._controller.lost()\n',
        'False\n',
        (NO_RESTART, '-k', 'line_gone'),
    ),
    Mutant(
        2,
        'the motor is enabled while it is being tuned',
        CONTROLLER,
        '        if (self._state, ControlEvent.ENABLE) in control_state.TRANSITIONS:\n',
        '        if self._access is not None:\n            self._state = ControlState.IDLE\n'
        '        if True:\n',
        (TUNING, '-k', 'two_at_a_time'),
    ),
    Mutant(
        2,
        'a tuning is taken for a motor that nobody enabled',
        TABLE,
        ' ControlState.PROCEDURE,',
        '',
        (TUNING, '-k', 'take_over'),
    ),
    Mutant(
        2,
        'a restarted driver lets run what runs',
        CONTROLLER,
        '        if await self.method.in_control(Priority.SERVICE):\n            turns',
        '        self._since = float("inf")\n        if False:\n            turns',
        (NO_RESTART, '-k', 'restarted_driver'),
        # a poll would find it, too
        ((CONTROLLER, '            reason = Report(Cause.RUNS_UNASKED)\n', '            pass\n'),),
    ),
    Mutant(
        2,
        'the run command is not taken back before an acknowledgement',
        G2,
        'one(Write(self._command, Scmd.STOP, once=True))',
        'one(Read(MODE))',
        (NO_RESTART, '-k', 'fault_and_ack'),
    ),
    Mutant(
        2,
        'a set-point from before enable is taken over',
        SETPOINT,
        '        self._armed_at = self._bus.now()\n',
        '        self._armed_at = 0.0\n        self._bus.request(self._slot)\n',
        (NO_RESTART, '-k', 'from_before_enable'),
    ),
    Mutant(
        2,
        'a refused enable leaves its run command standing',
        CONTROLLER,
        'a run command may stand by now\n            self._stop()',
        'a run command may stand by now',
        (NO_RESTART, '-k', 'without_run_input'),
    ),
    Mutant(
        2,
        'no set-point 0 before a run command',
        PROFILE,
        '        yield from self.zero(once=False)\n',
        '',
        (TRACE,),
    ),
    Mutant(
        3,
        'a run command that is refused ends the stop',
        PROFILE,
        '            refusal = error\n',
        '            raise\n',
        ('test/unit/families/test_movitrac31_profile.py', '-k', 'bits_are_refused'),
    ),
    Mutant(
        3,
        'what stops the motor by force is not tried',
        SEQUENCE,
        'if unconfirmed is not None and self._needs_force(seen, failure):',
        'if False:',
        (EVERY_STEP,),
    ),
    Mutant(
        3,
        'SIGHUP is left to the system',
        SIGNALS,
        ' - SUSPENDING - _OTHERS',
        ' - SUSPENDING - _OTHERS - {signal.SIGHUP}',
        (WAYS_OUT, '-k', 'SIGHUP'),
    ),
    Mutant(
        3,
        'Ctrl-Z suspends the driver',
        SIGNALS,
        'SUSPENDING = frozenset((signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU))',
        'SUSPENDING: frozenset[signal.Signals] = frozenset()',
        (WAYS_OUT, '-k', 'ctrl_z'),
    ),
    Mutant(
        3,
        'an exit does not stop the motor',
        MAIN,
        '        confirmed = self._stop_motors(why)',
        '        confirmed = True',
        (WAYS_OUT, '-k', 'SIGTERM'),
    ),
    Mutant(
        3,
        'deactivate does not stop the motor',
        NODE,
        'confirmed = self._stop_for(what, drive.deactivate)',
        'confirmed = True',
        (WAYS_OUT, '-k', 'deactivate'),
    ),
    Mutant(
        3,
        'a lifecycle shutdown does not stop the motor',
        NODE,
        "            self._stop_for('shut down', self.managed.drive.stop)\n"
        "            self._stop_for('shut down', self.managed.disconnect)\n",
        '            pass\n',
        (WAYS_OUT, '-k', 'lifecycle_shutdown'),
    ),
    Mutant(
        3,
        'an old set-point is followed for ever',
        SETPOINT,
        'left = last + timeout - self._bus.now() if timeout else math.inf',
        'left = math.inf',
        (WAYS_OUT, '-k', 'no_longer_refreshed'),
    ),
    Mutant(
        3,
        'a stop that is not confirmed is not said',
        MAIN,
        '        return not unconfirmed\n',
        '        return True\n',
        (WAYS_OUT, '-k', 'dead_line'),
    ),
    Mutant(
        3,
        'a stop waits behind everything else',
        COMMANDS,
        'carry_out(self._method.stop(control_mode), self._registers, Priority.STOP)',
        'carry_out(self._method.stop(control_mode), self._registers, Priority.REFRESH)',
        ('test/unit/drive/test_drive_commands.py', '-k', 'ahead_of_all'),
    ),
    Mutant(
        4,
        'parameters are written although they do not change',
        WRITER,
        '        if before == data:',
        '        if False:',
        (INTERFACE, '-k', 'has_already'),
    ),
    Mutant(
        4,
        'declaring or following a parameter writes it',
        'nfo_sinus_driver/node/drive_parameters.py',
        'if drive is None or self._outside != threading.get_ident():',
        'if drive is None:',
        ('test/ros/test_parameters_follow.py',),
        # what has not changed would not be written
        ((WRITER, '        if before == data:', '        if False:'),),
    ),
    Mutant(
        7,
        'what was written is believed without reading it back',
        WRITER,
        '        if kept == data:',
        '        if True:',
        ('test/unit/drive/test_parameters_change.py',),
    ),
    Mutant(
        4,
        'a monitor writes',
        DRIVE,
        "        if settings.method != 'monitor':",
        '        if True:',
        (INTERFACE, '-k', 'monitor'),
    ),
    Mutant(
        5,
        'a request reaches over its parameter',
        'nfo_sinus_driver/drive/parameter_access.py',
        'Address(*self.model[key].at(self.protocol).place)',
        'Address(*self.model[key].at(self.protocol).place[:3], 4)',
        (TRACE,),
    ),
    Mutant(
        6,
        'control is given back by MODE = Ext',
        G2,
        '            yield Write(MODE, Mode.STOP)\n\n'
        '    def remove(self, control_mode: str) -> Steps[Removal]:\n        """Write SCMD',
        '            yield Write(MODE, Mode.EXT)\n\n'
        '    def remove(self, control_mode: str) -> Steps[Removal]:\n        """Write SCMD',
        (TRACE,),
    ),
    Mutant(
        7,
        'what nobody measured is 0',
        'nfo_sinus_driver/drive/snapshot.py',
        'NAN = math.nan',
        'NAN = 0.0',
        (INTERFACE, '-k', 'before_anybody_answers'),
    ),
    Mutant(
        8,
        'a late answer is believed',
        'nfo_sinus_driver/link/serial_link.py',
        '        resynced = not isinstance(request, Write) and self._make_certain(request)',
        '        resynced = False',
        (RTU_LINK,),
    ),
    Mutant(
        8,
        'the check sum of an answer is not looked at',
        'nfo_sinus_driver/link/rtu.py',
        ' and crc(buffer[start : end - 2]) == buffer[end - 2 : end]:',
        ':',
        ('test/unit/link/test_rtu_codec.py',),
    ),
    Mutant(
        8,
        'the check sum of an ASCII answer is not looked at',
        'nfo_sinus_driver/link/modbus_ascii.py',
        '        if lrc(message) == check:',
        '        if True:',
        ('test/unit/link/test_ascii_codec.py',),
    ),
    Mutant(
        8,
        'an answer that comes twice is believed twice',
        'nfo_sinus_driver/link/late_replies.py',
        '        if self.repeated is None:',
        '        if True:',
        (ECHO,),
    ),
    Mutant(
        8,
        'the echo of a write is its answer',
        'nfo_sinus_driver/link/serial_link.py',
        '                self._echo.present = True',
        '                pass',
        (ECHO,),
    ),
    Mutant(
        8,
        'a late answer of a MOVITRAC is believed',
        'nfo_sinus_driver/link/movitrac_link.py',
        '                if movitrac.kind(answer) not in quarantined and not doubtful:',
        '                if not doubtful:',
        ('test/unit/link/test_movitrac_late.py',),
    ),
    Mutant(
        8,
        'an answer to another master of a MOVITRAC is believed',
        'nfo_sinus_driver/link/movitrac_link.py',
        ' not in quarantined and not doubtful:',
        ' not in quarantined:',
        ('test/unit/drive/test_another_master.py',),
    ),
    Mutant(
        8,
        'a late answer of another MOVITRAC is believed',
        'nfo_sinus_driver/link/late_replies.py',
        '        return any(kind in self._left(other, now) for other in others)',
        '        return False',
        ('test/unit/link/test_movitrac_late.py',),
    ),
    Mutant(
        8,
        'a value that a MOVITRAC tells twice is believed twice',
        'nfo_sinus_driver/link/movitrac_link.py',
        '(frame == self._last and arrived < soonest)',
        'False',
        ('test/unit/link/test_movitrac_late.py',),
    ),
    Mutant(
        8,
        'the sum of a frame is not looked at',
        'nfo_sinus_driver/link/movitrac.py',
        ' or check_sum(data[: length - 1]) != data[length - 1]:',
        ':',
        ('test/unit/link/test_movitrac_codec.py',),
    ),
    Mutant(
        8,
        'the remains of a value are an ACK',
        'nfo_sinus_driver/link/movitrac.py',
        '    return len(data) <= _GLITCH and _LENGTHS.keys().isdisjoint(data)',
        '    return True',
        ('test/unit/link/test_movitrac_codec.py',),
    ),
    Mutant(
        8,
        'a late answer of a CANopen node is believed',
        'nfo_sinus_driver/link/canopen_link.py',
        '        if sdo.is_among(told, self._late.quarantined(unit, now)) or (',
        '        if (',
        ('test/unit/link/test_canopen_link.py',),
    ),
    Mutant(
        8,
        'a transfer in segments is believed although another client has ended it',
        'nfo_sinus_driver/link/another_client.py',
        '        return unit in self._disturbed',
        '        return False',
        ('test/unit/link/test_another_sdo_client.py',),
    ),
    Mutant(
        8,
        'what another client asked while ours was answered is no more in doubt',
        'nfo_sinus_driver/link/another_client.py',
        '        return frozenset(self._meanwhile)',
        '        return frozenset()',
        ('test/unit/link/test_another_sdo_client.py',),
    ),
    Mutant(
        8,
        'an answer that a CANopen node tells twice is believed twice',
        'nfo_sinus_driver/link/canopen_link.py',
        '        if self._late.repeated is not None and now < sent + soonest:',
        '        if False:',
        ('test/unit/link/test_canopen_link.py',),
    ),
    Mutant(
        8,
        'a segment that is told twice is taken twice',
        'nfo_sinus_driver/link/sdo.py',
        '            if message[0] & _TOGGLE != self._toggle:',
        '            if False:',
        ('test/unit/link/test_sdo.py',),
    ),
    Mutant(
        8,
        'any answer of a gateway is the right one',
        'nfo_sinus_driver/link/modbus_tcp.py',
        '                if number == self._number:',
        '                if True:',
        ('test/unit/link/test_tcp_link.py',),
    ),
    Mutant(
        8,
        'frames follow each other without a gap',
        'nfo_sinus_driver/link/interface.py',
        '        return 0.00175 if self.baud_rate > 19200 else 3.5 * 11 / self.baud_rate',
        '        return 0.0',
        (RTU_LINK,),
    ),
    Mutant(
        3,
        'what a drive tells with a set-point waits until the poll has its turn',
        WATCH,
        '            self._look_beside()\n',
        '            self.wake()\n',
        ('test/unit/drive/test_look_beside.py', '-k', 'whatever'),
    ),
    Mutant(
        9,
        'an idle bus is silent longer than the time-out of the drive',
        WATCH,
        '                period = min(period, patience * _KEEP_ALIVE_SHARE)',
        '                pass',
        ('test/unit/drive/test_poll_schedule.py', '-k', 'kept_alive'),
    ),
    Mutant(
        9,
        'a clean exit leaves the time-out of the drive to strike',
        CONTROLLER,
        '\n        await self.method.release()\n',
        '\n',
        (WAYS_OUT, '-k', 'leaves_no_fault'),
    ),
    Mutant(
        10,
        'the README does not say what is a safety function',
        'README.md',
        'safety function',
        'function',
        ('test/unit/test_docs.py',),
    ),
    Mutant(
        9,
        'a time-out goes on where control is kept',
        'nfo_sinus_driver/drive/drive.py',
        '            if self._controller.method.keeps_control:',
        '            if False:',
        ('test/unit/drive/test_movitrac_timeout.py', '-k', 'clean_end'),
    ),
    Mutant(
        2,
        'a keypad that takes control is not asked for',
        'nfo_sinus_driver/drive/drive_state.py',
        'holder is Holder.BUS and not await self._operated_locally(priority, once)',
        'holder is Holder.BUS',
        (MOVITRAC_LAWS, '-k', 'after_trouble and keypad and status'),
    ),
    Mutant(
        2,
        'a motor that starts anew after a silence goes on',
        CONTROLLER,
        'self._why_stopped(seen) or self._why_slower(seen, before)',
        'self._why_stopped(seen)',
        (MOVITRAC_LAWS, '-k', 'short_power_cycle'),
    ),
    Mutant(
        2,
        'a card that was fitted is never asked for again',
        'nfo_sinus_driver/drive/parameter_access.py',
        '        self._denials.clear()',
        '        pass',
        ('test/unit/drive/test_movitrac_commands.py', '-k', 'fitted_meanwhile'),
    ),
)
