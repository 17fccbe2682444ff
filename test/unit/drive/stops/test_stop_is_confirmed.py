# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A stop, or an exit, is a success only when the drive has shown that no motor has current."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
import contextlib
import itertools
from typing import Any
from unittest import mock

import pytest
from support.rig import Rig
from support.said import said
from test_laws import STOPS

from nfo_sinus_driver.drive import Cause, DriveError, Procedure, Severity
from nfo_sinus_driver.families.sinus_g2.words import Mode, Scmd, Status
from nfo_sinus_driver.simulator.sinus_g2 import control_unit

MODE, SCMD = 'fieldbus.mode', 'fieldbus.scmd'
STOP = int(Scmd.STOP).to_bytes(2, 'big')
RUN = int(Scmd.FIELDBUS).to_bytes(2, 'big')
#: No manual says what DriveStatus shows of a tuning.
WORDS = (
    Status(0),
    Status.READY_TO_SWITCH_ON | Status.CTRL_FROM_NET,
    Status.READY_TO_SWITCH_ON | Status.SWITCHED_ON | Status.OP_ENABLED | Status.CTRL_FROM_NET,
)
every_word = pytest.mark.parametrize('word', WORDS)


@contextlib.contextmanager
def tuning(word: Status = WORDS[0]) -> Iterator[tuple[Rig, Future[Any]]]:
    """Have a drive tune that refuses everything until it is over; its status word is this."""
    with mock.patch.object(control_unit, '_TUNING_STATUS', word), Rig() as rig:
        unit = rig.far.control_unit
        rig.connect()
        future = rig.drive.tune(Procedure.FULL)
        rig.wait_until(lambda: unit.tuning is not None)
        rig.meet = lambda key, data: 'refused' if unit.tuning and data is not None else None
        yield rig, future


def succeeds(rig: Rig, future: Future[Any]) -> bool:
    """Wait for an answer; return whether it is a success."""
    rig.answer(future)
    error = future.exception()
    assert error is None or isinstance(error, DriveError)
    return error is None


@every_word
@pytest.mark.parametrize('how', STOPS)
def test_a_stop_of_a_tuning_that_is_refused_is_no_success(how: str, word: Status) -> None:
    with tuning(word) as (rig, tuned):
        unit = rig.far.control_unit
        stop = rig.drive.stop_for_good(1.0) if how == 'exit' else STOPS[how](rig.drive)
        assert not succeeds(rig, stop) and unit.tuning is not None
        assert 'NOT confirmed' in said(stop.exception()) and '28 Tuning' in said(stop.exception())
        rig.wait_until(lambda: unit.tuning is None)
        # it was tried until it was over
        rig.pass_time(0.5)
        assert not rig.drive.stop_unconfirmed
        assert tuned.done() or 'finished' in rig.answer(tuned)


@every_word
def test_an_exit_waits_for_the_end_of_a_tuning(word: Status) -> None:
    with tuning(word) as (rig, _):
        assert succeeds(rig, rig.drive.stop_for_good(30.0))
        assert rig.far.control_unit.tuning is None
        assert not rig.far.motor.driven


def test_a_tuning_of_a_driver_before_is_stopped_by_an_exit_too() -> None:
    with tuning() as (rig, _):
        rig.kill()
        rig.begin()
        rig.connect()
        assert not succeeds(rig, rig.drive.stop_for_good(1.0))
        assert rig.far.control_unit.tuning is not None


def test_what_was_requested_before_a_stop_was_confirmed_is_refused_after_it() -> None:
    with Rig() as rig:
        rig.turn()
        stop, requested_at = rig.drive.stop(), rig.clock.now
        assert succeeds(rig, stop) and rig.clock.now > requested_at
        for command in (
            rig.drive.enable(requested_at),
            rig.drive.tune(Procedure.FULL, requested_at=requested_at),
        ):
            assert 'a stop was confirmed after this was requested' in rig.answer(command)
            assert rig.far.control_unit.scmd == Scmd.STOP
        assert 'enabled' in rig.answer(rig.drive.enable(rig.clock.now))


def test_where_a_fault_forbids_what_was_requested_before_a_stop_the_fault_is_told() -> None:
    with Rig() as rig:
        rig.turn()
        stop, requested_at = rig.drive.stop(), rig.clock.now
        assert succeeds(rig, stop)
        rig.far.trip(5)
        rig.pass_time(0.5)
        for command in (
            rig.drive.enable(requested_at),
            rig.drive.tune(Procedure.FULL, requested_at=requested_at),
        ):
            assert 'fault 5 Overload is active' in rig.answer(command)


def test_two_calls_of_a_quick_stop_are_one_and_no_enable_comes_between() -> None:
    with Rig() as rig:
        rig.turn()
        stops: list[Future[Any]] = [rig.drive.quick_stop()]
        releases = itertools.count()

        def be_busy(key: str, data: bytes | None) -> str | None:
            if (key, data) != (MODE, int(Mode.STOP).to_bytes(2, 'big')):
                return None
            if not (number := next(releases)):
                stops.append(rig.drive.quick_stop())
            return 'busy' if number < 5 else None

        rig.meet = be_busy
        rig.wait_until(lambda: len(stops) == 2)
        enable = rig.answer(rig.drive.enable())
        assert not stops[1].done() and 'a stop is on its way' in enable
        assert [rig.answer(stop) for stop in stops] == ['released: the motor coasts'] * 2
        assert next(releases) == 6, 'it is written once, and while the drive is busy'
        assert 'enabled' in rig.answer(rig.drive.enable())


