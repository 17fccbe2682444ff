# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Asking a unit who it is: one transaction at a time, and whatever fails stays unknown."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from fake_link import PATIENCE, Done, FakeLink
import pytest
from support.addresses import packed, register

from nfo_sinus_driver.bus import Bus, Priority
from nfo_sinus_driver.link import (
    DamagedAnswer,
    Identification,
    LinkError,
    NoAnswer,
    NotReady,
    PortError,
    Refused,
    Reply,
)

_UNIT = 1
_FIRST, _SECOND, _STOP = 43, 17, 99


class _Inquiry:
    """Two questions, each of which is a read as far as the fake link knows."""

    def __init__(self, link: FakeLink, unit: int) -> None:
        self._link = link
        self._unit = unit
        self._left = [_FIRST, _SECOND]
        self.found = Identification()

    @property
    def done(self) -> bool:
        return not self._left

    def ask(self) -> Reply:
        number = self._left.pop(0)
        try:
            reply = self._link.read(self._unit, register(number))
        except NotReady:
            self._left.insert(0, number)
            raise
        self.found = Identification(vendor=f'{self.found.vendor}{number}')
        return reply


class _Link(FakeLink):
    def identify(self, unit: int) -> _Inquiry:
        return _Inquiry(self, unit)


@pytest.fixture
def link() -> _Link:
    return _Link()


@pytest.fixture
def bus(link: _Link) -> Iterator[Bus]:
    bus = Bus(link, now=link.now)
    bus.start()
    yield bus
    bus.close()


def _failing(error: Exception, *numbers: int) -> Callable[[Done], bytes]:
    def answer(done: Done) -> bytes:
        if done.number in numbers:
            raise error
        return packed(done.number)

    return answer


def test_each_question_is_asked_once(link: _Link, bus: Bus) -> None:
    found = bus.run(bus.identify(_UNIT, Priority.SERVICE)).result(PATIENCE)
    assert found == Identification(vendor='4317')
    assert link.numbers == [_FIRST, _SECOND]
    assert bus.statistics().transactions == 2


def test_a_stop_goes_between_two_questions(link: _Link, bus: Bus) -> None:
    async def stop() -> None:
        await bus.write(_UNIT, register(_STOP), packed(0), Priority.STOP)

    with link.held():
        inquiry = bus.run(bus.identify(_UNIT, Priority.SERVICE))
        link.wait_until_held()
        stopping = bus.run(stop())
    stopping.result(PATIENCE)
    inquiry.result(PATIENCE)
    assert link.numbers == [_FIRST, _STOP, _SECOND]


@pytest.mark.parametrize(
    'error', [Refused(1), NoAnswer('no unit'), DamagedAnswer('noise'), LinkError('a mistake')]
)
def test_what_fails_stays_unknown(link: _Link, bus: Bus, error: LinkError) -> None:
    link.answer = _failing(error, _FIRST)
    found = bus.run(bus.identify(_UNIT, Priority.SERVICE)).result(PATIENCE)
    assert found == Identification(vendor='17')
    link.answer = _failing(error, _FIRST, _SECOND)
    found = bus.run(bus.identify(_UNIT, Priority.SERVICE)).result(PATIENCE)
    assert found == Identification()
    assert link.numbers == 2 * [_FIRST, _SECOND], 'nothing is asked twice'
    assert bus.statistics().retries == 0


def test_what_cannot_be_asked_yet_is_asked_later(link: _Link, bus: Bus) -> None:
    refusals = iter([NotReady(0.0), NotReady(0.0)])

    def answer(done: Done) -> bytes:
        error = next(refusals, None)
        if error is not None:
            raise error
        return packed(done.number)

    link.answer = answer
    found = bus.run(bus.identify(_UNIT, Priority.SERVICE)).result(PATIENCE)
    assert found == Identification(vendor='4317')
    assert link.numbers == [_FIRST, _FIRST, _FIRST, _SECOND]


def test_a_lost_port_ends_it(link: _Link, bus: Bus) -> None:
    link.answer = _failing(PortError('gone'), _FIRST)
    future = bus.run(bus.identify(_UNIT, Priority.SERVICE))
    assert isinstance(future.exception(PATIENCE), PortError)
    assert link.numbers == [_FIRST]
