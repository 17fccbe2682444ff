# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The port lost and found again, the end of the bus, and its figures."""

from __future__ import annotations

import math
import threading

from bus_bench import UNIT, Writer, ask, failure, hold, raiser, result, take_time
from fake_link import PATIENCE, Done, FakeLink, wait_until
import pytest
from support.addresses import packed, register

from nfo_sinus_driver.bus import (
    Bus,
    Cancelled,
    LatestValue,
    Priority,
    Task,
    Watch,
    worker as bus_module,
)
from nfo_sinus_driver.link import (
    DamagedAnswer,
    LinkError,
    NoAnswer,
    NotReady,
    PortError,
    Read,
    Reconnect,
    Refused,
)


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
    # a new request fails at once
    assert isinstance(failure(ask(bus, 1, Priority.STOP)), PortError)
    sent = len(link.done)
    link.answer = lambda done: packed(done.number)
    link.opening = lambda: None
    wait_until(lambda: bus.port_error is None)
    assert result(ask(bus, 2, Priority.POLL)) == packed(2)
    assert len(link.done) == sent + 1
    assert bus.statistics().reconnects == 1


def test_lost_port_is_reported_to_all_though_one_of_them_ends_another(
    bus: Bus, link: FakeLink
) -> None:
    link.answer = raiser(PortError('gone'))
    tasks: list[Task | None] = []

    async def end_the_other() -> None:
        try:
            await bus.ask(UNIT, Read(register(1)), Priority.POLL)
        except PortError:
            bus.cancel(tasks[0])
            raise

    async def wait_behind() -> None:
        tasks.append(bus.current)
        await bus.ask(UNIT, Read(register(2)), Priority.POLL)

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
    bus = Bus(link, now=link.now)
    assert str(bus.port_error) == 'the port is not open yet'
    bus.start()
    assert str(failure(ask(bus, 1, Priority.POLL))) == 'absent'
    link.opening = lambda: None
    wait_until(lambda: bus.port_error is None)
    assert result(ask(bus, 2, Priority.POLL)) == packed(2)
    # it was opened once, so nothing was reconnected
    assert bus.statistics().reconnects == 0
    bus.close()


@pytest.mark.provokes
def test_slot_that_raises_while_the_port_is_lost(bus: Bus, link: FakeLink) -> None:
    link.opening = raiser(PortError('gone'))
    link.answer = raiser(PortError('gone'))
    failure(ask(bus, 1, Priority.POLL))
    broken = LatestValue(UNIT, raiser(ValueError('oops')), lambda written, error: None)
    writer = Writer(bus)

    def want_both() -> None:
        bus.request(broken)
        writer.want(7)

    bus.call(want_both)
    # the other one is notified all the same
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


@pytest.mark.provokes
def test_mute_port_that_cannot_be_reported_is_opened_again(bus: Bus, link: FakeLink) -> None:
    reports: list[float] = []

    def report(seconds: float) -> None:
        reports.append(seconds)
        raise ValueError('oops')

    bus.on_mute(report)
    bus.require_sign_of_life(UNIT, 0.01)
    result(ask(bus, 1, Priority.POLL))
    link.answer = raiser(NoAnswer(''))
    while link.opened < 2:
        failure(ask(bus, 1, Priority.POLL))
    link.answer = lambda done: packed(done.number)
    assert result(ask(bus, 2, Priority.POLL)) == packed(2)
    silent, speaks = reports
    assert silent >= 0.01 and speaks == 0
    assert bus.statistics().reconnects == 1


def test_mute_port_that_cannot_be_opened_again_is_lost(bus: Bus, link: FakeLink) -> None:
    bus.require_sign_of_life(UNIT, 0.01)
    result(ask(bus, 1, Priority.POLL))
    link.answer = raiser(NoAnswer(''))
    link.opening = raiser(PortError('another has it'))
    while bus.port_error is None:
        failure(ask(bus, 1, Priority.POLL))
    assert str(failure(ask(bus, 1, Priority.STOP))) == 'another has it' and link.closed
    link.answer = lambda done: packed(done.number)
    link.opening = lambda: None
    wait_until(lambda: bus.port_error is None)
    assert result(ask(bus, 2, Priority.POLL)) == packed(2)


