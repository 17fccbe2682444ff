# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Ways to break the laws that histories of any order, and what they found, have to notice."""

from __future__ import annotations

from mutant import ADVICE
from mutant import ANY_ORDER
from mutant import COMMANDS
from mutant import CONTROL_TAKEN
from mutant import CONTROLLER
from mutant import DRIVE
from mutant import G2
from mutant import G2_CONTROL
from mutant import G2_SCMD
from mutant import LAW_2
from mutant import MAIN
from mutant import NO_STOP_FORGOTTEN
from mutant import NO_TURN
from mutant import OPTIMAL_SCMD
from mutant import PROFILE
from mutant import SEQUENCE
from mutant import SETPOINT
from mutant import STARTING
from mutant import STOP_CONFIRMED
from mutant import TABLE
from mutant import TERMINALS_KEEP
from mutant import TUNING_BEGINS
from mutant import WATCH
from mutant import Mutant

HISTORIES = (
    # what the histories of any order have to notice
    *(
        Mutant(
            2,
            f'{what} does not disarm ({tests[-1]})',
            CONTROLLER,
            '        if reason is not None:\n            self._stop()',
            f'        if {new}:\n            self._stop()',
            tests,
        )
        for tests in (G2_SCMD, G2_CONTROL, OPTIMAL_SCMD)
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
        WATCH,
        'self._controller is not None and self._controller.lost()\n',
        'False\n',
        G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: a driver that begins lets run what runs',
        CONTROLLER,
        '        if await self.method.in_control(Priority.SERVICE):\n            turns',
        '        self._since = float("inf")\n        if False:\n            turns',
        G2_CONTROL,
        # a poll would find it, too
        ((CONTROLLER, '            reason = Report(Cause.RUNS_UNASKED)\n', '            pass\n'),),
    ),
    Mutant(
        2,
        'in any order: another control mode does not disarm',
        ADVICE,
        '    if inverter.control_mode != control_mode:',
        '    if False:',
        G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: no set-point 0 before a run command',
        PROFILE,
        '        yield from self.zero(once=False)\n',
        '',
        G2_CONTROL,
    ),
    Mutant(
        2,
        'in any order: a set-point from before enable is taken over',
        SETPOINT,
        '        self._armed_at = self._bus.now()\n',
        '        self._armed_at = 0.0\n        self._bus.request(self._slot)\n',
        OPTIMAL_SCMD,
    ),
    Mutant(
        2,
        'in any order: a refused enable leaves its run command standing',
        CONTROLLER,
        'a run command may stand by now\n            self._stop()',
        'a run command may stand by now',
        G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: what ends a ride leaves the run command standing',
        CONTROLLER,
        '            self._stop()\n            self._tell_stopped(reason)',
        '            self._happened(ControlEvent.STOP)\n            self._tell_stopped(reason)',
        G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: a stop that a fault holds is forgotten',
        SEQUENCE,
        '            return _Outcome.BLOCKED_BY_FAULT\n',
        '            return _Outcome.CONFIRMED\n',
        G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: a start that the RUN input ended waits for it',
        STARTING,
        ' or (delayed and seen.standby):',
        ':',
        ('test/unit/drive/test_any_order_found.py',),
    ),
    Mutant(
        3,
        'in any order: an old set-point is followed for ever',
        SETPOINT,
        'left = last + timeout - self._bus.now() if timeout else math.inf',
        'left = math.inf',
        OPTIMAL_SCMD,
    ),
    Mutant(
        3,
        'in any order: a stop is answered before it is confirmed',
        SEQUENCE,
        '        while task is not None and not await',
        '        while False and not await',
        G2_SCMD,
        # which must not wait instead, in the only thread
        (
            (
                SEQUENCE,
                'task is not None and task.future.e',
                'task is not None and task.future.done() and task.future.e',
            ),
        ),
    ),
    Mutant(
        3,
        'in any order: a motor that cannot be stopped is not said to be',
        SEQUENCE,
        '            if self._bus.now() >= complain_at or (stood and not stands):',
        '            if False:',
        G2_SCMD,
    ),
    Mutant(
        3,
        'in any order: deactivate does not stop the motor',
        DRIVE,
        '        return await self._controller.stop(patience)\n',
        '        return None\n',
        G2_CONTROL,
    ),
    Mutant(
        3,
        'in any order: a clean-up does not stop the motor',
        DRIVE,
        '            answer = await self._controller.release(timeout)\n',
        '            answer = Report(Cause.ONLY_WATCHED)\n',
        OPTIMAL_SCMD,
    ),
    Mutant(
        3,
        'in any order: a drive that is lost is still told as connected',
        WATCH,
        '        inverter.lost()\n        why =',
        '        why =',
        G2_CONTROL,
    ),
    Mutant(
        7,
        'in any order: the status of a fault is not told',
        WATCH,
        '        self._publish(seen)',
        '        seen.faulted or self._publish(seen)',
        (ANY_ORDER, '-k', 'OptimalMonitor'),
    ),
    Mutant(
        1,
        'in any order: polling acknowledges faults',
        'nfo_sinus_driver/drive/drive_state.py',
        'read_reply(key, priority, once=once',
        "read_reply('fieldbus.inv_st_with_ack', priority, once=once",
        (ANY_ORDER, '-k', 'G2Monitor'),
    ),
    Mutant(
        4,
        'in any order: a monitor writes',
        DRIVE,
        "        if settings.method != 'monitor':",
        '        if True:',
        (ANY_ORDER, '-k', 'G2Monitor'),
    ),
    Mutant(
        6,
        'in any order: both directions at once',
        G2,
        'switched_on | Control.ENABLE_OP,',
        'switched_on | Control.ENABLE_OP | Control.ENABLE_REV_OP,',
        G2_CONTROL,
    ),
    Mutant(
        6,
        'in any order: the register of the other method is written',
        G2,
        '        yield from self._stop_by(self._change_or_write(~_RUN, Control(0)), *zeroes)\n',
        '        yield from self._stop_by(self._change_or_write(~_RUN, Control(0)), *zeroes)\n'
        "        yield Write('fieldbus.scmd', 0)\n",
        G2_CONTROL,
    ),
    Mutant(
        3,
        'a tuning that refuses the stop is taken for a motor that stands',
        SEQUENCE,
        '        if seen.tuning and refusal:\n',
        '        if refusal and seen.tuning:\n            return None\n        if False:\n',
        STOP_CONFIRMED,
    ),
    Mutant(
        2,
        'an enable waits for a stop and then runs',
        TABLE,
        'ENABLE        .         ENABLING  .        .        .         .        .     ',
        'ENABLE        .         ENABLING  .        .        .         .        ENABLING',
        LAW_2,
    ),
    Mutant(
        3,
        'a stop that was lost is not repeated at once',
        SEQUENCE,
        '        elif self._outcome is not _Outcome.UNHEARD:\n',
        '        else:\n',
        STOP_CONFIRMED,
    ),
    Mutant(
        2,
        'a fault is acknowledged with the run command still there',
        G2,
        '        if ours and (yield from self.remove(control_mode)) is not Removal.COMMAND:\n',
        '        if False:\n',
        NO_TURN,
    ),
    Mutant(
        2,
        'nothing follows the acknowledgement of a drive that refuses everything',
        G2,
        '                yield AcknowledgeThenWrite(INV_ST_WITH_ACK, self._soonest)\n',
        '                yield Acknowledge(INV_ST_WITH_ACK)\n',
        NO_TURN,
    ),
    Mutant(
        2,
        'control is taken with the set-point of an earlier session',
        STARTING,
        '        if not self._inverter.settings_need_control:\n',
        '        if False:\n',
        CONTROL_TAKEN,
    ),
    Mutant(
        2,
        'no stop follows MODE = Bus',
        G2,
        '                yield stop\n                return\n',
        '                return\n',
        CONTROL_TAKEN,
    ),
    Mutant(
        2,
        'a tuning that waits for the line is sent after a stop',
        COMMANDS,
        'await self._registers.write(write, Priority.STOP, require_wanted)',
        'await self._registers.write(write, Priority.STOP)',
        TUNING_BEGINS,
    ),
    Mutant(
        3,
        'a stop is confirmed by what was seen before its reason',
        SEQUENCE,
        '        if self._reasons > reasons:\n',
        '        if False:\n',
        STOP_CONFIRMED,
        # a status from before the stop is waited out, too
        ((SEQUENCE, '            self._told_at = math.inf\n            self._reasons += 1\n', ''),),
    ),
    Mutant(
        2,
        'a quick stop ends what keeps others from enabling',
        SEQUENCE,
        '            self._held -= 1\n',
        '            self._held = 0\n',
        STOP_CONFIRMED,
    ),
    Mutant(
        2,
        'the acknowledgement of a serial fault takes control from the terminals',
        G2,
        '        if not elsewhere:\n            yield from self._remove_control()\n',
        '        yield from self._remove_control()\n',
        TERMINALS_KEEP,
    ),
    Mutant(
        3,
        'an exit does not count a drive that is just being connected to',
        MAIN,
        '            if self._may_be_there(node) and not',
        '            if node.managed.drive.identity is not None and not',
        ('test/ros/test_no_false_success.py', '-k', 'only_answer'),
        # who does not release the drive does not learn it either
        (
            (
                MAIN,
                '            elif node.managed.drive.heard:',
                '            elif node.managed.drive.identity is not None:',
            ),
        ),
    ),
    # what reading the controller has found
    Mutant(
        3,
        'a drive that is left alone while it runs is not stopped',
        CONTROLLER,
        '        if commanded:\n            self._stop()\n',
        '',
        NO_STOP_FORGOTTEN,
    ),
    Mutant(
        3,
        'an attempt that fails at once confirms the stop',
        SEQUENCE,
        '        self._report_fault()\n        return self._outcome',
        '        self._report_end()\n        return self._outcome',
        NO_STOP_FORGOTTEN,
    ),
    Mutant(
        2,
        'a drive is enabled while it is waited for that its motor stands',
        CONTROLLER,
        '        with self._stopped_by_itself():\n            return await self._release(',
        '        if True:\n            return await self._release(',
        NO_STOP_FORGOTTEN,
    ),
    Mutant(
        3,
        'a loss in use leads to where nothing is stopped',
        TABLE,
        'LOST          .         OFFLINE   STOPPING STOPPING',
        'LOST          .         OFFLINE   STOPPING OFFLINE ',
        ('test/unit/drive/test_control_state.py',),
    ),
)
