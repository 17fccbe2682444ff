# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Which replies to believe after a silence: some are late, come twice or are to another request.

Without I/O; time is in seconds of one steady clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Set as AbstractSet
import enum
import math
from typing import Generic, Protocol, TypeVar

from nfo_sinus_driver.link.interface import NotReady

#: How late a reply may come, in time-outs, before it counts as lost for good.
LATEST_REPLY = 4
#: How long a line is not trusted after unrequested bytes, s.
SUSPECT_FOR = 60.0
#: How often a link that listens finds out whether a stop waits, s; and why it then believes less.
LISTENING_STEP = 0.005
STOP_WAITS = 'a stop was sent before the answer was certain'
#: How much longer a reply may take on a busy machine, s.
_JITTER = 0.003
#: How much later than its slowest recent reply a unit may reply.
_LATER = 1.25
#: The share of a slow reply that is remembered with each of the next ones.
_DECAY = 0.95


def longer_than(ever: float) -> float:
    """Return how long something may take that has taken so long at most, s."""
    return _LATER * ever + _JITTER


class Request(Protocol):
    """A request to a unit."""

    @property
    def unit(self) -> int:
        """The unit."""


_Request = TypeVar('_Request', bound=Request)
_Kind = TypeVar('_Kind')
_Question = TypeVar('_Question')


class Doubt(enum.Enum):
    """What is needed before the last reply is believed."""

    NONE = enum.auto()
    #: Nothing, for it is right, but it may come once more.
    ONCE_MORE = enum.auto()
    #: Listen as long as the right reply may take: it may have been the one before, sent twice.
    LISTEN = enum.auto()
    #: Have the unit reply something of another kind.
    RESYNC = enum.auto()


class LateReplies(Generic[_Request, _Kind]):
    """
    The replies that may still come from each unit, by *kind*: what distinguishes its replies.

    Units reply in order and :data:`LATEST_REPLY` time-outs late at most. What may still come is in
    *quarantine*: a reply of such a kind may be to an earlier request, so it proves nothing. One of
    any other kind is to the present request, and all late ones have come before it. Where each
    reply names its request, as over Modbus TCP, nothing is ever in quarantine.

    No request has to wait until a quarantine is over: :meth:`first_certain` finds what to send
    meanwhile. A request that fails takes a time-out, and what could answer it stays in quarantine
    for three more, so there are never more than three such kinds: of four requests with replies of
    different kinds one is always certain, and of three after a time-out at most.

    A reply with the same bytes as the one before may be the one before, sent twice: see
    :meth:`doubt_about`.

    :param response_timeout: how long a reply is waited for, s.
    :param kinds: returns the kinds of replies that a request may have.
    :param longest: how long a reply may take that is not late, s; 0: the ``response_timeout``.
    :ivar repeated: the earlier request to which the unit gave the same reply as to the last one;
        ``None`` if it did not.
    """

    def __init__(
        self,
        response_timeout: float,
        kinds: Callable[[_Request], Iterable[_Kind]],
        longest: float = 0.0,
    ) -> None:
        self._response_timeout = response_timeout
        self._memory = (LATEST_REPLY - 1) * response_timeout
        self._kinds = kinds
        self._until: dict[int, dict[_Kind, float]] = {}
        #: The last reply of each unit: to what, its bytes, and until when it may come again.
        self._noted: dict[int, tuple[_Request, bytes, float]] = {}
        self._last: _Request | None = None
        self.repeated: _Request | None = None
        #: Until when a reply is likely to come twice.
        self._suspect_until = 0.0
        self._longest = longest or response_timeout
        #: How long a unit has taken at most to reply, s: recently, and ever.
        self._slowest: dict[int, float] = {}
        self._longest_ever: dict[int, float] = {}

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
        """Return whether a reply that names no unit may be a late one of another unit."""
        others = [other for other in self._until if other != unit]
        return any(kind in self._left(other, now) for other in others)

    def release(self, unit: int) -> None:
        """Expect nothing more from a unit: it has answered the last request."""
        self._until.pop(unit, None)

    def clear(self) -> None:
        """Expect nothing more from any unit, and forget the replies."""
        self._until.clear()
        self._noted.clear()
        self._last = self.repeated = None

    def first_certain(
        self, unit: int, questions: Iterable[tuple[_Question, Iterable[_Kind]]], now: float
    ) -> _Question:
        """
        Return the first question whose reply cannot be confused with any that may still come.

        :param questions: each with the kinds of replies to be distinguished; one question at least.
        :raises NotReady: there is none; it says when there will be.
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
        """Forget what can no longer come; return the rest, and until when each may come."""
        if unit not in self._until:
            return {}
        left = {kind: until for kind, until in self._until[unit].items() if until > now}
        self._until[unit] = left
        return left

    # --- unrequested, or sent twice -----------------------------------------------------------

    def sent(self, request: _Request) -> None:
        """Note a request."""
        self._last = request
        self.repeated = None

    def note_unrequested(self, now: float) -> None:
        """Note unrequested bytes: the last request may be answered once more."""
        self._suspect_until = now + SUSPECT_FOR
        if self._last is not None:
            self.expect(self._last, now)

    def note_reply(self, request: _Request, reply: bytes, now: float, length: float) -> None:
        """
        Note a reply of a unit, for it may come again.

        :param length: how long it takes on the line, s.
        """
        before = self._noted.get(request.unit)
        if before is not None and before[1] == reply and now < before[2]:
            self.repeated = before[0]
        self._noted[request.unit] = request, reply, now + self._response_timeout + length

    def doubt_about(self, request: _Request, now: float, *, names_it: bool = False) -> Doubt:
        """
        Return what is needed before the reply to the last request is believed.

        After unrequested bytes the line is not trusted for a while.

        :param names_it: the reply itself names what it is about.
        """
        if self.repeated is None:
            return Doubt.NONE
        right = names_it or self.repeated == request
        if now > self._suspect_until:
            return Doubt.NONE if right else Doubt.LISTEN
        return Doubt.ONCE_MORE if right else Doubt.RESYNC

    def took(self, unit: int, seconds: float) -> None:
        """Note how long a unit took to reply; a slow reply is remembered for some dozens."""
        slowest = max(seconds, _DECAY * self._slowest.get(unit, 0.0))
        self._slowest[unit] = min(slowest, self._longest)
        # a port may be faster than its settings say, and the reply here before it is due
        self._longest_ever[unit] = max(seconds, self._longest_ever.get(unit, 0.0))

    def longest(self, unit: int) -> float:
        """Return how long a unit may take to reply, by its recent replies, s."""
        return min(_LATER * self._slowest.get(unit, 0.0), self._longest)

    def longest_ever(self, unit: int) -> float:
        """Return how long a unit that has ever replied may take, s; infinity: it has not yet."""
        return longer_than(self._longest_ever.get(unit, math.inf))
