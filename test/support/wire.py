# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What requests on a line mean, by the manuals and by nothing of the driver."""

from __future__ import annotations

from collections.abc import Mapping
import functools
from functools import reduce
from operator import xor
import re
import struct
from typing import NamedTuple

from nfo_sinus_driver.catalog import load_family

#: Protocols whose frames are kept apart by silence.
WITH_GAP = frozenset(('modbus_rtu',))

_READ = 3
_WRITE_ONE = 6
_WRITE_SEVERAL = 16
_WRITE_AND_READ = 23
#: Who are you: function and data [M0 §6.2.4].
_REPORT_SLAVE_ID = bytes((17,))
_READ_DEVICE = frozenset(
    bytes((43, 14, code, first)) for code in (1, 2, 4) for first in range(7)
)
_ENQUIRY = re.compile(rb'\x04([ -\x7f])E([0-9A-F]{4})\x05', re.DOTALL)
_SELECT = re.compile(rb'\x04([ -\x7f])\x02(E([0-9A-F]{4})=([0-9A-F]{4})\x03)(.)', re.DOTALL)
#: ENQUIRY, SELECT and LONG_SELECT: what is between start delimiter and sum [M4 §2.1.1].
_MOVITRAC = {0xB5: '>BH', 0xA9: '>BH2H', 0xAD: '>BH4H'}
#: The addresses that a drive may have [M4 §2.3.1].
_MOVITRACS = range(64)


class Request(NamedTuple):
    """
    A read or a write.

    :ivar place: the register or the Classic id of the first word; the index. Of CANopen it is the
        register of the same parameter, and its words are those of Modbus: one instance has all of
        its addresses by formula [M0 §6.2.5], [M0 §6.4.3]; an object of the drive profile, which
        only CANopen has, is its own place.
    :ivar count: how many registers, else 1.
    :ivar words: what is written, ``None`` for a read.
    :ivar source: place and count of what is read in the same transaction as the write.
    """

    unit: int
    place: int
    count: int
    words: tuple[int, ...] | None
    source: tuple[int, int] | None = None


#: The objects of the drive profile [M0 table 11], and how many words of 16 bits each of its values
#: has at most (CiA 402).
PROFILE: Mapping[int, int] = {
    **dict.fromkeys((*range(0x603F, 0x6045), 0x605B, 0x605C, 0x6060, 0x6061, 0x6071, 0x6077), 1),
    **dict.fromkeys((0x6046, 0x6048, 0x6049, 0x604C, 0x6075, 0x6076, 0x6087, 0x6502), 2),
    0x6402: 1,
}


def understand(data: bytes, protocol: str) -> Request | None:
    """
    Return what a request asks for; ``None`` if it only asks the drive who it is, or on CANopen is
    about the node and not the drive.

    :raises ValueError: it is no request for parameters; says why.
    """
    if protocol == 'classic':
        return _of_classic(data)
    if protocol == 'movitrac':
        return _of_movitrac(data)
    if protocol == 'canopen':
        return _of_canopen(data)
    return _of_message(_message(data, protocol))


def _message(data: bytes, protocol: str) -> bytes:
    """Return unit, function and data of a Modbus request."""
    if protocol == 'modbus_rtu':
        if crc(data):
            raise ValueError('has a wrong CRC')
        return data[:-2]
    if protocol == 'modbus_ascii':
        if not re.fullmatch(rb':([0-9A-F]{2})+\r\n', data):
            raise ValueError('is no frame of upper-case digits')
        message = bytes.fromhex(data[1:-2].decode())
        if sum(message) % 256:
            raise ValueError('has a wrong LRC')
        return message[:-1]
    if protocol != 'modbus_tcp':
        raise LookupError(f'what is {protocol}?')
    _, zero, length = struct.unpack('>HHH', data[:6])
    if zero or length != len(data) - 6:
        raise ValueError('has a wrong head')
    return data[6:]


