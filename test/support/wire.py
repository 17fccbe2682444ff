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

"""What requests on a line mean, by the manuals and by nothing of the driver."""

from __future__ import annotations

from functools import reduce
from operator import xor
import re
import struct
from typing import NamedTuple

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

    :ivar place: the register or the Classic id of the first word; the index.
    :ivar count: how many registers, else 1.
    :ivar words: what is written, ``None`` for a read.
    :ivar source: place and count of what is read in the same transaction as the write.
    """

    unit: int
    place: int
    count: int
    words: tuple[int, ...] | None
    source: tuple[int, int] | None = None


def understand(data: bytes, protocol: str) -> Request | None:
    """
    Return what a request asks for; ``None`` if it only asks the drive who it is.

    :raises ValueError: it is no request for parameters; says why.
    """
    if protocol == 'classic':
        return _of_classic(data)
    if protocol == 'movitrac':
        return _of_movitrac(data)
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
