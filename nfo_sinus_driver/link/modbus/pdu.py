# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The requests of a Modbus master and their answers, and how these are found in bytes [M0 §6.2.3].

A *message* is unit, function and data: what RTU, ASCII and TCP have in common. Each of them packs
it into frames of its own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
import functools
import struct
from typing import Generic, Protocol, TypeVar

from nfo_sinus_driver.link.interface import Address, Refused

READ_COILS = 1
READ_HOLDING_REGISTERS = 3
READ_INPUT_REGISTERS = 4
WRITE_SINGLE_COIL = 5
WRITE_SINGLE_REGISTER = 6
WRITE_MULTIPLE_REGISTERS = 16
WRITE_AND_READ_REGISTERS = 23

#: The spaces of addresses beside that of registers, which are read by 03 and written by 06 and 16:
#: those that are written by 16 alone, those that are read by 04, and coils, by 01 and 05; and coils
#: each of which is a command: what is written is the number of the one that is set.
WRITTEN_BY_16 = 'register_16'
INPUT = 'input'
COIL = 'coil'
PULSE = 'pulse'

_EXCEPTION = 0x80
_ON = 0xFF00
#: Unit, function, code.
REFUSAL_LENGTH = 3

#: How many encoded requests each line caches: those of a poll are sent again and again.
PREPARED = 1024

_T = TypeVar('_T')
_Answer = TypeVar('_Answer', covariant=True)


class Request(Protocol[_Answer]):
    """What a request knows of itself and of its answer, in messages."""

    def __hash__(self) -> int:
        """Equal requests to the same unit are the same."""

    @property
    def unit(self) -> int:
        """The unit."""

    @property
    def function(self) -> int:
        """The function code."""

    @property
    def body(self) -> bytes:
        """The request without unit and function."""

    @property
    def answer_head(self) -> bytes:
        """The beginning of the answer, as far as it is known: unit, function and more."""

    @property
    def answer_length(self) -> int:
        """The greatest length of the answer."""

    def measure(self, beginning: bytes) -> int:
        """Return the least length of an answer that begins like this."""

    def decode(self, message: bytes) -> _Answer | None:
        """Return the content of a whole message; ``None`` if it is no answer after all."""


class _ReadsRegisters:
    """A request whose answer has ``count`` registers, and does not name them."""

    unit: int
    function: int
    count: int

    @functools.cached_property
    def answer_head(self) -> bytes:
        """What of the answer is known beforehand."""
        return bytes((self.unit, self.function, 2 * self.count))

    @functools.cached_property
    def answer_length(self) -> int:
        """Bytes of the answer."""
        return 3 + 2 * self.count

    def measure(self, beginning: bytes) -> int:
        """Bytes of the answer: always the same."""
        return self.answer_length

    def decode(self, message: bytes) -> bytes:
        """Return the registers."""
        return message[3:]


@dataclass(frozen=True)
class Read(_ReadsRegisters):
    """Read ``count`` registers of ``unit``, from ``register`` on (function 03)."""

    unit: int
    register: int
    count: int

    function = READ_HOLDING_REGISTERS

    @property
    def body(self) -> bytes:
        """The request without unit and function."""
        return struct.pack('>HH', self.register, self.count)


class ReadInput(Read):
    """Read ``count`` input registers of ``unit``, from ``register`` on (function 04)."""

    function = READ_INPUT_REGISTERS


