# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The end of a driver with many drives, on a line that takes long to stop them all."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import pytest
from support.rig import Rig
from support.stops import takes_run_away

from nfo_sinus_driver.families.sinus_g2.words import Scmd

#: How long each may take, s; all of them take longer on such a line.
_PATIENCE = 4.0
_SCMD = 'fieldbus.scmd'
_SLOW = {'baud': 1200}
#: So many that the stops of all take longer than that, but less than twice as long.
_DRIVES = {'rtu': 6, 'ascii': 4}


def _end(rig: Rig) -> dict[int, Future[Any]]:
    """End as the node does: stop all at once, and release each as soon as it is stopped."""
    until = rig.clock.monotonic() + _PATIENCE
    stops = {at: drive.stop_for_good(_PATIENCE) for at, drive in rig.drives.items()}
    releases: dict[int, Future[Any]] = {}

    def go_on() -> bool:
        for at, stop in stops.items():
            if at not in releases and stop.done() and stop.exception() is None:
                left = max(until - rig.clock.monotonic(), 0.0)
                releases[at] = rig.drives[at].disconnect(left)
        return all(stop.done() for stop in stops.values())

    rig.wait_until(go_on)
    go_on()
    for stop in stops.values():
        rig.result(stop)
    return releases


@pytest.mark.parametrize('connection', _DRIVES)
def test_each_is_stopped_before_one_is_released(connection: str) -> None:
    with Rig(connection, drives=_DRIVES[connection], line=_SLOW, poll_rate=0.2) as rig:
        rig.turn()
        rig.asked.clear()
        releases = _end(rig)
        for release in releases.values():
            rig.answer(release)
        stops = [at for at, key, data in rig.asked if key == _SCMD and data is not None]
        assert sorted(stops) == sorted(rig.drives), 'one stop is written to each'
        assert not rig.turns
        for drive in rig.drives.values():
            assert not drive.stop_owed and not drive.stop_waits


def test_a_motor_that_is_left_to_its_ramp_is_left_without_a_run_command() -> None:
    # one that a gateway has held until after the confirmed stop looks like a ramp to many drives
    with Rig(parameters={'control.retard': 500.0}) as rig:
        rig.turn()
        rig.result(rig.drive.stop_for_good(_PATIENCE))
        rig.asked.clear()
        assert 'left to its ramp' in rig.answer(rig.drive.disconnect(1.0))
        assert [data for _, key, data in rig.asked if key == _SCMD and data] == [b'\0\0']


def test_a_drive_that_is_cut_off_ends_the_wait_for_it() -> None:
    with Rig(drives=2) as rig:
        rig.turn()
        rig.meet = lambda key, data: 'unheard'
        stop = rig.drive.stop_for_good(_PATIENCE)
        begun = rig.clock.monotonic()
        assert 'NOT confirmed' in rig.answer(stop)
        assert rig.clock.monotonic() - begun < _PATIENCE + 1.0


# ``make exhaustive`` has them all
@pytest.mark.parametrize('connection', ['optimal, control word', 'movitrac, by terminals'])
def test_one_lost_answer_fails_no_release(connection: str) -> None:
    asked = lost_at = 0
    # at each request of it in turn
    while lost_at <= asked:
        with Rig(connection, line={'response_timeout': 0.1}) as rig:
            rig.turn()
            rig.result(rig.drive.quick_stop())
            rig.pass_time(1.5)
            begun = len(rig.asked)

            def meet(*_: object, rig: Rig = rig, at: int = begun + lost_at) -> str | None:
                return 'drop' if len(rig.asked) == at + 1 else None

            rig.meet = meet
            released = rig.drive.disconnect(2.0)
            rig.answer(released)
            assert released.exception() is None, (lost_at, rig.asked[begun:])
            asked = len(rig.asked) - begun
            lost_at += 1


def _take_over(rig: Rig) -> None:
    rig.far.control_unit.press('ext')


def _tune(rig: Rig) -> None:
    rig.far.write_raw(_SCMD, int(Scmd.FULL_TUNING))


def _trip(rig: Rig) -> None:
    # with a run command that a gateway has held until after the stop
    rig.far.write_raw(_SCMD, int(Scmd.FIX_1_F))
    rig.far.trip(rig.a_fault)


@pytest.mark.parametrize('happen', [_take_over, _tune, _trip])
def test_what_has_come_since_the_last_poll_of_an_end_is_stopped(
    happen: Callable[[Rig], None]
) -> None:
    with Rig() as rig:
        rig.turn()
        rig.send(None)
        rig.result(rig.drive.stop_for_good(_PATIENCE))
        polled = len(rig.notes.snapshots)
        rig.wait_until(lambda: len(rig.notes.snapshots) > polled)
        happen(rig)
        rig.asked.clear()
        rig.answer(rig.drive.disconnect(1.0))
        rig.pass_time(2.0)
        stops = [key for _, key, data in rig.asked if key == _SCMD and data == b'\0\0']
        assert stops and rig.far.control_unit.tuning is None
        rig.notes.events.clear()


@pytest.mark.parametrize('drives', [2, 4, 8])
def test_after_a_pause_each_is_stopped_before_one_is_released(drives: int) -> None:
    # each may be another one by then, and is recognised before
    with Rig('described', drives=drives, poll_rate=20.0, drive_timeout=2.0) as rig:
        rig.turn()
        ended = {at: drive.stop_for_good(_PATIENCE) for at, drive in rig.drives.items()}
        rig.line.go_to(rig.clock.now + 3.5)
        rig.asked.clear()
        releases = {}

        def stopped() -> set[int]:
            for at, stop in ended.items():
                if at not in releases and stop.done():
                    releases[at] = rig.drives[at].disconnect(_PATIENCE)
            return {at for at, key, data in rig.asked if takes_run_away(rig, key, data)}

        # each has stopped its motor by itself: ten requests, with the silence that it wants
        rig.wait_until(lambda: stopped() == set(rig.drives), 0.17 * drives)
        rig.wait_until(lambda: stopped() and len(releases) == drives, 20.0)
        for release in releases.values():
            rig.answer(release)
        assert not rig.turns
