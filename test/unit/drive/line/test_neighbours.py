# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Drives that are unplugged, or only stand, leave the line to their neighbours."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import Future
import itertools
import sys
from types import FrameType
from typing import Any

import pytest
from support.rig import CONNECTIONS, SLICE, Rig

#: What the neighbours keep of the rate that they would have alone on the line.
_KEPT = 0.9
#: From when on a drive that is unplugged is asked seldom, s.
_SETTLED = 5.0
#: How much longer than its reads alone the start of many drives may take.
_START = 1.2
_SLOW = {'baud': 19200}
#: The function of Modbus by which a stop is written.
_WRITE = 6
#: Those on which the rig has several drives.
SEVERAL = [name for name, kind in CONNECTIONS.items() if kind.protocol != 'telegram1']


def made(drives: int, connection: str = 'rtu', *, line: Any = _SLOW, **settings: Any) -> Rig:
    """Return a rig whose drives are polled as fast as the line allows."""
    return Rig(connection, drives=drives, line=line, **{'poll_rate': 50.0, **settings})


def polls(rig: Rig, seconds: float) -> Counter[int]:
    """Let time pass; return how many statuses of each drive were published meanwhile."""
    before = {address: len(notes.snapshots) for address, notes in rig.notes_of.items()}
    rig.pass_time(seconds)
    return Counter({
        address: sum(snapshot.connected for snapshot in notes.snapshots[before[address] :])
        for address, notes in rig.notes_of.items()
    })


def measured(rig: Rig) -> Counter[int]:
    """Return how often each drive was measured."""
    return Counter({address: len(notes.telemetry) for address, notes in rig.notes_of.items()})


def start(rig: Rig, *addresses: int) -> float:
    """
    Connect to some drives or to all, one a little after the other, and read their settings.

    Each is activated as it is done.

    :returns: how long it took, s.
    """
    began = rig.clock.now
    due = {address: began + 0.03 * n for n, address in enumerate(addresses or rig.fars)}
    begun: dict[int, Future[Any]] = {}
    while due or begun:
        for address in [address for address, at in due.items() if at <= rig.clock.now]:
            del due[address]
            begun[address] = rig.drives[address].connect(parameters=True)
        for address in [address for address, future in begun.items() if future.done()]:
            begun.pop(address).result()
            rig.drives[address].activate()
        rig.pass_time(SLICE)
    return rig.clock.now - began


def rate_alone(drives: int, connection: str, *, runs: bool) -> float:
    """Return how often a second the status of each comes when they are alone on the line."""
    with made(drives, connection) as rig:
        begin(rig, runs=runs)
        return sum(polls(rig, 5.0).values()) / 5.0 / drives


def begin(rig: Rig, *, runs: bool) -> None:
    rig.connect()
    if runs:
        rig.enable()
        rig.send(20.0)
        rig.pass_time(2.0)


@pytest.mark.parametrize(
    ('connection', 'runs'), [('rtu', False), ('classic', False), ('rtu', True)]
)
def test_neighbours_keep_their_rate_with_a_quarter_of_the_drives_unplugged(
    connection: str, runs: bool
) -> None:
    kept = rate_alone(6, connection, runs=runs)
    with made(8, connection) as rig:
        begin(rig, runs=runs)
        rig.line.unplug(7, 8)
        rig.pass_time(_SETTLED)
        seen = polls(rig, 10.0)
        assert all(seen[address] / 10.0 >= _KEPT * kept for address in range(1, 7))
        assert not seen[7] and not seen[8]
        # their stops are not confirmed, and tried on: those that come back are stopped
        for address, drive in rig.drives.items():
            assert drive.following == (runs and address < 7)
            assert drive.stop_unconfirmed == (runs and address >= 7)
        # and each of them is found again
        rig.line.unplug()
        rig.pass_time(10.0)
        assert all(drive.snapshot.connected for drive in rig.drives.values())
        assert not any(drive.stop_unconfirmed for drive in rig.drives.values())


def test_a_limited_rate_is_kept_too() -> None:
    with made(16, line={}, poll_rate=1.0, telemetry_rate=0.0) as rig:
        rig.connect()
        before = polls(rig, 10.0)
        rig.line.unplug(13, 14, 15, 16)
        rig.pass_time(_SETTLED)
        seen = polls(rig, 10.0)
        assert all(seen[address] >= _KEPT * before[address] for address in range(1, 13))


def test_a_stop_of_a_drive_that_is_lost_goes_out_at_once() -> None:
    with made(8) as rig:
        rig.connect()
        rig.line.unplug(8)
        rig.pass_time(2.5)
        sent, requested_at = len(rig.line.frames), rig.clock.now
        stop = rig.drives[8].stop()
        rig.pass_time(1.0)
        mine = [frame for frame in rig.line.frames[sent:] if frame['hex'].startswith('08')]
        # behind the transaction on the line, which may be one without a response
        assert mine[0]['hex'].startswith('0806') and mine[0]['last'] - requested_at < 0.3
        assert 'NOT confirmed' in rig.answer(stop)


