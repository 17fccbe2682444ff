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
import dataclasses
import itertools
from typing import Any

from line_rig import MakeLine
import pytest
from support.addresses import Words
from support.wire import understand
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.simulator.family import load
from nfo_sinus_driver.simulator.movitrac31.codes import PC_TIMEOUT
from nfo_sinus_driver.simulator.movitrac31.codes import Bit
from nfo_sinus_driver.simulator.movitrac31.codes import Mode
from nfo_sinus_driver.simulator.movitrac31.commands import CONTROL_MODE
from nfo_sinus_driver.simulator.movitrac31.commands import FUNCTION_BITS
from nfo_sinus_driver.simulator.movitrac31.commands import SETPOINT

MODEL = 'movitrac31'
OVERCURRENT = 101
#: Indices [M4 §4].
BITS, SIZE, P841, STATUS, FREQUENCY, PC_TIMEOUT_INDEX = 281, 223, 205, 284, 0, 285
DIRECTIONS = Bit.CW | Bit.CCW
REMOTE = {CONTROL_MODE: 'Remote control'}

#: Each switch of the simulated drive, turned alone.
SWITCHES: Mapping[str, Mapping[str, str]] = {
    'as the manual says': {},
    **{
        f'{option.name} {choice}': {option.name: choice}
        for option in load(MODEL).options
        if option.name != 'option_card'
        for choice in option.choices[1:]
    },
}
each_switch = pytest.mark.parametrize('switch', SWITCHES.values(), ids=SWITCHES)

WAYS: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'quick stop': lambda drive: drive.quick_stop(),
    'deactivate': lambda drive: drive.deactivate(),
    'clean up': lambda drive: drive.disconnect(1.0),
    'exit': lambda drive: drive.stop_for_good(1.0),
}
each_way = pytest.mark.parametrize('way', WAYS.values(), ids=WAYS)


def make(
    make_virtual: MakeVirtual, switch: Mapping[str, str] | None = None, **settings: Any
) -> VirtualRig:
    """Make a rig; P841 is Remote control already where nothing could set it."""
    needs = switch is not None and 'settings_need' in switch
    return make_virtual(REMOTE if needs else {}, variant=switch, model=MODEL, **settings)


def bits(rig: VirtualRig) -> int:
    return rig.far.memory.raw(FUNCTION_BITS)


def turns(rig: VirtualRig) -> bool:
    """Tell whether the drive turns the motor, or is about to; it may coast."""
    return rig.far.motor.driven and rig.far.motor.demand != 0


def succeeded(rig: VirtualRig, future: Future[Any]) -> bool:
    """Wait for an answer; tell whether it is a success."""
    rig.answer(future)
    error = future.exception()
    assert error is None or isinstance(error, DriveError), repr(error)
    return error is None


def requests_since(rig: VirtualRig, frames: int) -> list[tuple[int, Words | None]]:
    """Return index and value of what was asked since so many frames."""
    asked = [understand(bytes.fromhex(one['hex']), 'movitrac') for one in rig.link.frames[frames:]]
    return [(one.place, one.words) for one in asked if one is not None]


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
        # one transaction is on the line; a stop begins with the set-point, or releases the motor
        after = requests_since(rig, at)[1]
        assert after in ((SIZE, (0, 0)), (BITS, (0, int(Bit.INHIBIT)))), (moment, after)


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


def assert_only_enable_helps(rig: VirtualRig) -> None:
    """It stays still although set-points keep arriving, until somebody calls enable."""
    rig.send(20.0)
    rig.pass_time(1.5)
    assert not rig.drive.armed
    assert not turns(rig)
    assert not bits(rig) & DIRECTIONS
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.send(20.0)
    rig.pass_time(1.5)
    assert rig.far.motor.frequency > 19


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


# --- what an enable asks --------------------------------------------------------------------------

#: P600 to P609 of terminals that only an option card has, P760 and P880 likewise.
CARDS = {153, 154, 155, 156, 321, 322, 323, 249, 212}


