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

from dataclasses import dataclass

_WAYS_OUT = 'test/ros/test_ways_out.py'
_NO_RESTART = 'test/ros/test_no_restart.py'
_INTERFACE = 'test/ros/test_interface.py'
_TRACE = 'test/ros/test_trace.py'
_RTU_LINK = 'test/unit/link/test_rtu_link.py'
_ECHO = 'test/unit/link/test_echo.py'

_CONTROLLER = 'nfo_sinus_driver/drive/controller.py'
_STARTING = 'nfo_sinus_driver/drive/start_sequence.py'
_TABLE = 'nfo_sinus_driver/drive/control_state.py'
_SETPOINT = 'nfo_sinus_driver/drive/setpoint.py'
_ADVICE = 'nfo_sinus_driver/drive/diagnosis.py'
_DRIVE = 'nfo_sinus_driver/drive/drive.py'
_WATCH = 'nfo_sinus_driver/drive/poller.py'
_WRITER = 'nfo_sinus_driver/drive/parameter_writer.py'
_TUNING = 'test/unit/drive/test_tuning.py'
_COMMANDS = 'nfo_sinus_driver/drive/commands.py'
_G2 = 'nfo_sinus_driver/families/sinus_g2/profile.py'
_NODE = 'nfo_sinus_driver/node/drive_node.py'
_MAIN = 'nfo_sinus_driver/node/main.py'
_SIGNALS = 'nfo_sinus_driver/signals.py'
_SEQUENCE = 'nfo_sinus_driver/drive/stop_sequence.py'
_PROFILE = 'nfo_sinus_driver/catalog/profile.py'
_ANY_ORDER = 'test/unit/drive/test_any_order.py'
_STOP_CONFIRMED = ('test/unit/drive/test_stop_is_confirmed.py',)
_CONTROL_TAKEN = ('test/unit/drive/test_control_is_taken.py',)
_TUNING_BEGINS = ('test/unit/drive/test_tuning_begins.py', '-k', 'any_moment')
_EVERY_WAY = ('test/unit/drive/test_errands_every_way.py', '-k', 'terminals_keep')
_NO_TURN = ('test/unit/drive/test_no_turn_at_acknowledge.py',)
_G2_SCMD = (_ANY_ORDER, '-k', 'G2ModeScmd')
_G2_CONTROL = (_ANY_ORDER, '-k', 'G2DriveControl')
_OPTIMAL_SCMD = (_ANY_ORDER, '-k', 'OptimalModeScmd')


@dataclass(frozen=True)
class Mutant:
    """
    One broken copy.

    :ivar law: the number of the law in docs/architecture.md that it breaks.
    :ivar old: what stands in the file, once.
    :ivar tests: what has to fail, as arguments of pytest.
    """

    law: int
    what: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def __str__(self) -> str:
        return f'law {self.law}: {self.what}'


