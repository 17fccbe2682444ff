# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Modbus RTU of a master: frames, without I/O [M0 §6.2.3], and the link over one serial line.

:func:`encode` makes a request; an :class:`RtuReader` finds its answer in the bytes that come in, in
any pieces, among noise and the answers to other requests.
"""

from __future__ import annotations

from collections.abc import Iterator
import functools
from typing import Any, TypeVar

from nfo_sinus_driver.link.modbus import pdu
from nfo_sinus_driver.link.modbus.foreign import message_lengths
from nfo_sinus_driver.link.modbus.pdu import AnswerReader, Request
from nfo_sinus_driver.link.modbus.serial import SerialLink
from nfo_sinus_driver.link.protocols import MODBUS_RTU

#: How many bytes the check sum has.
CRC_LENGTH = 2
#: USB adapters deliver bytes in lumps, so a pause within an answer may last this long, s.
_INTER_BYTE_TIMEOUT = 0.03

_T = TypeVar('_T')


def crc(data: bytes) -> bytes:
    """Return the CRC-16 of Modbus as it goes on the wire, the low byte first."""
    value = 0xFFFF
    for byte in data:
        value = value >> 8 ^ _CRC_TABLE[(value ^ byte) & 0xFF]
    return value.to_bytes(CRC_LENGTH, 'little')


@functools.lru_cache(pdu.PREPARED)
def encode(request: Request[object]) -> bytes:
    """Return the frame of a request."""
    message = pdu.encode(request)
    return message + crc(message)


class RtuReader(AnswerReader[_T]):
    """Finds an answer in RTU frames: only its length and check sum show where one is."""

    inter_byte_timeout = _INTER_BYTE_TIMEOUT

    def __init__(self, request: Request[_T]) -> None:
        super().__init__(request)
        self._head = request.answer_head
        self._refusal_head = pdu.refusal_head(request)

    @property
    def bytes_needed(self) -> int:
        """How many bytes have to come yet, by those that came."""
        begun = self._begun()
        if begun is None:
            length = self._request.measure(self._buffer)
            return max(1, length + CRC_LENGTH - len(self._buffer))
        length = pdu.longest(self._request, self._buffer[begun:]) + CRC_LENGTH
        return max(1, length - len(self._buffer) + begun)

    def _begun(self) -> int | None:
        """Return where an answer has begun; ``None``: nowhere yet."""
        buffer, head = self._buffer, self._head
        if (start := buffer.find(head)) >= 0:
            return start
        ends = range(min(len(head), len(buffer)), 0, -1)
        return next((len(buffer) - n for n in ends if buffer.endswith(head[:n])), None)

    def _messages(self) -> Iterator[tuple[int, int, bytes]]:
        buffer = self._buffer
        # nothing shorter is a frame
        for start in range(len(buffer) - pdu.REFUSAL_LENGTH - CRC_LENGTH + 1):
            if buffer.startswith(self._head, start):
                length = self._request.measure(buffer[start:])
            elif buffer.startswith(self._refusal_head, start):
                length = pdu.REFUSAL_LENGTH
            else:
                continue
            end = start + length + CRC_LENGTH
            if end <= len(buffer) and crc(buffer[start : end - 2]) == buffer[end - 2 : end]:
                yield start, end, buffer[start : end - 2]


def _crc_entry(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ 0xA001 if byte & 1 else byte >> 1
    return byte


_CRC_TABLE = tuple(_crc_entry(byte) for byte in range(256))


class RtuLink(SerialLink):
    """A Modbus RTU master; between frames the line is silent for t3.5."""

    protocol = MODBUS_RTU

    @functools.cached_property
    def _gap(self) -> float:
        return self._settings.frame_gap

    def _encode(self, request: Request[Any]) -> bytes:
        return encode(request)

    def _reader(self, request: Request[_T]) -> RtuReader[_T]:
        return RtuReader(request)

    def _messages(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        for start in range(len(data)):
            for length in message_lengths(data[start:]):
                end = start + length
                if crc(data[start:end]) == data[end : end + CRC_LENGTH]:
                    yield start, end + CRC_LENGTH, data[start:end]

    def _frame_length(self, message_length: int) -> int:
        return message_length + CRC_LENGTH
