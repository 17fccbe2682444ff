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

"""A set-point and the status in one transaction, where the drive has it (function 23)."""

from __future__ import annotations

import pytest
from support.addresses import Words
from support.wire import Request
from support.wire import understand
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.link import NoAnswer
from nfo_sinus_driver.link import Refused
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.sinus.control_unit import NOTHING

SETPOINT, STATUS, INV_ST, SCMD = 0x3FC, 0x258, 0x2A5, 0x298
OVERLOAD = 5
WRITE, BOTH = 6, 23


def frames(rig: VirtualRig) -> list[Request]:
    """What was asked so far."""
    asked = [understand(bytes.fromhex(one['hex']), 'modbus_rtu') for one in rig.link.frames]
    return [one for one in asked if one is not None]


def functions(rig: VirtualRig, register: int) -> list[int]:
    """By which functions a register was written, in order."""
    sent = [bytes.fromhex(one['hex']) for one in rig.link.frames]
    wrote = [understand(frame, 'modbus_rtu') for frame in sent]
    return [
        frame[1]
        for frame, one in zip(sent, wrote, strict=True)
        if one is not None and one.words is not None and one.place == register
    ]


def in_one(rig: VirtualRig) -> list[tuple[int, Words | None, tuple[int, int] | None]]:
    """What was written while something was read."""
    return [(one.place, one.words, one.source) for one in frames(rig) if one.source]


def quiet(make_virtual: MakeVirtual, **settings: object) -> VirtualRig:
    """A motor that turns, so seldom polled that nothing waits for the line."""
    rig = make_virtual(
        variant={'refuses_in_fault': NOTHING}, poll_rate=1.0, telemetry_rate=0.0, **settings
    )
    rig.ride(20.0)
    rig.send(None)
    return rig


def test_a_set_point_and_the_status_are_one_transaction(make_virtual: MakeVirtual) -> None:
    rig = quiet(make_virtual)
    begun = len(in_one(rig))
    rig.drive.set_setpoint(25.0)
    rig.pass_time(0.05)
    assert in_one(rig)[begun:] == [(SETPOINT, (250,), (STATUS, 2))]
    rig.pass_time(1.0)
    assert abs(rig.far.motor.frequency - 25.0) < 0.2


def test_set_point_zero_of_a_stop_is_a_write_alone(make_virtual: MakeVirtual) -> None:
    rig = quiet(make_virtual)
    assert rig.answer(rig.drive.stop()).startswith('stop')
    assert functions(rig, SETPOINT)[-1] == WRITE


