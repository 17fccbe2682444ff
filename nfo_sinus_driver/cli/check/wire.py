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

from nfo_sinus_driver.link.canopen.can import CanPort, Frame
from nfo_sinus_driver.link.ports.port import Port
from nfo_sinus_driver.link.ports.tcp_connection import Connection

#: How long the first byte is waited for at least, and a byte after the last one, s.
FIRST, _LAST = 0.5, 0.05
#: The longest answer of Modbus.
_MOST = 260
_CONNECTS_WITHIN = 5.0
#: From one request to a gateway or PLC to the next at least, s, for it has other work [C118].
_EVERY = 0.02
#: Exceptions of a gateway: no path to the drive, or no answer of it.
_OF_GATEWAY = (b'\x0a', b'\x0b')
#: What a Classic drive answers where there is no such parameter, and how long a REPLY is.
NAK = b'\x15'
_REPLY = 14
#: Start delimiters of the MOVITRAC: what asks, and how long the answer is that each begins.
_ENQUIRY, _NACK = 0xB5, 0xF3
_ANSWERS = {0xC8: 8, 0xAC: 12, _NACK: 3}
#: What SDO frames begin with, of the client and of the server; an abort.
_REQUESTS, _ANSWERED = 0x600, 0x580
_UPLOAD, _ABORT, _ABORTED = b'\x40', b'\x80', 5
#: How much is added to the sum of a frame that is to be none.
_SPOILED = 0x0101


class Answer(NamedTuple):
    """
    What came for one request.

    :ivar pdu: function and data, on other lines than Modbus what their wire says; nothing: no frame
        that belongs to the request.
    :ivar frame: every byte that came.
    :ivar first: from the last byte sent to the first that came, s; infinite: none did.
    """

    pdu: bytes
    frame: bytes
    first: float

    @property
    def refused_with(self) -> int | None:
        """The exception code, if it is a refusal; of CANopen the abort code."""
        if len(self.pdu) == _ABORTED and self.pdu[:1] == _ABORT:
            return int.from_bytes(self.pdu[1:], 'big')
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


class _OnPort:
    """
    A drive on a serial line; each request waits until the line was silent for a while.

    An adapter may return every byte that is sent: the first read tells, whose answer is another.

    :ivar gap: the least silence before a request, s.
    """

    has_sum = True

    def __init__(self, port: Port, unit: int, gap: float, first: float) -> None:
        self._port = port
        self._unit = unit
        self.gap = gap
        #: How long the first byte is waited for, s.
        self._first = first
        self._echoes: bool | None = None

    def _send(self, request: bytes, is_whole: Callable[[bytes], bool]) -> tuple[bytes, float]:
        """Send a request; return what came for it, without an echo, and after how long, s."""
        port = self._port
        while port.read(time.monotonic() + self.gap):
            # what is left of an answer that came too late
            pass
        port.write(request)
        sent = time.monotonic()
        came, first = b'', float('inf')
        until = sent + self._first
        while len(came) < 3 * _MOST and (data := port.read(until)):
            now = time.monotonic()
            came += data
            if self._echoes is None and is_whole(came) and came != request:
                self._echoes = False
            if self._echoes is None and came.startswith(request) and is_whole(came[len(request) :]):
                self._echoes = True
            answer = came[len(request) :] if self._echoes else came
            if answer and (self._echoes is not None or not request.startswith(answer)):
                first, until = min(first, now - sent), now + _LAST
            # the first request is a read, whose echo is not its answer
            if is_whole(answer) and self._echoes is not None:
                break
        return came[len(request) :] if self._echoes else came, first


class SerialWire(_OnPort):
    """A drive on a Modbus RTU or ASCII line."""

    def __init__(
        self, port: Port, unit: int, gap: float, first: float, *, ascii_frames: bool
    ) -> None:
        super().__init__(port, unit, gap, first)
        self._pack: Callable[[bytes, int], bytes] = _ascii if ascii_frames else _rtu
        self._unpack = _from_ascii if ascii_frames else _from_rtu

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        """Send a request, and return what came."""
        message = bytes((self._unit,)) + pdu
        request = self._pack(message, _SPOILED if spoiled else 0)
        frame, first = self._send(request, lambda came: bool(self._unpack(came)))
        answer = self._unpack(frame)
        belongs = answer[:1] == message[:1] and answer[1:2] in (pdu[:1], bytes((pdu[0] | 0x80,)))
        return Answer(answer[1:] if belongs else b'', frame, first)