def test_a_port_is_at_the_same_place_if_that_can_be_told(link: FakeLink) -> None:
    port = Reconnect(link)
    # where it was opened last, and whether that is where it was before
    places = ['', '', '1-2', '1-2', '1-3', '1-3', '', '1-3']
    same = []
    for link.place in places:
        port.mark_lost(PortError('gone'), 0.0)
        port.open(0.0)
        same.append(port.is_at_same_place)
    assert same == [False, False, False, True, False, True, False, False]


def test_tries_in_vain_do_not_count_for_the_place(link: FakeLink) -> None:
    port = Reconnect(link)
    link.place = '1-2'
    port.open(0.0)
    port.mark_lost(PortError('gone'), 0.0)
    # it is there, but cannot be used
    link.opening, link.place = raiser(PortError('in use')), '1-3'
    port.open(0.0)
    link.opening = lambda: None
    port.open(0.0)
    assert port.is_open and not port.is_at_same_place


def test_who_waits_for_a_mute_port_and_asks_nothing_is_woken_once(link: FakeLink) -> None:
    now = 0.0
    link.time = lambda: now
    bus = Bus(link, now=link.now)
    bus.require_sign_of_life(UNIT, 1.0)
    woken: list[float] = []

    async def wait() -> None:
        while True:
            await bus.sleep(1000.0, or_opening=True)
            woken.append(now)

    def try_in_vain() -> None:
        nonlocal now
        ask(bus, 1, Priority.POLL)
        while bus.step() == -math.inf:
            continue
        now += 0.1

    try_in_vain()
    link.answer = raiser(NoAnswer(''))
    bus.run(wait())
    while link.opened < 2:
        try_in_vain()
    assert len(woken) == 1
    try_in_vain()
    # the next opening waits for a request in vain
    now += 10.0
    for _ in range(20):
        bus.step()
    assert len(woken) == 2 and link.opened == 2
    try_in_vain()
    bus.step()
    assert len(woken) == 3 and link.opened == 3
    bus.close()


def test_reconnects_are_counted(bus: Bus, link: FakeLink) -> None:
    for times in range(1, 4):
        link.answer = raiser(PortError('gone'))
        failure(ask(bus, 1, Priority.POLL))
        link.answer = lambda done: packed(done.number)
        wait_until(lambda times=times: bus.statistics().reconnects == times)


def test_close_ends_everything(link: FakeLink) -> None:
    bus = Bus(link, now=link.now)
    bus.start()

    async def sleeper() -> None:
        await bus.sleep(3600)

    async def for_ever() -> None:
        while True:
            await bus.ask(UNIT, Read(register(1)), Priority.POLL)

    futures = [bus.run(sleeper()), bus.run(for_ever())]
    wait_until(lambda: len(link.done) > 3)
    bus.close()
    assert not bus.alive
    assert link.closed == 1
    for future in futures:
        assert isinstance(failure(future), Cancelled)
    sent = len(link.done)
    # what comes too late does not wait without end
    assert isinstance(failure(ask(bus, 2, Priority.STOP)), Cancelled)
    assert len(link.done) == sent
    assert bus.port_error is not None
    bus.close()


def test_close_waits_for_the_transaction_on_the_line(link: FakeLink) -> None:
    bus = Bus(link, now=link.now)
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
    bus = Bus(link, now=link.now)
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
        bus = Bus(link, now=link.now)
        bus.start()
        assert bus.alive
        bus.close()
    assert threading.active_count() == before


def test_figures_of_the_line(link: FakeLink, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = take_time(link, {})
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
    bus = Bus(link, now=link.now)
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
    bus.call(lambda: bus.recorder.cycle(2, math.nan))
    result(bus.run(nothing()))
    assert bus.statistics().cycle_time == 0.2
    bus.close()


async def nothing() -> None:
    return


def test_each_drive_is_looked_at_on_a_silent_line_asked_or_not(bus: Bus, link: FakeLink) -> None:
    looked: list[int] = []

    def look() -> float:
        looked.append(3)
        return math.inf

    for unit in (1, 2, 3):
        bus.require_sign_of_life(unit, 100.0)
    bus.watch_over(3, Watch(look, lambda: False, lambda seconds: None))
    link.answer = raiser(NoAnswer())
    assert failure(ask(bus, 1, Priority.POLL, unit=1)) is not None
    assert not looked
    for unit in (2, 1):
        assert failure(ask(bus, 1, Priority.POLL, unit=unit)) is not None
    assert looked