@pytest.mark.parametrize('connection', SEVERAL)
def test_stops_of_drives_that_are_cut_off_keep_no_neighbour_from_the_line(connection: str) -> None:
    with Rig(connection, drives=4) as rig:
        rig.turn()
        asked_at = [rig.clock.now]

        def meet(key: str, data: bytes | None) -> None:
            if rig.asked[-1][0] == 4:
                asked_at.append(rig.clock.now)

        rig.meet = meet
        for address in (1, 2, 3):
            rig.fars[address].silence(3600.0)
            rig.drives[address].stop()
        rig.pass_time(5.0)
        asked_at.append(rig.clock.now)
        # the first stop of each goes at once; and a drive that stops by itself unless it is asked
        # every 2 s, has to be asked in half of that
        pauses = [after - before for before, after in itertools.pairwise(asked_at)]
        assert max(pauses) < 1.0
        assert rig.drives[4].following


# one of these has the status with every set-point
@pytest.mark.parametrize('connection', ['rtu', 'ascii', 'classic', 'tcp', 'movitrac', 'canopen'])
def test_a_fault_is_noticed_while_another_drive_is_stopped_in_vain(connection: str) -> None:
    with Rig(connection, drives=5) as rig:
        rig.turn()
        frequencies = itertools.cycle(20.0 + number for number in range(7))

        def give() -> None:
            # all that set-points leave between two stops
            for address in (2, 3, 4, 5):
                rig.drives[address].set_setpoint(rig.connection.hertz * next(frequencies))

        rig.keep(give)
        rig.pass_time(0.5)
        rig.far.silence(3600.0)
        rig.drive.stop()
        rig.pass_time(0.3)
        rig.fars[5].trip(rig.a_fault)
        rig.wait_until(lambda: not rig.drives[5].following, 1.9)


@pytest.mark.parametrize('connection', SEVERAL)
def test_a_drive_that_hardly_answers_keeps_no_neighbour_from_the_line(connection: str) -> None:
    with Rig(connection, drives=3) as rig:
        rig.turn()
        asked_at = [rig.clock.now]
        count = itertools.count(1)

        def meet(key: str, data: bytes | None) -> str | None:
            if rig.asked[-1][0] == 1:
                asked_at.append(rig.clock.now)
            return 'drop' if rig.asked[-1][0] == 3 and next(count) % 3 else None

        rig.meet = meet
        for _ in range(3):
            rig.drives[3].identify()
        rig.pass_time(6.0)
        asked_at.append(rig.clock.now)
        pauses = [after - before for before, after in itertools.pairwise(asked_at)]
        assert max(pauses) < 1.0
        assert rig.drives[1].following


def test_a_stop_that_is_acknowledged_and_never_confirmed_leaves_the_line_to_the_others() -> None:
    with made(4) as rig:
        begin(rig, runs=True)
        before = polls(rig, 10.0)
        # its writes are answered, and nothing that it is asked
        rig.line.plan = lambda frame: 'damage' if frame[0] == 1 and frame[1] != _WRITE else None
        rig.drives[1].stop()
        rig.pass_time(_SETTLED)
        after = polls(rig, 10.0)
        assert all(after[address] > before[address] / 2 for address in range(2, 5)), after
        assert rig.drives[1].stop_unconfirmed


@pytest.mark.parametrize('cut', [9.0, 10.3, 11.7])
@pytest.mark.parametrize('connection', SEVERAL)
def test_when_a_cut_line_is_back_no_drive_that_is_off_delays_the_stops_of_the_others(
    connection: str, cut: float
) -> None:
    with Rig(connection, drives=4) as rig:
        rig.turn()
        rig.fars[1].silence(3600.0)
        rig.pass_time(6.0)
        for address in (2, 3, 4):
            rig.fars[address].silence(cut)
        rig.pass_time(cut)
        back_at = rig.clock.now
        stopped: dict[int, float] = {}

        def meet(key: str, data: bytes | None) -> None:
            if data is not None:
                stopped.setdefault(rig.asked[-1][0], rig.clock.now - back_at)

        rig.meet = meet
        rig.pass_time(5.0)
        # each is tried every second, and the one that is off may come before it
        assert all(stopped[address] < 2.5 for address in (2, 3, 4)), stopped


