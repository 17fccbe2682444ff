# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is done by the clock: when it becomes due, and that nothing keeps it from coming again."""

from __future__ import annotations

from collections.abc import Iterator
import math
import threading
import time

import pytest

from nfo_sinus_driver.node.ros import publish_queue
from nfo_sinus_driver.node.ros.publish_queue import PublishQueue, Schedule

#: Far longer than anything here takes, s.
PATIENCE = 20.0


def due(schedule: Schedule, now: float) -> int:
    """Run all that is due; return how much it was."""
    count = 0
    while (function := schedule.take_due(now)) is not None:
        function()
        count += 1
    return count


def test_nothing_is_ever_due_where_nothing_was_added() -> None:
    schedule = Schedule()
    assert schedule.next_moment == math.inf
    assert schedule.take_due(1e9) is None


def test_each_comes_once_in_its_own_period() -> None:
    schedule = Schedule()
    calls: list[str] = []
    schedule.add(100.0, 1.0, lambda: calls.append('each second'))
    schedule.add(100.0, 0.25, lambda: calls.append('often'))
    now = 100.0
    while now < 110.0:
        assert schedule.next_moment > now
        now = schedule.next_moment
        assert due(schedule, now) >= 1
    # the next moment was the first beyond
    assert calls.count('each second') in (10, 11)
    assert calls.count('often') in (40, 41)


def test_nothing_comes_at_once_but_all_within_the_first_period() -> None:
    schedule = Schedule()
    for _ in range(33):
        schedule.add(5.0, 1.0, lambda: None)
    assert due(schedule, 5.0) == 0
    assert due(schedule, 6.0) == 33


def test_those_of_many_drives_do_not_come_together() -> None:
    schedule = Schedule()
    for _ in range(33):
        schedule.add(0.0, 1.0, lambda: None)
    most = 0
    for step in range(1, 101):
        most = max(most, due(schedule, step / 100))
    assert most <= 2


def test_what_is_late_comes_once_and_in_its_old_rhythm() -> None:
    schedule = Schedule()
    schedule.add(0.0, 1.0, lambda: None)
    assert schedule.next_moment == pytest.approx(1.0)
    # the machine slept
    assert due(schedule, 61.5) == 1
    assert schedule.next_moment == pytest.approx(62.0)


@pytest.fixture
def queue() -> Iterator[PublishQueue]:
    queue = PublishQueue()
    queue.start()
    yield queue
    queue.close()


def test_the_queue_does_both_what_is_put_in_and_what_is_due(queue: PublishQueue) -> None:
    came = threading.Semaphore(0)
    queue.put_every(0.02, came.release)
    for _ in range(5):
        assert came.acquire(timeout=PATIENCE)
    put = threading.Event()
    queue.put(put.set)
    assert put.wait(PATIENCE)


@pytest.mark.provokes
def test_what_raises_keeps_nothing_back(
    queue: PublishQueue, caplog: pytest.LogCaptureFixture
) -> None:
    came = threading.Semaphore(0)

    def raises() -> None:
        came.release()
        raise ValueError('oops')

    queue.put_every(0.02, raises)
    for _ in range(3):
        assert came.acquire(timeout=PATIENCE)
    assert queue.alive
    assert 'oops' in caplog.text


def test_it_sleeps_while_there_is_nothing_to_do(queue: PublishQueue) -> None:
    ready = threading.Event()
    queue.put(ready.set)
    assert ready.wait(PATIENCE)
    clock = time.pthread_getcpuclockid(queue._thread.ident)  # type: ignore[arg-type]
    before = time.clock_gettime(clock)
    time.sleep(1.0)
    assert time.clock_gettime(clock) - before < 0.1


def test_it_ends_with_what_is_waiting_and_without_what_is_not_due() -> None:
    queue = PublishQueue()
    done: list[str] = []
    queue.put_every(3600.0, lambda: done.append('in an hour'))
    queue.put(lambda: done.append('waiting'))
    queue.start()
    queue.close()
    assert not queue.alive
    assert done == ['waiting']


def test_what_is_urgent_goes_first_and_is_never_dropped() -> None:
    done: list[str] = []
    held = threading.Event()
    queue = PublishQueue()
    queue.put(lambda: held.wait(PATIENCE) and None)
    queue.start()
    queue.put_first(lambda: done.append('stop'))
    for _ in range(2000):
        queue.put(lambda: done.append('status'))
    held.set()
    queue.close(PATIENCE)
    assert done[0] == 'stop' and done.count('stop') == 1


