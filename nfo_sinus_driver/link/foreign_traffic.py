# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Another master on a line, by the requests that it sends and the answers to them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
import math
from typing import Any, NamedTuple

from nfo_sinus_driver.link.interface import Remarks

#: How often a read is sent while another master sends at the same time.
TRIES = 3

ANOTHER_MASTER = (
    'another master asks the drives on this line: a line has one master, so disconnect it or stop '
    'its program; until then readings come later, and commands of its own may reach a drive'
)
DOUBTFUL = 'another master asked at the same time'

#: How long another master counts as present after a request of it, s.
_PRESENT_FOR = 60.0
#: How many of its frames within that time are no noise.
_SURE = 3


class Sightings:
    """When another master sent requests; it is reported when it was no mere noise."""

    def __init__(self, remarks: Remarks) -> None:
        self._remarks = remarks
        self._at: deque[float] = deque((-math.inf,), maxlen=_SURE)

    def add(self, now: float, remark: str) -> None:
        """Count a request of another master."""
        self._remarks.foreign_frames += 1
        self._at.append(now)
        if len(self._at) == _SURE and now < self._at[0] + _PRESENT_FOR:
            self._remarks.add(remark)

    def is_there(self, now: float) -> bool:
        """Return whether another master has sent anything recently."""
        return now < self._at[-1] + _PRESENT_FOR


class Codec(NamedTuple):
    """
    The messages of a protocol where a request and an answer always differ.

    :ivar enquiry: a request that reads; ``select`` one that writes.
    :ivar kind: returns what distinguishes an answer from others.
    :ivar kinds: returns the kinds of answers that a request may have, the wanted one first.
    :ivar answers: returns whether a message may be the answer to a request.
    :ivar encode: returns the frame of a message.
    :ivar reader: finds messages in the bytes that come in: ``feed`` returns those that became
        whole, ``rest`` is what has come of the next one.
    :ivar longest_answer: how many bytes an answer has at most.
    :ivar inter_byte_timeout: how long a pause within an answer may last, s.
    """

    enquiry: Any
    select: Any
    kind: Callable[[Any], Any]
    kinds: Callable[[Any], Sequence[Any]]
    answers: Callable[[Any, Any], bool]
    encode: Callable[[Any], bytes]
    reader: Callable[[], Any]
    longest_answer: int
    inter_byte_timeout: float


class ForeignPairs:
    """
    Finds the requests of another master in all that comes, and the answers to them.

    A request of another master is open until its answer comes, or may be late. What could answer
    one that was open during our exchange is no certain answer to us, unless both are the same.

    :param answer_timeout: how long an answer may take, s.
    """

    def __init__(self, remarks: Remarks, answer_timeout: float, codec: Codec) -> None:
        self._sightings = Sightings(remarks)
        self._answer_timeout = answer_timeout
        self._codec = codec
        self._requests = codec.enquiry, codec.select
        self._reader = codec.reader()
        #: Our last request, until it comes back: some adapters return what is sent.
        self._own: Any = None
        self._open: Any = None
        self._open_until = 0.0
        #: What was open at any time since our last request.
        self._meanwhile: list[Any] = []
        #: How many bytes the requests have that came since then.
        self._length = 0
        #: Another master has sent a request since our last one, and was answered.
        self.was_answered = False

    def open_until(self, unit: int) -> float:
        """Until when an answer to another master may come; 0: none is awaited."""
        return 0.0 if self._open is None else self._open_until

    def is_there(self, now: float) -> bool:
        """Return whether another master has sent anything recently."""
        return self._sightings.is_there(now)

    def sent(self, request: Any) -> None:
        """Note a request of ours."""
        self._own = request
        self._meanwhile = [] if self._open is None else [self._open]
        self._length = 0
        self.was_answered = False

    def take_late(self, now: float) -> Any:
        """Return a request whose answer has not come, and may now be late."""
        late = self._open if now >= self._open_until else None
        if late is not None:
            self._open = None
        return late

    def doubts(self, answer: object, request: Any, now: float, stray: int) -> bool:
        """
        Return whether what may answer our request may be the answer to another one.

        :param stray: how many other bytes came with it. If they are more than those of the requests
            of another master, two answers may have met.
        """
        if stray > self._length and self.is_there(now):
            return True
        others = (other for other in self._meanwhile if other != request)
        return any(self._codec.answers(answer, other) for other in others)

    def clear(self) -> None:
        """Await no more answers: the port is closed."""
        self._own = self._open = None

    def hear_bytes(self, data: bytes, now: float) -> bool:
        """Take all bytes that come; return whether any message of another exchange is in them."""
        found = False
        for message in self._reader.feed(data):
            if not isinstance(message, self._requests):
                if self._open is not None and self._codec.answers(message, self._open):
                    self.was_answered = self._length > 0
                    self._open = None
                    found = True
            elif message == self._own:
                self._own = None
            else:
                self._sightings.add(now, ANOTHER_MASTER)
                self._open, self._open_until = message, now + self._answer_timeout
                self._meanwhile.append(message)
                self._length += len(self._codec.encode(message))
                found = True
        return found
