# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Asking a unit who it is: one transaction at a time, and whatever fails stays unknown."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from fake_link import PATIENCE, Done, FakeLink
import pytest
from support.addresses import packed, register

from nfo_sinus_driver.bus import Bus, Priority
from nfo_sinus_driver.bus.tasks import set_up
from nfo_sinus_driver.link import (
    DamagedAnswer,
    Identification,
    LinkError,
    NoAnswer,
    NotReady,
    Plan,
    PortError,
    Read,
    Refused,
    Write,
)

_UNIT = 1
_FIRST, _SECOND, _STOP = 43, 17, 99


class _Link(FakeLink):
    """It has two questions, each of which is a read."""

    def identify(self, unit: int) -> Plan[Identification]:
        answered = ''
        for number in (_FIRST, _SECOND):
            if (yield Read(register(number))) is not None:
                answered += str(number)
        return Identification(vendor=answered)


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
        await bus.ask(_UNIT, Write(register(_STOP), packed(0)), Priority.STOP)

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


def _steps() -> Plan[str]:
    for number in (_FIRST, _SECOND):
        if (yield Write(register(number), packed(0))) is None:
            return f'refused {number}'
    return 'all'


def _set_up(bus: Bus, tries: int) -> str:
    future = bus.run(set_up(_UNIT, _steps(), Priority.SERVICE, tries, lambda: None))
    return future.result(PATIENCE)


@pytest.mark.parametrize('error', [NoAnswer('no unit'), DamagedAnswer('noise'), Refused(6)])
def test_a_step_that_was_not_carried_out_is_tried_again(
    link: _Link, bus: Bus, error: LinkError
) -> None:
    failures = iter([error, None, error, None])

    def answer(done: Done) -> bytes:
        if (failure := next(failures)) is not None:
            raise failure
        return b''

    link.answer = answer
    assert _set_up(bus, 2) == 'all'
    assert link.numbers == [_FIRST, _FIRST, _SECOND, _SECOND]
    link.answer = _failing(error, _SECOND)
    with pytest.raises(type(error)):
        _set_up(bus, 3)
    assert link.numbers[4:] == [_FIRST, *3 * [_SECOND]]


def test_a_step_that_is_refused_is_not_tried_again(link: _Link, bus: Bus) -> None:
    link.answer = _failing(Refused(2), _SECOND)
    assert _set_up(bus, 3) == 'refused 17'
    assert link.numbers == [_FIRST, _SECOND]
