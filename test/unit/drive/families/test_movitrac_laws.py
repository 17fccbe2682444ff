# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the laws ask of a MOVITRAC 31 alone: with each switch of the simulated one, turned alone.

With all of them as hard as can be it is one of the connections of test_laws.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
import itertools
from typing import Any

from movitrac import DIRECTIONS, OVERCURRENT, STOPS, SWITCHES, bits, make, succeeded, switched
import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause, Drive, Severity
from nfo_sinus_driver.simulator.movitrac31.commands import CONTROL_MODE, SETPOINT
from nfo_sinus_driver.simulator.movitrac31.parameters import PC_TIMEOUT, Bit, Mode

BITS = 'fieldbus.function_bits'
each_switch = pytest.mark.parametrize('switch', SWITCHES)


def assert_only_enable_helps(rig: Rig) -> None:
    """Neither turns it nor has a direction, although set-points keep arriving, until enabled."""
    rig.send(20.0)
    rig.pass_time(0.5)
    assert not bits(rig) & DIRECTIONS
    rig.assert_only_enable_helps()


# --- ways out -------------------------------------------------------------------------------------


@each_switch
def test_every_way_out_takes_bits_and_set_point_back_and_keeps_control(switch: str) -> None:
    with make(switch) as rig:
        for name, stop in STOPS.items():
            rig.turn(-20.0)
            assert succeeded(rig, stop(rig.drive)), name
            rig.send(None)
            rig.pass_time(1.0)
            assert not bits(rig) & DIRECTIONS and not rig.turns, name
            assert rig.far.memory.number(SETPOINT) == 0, name
            # for any other P841 can start the motor
            assert round(rig.far.memory.number(CONTROL_MODE)) == Mode.REMOTE_CONTROL
            assert not rig.notes.said(Cause.CANNOT_STOP)


@each_switch
def test_a_stop_is_confirmed_by_a_frequency_that_falls(switch: str) -> None:
    with make(switch) as rig:
        rig.turn()
        # it says that it has taken everything, and goes on
        unit = rig.far.control_unit
        take, unit._take = unit._take, lambda *taken: None
        assert not succeeded(rig, rig.drive.stop())
        assert rig.far.motor.frequency > 19
        rig.pass_time(1.0)
        assert rig.drive.stop_unconfirmed
        unit._take = take
        rig.pass_time(2.0)
        assert not rig.drive.stop_unconfirmed
        assert rig.far.motor.frequency == 0


def stop_at(
    rig: Rig, moment: int, stop: Callable[[Drive], Future[Any]]
) -> list[tuple[int, Future[Any]]]:
    """Have it stopped at some request from now on; what is returned gets its place and answer."""
    requests = itertools.count()
    begun: list[tuple[int, Future[Any]]] = []

    def meet(key: str, data: bytes | None) -> None:
        if next(requests) == moment:
            begun.append((len(rig.asked), stop(rig.drive)))

    rig.meet = meet
    return begun


@pytest.mark.parametrize('busy', [False, True])
@pytest.mark.parametrize('name', STOPS)
def test_a_stop_is_the_next_frame(name: str, busy: bool) -> None:
    wrong = {}
    for moment in (0, 1, 4):
        with make() as rig:
            rig.turn()
            if busy:
                rig.drive.parameters.read()
            begun = stop_at(rig, moment, STOPS[name])
            rig.wait_until(lambda begun=begun: begun)
            ((at, future),) = begun
            rig.answer(future)
            # one transaction is on the line; a stop begins with the bits, or takes the enable, or
            # releases the motor
            firsts = None, *(int(bits).to_bytes(4, 'big') for bits in (0, Bit.INHIBIT))
            if rig.asked[at][1:] not in [(BITS, first) for first in firsts]:
                wrong[moment] = rig.asked[at]
    assert not wrong


@pytest.mark.parametrize('name', ['stop', 'quick stop', 'deactivate'])
def test_a_stop_at_each_step_of_an_enable(name: str) -> None:
    with switched({'stop_status': 'enable'}) as rig:
        rig.connect()
        for moment in itertools.count():
            # so that control is taken on the way
            rig.far.set_from_keypad(CONTROL_MODE, 'Standard')
            rig.pass_time(0.1)
            begun = stop_at(rig, moment, STOPS[name])
            rig.answer(rig.drive.enable())
            rig.meet = lambda key, data: None
            if not begun:
                break
            assert succeeded(rig, begun[0][1]), moment
            rig.send(20.0)
            rig.pass_time(0.3)
            assert not rig.drive.following and not bits(rig) & DIRECTIONS and not rig.turns, moment
            rig.send(None)
            rig.drive.activate()
        # it was stopped at each of the checks, of what takes control and of the run command
        assert moment > 35


