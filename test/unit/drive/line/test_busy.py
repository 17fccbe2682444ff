# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive that is busy (Modbus exception 06) has done nothing, and is asked again."""

from __future__ import annotations

import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause, Severity

MODE, SCMD, STATUS = 'fieldbus.mode', 'fieldbus.scmd', 'fieldbus.inv_st'
FREQUENCY = 'status.frq_set'
ALWAYS = 10_000


class Busy:
    """Has the drive say that it is busy, so many times for each parameter that is named."""

    def __init__(self, rig: Rig, times: int, *keys: str, written: bool = True) -> None:
        self._left = dict.fromkeys(keys, times)
        self._written = written
        self.said = 0
        rig.meet = self

    def __call__(self, key: str, data: bytes | None) -> str | None:
        if self._left.get(key, 0) == 0 or (data is not None) != self._written:
            return None
        self._left[key] -= 1
        self.said += 1
        return 'busy'


def test_a_command_is_given_again() -> None:
    with Rig().connect() as rig:
        busy = Busy(rig, 2, MODE, SCMD)
        rig.enable()
        assert busy.said == 4
        assert rig.drive.following
        assert rig.written(SCMD).count(0x101) == 1


def test_a_value_is_read_again() -> None:
    with Rig().connect() as rig:
        busy = Busy(rig, 3, 'fieldbus.drive_status', STATUS, written=False)
        rig.pass_time(1.0)
        assert busy.said == 6
        assert rig.drive.snapshot.connected and not rig.notes.said('lost')


def test_one_that_stays_busy_is_reported() -> None:
    with Rig().connect() as rig:
        Busy(rig, ALWAYS, MODE)
        assert 'the drive is busy (exception 6)' in rig.answer(rig.drive.enable())
    # and is no other model
    with Rig() as rig:
        Busy(rig, ALWAYS, 'fieldbus.sw_ver', written=False)
        answer = rig.answer(rig.drive.connect())
        assert 'the drive is busy' in answer and 'model' not in answer


def test_one_that_is_busy_when_it_is_there_again_is_no_other_model() -> None:
    with Rig().connect() as rig:
        rig.line.state = 'silent'
        rig.pass_time(3.0)
        assert rig.notes.said('lost: ')
        Busy(rig, ALWAYS, 'fieldbus.sw_ver', written=False)
        rig.line.mend()
        rig.pass_time(8.0)
        assert not rig.notes.said('another model')
        Busy(rig, 0)
        rig.pass_time(5.0)
        assert rig.drive.snapshot.connected


def test_a_stop_is_tried_on() -> None:
    with Rig().turn() as rig:
        busy = Busy(rig, 3, SCMD)
        assert rig.answer(rig.drive.stop()) == 'stopping: it ramps down'
        assert busy.said == 3


@pytest.mark.parametrize(
    ('connection', 'key'),
    [('rtu', MODE), ('rtu, control word', 'fieldbus.drv_ctrl_write_mask')],
)
def test_a_quick_stop_stays_one(connection: str, key: str) -> None:
    with Rig(connection, parameters={'control.retard': 10.0}).turn() as rig:
        busy = Busy(rig, 1, key)
        assert rig.answer(rig.drive.quick_stop()) == 'released: the motor coasts'
        assert busy.said == 1 and not rig.far.motor.driven


@pytest.mark.parametrize('retard', [0.3, 10.0])
def test_a_stop_is_confirmed_whatever_else_cannot_be_read(retard: float) -> None:
    with Rig(parameters={'control.retard': retard}).turn() as rig:
        Busy(rig, ALWAYS, 'control.st_mode', written=False)
        assert rig.answer(rig.drive.stop()).startswith('stopping (')
        assert not rig.drive.stop_unconfirmed


def test_a_set_point_is_written_again() -> None:
    with Rig().turn(20.0) as rig:
        busy = Busy(rig, 3, FREQUENCY)
        rig.send(10.0)
        rig.pass_time(1.0)
        assert busy.said == 3
        assert rig.drive.following and abs(rig.far.motor.frequency - 10.0) < 0.2


def test_set_point_0_is_written_again_when_no_others_come() -> None:
    with Rig(setpoint_timeout=0.5).turn() as rig:
        Busy(rig, 1, FREQUENCY)
        rig.send(None)
        rig.pass_time(2.0)
        assert rig.notes.said('no set-point for 0.5 s', Severity.WARNING)
        assert abs(rig.far.motor.frequency) < 0.1 and rig.drive.following
        # how long it was busy then does not count any more
        Busy(rig, 1, FREQUENCY)
        rig.send(15.0)
        rig.pass_time(1.0)
        assert rig.drive.following and abs(rig.far.motor.frequency - 15.0) < 0.2


def test_a_drive_that_takes_no_set_point_for_long_is_stopped() -> None:
    with Rig().turn(20.0) as rig:
        Busy(rig, ALWAYS, FREQUENCY)
        rig.send(10.0)
        rig.pass_time(3.0)
        assert not rig.drive.following
        assert rig.notes.said('refused set-point 10: the drive is busy', Severity.WARNING)
        assert not rig.turns


def test_a_status_that_stays_refused_is_a_loss_too() -> None:
    # the motor could not be watched
    with Rig().turn() as rig:
        Busy(rig, 10, STATUS, written=False)
        rig.pass_time(2.0)
        assert rig.drive.following
        Busy(rig, ALWAYS, STATUS, written=False)
        rig.pass_time(5.0)
        assert rig.notes.said('lost: the drive is busy')
        assert not rig.drive.following


@pytest.mark.parametrize('wrong', ['busy', 'unheard'])
def test_one_that_was_busy_was_not_switched_off_and_one_that_was_silent_may_have_been(
    wrong: str,
) -> None:
    with Rig().turn() as rig:
        left = [5 if wrong == 'busy' else 1]

        def meet(key: str, data: bytes | None) -> str | None:
            if key != FREQUENCY or data is None or not left[0]:
                return None
            left[0] -= 1
            rig.far.control_unit.press('stop')
            return wrong

        rig.meet = meet
        rig.send(10.0)
        rig.pass_time(1.0)
        if wrong == 'busy':
            assert rig.notes.said(Cause.CONTROL_LOST, Severity.WARNING)
            assert not rig.notes.said('did not answer') and not rig.notes.said('switched off')
        else:
            assert rig.notes.said(Cause.POWER_CYCLED, Severity.WARNING)
