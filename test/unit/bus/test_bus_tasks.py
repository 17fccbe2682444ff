# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Tasks: time that passes, waking, joining and cancelling."""

from __future__ import annotations

import threading
import time

from bus_bench import UNIT, ask, hold, result, spawned
from fake_link import Done, FakeLink, wait_until
import pytest
from support.addresses import packed, register

from nfo_sinus_driver.bus import Bus, Cancelled, Priority, Task
from nfo_sinus_driver.bus.tasks import Request
from nfo_sinus_driver.link import InProgress, NotReady, Read, Reply


def test_sleep_takes_its_time_and_keeps_no_other_waiting(bus: Bus, link: FakeLink) -> None:
    woken: list[float] = []

    async def sleeper() -> None:
        await bus.sleep(0.05)
        woken.append(time.monotonic())

    start = time.monotonic()
    future = bus.run(sleeper())
    assert result(ask(bus, 1, Priority.POLL)) == packed(1)
    result(future)
    assert woken[0] - start >= 0.05


def test_sleepers_wake_in_order(bus: Bus) -> None:
    woken: list[int] = []

    async def sleeper(number: int, seconds: float) -> None:
        await bus.sleep(seconds)
        woken.append(number)

    async def together() -> None:
        # all at one moment of the worker, so that nothing comes between
        for number, seconds in ((3, 0.03), (1, 0.01), (0, -1.0), (2, 0.02)):
            bus.spawn(sleeper(number, seconds))

    result(bus.run(together()))
    wait_until(lambda: len(woken) == 4)
    assert woken == [0, 1, 2, 3]


def test_sleeper_can_be_woken(bus: Bus) -> None:
    async def sleeper() -> str:
        await bus.sleep(3600)
        await bus.sleep(0.0)
        return 'awake'

    task = spawned(bus, sleeper())
    assert not task.future.done()
    bus.call(lambda: bus.wake(task))
    assert result(task.future) == 'awake'
    # harmless afterwards
    bus.call(lambda: bus.wake(task))
    assert result(ask(bus, 1, Priority.POLL)) == packed(1)


def test_waking_does_not_shorten_the_next_sleep(bus: Bus) -> None:
    # the timer of the first pause must not end the second
    stages: list[str] = []

    async def sleeper() -> None:
        await bus.sleep(0.02)
        stages.append('first')
        await bus.sleep(3600)
        stages.append('second')

    async def past_the_first_timer() -> None:
        await bus.sleep(0.05)

    task = spawned(bus, sleeper())
    bus.call(lambda: bus.wake(task))
    wait_until(lambda: stages)
    result(bus.run(past_the_first_timer()))
    assert stages == ['first']
    bus.call(lambda: bus.wake(task))
    result(task.future)
    assert stages == ['first', 'second']


def test_waking_a_task_that_waits_for_an_answer_does_nothing(bus: Bus, link: FakeLink) -> None:
    async def job() -> bytes:
        return (await bus.ask(UNIT, Read(register(9)), Priority.REFRESH)).data

    with link.held():
        hold(bus, link, Priority.POLL)
        tasks: list[Task] = []
        bus.call(lambda: tasks.append(bus.spawn(job())))
    wait_until(lambda: tasks)
    bus.call(lambda: bus.wake(tasks[0]))
    assert result(tasks[0].future) == packed(9)


def test_join(bus: Bus) -> None:
    async def job() -> str:
        await bus.sleep(3600)
        return 'result'

    task = spawned(bus, job())

    async def waiter(seconds: float) -> bool:
        return await bus.join(task, seconds)

    assert result(bus.run(waiter(0.01))) is False
    joined = bus.run(waiter(3600))
    second = bus.run(waiter(3600))
    bus.call(lambda: bus.wake(task))
    assert result(joined) is True
    assert result(second) is True
    # one that has ended is not waited for
    assert result(bus.run(waiter(3600))) is True


