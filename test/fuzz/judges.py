# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What bytes mean, by the standards and the manuals and by nothing of the driver or the simulator.

The judges of the fuzz campaign. They look at whole bytes, slowly; a mutation that by chance is a
right frame again is one to them, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from operator import xor
import re
import struct
from typing import NamedTuple

from support.wire import crc

READ, WRITE_ONE, WRITE_SEVERAL, REPORT_ID, WRITE_AND_READ, IDENTIFY = 3, 6, 16, 17, 23, 43
_REFUSED = 0x80
#: Unit, function, and what a frame of 256 bytes has beside its CRC.
_LONGEST = 254


class Asked(NamedTuple):
    """
    A Modbus request, as far as its answer depends on it.

    :ivar place: the register written to; of IDENTIFY the object asked for.
    :ivar count: how many registers are read; of IDENTIFY the code.
    :ivar data: what is written.
    """

    unit: int
    function: int
    place: int = 0
    count: int = 0
    data: bytes = b''


class Refusal(NamedTuple):
    """An exception, and its code."""

    code: int


class Objects(NamedTuple):
    """What a unit says of itself: numbers and contents, and where to go on."""

    objects: tuple[tuple[int, bytes], ...]
    following: int | None


#: What an answer says: what was read or reported, nothing, the objects, or a refusal.
Meaning = bytes | Objects | Refusal


