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


"""A stop, or an exit, is a success only when the drive has shown that no motor has current."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from concurrent.futures import Future
import contextlib
import itertools
from typing import Any
from unittest import mock

from drive_rig import MODE
from drive_rig import RUN
from drive_rig import SCMD
import pytest
from support.addresses import Words
from support.said import said
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.families.sinus_g2.words import Status
from nfo_sinus_driver.link import Refused
from nfo_sinus_driver.simulator.sinus_g2 import control_unit

WAYS: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'quick stop': lambda drive: drive.quick_stop(),
    'deactivate': lambda drive: drive.deactivate(),
    'clean up': lambda drive: drive.disconnect(1.0),
    'exit': lambda drive: drive.stop_for_good(1.0),
}
#: No manual says what DriveStatus shows of a tuning.
WORDS = (
    Status(0),
    Status.READY_TO_SWITCH_ON | Status.CTRL_FROM_NET,
    Status.READY_TO_SWITCH_ON | Status.SWITCHED_ON | Status.OP_ENABLED | Status.CTRL_FROM_NET,
)


@contextlib.contextmanager
def tuning(rig: VirtualRig, word: Status) -> Iterator[Future[Any]]:
    """Have a drive tune that refuses everything until it is over; its status word is this."""

    def refuse(register: int, words: Words | None) -> None:
        if rig.far.control_unit.tuning is not None and words is not None:
            raise Refused(Refused.DEVICE_FAILURE)

    with mock.patch.object(control_unit, '_TUNING_STATUS', word):
        rig.connect()
        future = rig.drive.tune(Procedure.FULL)
        while rig.far.control_unit.tuning is None:
            rig.pass_time(0.01)
        rig.before = refuse
        yield future


def answered(rig: VirtualRig, future: Future[Any]) -> bool:
    """Wait for an answer; tell whether it is a success."""
    rig.answer(future)
    error = future.exception()
    assert error is None or isinstance(error, DriveError)
    return error is None


@pytest.mark.parametrize('word', WORDS)
@pytest.mark.parametrize('way', WAYS)
def test_a_stop_of_a_tuning_that_is_refused_is_no_success(
    make_virtual: MakeVirtual, way: str, word: Status
) -> None:
    rig = make_virtual()
    with tuning(rig, word) as tuned:
        stop = WAYS[way](rig.drive)
        success = answered(rig, stop)
        assert success == (rig.far.control_unit.tuning is None)
        assert not success
        assert 'NOT confirmed' in said(stop.exception()) and '28 Tuning' in said(stop.exception())
        while rig.far.control_unit.tuning is not None:
            rig.pass_time(0.01)
        # it was tried until it was over
        rig.pass_time(0.5)
        assert not rig.drive.stop_unconfirmed
        assert tuned.done() or 'finished' in rig.answer(tuned)


@pytest.mark.parametrize('word', WORDS)
def test_an_exit_waits_for_the_end_of_a_tuning(make_virtual: MakeVirtual, word: Status) -> None:
    rig = make_virtual()
    with tuning(rig, word):
        assert answered(rig, rig.drive.stop_for_good(30.0))
        assert rig.far.control_unit.tuning is None
        assert not rig.far.motor.driven


def test_a_tuning_of_a_driver_before_is_stopped_by_an_exit_too(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    with tuning(rig, Status(0)):
        rig.kill()
        rig.begin()
        assert 'firmware' in rig.connect()
        assert not answered(rig, rig.drive.stop_for_good(1.0))
        assert rig.far.control_unit.tuning is not None


def test_an_enable_that_comes_while_a_stop_is_on_its_way_is_refused(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual()
    rig.connect()
    for moment in range(0, 60, 2):
        first = rig.drive.enable()
        rig.pass_time(moment / 1000)
        # by the order of arrival the last is behind the stop
        futures = [rig.drive.enable(), rig.drive.stop(), rig.drive.enable()]
        rig.send(20.0)
        answers = [rig.answer(future) for future in (first, *futures)]
        assert 'a stop is on its way' in answers[3]
        rig.pass_time(0.5)
        assert not rig.drive.armed
        assert not rig.far.motor.driven
        assert rig.far.control_unit.scmd == Scmd.STOP
        rig.send(None)


def test_what_was_asked_for_before_a_stop_was_confirmed_is_refused_after_it(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual()
    rig.ride()
    stop = rig.drive.stop()
    rig.pass_time(0.0)
    asked_at = rig.clock.now
    assert answered(rig, stop)
    assert rig.clock.now > asked_at
    rig.pass_time(1.0)
    for command in (
        rig.drive.enable(asked_at), rig.drive.tune(Procedure.FULL, asked_at=asked_at)
    ):
        assert 'a stop was confirmed after this was asked for' in rig.answer(command)
        assert rig.far.control_unit.scmd == Scmd.STOP
    assert 'enabled' in rig.answer(rig.drive.enable(rig.clock.now))


def test_an_enable_is_refused_until_every_quick_stop_has_ended(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.ride()
    stops: list[Future[Any]] = [rig.drive.quick_stop()]
    releases = itertools.count()

    def be_busy_with_the_second(register: int, words: Words | None) -> None:
        if (register, words) == (MODE, (Mode.STOP,)):
            number = next(releases)
            if not number:
                stops.append(rig.drive.quick_stop())
            elif number < 5:
                rig.elapse(0.004)
                raise Refused(Refused.BUSY)

    rig.before = be_busy_with_the_second
    first = rig.answer(stops[0])
    assert first == 'released: the motor coasts'
    assert not stops[1].done()
    enable = rig.answer(rig.drive.enable())
    assert not stops[1].done()
    assert 'a stop is on its way' in enable
    rig.answer(stops[1])
    assert 'enabled' in rig.answer(rig.drive.enable())


def test_an_enable_may_follow_as_soon_as_a_stop_is_answered(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    for stop in (rig.drive.stop, rig.drive.quick_stop):
        rig.ride()
        assert answered(rig, stop())
        assert 'enabled' in rig.answer(rig.drive.enable())


def test_an_enable_may_follow_as_soon_as_a_fault_is_acknowledged(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.ride()
    rig.far.trip(5)
    rig.pass_time(1.0)
    assert answered(rig, rig.drive.acknowledge())
    assert 'enabled' in rig.answer(rig.drive.enable())


def test_a_lost_stop_is_repeated_at_once(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.ride()
    rig.link.unheard = 3
    asked: list[tuple[float, bool]] = []

    def note(register: int, words: Words | None) -> None:
        asked.append((rig.clock.now, (register, words) == (SCMD, (Scmd.STOP,))))

    rig.before = note
    stop = rig.drive.stop()
    assert answered(rig, stop)
    # nothing between, and no longer than the time-out that shows that it was lost
    assert [stops for _, stops in asked[:4]] == [True] * 4
    times = [at for at, _ in asked[:4]]
    assert max(later - at for at, later in itertools.pairwise(times)) < 0.12
    assert not rig.said(Cause.CANNOT_STOP)


def test_a_stop_that_ends_with_the_driver_is_no_success(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.connect()

    def lose(register: int, words: Words | None) -> None:
        if (register, words) == (SCMD, (RUN,)):
            rig.link.state = 'deaf'

    rig.before = lose
    rig.drive.enable()
    while not rig.far.motor.driven:
        rig.pass_time(0.01)
    # what was seen last is a drive that stands by
    rig.link.state = 'silent'
    stop = rig.drive.stop()
    rig.pass_time(0.05)
    # as the end of the bus does, which ends what it is to be confirmed by before who waits for it
    sequence = rig.drive._controller._sequence._task
    rig.bus.call(lambda: rig.bus.cancel(sequence))
    rig.pass_time(0.3)
    assert rig.far.motor.driven
    assert isinstance(stop.exception(), DriveError)


def test_a_stop_that_the_drive_is_too_busy_for_is_written_again_soon(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual()
    rig.ride()
    rig.be_busy(SCMD, 3, writes=True)
    asked_at = rig.clock.now
    stop = rig.drive.stop()
    while rig.far.control_unit.scmd != Scmd.STOP:
        rig.pass_time(0.005)
    assert rig.clock.now - asked_at < 0.15
    assert answered(rig, stop)


def test_callers_who_were_answered_are_forgotten(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.ride()
    rig.link.state = 'silent'
    rig.pass_time(3.0)
    for _ in range(5):
        assert not answered(rig, rig.drive.stop())
    assert not rig.drive._controller._sequence._task.joiners


def test_what_was_seen_before_a_new_reason_to_stop_confirms_nothing(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual()
    rig.ride()
    begun = len(rig.written(SCMD))

    def know_better(register: int, words: Words | None) -> None:
        if words is None and len(rig.written(SCMD)) > begun:
            # it is being looked whether the drive stops
            rig.before = lambda *_: None
            rig.drive._controller._sequence.request_anew()

    rig.before = know_better
    rig.answer(rig.drive.stop())
    assert rig.written(SCMD)[begun:] == [Scmd.STOP, Scmd.STOP]


def test_many_callers_share_one_stop(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.ride()
    rig.link.state = 'silent'
    stops = [rig.drive.stop()]
    for _ in range(50):
        rig.pass_time(0.02)
        stops.append(rig.drive.stop())
    rig.pass_time(4.0)
    assert all(stop.done() for stop in stops)
    # it is lost by now, and callers learn so at once
    begun, asked = rig.clock.now, len(rig.written(SCMD))
    for _ in range(20):
        assert not answered(rig, rig.drive.stop())
    assert rig.clock.now - begun < 1.0
    assert len(rig.written(SCMD)) - asked <= 2
    rig.link.mend()
    rig.pass_time(5.0)
    assert not rig.drive.stop_unconfirmed
    assert not rig.far.motor.driven
    assert rig.said(Cause.CANNOT_STOP, Severity.ERROR)
    assert RUN not in rig.written(SCMD)[asked:]
    assert Mode.EXT not in rig.written(MODE)


@pytest.mark.parametrize('way', ['stop', 'quick stop', 'deactivate', 'clean up', 'keypad'])
def test_who_sees_a_drive_disarmed_sees_that_its_stop_is_not_confirmed(
    make_virtual: MakeVirtual, way: str
) -> None:
    # other threads look at any moment, and take "not armed, no stop pending" for the end of a stop
    rig = make_virtual()
    rig.ride()
    seen = []
    disarm = rig.drive.setpoint.disarm

    def note() -> None:
        disarm()
        seen.append(rig.drive.stop_unconfirmed)

    with mock.patch.object(rig.drive.setpoint, 'disarm', note):
        if way == 'keypad':
            rig.far.control_unit.press('stop')
            rig.pass_time(1.0)
        else:
            answered(rig, WAYS[way](rig.drive))
    assert seen == [True]
    rig.pass_time(1.0)
    assert not rig.drive.stop_unconfirmed