MUTANTS = (
    Mutant(
        1,
        'polling acknowledges faults',
        'nfo_sinus_driver/drive/drive_state.py',
        'read_at(key, priority, once=once',
        "read_at('fieldbus.inv_st_with_ack', priority, once=once",
        (_TRACE,),
    ),
    Mutant(
        2,
        'a fault does not disarm',
        _ADVICE,
        '    if seen.faulted:\n        return explain_fault',
        '    if False:\n        return explain_fault',
        (_NO_RESTART, '-k', 'fault_and_ack'),
    ),
    Mutant(
        2,
        'a keypad STOP does not disarm',
        _ADVICE,
        '    elif not seen.from_bus:\n        cause = _why',
        '    elif False:\n        cause = _why',
        (_NO_RESTART, '-k', 'keypad or mode_changed'),
    ),
    Mutant(
        2,
        'a lost RUN input does not disarm',
        _ADVICE,
        '    elif not seen.runs:\n        cause =',
        '    elif False:\n        cause =',
        (_NO_RESTART, '-k', 'run_input'),
    ),
    Mutant(
        2,
        'a control mode that was changed does not disarm',
        _ADVICE,
        '    if inverter.control_mode != control_mode:',
        '    if False:',
        ('test/unit/drive/test_setpoint_modes.py', '-k', 'at_the_keypad'),
    ),
    Mutant(
        2,
        'a fault that a refused set-point shows first is not told',
        _CONTROLLER,
        'if seen.faulted else reason)',
        'if False else reason)',
        ('test/unit/drive/test_watching.py', '-k', 'shows_first'),
    ),
    Mutant(
        6,
        'another control method takes over a motor that still ramps down',
        _DRIVE,
        '        if seen.driven and seen.from_bus:',
        '        if False:',
        ('test/unit/drive/test_control_methods.py', '-k', 'until_the_motor_stands'),
    ),
    Mutant(
        6,
        'a session changes its control method',
        _DRIVE,
        '            if getattr(settings, name) != getattr(self.settings, name):',
        '            if False:',
        ('test/unit/drive/test_control_methods.py', '-k', 'never_changes'),
    ),
    Mutant(
        2,
        'a lost line does not disarm',
        _WATCH,
        'self._controller is not None and self._controller.lost()\n',
        'False\n',
        (_NO_RESTART, '-k', 'line_gone'),
    ),
    Mutant(
        2,
        'the motor is enabled while it is being tuned',
        _CONTROLLER,
        '        if (self._state, ControlEvent.ENABLE) in control_state.TRANSITIONS:\n',
        '        if self._access is not None:\n            self._state = ControlState.IDLE\n'
        '        if True:\n',
        (_TUNING, '-k', 'two_at_a_time'),
    ),
    Mutant(
        2,
        'a tuning is taken for a motor that nobody enabled',
        _TABLE,
        '        ControlState.PROCEDURE,\n',
        '',
        (_TUNING, '-k', 'take_over'),
    ),
    Mutant(
        2,
        'a restarted driver lets run what runs',
        _CONTROLLER,
        '        if await self._method.in_control(Priority.SERVICE):\n            if seen',
        '        self._since = float("inf")\n        if False:\n            if seen',
        (_NO_RESTART, '-k', 'restarted_driver'),
    ),
    Mutant(
        2,
        'the run command is not taken back before an acknowledgement',
        _G2,
        'yield Write(self._command, Scmd.STOP, once=True)',
        'pass',
        (_NO_RESTART, '-k', 'fault_and_ack'),
    ),
    Mutant(
        2,
        'a set-point from before enable is taken over',
        _SETPOINT,
        '        self._armed_at = time.monotonic()\n',
        '        self._armed_at = 0.0\n        self._bus.request(self._slot)\n',
        (_NO_RESTART, '-k', 'from_before_enable'),
    ),
    Mutant(
        2,
        'a refused enable leaves its run command standing',
        _CONTROLLER,
        'a run command may stand by now\n            self._stop()',
        'a run command may stand by now',
        (_NO_RESTART, '-k', 'without_run_input'),
    ),
    Mutant(
        2,
        'no set-point 0 before a run command',
        _PROFILE,
        '        yield from self.zero(once=False)\n',
        '',
        (_TRACE,),
    ),
    Mutant(
        3,
        'SIGHUP is left to the system',
        _SIGNALS,
        ' - SUSPENDING - _OTHERS',
        ' - SUSPENDING - _OTHERS - {signal.SIGHUP}',
        (_WAYS_OUT, '-k', 'SIGHUP'),
    ),
    Mutant(
        3,
        'Ctrl-Z suspends the driver',
        _SIGNALS,
        'SUSPENDING = frozenset((signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU))',
        'SUSPENDING: frozenset[signal.Signals] = frozenset()',
        (_WAYS_OUT, '-k', 'ctrl_z'),
    ),
    Mutant(
        3,
        'an exit does not stop the motor',
        _MAIN,
        '        confirmed = self._stop_motors(why)',
        '        confirmed = True',
        (_WAYS_OUT, '-k', 'SIGTERM'),
    ),
    Mutant(
        3,
        'deactivate does not stop the motor',
        _NODE,
        'confirmed = self._stop_for(what, drive.deactivate)',
        'confirmed = True',
        (_WAYS_OUT, '-k', 'deactivate'),
    ),
    Mutant(
        3,
        'a lifecycle shutdown does not stop the motor',
        _NODE,
        "            self._stop_for('shut down', self.managed.drive.stop)\n"
        "            self._stop_for('shut down', self.managed.disconnect)\n",
        '            pass\n',
        (_WAYS_OUT, '-k', 'lifecycle_shutdown'),
    ),
    Mutant(
        3,
        'an old set-point is followed for ever',
        _SETPOINT,
        'left = last + timeout - time.monotonic() if timeout else math.inf',
        'left = math.inf',
        (_WAYS_OUT, '-k', 'no_longer_refreshed'),
    ),
    Mutant(
        3,
        'a stop that is not confirmed is not said',
        _MAIN,
        '        return not unconfirmed\n',
        '        return True\n',
        (_WAYS_OUT, '-k', 'dead_line'),
    ),
    Mutant(
        3,
        'a stop waits behind everything else',
        _COMMANDS,
        'carry_out(self._method.stop(control_mode), self._registers, Priority.STOP)',
        'carry_out(self._method.stop(control_mode), self._registers, Priority.REFRESH)',
        ('test/unit/drive/test_stop_first.py',),
    ),
    Mutant(
        4,
        'parameters are written although they do not change',
        _WRITER,
        '        if before == data:',
        '        if False:',
        (_INTERFACE, '-k', 'has_already'),
    ),
    Mutant(
        4,
        'declaring or following a parameter writes it',
        'nfo_sinus_driver/node/drive_parameters.py',
        'if drive is None or self._outside != threading.get_ident():',
        'if drive is None:',
        ('test/ros/test_parameters_follow.py',),
    ),
    Mutant(
        7,
        'what was written is believed without reading it back',
        _WRITER,
        '        if kept == data:',
        '        if True:',
        ('test/unit/drive/test_parameters_change.py',),
    ),
    Mutant(
        4,
        'a monitor writes',
        _DRIVE,
        "        if settings.control_method != 'monitor':",
        '        if True:',
        (_INTERFACE, '-k', 'monitor'),
    ),
    Mutant(
        5,
        'a request reaches over its parameter',
        'nfo_sinus_driver/drive/parameter_access.py',
        'Address(*self.model[key].at(self.protocol).place)',
        'Address(*self.model[key].at(self.protocol).place[:3], 4)',
        (_TRACE,),
    ),
    Mutant(
        6,
        'control is given back by MODE = Ext',
        _G2,
        '            yield Write(MODE, Mode.STOP)\n\n'
        '    def remove(self, control_mode: str) -> Steps[Removal]:\n        """Write SCMD',
        '            yield Write(MODE, Mode.EXT)\n\n'
        '    def remove(self, control_mode: str) -> Steps[Removal]:\n        """Write SCMD',
        (_TRACE,),
    ),
    Mutant(
        7,
        'what nobody measured is 0',
        'nfo_sinus_driver/drive/snapshot.py',
        'NAN = math.nan',
        'NAN = 0.0',
        (_INTERFACE, '-k', 'before_anybody_answers'),
    ),
    Mutant(
        8,
        'a late answer is believed',
        'nfo_sinus_driver/link/serial_link.py',
        '        resynced = not isinstance(request, Write) and self._make_certain(request)',
        '        resynced = False',
        (_RTU_LINK,),
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
        '            if lrc(data[:-1]) == data[-1]:',
        '            if True:',
        ('test/unit/link/test_ascii_codec.py',),
    ),
    Mutant(
        8,
        'an answer that comes twice is believed twice',
        'nfo_sinus_driver/link/late_replies.py',
        '        if self.repeated is None:',
        '        if True:',
        (_ECHO,),
    ),
    Mutant(
        8,
        'the echo of a write is its answer',
        'nfo_sinus_driver/link/serial_link.py',
        '                self._echo.present = True',
        '                pass',
        (_ECHO,),
    ),
    Mutant(
        8,
        'any answer of a gateway is the right one',
        'nfo_sinus_driver/link/tcp_link.py',
        '                if number == self._number:',
        '                if True:',
        ('test/unit/link/test_tcp_link.py',),
    ),
    Mutant(
        8,
        'frames follow each other without a gap',
        'nfo_sinus_driver/link/settings.py',
        '        return 0.00175 if self.baud_rate > 19200 else 3.5 * 11 / self.baud_rate',
        '        return 0.0',
        (_RTU_LINK,),
    ),
    Mutant(
        9,
        'an idle bus is silent longer than the time-out of the drive',
        _WATCH,
        '            period = min(period, self._inverter.sio_tot * _KEEP_ALIVE_SHARE)',
        '            pass',
        (_WAYS_OUT, '-k', 'kept_alive'),
    ),
    Mutant(
        9,
        'a clean exit leaves the time-out of the drive to strike',
        _CONTROLLER,
        '        await self._method.release()\n',
        '',
        (_WAYS_OUT, '-k', 'leaves_no_fault'),
    ),
    Mutant(
        10,
        'the README does not say what is a safety function',
        'README.md',
        'safety function',
        'function',
        ('test/unit/test_docs.py',),
    ),
    # what the histories of any order have to notice
    *(
        Mutant(
            2,
            f'{what} does not disarm ({tests[-1]})',
            _CONTROLLER,
            '        if reason is not None:\n            self._stop()',
            f'        if {new}:\n            self._stop()',
            tests,
        )
        for tests in (_G2_SCMD, _G2_CONTROL, _OPTIMAL_SCMD)
        for what, new in (
            ('in any order: a fault', 'reason and not seen.faulted'),
            (
                'in any order: keypad, terminals or another master',
                'reason and (seen.from_bus or seen.faulted)',
            ),
            (
                'in any order: a lost RUN input',
                'reason and (seen.runs or seen.faulted or not seen.from_bus)',
            ),
        )
    ),
    Mutant(
        2,
        'in any order: a lost line does not disarm',
        _WATCH,
        'self._controller is not None and self._controller.lost()\n',
        'False\n',
        _G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: a driver that begins lets run what runs',
        _CONTROLLER,
        '        if await self._method.in_control(Priority.SERVICE):\n            if seen',
        '        self._since = float("inf")\n        if False:\n            if seen',
        _G2_CONTROL,
    ),
    Mutant(
        2,
        'in any order: another control mode does not disarm',
        _ADVICE,
        '    if inverter.control_mode != control_mode:',
        '    if False:',
        _G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: no set-point 0 before a run command',
        _PROFILE,
        '        yield from self.zero(once=False)\n',
        '',
        _G2_CONTROL,
    ),
    Mutant(
        2,
        'in any order: a set-point from before enable is taken over',
        _SETPOINT,
        '        self._armed_at = time.monotonic()\n',
        '        self._armed_at = 0.0\n        self._bus.request(self._slot)\n',
        _OPTIMAL_SCMD,
    ),
    Mutant(
        2,
        'in any order: a refused enable leaves its run command standing',
        _CONTROLLER,
        'a run command may stand by now\n            self._stop()',
        'a run command may stand by now',
        _G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: what ends a ride leaves the run command standing',
        _CONTROLLER,
        '            self._stop()\n            self._tell_stopped(reason)',
        '            self._happened(ControlEvent.STOP)\n            self._tell_stopped(reason)',
        _G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: a stop that a fault holds is forgotten',
        _SEQUENCE,
        '            return _Outcome.BLOCKED_BY_FAULT\n',
        '            return _Outcome.CONFIRMED\n',
        _G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: a start that the RUN input ended waits for it',
        _STARTING,
        ' or (delayed and seen.standby):',
        ':',
        ('test/unit/drive/test_any_order_found.py',),
    ),
    Mutant(
        3,
        'in any order: an old set-point is followed for ever',
        _SETPOINT,
        'left = last + timeout - time.monotonic() if timeout else math.inf',
        'left = math.inf',
        _OPTIMAL_SCMD,
    ),
    Mutant(
        3,
        'in any order: a stop is answered before it is confirmed',
        _SEQUENCE,
        '        while task is not None and not await',
        '        while False and not await',
        _G2_SCMD,
    ),
    Mutant(
        3,
        'in any order: a motor that cannot be stopped is not said to be',
        _SEQUENCE,
        '            if time.monotonic() >= complain_at:',
        '            if False:',
        _G2_SCMD,
    ),
    Mutant(
        3,
        'in any order: deactivate does not stop the motor',
        _DRIVE,
        '        return await self._controller.stop(patience)\n',
        '        return None\n',
        _G2_CONTROL,
    ),
    Mutant(
        3,
        'in any order: a clean-up does not stop the motor',
        _DRIVE,
        '            return await self._controller.release(timeout)\n',
        '            return Report(Cause.ONLY_WATCHED)\n',
        _OPTIMAL_SCMD,
    ),
    Mutant(
        3,
        'in any order: a drive that is lost is still told as connected',
        _WATCH,
        '        inverter.connected = False\n        why =',
        '        why =',
        _G2_CONTROL,
    ),
    Mutant(
        7,
        'in any order: the status of a fault is not told',
        _WATCH,
        '        self._publish(seen)',
        '        seen.faulted or self._publish(seen)',
        (_ANY_ORDER, '-k', 'OptimalMonitor'),
    ),
    Mutant(
        1,
        'in any order: polling acknowledges faults',
        'nfo_sinus_driver/drive/drive_state.py',
        'read_at(key, priority, once=once',
        "read_at('fieldbus.inv_st_with_ack', priority, once=once",
        (_ANY_ORDER, '-k', 'G2Monitor'),
    ),
    Mutant(
        4,
        'in any order: a monitor writes',
        _DRIVE,
        "        if settings.control_method != 'monitor':",
        '        if True:',
        (_ANY_ORDER, '-k', 'G2Monitor'),
    ),
    Mutant(
        6,
        'in any order: both directions at once',
        _G2,
        'switched_on | Control.ENABLE_OP,',
        'switched_on | Control.ENABLE_OP | Control.ENABLE_REV_OP,',
        _G2_CONTROL,
    ),
    Mutant(
        6,
        'in any order: the register of the other method is written',
        _G2,
        '            yield from self._change(~_RUN, Control(0))\n',
        '            yield from self._change(~_RUN, Control(0))\n'
        "            yield Write('fieldbus.scmd', 0)\n",
        _G2_CONTROL,
    ),
    Mutant(
        3,
        'a tuning that refuses the stop is taken for a motor that stands',
        _SEQUENCE,
        '        if seen.tuning:\n',
        '        if False:\n',
        _STOP_CONFIRMED,
    ),
    Mutant(
        2,
        'an enable waits for a stop and then runs',
        _TABLE,
        'ENABLE        .         ENABLING  .        .        .         .        .     ',
        'ENABLE        .         ENABLING  .        .        .         .        ENABLING',
        _STOP_CONFIRMED,
    ),
    Mutant(
        3,
        'a stop that was lost is not repeated at once',
        _SEQUENCE,
        '        elif self._outcome is not _Outcome.UNHEARD:\n',
        '        else:\n',
        _STOP_CONFIRMED,
    ),
    Mutant(
        2,
        'a fault is acknowledged with the run command still there',
        _G2,
        '        if ours and (yield from self.remove(control_mode)) is not Removal.COMMAND:\n',
        '        if False:\n',
        _NO_TURN,
    ),
    Mutant(
        2,
        'nothing follows the acknowledgement of a drive that refuses everything',
        _G2,
        '                yield AcknowledgeThenWrite(INV_ST_WITH_ACK, self._soonest)\n',
        '                yield Acknowledge(INV_ST_WITH_ACK)\n',
        _NO_TURN,
    ),
    Mutant(
        2,
        'control is taken with the set-point of an earlier session',
        _STARTING,
        '        if not self._inverter.settings_need_control:\n',
        '        if False:\n',
        _CONTROL_TAKEN,
    ),
    Mutant(
        2,
        'no stop follows MODE = Bus',
        _G2,
        '                yield stop\n                return\n',
        '                return\n',
        _CONTROL_TAKEN,
    ),
    Mutant(
        2,
        'a tuning that waits for the line is sent after a stop',
        _COMMANDS,
        'await self._registers.write(write, Priority.STOP, require_wanted)',
        'await self._registers.write(write, Priority.STOP)',
        _TUNING_BEGINS,
    ),
    Mutant(
        3,
        'a stop is confirmed by what was seen before its reason',
        _SEQUENCE,
        '        if self._reasons > reasons:\n',
        '        if False:\n',
        _STOP_CONFIRMED,
    ),
    Mutant(
        2,
        'a quick stop ends what keeps others from enabling',
        _SEQUENCE,
        '            self._held -= 1\n',
        '            self._held = 0\n',
        _STOP_CONFIRMED,
    ),
    Mutant(
        2,
        'the acknowledgement of a serial fault takes control from the terminals',
        _G2,
        '        if not elsewhere:\n            yield from self._remove_control()\n',
        '        yield from self._remove_control()\n',
        _EVERY_WAY,
    ),
    Mutant(
        3,
        'an exit does not count a drive that is just being connected to',
        _MAIN,
        '            if self._may_be_there(node) and not',
        '            if node.managed.drive.identity is not None and not',
        ('test/ros/test_no_false_success.py', '-k', 'before_the_first_answer'),
    ),
)
