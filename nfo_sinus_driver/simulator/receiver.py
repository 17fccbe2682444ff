# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Cuts the bytes that arrive into frames, by their length and by silence."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from nfo_sinus_driver.simulator.protocol import Protocol

#: More than any frame has: rubbish is not collected for ever.
_MOST = 600


@dataclass(frozen=True)
class Arrived:
    """A frame, or rubbish, and when its first and last byte arrived (s)."""

    data: bytes
    first: float
    last: float


class Receiver:
    """
    Collects bytes; a frame is there when its last byte has had time to arrive.

    :param protocol: knows how long a frame is.
    :param character: time of one character on the line (s); 0 on a line without pace.
    :param silence: the silence that ends what is no whole frame (s).
    """

    def __init__(self, protocol: Protocol, character: float, silence: float) -> None:
        self._protocol = protocol
        self._character = character
        self._silence = silence
        self._buffer = b''
        self._first = 0.0
        #: When the byte at the buffer's beginning began, and when its last one ends, on the wire.
        self._begin = self._end = float('-inf')

    def clear(self) -> None:
        """Forget what has not become a frame."""
        self._buffer = b''

    def feed(self, data: bytes, now: float) -> Iterator[Arrived]:
        """Take bytes that were read at ``now``; return what is complete by then."""
        # what the silence before these bytes has ended does not belong to them
        yield from self.take(now)
        begin = max(now, self._end)
        if not self._buffer:
            self._first = now
            self._begin = begin
        self._end = begin + len(data) * self._character
        self._buffer += data
        yield from self.take(now)

    def take(self, now: float) -> Iterator[Arrived]:
        """Return what is complete at ``now``."""
        while self._buffer:
            length, end = self._next()
            if end > now:
                return
            yield Arrived(self._buffer[:length], self._first, end)
            self._buffer = self._buffer[length:]
            # bytes right behind a frame are the next one, as from a hasty master
            self._begin = self._first = end

    @property
    def due(self) -> float | None:
        """When :meth:`take` will have something; ``None`` while nothing has arrived."""
        return self._next()[1] if self._buffer else None

    def _next(self) -> tuple[int, float]:
        """How much of the buffer comes out next, and when."""
        have = len(self._buffer)
        length = self._protocol.cut(self._buffer)
        if length:
            whole = length == have
            return length, self._end if whole else self._begin + length * self._character
        return have, self._end if have > _MOST else self._end + self._silence