def asked_by_enable(rig: VirtualRig) -> list[int]:
    """Enable; return the indices that were asked for or written meanwhile."""
    before = len(rig.link.frames)
    assert 'enabled' in rig.answer(rig.drive.enable())
    asked = [index for index, _ in requests_since(rig, before)]
    assert succeeded(rig, rig.drive.stop())
    return asked


@pytest.mark.parametrize(('settings', 'most'), [({}, 34), (REMOTE, 28)], ids=['P841', 'mine'])
def test_an_enable_asks_little_of_a_drive_whose_settings_were_read(
    make_virtual: MakeVirtual, settings: dict[str, Any], most: int
) -> None:
    rig = make_virtual(settings, model=MODEL, telemetry_rate=0.0, poll_rate=0.1)
    rig.connect()
    rig.answer(rig.drive.parameters.read())
    asked = asked_by_enable(rig)
    assert len(asked) <= most, asked
    assert not CARDS & set(asked)


def test_a_card_that_was_fitted_meanwhile_is_asked_for_again(make_virtual: MakeVirtual) -> None:
    rig = make_virtual({'terminal.input_48': 'CW/Stop'}, model=MODEL)
    rig.connect()
    rig.answer(rig.drive.parameters.read())
    assert not CARDS & set(asked_by_enable(rig))
    unit = rig.far.control_unit
    unit.variant = dataclasses.replace(unit.variant, option_card='fio')
    unit.terminals.inputs += (48, 49, 50, 51, 52, 53, 54)
    # a card is fitted while the drive has no power
    rig.far.power_cycle(5.0)
    rig.pass_time(10.0)
    assert rig.drive.snapshot.connected
    unit.switch(48, True)
    assert 'terminal 48 (CW/Stop) is closed' in rig.answer(rig.drive.enable())


def test_one_refusal_is_not_believed_of_a_card(make_virtual: MakeVirtual) -> None:
    rig = make(make_virtual)
    rig.connect()
    assert set(asked_by_enable(rig)) >= CARDS
    assert set(asked_by_enable(rig)) >= CARDS
    assert not CARDS & set(asked_by_enable(rig))


# --- the PC time-out ------------------------------------------------------------------------------


@pytest.mark.parametrize('timeout_stop', ['coasts', 'ramps'])
def test_the_pc_time_out_strikes_when_the_driver_dies(
    make_virtual: MakeVirtual, timeout_stop: str
) -> None:
    rig = make(make_virtual, {'timeout_stop': timeout_stop}, drive_timeout=1.5)
    rig.ride()
    rig.pass_time(20.0)
    rig.send(None)
    rig.pass_time(5.0)
    # nobody sends set-points any more, and it is still enabled
    assert rig.drive.armed and not rig.far.faults
    rig.send(20.0)
    rig.pass_time(1.0)
    rig.kill()
    rig.elapse(1.0)
    assert not rig.far.faults
    rig.elapse(1.0)
    assert rig.far.faults.codes == [PC_TIMEOUT]
    rig.elapse(2.0)
    assert not rig.far.motor.driven


def test_a_pc_time_out_that_is_found_is_acknowledged_by_a_person_alone(
    make_virtual: MakeVirtual,
) -> None:
    rig = make(make_virtual, {'bits_in_fault': 'kept'}, drive_timeout=1.5)
    rig.ride()
    rig.kill()
    rig.elapse(5.0)
    rig.begin()
    rig.connect()
    rig.pass_time(3.0)
    assert any('145 PC time out' in text or 'fault 145' in text for _, _, text in rig.notes.events)
    assert rig.far.faults.codes == [PC_TIMEOUT]
    assert '145 PC time out' in rig.answer(rig.drive.enable())
    assert rig.far.faults.codes == [PC_TIMEOUT]
    assert 'acknowledged 145 PC time out' in rig.answer(rig.drive.acknowledge())
    assert_only_enable_helps(rig)


