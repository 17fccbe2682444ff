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


"""Who talks next, and that nothing takes the worker down."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from collections.abc import Iterator
from concurrent.futures import Future
import threading
import time
from types import SimpleNamespace
from typing import Any

from fake_link import PATIENCE
from fake_link import Done
from fake_link import FakeLink
from fake_link import wait_until
import pytest
from support.addresses import packed
from support.addresses import register

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Cancelled
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.bus import Slot
from nfo_sinus_driver.bus import Task
from nfo_sinus_driver.bus import Transfer
from nfo_sinus_driver.bus import statistics as statistics_module
from nfo_sinus_driver.bus import worker as bus_module
from nfo_sinus_driver.bus.scheduler import BACKGROUND_SHARE
from nfo_sinus_driver.link import Address
from nfo_sinus_driver.link import DamagedAnswer
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import NoAnswer
from nfo_sinus_driver.link import NotReady
from nfo_sinus_driver.link import PortError
from nfo_sinus_driver.link import Refused

UNIT = 1
OTHER = 2


@pytest.fixture
def link() -> FakeLink:
    return FakeLink()


@pytest.fixture
def bus(link: FakeLink, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bus]:
    monkeypatch.setattr(bus_module, 'REOPEN_PERIOD', 0.01)
    bus = Bus(link)
    bus.start()
    yield bus
    bus.close()


def ask(
    bus: Bus, number: int, priority: Priority, data: bytes | None = None, unit: int = UNIT
) -> Future[bytes]:
    """Let a coroutine read or write one register; the future has the bytes read."""

    async def job() -> bytes:
        if data is None:
            return (await bus.read(unit, register(number), priority)).data
        return (await bus.write(unit, register(number), data, priority)).data

    return bus.run(job())


def result(future: Future[Any]) -> Any:
    return future.result(PATIENCE)


def failure(future: Future[Any]) -> BaseException | None:
    return future.exception(PATIENCE)


def hold(bus: Bus, link: FakeLink, priority: Priority = Priority.REFRESH) -> Future[bytes]:
    """Have a transaction kept on the line; to be used while the link is held."""
    future = ask(bus, 0, priority)
    link.wait_until_held()
    return future


class Writer:
    """The owner of a slot: what is wanted, what was sent, and what came of it."""

    def __init__(self, bus: Bus, number: int = 50, unit: int = UNIT) -> None:
        self.bus = bus
        self.wanted: int | None = None
        self.outcomes: list[tuple[bytes | None, LinkError | None]] = []
        self.slot = Slot(self.make, self.done)
        self.address = register(number)
        self.unit = unit

    def want(self, value: int | None) -> None:
        self.wanted = value
        self.bus.request(self.slot)

    def make(self) -> Transfer | None:
        if self.wanted is None:
            return None
        return Transfer(self.unit, self.address, Priority.SETPOINT, packed(self.wanted))

    def done(self, transfer: Transfer, error: LinkError | None) -> None:
        self.outcomes.append((transfer.data, error))


# --- coroutines -----------------------------------------------------------------------------------


def test_read_and_write(bus: Bus, link: FakeLink) -> None:
    assert result(ask(bus, 7, Priority.SERVICE)) == packed(7)
    link.answer = lambda done: b''
    assert result(ask(bus, 8, Priority.SERVICE, packed(1, 2))) == b''
    assert link.done == [Done(UNIT, 7, None), Done(UNIT, 8, packed(1, 2))]


def test_result_and_mistake_of_a_coroutine(bus: Bus) -> None:
    async def good() -> str:
        await bus.read(UNIT, register(1), Priority.SERVICE)
        return 'done'

    async def bad() -> None:
        await bus.read(UNIT, register(1), Priority.SERVICE)
        raise ZeroDivisionError

    assert result(bus.run(good())) == 'done'
    assert isinstance(failure(bus.run(bad())), ZeroDivisionError)


@pytest.mark.parametrize(
    'error',
    [NoAnswer('silence'), DamagedAnswer('noise'), Refused(2)],
    ids=lambda error: type(error).__name__,
)
def test_error_of_the_link_reaches_the_coroutine(
    bus: Bus, link: FakeLink, error: LinkError
) -> None:
    def answer(done: Done) -> bytes:
        raise error

    caught: list[LinkError] = []

    async def job() -> str:
        try:
            await bus.read(UNIT, register(1), Priority.SERVICE)
        except LinkError as raised:
            caught.append(raised)
        return 'goes on'

    link.answer = answer
    assert result(bus.run(job())) == 'goes on'
    assert caught == [error]
    assert failure(ask(bus, 1, Priority.SERVICE)) is error


def test_future_cannot_be_cancelled_from_outside(bus: Bus, link: FakeLink) -> None:
    with link.held():
        future = hold(bus, link)
        assert not future.cancel()
        waiting = ask(bus, 1, Priority.SERVICE)
        assert not waiting.cancel()
    assert result(waiting) == packed(1)
    assert not future.cancelled()


def test_calls_are_made_between_transactions_in_order(bus: Bus, link: FakeLink) -> None:
    seen: list[int] = []
    with link.held():
        hold(bus, link)
        for number in range(5):
            bus.call(lambda number=number: seen.append(number))  # type: ignore[misc]
        assert seen == []
    wait_until(lambda: len(seen) == 5)
    assert seen == list(range(5))


@pytest.mark.parametrize('lost', [False, True])
def test_nothing_goes_between_a_read_and_the_write_behind_it(
    bus: Bus, link: FakeLink, lost: bool
) -> None:
    def answer(done: Done) -> bytes:
        if lost and done.number == 1:
            raise NoAnswer('silence')
        return packed(done.number)

    async def job() -> bytes:
        reply = await bus.read_then_write(UNIT, register(1), register(2), packed(0), Priority.STOP)
        return reply.data

    link.answer = answer
    with link.held():
        hold(bus, link)
        waiting = [
            ask(bus, 3, Priority.STOP),
            bus.run(job()),
            ask(bus, 4, Priority.STOP, packed(1)),
        ]
    assert [result(future) for future in waiting] == [packed(3), packed(2), packed(4)]
    # as any write of a stop it goes ahead of what only looks
    assert link.numbers == [0, 1, 2, 4, 3]


def test_resync_reads_are_passed_to_the_link(bus: Bus, link: FakeLink) -> None:
    bus.use_resync_reads(3, (register(1), register(2, 2)))
    wait_until(lambda: link.resync_reads == {3: (register(1), register(2, 2))})


# --- who is next ----------------------------------------------------------------------------------


def test_most_urgent_goes_first(
    bus: Bus, link: FakeLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    # in no time, so that the background has no claim
    take_time(link, monkeypatch, {})
    writer = Writer(bus)
    with link.held():
        futures = [hold(bus, link)]
        for priority in sorted(Priority, reverse=True):
            futures.append(ask(bus, 100 + priority, priority))
        writer.want(5)
    for future in futures:
        result(future)
    wait_until(lambda: writer.outcomes)
    # a set-point in a slot stands before any other of its rank
    order = [100, 50, 101, 102, 103]
    assert link.numbers[1:6] == order
    assert sorted(link.numbers[6:]) == [104, 105]


def test_equals_take_turns_in_the_order_they_came(bus: Bus, link: FakeLink) -> None:
    with link.held():
        hold(bus, link)
        futures = [ask(bus, number, Priority.SERVICE) for number in range(1, 20)]
    for future in futures:
        result(future)
    assert link.numbers == list(range(20))


def test_stop_waits_for_one_transaction_at_most(bus: Bus, link: FakeLink) -> None:
    # everybody asks without end, in more steps than one
    ended = threading.Event()

    async def chatter(number: int, priority: Priority) -> None:
        while not ended.is_set():
            await bus.read(UNIT, register(number), priority)

    talkers = [
        bus.run(chatter(10 + priority, priority)) for priority in Priority if priority > 0
    ]
    writer = Writer(bus)
    wait_until(lambda: len(link.done) > 50)
    with link.held():
        link.wait_until_held()
        writer.want(7)
        before = len(link.done)
        stops = [ask(bus, 1 + number, Priority.STOP) for number in range(3)]
    for stop in stops:
        result(stop)
    assert link.numbers[before : before + 3] == [1, 2, 3]
    ended.set()
    for talker in talkers:
        result(talker)


def test_stop_goes_between_the_words_of_a_value(bus: Bus, link: FakeLink) -> None:
    # over Classic each word is a transaction: the high one, the low one, the high one again
    async def read() -> bytes:
        return (await bus.read(UNIT, Address('register', 5, 6, 4), Priority.REFRESH)).data

    with link.held():
        value = bus.run(read())
        link.wait_until_held()
        stop = ask(bus, 1, Priority.STOP)
    result(stop)
    assert result(value) == packed(5, 6)
    assert link.numbers == [6, 1, 5, 6]


def test_stop_goes_before_the_background_s_share(
    bus: Bus, link: FakeLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = take_time(link, monkeypatch, {0: 1.0})
    with link.held():
        # so much of the line that the background has a claim
        hold(bus, link, Priority.POLL)
        background = ask(bus, 1, Priority.TELEMETRY)
        stop = ask(bus, 2, Priority.STOP)
        poll = ask(bus, 3, Priority.POLL)
    for future in (background, stop, poll):
        result(future)
    assert link.numbers == [0, 2, 1, 3]
    assert clock.now == pytest.approx(clock.start + 1.0)


class Clock:
    """A clock that only transactions move."""

    def __init__(self, took: dict[int, float]) -> None:
        self.start = self.now = 1000.0
        self.took = took

    def monotonic(self) -> float:
        return self.now


def take_time(
    link: FakeLink, monkeypatch: pytest.MonkeyPatch, took: dict[int, float]
) -> Clock:
    """Let transactions take a time by their register, on a clock of their own."""
    clock = Clock(took)

    def answer(done: Done) -> bytes:
        clock.now += took.get(done.number, 0.0)
        return packed(done.number)

    link.answer = answer
    for module in (bus_module, statistics_module):
        monkeypatch.setattr(module, 'time', SimpleNamespace(monotonic=clock.monotonic))
    return clock


@pytest.mark.parametrize('background', [0.0064, 0.013, 0.023])
@pytest.mark.parametrize('foreground', [0.0064, 0.013, 0.023, 0.2])
def test_background_has_a_sixth_of_the_time_each(
    link: FakeLink, monkeypatch: pytest.MonkeyPatch, foreground: float, background: float
) -> None:
    took = {
        Priority.SETPOINT: foreground,
        Priority.SERVICE: foreground,
        Priority.POLL: foreground,
        Priority.TELEMETRY: background,
        Priority.REFRESH: background,
    }
    clock = take_time(link, monkeypatch, {int(key): value for key, value in took.items()})
    bus = Bus(link)
    rounds = 4000

    async def chatter(priority: Priority) -> None:
        while len(link.done) < rounds:
            await bus.read(UNIT, register(priority), priority)

    talkers = [bus.run(chatter(priority)) for priority in took for _ in range(3)]
    bus.start()
    for talker in talkers:
        result(talker)
    bus.close()
    count = Counter(link.numbers[:rounds])
    for priority in (Priority.TELEMETRY, Priority.REFRESH):
        share = background * count[priority] / (clock.now - clock.start)
        assert share == pytest.approx(BACKGROUND_SHARE, rel=0.05)
    # what is urgent starves what is not: the set-points ask without end
    assert count[Priority.SERVICE] == count[Priority.POLL] == 0


def test_background_alone_has_the_whole_line(bus: Bus, link: FakeLink) -> None:
    for number in range(20):
        assert result(ask(bus, number, Priority.REFRESH)) == packed(number)


def test_set_point_goes_before_all_that_the_background_is_owed(
    link: FakeLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the shortest read there is takes 6.4 ms, at 57600 bit/s
    take_time(link, monkeypatch, {0: 1.0, 1: 0.0064, 50: 0.0064})
    bus = Bus(link)
    bus.start()
    writer = Writer(bus)
    for _ in range(20):
        # much time in which the background asked for nothing
        result(ask(bus, 0, Priority.POLL))
    with link.held():
        hold(bus, link, Priority.POLL)
        background = [ask(bus, 1, Priority.TELEMETRY) for _ in range(10)]
        writer.want(7)
    for future in background:
        result(future)
    wait_until(lambda: writer.outcomes)
    bus.close()
    # the one that was on the line when it came
    assert link.numbers[20:22] == [0, 50]


# --- slots ----------------------------------------------------------------------------------------


def test_slot_sends_the_latest_value_only(bus: Bus, link: FakeLink) -> None:
    writer = Writer(bus)
    with link.held():
        hold(bus, link)
        for value in range(100):
            writer.want(value)
    wait_until(lambda: writer.outcomes)
    result(ask(bus, 1, Priority.REFRESH))
    assert writer.outcomes == [(packed(99), None)]
    assert [done for done in link.done if done.number == 50] == [Done(UNIT, 50, packed(99))]


def test_slot_that_has_nothing_to_say_any_more(bus: Bus, link: FakeLink) -> None:
    writer = Writer(bus)
    other = Writer(bus, 51)
    with link.held():
        hold(bus, link)
        writer.want(1)
        writer.wanted = None
        other.want(2)
    wait_until(lambda: other.outcomes)
    assert writer.outcomes == []
    assert link.numbers == [0, 51]
    # it can be asked for again
    writer.want(3)
    wait_until(lambda: writer.outcomes)
    assert writer.outcomes == [(packed(3), None)]


def test_slots_take_turns(bus: Bus, link: FakeLink) -> None:
    # one that is asked for again and again keeps nobody waiting
    hasty, calm = Writer(bus, 50), Writer(bus, 51)
    count = 0

    def answer(done: Done) -> bytes:
        nonlocal count
        if done.number == 50 and count < 100:
            count += 1
            hasty.want(count)
        return b''

    with link.held():
        hold(bus, link)
        link.answer = answer
        hasty.want(0)
        calm.want(7)
    wait_until(lambda: len(hasty.outcomes) == 101)
    assert link.numbers[1:4] == [50, 51, 50]


def test_error_reaches_the_owner_of_a_slot(bus: Bus, link: FakeLink) -> None:
    writer = Writer(bus)
    error = Refused(3)

    def answer(done: Done) -> bytes:
        raise error

    link.answer = answer
    writer.want(1)
    wait_until(lambda: writer.outcomes)
    assert writer.outcomes == [(packed(1), error)]


# --- whatever is raised ---------------------------------------------------------------------------

ANYTHING = [ValueError('no'), AssertionError(), SystemExit(1), KeyboardInterrupt(), Cancelled()]
RAISED = pytest.mark.parametrize('error', ANYTHING, ids=lambda error: type(error).__name__)


def raiser(error: BaseException) -> Callable[..., Any]:
    def function(*_: object) -> Any:
        raise error

    return function


@RAISED
def test_coroutine_that_raises(bus: Bus, error: BaseException) -> None:
    async def job() -> None:
        raise error

    future = bus.run(job())
    wait_until(future.done)
    assert result(ask(bus, 1, Priority.POLL)) == packed(1)
    assert future.exception() is error


@RAISED
def test_call_that_raises(bus: Bus, error: BaseException) -> None:
    bus.call(raiser(error))
    assert result(ask(bus, 1, Priority.POLL)) == packed(1)


@RAISED
def test_call_that_raises_keeps_nobody_else_out(
    bus: Bus, link: FakeLink, error: BaseException
) -> None:
    with link.held():
        hold(bus, link)
        bus.call(raiser(error))
        future = ask(bus, 1, Priority.POLL)
    assert result(future) == packed(1)


@RAISED
@pytest.mark.parametrize('which', ['make', 'done'])
def test_slot_that_raises(bus: Bus, link: FakeLink, error: BaseException, which: str) -> None:
    writer = Writer(bus)
    good = getattr(writer, which)
    setattr(writer.slot, which, raiser(error))
    writer.want(1)
    assert result(ask(bus, 1, Priority.POLL)) == packed(1)
    setattr(writer.slot, which, good)
    writer.want(2)
    wait_until(lambda: writer.outcomes)
    assert writer.outcomes[-1] == (packed(2), None)


@RAISED
def test_link_that_raises(bus: Bus, link: FakeLink, error: BaseException) -> None:
    link.answer = raiser(error)
    future = ask(bus, 1, Priority.POLL)
    assert isinstance(failure(future), LinkError)
    writer = Writer(bus)
    writer.want(1)
    wait_until(lambda: writer.outcomes)
    assert isinstance(writer.outcomes[0][1], LinkError)
    link.answer = lambda done: packed(done.number)
    assert result(ask(bus, 2, Priority.POLL)) == packed(2)


@RAISED
def test_link_that_raises_when_it_is_opened(
    link: FakeLink, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    monkeypatch.setattr(bus_module, 'REOPEN_PERIOD', 0.01)
    tries = 0

    def opening() -> None:
        nonlocal tries
        tries += 1
        raise error

    link.opening = opening
    bus = Bus(link)
    bus.start()
    future = ask(bus, 1, Priority.POLL)
    assert isinstance(failure(future), PortError)
    assert isinstance(bus.port_error, PortError)
    before, start = tries, time.monotonic()
    wait_until(lambda: tries >= before + 5)
    # tried again at leisure, not in a storm: the first of the five may be due at once
    assert time.monotonic() - start >= 0.03
    link.opening = lambda: None
    wait_until(lambda: bus.port_error is None)
    assert result(ask(bus, 2, Priority.POLL)) == packed(2)
    bus.close()


@RAISED
def test_link_that_raises_when_it_is_closed(
    bus: Bus, link: FakeLink, error: BaseException
) -> None:
    link.closing = raiser(error)
    link.answer = raiser(PortError('gone'))
    assert isinstance(failure(ask(bus, 1, Priority.POLL)), PortError)
    link.answer = lambda done: packed(done.number)
    wait_until(lambda: bus.port_error is None)
    assert result(ask(bus, 2, Priority.POLL)) == packed(2)
    bus.close()
    assert not bus.alive


def test_resync_reads_that_raise(bus: Bus, link: FakeLink, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, 'use_resync_reads', raiser(RuntimeError()))
    bus.use_resync_reads(1, ())
    assert result(ask(bus, 1, Priority.POLL)) == packed(1)


# --- time -----------------------------------------------------------------------------------------


def test_sleep_takes_its_time_and_keeps_nobody_waiting(bus: Bus, link: FakeLink) -> None:
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


def spawned(bus: Bus, coroutine: Any) -> Task:
    """Start a coroutine beside, from outside."""
    tasks: list[Task] = []
    bus.call(lambda: tasks.append(bus.spawn(coroutine)))
    wait_until(lambda: tasks)
    return tasks[0]


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


def test_waking_one_who_waits_for_an_answer_does_nothing(bus: Bus, link: FakeLink) -> None:
    async def job() -> bytes:
        return (await bus.read(UNIT, register(9), Priority.REFRESH)).data

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


# --- cancelling -----------------------------------------------------------------------------------


def test_cancelled_task_sends_nothing_more(bus: Bus, link: FakeLink) -> None:
    seen: list[str] = []

    async def job() -> None:
        try:
            await bus.read(UNIT, register(66), Priority.REFRESH)
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
        return (await bus.read(UNIT, register(number), Priority.REFRESH)).data

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
        await bus.read(UNIT, register(1), Priority.POLL)
        await bus.read(UNIT, register(2), Priority.POLL)

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
            return (await bus.read(UNIT, register(8), Priority.STOP)).data
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
    async def job() -> tuple[Task | None, Task]:
        return bus.current_or_none, bus.current

    none, some = result(bus.run(job()))
    assert none is some
    seen: list[Task | None] = []
    bus.call(lambda: seen.append(bus.current_or_none))
    wait_until(lambda: seen)
    assert seen == [None]


# --- units that must be left alone ----------------------------------------------------------------


def test_unit_in_doubt_keeps_nobody_waiting(bus: Bus, link: FakeLink) -> None:
    ready = threading.Event()

    def answer(done: Done) -> bytes:
        if done.unit == UNIT and not ready.is_set():
            raise NotReady(time.monotonic() + 0.01)
        return packed(done.number)

    link.answer = answer
    writer = Writer(bus)
    writer.want(7)
    mine = ask(bus, 1, Priority.SERVICE)
    for number in range(10):
        assert result(ask(bus, number, Priority.REFRESH, unit=OTHER)) == packed(number)
    assert not mine.done()
    assert writer.outcomes == []
    ready.set()
    assert result(mine) == packed(1)
    wait_until(lambda: writer.outcomes)
    assert writer.outcomes == [(packed(7), None)]
    # nothing was sent while it was in doubt, so nothing is counted
    assert bus.statistics().transactions == 12


def test_cancelled_while_its_unit_is_in_doubt(bus: Bus, link: FakeLink) -> None:
    asked = threading.Event()

    def answer(done: Done) -> bytes:
        if done.number == 66:
            asked.set()
            raise NotReady(time.monotonic() + 0.02)
        return packed(done.number)

    async def job() -> None:
        await bus.read(UNIT, register(66), Priority.POLL)

    async def past_it() -> None:
        await bus.sleep(0.05)

    link.answer = answer
    task = spawned(bus, job())
    assert asked.wait(PATIENCE)
    bus.call(lambda: bus.cancel(task))
    assert isinstance(failure(task.future), Cancelled)
    tries = link.numbers.count(66)
    result(bus.run(past_it()))
    assert link.numbers.count(66) == tries


# --- the port -------------------------------------------------------------------------------------


def test_port_that_is_lost_and_comes_back(bus: Bus, link: FakeLink) -> None:
    assert result(ask(bus, 1, Priority.POLL)) == packed(1)
    assert bus.port_error is None
    gone = PortError('gone')
    link.answer = raiser(gone)
    link.opening = raiser(PortError('still gone'))
    writer = Writer(bus)
    with link.held():
        lost = hold(bus, link)
        others = [ask(bus, number, priority) for number, priority in enumerate(Priority)]
        writer.want(3)
    assert failure(lost) is gone
    for future in others:
        assert isinstance(failure(future), PortError)
    wait_until(lambda: writer.outcomes)
    assert isinstance(writer.outcomes[0][1], PortError)
    assert link.closed >= 1
    wait_until(lambda: bus.port_error is not None and str(bus.port_error) == 'still gone')
    # who asks now is told at once
    assert isinstance(failure(ask(bus, 1, Priority.STOP)), PortError)
    sent = len(link.done)
    link.answer = lambda done: packed(done.number)
    link.opening = lambda: None
    wait_until(lambda: bus.port_error is None)
    assert result(ask(bus, 2, Priority.POLL)) == packed(2)
    assert len(link.done) == sent + 1
    assert bus.statistics().reconnects == 1


def test_lost_port_is_told_to_all_though_one_who_hears_of_it_ends_another(
    bus: Bus, link: FakeLink
) -> None:
    link.answer = raiser(PortError('gone'))
    tasks: list[Task] = []

    async def end_the_other() -> None:
        try:
            await bus.read(UNIT, register(1), Priority.POLL)
        except PortError:
            bus.cancel(tasks[0])
            raise

    async def wait_behind() -> None:
        tasks.append(bus.current)
        await bus.read(UNIT, register(2), Priority.POLL)

    with link.held():
        lost = hold(bus, link)
        first = bus.run(end_the_other())
        ended = bus.run(wait_behind())
        last = ask(bus, 3, Priority.POLL)
    for future in (lost, first, last):
        assert isinstance(failure(future), PortError)
    assert isinstance(failure(ended), Cancelled)


def test_port_that_is_absent_at_first(link: FakeLink, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bus_module, 'REOPEN_PERIOD', 0.01)
    link.opening = raiser(PortError('absent'))
    bus = Bus(link)
    assert str(bus.port_error) == 'the port is not open yet'
    bus.start()
    assert str(failure(ask(bus, 1, Priority.POLL))) == 'absent'
    link.opening = lambda: None
    wait_until(lambda: bus.port_error is None)
    assert result(ask(bus, 2, Priority.POLL)) == packed(2)
    # it was opened once, so nothing was reconnected
    assert bus.statistics().reconnects == 0
    bus.close()


def test_slot_that_raises_while_the_port_is_lost(bus: Bus, link: FakeLink) -> None:
    link.opening = raiser(PortError('gone'))
    link.answer = raiser(PortError('gone'))
    failure(ask(bus, 1, Priority.POLL))
    broken = Slot(raiser(ValueError('oops')), lambda transfer, error: None)
    writer = Writer(bus)

    def want_both() -> None:
        bus.request(broken)
        writer.want(7)

    bus.call(want_both)
    # the other one is told all the same
    wait_until(lambda: writer.outcomes)
    assert str(writer.outcomes[0][1]) == 'gone'
    assert not broken.pending


def test_sleepers_are_not_troubled_by_a_lost_port(bus: Bus, link: FakeLink) -> None:
    link.opening = raiser(PortError('gone'))
    link.answer = raiser(PortError('gone'))
    failure(ask(bus, 1, Priority.POLL))

    async def sleeper() -> str:
        await bus.sleep(0.02)
        return 'slept'

    assert result(bus.run(sleeper())) == 'slept'


def test_reconnects_are_counted(bus: Bus, link: FakeLink) -> None:
    for times in range(1, 4):
        link.answer = raiser(PortError('gone'))
        failure(ask(bus, 1, Priority.POLL))
        link.answer = lambda done: packed(done.number)
        wait_until(lambda times=times: bus.statistics().reconnects == times)


# --- the end --------------------------------------------------------------------------------------


def test_close_ends_everything(link: FakeLink) -> None:
    bus = Bus(link)
    bus.start()

    async def sleeper() -> None:
        await bus.sleep(3600)

    async def for_ever() -> None:
        while True:
            await bus.read(UNIT, register(1), Priority.POLL)

    futures = [bus.run(sleeper()), bus.run(for_ever())]
    wait_until(lambda: len(link.done) > 3)
    bus.close()
    assert not bus.alive
    assert link.closed == 1
    for future in futures:
        assert isinstance(failure(future), Cancelled)
    sent = len(link.done)
    # nobody who comes too late waits for ever
    assert isinstance(failure(ask(bus, 2, Priority.STOP)), Cancelled)
    assert len(link.done) == sent
    assert bus.port_error is not None
    bus.close()


def test_close_waits_for_the_transaction_on_the_line(link: FakeLink) -> None:
    bus = Bus(link)
    bus.start()
    with link.held():
        future = hold(bus, link)
        closer = threading.Thread(target=bus.close)
        closer.start()
        assert link.closed == 0
    closer.join(PATIENCE)
    assert link.closed == 1
    assert result(future) == packed(0)


def test_coroutine_that_will_not_end_does_not_keep_the_bus(link: FakeLink) -> None:
    bus = Bus(link)
    bus.start()

    begun = threading.Event()

    async def stubborn() -> str:
        begun.set()
        for _ in range(5):
            try:
                await bus.sleep(3600)
            except Cancelled:
                continue
        return 'at last'

    future = bus.run(stubborn())
    assert begun.wait(PATIENCE)
    bus.close()
    assert not bus.alive
    assert result(future) == 'at last'


def test_start_and_close_leave_no_thread(link: FakeLink) -> None:
    before = threading.active_count()
    for _ in range(3):
        bus = Bus(link)
        bus.start()
        assert bus.alive
        bus.close()
    assert threading.active_count() == before


# --- figures --------------------------------------------------------------------------------------


def test_figures_of_the_line(link: FakeLink, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = take_time(link, monkeypatch, {})
    script: list[tuple[float, LinkError | None]] = [
        (0.010, None),
        (0.020, None),
        (0.200, NoAnswer('')),
        (0.100, DamagedAnswer('')),
        (0.030, Refused(2)),
        (0.000, NotReady(0.0)),
        (0.040, None),
    ]
    steps = iter(script)

    def answer(done: Done) -> bytes:
        took, error = next(steps)
        clock.now += took
        if error is not None:
            raise error
        return packed(1)

    link.answer = answer
    bus = Bus(link)
    bus.start()
    for _ in range(6):  # one of them is not ready at first and asked again
        wait_until(ask(bus, 1, Priority.POLL).done)
    bus.call(lambda: bus.recorder.retry(1))
    bus.call(lambda: bus.recorder.cycle(1, 0.3))
    bus.call(lambda: bus.recorder.cycle(2, 0.5))
    bus.call(lambda: bus.recorder.cycle(1, 0.2))
    result(bus.run(nothing()))
    figures = bus.statistics()
    assert figures.transactions == 6
    assert (figures.timeouts, figures.damaged, figures.refused) == (1, 1, 1)
    assert (figures.retries, figures.reconnects) == (1, 0)
    assert figures.utilisation == pytest.approx(0.4 / 2.0)
    assert figures.cycle_time == 0.5
    # a refusal is an answer too
    assert figures.round_trip_min == pytest.approx(0.01)
    assert figures.round_trip_mean == pytest.approx(0.025)
    assert figures.round_trip_max == pytest.approx(0.04)
    bus.call(lambda: bus.recorder.forget_cycle(2))
    result(bus.run(nothing()))
    assert bus.statistics().cycle_time == 0.2
    bus.close()


async def nothing() -> None:
    return