def test_the_optimal_is_never_asked_for_it(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(model='sinus_optimal')
    rig.ride(20.0)
    assert BOTH not in functions(rig, SETPOINT)
    assert rig.drive.armed


@pytest.mark.parametrize('code', [Refused.ILLEGAL_FUNCTION, Refused.ILLEGAL_VALUE])
def test_one_that_refuses_the_function_is_given_up_for_the_connection(
    make_virtual: MakeVirtual, code: int
) -> None:
    rig = make_virtual(telemetry_rate=0.0)
    tried: list[int] = []

    def refuse(register: int, words: Words) -> None:
        tried.append(register)
        raise Refused(code)

    rig.before_both = refuse
    rig.ride(20.0)
    assert len(tried) == 1
    assert rig.drive.armed
    assert not rig.notes.events
    assert abs(rig.far.motor.frequency - 20.0) < 0.2


def test_the_plain_write_follows_at_once(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(telemetry_rate=0.0)
    refused_at: list[int] = []

    def refuse(register: int, words: Words) -> None:
        refused_at.append(len(rig.link.frames))
        raise Refused(Refused.ILLEGAL_FUNCTION)

    rig.before_both = refuse
    rig.ride(20.0)
    follow = [one.words for one in frames(rig)[refused_at[0] : refused_at[0] + 2]]
    # a poll may have waited longer, and a stop might
    assert (200,) in follow


def test_one_that_does_not_know_the_function_and_is_silent_is_given_up(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual(telemetry_rate=0.0)
    lost: list[int] = []

    def ignore(register: int, words: Words) -> None:
        lost.append(register)
        rig.elapse(0.1)
        raise NoAnswer('nobody answers')

    rig.before_both = ignore
    rig.ride(20.0)
    assert len(lost) == 1
    assert rig.drive.armed
    assert abs(rig.far.motor.frequency - 20.0) < 0.2


def test_it_is_tried_anew_after_a_reconnect(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(telemetry_rate=0.0)

    def refuse(register: int, words: Words) -> None:
        raise Refused(Refused.ILLEGAL_FUNCTION)

    rig.before_both = refuse
    rig.ride(20.0)
    rig.before_both = lambda register, words: None
    rig.link.state = 'silent'
    rig.pass_time(2.0)
    assert not rig.drive.snapshot.connected
    rig.link.mend()
    rig.pass_time(5.0)
    assert rig.drive.snapshot.connected
    assert not in_one(rig)
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.pass_time(0.5)
    assert in_one(rig)


def test_a_refused_set_point_stops(make_virtual: MakeVirtual) -> None:
    rig = quiet(make_virtual)

    def refuse(register: int, words: Words) -> None:
        raise Refused(Refused.ILLEGAL_VALUE)

    rig.before_both = refuse
    rig.drive.set_setpoint(30.0)
    rig.pass_time(0.3)
    assert not rig.drive.armed
    assert rig.said('it refused set-point 30')
    assert not rig.drive.stop_unconfirmed


def test_a_lost_answer_is_looked_after_before_the_next_set_point(
    make_virtual: MakeVirtual,
) -> None:
    rig = quiet(make_virtual)
    rig.link.losses = 1
    rig.drive.set_setpoint(30.0)
    rig.pass_time(0.3)
    assert rig.drive.armed
    asked = [(one.place, one.words) for one in frames(rig)]
    first, again = [n for n, one in enumerate(asked) if one == (SETPOINT, (300,))]
    assert (STATUS, None) in asked[first:again]
    assert functions(rig, SETPOINT)[-2:] == [BOTH, BOTH]


def test_a_fault_that_is_told_with_a_set_point_stops_at_once(make_virtual: MakeVirtual) -> None:
    rig = quiet(make_virtual)
    rig.far.trip(OVERLOAD)
    begun = len(rig.link.frames)
    rig.drive.set_setpoint(30.0)
    rig.pass_time(0.1)
    assert not rig.drive.armed
    asked = [(one.place, one.words) for one in frames(rig)[begun:]]
    assert asked[:3] == [(SETPOINT, (300,)), (INV_ST, None), (SCMD, (0,))]
    assert rig.said('stopped: fault 5 Overload')


def test_a_lost_run_input_that_is_told_with_a_set_point_stops_at_once(
    make_virtual: MakeVirtual,
) -> None:
    rig = quiet(make_virtual)
    rig.far.control_unit.run_input = False
    rig.far.advance(0.01)
    begun = len(rig.link.frames)
    rig.drive.set_setpoint(30.0)
    rig.pass_time(0.1)
    assert not rig.drive.armed
    asked = [(one.place, one.words) for one in frames(rig)[begun:]]
    assert asked[:3] == [(SETPOINT, (300,)), (INV_ST, None), (SCMD, (0,))]


def test_an_impossible_status_that_is_told_with_a_set_point_stops_nothing(
    make_virtual: MakeVirtual,
) -> None:
    rig = quiet(make_virtual)
    whole = server(rig.far).write_and_read

    def spoil(register: int, words: Words, source: int, count: int) -> Words:
        whole(register, words, source, count)
        return (0xFFFF, 0)

    server(rig.far).write_and_read = spoil  # type: ignore[method-assign]
    rig.drive.set_setpoint(25.0)
    rig.pass_time(1.5)
    assert rig.drive.armed
    assert not rig.notes.events


def test_a_stop_goes_before_a_set_point_that_waits(make_virtual: MakeVirtual) -> None:
    rig = quiet(make_virtual)
    begun = len(rig.link.frames)
    rig.drive.set_setpoint(30.0)
    stop = rig.drive.stop()
    assert rig.answer(stop).startswith('stop')
    writes = [(one.place, one.words) for one in frames(rig)[begun:] if one.words is not None]
    assert writes[0] == (SCMD, (0,))
    assert (SETPOINT, (300,)) not in writes


def test_a_poll_that_waits_is_spared_what_the_set_point_told(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(poll_rate=0.0, telemetry_rate=0.0)
    rig.ride(20.0)
    # a new one before each step of the bus
    value, begun = 20.0, len(rig.link.frames)
    for _ in range(40):
        value += 0.1
        rig.drive.set_setpoint(value)
        rig.bus.step()
    asked = frames(rig)[begun:]
    polls = [one for one in asked if one.place == STATUS and one.words is None]
    told = [one for one in asked if one.source]
    assert len(told) > 10
    assert len(polls) < len(told) / 4
    assert rig.drive.armed


@pytest.mark.parametrize(('timeout', 'period'), [(0.0, 5.0), (3.0, 1.0), (20.0, 5.0)])
def test_an_unchanged_set_point_is_written_no_more_often_than_needed(
    make_virtual: MakeVirtual, timeout: float, period: float
) -> None:
    rig = make_virtual(drive_timeout=timeout)
    rig.ride(20.0)
    begun = len(functions(rig, SETPOINT))
    rig.pass_time(30.0)
    assert rig.drive.armed
    # a program sends it ten times a second
    assert 30 / period * 0.8 <= len(functions(rig, SETPOINT)) - begun <= 30 / period + 1


def test_a_set_point_that_somebody_else_changed_is_written_again(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.ride(20.0)
    server(rig.far).write(SETPOINT, (300,))
    rig.pass_time(6.0)
    assert abs(rig.far.motor.frequency - 20.0) < 0.2