def test_a_drive_alone_on_its_line_is_asked_every_four_seconds_when_it_is_gone() -> None:
    with made(1) as rig:
        rig.connect()
        rig.line.unplug(1)
        rig.pass_time(8.0)
        asked = len(rig.asked)
        rig.pass_time(20.0)
        # and the time without a response
        assert len(rig.asked) - asked >= 4


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'movitrac'])
def test_many_drives_start_in_the_time_of_their_reads(connection: str) -> None:
    with made(1, connection, line={}) as rig:
        alone = start(rig)
    with made(8, connection, line={}) as rig:
        assert start(rig) <= _START * 8 * alone


def test_drives_that_stand_are_polled_seldom_while_another_is_read_for_the_first_time() -> None:
    with made(5, line={}) as rig:
        start(rig, 1, 2, 3, 4)
        rig.pass_time(_SETTLED)
        before = measured(rig)
        reading = rig.drives[5].connect(parameters=True)
        seen = polls(rig, 0.8)
        assert not reading.done()
        # what had begun already comes to its end
        assert all(seen[address] <= 2 for address in range(1, 5))
        assert all(measured(rig)[address] - before[address] <= 1 for address in range(1, 5))
        rig.answer(reading)
        # and then as often as before
        rig.pass_time(2.0)
        before = measured(rig)
        seen = polls(rig, 5.0)
        assert all(seen[address] > 50 for address in range(1, 5))
        assert all(measured(rig)[address] - before[address] > 1 for address in range(1, 5))


def test_a_drive_that_runs_is_polled_and_measured_as_always_while_another_is_read() -> None:
    with made(3, measured=['status.frq_act']) as rig:
        start(rig, 1, 2)
        rig.enable(1)
        rig.send(20.0, 1)
        rig.pass_time(_SETTLED)
        before = measured(rig)
        reading = rig.drives[3].connect(parameters=True)
        seen = polls(rig, 1.5)
        assert not reading.done()
        assert seen[1] > 10
        assert measured(rig)[1] - before[1] >= 1
        assert seen[2] <= 2
        # a stop is confirmed as always
        requested_at = rig.clock.now
        stop = rig.drives[1].stop()
        rig.pass_time(0.5)
        assert not reading.done()
        assert 'stop' in rig.answer(stop, 2.0)
        assert rig.clock.now - requested_at < 1.5


def test_a_drive_is_enabled_as_always_while_another_is_read_for_the_first_time() -> None:
    with made(2, line={'baud': 1200}) as rig:
        start(rig, 1)
        reading = rig.drives[2].connect(parameters=True)
        rig.pass_time(3.0)
        rig.enable(1)
        rig.send(20.0, 1)
        seen = polls(rig, 5.0)
        assert not reading.done()
        # a poll takes three transactions, and a set-point goes between
        assert seen[1] >= 5
        assert rig.drives[1].snapshot.frequency > 0


def test_settings_that_are_read_again_slow_no_other_drive() -> None:
    with made(2) as rig:
        start(rig)
        rig.answer(rig.drives[2].disconnect(1.0))
        rig.pass_time(_SETTLED)
        reading = rig.drives[2].connect(parameters=True)
        assert polls(rig, 1.0)[1] > 4
        assert not reading.done()


@pytest.mark.parametrize('retry', [True, False])
def test_a_drive_that_is_silent_when_it_is_read_slows_no_other(retry: bool) -> None:
    with made(2, line={}) as rig:
        start(rig, 1)
        if not retry:
            rig.line.unplug(2)
        reading = rig.drives[2].connect(retry=retry, parameters=True)
        rig.pass_time(0.5)
        rig.line.unplug(2)
        rig.answer(reading)
        rig.pass_time(_SETTLED)
        assert polls(rig, 5.0)[1] > 100


# --- what a transaction costs the computer, in function calls ------------------------------------


class Calls:
    """Counts what the driver calls, built-in functions too, but not what the line does."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        where = frame.f_code.co_filename
        if event in ('call', 'c_call') and 'nfo_sinus_driver' in where and 'simulator' not in where:
            self.count += 1


def calls_per_transaction(drives: int) -> float:
    """Return what a transaction costs while drives are polled as fast as the line allows."""
    with Rig(drives=drives, poll_rate=50.0) as rig:
        rig.connect()
        rig.pass_time(0.2 * drives)
        begun, counter = len(rig.asked), Calls()
        sys.setprofile(counter)
        try:
            while len(rig.asked) < begun + 600:
                # and nothing of what the rig looks after
                rig.line.go_to(min(rig.bus.step(), rig.clock.now + SLICE))
        finally:
            sys.setprofile(None)
        return counter.count / (len(rig.asked) - begun)


def test_a_transaction_costs_no_more_with_many_drives() -> None:
    alone = calls_per_transaction(1)
    among_many = calls_per_transaction(16)
    assert among_many <= 1.1 * alone
