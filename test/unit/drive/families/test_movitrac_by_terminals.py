# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A MOVITRAC 31 that its terminals start, while the line gives the frequency (P841 = 1)."""

from __future__ import annotations

from typing import Any

import movitrac
from movitrac import SWITCHES, succeeded
import pytest
from support.rig import CONNECTIONS, Rig

from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.simulator.movitrac31.commands import CONTROL_MODE, SETPOINT
from nfo_sinus_driver.simulator.movitrac31.parameters import Mode

CONNECTION = 'movitrac, by terminals'
each_switch = pytest.mark.parametrize(
    'switch', [name for name in SWITCHES if 'settings_need' not in name]
)


def make(switch: str = 'as the manual says', **more: Any) -> Rig:
    return movitrac.make(switch, connection=CONNECTION, **more)


@each_switch
@pytest.mark.parametrize('terminal', [41, 42])
def test_the_motor_follows_sizes_in_the_direction_of_its_terminal(
    switch: str, terminal: int
) -> None:
    with make(switch) as rig:
        unit = rig.far.control_unit
        unit.switch(41, False)
        unit.switch(terminal, True)
        rig.connect()
        rig.enable()
        sign = 1 if terminal == 41 else -1
        for value in (20.0, 35.0, 0.0, 10.0):
            rig.send(value)
            rig.pass_time(2.0)
            assert rig.far.motor.frequency == pytest.approx(sign * value, abs=0.1)
            assert rig.drive.snapshot.frequency == pytest.approx(sign * value, abs=0.1)
            assert rig.drive.following
        rig.send(-20.0)
        rig.pass_time(1.0)
        assert rig.far.motor.frequency == 0 and rig.drive.snapshot.setpoint_clamped
        assert succeeded(rig, rig.drive.stop())


@each_switch
def test_a_stop_is_set_point_0_and_control_is_kept(switch: str) -> None:
    with make(switch) as rig:
        rig.turn()
        assert succeeded(rig, rig.drive.stop())
        rig.send(30.0)
        rig.pass_time(1.0)
        assert rig.far.motor.frequency == 0 and not rig.drive.following
        assert rig.far.memory.number(SETPOINT) == 0
        rig.turn()
        assert 'no quick stop' in rig.answer(rig.drive.quick_stop())
        assert succeeded(rig, rig.drive.disconnect(2.0))
        assert round(rig.far.memory.number(CONTROL_MODE)) == Mode.REMOTE_SETPOINT
        assert rig.far.motor.frequency == 0


@pytest.mark.parametrize('terminal', [41, 43])
def test_a_terminal_that_stops_the_motor_ends_the_enable(terminal: int) -> None:
    with make() as rig:
        rig.turn()
        unit = rig.far.control_unit
        unit.switch(terminal, False)
        rig.pass_time(1.0)
        assert not rig.drive.following and rig.far.motor.frequency == 0
        assert rig.notes.said(Cause.STOPPED_BECAUSE, Severity.WARNING)
        reason = 'no terminal with a direction' if terminal == 41 else 'terminal 43'
        assert reason in rig.answer(rig.drive.enable())
        unit.switch(terminal, True)
        rig.assert_only_enable_helps()


def test_p841_is_set_once_where_no_set_point_is_left_that_the_motor_would_follow() -> None:
    with make('outside_remote_control refused') as rig:
        rig.far.set_from_keypad(CONTROL_MODE, 'Standard')
        rig.far.memory.put(SETPOINT, 2000)
        rig.far.control_unit.switch(41, False)
        rig.connect()
        assert 'no terminal with a direction' in rig.answer(rig.drive.enable())
        rig.far.set_from_keypad('setpoint.n11', 0.0)
        rig.far.control_unit.switch(47, True)
        rig.far.control_unit.switch(41, True)
        rig.pass_time(1.0)
        # it stands, by a fixed set-point of 0
        assert 'a set-point stands in the drive' in rig.answer(rig.drive.enable())
        assert not rig.written(CONTROL_MODE)
        rig.far.memory.put(SETPOINT, 0)
        rig.enable()
        assert round(rig.far.memory.number(CONTROL_MODE)) == Mode.REMOTE_SETPOINT
        assert len(rig.written(CONTROL_MODE)) == 1 and rig.notes.said(Cause.STORED)


def test_a_motor_that_follows_the_terminals_alone_is_not_enabled() -> None:
    with make(parameters={CONTROL_MODE: 'Standard'}) as rig:
        rig.connect()
        assert rig.far.motor.frequency > 10
        assert 'set serial.control_mode to Remote setpoint' in rig.answer(rig.drive.enable())
        assert not rig.written(CONTROL_MODE) and rig.far.motor.frequency > 10


def test_a_motor_that_does_not_obey_is_released_by_taking_control_from_the_terminals() -> None:
    with make() as rig:
        rig.turn()
        rig.send(None)
        rig.meet = lambda key, data: (
            'ignored' if key == SETPOINT and data is not None else None
        )
        rig.drive.stop()
        rig.pass_time(1.0)
        assert rig.drive.stop_unconfirmed and rig.far.motor.frequency > 19
        rig.wait_until(lambda: not rig.drive.stop_unconfirmed, 30.0)
        rig.pass_time(2.0)
        assert not rig.far.motor.driven and rig.notes.said(Cause.STOP_FORCED, Severity.WARNING)
        assert round(rig.far.memory.number(CONTROL_MODE)) == Mode.REMOTE_CONTROL
        rig.meet = lambda key, data: None
        # and it can be enabled again
        rig.turn()


def test_what_function_bits_of_an_earlier_session_turn_is_stopped() -> None:
    with Rig('movitrac') as rig:
        rig.turn()
        rig.kill()
        rig.reset(control_method='remote_setpoint')
        rig.connection = CONNECTIONS[CONNECTION]
        rig.begin()
        rig.connect()
        rig.pass_time(2.0)
        assert rig.far.motor.frequency == 0
        assert rig.notes.said(Cause.FOUND_RUNNING, Severity.WARNING)
        rig.line.frames.clear()