@pytest.mark.parametrize('found', [0.0, 5.0])
@pytest.mark.parametrize('end', [['clean up'], ['exit', 'clean up']], ids=['clean up', 'exit'])
def test_a_clean_end_leaves_the_pc_time_out_as_it_was_found(
    make_virtual: MakeVirtual, found: float, end: list[str]
) -> None:
    rig = make_virtual({'serial.pc_timeout': found}, model=MODEL, drive_timeout=1.5)
    rig.ride()
    assert rig.far.memory.number('serial.pc_timeout') == 1.5
    # set again and changed: what was found stays what it was
    rig.answer(rig.drive.set_drive_timeout(2.0))
    for name in end:
        assert succeeded(rig, WAYS[name](rig.drive)), name
    assert rig.far.memory.number('serial.pc_timeout') == found
    assert bool(rig.said(Cause.OWN_TIMEOUT_LEFT, Severity.WARNING)) == bool(found)
    rig.send(None)
    rig.kill()
    rig.elapse(20.0)
    assert bool(rig.far.faults) == bool(found)


def test_a_clean_end_turns_the_pc_time_out_off_when_the_motor_has_stopped(
    make_virtual: MakeVirtual,
) -> None:
    rig = make(make_virtual, drive_timeout=1.5)
    rig.ride()
    frequencies: list[float] = []

    def meet(index: int, words: Words | None) -> None:
        if index == PC_TIMEOUT_INDEX and words is not None:
            frequencies.append(rig.far.motor.frequency)

    rig.before = meet
    assert succeeded(rig, rig.drive.disconnect(5.0))
    assert frequencies == [0.0]


def test_a_clean_end_during_a_long_ramp_leaves_no_fault(make_virtual: MakeVirtual) -> None:
    rig = make_virtual({'ramp.t11_down': 60.0}, model=MODEL, drive_timeout=1.5)
    rig.ride()
    assert succeeded(rig, rig.drive.disconnect(0.5))
    rig.send(None)
    rig.kill()
    rig.elapse(1.0)
    assert rig.far.motor.frequency > 10
    rig.elapse(60.0)
    assert not rig.far.faults and not rig.far.motor.turning


@pytest.mark.parametrize('seconds', [0.0, 4.0])
def test_a_pc_time_out_of_somebody_else_is_left_alone(
    make_virtual: MakeVirtual, seconds: float
) -> None:
    rig = make(make_virtual, drive_timeout=1.5)
    rig.ride()
    rig.far.set_from_keypad('serial.pc_timeout', seconds)
    rig.pass_time(1.0)
    written = len(rig.written(PC_TIMEOUT_INDEX))
    assert succeeded(rig, rig.drive.disconnect(1.0))
    assert len(rig.written(PC_TIMEOUT_INDEX)) == written
    assert rig.far.memory.number('serial.pc_timeout') == seconds


def test_a_pc_time_out_that_cannot_be_ended_is_told(make_virtual: MakeVirtual) -> None:
    rig = make(make_virtual, drive_timeout=1.5)
    rig.ride()
    rig.far.set_from_keypad('special.parameter_lock', True)
    # the motor stands all the same
    assert succeeded(rig, rig.drive.disconnect(1.0))
    assert rig.far.motor.frequency == 0
    assert rig.said(Cause.OWN_TIMEOUT_LEFT, Severity.WARNING)


def test_a_drive_that_answers_late_is_followed_all_the_same(make_virtual: MakeVirtual) -> None:
    rig = make_virtual({'serial.response_time': 200.0}, model=MODEL, drive_timeout=3.0)
    rig.ride()
    rig.pass_time(30.0)
    assert rig.drive.armed and not rig.far.faults
    assert succeeded(rig, rig.drive.stop())


