# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Requests in frames that nothing of the driver's own codecs makes or reads."""

from __future__ import annotations

from collections.abc import Callable
import functools
import operator
import struct
import time
from typing import NamedTuple, Protocol

from nfo_sinus_driver.link.ports.port import Port
from nfo_sinus_driver.link.ports.tcp_connection import TcpConnection

#: How long the first byte is waited for, and after the last one, s.
_FIRST, _LAST = 0.5, 0.05
#: The longest answer of Modbus.
_MOST = 260
_CONNECTS_WITHIN = 5.0
#: What a Classic drive answers where there is no such parameter, and how long a REPLY is.
NAK = b'\x15'
_REPLY = 14
#: How much is added to the sum of a frame that is to be none.
_SPOILED = 0x0101


class Answer(NamedTuple):
    """
    What came for one request.

    :ivar pdu: function and data, on Classic what :class:`ClassicWire` says; nothing: no frame that
        belongs to the request.
    :ivar frame: every byte that came.
    :ivar first: from the last byte sent to the first that came, s; infinite: none did.
    """

    pdu: bytes
    frame: bytes
    first: float

    @property
    def refused_with(self) -> int | None:
        """The exception code, if it is a refusal."""
        return self.pdu[1] if len(self.pdu) == 2 and self.pdu[0] & 0x80 else None


class Wire(Protocol):
    """One drive, asked by what it speaks."""

    @property
    def has_sum(self) -> bool:
        """Its frames have a sum, which can be wrong."""

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        """
        Send a request, with a wrong sum or the right one, and return what came.

        :raises PortError: the port is gone.
        """


class SerialWire:
    """A drive on a serial line; each request waits until the line was silent for a while."""

    has_sum = True

    def __init__(self, port: Port, unit: int, gap: float, *, ascii_frames: bool) -> None:
        self._port = port
        self._unit = unit
        #: The least silence before a request, s.
        self.gap = gap
        self._pack: Callable[[bytes, int], bytes] = _ascii if ascii_frames else _rtu
        self._unpack = _from_ascii if ascii_frames else _from_rtu

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        """Send a request, and return what came."""
        port, message = self._port, bytes((self._unit,)) + pdu
        while port.read(time.monotonic() + self.gap):
            # what is left of an answer that came too late
            pass
        port.write(self._pack(message, _SPOILED if spoiled else 0))
        sent = time.monotonic()
        frame, first = b'', float('inf')
        until = sent + _FIRST
        while len(frame) < 2 * _MOST and (data := port.read(until)):
            now = time.monotonic()
            first = min(first, now - sent)
            frame, until = frame + data, now + _LAST
            if self._unpack(frame):
                break
        answer = self._unpack(frame)
        belongs = answer[:1] == message[:1] and answer[1:2] in (pdu[:1], bytes((pdu[0] | 0x80,)))
        return Answer(answer[1:] if belongs else b'', frame, first)


class ClassicWire:
    """
    A drive on a Classic line.

    A request is the number of a parameter, in two bytes; an answer its word, in two bytes, or NAK.
    """

    has_sum = True

    def __init__(self, port: Port, unit: int, gap: float) -> None:
        self._port = port
        self._unit = unit
        #: The least silence before a request, s.
        self.gap = gap

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        """Send an ENQUIRY, which has no sum, and return what came."""
        assert not spoiled, 'an ENQUIRY has no sum'
        port, address = self._port, bytes((0x20 + self._unit,))
        while port.read(time.monotonic() + self.gap):
            # what is left of an answer that came too late
            pass
        parameter = b'E' + pdu.hex().upper().encode()
        port.write(b'\x04' + address + parameter + b'\x05')
        sent = time.monotonic()
        frame, first = b'', float('inf')
        until = sent + _FIRST
        while len(frame) < _MOST and (data := port.read(until)):
            now = time.monotonic()
            first = min(first, now - sent)
            frame, until = frame + data, now + _LAST
            if frame == address + NAK or len(frame) == _REPLY:
                break
        if frame == address + NAK:
            return Answer(NAK, frame, first)
        head = address + b'\x02' + parameter + b'='
        whole = len(frame) == _REPLY and frame.startswith(head) and frame[12:13] == b'\x03'
        right = whole and functools.reduce(operator.xor, frame[2:13]) == frame[13]
        try:
            word = bytes.fromhex(frame[8:12].decode('ascii')) if right else b''
        except ValueError:
            word = b''
        return Answer(word, frame, first)


class TcpWire:
    """A drive behind a Modbus TCP gateway."""

    has_sum = False

    def __init__(self, host: str, port: int, unit: int) -> None:
        self._connection = TcpConnection(host, port)
        self._unit = unit
        self._number = 0
        self._connection.open()
        deadline = time.monotonic() + _CONNECTS_WITHIN
        while not self._connection.connected(deadline):
            if time.monotonic() >= deadline:
                raise ConnectionError(f'{host}:{port} does not answer')

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        """Send a request, and return what came."""
        self._number += 1
        head = struct.pack('>HHHB', self._number, 0, len(pdu) + 1, self._unit)
        self._connection.write(head + pdu)
        sent = time.monotonic()
        frame, first = b'', float('inf')
        until = sent + _FIRST
        while data := self._connection.read(until):
            now = time.monotonic()
            first = min(first, now - sent)
            frame, until = frame + data, now + _LAST
            if len(frame) > 6 and len(frame) == 6 + int.from_bytes(frame[4:6], 'big'):
                break
        belongs = frame[:4] == head[:4] and len(frame) > 7
        return Answer(frame[7:] if belongs else b'', frame, first)

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


def _crc(message: bytes) -> int:
    crc = 0xFFFF
    for byte in message:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc


def _rtu(message: bytes, added: int) -> bytes:
    return message + struct.pack('<H', _crc(message) + added & 0xFFFF)


def _from_rtu(frame: bytes) -> bytes:
    right = len(frame) > 3 and _rtu(frame[:-2], 0) == frame
    return frame[:-2] if right else b''


def _ascii(message: bytes, added: int) -> bytes:
    lrc = -sum(message) + added & 0xFF
    return b':' + (message + bytes((lrc,))).hex().upper().encode() + b'\r\n'


def _from_ascii(frame: bytes) -> bytes:
    try:
        whole = bytes.fromhex(frame.strip().removeprefix(b':').decode('ascii'))
    except ValueError:
        return b''
    right = len(whole) > 2 and sum(whole) & 0xFF == 0
    return whole[:-1] if right else b''
