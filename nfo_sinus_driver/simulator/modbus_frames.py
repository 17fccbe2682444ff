# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus RTU, ASCII and TCP: three ways to pack the same requests."""

from __future__ import annotations

import abc
import binascii
import re

from nfo_sinus_driver.simulator import pymodbus_compat
from nfo_sinus_driver.simulator.line_faults import Reply
from nfo_sinus_driver.simulator.memory import GatewayReason
from nfo_sinus_driver.simulator.modbus import is_write, server
from nfo_sinus_driver.simulator.protocol import Protocol, Request, Station
from nfo_sinus_driver.simulator.timing import Timing

#: All units obey a write to this address, and none answers.
BROADCAST = 0

#: Added to t3.5 before silence is believed: the system may hold bytes of one frame apart (s).
_SLACK = 0.002

#: Length of a request's whole RTU frame by function: fixed, or what the byte count at an index
#: adds to the rest.
_FIXED = dict.fromkeys((1, 2, 3, 4, 5, 6, 8), 8) | {7: 4, 11: 4, 12: 4, 17: 4, 22: 10, 24: 6, 43: 7}
_COUNTED = {15: 6, 16: 6, 20: 2, 21: 2, 23: 10}

_ASCII_FRAME = re.compile(rb':((?:[0-9A-F]{2}){3,})\r\n')

#: Transaction, protocol (0), length of the rest: what precedes the unit.
_MBAP = 6
_MOST_IN_TCP = 254


class _Modbus(Protocol):
    """What the three have in common: an address, a PDU, and that only writes are broadcast."""

    @staticmethod
    def concerns(station: Station, request: Request) -> bool:
        """Whether the drive is meant; only writes are broadcast."""
        return request.address == station.address or _for_all(request)

    def answer(self, station: Station, request: Request) -> bytes:
        """Let the drive carry out a request; return the answer's frame."""
        pdu = server(station).answer(request.body)
        return b'' if not pdu or _for_all(request) else self._framed(request, pdu)

    @abc.abstractmethod
    def _framed(self, request: Request, pdu: bytes) -> bytes:
        """Return the frame that answers a request."""


class ModbusRtu(_Modbus):
    """RTU frames: cut by their length, and by silence where their CRC is not right."""

    name = 'modbus_rtu'
    spoken = 'modbus_rtu'

    @staticmethod
    def gap(timing: Timing) -> float:
        """t3.5."""
        return timing.t35

    @staticmethod
    def patience(timing: Timing) -> float:
        """t3.5, and what a computer needs beyond it."""
        return timing.t35 + _SLACK

    def cut(self, buffer: bytes) -> int:
        """Return the length of the frame at the beginning, 0 while there is none."""
        length = _rtu_length(buffer)
        whole = 0 < length <= len(buffer) and self.unwrap(buffer[:length]) is not None
        return length if whole else 0

    @staticmethod
    def unwrap(frame: bytes) -> Request | None:
        """Return address and PDU of a frame; ``None`` when it is damaged."""
        if len(frame) < 4 or pymodbus_compat.crc(frame[:-2]) != frame[-2:]:
            return None
        return Request(frame[0], frame[1:-2])

    @staticmethod
    def wrap(address: int, pdu: bytes) -> bytes:
        """Return the frame of a PDU."""
        body = bytes([address]) + pdu
        return body + pymodbus_compat.crc(body)

    def _framed(self, request: Request, pdu: bytes) -> bytes:
        return self.wrap(request.address, pdu)


class ModbusAscii(_Modbus):
    """
    ASCII frames: a colon, which begins one, upper-case digits, LRC, CR LF.

    By the standard a frame may pause for a second.
    """

    name = 'modbus_ascii'
    spoken = 'modbus_ascii'

    @staticmethod
    def cut(buffer: bytes) -> int:
        """Return what lies before the next colon, or up to the end of the line."""
        colon = buffer.find(b':', 1)
        end = buffer.find(b'\r\n')
        if colon > 0 and (buffer[:1] != b':' or not 0 < end < colon):
            return colon
        return end + 2 if end > 0 and buffer[:1] == b':' else 0

    @staticmethod
    def unwrap(frame: bytes) -> Request | None:
        """Return address and PDU of a frame; ``None`` when it is damaged."""
        match = _ASCII_FRAME.fullmatch(frame)
        if match is None:
            return None
        data = binascii.unhexlify(match[1])
        if pymodbus_compat.lrc(data[:-1]) != data[-1]:
            return None
        return Request(data[0], data[1:-1])

    @staticmethod
    def wrap(address: int, pdu: bytes) -> bytes:
        """Return the frame of a PDU."""
        return pymodbus_compat.ascii_frame(address, pdu)

    def _framed(self, request: Request, pdu: bytes) -> bytes:
        return self.wrap(request.address, pdu)


class ModbusTcp(_Modbus):
    """Modbus TCP as of a gateway, behind which the drives are on an RTU line; units are drives."""

    name = 'modbus_tcp'
    spoken = 'modbus_rtu'
    serial = False

    @staticmethod
    def gap(timing: Timing) -> float:
        """t3.5: what the drive keeps on the line behind the gateway."""
        return timing.t35

    @staticmethod
    def cut(buffer: bytes) -> int:
        """Return the length of the frame at the beginning, 0 while there is none."""
        if len(buffer) < _MBAP:
            return 0
        rest = int.from_bytes(buffer[4:6], 'big')
        if buffer[2:4] != b'\0\0' or not 2 <= rest <= _MOST_IN_TCP:
            return len(buffer)
        return _MBAP + rest if len(buffer) >= _MBAP + rest else 0

    @staticmethod
    def unwrap(frame: bytes) -> Request | None:
        """Return transaction, unit and PDU; ``None`` when it is no frame of Modbus."""
        rest = int.from_bytes(frame[4:6], 'big')
        if len(frame) < _MBAP + 2 or frame[2:4] != b'\0\0' or len(frame) != _MBAP + rest:
            return None
        return Request(frame[6], frame[7:], transaction=int.from_bytes(frame[:2], 'big'))

    @staticmethod
    def wrap(transaction: int, unit: int, pdu: bytes) -> bytes:
        """Return the frame of a PDU."""
        return pymodbus_compat.tcp_frame(transaction, unit, pdu)

    def instead(self, request: Request, there: bool) -> Reply | None:
        """Say, after having waited, that the drive does not answer; or that there is none."""
        if request.address == BROADCAST:
            return None
        reason = GatewayReason.NO_ANSWER if there else GatewayReason.NO_PATH
        pdu = pymodbus_compat.encode_exception(request.body[0], reason)
        return Reply(self._framed(request, pdu), self.wait if there else 0.0)

    def _framed(self, request: Request, pdu: bytes) -> bytes:
        return self.wrap(request.transaction, request.address, pdu)


class ThroughPlc(ModbusTcp):
    """Modbus TCP as of a PLC, whose units have the blocks of its drives."""

    name = 'telegram1'


def _for_all(request: Request) -> bool:
    """Whether every drive obeys a request and none answers."""
    return request.address == BROADCAST and is_write(request.body)


def _rtu_length(buffer: bytes) -> int:
    """Return how long the request at the beginning is, CRC included; 0 when unknown."""
    if len(buffer) < 2:
        return 0
    function = buffer[1]
    if function in _COUNTED:
        at = _COUNTED[function]
        return at + 1 + buffer[at] + 2 if len(buffer) > at else 0
    return _FIXED.get(function, 0)