@pytest.mark.parametrize('how', ['stop', 'quick stop', 'acknowledge'])
def test_an_enable_may_follow_as_soon_as_a_stop_is_answered(how: str) -> None:
    with Rig() as rig:
        rig.turn()
        if how == 'acknowledge':
            rig.far.trip(5)
            rig.pass_time(1.0)
            rig.acknowledged = 1
        stop = rig.drive.acknowledge() if how == 'acknowledge' else STOPS[how](rig.drive)
        assert succeeds(rig, stop)
        assert 'enabled' in rig.answer(rig.drive.enable())


def test_a_lost_stop_is_repeated_at_once() -> None:
    with Rig() as rig:
        rig.turn()
        asked: list[tuple[float, bool]] = []

        def note(key: str, data: bytes | None) -> str | None:
            asked.append((rig.clock.now, (key, data) == (SCMD, STOP)))
            return 'unheard' if len(asked) <= 2 else None

        rig.meet = note
        assert succeeds(rig, rig.drive.stop())
        # nothing between, and no longer than the time-out that shows that it was lost
        assert [stops for _, stops in asked[:3]] == [True] * 3
        times = [at for at, _ in asked[:3]]
        assert max(after - before for before, after in itertools.pairwise(times)) < 0.22
        assert not rig.notes.said(Cause.CANNOT_STOP)


def test_a_stop_that_the_drive_is_too_busy_for_is_written_again_soon() -> None:
    with Rig() as rig:
        rig.turn()
        rig.spoil('busy', SCMD, 3)
        requested_at, stop = rig.clock.now, rig.drive.stop()
        rig.wait_until(lambda: rig.far.control_unit.scmd == Scmd.STOP)
        assert rig.clock.now - requested_at < 0.15
        assert succeeds(rig, stop)


def test_a_stop_that_ends_with_the_driver_is_no_success() -> None:
    with Rig() as rig:
        rig.connect()

        def lose(key: str, data: bytes | None) -> None:
            if (key, data) == (SCMD, RUN):
                rig.line.state = 'deaf'

        rig.meet = lose
        rig.drive.enable()
        rig.wait_until(lambda: rig.far.motor.driven)
        # what was seen last is a drive that stands by
        rig.line.state = 'silent'
        stop = rig.drive.stop()
        rig.pass_time(0.05)
        # as the end of the bus does, which ends what it is to be confirmed by before who waits
        sequence = rig.drive._controller._sequence._task
        rig.bus.call(lambda: rig.bus.cancel(sequence))
        rig.pass_time(0.3)
        assert rig.far.motor.driven
        assert isinstance(stop.exception(), DriveError)


def test_a_status_from_before_a_new_reason_to_stop_confirms_nothing() -> None:
    with Rig() as rig:
        rig.turn()
        begun = len(rig.written(SCMD))

        def know_better(key: str, data: bytes | None) -> None:
            if data is None and len(rig.written(SCMD)) > begun:
                # it is being looked whether the drive stops
                rig.meet = lambda key, data: None
                rig.drive._controller._sequence.restart()

        rig.meet = know_better
        rig.answer(rig.drive.stop())
        assert rig.written(SCMD)[begun:] == [Scmd.STOP, Scmd.STOP]


def test_many_callers_share_one_stop() -> None:
    with Rig() as rig:
        rig.turn()
        rig.line.state = 'silent'
        stops = [rig.drive.stop()]
        for _ in range(50):
            rig.pass_time(0.02)
            stops.append(rig.drive.stop())
        rig.pass_time(4.0)
        assert all(stop.done() for stop in stops)
        # it is lost by now, and callers learn so at once
        begun, asked = rig.clock.now, len(rig.written(SCMD))
        for _ in range(20):
            assert not succeeds(rig, rig.drive.stop())
        # those who were answered are forgotten
        assert not rig.drive._controller._sequence._task.joiners
        assert rig.clock.now - begun < 1.5
        assert len(rig.written(SCMD)) - asked <= 2
        rig.line.mend()
        rig.pass_time(5.0)
        assert not rig.drive.stop_unconfirmed and not rig.far.motor.driven
        assert rig.notes.said(Cause.CANNOT_STOP, Severity.ERROR)
        assert Scmd.FIELDBUS not in rig.written(SCMD)[asked:]
        assert Mode.EXT not in rig.written(MODE)


@pytest.mark.parametrize('how', [*STOPS, 'keypad'])
def test_a_drive_that_shows_as_not_enabled_shows_its_unconfirmed_stop(how: str) -> None:
    # other threads look at any moment, and take "not armed, no stop pending" for the end of a stop
    with Rig() as rig:
        rig.turn()
        seen = []
        stop_following = rig.drive.setpoint.stop_following

        def note() -> None:
            stop_following()
            seen.append(rig.drive.stop_unconfirmed)

        with mock.patch.object(rig.drive.setpoint, 'stop_following', note):
            if how == 'keypad':
                rig.far.control_unit.press('stop')
                rig.pass_time(1.0)
            else:
                succeeds(rig, STOPS[how](rig.drive))
        assert seen == [True]
        rig.pass_time(1.0)
        assert not rig.drive.stop_unconfirmed
