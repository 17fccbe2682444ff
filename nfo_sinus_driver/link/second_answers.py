# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Units that answer each request twice: a repeater does that, and two drives at one address.

A second answer that comes behind the next request passes for the answer to that, for no answer to
a read names its register. So from the first one on, a reading counts only if the line was silent
before its request for as long as a second answer may take, and if all that comes in as long a time
after it is the same once more.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
import math

from nfo_sinus_driver.link.interface import DamagedAnswer
from nfo_sinus_driver.link.late_replies import SUSPECT_FOR, Request, longer_than

#: So often in a row it is no chance, and one between may be lost.
_SURE = 2
_NEAR = 2
#: So often a silence has not helped that none does.
_GIVES_UP = 2
#: The longest silence that is tried, s, and in response time-outs; and that after one by chance, s.
_LONGEST = 0.15
_LONGEST_SHARE = 0.75
_SHORT = 0.03
#: How many of the last answers of a unit may come again.
_RECENT = 4


def different(unit: int) -> DamagedAnswer:
    """Return the error of a reading that is not the only answer."""
    return DamagedAnswer(
        f'unit {unit}: each request is answered twice, and not alike: two drives at one address, '
        'or a repeater? What it reports is not believed'
    )


def _twice(unit: int) -> str:
    return (
        f'unit {unit} answers each request twice: two drives at one address, or a repeater? Give '
        f'each drive an address of its own, and take the repeater off; until then readings come '
        f'later'
    )


@dataclass
class _Unit:
    """A unit, and its second answers."""

    #: The last answers, when each was complete and to what; how the last one begins; how many.
    recent: deque[tuple[bytes, float, Request]] = field(
        default_factory=lambda: deque(maxlen=_RECENT)
    )
    head: bytes = b''
    number: int = 0
    #: To which of them a second answer came last, and to how many in a row.
    seen: int = -_NEAR
    in_row: int = 0
    #: The silence that is long enough for one, s; and until when there is one, if no more comes.
    silence: float = 0.0
    until: float = -math.inf
    #: How often it was not long enough.
    failures: int = 0
    #: Until when the answer to each of some requests may be late: it is no second one then.
    late: dict[Request, float] = field(default_factory=dict)

    def may_be_late(self, request: Request, now: float) -> bool:
        """Return whether an earlier one of the same was not answered."""
        return now < self.late.get(request, -math.inf)


class SecondAnswers:
    """
    The second answers of all units of a line; without I/O.

    :param tell: takes a sentence of what was learnt.
    :param response_timeout: how long an answer is waited for, s.
    :param memory: how late an answer may be, s.
    :ivar last_unit: the one that has answered last.
    """

    def __init__(
        self, tell: Callable[[str], None], response_timeout: float, memory: float
    ) -> None:
        self._tell = tell
        self._most = min(_LONGEST, _LONGEST_SHARE * response_timeout)
        self._memory = memory
        self._units: dict[int, _Unit] = {}
        self.last_unit = -1

    def clear(self) -> None:
        """Forget all: the port is closed."""
        self._units.clear()

    def answered(self, request: Request, frame: bytes, now: float, head: bytes = b'') -> None:
        """Note an answer to us, and how its message begins: another that does is like it."""
        self.last_unit = unit = request.unit
        record = self._units.get(unit)
        if record is None:
            record = self._units[unit] = _Unit()
        record.recent.append((frame, now, request))
        record.head = head
        record.number += 1

    def unanswered(self, request: Request, now: float) -> None:
        """Note that no answer has come: it may be late."""
        record = self._units.get(request.unit)
        if record is not None:
            record.late = {other: until for other, until in record.late.items() if until > now}
            record.late[request] = now + self._memory

    def silence(self, unit: int, now: float) -> float:
        """Return how long the line is silent before and after a reading, s; 0: as usual."""
        record = self._units.get(unit)
        return record.silence if record is not None and now < record.until else 0.0

    def is_refused(self, unit: int, now: float) -> bool:
        """Return whether no silence helps: what a unit reports is not believed."""
        return self.silence(unit, now) > 0.0 and self._units[unit].failures >= _GIVES_UP

    def take_frame(self, unit: int, frame: bytes, now: float, message: bytes = b'') -> bool:
        """Return whether a frame that answers no open request is a second answer; note it."""
        record = self._units.get(unit)
        if record is None or not record.recent:
            return False
        last, last_at, _ = record.recent[-1]
        again = [
            at for answer, at, to in record.recent
            if answer == frame and not record.may_be_late(to, now)
        ]
        is_like = record.head and message.startswith(record.head)
        if not again and (not is_like or now < max(record.late.values(), default=now)):
            return False
        delay = now - (again or [last_at])[-1]
        if delay > self._memory:
            return False
        if record.number != record.seen:
            record.in_row = record.in_row + 1 if record.number <= record.seen + _NEAR else 1
            record.seen = record.number
        self._learn(record, longer_than(delay), now, same=frame == last)
        if record.in_row >= _SURE:
            self._tell(_twice(unit))
        return True

    def _learn(self, record: _Unit, needed: float, now: float, *, same: bool) -> None:
        if now >= record.until:
            record.silence, record.failures = 0.0, 0
        if not record.silence:
            if needed <= _SHORT or record.in_row >= _SURE:
                record.silence = min(needed, self._most)
        elif same and needed <= record.silence:
            record.failures = 0
        elif record.silence < self._most:
            record.silence = min(max(2 * record.silence, needed), self._most)
        else:
            record.failures += 1
        record.until = now + SUSPECT_FOR
