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

"""
Modbus RTU frames of a master, without I/O [M0 §6.2.3].

:func:`encode` makes a request; an :class:`AnswerReader` finds its answer in whatever bytes come
in, in any pieces, among noise and the answers to other requests.
"""

from __future__ import annotations

from dataclasses import dataclass
import struct
from typing import Generic
from typing import Protocol
from typing import TypeVar

from nfo_sinus_driver.link.errors import Refused
from nfo_sinus_driver.link.interface import Words

READ_HOLDING_REGISTERS = 3
WRITE_SINGLE_REGISTER = 6
WRITE_MULTIPLE_REGISTERS = 16
WRITE_AND_READ_REGISTERS = 23

_EXCEPTION = 0x80
#: unit, function, code, CRC
_EXCEPTION_LENGTH = 5

T = TypeVar('T')
_Answer = TypeVar('_Answer', covariant=True)


class Request(Protocol[_Answer]):
    """What a request knows of itself and of its answer."""

    @property
    def unit(self) -> int:
        """Who is asked."""

    @property
    def function(self) -> int:
        """The function code."""

    @property
    def body(self) -> bytes:
        """The request without unit, function and CRC."""

    @property
    def answer_head(self) -> bytes:
        """What of the answer is known beforehand: unit, function and what follows them."""

    @property
    def answer_length(self) -> int:
        """Bytes of the answer, CRC included; the most there can be."""

    def measure(self, beginning: bytes) -> int:
        """Bytes of an answer that begins like this, CRC included; the least there can be."""

    def decode(self, frame: bytes) -> _Answer | None:
        """Return what a whole frame says; ``None`` if it is no answer after all."""


@dataclass(frozen=True)
class Read:
    """Read ``count`` registers of ``unit``, from ``register`` on (function 03)."""

    unit: int
    register: int
    count: int

    function = READ_HOLDING_REGISTERS

    @property
    def body(self) -> bytes:
        """The request without unit, function and CRC."""
        return struct.pack('>HH', self.register, self.count)

    @property
    def answer_head(self) -> bytes:
        """What of the answer is known beforehand."""
        return bytes((self.unit, self.function, 2 * self.count))

    @property
    def answer_length(self) -> int:
        """Bytes of the answer, CRC included."""
        return 5 + 2 * self.count

    def measure(self, beginning: bytes) -> int:
        """Bytes of the answer: always the same."""
        return self.answer_length

    def decode(self, frame: bytes) -> Words:
        """Return the words read."""
        return struct.unpack(f'>{self.count}H', frame[3:-2])


@dataclass(frozen=True)
class Write:
    """Write ``words`` to the registers of ``unit`` from ``register`` on (function 06 or 16)."""

    unit: int
    register: int
    words: Words

    @property
    def function(self) -> int:
        """06 for one word, 16 for several."""
        return WRITE_SINGLE_REGISTER if len(self.words) == 1 else WRITE_MULTIPLE_REGISTERS

    @property
    def body(self) -> bytes:
        """The request without unit, function and CRC."""
        count = len(self.words)
        if count == 1:
            return struct.pack('>HH', self.register, self.words[0])
        return struct.pack(f'>HHB{count}H', self.register, count, 2 * count, *self.words)

    @property
    def answer_head(self) -> bytes:
        """What of the answer is known beforehand: all of it."""
        second = self.words[0] if len(self.words) == 1 else len(self.words)
        return struct.pack('>BBHH', self.unit, self.function, self.register, second)

    @property
    def answer_length(self) -> int:
        """Bytes of the answer, CRC included."""
        return 8

    def measure(self, beginning: bytes) -> int:
        """Bytes of the answer: always the same."""
        return self.answer_length

    def decode(self, frame: bytes) -> Words:
        """Return no words: the answer only says that it was done."""
        return ()


