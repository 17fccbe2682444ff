# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Whatever is raised, whatever raises it, the bus goes on."""

from __future__ import annotations

from concurrent.futures import Future
import threading
import time

from bus_bench import OTHER, RAISED, UNIT, Writer, ask, failure, hold, raiser, result, spawned
from fake_link import PATIENCE, Done, FakeLink, wait_until
import pytest
from support.addresses import packed, register

from nfo_sinus_driver.bus import Bus, Cancelled, Priority, worker as bus_module
from nfo_sinus_driver.link import InProgress, LinkError, NotReady, PortError, Read


@RAISED
def test_coroutine_that_raises(bus: Bus, error: BaseException) -> None:
    async def job() -> None:
        raise error

    future = bus.run(job())
    wait_until(future.done)
    assert result(ask(bus, 1, Priority.POLL)) == packed(1)
    assert future.exception() is error


@pytest.mark.provokes
@RAISED
def test_call_that_raises(bus: Bus, error: BaseException) -> None:
    bus.call(raiser(error))
    assert result(ask(bus, 1, Priority.POLL)) == packed(1)


@pytest.mark.provokes
@RAISED
def test_call_that_raises_keeps_no_other_out(
    bus: Bus, link: FakeLink, error: BaseException
) -> None:
    with link.held():
        hold(bus, link)
        bus.call(raiser(error))
        future = ask(bus, 1, Priority.POLL)
    assert result(future) == packed(1)


@pytest.mark.provokes
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


@pytest.mark.provokes
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


@pytest.mark.provokes
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
    bus = Bus(link, now=link.now)
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


@pytest.mark.provokes
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


@pytest.mark.provokes
def test_resync_reads_that_raise(bus: Bus, link: FakeLink, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, 'use_resync_reads', raiser(RuntimeError()))
    bus.use_resync_reads(1, ())
    assert result(ask(bus, 1, Priority.POLL)) == packed(1)


def test_unit_in_doubt_keeps_no_other_waiting(bus: Bus, link: FakeLink) -> None:
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


def test_stop_goes_between_the_transactions_of_a_request_in_several(
    bus: Bus, link: FakeLink
) -> None:
    stops: list[Future[bytes]] = []

    def answer(done: Done) -> bytes:
        if done.number == 66 and link.numbers.count(66) < 5:
            if link.numbers.count(66) == 2:
                stops.append(ask(bus, 0, Priority.STOP, packed(0)))
            raise InProgress(link.clock())
        return packed(done.number)

    link.answer = answer
    assert result(ask(bus, 66, Priority.SERVICE)) == packed(66)
    assert result(stops[0]) == packed(0)
    assert link.numbers == [66, 66, 0, 66, 66, 66]
    # each of them was one, and was answered
    assert bus.statistics().transactions == 6


def test_cancelled_while_its_unit_is_in_doubt(bus: Bus, link: FakeLink) -> None:
    asked = threading.Event()

    def answer(done: Done) -> bytes:
        if done.number == 66:
            asked.set()
            raise NotReady(time.monotonic() + 0.02)
        return packed(done.number)

    async def job() -> None:
        await bus.ask(UNIT, Read(register(66)), Priority.POLL)

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
