# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What reading the controller found: a stop that is not carried out, or an enable beside one."""

from __future__ import annotations

from support.rig import Rig

from nfo_sinus_driver.catalog.profile import Steps
from nfo_sinus_driver.drive.known.control_state import ControlState
from nfo_sinus_driver.drive.known.events import Cause, Report


def test_a_drive_that_is_left_alone_while_it_runs_is_stopped() -> None:
    with Rig() as rig:
        rig.drive.activate()
        connecting = rig.drive.connect(parameters=True)
        rig.wait_until(lambda: rig.drive.state.contact.connected)
        # an enable need not wait for the end of the reading
        rig.drive.enable()
        rig.wait_until(lambda: rig.drive.following)
        rig.send(20.0)
        rig.pass_time(0.2)
        assert rig.far.motor.driven and not connecting.done()
        rig.line.state = 'silent'
        rig.answer(connecting)
        assert connecting.exception() is not None
        assert rig.drive.stop_unconfirmed
        rig.line.mend()
        rig.pass_time(3.0)
        assert not rig.far.motor.driven and not rig.drive.stop_unconfirmed
        # and it is of use again
        rig.send(None)
        rig.turn()


def test_a_drive_that_is_being_left_is_not_enabled() -> None:
    with Rig(parameters={'control.retard': 8.0}) as rig:
        rig.turn(40.0)
        rig.asked.clear()
        leaving = rig.drive.disconnect(1.0)
        rig.pass_time(0.3)
        assert not leaving.done()
        assert 'not active' in rig.answer(rig.drive.enable())
        rig.drive.activate()
        enabled = rig.drive.enable()
        rig.answer(enabled)
        assert enabled.exception() is not None
        assert 'left to its ramp' in rig.answer(leaving)
        rig.pass_time(10.0)
        assert not rig.drive.following and not rig.far.motor.driven
        # not only because the last stop of the release has ended it
        assert not any(rig.written('fieldbus.scmd'))


def test_an_attempt_that_fails_at_once_confirms_nothing() -> None:
    with Rig() as rig:
        rig.turn()
        controller = rig.drive._controller
        stop, left = controller.method.stop, [7]

        def fail(control_mode: str) -> Steps[None]:
            if left[0]:
                left[0] -= 1
                raise ValueError('a mistake')
            yield from stop(control_mode)

        controller.method.stop = fail  # type: ignore[method-assign]
        answer = rig.drive.stop()
        rig.pass_time(0.05)
        assert rig.drive.state.control.state is ControlState.STOPPING
        enabled = rig.drive.enable()
        rig.answer(enabled)
        assert enabled.exception() is not None
        rig.answer(answer)
        rig.pass_time(2.0)
        assert not rig.far.motor.driven
        rig.notes.events.clear()


def test_a_mistake_in_a_quick_stop_ends_in_a_stop() -> None:
    with Rig() as rig:
        rig.turn()
        controller = rig.drive._controller

        def fail(control_mode: str) -> Steps[None]:
            raise ValueError('a mistake')

        controller.method.quick_stop = fail  # type: ignore[method-assign]
        answer = rig.drive.quick_stop()
        rig.answer(answer)
        assert answer.exception() is not None
        rig.pass_time(3.0)
        assert not rig.far.motor.driven and rig.drive.state.control.state is ControlState.IDLE
        # not only because a poll has found it running
        assert not rig.notes.said(Cause.STOPPED_BECAUSE)
        rig.notes.events.clear()


def test_a_refused_set_point_and_a_loss_leave_no_stop_that_is_not_shown() -> None:
    with Rig() as rig:
        rig.turn()
        controller = rig.drive._controller
        controller.on_status = lambda status: False  # type: ignore[method-assign]
        controller.refused(Report(Cause.NO_ANSWER_YET))
        rig.pass_time(0.3)
        assert rig.drive.state.control.state is ControlState.IDLE
        rig.line.state = 'silent'
        rig.pass_time(4.0)
        assert rig.drive.state.control.stopping
        assert rig.drive.state.control.state is ControlState.STOPPING
