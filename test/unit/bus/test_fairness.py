# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive that is asked for much keeps none from the line that is asked for little."""

from __future__ import annotations

from concurrent.futures import Future

from bus_bench import ask, result
from fake_link import Done, FakeLink, wait_until
from support.addresses import packed, register

from nfo_sinus_driver.bus import Bus, LatestValue, Priority
from nfo_sinus_driver.link import Read, Write

_SETPOINT = 50
_POLL = 7
_STOP = 9
_ENOUGH = 400


def test_set_points_that_never_end_leave_every_other_turn_to_the_polls() -> None:
    link = FakeLink()
    bus = Bus(link, now=link.now)

    def write() -> Write:
        # wanted again before it is written: set-points come faster than the line can carry
        for slot in slots:
            bus.request(slot)
        return Write(register(_SETPOINT), packed(1))

    slots = [LatestValue(1, write, lambda written, error: None) for _ in range(8)]

    async def poll() -> None:
        while True:
            await bus.ask(1, Read(register(_POLL)), Priority.POLL)

    bus.start()
    polling = bus.run(poll())
    bus.request(slots[0])
    wait_until(lambda: len(link.done) > 2 * _ENOUGH, timeout=60.0)
    bus.close()
    assert polling.done()
    seen: list[Done] = link.done[_ENOUGH:]
    polls = sum(done.number == _POLL for done in seen)
    writes = sum(done.number == _SETPOINT for done in seen)
    assert abs(polls - writes) <= 2


def test_requests_keep_to_their_number_a_second_but_a_stop_waits_for_none() -> None:
    link = FakeLink()
    at: list[tuple[float, int]] = []
    stop: list[Future[bytes]] = []

    def note(done: Done) -> bytes:
        at.append((link.now(), done.number))
        if not stop:
            stop.append(ask(bus, _STOP, Priority.STOP, packed(1)))
        return packed(done.number)

    link.answer = note
    bus = Bus(link, max_requests=10, now=link.now)
    bus.start()
    for poll in [ask(bus, _POLL, Priority.POLL) for _ in range(6)]:
        result(poll)
    bus.close()
    assert [number for _, number in at] == [_POLL, _STOP, *5 * [_POLL]]
    # one period less than there are: the clock is looked at before a request
    assert at[-1][0] - at[0][0] >= 4 * 0.1