@pytest.mark.parametrize('count', [4, 8])
def test_several_at_one_line_are_kept_alive_while_others_are_enabled(
    make_line: MakeLine, count: int
) -> None:
    # an enable asks some forty times, and nobody sends set-points yet
    rig = make_line(count, protocol='movitrac', drive_timeout=1.5)
    rig.connect()
    rig.enable()
    assert not any(far.faults for far in rig.fars.values())
    rig.keep(lambda: rig.give_all(20.0))
    rig.pass_time(20.0)
    assert not any(far.faults for far in rig.fars.values())
    assert all(drive.armed for drive in rig.drives.values())
    assert all(far.motor.frequency > 19 for far in rig.fars.values())
    stops = [drive.stop() for drive in rig.drives.values()]
    for stop in stops:
        rig.answer(stop)
        assert stop.exception() is None
    rig.pass_time(3.0)
    assert not any(far.motor.turning for far in rig.fars.values())


# --- what it does not do, and says so -------------------------------------------------------------


@pytest.mark.parametrize(
    ('settings', 'closed', 'opened', 'reason'),
    [
        ({}, 41, 0, 'terminal 41 (CW/Stop) is closed'),
        ({}, 42, 0, 'terminal 42 (CCW/Stop) is closed'),
        ({}, 0, 43, 'terminal 43 (Enable/Stop) is open'),
        ({'serial.manual_operation': True}, 0, 0, 'P870'),
        ({'special.parameter_lock': True}, 0, 0, 'P800'),
        ({'frequency.f_min_1': 5.0}, 0, 0, 'set frequency.f_min_1 to 0'),
    ],
)
def test_an_enable_is_refused_with_the_reason(
    make_virtual: MakeVirtual, settings: dict[str, Any], closed: int, opened: int, reason: str
) -> None:
    rig = make_virtual(settings, model=MODEL)
    rig.connect()
    for terminal, state in ((closed, True), (opened, False)):
        if terminal:
            rig.far.control_unit.switch(terminal, state)
    assert reason in rig.answer(rig.drive.enable())
    rig.send(20.0)
    rig.pass_time(1.0)
    assert not rig.drive.armed
    assert not bits(rig) & DIRECTIONS
    assert not rig.written(P841) or 'P800' in reason
    assert round(rig.far.memory.number(CONTROL_MODE)) == Mode.STANDARD


@pytest.mark.parametrize(
    ('card', 'settings', 'reason'),
    [
        ('fen', {'control.operating_mode': 'Positioning control'}, 'P770'),
        ('fea', {'serial.master_slave': True}, 'no response'),
    ],
)
def test_an_enable_is_refused_in_another_operating_mode(
    make_virtual: MakeVirtual, card: str, settings: dict[str, Any], reason: str
) -> None:
    rig = make_virtual(settings, variant={'option_card': card}, model=MODEL)
    if reason == 'no response':
        # on RS-485 it hears nobody then; what the simulated line does is tested elsewhere
        rig.far.control_unit.hears = lambda *line: True  # type: ignore[method-assign]
        reason = 'P880'
    rig.connect()
    assert reason in rig.answer(rig.drive.enable())
    assert not rig.drive.armed


@pytest.mark.parametrize(
    'ask',
    [
        lambda drive: drive.tune(Procedure.FULL),
        lambda drive: drive.erase_error_log(),
        lambda drive: drive.reset_energy(),
    ],
    ids=['tune', 'erase', 'energy'],
)
def test_what_it_has_not_is_answered_so(
    make_virtual: MakeVirtual, ask: Callable[[Drive], Future[Any]]
) -> None:
    rig = make(make_virtual)
    rig.connect()
    frames = len(rig.link.frames)
    future = ask(rig.drive)
    assert not succeeded(rig, future)
    assert MODEL in rig.answer(future) or 'MOVITRAC' in rig.answer(future)
    assert all(words is None for _, words in requests_since(rig, frames))


def test_the_last_five_faults_are_told_newest_first(make_virtual: MakeVirtual) -> None:
    rig = make(make_virtual)
    rig.connect()
    for fault in (101, 107, 106, 145, 103, 101):
        rig.far.trip(fault)
        rig.far.control_unit.reset()
    log = rig.drive.error_log()
    rig.answer(log)
    assert [entry.code for entry in log.result()] == [101, 103, 145, 106, 107]
    assert [entry.text for entry in log.result()[:2]] == ['Overcurrent', 'Brake chopper']
