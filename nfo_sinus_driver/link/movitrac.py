# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Frames of the serial protocol of SEW's MOVITRAC 31.., without I/O [M4 §2.1].

:func:`encode` makes a frame; a :class:`Reader` finds the answer to one request in whatever bytes
come in, in any pieces, among noise and the remains of others. A start delimiter says what a frame
is and how long; its last byte is the sum of all others, without carry [C85].
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from nfo_sinus_driver.link.line_protocols import MOVITRAC

#: How many bytes a value has: of a plain frame, and of a long one.
SIZES = (4, 8)
#: Bytes of LONG_DATA, the longest answer.
LONGEST_ANSWER = 12

#: Of how many requests the frame is kept; those of a poll are sent again and again.
_PREPARED = 1024

_ENQUIRY = 0xB5
_DATA = 0xC8
_LONG_DATA = 0xAC
_SELECT = 0xA9
_LONG_SELECT = 0xAD
_ACK = 0xD2
_NACK = 0xF3
#: How long a frame is, by its start delimiter.
_LENGTHS = {
    _ENQUIRY: 5,
    _DATA: 8,
    _LONG_DATA: LONGEST_ANSWER,
    _SELECT: 9,
    _LONG_SELECT: 13,
    _ACK: 2,
    _NACK: 3,
}
#: Bytes of LONG_SELECT, the longest frame.
_LONGEST = max(_LENGTHS.values())
#: Bytes that may come before or after a frame when a transmitter is switched.
_GLITCH = 2


@dataclass(frozen=True)
class Enquiry:
    """Ask for the value of a parameter."""

    unit: int
    index: int


@dataclass(frozen=True)
class Select:
    """SELECT or LONG_SELECT, as its value is long: give a parameter a value."""

    unit: int
    index: int
    value: bytes


@dataclass(frozen=True)
class Data:
    """DATA or LONG_DATA: the value that a parameter has."""

    index: int
    value: bytes


@dataclass(frozen=True)
class Ack:
    """It was done."""


@dataclass(frozen=True)
class Nack:
    """It was not done, or is not quite what was asked for: the return code says why."""

    code: int


Request = Enquiry | Select
Answer = Data | Ack | Nack
Message = Request | Answer
#: What tells answers apart: the index that a DATA names, else only what it is.
Kind = int | type[Answer]


def kind(answer: Answer) -> Kind:
    """Return what tells an answer from others."""
    return answer.index if isinstance(answer, Data) else type(answer)


def kinds(request: Request) -> tuple[Kind, Kind]:
    """Return the kinds of answers that a request may have."""
    return request.index if isinstance(request, Enquiry) else Ack, Nack


def answers(message: Message, request: Request) -> bool:
    """Tell whether a message may be the answer to a request."""
    return not isinstance(message, Request) and kind(message) in kinds(request)


def check_sum(body: bytes) -> int:
    """Return the frame check sum: the sum of all bytes before it, without carry."""
    return sum(body) & 0xFF


@lru_cache(_PREPARED)
def encode(message: Message) -> bytes:
    """
    Return the frame of a message.

    :raises ValueError: an address, an index or a value that the protocol cannot express.
    """
    if isinstance(message, Ack):
        body = bytes((_ACK,))
    elif isinstance(message, Nack):
        body = bytes((_NACK, message.code))
    elif isinstance(message, Data):
        start = _start(message.value, _DATA, _LONG_DATA)
        body = bytes((start,)) + _word(message.index) + message.value
    else:
        MOVITRAC.require_unit(message.unit)
        value = message.value if isinstance(message, Select) else b''
        start = _start(value, _SELECT, _LONG_SELECT) if isinstance(message, Select) else _ENQUIRY
        body = bytes((start, message.unit)) + _word(message.index) + value
    return body + bytes((check_sum(body),))


def _start(value: bytes, plain: int, long: int) -> int:
    """Return the start delimiter of a frame that carries a value."""
    if len(value) not in SIZES:
        raise ValueError(f'a value of {len(value)} bytes: there are those of 4 and of 8')
    return plain if len(value) == SIZES[0] else long


def _word(index: int) -> bytes:
    if not 0 <= index <= 0xFFFF:
        raise ValueError(f'index {index} does not fit into two bytes')
    return index.to_bytes(2, 'big')


def decode(data: bytes) -> Message | None:
    """Return the message whose frame the bytes begin with; ``None`` if they do not, or not yet."""
    length = _LENGTHS.get(data[0], 0) if data else 0
    if not 0 < length <= len(data) or check_sum(data[: length - 1]) != data[length - 1]:
        return None
    start, body = data[0], data[1 : length - 1]
    if start == _ACK:
        return Ack()
    if start == _NACK:
        return Nack(body[0])
    if start in (_DATA, _LONG_DATA):
        return Data(int.from_bytes(body[:2], 'big'), body[2:])
    unit, index = body[0], int.from_bytes(body[1:3], 'big')
    if unit not in MOVITRAC.units:
        return None
    return Enquiry(unit, index) if start == _ENQUIRY else Select(unit, index, body[3:])


def is_glitch(data: bytes) -> bool:
    """Tell whether bytes are too few to be the remains of an answer, and none begins a frame."""
    return len(data) <= _GLITCH and _LENGTHS.keys().isdisjoint(data)


class Reader:
    """
    Finds the answer to one request in the bytes that come in.

    A DATA counts when its index is the one asked for and the sum is right, whatever came before
    it. ACK and NACK have next to nothing that could be wrong in them, so they count only at the
    beginning, behind whole frames, such as the echo of the request, or behind a glitch: a byte or
    two of which none begins a frame. Whatever else comes is passed over.

    :ivar frame: the bytes of the answer found last.
    :ivar passed_over: what came before it.
    :ivar rest: what has come since, or at all.
    """

    def __init__(self, request: Request) -> None:
        self._request = request
        self.rest = b''
        self.frame = b''
        self.passed_over = b''

    @property
    def other(self) -> bytes:
        """All that came and is no answer."""
        return self.passed_over + self.rest

    def feed(self, data: bytes) -> Answer | None:
        """
        Take bytes that came in.

        :returns: the answer, ``None`` while there is none; feeding may go on after it.
        """
        self.rest += data
        for start, end, message in _messages(self.rest):
            if not isinstance(message, Request) and answers(message, self._request):
                # an answer found before was not believed
                self.passed_over += self.frame + self.rest[:start]
                self.frame = self.rest[start:end]
                self.rest = self.rest[end:]
                return message
        return None


def _messages(data: bytes) -> Iterator[tuple[int, int, Message]]:
    """Yield each message that counts, where its frame begins and where it ends."""
    start = behind = 0
    while start < len(data):
        message = decode(data[start:])
        junk = data[behind:start]
        if message is None or (isinstance(message, (Ack, Nack)) and not is_glitch(junk)):
            start += 1
            continue
        end = start + _LENGTHS[data[start]]
        yield start, end, message
        start = behind = end


class Overhearing:
    """Finds all messages, of any master and drive, in the bytes that come in."""

    def __init__(self) -> None:
        self._rest = b''

    def feed(self, data: bytes) -> list[Message]:
        """Take bytes that came in; return the messages that became whole, in their order."""
        self._rest += data
        found: list[Message] = []
        behind = 0
        for _, end, message in _messages(self._rest):
            found.append(message)
            behind = end
        self._rest = self._rest[behind:][1 - _LONGEST :]
        return found