def test_a_stream_that_comes_faster_than_it_is_published_is_published_from_its_newest() -> None:
    done: list[int] = []
    queue = PublishQueue()
    stream = queue.stream(done.append)
    for number in range(500):
        stream(number)
    # what comes once is not dropped for it
    queue.put(lambda: done.append(-1))
    queue.start()
    queue.close(PATIENCE)
    assert done == [*range(500 - 10, 500), -1]


def test_a_flood_of_others_silences_no_stream() -> None:
    done: list[int] = []
    queue = PublishQueue()
    stream = queue.stream(done.append)
    stream(0)
    for _ in range(2000):
        queue.put(lambda: None)
    queue.start()
    stream(1)
    queue.close(PATIENCE)
    assert done == [0, 1]


def test_what_may_wait_does_so_for_a_moment_only_and_in_its_order(queue: PublishQueue) -> None:
    done: list[int] = []
    published = threading.Semaphore(0)

    def publish(number: int) -> None:
        done.append(number)
        published.release()

    stream = queue.stream(publish, lambda number: number == 2)
    stream(0)
    # nothing else wakes the thread
    assert published.acquire(timeout=PATIENCE)
    for number in (1, 2):
        stream(number)
    for _ in range(2):
        assert published.acquire(timeout=PATIENCE)
    assert done == [0, 1, 2]


def test_what_is_urgent_does_not_wait(
    queue: PublishQueue, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(publish_queue, '_LONGEST_WAIT', 3600.0)
    ready, both = threading.Event(), threading.Event()
    done: list[int] = []
    # from now on the thread wakes only when it is woken
    queue.put(ready.set)
    assert ready.wait(PATIENCE)

    def publish(number: int) -> None:
        done.append(number)
        if number:
            both.set()

    stream = queue.stream(publish, bool)
    time.sleep(0.2)
    stream(0)
    time.sleep(0.3)
    assert done == []
    stream(1)
    assert both.wait(PATIENCE)
    assert done == [0, 1]


def test_a_stream_that_may_wait_loses_nothing_for_it(queue: PublishQueue) -> None:
    done: list[int] = []
    stream = queue.stream(done.append, lambda number: False)
    for number in range(30):
        stream(number)
        # as many as may wait, however late the queue comes
        until = time.monotonic() + PATIENCE
        while number - len(done) >= 8 and time.monotonic() < until:
            time.sleep(0.001)
    queue.close(PATIENCE)
    assert done == [*range(30)]


def test_a_stream_that_may_wait_does_so_while_there_is_room_for_more(
    queue: PublishQueue, monkeypatch: pytest.MonkeyPatch
) -> None:
    # were it full, the next value would be the end of the oldest
    monkeypatch.setattr(publish_queue, '_LONGEST_WAIT', 3600.0)
    queue.put_every(3600.0, lambda: None)
    done: list[int] = []
    stream = queue.stream(done.append, lambda number: False)
    room = publish_queue._MOST_OF_A_STREAM - 1
    for count in range(room, 20 * room, room):
        for number in range(room):
            stream(number)
        until = time.monotonic() + PATIENCE
        while len(done) < count:
            assert time.monotonic() < until, 'it waits until it is full'
            time.sleep(0.001)


def test_a_stream_that_never_ends_keeps_nothing_else_waiting(queue: PublishQueue) -> None:
    put, due = threading.Event(), threading.Semaphore(0)
    ended = False

    def publish(number: int) -> None:
        # the next ones are there before this one has been published
        if not ended:
            stream(number + 1)
            stream(number + 2)

    stream = queue.stream(publish)
    stream(0)
    queue.put(put.set)
    queue.put_every(0.02, due.release)
    try:
        assert put.wait(PATIENCE)
        for _ in range(3):
            assert due.acquire(timeout=PATIENCE)
    finally:
        ended = True


@pytest.mark.provokes
def test_a_value_that_cannot_be_published_loses_no_other(caplog: pytest.LogCaptureFixture) -> None:
    done: list[float] = []
    queue = PublishQueue()
    stream = queue.stream(lambda number: done.append(1 / number))
    for number in (1, 0, 2):
        stream(number)
    queue.start()
    queue.close(PATIENCE)
    assert done == [1, 0.5] and len(caplog.records) == 1
