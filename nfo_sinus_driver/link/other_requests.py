# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Another master on a line where a request and an answer always differ, by its requests."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Generic, TypeVar

from nfo_sinus_driver.link.another_master import Sightings
from nfo_sinus_driver.link.interface import Remarks

ANOTHER_MASTER = (
    'another master asks the drives on this line: a line has one master, so disconnect it or stop '
    'its program; until then readings come later, and commands of its own may reach a drive'
)
#: How often a read is asked while another master asks at the same time.
TRIES = 3

_Request = TypeVar('_Request')


class OtherRequests(Generic[_Request]):
    """
    Finds the requests of another master in all that comes, and the answers to them.

    A request of another master is open until its answer comes, or may be late. What could answer
    one that was open during our exchange is no certain answer to us, unless it asks the same.

    :param patience: how long an answer may take, s.
    :param feed: takes bytes; returns the messages that became whole.
    :param request_types: what of them is a request.
    :param encode: returns the frame of a message.
    :param answers: tells whether a message may answer a request.
    """

    def __init__(
        self,
        remarks: Remarks,
        patience: float,
        feed: Callable[[bytes], Iterable[Any]],
        request_types: Any,
        encode: Callable[[Any], bytes],
        answers: Callable[[Any, _Request], bool],
    ) -> None:
        self._sightings = Sightings(remarks)
        self._patience = patience
        self._feed = feed
        self._request_types = request_types
        self._encode = encode
        self._answers = answers
        #: Our last request, until it comes back: some adapters return what is sent.
        self._own: _Request | None = None
        self._open: _Request | None = None
        self._open_until = 0.0
        #: What was open at any time since our last request.
        self._meanwhile: list[_Request] = []
        #: How many bytes the requests have that came since then.
        self._length = 0
        self._answered = False

    @property
    def open_until(self) -> float:
        """Until when an answer to another master may come; 0: none is awaited."""
        return 0.0 if self._open is None else self._open_until

    @property
    def was_answered(self) -> bool:
        """Whether another master has asked since our last request, and was answered."""
        return self._answered

    def is_there(self, now: float) -> bool:
        """Tell whether another master has been heard of late."""
        return self._sightings.is_there(now)

    def sent(self, request: _Request) -> None:
        """Take note of a request of ours."""
        self._own = request
        self._meanwhile = [] if self._open is None else [self._open]
        self._length = 0
        self._answered = False

    def take_late(self, now: float) -> _Request | None:
        """Return a request whose answer has not come, and may now be late."""
        late = self._open if now >= self._open_until else None
        if late is not None:
            self._open = None
        return late

    def doubts(self, answer: object, request: _Request, now: float, stray: int) -> bool:
        """
        Tell whether what may answer our request may be the answer to another one.

        :param stray: how many other bytes came with it. If they are more than requests that were
            heard, two answers may have met.
        """
        if stray > self._length and self.is_there(now):
            return True
        return any(other != request and self._answers(answer, other) for other in self._meanwhile)

    def clear(self) -> None:
        """Await no more answers: the port is closed."""
        self._own = self._open = None

    def hear(self, data: bytes, now: float) -> bool:
        """Take all bytes that come; tell whether any message of another exchange is in them."""
        found = False
        for message in self._feed(data):
            if not isinstance(message, self._request_types):
                if self._open is not None and self._answers(message, self._open):
                    self._answered = self._length > 0
                    self._open = None
                    found = True
            elif message == self._own:
                self._own = None
            else:
                self._sightings.add(now, ANOTHER_MASTER)
                self._open, self._open_until = message, now + self._patience
                self._meanwhile.append(message)
                self._length += len(self._encode(message))
                found = True
        return found