@dataclass(frozen=True)
class ReadCoils:
    """Read ``count`` coils of ``unit``, from ``coil`` on (function 01): the first in bit 0."""

    unit: int
    coil: int
    count: int

    function = READ_COILS

    @property
    def body(self) -> bytes:
        """The request without unit and function."""
        return struct.pack('>HH', self.coil, self.count)

    @property
    def answer_head(self) -> bytes:
        """What of the answer is known beforehand."""
        return bytes((self.unit, self.function, self._bytes))

    @property
    def answer_length(self) -> int:
        """Bytes of the answer."""
        return 3 + self._bytes

    @property
    def _bytes(self) -> int:
        return -(-self.count // 8)

    def measure(self, beginning: bytes) -> int:
        """Bytes of the answer: always the same."""
        return self.answer_length

    def decode(self, message: bytes) -> bytes:
        """Return the bits, eight in a byte; unused ones are 0."""
        bits = int.from_bytes(message[3:], 'little') & ((1 << self.count) - 1)
        return bits.to_bytes(self._bytes, 'little')


@dataclass(frozen=True)
class Write:
    """
    Write ``data`` to the registers of ``unit`` from ``register`` on (function 06 or 16).

    :ivar multiple: by function 16 although it is one register.
    """

    unit: int
    register: int
    data: bytes
    multiple: bool = False

    @property
    def function(self) -> int:
        """06 for one register, 16 for several."""
        return WRITE_SINGLE_REGISTER if self._is_single else WRITE_MULTIPLE_REGISTERS

    @property
    def _is_single(self) -> bool:
        return len(self.data) == 2 and not self.multiple

    @property
    def body(self) -> bytes:
        """The request without unit and function."""
        size = len(self.data)
        if self._is_single:
            return self.register.to_bytes(2, 'big') + self.data
        return struct.pack('>HHB', self.register, size // 2, size) + self.data

    @property
    def answer_head(self) -> bytes:
        """What of the answer is known beforehand: all of it."""
        size = len(self.data)
        second = self.data if self._is_single else (size // 2).to_bytes(2, 'big')
        return struct.pack('>BBH', self.unit, self.function, self.register) + second

    @property
    def answer_length(self) -> int:
        """Bytes of the answer."""
        return 6

    def measure(self, beginning: bytes) -> int:
        """Bytes of the answer: always the same."""
        return self.answer_length

    def decode(self, message: bytes) -> bytes:
        """Return nothing: the answer only says that it was done."""
        return b''


class WriteCoil(Write):
    """Write one coil of ``unit`` (function 05): it is off where ``data`` is 0."""

    function = WRITE_SINGLE_COIL

    @property
    def body(self) -> bytes:
        """The request without unit and function."""
        return struct.pack('>HH', self.register, _ON if any(self.data) else 0)

    @property
    def answer_head(self) -> bytes:
        """What of the answer is known beforehand: all of it."""
        return bytes((self.unit, self.function)) + self.body


@dataclass(frozen=True)
class WriteAndRead(_ReadsRegisters):
    """
    Write ``data`` from ``register`` on, then read ``count`` registers from ``source`` on.

    One transaction (function 23) [M0 §6.2.3]; only the G2 has it [C57]. The answer is that of a
    read: it names no register.
    """

    unit: int
    register: int
    data: bytes
    source: int
    count: int

    function = WRITE_AND_READ_REGISTERS

    @property
    def body(self) -> bytes:
        """The request without unit and function."""
        size = len(self.data)
        where = (self.source, self.count, self.register, size // 2)
        return struct.pack('>4HB', *where, size) + self.data


@functools.lru_cache(PREPARED)
def read_of(unit: int, address: Address) -> Request[bytes]:
    """Return the request that reads; the same one for the same address."""
    if address.space == COIL:
        return ReadCoils(unit, address.index, 1 if address.size == 1 else 8 * address.size)
    kind = ReadInput if address.space == INPUT else Read
    return kind(unit, address.index, address.size // 2)


def write_of(unit: int, address: Address, data: bytes) -> Write:
    """Return the request that writes."""
    if address.space == COIL:
        return WriteCoil(unit, address.index, data)
    if address.space == PULSE:
        return WriteCoil(unit, int.from_bytes(data, 'big'), bytes((1,)))
    return Write(unit, address.index, data, multiple=address.space == WRITTEN_BY_16)


def write_and_read_of(unit: int, address: Address, data: bytes, source: Address) -> WriteAndRead:
    """Return the request that writes to one address and reads another."""
    return WriteAndRead(unit, address.index, data, source.index, source.size // 2)


def encode(request: Request[object]) -> bytes:
    """Return the message of a request."""
    return bytes((request.unit, request.function)) + request.body


def refusal_head(request: Request[object]) -> bytes:
    """Return the beginning of a refusal of a request."""
    return bytes((request.unit, request.function | _EXCEPTION))


def longest(request: Request[object], beginning: bytes) -> int:
    """Return the greatest length of an answer that begins like this."""
    if request.measure(b'') == request.answer_length:
        return request.answer_length
    # what does not follow from the beginning may be as long as possible
    unknown = b'\xff' * request.answer_length
    return min(request.answer_length, request.measure(beginning + unknown))


def understand(request: Request[_T], message: bytes) -> _T | None:
    """
    Return the content of a message as the answer to a request; ``None``: it is none.

    :raises Refused: the unit answered with an exception.
    """
    if len(message) == REFUSAL_LENGTH and message.startswith(refusal_head(request)):
        raise Refused(message[2])
    if not message.startswith(request.answer_head):
        return None
    if not request.measure(message) == len(message) <= request.answer_length:
        return None
    return request.decode(message)


class AnswerReader(ABC, Generic[_T]):
    """
    Finds the answer to one request in the bytes that come in.

    An answer counts only when unit, function, length and check sum are right, and for a write
    register and value too. Everything else is passed over: it can be noise, or the answer to
    another master. A read answer does not name its register, so the caller has to make sure that
    no answer to an earlier request of the same shape can still come.

    :ivar frame: the bytes of the last answer or refusal found.
    :ivar passed_over: the bytes before it.
    """

    def __init__(self, request: Request[_T]) -> None:
        self._request = request
        self._buffer = b''
        self.frame = b''
        self.passed_over = b''

    @property
    def received(self) -> int:
        """How many bytes have come behind it, or at all."""
        return len(self._buffer)

    @property
    def other(self) -> bytes:
        """All bytes that are no answer."""
        return self.passed_over + self._buffer

    @property
    @abstractmethod
    def bytes_needed(self) -> int:
        """
        How many bytes have to come yet, by those that came.

        At least, while no answer has begun; then at most: the port may deliver all of a long answer
        at once, and one that is still coming is not late.
        """

    @property
    @abstractmethod
    def inter_byte_timeout(self) -> float:
        """How long a pause may last before the next byte comes, s."""

    def feed(self, data: bytes) -> _T | None:
        """
        Take bytes that came in; return the decoded answer, if it is there.

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