# --- no restart -----------------------------------------------------------------------------------


def trip(rig: Rig) -> None:
    rig.far.trip(OVERCURRENT)
    rig.pass_time(1.0)
    assert not rig.drive.following
    rig.acknowledged += 1
    assert 'acknowledged 101 Overcurrent' in rig.answer(rig.drive.acknowledge())


def lose_line(rig: Rig) -> None:
    rig.line.state = 'silent'
    rig.pass_time(4.0)
    assert not rig.drive.snapshot.connected and rig.far.motor.frequency > 19
    rig.line.mend()
    rig.pass_time(3.0)


def restart_driver(rig: Rig) -> None:
    rig.kill()
    rig.line.go_to(rig.clock.now + 2.0)
    assert rig.far.motor.frequency > 19
    rig.begin()
    rig.connect()
    rig.pass_time(1.0)
    assert rig.notes.said(Cause.FOUND_RUNNING, Severity.WARNING)


def press(rig: Rig, key: str) -> None:
    """Take control at the keypad, which is seen whatever the drive shows."""
    rig.far.control_unit.press('manual')
    rig.far.control_unit.press(key)
    rig.pass_time(1.0)
    assert not rig.drive.following
    assert rig.notes.said(Cause.STOPPED_BECAUSE, Severity.WARNING)
    assert not bits(rig) & DIRECTIONS and rig.far.memory.number(SETPOINT) == 0
    rig.far.control_unit.press('automatic')
    rig.pass_time(1.0)


TROUBLES: dict[str, Callable[[Rig], None]] = {
    'fault': trip,
    'line': lose_line,
    'driver': restart_driver,
    'keypad stop': lambda rig: press(rig, 'stop'),
    'keypad cw': lambda rig: press(rig, 'cw'),
}


@each_switch
@pytest.mark.parametrize('trouble', TROUBLES)
def test_after_trouble_only_enable_helps(switch: str, trouble: str) -> None:
    with make(switch) as rig:
        rig.turn()
        TROUBLES[trouble](rig)
        assert_only_enable_helps(rig)


@each_switch
def test_no_turn_at_an_acknowledgement(switch: str) -> None:
    with make(switch) as rig:
        rig.turn()
        turned: list[bool] = []
        for fault, between in itertools.product((OVERCURRENT, PC_TIMEOUT), (0.0, 0.03, 1.0)):
            rig.far.trip(fault)
            rig.pass_time(between)
            rig.looked = lambda: turned.append(rig.turns)
            rig.acknowledged += 2
            rig.answer(rig.drive.acknowledge())
            rig.pass_time(0.5)
            if rig.far.faults:
                rig.answer(rig.drive.acknowledge())
            rig.looked = lambda: None
            assert not rig.far.faults and not any(turned), (fault, between)
            rig.enable()
            rig.pass_time(0.5)
            assert rig.far.motor.frequency > 19
        assert turned


def turn_with_a_slow_ramp(rig: Rig, value: float) -> None:
    """Turn; a drive that restarts then has not come far when it is heard again."""
    rig.turn(value)
    rig.far.set_from_keypad('ramp.t11_up', 3.0)
    rig.pass_time(0.5)
    assert rig.far.motor.frequency == value


KEPT = {'bits_after_power_on': 'kept'}


@pytest.mark.parametrize(
    ('switch', 'value', 'moment'),
    [
        *((switch, 20.0, 0.0) for switch in SWITCHES.values()),
        *((KEPT, value, moment) for value in (20.0, -20.0) for moment in (0.01, 0.03, 0.06)),
        *(({**KEPT, 'stop_status': 'enable'}, value, 0.0) for value in (20.0, -20.0)),
    ],
)
def test_a_short_power_cycle_ends_a_run_in_which_the_frequency_falls(
    switch: Mapping[str, str], value: float, moment: float
) -> None:
    with switched(switch) as rig:
        turn_with_a_slow_ramp(rig, value)
        rig.pass_time(moment)
        # less than lost_after; without power the brake holds the motor
        rig.far.power_cycle(0.5)
        rig.far.motor.rotor = 0.0
        rig.pass_time(2.0)
        assert not rig.drive.following and not rig.turns and rig.drive.snapshot.connected
        if switch.get('bits_after_power_on') == 'kept':
            assert rig.notes.said(Cause.SLOWER_AFTER_SILENCE, Severity.WARNING)
        assert_only_enable_helps(rig)


