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

"""The laws, over a MOVITRAC 31 with each switch of the simulated one, on its real link."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from concurrent.futures import Future
import itertools
from typing import Any

from movitrac_rig import BITS
from movitrac_rig import DIRECTIONS
from movitrac_rig import MODEL
from movitrac_rig import OVERCURRENT
from movitrac_rig import SWITCHES
from movitrac_rig import WAYS
from movitrac_rig import assert_only_enable_helps
from movitrac_rig import bits
from movitrac_rig import each_switch
from movitrac_rig import each_way
from movitrac_rig import make
from movitrac_rig import requests_since
from movitrac_rig import succeeded
from movitrac_rig import turns
import pytest
from support.addresses import Words
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.simulator.movitrac31.codes import PC_TIMEOUT
from nfo_sinus_driver.simulator.movitrac31.codes import Bit
from nfo_sinus_driver.simulator.movitrac31.codes import Mode
from nfo_sinus_driver.simulator.movitrac31.commands import CONTROL_MODE
from nfo_sinus_driver.simulator.movitrac31.commands import SETPOINT

# --- ways out -------------------------------------------------------------------------------------


@each_switch
def test_every_way_out_stops_the_motor(
    make_virtual: MakeVirtual, switch: Mapping[str, str]
) -> None:
    rig = make(make_virtual, switch)
    for name, way in WAYS.items():
        rig.ride(-20.0)
        assert succeeded(rig, way(rig.drive)), name
        rig.send(None)
        rig.pass_time(1.0)
        assert not bits(rig) & DIRECTIONS, name
        assert rig.far.memory.number(SETPOINT) == 0, name
        assert not turns(rig), name
        # it keeps control, for any other P841 can start the motor
        assert round(rig.far.memory.number(CONTROL_MODE)) == Mode.REMOTE_CONTROL
        assert not rig.said(Cause.CANNOT_STOP)


@each_switch
def test_a_stop_is_confirmed_by_a_frequency_that_falls(
    make_virtual: MakeVirtual, switch: Mapping[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = make(make_virtual, switch)
    rig.ride()
    # it says that it has taken everything, and goes on
    with monkeypatch.context() as deaf:
        deaf.setattr(rig.far.control_unit, '_take', lambda *taken: None)
        stop = rig.drive.stop()
        assert not succeeded(rig, stop)
        assert rig.far.motor.frequency > 19
        assert rig.drive.stop_unconfirmed
        rig.pass_time(1.0)
        assert rig.drive.stop_unconfirmed
    rig.pass_time(2.0)
    assert not rig.drive.stop_unconfirmed
    assert rig.far.motor.frequency == 0


@each_way
@pytest.mark.parametrize('busy', [False, True])
def test_a_stop_is_the_next_frame(
    make_virtual: MakeVirtual, way: Callable[[Drive], Future[Any]], busy: bool
) -> None:
    for moment in range(6):
        rig = make(make_virtual)
        rig.ride()
        if busy:
            rig.drive.parameters.read()
        at, future = stopped_at(rig, moment, way)
        rig.answer(future)
        # one transaction is on the line; a stop begins with the bits, or releases the motor
        after = requests_since(rig, at)[1]
        assert after in ((BITS, None), (BITS, (0, int(Bit.INHIBIT)))), (moment, after)


def stopped_at(
    rig: VirtualRig, moment: int, way: Callable[[Drive], Future[Any]]
) -> tuple[int, Future[Any]]:
    """Go a way out at some request; return how many frames there were, and what will be said."""
    requests = itertools.count()
    begun: list[tuple[int, Future[Any]]] = []

    def meet(index: int, words: Words | None) -> None:
        if next(requests) == moment:
            begun.append((len(rig.link.frames), way(rig.drive)))

    rig.before = meet
    while not begun:
        rig.pass_time(0.001)
    rig.before = lambda index, words: None
    return begun[0]


@pytest.mark.parametrize('way', ['stop', 'quick stop', 'deactivate'])
def test_a_stop_at_each_step_of_an_enable(make_virtual: MakeVirtual, way: str) -> None:
    for moment in itertools.count():
        # from P841 = Standard, so that control is taken on the way
        rig = make(make_virtual, {'stop_status': 'enable'})
        stop = stopped_in_enable(rig, moment, WAYS[way])
        if stop is None:
            break
        assert succeeded(rig, stop)
        assert not rig.drive.armed
        rig.send(20.0)
        rig.pass_time(0.5)
        assert not bits(rig) & DIRECTIONS, moment
        assert not turns(rig)
    # it was stopped at each of the checks, of what takes control and of the run command
    assert moment > 35


def stopped_in_enable(
    rig: VirtualRig, moment: int, way: Callable[[Drive], Future[Any]]
) -> Future[Any] | None:
    """Enable, and go a way out at some request of that; ``None`` if there are not so many."""
    rig.connect()
    enable = rig.drive.enable()
    requests = itertools.count()
    stops: list[Future[Any]] = []

    def meet(index: int, words: Words | None) -> None:
        if next(requests) == moment and not enable.done():
            stops.append(way(rig.drive))

    rig.before = meet
    rig.answer(enable)
    rig.before = lambda index, words: None
    return stops[0] if stops else None


# --- no restart -----------------------------------------------------------------------------------


@each_switch
def test_a_fault_ends_a_ride(make_virtual: MakeVirtual, switch: Mapping[str, str]) -> None:
    rig = make(make_virtual, switch)
    rig.ride()
    rig.far.trip(OVERCURRENT)
    rig.pass_time(1.0)
    assert not rig.drive.armed
    assert 'acknowledged 101 Overcurrent' in rig.answer(rig.drive.acknowledge())
    assert_only_enable_helps(rig)


@each_switch
def test_no_turn_at_an_acknowledgement(
    make_virtual: MakeVirtual, switch: Mapping[str, str]
) -> None:
    rig = make(make_virtual, switch)
    rig.ride()
    turned: list[bool] = []
    for fault, between in itertools.product((OVERCURRENT, PC_TIMEOUT), (0.0, 0.01, 0.05, 1.0)):
        rig.far.trip(fault)
        rig.pass_time(between)
        rig.looked = lambda: turned.append(turns(rig))
        rig.answer(rig.drive.acknowledge())
        rig.pass_time(1.0)
        if rig.far.faults:
            rig.answer(rig.drive.acknowledge())
        assert not rig.far.faults
        assert not any(turned), (fault, between)
        rig.looked = lambda: None
        assert_only_enable_helps(rig)


@pytest.mark.parametrize('kept', ['kept', 'cleared'])
def test_a_power_cycle_ends_a_ride(make_virtual: MakeVirtual, kept: str) -> None:
    rig = make(make_virtual, {'bits_after_power_on': kept})
    rig.ride()
    # P841 is stored, so that the drive goes on where bits and set-point survive
    rig.far.power_cycle(2.0)
    rig.pass_time(2.05)
    assert bool(rig.far.motor.driven) == (kept == 'kept')
    rig.pass_time(3.0)
    assert rig.drive.snapshot.connected
    assert_only_enable_helps(rig)


def ride_and_slow_down_the_ramp(rig: VirtualRig, value: float) -> None:
    """Ride; who starts anew then has not come far when it is heard again."""
    rig.ride(value)
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
def test_a_short_power_cycle_ends_a_ride_in_which_the_frequency_falls(
    make_virtual: MakeVirtual, switch: Mapping[str, str], value: float, moment: float
) -> None:
    rig = make(make_virtual, switch)
    ride_and_slow_down_the_ramp(rig, value)
    rig.pass_time(moment)
    # less than lost_after; without power the brake holds the motor
    rig.far.power_cycle(0.5)
    rig.far.motor.rotor = 0.0
    rig.pass_time(2.0)
    assert not rig.drive.armed
    assert not turns(rig)
    assert rig.drive.snapshot.connected
    if switch.get('bits_after_power_on') == 'kept':
        assert rig.said(Cause.SLOWER_AFTER_SILENCE, Severity.WARNING)
    assert_only_enable_helps(rig)


@pytest.mark.parametrize('value', [5.0, 0.0, -5.0, 15.0])
@pytest.mark.parametrize('lead', [0.3, 0.05, 0.0, -0.1])
def test_a_set_point_that_was_lowered_in_noise_ends_no_ride(
    make_virtual: MakeVirtual, value: float, lead: float
) -> None:
    rig = make_virtual({'ramp.t11_down': 1.0, 'ramp.t11_up': 0.3}, model=MODEL)
    rig.ride(40.0)
    rig.pass_time(1.0)
    if lead > 0:
        rig.send(value)
        rig.pass_time(lead)
    rig.link.state = 'silent'
    rig.pass_time(max(-lead, 0.0))
    rig.send(value)
    rig.pass_time(0.7)
    rig.link.mend()
    rig.pass_time(3.0)
    assert rig.drive.armed
    assert rig.far.motor.frequency == pytest.approx(value, abs=0.1)


def test_a_set_point_whose_answer_is_lost_ends_no_ride(make_virtual: MakeVirtual) -> None:
    rig = make_virtual({'ramp.t11_down': 0.3}, model=MODEL)
    # with three the drive is lost
    for losses in (1, 2):
        rig.ride(40.0)
        rig.pass_time(1.0)
        rig.link.losses = losses
        rig.send(5.0)
        rig.pass_time(1.0)
        rig.link.losses = losses
        rig.send(-20.0)
        rig.pass_time(2.0)
        assert rig.drive.armed, losses


def test_a_motor_that_is_held_back_for_a_moment_ends_no_ride(make_virtual: MakeVirtual) -> None:
    rig = make(make_virtual)
    ride_and_slow_down_the_ramp(rig, 20.0)
    rig.link.state = 'silent'
    rig.pass_time(0.4)
    rig.far.motor.load = 5.0
    rig.pass_time(0.2)
    assert 11 < rig.far.motor.frequency < 19
    rig.link.mend()
    rig.pass_time(3.0)
    assert rig.drive.armed


def test_noise_while_the_motor_speeds_up_ends_no_ride(make_virtual: MakeVirtual) -> None:
    rig = make(make_virtual)
    ride_and_slow_down_the_ramp(rig, 5.0)
    rig.send(40.0)
    for _ in range(3):
        rig.link.state = 'silent'
        rig.pass_time(0.7)
        rig.link.mend()
        rig.pass_time(0.2)
    assert rig.drive.armed


@each_switch
def test_a_lost_line_ends_a_ride(make_virtual: MakeVirtual, switch: Mapping[str, str]) -> None:
    rig = make(make_virtual, switch)
    rig.ride()
    rig.link.state = 'silent'
    rig.pass_time(4.0)
    assert not rig.drive.snapshot.connected
    assert rig.far.motor.frequency > 19
    rig.link.mend()
    rig.pass_time(3.0)
    assert_only_enable_helps(rig)


@each_switch
def test_a_driver_that_begins_takes_away_what_another_has_left(
    make_virtual: MakeVirtual, switch: Mapping[str, str]
) -> None:
    rig = make(make_virtual, switch)
    rig.ride()
    rig.kill()
    rig.elapse(2.0)
    assert rig.far.motor.frequency > 19
    rig.begin()
    rig.connect()
    rig.pass_time(1.0)
    assert rig.said(Cause.FOUND_RUNNING, Severity.WARNING)
    assert_only_enable_helps(rig)


@pytest.mark.parametrize('outside', ['ignored', 'refused', 'taken'])
def test_bits_left_behind_by_another_control_mode_turn_nothing(
    make_virtual: MakeVirtual, outside: str
) -> None:
    rig = make(make_virtual, {'outside_remote_control': outside})
    rig.ride()
    rig.far.set_from_keypad(CONTROL_MODE, 'Standard')
    rig.pass_time(3.0)
    assert not rig.drive.armed
    rig.send(None)
    turned: list[bool] = []
    rig.looked = lambda: turned.append(turns(rig))
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.pass_time(1.0)
    assert not any(turned)


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
def test_who_takes_the_motor_away_ends_a_ride(
    make_virtual: MakeVirtual, takes_away: Callable[[VirtualRig], None]
) -> None:
    rig = make(make_virtual, {})
    rig.ride()
    takes_away(rig)
    rig.pass_time(3.0)
    assert not rig.drive.armed
    unit = rig.far.control_unit
    unit.press('automatic')
    unit.switch(42, False)
    rig.far.set_run_input(True)
    rig.far.set_from_keypad(CONTROL_MODE, 'Remote control')
    rig.pass_time(1.0)
    assert_only_enable_helps(rig)


@each_switch
@pytest.mark.parametrize('key', ['stop', 'cw', 'ccw'])
def test_a_keypad_that_takes_control_is_seen_whatever_the_drive_shows(
    make_virtual: MakeVirtual, switch: Mapping[str, str], key: str
) -> None:
    rig = make(make_virtual, switch)
    rig.ride()
    rig.far.control_unit.press('manual')
    rig.far.control_unit.press(key)
    rig.pass_time(2.0)
    assert not rig.drive.armed
    assert rig.said(Cause.STOPPED_BECAUSE, Severity.WARNING)
    assert not bits(rig) & DIRECTIONS
    assert rig.far.memory.number(SETPOINT) == 0
    rig.far.control_unit.press('automatic')
    rig.pass_time(2.0)
    assert_only_enable_helps(rig)


# --- set-points -----------------------------------------------------------------------------------


def test_a_reversal_goes_through_zero(make_virtual: MakeVirtual) -> None:
    rig = make(make_virtual)
    rig.ride()
    wrong: list[str] = []
    before = [bits(rig) & DIRECTIONS]

    def look() -> None:
        now = bits(rig) & DIRECTIONS
        if now != before[0] and rig.far.memory.number(SETPOINT):
            wrong.append(f'{before[0]} -> {now} at {rig.far.memory.number(SETPOINT)}')
        before[0] = now

    rig.looked = look
    for value in (-20.0, 30.0, 5.0, -50.0, 0.0, -5.0, 20.0):
        rig.send(value)
        rig.pass_time(1.5)
        assert rig.far.motor.frequency == pytest.approx(value, abs=0.1)
        assert rig.drive.snapshot.frequency == pytest.approx(value, abs=0.1)
    assert not wrong
