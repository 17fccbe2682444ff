# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What to believe after a silence: replies that are late, come twice or may belong to another request.

Without I/O; time is in seconds of one steady clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Set as AbstractSet
import enum
from typing import Generic, Protocol, TypeVar

from nfo_sinus_driver.link.interface import NotReady

#: How late a reply may come, in time-outs, before it counts as lost for good.
LATEST_REPLY = 4
#: How long a line is not trusted that has brought something unrequested, s.
SUSPECT_FOR = 60.0
#: How much later than its slowest reply of late a unit may reply.
_LATER = 1.25
#: What is left of the memory of a slow reply with each of the next.
_DECAY = 0.95


class Request(Protocol):
    """What is asked."""

    @property
    def unit(self) -> int:
        """Who is asked."""


_Request = TypeVar('_Request', bound=Request)
_Kind = TypeVar('_Kind')
_Question = TypeVar('_Question')


class Doubt(enum.Enum):
    """What has to be done before the last reply is believed."""

    NONE = enum.auto()
    #: Nothing, for what it says is right, but it may come once more.
    ONCE_MORE = enum.auto()
    #: Listen as long as the right reply may take: it may have been the one before, sent twice.
    LISTEN = enum.auto()
    #: Have the unit reply something of another kind.
    RESYNC = enum.auto()


class LateReplies(Generic[_Request, _Kind]):
    """
    What may still come from each unit, by *kinds*: what tells its replies from one another.

    Units reply in order and :data:`LATEST_REPLY` time-outs late at most. What may still come is in
    *quarantine*: a reply of such a kind may be that to an earlier request, so it proves nothing.
    One of any other kind is that to the present request, and whatever was to come has come before
    it. Where each reply names its very request, as over Modbus TCP, nothing is ever in quarantine.

    No request has to wait until a quarantine is over: :meth:`first_certain` finds what to ask
    meanwhile. A request that fails takes a time-out, and what could answer it stays in quarantine
    for three more, so there are never more than three such kinds: of four questions with replies
    of different kinds one is always certain, and of three after a time-out at most.

    A reply with the very bytes of the one before may be the one before, sent twice: see
    :meth:`doubt_about`.

    :param response_timeout: how long a reply is waited for, s.
    :param kinds: returns the kinds of replies that a request may have.
    :ivar repeated: to which earlier request the unit replied the same as to the last one just now;
        ``None`` if it did not.
    """

    def __init__(
        self, response_timeout: float, kinds: Callable[[_Request], Iterable[_Kind]]
    ) -> None:
        self._response_timeout = response_timeout
        self._memory = (LATEST_REPLY - 1) * response_timeout
        self._kinds = kinds
        self._until: dict[int, dict[_Kind, float]] = {}
        #: The last reply of each unit: to what, its bytes, and until when it may come again.
        self._noted: dict[int, tuple[_Request, bytes, float]] = {}
        self._last: _Request | None = None
        self.repeated: _Request | None = None
        #: Until when a reply may well come twice.
        self._suspect_until = 0.0
        #: How long a unit has taken at most to reply, s.
        self._slowest: dict[int, float] = {}

    # --- late ---------------------------------------------------------------------------------

    def expect(self, request: _Request, now: float) -> None:
        """Expect a reply to a request, one more than has come."""
        self.quarantine(request.unit, self._kinds(request), now)

    def quarantine(self, unit: int, kinds: Iterable[_Kind], now: float) -> None:
        """Expect a reply of one of these kinds from a unit, one more than has come."""
        until = now + self._memory
        self._until.setdefault(unit, {}).update(dict.fromkeys(kinds, until))

    def quarantined(self, unit: int, now: float) -> AbstractSet[_Kind]:
        """Return the kinds of replies that may still come from a unit."""
        return self._left(unit, now).keys()

    def may_be_of_another(self, unit: int, kind: _Kind, now: float) -> bool:
        """Tell whether a reply that names no unit may be a late one of another than that asked."""
        others = [other for other in self._until if other != unit]
        return any(kind in self._left(other, now) for other in others)

    def release(self, unit: int) -> None:
        """Expect nothing more from a unit: it has answered what was asked last."""
        self._until.pop(unit, None)

    def clear(self) -> None:
        """Expect nothing more from any unit, and forget what came."""
        self._until.clear()
        self._noted.clear()
        self._last = self.repeated = None

    def first_certain(
        self, unit: int, questions: Iterable[tuple[_Question, Iterable[_Kind]]], now: float
    ) -> _Question:
        """
        Return the first question whose reply cannot be confused with any that may still come.

        :param questions: each with the kinds of replies to be distinguished; one question at least.
        :raises NotReady: there is none, and when there will be.
        """
        left = self._left(unit, now)
        free = []
        for question, kinds in questions:
            doubted = [left[kind] for kind in kinds if kind in left]
            if not doubted:
                return question
            free.append(max(doubted))
        raise NotReady(min(free))

    def _left(self, unit: int, now: float) -> dict[_Kind, float]:
        """Forget what is too late by now; return the rest, and until when each may come."""
        if unit not in self._until:
            return {}
        left = {kind: until for kind, until in self._until[unit].items() if until > now}
        self._until[unit] = left
        return left

    # --- unasked, or sent twice ---------------------------------------------------------------

    def sent(self, request: _Request) -> None:
        """Take note that a request goes out."""
        self._last = request
        self.repeated = None

    def heard_unasked(self, now: float) -> None:
        """Take note of unrequested bytes: the last request may be answered once more."""
        self._suspect_until = now + SUSPECT_FOR
        if self._last is not None:
            self.expect(self._last, now)

    def note(self, request: _Request, reply: bytes, now: float, length: float) -> None:
        """
        Take note of what a unit replied, for it may come again.

        :param length: how long it takes on the line, s.
        """
        before = self._noted.get(request.unit)
        if before is not None and before[1] == reply and now < before[2]:
            self.repeated = before[0]
        self._noted[request.unit] = request, reply, now + self._response_timeout + length

    def doubt_about(self, request: _Request, now: float, *, names_it: bool = False) -> Doubt:
        """
        Return what has to be done before the reply to the last request is believed.

        A line that has brought something unrequested is not trusted for a while.

        :param names_it: the reply says itself what it is about.
        """
        if self.repeated is None:
            return Doubt.NONE
        right = names_it or self.repeated == request
        if now > self._suspect_until:
            return Doubt.NONE if right else Doubt.LISTEN
        return Doubt.ONCE_MORE if right else Doubt.RESYNC

    def took(self, unit: int, seconds: float) -> None:
        """Take note how long a unit took to reply; a slow reply is remembered for some dozens."""
        self._slowest[unit] = max(seconds, _DECAY * self._slowest.get(unit, 0.0))

    def longest(self, unit: int) -> float:
        """Return how long a unit may take to reply, as it replied of late, s."""
        return _LATER * self._slowest.get(unit, 0.0)