@pytest.mark.parametrize('outside', ['ignored', 'refused', 'taken'])
def test_bits_left_behind_by_another_control_mode_turn_nothing(outside: str) -> None:
    with switched({'outside_remote_control': outside}) as rig:
        rig.turn()
        rig.far.set_from_keypad(CONTROL_MODE, 'Standard')
        rig.pass_time(3.0)
        assert not rig.drive.following
        rig.send(None)
        turned: list[bool] = []
        rig.looked = lambda: turned.append(rig.turns)
        rig.enable()
        rig.pass_time(1.0)
        assert turned and not any(turned)


@pytest.mark.parametrize(
    'takes_away',
    [
        lambda rig: rig.far.set_run_input(False),
        lambda rig: rig.far.control_unit.switch(42, True),
        lambda rig: rig.far.control_unit.press('manual'),
        lambda rig: rig.far.set_from_keypad(CONTROL_MODE, 'Fieldbus'),
    ],
    ids=['terminal 43', 'terminal 42', 'keypad', 'P841'],
)
def test_what_takes_the_motor_away_ends_a_run(takes_away: Callable[[Rig], None]) -> None:
    with make() as rig:
        rig.turn()
        takes_away(rig)
        rig.pass_time(3.0)
        assert not rig.drive.following
        unit = rig.far.control_unit
        unit.press('automatic')
        unit.switch(42, False)
        rig.far.set_run_input(True)
        rig.far.set_from_keypad(CONTROL_MODE, 'Remote control')
        rig.pass_time(1.0)
        assert_only_enable_helps(rig)


# --- what ends no run -----------------------------------------------------------------------------


@pytest.mark.parametrize('value', [5.0, 0.0, -5.0, 15.0])
def test_a_set_point_that_was_lowered_in_noise_ends_no_run(value: float) -> None:
    with Rig('movitrac', parameters={'ramp.t11_down': 1.0}) as rig:
        for lead in (0.3, 0.05, 0.0, -0.1):
            rig.turn(40.0)
            if lead > 0:
                rig.send(value)
                rig.pass_time(lead)
            rig.line.state = 'silent'
            rig.pass_time(max(-lead, 0.0))
            rig.send(value)
            rig.pass_time(0.7)
            rig.line.mend()
            rig.pass_time(2.0)
            assert rig.drive.following, lead
            assert rig.far.motor.frequency == pytest.approx(value, abs=0.1), lead


def test_a_set_point_whose_answer_is_lost_ends_no_run() -> None:
    with Rig('movitrac') as rig:
        # with three the drive is lost
        for losses in (1, 2):
            rig.turn(40.0)
            for value in (5.0, -20.0):
                rig.line.losses = losses
                rig.send(value)
                rig.pass_time(1.5)
            assert rig.drive.following, losses


def test_a_motor_that_is_held_back_for_a_moment_ends_no_run() -> None:
    with make() as rig:
        turn_with_a_slow_ramp(rig, 20.0)
        rig.line.state = 'silent'
        rig.pass_time(0.4)
        rig.far.motor.load = 5.0
        rig.pass_time(0.2)
        assert 11 < rig.far.motor.frequency < 19
        rig.line.mend()
        rig.pass_time(3.0)
        assert rig.drive.following


def test_noise_while_the_motor_speeds_up_ends_no_run() -> None:
    with make() as rig:
        turn_with_a_slow_ramp(rig, 5.0)
        rig.send(40.0)
        for _ in range(3):
            rig.line.state = 'silent'
            rig.pass_time(0.7)
            rig.line.mend()
            rig.pass_time(0.2)
        assert rig.drive.following


def test_a_motor_is_reversed_again_and_again() -> None:
    # that no direction changes beside a set-point is judged by the requests
    with make() as rig:
        rig.turn()
        for value in (-20.0, 30.0, 5.0, -50.0, 0.0, -5.0, 20.0):
            rig.send(value)
            rig.pass_time(1.5)
            assert rig.far.motor.frequency == pytest.approx(value, abs=0.1)
            assert rig.drive.snapshot.frequency == pytest.approx(value, abs=0.1)
