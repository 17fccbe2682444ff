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

"""Finds the answer to a request among the bytes of a serial line, however they are packed."""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Iterator
from typing import Generic
from typing import TypeVar

from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.link.modbus_pdu import Request
from nfo_sinus_driver.link.modbus_pdu import understand

_T = TypeVar('_T')


class AnswerReader(ABC, Generic[_T]):
    """
    Finds the answer to one request in the bytes that come in.

    An answer counts only when unit, function, length and check sum are right, and for a write
    register and value too. Everything else is passed over: it can be noise, or the answer of
    somebody else. A read answer does not name its register, so the caller has to make sure that
    no answer to an earlier request of the same shape can still come.

    :ivar frame: the bytes of the answer or refusal found last.
    :ivar passed_over: what came before it.
    """

    def __init__(self, request: Request[_T]) -> None:
        self._request = request
        self._buffer = b''
        self.frame = b''
        self.passed_over = b''

    @property
    def received(self) -> int:
        """How many bytes have come since, or at all."""
        return len(self._buffer)

    @property
    def other(self) -> bytes:
        """All that came and is no answer."""
        return self.passed_over + self._buffer

    @property
    @abstractmethod
    def bytes_needed(self) -> int:
        """How many bytes have to come yet, at least, as far as those that came tell."""

    @property
    @abstractmethod
    def inter_byte_timeout(self) -> float:
        """How long a pause may last before the next byte comes, s."""

    def feed(self, data: bytes) -> _T | None:
        """
        Take bytes that came in; return what the request's ``decode`` makes of its answer, if any.

        :raises Refused: the unit answered with an exception; feeding may go on after it.
        """
        self._buffer += data
        for start, end, message in self._messages():
            try:
                answer = understand(self._request, message)
            except Refused:
                self._take(start, end)
                raise
            if answer is not None:
                self._take(start, end)
                return answer
        return None

    @abstractmethod
    def _messages(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield the messages of the frames that may be answers; where each begins and ends."""

    def _take(self, start: int, end: int) -> None:
        # a refusal found before was not believed
        self.passed_over += self.frame + self._buffer[:start]
        self.frame = self._buffer[start:end]
        self._buffer = self._buffer[end:]
