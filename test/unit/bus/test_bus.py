# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Coroutines and slots on the bus, and who is next."""

from __future__ import annotations

from collections import Counter
import threading

from bus_bench import UNIT, Writer, ask, failure, hold, result, take_time
from fake_link import Done, FakeLink, wait_until
import pytest
from support.addresses import packed, register

from nfo_sinus_driver.bus import Bus, Priority
from nfo_sinus_driver.bus.scheduler import BACKGROUND_SHARE
from nfo_sinus_driver.link import (
    Address,
    DamagedAnswer,
    LinkError,
    NoAnswer,
    Read,
    ReadThenWrite,
    Refused,
)


def test_read_and_write(bus: Bus, link: FakeLink) -> None:
    assert result(ask(bus, 7, Priority.SERVICE)) == packed(7)
    link.answer = lambda done: b''
    assert result(ask(bus, 8, Priority.SERVICE, packed(1, 2))) == b''
    assert link.done == [Done(UNIT, 7, None), Done(UNIT, 8, packed(1, 2))]


def test_result_and_mistake_of_a_coroutine(bus: Bus) -> None:
    async def good() -> str:
        await bus.ask(UNIT, Read(register(1)), Priority.SERVICE)
        return 'done'

    async def bad() -> None:
        await bus.ask(UNIT, Read(register(1)), Priority.SERVICE)
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
            await bus.ask(UNIT, Read(register(1)), Priority.SERVICE)
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
        both = ReadThenWrite(register(1), register(2), packed(0))
        reply = await bus.ask(UNIT, both, Priority.STOP)
        return reply.data

    link.answer = answer
    with link.held():
        hold(bus, link)
        waiting = [
            ask(bus, 3, Priority.LOOK),
            bus.run(job()),
            ask(bus, 4, Priority.STOP, packed(1)),
        ]
    assert [result(future) for future in waiting] == [packed(3), packed(2), packed(4)]
    # as any write of a stop it goes ahead of what only looks
    assert link.numbers == [0, 1, 2, 4, 3]


def test_resync_reads_are_passed_to_the_link(bus: Bus, link: FakeLink) -> None:
    bus.use_resync_reads(3, (register(1), register(2, 2)))
    wait_until(lambda: link.resync_reads == {3: (register(1), register(2, 2))})


def test_most_urgent_goes_first(
    bus: Bus, link: FakeLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    # in no time, so that the background has no claim
    take_time(link, {})
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
    order = [100, 101, 50, 102, 103, 104]
    assert link.numbers[1:7] == order
    assert sorted(link.numbers[7:]) == [105, 106]


def test_equals_take_turns_in_the_order_they_came(bus: Bus, link: FakeLink) -> None:
    with link.held():
        hold(bus, link)
        futures = [ask(bus, number, Priority.SERVICE) for number in range(1, 20)]
    for future in futures:
        result(future)
    assert link.numbers == list(range(20))


def test_stop_waits_for_one_transaction_at_most(bus: Bus, link: FakeLink) -> None:
    # all ask without end, in more steps than one
    ended = threading.Event()

    async def chatter(number: int, priority: Priority) -> None:
        while not ended.is_set():
            await bus.ask(UNIT, Read(register(number)), priority)

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


async def read_parts(bus: Bus) -> bytes:
    """Read a value of two words, of which register 5 has the low one."""
    return (await bus.ask(UNIT, Read(Address('register', 5, 6, 4)), Priority.REFRESH)).data


def test_stop_goes_between_the_words_of_a_value(bus: Bus, link: FakeLink) -> None:
    # over Classic each word is a transaction: the high one, the low one, the high one again
    with link.held():
        value = bus.run(read_parts(bus))
        link.wait_until_held()
        stop = ask(bus, 1, Priority.STOP)
    result(stop)
    assert result(value) == packed(5, 6)
    assert link.numbers == [6, 1, 5, 6]


def test_words_that_change_meanwhile_are_read_again(bus: Bus, link: FakeLink) -> None:
    # 3FFFFh becomes 40000h between high and low
    words = {6: iter([3, 4, 4]), 5: iter([0, 1])}
    link.answer = lambda done: packed(next(words[done.number]))
    assert result(bus.run(read_parts(bus))) == packed(1, 4)
    assert link.numbers == [6, 5, 6, 5, 6]


def test_words_that_never_stand_still(bus: Bus, link: FakeLink) -> None:
    link.answer = lambda done: packed(len(link.done))
    with pytest.raises(DamagedAnswer, match='stood still'):
        result(bus.run(read_parts(bus)))
    assert len(link.numbers) == 11


def test_stop_goes_before_the_background_s_share(
    bus: Bus, link: FakeLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = take_time(link, {0: 1.0})
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
    clock = take_time(link, {int(key): value for key, value in took.items()})
    bus = Bus(link, now=link.now)
    rounds = 4000

    async def chatter(priority: Priority) -> None:
        while len(link.done) < rounds:
            await bus.ask(UNIT, Read(register(priority)), priority)

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
    take_time(link, {0: 1.0, 1: 0.0064, 50: 0.0064})
    bus = Bus(link, now=link.now)
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
    # one that is asked for again and again keeps no other waiting
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
