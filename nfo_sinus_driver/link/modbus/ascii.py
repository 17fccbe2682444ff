# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Modbus ASCII of a master: frames, without I/O, and the link over one serial line.

A frame is ``:``, the message and its check sum in hexadecimal characters, carriage return and line
feed (MODBUS over Serial Line V1.02 §2.5.2). Upper case is sent, both are read. A colon always
begins a frame: what came before it is lost.
"""

from __future__ import annotations

from collections.abc import Iterator
import functools
import re
from typing import Any, TypeVar

from nfo_sinus_driver.link.modbus import pdu
from nfo_sinus_driver.link.modbus.foreign import message_lengths
from nfo_sinus_driver.link.modbus.pdu import AnswerReader, Request
from nfo_sinus_driver.link.modbus.serial import SerialLink
from nfo_sinus_driver.link.protocols import MODBUS_ASCII

#: How long a pause between two characters of a frame may last, s.
INTER_BYTE_TIMEOUT = 1.0
#: How long one may last outside a frame: adapters deliver characters in lumps, s.
_IDLE_TIMEOUT = 0.03

_FRAME = re.compile(rb':((?:[0-9A-Fa-f]{2})+)\r\n')
_BEGUN = re.compile(rb':([0-9A-Fa-f]*)\r?\Z')

_T = TypeVar('_T')


def lrc(data: bytes) -> int:
    """Return the check sum of a message: with it, all bytes add up to 0, modulo 256."""
    return -sum(data) & 0xFF


@functools.lru_cache(pdu.PREPARED)
def encode(request: Request[object]) -> bytes:
    """Return the frame of a request."""
    message = pdu.encode(request)
    return b':%b%02X\r\n' % (message.hex().upper().encode(), lrc(message))


def length(message_length: int) -> int:
    """Return how many characters the frame of a message has."""
    return 2 * (message_length + 1) + len(':\r\n')


def _whole_frames(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield the messages of the frames whose check sum is right; where each begins and ends."""
    for frame in _FRAME.finditer(data):
        *body, check = bytes.fromhex(frame[1].decode())
        message = bytes(body)
        if lrc(message) == check:
            yield frame.start(), frame.end(), message


class AsciiReader(AnswerReader[_T]):
    """Finds an answer in ASCII frames, which may pause for ``inter_byte_timeout``, s."""

    def __init__(
        self, request: Request[_T], inter_byte_timeout: float = INTER_BYTE_TIMEOUT
    ) -> None:
        super().__init__(request)
        self._inter_byte_timeout = inter_byte_timeout
        self._longest = length(request.answer_length)
        self._heads = [
            head.hex().upper().encode()
            for head in (request.answer_head, pdu.refusal_head(request))
        ]

    @property
    def bytes_needed(self) -> int:
        """How many characters have to come yet, by those that came."""
        begun = self._begun()
        digits = begun[1] if begun else b''
        beginning = bytes.fromhex(digits[: len(digits) & ~1].decode())
        if begun is None:
            return length(self._request.measure(beginning))
        return max(1, length(pdu.longest(self._request, beginning)) - len(begun[0]))

    @property
    def inter_byte_timeout(self) -> float:
        """How long a pause may last before the next character comes, s."""
        return self._inter_byte_timeout if self._begun() else _IDLE_TIMEOUT

    def _messages(self) -> Iterator[tuple[int, int, bytes]]:
        return _whole_frames(self._buffer)

    def _begun(self) -> re.Match[bytes] | None:
        """Return the frame that has begun and not ended, if it can become an answer."""
        begun = _BEGUN.search(self._buffer)
        if begun is None or len(begun[0]) >= self._longest:
            return None
        digits = begun[1].upper()
        fits = any(digits.startswith(head[: len(digits)]) for head in self._heads)
        return begun if fits else None


#: Frames need no silence between them, but transmitters need a moment to switch, characters.
_SWITCHING = 2


class AsciiLink(SerialLink):
    """
    A Modbus ASCII master.

    The standard allows a pause of a second between two characters. An answer whose end was lost
    would leave the line unused for that, so no pause may be longer than ``response_timeout``.
    """

    protocol = MODBUS_ASCII

    @functools.cached_property
    def _gap(self) -> float:
        return _SWITCHING * self._settings.char_time

    def _encode(self, request: Request[Any]) -> bytes:
        return encode(request)

    def _reader(self, request: Request[_T]) -> AsciiReader[_T]:
        timeout = min(INTER_BYTE_TIMEOUT, self._settings.response_timeout)
        return AsciiReader(request, timeout)

    def _messages(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        for start, end, message in _whole_frames(data):
            if len(message) in message_lengths(message):
                yield start, end, message

    def _frame_length(self, message_length: int) -> int:
        return length(message_length)
