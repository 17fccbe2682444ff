# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Ways to break the laws that histories of any order, and what they found, have to notice."""

from __future__ import annotations

from mutant import (
    ANY_ORDER,
    CONTROL_TAKEN,
    G2_CONTROL,
    G2_SCMD,
    LAW_2,
    NO_STOP_FORGOTTEN,
    NO_TURN,
    OPTIMAL_SCMD,
    STOP_CONFIRMED,
    TERMINALS_KEEP,
    TUNING_BEGINS,
    Mutant,
)

HISTORIES = (
    # what the histories of any order have to notice
    *(
        Mutant(
            2,
            f'{what} does not end the following of set-points ({tests[-1]})',
            'Controller.on_status',
            '        if reason is not None:\n            self._sequence.start(reason)',
            f'        if {new}:\n            self._sequence.start(reason)',
            tests,
        )
        for tests in (G2_SCMD, G2_CONTROL, OPTIMAL_SCMD)
        for what, new in (
            ('in any order: a fault', 'reason and not seen.faulted'),
            (
                'in any order: keypad, terminals or another master',
                'reason and (status.from_bus or status.faulted)',
            ),
            (
                'in any order: a lost RUN input',
                'reason and (status.runs or status.faulted or not status.from_bus)',
            ),
        )
    ),
    Mutant(
        2,
        'control is not told of a loss',
        'Poller._mark_lost',
        'self._controller is not None and self._controller.lost(why)\n',
        'False\n',
        ('test_no_stop_is_forgotten.py',),
    ),
    Mutant(
        2,
        'in any order: a driver that begins lets run what runs',
        'Controller.stop_unexpected_run',
        '        if await self.in_control(Priority.SERVICE):\n            turns',
        '        self._control.since = float("inf")\n        if False:\n            turns',
        G2_CONTROL,
        # a poll would find it, too
        ((
            'Controller._why_stopped_again',
            '            return Report(Cause.RUNS_UNASKED)\n',
            '            pass\n',
        ),),
    ),
    Mutant(
        2,
        'in any order: no set-point 0 before a run command',
        'SetpointTarget.set_to_zero',
        '        yield from self.zero(retry=True)\n',
        '',
        G2_CONTROL,
    ),
    Mutant(
        2,
        'in any order: a set-point from before enable is taken over',
        'Setpoint.follow',
        '        self.following_since = self._bus.now()\n',
        '        self.following_since = 0.0\n        self._bus.request(self._slot)\n',
        OPTIMAL_SCMD,
    ),
    Mutant(
        2,
        'in any order: a refused enable leaves its run command standing',
        'Controller._start',
        'a run command may be active by now\n'
        '            self._sequence.start(Report(Cause.ENABLE_FAILED, why=report_of(error)))',
        'a run command may be active by now',
        G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: what ends a run leaves the run command standing',
        'Controller.on_status',
        '            self._sequence.start(reason)\n            self._report_stop(reason)',
        '            self._control.dispatch(ControlEvent.STOP)\n'
        '            self._report_stop(reason)',
        G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: a stop that a fault holds is forgotten',
        'StopSequence._try_once',
        '            return _Outcome.BLOCKED_BY_FAULT\n',
        '            return _Outcome.CONFIRMED\n',
        G2_SCMD,
    ),
    Mutant(
        2,
        'in any order: a start that the RUN input ended waits for it',
        '_StepTime._is_late',
        'return forgotten or ',
        'return ',
        ('test_any_order_found.py',),
    ),
    Mutant(
        3,
        'in any order: a stop that a fault has refused waits for measured values',
        'StopSequence._remove_in_fault',
        'self._method.remove(control_mode),\n            Priority.STOP,',
        'self._method.remove(control_mode),\n            Priority.SERVICE,',
        ('test_any_order_found.py',),
    ),
    Mutant(
        3,
        'in any order: a stop waits although the fault that refused it is over',
        'StopSequence._try_once',
        'return _Outcome.UNANSWERED if over else _Outcome.UNCONFIRMED',
        'return _Outcome.UNCONFIRMED',
        ('test_any_order_found.py',),
    ),
    Mutant(
        3,
        'in any order: an old set-point is followed for ever',
        'Setpoint._watch_age',
        'left = last + timeout - self._bus.now() if timeout else math.inf',
        'left = math.inf',
        OPTIMAL_SCMD,
    ),
    Mutant(
        3,
        'in any order: a stop is answered before it is confirmed',
        'StopSequence.wait_confirmed',
        '        while task is not None and not await',
        '        while False and not await',
        G2_SCMD,
        # which must not wait instead, in the only thread
        (
            (
                'StopSequence.wait_confirmed',
                'task is not None and task.future.e',
                'task is not None and task.future.done() and task.future.e',
            ),
        ),
    ),
    Mutant(
        3,
        'in any order: a motor that cannot be stopped is not said to be',
        'StopSequence._keep_trying',
        '            if self._bus.now() >= self._complain_at or (stood and not stands):',
        '            if False:',
        G2_SCMD,
    ),
    Mutant(
        3,
        'in any order: deactivate does not stop the motor',
        'Drive._deactivate',
        '        return await self._controller.stop(why, patience)\n',
        '        return None\n',
        G2_CONTROL,
    ),
    Mutant(
        3,
        'a clean-up does not stop the motor',
        'Drive.disconnect',
        'answer = await self._controller.release(timeout, why, self._drive_timeout.undo)\n',
        'answer = Report(Cause.ONLY_WATCHED)\n',
        ('test_laws.py', '-k', 'way_out'),
    ),
    Mutant(
        3,
        'in any order: a drive that is lost is still reported as connected',
        'Poller._mark_lost',
        '        self._contact.dispatch(ContactEvent.LOST)\n        why =',
        '        why =',
        G2_CONTROL,
    ),
    Mutant(
        7,
        'in any order: the status of a fault is not reported',
        'Poller._poll',
        '        self._publish(status)',
        '        status.faulted or self._publish(status)',
        (ANY_ORDER, '-k', 'OptimalMonitor'),
    ),
    Mutant(
        1,
        'in any order: polling acknowledges faults',
        'StatusReader._read_int',
        'read_reply(key, priority, retry=retry',
        "read_reply('fieldbus.inv_st_with_ack', priority, retry=retry",
        (ANY_ORDER, '-k', 'G2Monitor'),
    ),
    Mutant(
        4,
        'in any order: a monitor writes',
        'Drive.__init__',
        "        if settings.method != 'monitor':",
        '        if True:',
        (ANY_ORDER, '-k', 'G2Monitor'),
    ),
    Mutant(
        6,
        'in any order: both directions at once',
        'DriveControl.run',
        'switched_on | ControlWord.ENABLE_OP,',
        'switched_on | ControlWord.ENABLE_OP | ControlWord.ENABLE_REV_OP,',
        G2_CONTROL,
    ),
    Mutant(
        6,
        'in any order: the register of the other method is written',
        'DriveControl.stop',
        '        yield from self._stop_by(self._change_or_write(~_RUN, ControlWord(0)), *zeroes)\n',
        '        yield from self._stop_by(self._change_or_write(~_RUN, ControlWord(0)), *zeroes)\n'
        "        yield Write('fieldbus.scmd', 0)\n",
        G2_CONTROL,
    ),
    Mutant(
        3,
        'a tuning that refuses the stop is taken for a motor that stands',
        'StopSequence._why_unconfirmed',
        '        if status.tuning and refusal:\n',
        '        if refusal and status.tuning:\n            return None\n        if False:\n',
        STOP_CONFIRMED,
    ),
    Mutant(
        2,
        'an enable waits for a stop and then runs',
        '_TABLE',
        'ENABLE        .         ENABLING  .        .        .         .        .',
        'ENABLE        .         ENABLING  .        .        .         ENABLING .',
        LAW_2,
    ),
    Mutant(
        3,
        'a stop that was lost is not repeated at once',
        'StopSequence._rest',
        '        elif outcome is not _Outcome.UNANSWERED:\n',
        '        else:\n',
        STOP_CONFIRMED,
    ),
    Mutant(
        2,
        'a fault is acknowledged with the run command still there',
        'ModeScmd._acknowledge_by_reading',
        '        if ours and (yield from self.remove(control_mode)) is not Removal.COMMAND:\n',
        '        if False:\n',
        NO_TURN,
    ),
    Mutant(
        2,
        'nothing follows the acknowledgement of a drive that refuses everything',
        'ModeScmd._acknowledge_by_reading',
        '                yield AcknowledgeThenWrite(INV_ST_WITH_ACK, self._soonest)\n',
        '                yield Acknowledge(INV_ST_WITH_ACK)\n',
        NO_TURN,
    ),
    Mutant(
        2,
        'control is taken with the set-point of an earlier session',
        'StartSequence.take_control',
        '        if not self._state.nameplate.is_older:\n',
        '        if False:\n',
        CONTROL_TAKEN,
    ),
    Mutant(
        2,
        'no stop follows MODE = Bus',
        'ModeScmd.take_control',
        '                yield stop\n                return\n',
        '                return\n',
        CONTROL_TAKEN,
    ),
    Mutant(
        2,
        'a tuning that waits for the line is sent after a stop',
        'Procedures.command',
        '.params.write(write, Priority.STOP, access.require_wanted)',
        '.params.write(write, Priority.STOP)',
        TUNING_BEGINS,
    ),
    Mutant(
        3,
        'a stop is confirmed by what was seen before its reason',
        'StopSequence._attempt',
        '        if self._reasons > reasons:\n',
        '        if False:\n',
        STOP_CONFIRMED,
        # a status from before the stop is waited out, too
        ((
            'StopSequence.restart',
            '            self._sent_at = self._forced_at = math.inf\n'
            '            self._measured = None\n',
            '',
        ),),
    ),
    Mutant(
        2,
        'a quick stop ends what keeps others from enabling',
        'StopSequence.external_stop',
        '            self._external -= 1\n',
        '            self._external = 0\n',
        STOP_CONFIRMED,
    ),
    Mutant(
        2,
        'the acknowledgement of a serial fault takes control from the terminals',
        'ModeScmd.acknowledge',
        '        if not elsewhere:\n            yield from self._remove_control()\n',
        '        yield from self._remove_control()\n',
        TERMINALS_KEEP,
    ),
    Mutant(
        3,
        'an exit does not count a drive that is just being connected to',
        'DriverProcess._stop_motors',
        '            if self._may_be_there(node) and not',
        '            if node.managed.drive.identity is not None and not',
        ('test_no_false_success.py', '-k', 'only_answer'),
        # who does not release the drive does not learn it either
        (
            (
                'DriverProcess._stop_motors',
                '            elif node.managed.drive.ever_responded and',
                '            elif node.managed.drive.identity is not None and',
            ),
        ),
    ),
    # what reading the controller has found
    Mutant(
        3,
        'a drive that is left alone while it runs is not stopped',
        'Controller.disconnected',
        '        if self._control.stopping:\n            self._sequence.start()\n',
        '',
        NO_STOP_FORGOTTEN,
    ),
    Mutant(
        3,
        'an attempt that fails at once confirms the stop',
        'StopSequence',
        '\n        return outcome\n\n    def _report_end',
        '\n        self._control.dispatch(ControlEvent.STOPPED)\n'
        '        return outcome\n\n    def _report_end',
        NO_STOP_FORGOTTEN,
    ),
    Mutant(
        2,
        'a drive is enabled while it is waited for that its motor stands',
        'Controller.release',
        '        with self._sequence.external_stop(why):\n'
        '            stop = self._stopped if ended',
        '        if True:\n            stop = self._stopped if ended',
        NO_STOP_FORGOTTEN,
    ),
    Mutant(
        3,
        'a loss in use leads to where nothing is stopped',
        '_TABLE',
        'LOST          .         OFFLINE   STOPPING STOPPING',
        'LOST          .         OFFLINE   STOPPING OFFLINE ',
        ('test_control_table.py',),
    ),
)