def crc(data: bytes) -> int:
    """Return the CRC of Modbus; 0 of what ends with its own."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value


def _of_message(message: bytes) -> Request | None:
    if message[1:] == _REPORT_SLAVE_ID or message[1:] in _READ_DEVICE:
        return None
    unit, function = message[:2]
    if function not in (_READ, _WRITE_ONE, _WRITE_SEVERAL, _WRITE_AND_READ):
        raise ValueError(f'function {function} is not for parameters')
    if function == _WRITE_AND_READ:
        return _of_both(unit, message)
    register, second = struct.unpack('>HH', message[2:6])
    if function == _READ:
        return Request(unit, register, second, None)
    if function == _WRITE_ONE:
        return Request(unit, register, 1, (second,))
    words = struct.unpack(f'>{second}H', message[7 : 7 + 2 * second])
    return Request(unit, register, second, words)


def _of_both(unit: int, message: bytes) -> Request:
    source, wanted, register, count = struct.unpack('>4H', message[2:10])
    words = struct.unpack(f'>{count}H', message[11 : 11 + 2 * count])
    return Request(unit, register, count, words, (source, wanted))


def _of_classic(data: bytes) -> Request:
    if match := _ENQUIRY.fullmatch(data):
        return Request(match[1][0] - 0x20, int(match[2], 16), 1, None)
    match = _SELECT.fullmatch(data)
    if match is None:
        raise ValueError('is neither ENQUIRY nor SELECT')
    if reduce(xor, match[2]) != match[5][0]:
        raise ValueError('has a wrong BCC')
    return Request(match[1][0] - 0x20, int(match[3], 16), 1, (int(match[4], 16),))


def _of_movitrac(data: bytes) -> Request:
    shape = _MOVITRAC.get(data[0])
    if shape is None or len(data) != struct.calcsize(shape) + 2:
        raise ValueError('is neither ENQUIRY nor SELECT')
    if sum(data[:-1]) % 256 != data[-1]:
        raise ValueError('has a wrong sum')
    unit, index, *words = struct.unpack(shape, data[1:-1])
    if unit not in _MOVITRACS:
        raise ValueError(f'is for address {unit}')
    return Request(unit, index, 1, tuple(words) or None)


#: The frames of a client that are no requests: network management, its own heartbeat, the asking
#: for the state of a node, which has no data.
_NETWORK_MANAGEMENT, _ERROR_CONTROL, _REQUESTS = 0x000, 0x700, 0x600
_NODES = range(1, 128)
#: Objects of the communication profile, and of the drive.
_OF_THE_NODE, _OF_THE_DRIVE = range(0x1000, 0x2000), range(0x2001, 0x2F00)
#: Where the error log begins, as printed and by formula [C2], and on Modbus.
_LOGS, _LOG_REGISTER, _LOG_ENTRIES = (0x2F7C, 0x4F7D), 0xC000, 32
#: Commands of a client: it writes, it reads; anything else goes on with what has begun, or ends it.
_DOWNLOAD, _UPLOAD = 1, 2


def _of_canopen(data: bytes) -> Request | None:
    identifier, message = int.from_bytes(data[:2], 'big'), data[2:]
    unit = identifier - _REQUESTS
    if unit not in _NODES:
        known = identifier == _NETWORK_MANAGEMENT or identifier - _ERROR_CONTROL in _NODES
        if not known:
            raise ValueError(f"has identifier {identifier:03X}h, which is no client's")
        return None
    if len(message) != 8:
        raise ValueError(f'has {len(message)} bytes, and a request has eight')
    command = message[0] >> 5
    index, sub_index = int.from_bytes(message[1:3], 'little'), message[3]
    if command not in (_DOWNLOAD, _UPLOAD) or index in _OF_THE_NODE:
        return None
    register, count = _register(index, sub_index)
    if command == _UPLOAD:
        return Request(unit, register, count, None)
    if not message[0] & 2:
        raise ValueError('writes more than four bytes, which no parameter has')
    value = message[4 : 8 - (message[0] >> 2 & 3 if message[0] & 1 else 0)]
    number = int.from_bytes(value, 'little', signed=True)
    words = struct.unpack('<2H', (number & 0xFFFF_FFFF).to_bytes(4, 'little'))
    return Request(unit, register, count, words[:count])


def _register(index: int, sub_index: int) -> tuple[int, int]:
    """Return the register of an object, and how many there are of it."""
    for first in _LOGS:
        if index - first in range(_LOG_ENTRIES):
            return _LOG_REGISTER + 4 * (index - first), 2
    if index in PROFILE:
        return index, PROFILE[index]
    if index not in _OF_THE_DRIVE:
        raise ValueError(f'is about object {index:04X}h, which is no parameter')
    base = 0x210 + 4 * (index - 0x2001)
    counts = _counts()
    # the second value stands behind the first
    register = base if sub_index < 2 else base + counts.get(base, 2)
    return register, counts.get(register, 1)


@functools.cache
def _counts() -> Mapping[int, int]:
    """Return how many registers each parameter has, by the first one; of a ramp the second half."""
    rows = load_family('sinus_g2').values()
    places = [row.at('modbus') for row in rows if 'modbus' in row.addresses]
    return {place.index: place.codec.size // 2 for place in places}