@dataclass(frozen=True)
class WriteAndRead:
    """
    Write ``words`` from ``register`` on, then read ``count`` registers from ``source`` on.

    One transaction (function 23) [M0 §6.2.3]; only the G2 has it [C57]. The answer is that of a
    read: it names no register.
    """

    unit: int
    register: int
    words: Words
    source: int
    count: int

    function = WRITE_AND_READ_REGISTERS

    @property
    def body(self) -> bytes:
        """The request without unit, function and CRC."""
        size = len(self.words)
        where = (self.source, self.count, self.register, size)
        return struct.pack(f'>4HB{size}H', *where, 2 * size, *self.words)

    @property
    def answer_head(self) -> bytes:
        """What of the answer is known beforehand."""
        return bytes((self.unit, self.function, 2 * self.count))

    @property
    def answer_length(self) -> int:
        """Bytes of the answer, CRC included."""
        return 5 + 2 * self.count

    def measure(self, beginning: bytes) -> int:
        """Bytes of the answer: always the same."""
        return self.answer_length

    def decode(self, frame: bytes) -> Words:
        """Return the words read."""
        return struct.unpack(f'>{self.count}H', frame[3:-2])


def crc(data: bytes | bytearray) -> bytes:
    """Return the CRC-16 of Modbus as it goes on the wire, the low byte first."""
    value = 0xFFFF
    for byte in data:
        value = value >> 8 ^ _CRC_TABLE[(value ^ byte) & 0xFF]
    return value.to_bytes(2, 'little')


def encode(request: Request[object]) -> bytes:
    """Return the frame of a request."""
    frame = bytes((request.unit, request.function)) + request.body
    return frame + crc(frame)


class AnswerReader(Generic[T]):
    """
    Finds the answer to one request in the bytes that come in.

    An answer counts only when unit, function, length and check sum are right, and for a write
    register and value too. Everything else is passed over: it can be noise, or the answer of
    somebody else. A read answer does not name its register, so the caller has to make sure that
    no answer to an earlier request of the same shape can still come.
    """

    def __init__(self, request: Request[T]) -> None:
        self._request = request
        self._length = request.answer_length
        self._head = request.answer_head
        self._exception_head = bytes((request.unit, request.function | _EXCEPTION))
        self._buffer = bytearray()

    @property
    def received(self) -> int:
        """How many bytes have come that are not part of a frame found."""
        return len(self._buffer)

    @property
    def missing(self) -> int:
        """How many bytes have to come yet, at least, as far as those that came tell."""
        begun = max(0, self._buffer.find(self._head))
        return max(1, self._request.measure(bytes(self._buffer[begun:])) - len(self._buffer))

    def feed(self, data: bytes) -> T | None:
        """
        Take bytes that came in.

        :returns: the words read, ``()`` for a write done, or what else the request's ``decode``
            makes of its answer; ``None`` while there is no answer yet.
        :raises Refused: the unit answered with an exception; feeding may go on after it.
        """
        buffer = self._buffer
        buffer += data
        for start in range(len(buffer) - _EXCEPTION_LENGTH + 1):
            if buffer.startswith(self._head, start):
                length = self._request.measure(bytes(buffer[start:]))
                if length <= self._length and self._frame_at(start, self._head, length):
                    answer = self._request.decode(bytes(buffer[start : start + length]))
                    if answer is not None:
                        del buffer[: start + length]
                        return answer
            if self._frame_at(start, self._exception_head, _EXCEPTION_LENGTH):
                code = buffer[start + 2]
                del buffer[: start + _EXCEPTION_LENGTH]
                raise Refused(code)
        return None

    def _frame_at(self, start: int, head: bytes, length: int) -> bool:
        buffer = self._buffer
        end = start + length
        return (
            end <= len(buffer)
            and buffer.startswith(head, start)
            and crc(buffer[start : end - 2]) == buffer[end - 2 : end]
        )


def _crc_entry(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ 0xA001 if byte & 1 else byte >> 1
    return byte


_CRC_TABLE = tuple(_crc_entry(byte) for byte in range(256))