def test_cancelled_task_sends_nothing_more(bus: Bus, link: FakeLink) -> None:
    seen: list[str] = []

    async def job() -> None:
        try:
            await bus.ask(UNIT, Read(register(66)), Priority.REFRESH)
        except Cancelled:
            seen.append('cancelled')
            raise

    with link.held():
        hold(bus, link, Priority.POLL)
        tasks: list[Task] = []
        bus.call(lambda: tasks.append(bus.spawn(job())))
        bus.call(lambda: bus.cancel(tasks[0]))
        bus.call(lambda: bus.cancel(tasks[0]))
    wait_until(lambda: tasks and tasks[0].future.done())
    assert isinstance(tasks[0].future.exception(), Cancelled)
    result(ask(bus, 1, Priority.REFRESH))
    assert seen == ['cancelled']
    assert 66 not in link.numbers


def test_cancelled_sleeper(bus: Bus) -> None:
    async def sleeper() -> str:
        try:
            await bus.sleep(3600)
        except Cancelled:
            return 'cleaned up'
        return 'slept'

    task = spawned(bus, sleeper())
    bus.call(lambda: bus.cancel(task))
    assert result(task.future) == 'cleaned up'


def test_cancelling_one_leaves_the_others(bus: Bus, link: FakeLink) -> None:
    async def job(number: int) -> bytes:
        return (await bus.ask(UNIT, Read(register(number)), Priority.REFRESH)).data

    tasks: list[Task] = []
    with link.held():
        hold(bus, link, Priority.POLL)
        bus.call(lambda: tasks.extend(bus.spawn(job(number)) for number in range(1, 6)))
        bus.call(lambda: bus.cancel(tasks[2]))
    wait_until(lambda: len(tasks) == 5 and all(task.future.done() for task in tasks))
    assert link.numbers == [0, 1, 2, 4, 5]


def test_cancelled_while_its_answer_is_on_the_way(bus: Bus, link: FakeLink) -> None:
    # the transaction on the line ends first; what comes after it is not sent
    async def job() -> None:
        await bus.ask(UNIT, Read(register(1)), Priority.POLL)
        await bus.ask(UNIT, Read(register(2)), Priority.POLL)

    tasks: list[Task] = []
    with link.held():
        bus.call(lambda: tasks.append(bus.spawn(job())))
        link.wait_until_held()
        bus.call(lambda: bus.cancel(tasks[0]))
    wait_until(lambda: tasks and tasks[0].future.done())
    result(ask(bus, 3, Priority.REFRESH))
    assert link.numbers == [1, 3]


def test_task_that_cancels_itself(bus: Bus) -> None:
    async def job() -> str:
        bus.cancel(bus.current)
        try:
            await bus.sleep(0.0)
        except Cancelled:
            return 'ended at the next step'
        return 'went on'

    assert result(bus.run(job())) == 'ended at the next step'


def test_cancelling_what_has_ended_does_nothing(bus: Bus) -> None:
    async def job() -> int:
        return 5

    task = spawned(bus, job())
    bus.call(lambda: bus.cancel(task))
    assert result(task.future) == 5


def test_cancelled_task_may_still_talk_while_it_cleans_up(bus: Bus, link: FakeLink) -> None:
    ready = threading.Event()

    async def job() -> bytes:
        try:
            await bus.sleep(3600)
        except Cancelled:
            return (await bus.ask(UNIT, Read(register(8)), Priority.STOP)).data
        return b''

    def answer(done: Done) -> bytes:
        if not ready.is_set():
            ready.set()
            raise NotReady(time.monotonic() + 0.01)
        return packed(done.number)

    link.answer = answer
    task = spawned(bus, job())
    bus.call(lambda: bus.cancel(task))
    assert result(task.future) == packed(8)


def test_current_task(bus: Bus) -> None:
    async def job() -> Task | None:
        return bus.current

    assert isinstance(result(bus.run(job())), Task)
    seen: list[Task | None] = []
    bus.call(lambda: seen.append(bus.current))
    wait_until(lambda: seen)
    assert seen == [None]


@pytest.mark.parametrize('once', [True, False])
def test_what_is_read_again_after_a_pause_is_the_same_read(once: bool) -> None:
    # the link repeats it where another master is, as before, unless it acknowledges
    read, reply = Read(register(1), once), Reply(packed(1), 0.0)
    request = Request(UNIT, read, Priority.POLL)
    if not once:
        with pytest.raises(InProgress):
            request.without_old(reply)
    assert request.without_old(reply) == reply
    assert request.operation == read
