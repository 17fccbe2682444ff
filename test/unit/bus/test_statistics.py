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


"""Counters and times of a line."""

from __future__ import annotations

import math
import threading
from types import SimpleNamespace

import pytest

from nfo_sinus_driver import statistics as module
from nfo_sinus_driver.statistics import Recorder


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    clock = SimpleNamespace(now=500.0)
    monkeypatch.setattr(module, 'time', SimpleNamespace(monotonic=lambda: clock.now))
    return clock


def test_nothing_measured_yet(clock: SimpleNamespace) -> None:
    figures = Recorder().statistics()
    assert (figures.transactions, figures.utilisation, figures.reconnects) == (0, 0.0, 0)
    times = (
        figures.cycle_time,
        figures.round_trip_min,
        figures.round_trip_mean,
        figures.round_trip_p99,
        figures.round_trip_max,
    )
    assert all(math.isnan(value) for value in times)


@pytest.mark.parametrize(
    ('count', 'p99'), [(1, 1.0), (2, 2.0), (99, 99.0), (100, 99.0), (200, 198.0), (1000, 990.0)]
)
def test_round_trips(clock: SimpleNamespace, count: int, p99: float) -> None:
    recorder = Recorder()
    for number in reversed(range(count)):
        recorder.answered(number + 1.0)
    figures = recorder.statistics()
    assert figures.round_trip_min == 1.0
    assert figures.round_trip_max == count
    assert figures.round_trip_mean == pytest.approx((count + 1) / 2)
    assert figures.round_trip_p99 == p99


def test_old_round_trips_are_forgotten(clock: SimpleNamespace) -> None:
    recorder = Recorder()
    recorder.answered(99.0)
    for _ in range(1000):
        recorder.answered(1.0)
    assert recorder.statistics().round_trip_max == 1.0


def test_utilisation_is_that_of_the_last_two_seconds(clock: SimpleNamespace) -> None:
    recorder = Recorder()
    recorder.busy(clock.now, 0.5)
    clock.now += 1.0
    recorder.busy(clock.now, 0.3)
    assert recorder.statistics().utilisation == pytest.approx(0.4)
    # the first one is over; nothing new has come in meanwhile
    clock.now += 1.5
    assert recorder.statistics().utilisation == pytest.approx(0.15)
    clock.now += 10.0
    assert recorder.statistics().utilisation == 0.0
    assert recorder.statistics().transactions == 2


def test_utilisation_is_never_more_than_all(clock: SimpleNamespace) -> None:
    recorder = Recorder()
    for _ in range(3):
        recorder.busy(clock.now, 1.0)
    assert recorder.statistics().utilisation == 1.0


def test_every_opening_but_the_first_is_a_reconnect(clock: SimpleNamespace) -> None:
    recorder = Recorder()
    seen = []
    for _ in range(4):
        recorder.opened()
        seen.append(recorder.statistics().reconnects)
    assert seen == [0, 1, 2, 3]


def test_cycle_time_is_that_of_the_slowest(clock: SimpleNamespace) -> None:
    recorder = Recorder()
    recorder.cycle(1, 0.1)
    recorder.cycle(2, 0.3)
    assert recorder.statistics().cycle_time == 0.3
    recorder.cycle(2, 0.05)
    assert recorder.statistics().cycle_time == 0.1
    recorder.forget_cycle(1)
    recorder.forget_cycle(7)
    assert recorder.statistics().cycle_time == 0.05
    recorder.forget_cycle(2)
    assert math.isnan(recorder.statistics().cycle_time)


def test_read_while_it_is_written() -> None:
    # a slow reader must never fail because the worker goes on
    recorder = Recorder()
    ended = threading.Event()

    def work() -> None:
        number = 0
        while not ended.is_set():
            number += 1
            recorder.busy(number * 0.01, 0.001)
            recorder.answered(0.001)
            recorder.cycle(number % 50, 0.1)
            recorder.forget_cycle((number + 25) % 50)

    worker = threading.Thread(target=work)
    worker.start()
    for _ in range(300):
        recorder.statistics()
    ended.set()
    worker.join()
    assert recorder.statistics().transactions > 0