def meaning(asked: Asked, message: bytes) -> Meaning | None:
    """Return what a message says as the answer to a request; ``None``: it is no answer to it."""
    if len(message) < 2 or message[0] != asked.unit:
        return None
    if message[1] == asked.function | _REFUSED and len(message) == 3:
        return Refusal(message[2])
    if message[1] != asked.function:
        return None
    data = message[2:]
    if asked.function in (READ, WRITE_AND_READ):
        if not data or data[0] != 2 * asked.count or len(data) != 1 + data[0]:
            return None
        return data[1:]
    if asked.function in (WRITE_ONE, WRITE_SEVERAL):
        count = struct.pack('>H', len(asked.data) // 2)
        second = asked.data if asked.function == WRITE_ONE else count
        return b'' if data == struct.pack('>H', asked.place) + second else None
    if asked.function == REPORT_ID:
        return data[1:] if data and data[0] == len(data) - 1 and len(data) <= _LONGEST - 2 else None
    return _objects(asked, data)


def _objects(asked: Asked, data: bytes) -> Objects | None:
    """Return what an answer of function 43/14 says (MODBUS APPLICATION V1.1b §6.21)."""
    if len(data) < 6 or data[:2] != bytes((14, asked.count)) or data[3] not in (0, 0xFF):
        return None
    objects, rest = [], data[6:]
    for _ in range(data[5]):
        if len(rest) < 2 or len(rest) < 2 + rest[1]:
            return None
        objects.append((rest[0], rest[2 : 2 + rest[1]]))
        rest = rest[2 + rest[1] :]
    if rest or len(data) > _LONGEST - 2:
        return None
    if asked.count == 4 and [number for number, _ in objects] != [asked.place]:
        return None
    return Objects(tuple(objects), data[4] if data[3] else None)


def rtu_message(frame: bytes) -> bytes | None:
    """Return the message of an RTU frame; ``None`` if it is damaged."""
    return frame[:-2] if len(frame) >= 4 and crc(frame) == 0 else None


def seal_rtu(message: bytes) -> bytes:
    """Return the RTU frame of a message."""
    return message + crc(message).to_bytes(2, 'little')


def ascii_message(frame: bytes) -> bytes | None:
    """Return the message of an ASCII frame; ``None`` if it is damaged."""
    if not re.fullmatch(rb':([0-9A-Fa-f]{2})+\r\n', frame):
        return None
    data = bytes.fromhex(frame[1:-2].decode())
    return data[:-1] if sum(data) % 256 == 0 else None


def seal_ascii(message: bytes) -> bytes:
    """Return the ASCII frame of a message."""
    return b':' + (message + bytes((-sum(message) % 256,))).hex().upper().encode() + b'\r\n'


def tcp_frames(stream: bytes) -> tuple[list[tuple[int, bytes]], bool]:
    """Return numbers and messages of the frames of a connection, and whether it got out of step."""
    frames = []
    while len(stream) >= 6:
        number, zero, length = struct.unpack('>HHH', stream[:6])
        if zero or not 2 <= length <= _LONGEST:
            return frames, True
        if len(stream) < 6 + length:
            break
        frames.append((number, stream[6 : 6 + length]))
        stream = stream[6 + length :]
    return frames, False


def seal_tcp(number: int, message: bytes) -> bytes:
    """Return the TCP frame of a message."""
    return struct.pack('>HHH', number & 0xFFFF, 0, len(message) & 0xFFFF) + message


class Classic(NamedTuple):
    """
    A message of Classic, and where in the bytes it stands.

    :ivar kind: ``enquiry``, ``select``, ``value``, ``ack`` or ``nak``.
    """

    begin: int
    end: int
    kind: str
    unit: int
    number: int = 0
    word: int = 0


_BODY = rb'([Ee]([0-9A-Fa-f]{4})=([0-9A-Fa-f]{4})\x03)(.)'
#: All messages at all places, those that overlap included ([M0 §6.1.3], [M2 §5]).
_TEXT = re.compile(rb'(?s)(?=(\x04?)([ -\x7f])\x02' + _BODY + rb')')
_ENQUIRY = re.compile(rb'(?=\x04([ -\x7f])[Ee]([0-9A-Fa-f]{4})\x05)')
_VERDICT = re.compile(rb'(?=([ -\x7f])([\x06\x15]))')
_ENQUIRY_LENGTH, _TEXT_LENGTH = 8, 14


def bcc(body: bytes) -> int:
    """Return the check sum of what lies between STX, excluded, and ETX, included [C44]."""
    return reduce(xor, body)


def classic_messages(stream: bytes) -> Iterator[Classic]:
    """Yield every message that can be read anywhere in the bytes, with its check sum right."""
    for match in _TEXT.finditer(stream):
        if bcc(match[3]) == match[6][0]:
            begin, is_select = match.start(), len(match[1])
            end = begin + is_select + _TEXT_LENGTH
            kind = 'select' if is_select else 'value'
            number, word = int(match[4], 16), int(match[5], 16)
            yield Classic(begin, end, kind, match[2][0] - 0x20, number, word)
    for match in _ENQUIRY.finditer(stream):
        begin = match.start()
        number = int(match[2], 16)
        yield Classic(begin, begin + _ENQUIRY_LENGTH, 'enquiry', match[1][0] - 0x20, number)
    for match in _VERDICT.finditer(stream):
        kind = 'ack' if match[2] == b'\x06' else 'nak'
        yield Classic(match.start(), match.start() + 2, kind, match[1][0] - 0x20)


def seal_classic(message: bytes) -> bytes:
    """Return a Classic message with the check sum that it needs, if it needs one."""
    text = message.partition(b'\x02')[2]
    return message + bytes((bcc(text),)) if text else message


class Movitrac(NamedTuple):
    """
    A frame of the MOVITRAC's protocol, and where in the bytes it stands.

    :ivar kind: ``enquiry``, ``select``, ``value``, ``ack`` or ``nack``.
    :ivar number: the index, or the return code.
    """

    begin: int
    end: int
    kind: str
    number: int = 0
    value: bytes = b''


_ANY = rb'(.{2})(.{4})'
_LONG = rb'(.{2})(.{8})'
#: What stands before the sum, by kind [M4 §2.1.1]; only addresses that there are.
_MOVITRAC = (
    ('enquiry', re.compile(rb'(?s)\xb5[\x00-\x3f](.{2})()')),
    ('value', re.compile(rb'(?s)\xc8' + _ANY)),
    ('value', re.compile(rb'(?s)\xac' + _LONG)),
    ('select', re.compile(rb'(?s)\xa9[\x00-\x3f]' + _ANY)),
    ('select', re.compile(rb'(?s)\xad[\x00-\x3f]' + _LONG)),
    ('ack', re.compile(rb'(?s)\xd2()()')),
    ('nack', re.compile(rb'(?s)\xf3(.)()')),
)
#: The bytes with which a frame begins.
MOVITRAC_STARTS = frozenset(b'\xb5\xc8\xac\xa9\xad\xd2\xf3')


def movitrac_frames(stream: bytes) -> Iterator[Movitrac]:
    """Yield every frame that can be read anywhere in the bytes, with its sum right [C85]."""
    for begin in range(len(stream)):
        for kind, shape in _MOVITRAC:
            match = shape.match(stream, begin)
            if match and seal_movitrac(match[0]) == stream[begin : match.end() + 1]:
                number = int.from_bytes(match[1], 'big')
                yield Movitrac(begin, match.end() + 1, kind, number, match[2])


def seal_movitrac(message: bytes) -> bytes:
    """Return a frame with the sum that it needs."""
    return message + bytes((sum(message) % 256,))
