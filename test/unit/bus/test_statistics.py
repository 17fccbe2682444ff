# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Counters and times of a line."""

from __future__ import annotations

import math
import threading
from types import SimpleNamespace

import pytest

from nfo_sinus_driver.bus.statistics import Recorder
from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, Refused


@pytest.fixture
def clock() -> SimpleNamespace:
    return SimpleNamespace(now=500.0)


def test_nothing_measured_yet(clock: SimpleNamespace) -> None:
    figures = Recorder(lambda: clock.now).statistics()
    assert (figures.transactions, figures.utilisation, figures.reconnects) == (0, 0.0, 0)
    times = (
        figures.cycle_time,
        figures.round_trip_min,
        figures.round_trip_mean,
        figures.round_trip_median,
        figures.round_trip_p99,
        figures.round_trip_max,
    )
    assert all(math.isnan(value) for value in times)


@pytest.mark.parametrize(
    ('count', 'p99'), [(1, 1.0), (2, 2.0), (99, 99.0), (100, 99.0), (200, 198.0), (1000, 990.0)]
)
def test_round_trips(clock: SimpleNamespace, count: int, p99: float) -> None:
    recorder = Recorder(lambda: clock.now)
    for number in reversed(range(count)):
        recorder.transaction(1, clock.now, number + 1.0, None)
    figures = recorder.statistics()
    assert figures.round_trip_min == 1.0
    assert figures.round_trip_max == count
    assert figures.round_trip_mean == pytest.approx((count + 1) / 2)
    assert figures.round_trip_median == math.ceil(count / 2)
    assert figures.round_trip_p99 == p99


def test_old_round_trips_are_forgotten(clock: SimpleNamespace) -> None:
    recorder = Recorder(lambda: clock.now)
    recorder.transaction(1, clock.now, 99.0, None)
    for _ in range(1000):
        recorder.transaction(1, clock.now, 1.0, None)
    assert recorder.statistics().round_trip_max == 1.0


def test_utilisation_is_that_of_the_last_two_seconds(clock: SimpleNamespace) -> None:
    recorder = Recorder(lambda: clock.now)
    recorder.transaction(1, clock.now, 0.5, NoAnswer())
    clock.now += 1.0
    recorder.transaction(2, clock.now, 0.3, None)
    assert recorder.statistics().utilisation == pytest.approx(0.4)
    # the first one is over; nothing new has come in meanwhile
    clock.now += 1.5
    assert recorder.statistics().utilisation == pytest.approx(0.15)
    clock.now += 10.0
    assert recorder.statistics().utilisation == 0.0
    assert recorder.statistics().transactions == 2


def test_utilisation_is_never_more_than_all(clock: SimpleNamespace) -> None:
    recorder = Recorder(lambda: clock.now)
    for _ in range(3):
        recorder.transaction(1, clock.now, 1.0, None)
    assert recorder.statistics().utilisation == 1.0


def test_every_opening_but_the_first_is_a_reconnect(clock: SimpleNamespace) -> None:
    recorder = Recorder(lambda: clock.now)
    seen = []
    for _ in range(4):
        recorder.opened()
        seen.append(recorder.statistics().reconnects)
    assert seen == [0, 1, 2, 3]


def test_cycle_time_is_that_of_the_slowest(clock: SimpleNamespace) -> None:
    recorder = Recorder(lambda: clock.now)
    recorder.cycle(1, 0.1)
    recorder.cycle(2, 0.3)
    assert recorder.statistics().cycle_time == 0.3
    recorder.cycle(2, 0.05)
    assert recorder.statistics().cycle_time == 0.1
    recorder.cycle(1, math.nan)
    recorder.cycle(7, math.nan)
    assert recorder.statistics().cycle_time == 0.05
    recorder.cycle(2, math.nan)
    assert math.isnan(recorder.statistics().cycle_time)


def test_read_while_it_is_written(clock: SimpleNamespace) -> None:
    # a slow reader must never fail because the worker goes on
    recorder = Recorder(lambda: clock.now)
    ended = threading.Event()

    def work() -> None:
        number = 0
        while not ended.is_set():
            number += 1
            recorder.transaction(number % 50, number * 0.01, 0.001, None)
            recorder.cycle(number % 50, 0.1)
            recorder.cycle((number + 25) % 50, math.nan)

    worker = threading.Thread(target=work)
    worker.start()
    for _ in range(300):
        recorder.statistics()
        recorder.statistics(7)
    ended.set()
    worker.join()
    assert recorder.statistics().transactions > 0


def test_each_unit_has_its_own_figures(clock: SimpleNamespace) -> None:
    recorder = Recorder(lambda: clock.now)
    for unit, seconds, error in (
        (1, 0.01, None),
        (1, 0.03, None),
        (2, 0.2, NoAnswer()),
        (2, 0.05, DamagedAnswer()),
        (2, 0.02, Refused(1)),
        (2, 0.04, None),
    ):
        recorder.transaction(unit, clock.now, seconds, error)
    recorder.retry(2)
    recorder.cycle(1, 0.1)
    recorder.cycle(2, 0.3)
    line, first, second = (recorder.statistics(unit) for unit in (None, 1, 2))
    assert (line.transactions, first.transactions, second.transactions) == (6, 2, 4)
    assert (second.timeouts, second.damaged, second.refused, second.retries) == (1, 1, 1, 1)
    assert (first.timeouts, first.damaged, first.refused, first.retries) == (0, 0, 0, 0)
    assert (line.timeouts, line.damaged, line.refused, line.retries) == (1, 1, 1, 1)
    assert first.utilisation == pytest.approx(0.02)
    assert second.utilisation == pytest.approx(0.155)
    assert line.utilisation == pytest.approx(0.175)
    assert (line.cycle_time, first.cycle_time, second.cycle_time) == (0.3, 0.1, 0.3)
    # a refusal is an answer, too
    assert (second.round_trip_min, second.round_trip_max) == (0.02, 0.04)
    assert (line.round_trip_min, line.round_trip_max) == (0.01, 0.04)


def test_a_unit_that_was_connected_to_again_has_reconnects(clock: SimpleNamespace) -> None:
    recorder = Recorder(lambda: clock.now)
    for unit in (1, 2, 2, 2):
        recorder.connected(unit)
    found = [recorder.statistics(unit).reconnects for unit in (1, 2, 3, None)]
    assert found == [0, 2, 0, 0]


def test_reading_figures_leaves_no_trace(clock: SimpleNamespace) -> None:
    recorder = Recorder(lambda: clock.now)
    assert recorder.statistics(9).transactions == 0
    assert math.isnan(recorder.statistics(9).round_trip_median)
    recorder.cycle(9, math.nan)
    assert math.isnan(recorder.statistics().cycle_time)


def test_what_is_kept_of_a_unit_is_bounded(clock: SimpleNamespace) -> None:
    recorder = Recorder(lambda: clock.now)
    recorder.transaction(1, clock.now, 99.0, None)
    for _ in range(1000):
        recorder.transaction(1, clock.now, 1.0, LinkError())
    # without an answer there is no round trip
    assert recorder.statistics(1).round_trip_max == 99.0
    for _ in range(500):
        recorder.transaction(1, clock.now, 1.0, None)
    assert recorder.statistics(1).round_trip_max == 1.0
    assert recorder.statistics().round_trip_max == 99.0
