# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Drives that stop with another one: at once, whatever stops that one, and only they."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from support.rig import CONNECTIONS, Rig

from nfo_sinus_driver.drive import Cause, Report, StopReason

#: How many requests there may be from the first stop of the one to the first of the other.
_BETWEEN = 2


def couple(rig: Rig, first: int, second: int) -> None:
    """Have a drive stop when another one does."""
    rig.drives[first].on_stop(
        lambda why: rig.drives[second].stop_beside(
            Report(Cause.STOPPED_WITH, drive=f'/drive{first}', why=why)
        )
    )


#: Those on which the rig has several drives.
SEVERAL = [name for name, connection in CONNECTIONS.items() if connection.protocol != 'telegram1']
STOPS: dict[str, Callable[[Rig], object]] = {
    'stop': lambda rig: rig.drive.stop(),
    'quick stop': lambda rig: rig.drive.quick_stop(),
    'fault': lambda rig: rig.far.trip(rig.a_fault),
    'lost': lambda rig: rig.far.silence(3600.0),
}


@pytest.mark.parametrize('connection', SEVERAL)
@pytest.mark.parametrize('stop', STOPS)
def test_whatever_stops_a_drive_stops_what_stops_with_it(connection: str, stop: str) -> None:
    with Rig(connection, drives=3) as rig:
        couple(rig, 1, 2)
        rig.turn()
        STOPS[stop](rig)
        rig.pass_time(4.0)
        assert rig.drives[2].snapshot.stop_reason is StopReason.STOP_WITH
        assert not rig.drives[2].following and not rig.drives[2].stop_unconfirmed
        # and nothing else
        assert rig.drives[3].following
        # what has stopped is enabled again as ever
        rig.enable(2)
        assert rig.drives[2].following


@pytest.mark.parametrize('connection', SEVERAL)
def test_it_is_sent_the_stop_right_after_the_other(connection: str) -> None:
    with Rig(connection, drives=2) as rig:
        couple(rig, 1, 2)
        rig.turn()
        begun = len(rig.asked)
        stopping = rig.drive.stop()
        rig.answer(stopping)
        rig.pass_time(0.2)
        written = [unit for unit, _, data in rig.asked[begun:] if data is not None]
        first, second = written.index(1), written.index(2)
        assert first < second <= first + _BETWEEN


def test_a_circle_stops_all_of_it_once() -> None:
    with Rig(drives=3) as rig:
        for first, second in ((1, 2), (2, 3), (3, 1)):
            couple(rig, first, second)
        rig.turn()
        rig.answer(rig.drives[2].stop())
        rig.pass_time(1.0)
        reasons = [rig.drives[address].snapshot.stop_reason for address in (1, 2, 3)]
        assert reasons == [StopReason.STOP_WITH, StopReason.STOP, StopReason.STOP_WITH]
        rig.enable()
        assert all(drive.following for drive in rig.drives.values())


def test_without_set_points_a_drive_stays_enabled_and_nothing_stops_with_it() -> None:
    with Rig(drives=2, setpoint_timeout=1.0) as rig:
        couple(rig, 1, 2)
        rig.turn()
        rig.send(20.0, 2)
        rig.pass_time(3.0)
        assert rig.drive.snapshot.stop_reason is StopReason.SETPOINT_TIMEOUT
        assert rig.drives[2].following


@pytest.mark.provokes
def test_what_goes_wrong_with_the_others_keeps_no_stop() -> None:
    def fail(why: Report) -> None:
        raise ZeroDivisionError

    with Rig() as rig:
        rig.drive.on_stop(fail)
        rig.turn()
        assert 'stopping' in rig.answer(rig.drive.stop())
        rig.enable()
        assert rig.drive.following