class ClassicWire(_OnPort):
    """
    A drive on a Classic line.

    A request is the number of a parameter, in two bytes; an answer its word, in two bytes, or NAK.
    """

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        """Send an ENQUIRY, which has no sum, and return what came."""
        assert not spoiled, 'an ENQUIRY has no sum'
        address = bytes((0x20 + self._unit,))
        parameter = b'E' + pdu.hex().upper().encode()
        frame, first = self._send(
            b'\x04' + address + parameter + b'\x05',
            lambda came: came.startswith(address) and (
                came == address + NAK or len(came) == _REPLY
            ),
        )
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


class MovitracWire(_OnPort):
    """
    A drive on the line of a MOVITRAC.

    A request is the index of a parameter, in two bytes; an answer its four or eight bytes, or F3h
    and a return code.
    """

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        """Send an ENQUIRY, and return what came."""
        head = bytes((_ENQUIRY, self._unit)) + pdu
        total = sum(head) + (_SPOILED if spoiled else 0) & 0xFF
        frame, first = self._send(head + bytes((total,)), lambda came: bool(_summed(came)))
        body = _summed(frame)
        # a refusal does not say of what
        if body[:1] == bytes((_NACK,)):
            return Answer(body, frame, first)
        return Answer(body[3:] if body[1:3] == pdu else b'', frame, first)


class CanWire:
    """
    A node on a CAN bus.

    A request is an object, index and sub-index, in three bytes; an answer 40h and its bytes, the
    low one first, or 80h and the abort code. What is longer than four bytes is none.
    """

    has_sum = False

    def __init__(self, port: CanPort, unit: int, first: float) -> None:
        self._port = port
        self._unit = unit
        self._first = first

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        """Send a request to read, and return what came about that object."""
        place = pdu[1::-1] + pdu[2:]
        self._port.send(Frame(_REQUESTS + self._unit, _UPLOAD + place + bytes(4)))
        sent = time.monotonic()
        until = sent + self._first
        while time.monotonic() < until:
            for identifier, data, *_ in self._port.receive(until):
                if identifier == _ANSWERED + self._unit and data[1:4] == place and len(data) == 8:
                    return Answer(_from_sdo(data), data, time.monotonic() - sent)
        return Answer(b'', b'', float('inf'))


class TcpWire:
    """A drive behind a Modbus TCP gateway, whose own refusals are no answer of the drive."""

    has_sum = False

    def __init__(self, connection: Connection, unit: int, first: float) -> None:
        self._connection = connection
        self._unit = unit
        self._first = first
        self._number = 0
        #: When the last request was sent.
        self._sent = float('-inf')
        #: What has come and is no whole frame yet.
        self._rest = b''
        connection.open()
        deadline = time.monotonic() + _CONNECTS_WITHIN
        while not connection.connected(deadline):
            if time.monotonic() >= deadline:
                raise ConnectionError('the gateway does not answer')

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        """Send a request, and return what came; what came for one before is passed over."""
        self._number = self._number % 0xFFFF + 1
        head = struct.pack('>HHHB', self._number, 0, len(pdu) + 1, self._unit)
        time.sleep(max(0.0, self._sent + _EVERY - time.monotonic()))
        self._connection.write(head + pdu)
        self._sent = sent = time.monotonic()
        until = sent + self._first
        while data := self._connection.read(until):
            now = time.monotonic()
            self._rest += data
            while len(self._rest) > 6 and len(self._rest) >= (end := _end_of(self._rest)):
                frame, self._rest = self._rest[:end], self._rest[end:]
                if frame[:4] == head[:4]:
                    answer = frame[7:]
                    is_gateway = answer[1:] in _OF_GATEWAY and answer[0] & 0x80
                    return Answer(b'' if is_gateway else answer, frame, now - sent)
        return Answer(b'', b'', float('inf'))


def _end_of(frames: bytes) -> int:
    return 6 + int.from_bytes(frames[4:6], 'big')


def _summed(frame: bytes) -> bytes:
    """Return the answer of a MOVITRAC without its sum, nothing if it is none."""
    whole = bool(frame) and len(frame) == _ANSWERS.get(frame[0])
    return frame[:-1] if whole and sum(frame[:-1]) & 0xFF == frame[-1] else b''


def _from_sdo(data: bytes) -> bytes:
    command = data[0]
    if data[:1] == _ABORT:
        return _ABORT + data[:3:-1]
    if command & 0xE2 != 0x42:
        return b''
    # the count of bytes that are empty, if it is said
    return _UPLOAD + (data[4 : 8 - (command >> 2 & 3)] if command & 1 else data[4:])


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
