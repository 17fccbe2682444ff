# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Frames of the MOVITRAC's serial protocol, byte by byte [M4 §2.1].

A frame is known by its first byte, the start delimiter, and is cut by the length that goes with it:
nothing else marks its end.
"""

from __future__ import annotations

from dataclasses import dataclass
import enum
import struct


class Start(enum.IntEnum):
    """The start delimiters: what kind of frame it is [M4 §2.1.1]."""

    ENQUIRY = 0xB5
    SELECT = 0xA9
    LONG_SELECT = 0xAD
    DATA = 0xC8
    LONG_DATA = 0xAC
    ACK = 0xD2
    NACK = 0xF3


class ReturnCode(enum.IntEnum):
    """Why a service was not carried out, or what there is to know of it [M4 §2.1.2]."""

    ILLEGAL_INDEX = 0x10
    NOT_IMPLEMENTED = 0x11
    READ_ONLY = 0x12
    LOCKED = 0x13
    FACTORY_SETTING_RUNNING = 0x14
    TOO_LARGE = 0x15
    TOO_SMALL = 0x16
    OPTION_MISSING = 0x17
    SOFTWARE_FAULT = 0x18
    NOT_BY_THIS_INTERFACE = 0x19
    SPEED_CONTROL_ACTIVE = 0x1A
    UNAUTHORIZED = 0x1B
    NOT_INHIBITED = 0x1C
    INVALID_VALUE = 0x1D
    FACTORY_SETTING_STARTED = 0x1E
    NEEDS_4Q_1 = 0x22
    NEEDS_4Q_2 = 0x23
    DC_BRAKING_1_ACTIVE = 0x24
    DC_BRAKING_2_ACTIVE = 0x25
    HOIST_1_ACTIVE = 0x26
    HOIST_2_ACTIVE = 0x27
    VOLATILE = 0x28
    NOT_BY_THIS_INTERFACE_EITHER = 0x29
    SPEED_CONTROL_INACTIVE = 0x2A
    NEEDS_INHIBIT = 0x2B
    SIZE_UP_OR_RAPID_START_1 = 0x2C
    SIZE_UP_OR_RAPID_START_2 = 0x2D
    OPTION_MISSING_TOO = 0x2E
    FOUR_Q_OR_DC_BRAKING_1 = 0x2F
    FOUR_Q_OR_DC_BRAKING_2 = 0x30
    INHIBIT_ACTIVE = 0x31
    SYNCHRONOUS_INACTIVE = 0x32
    SYNCHRONOUS_SLAVE = 0x33
    ILLEGAL_MESSAGE = 0x34


#: The addresses that an inverter can have [M4 §2.3.1].
ADDRESSES = range(64)

#: How many bytes of value a master's frame carries.
_VALUE = {Start.ENQUIRY: 0, Start.SELECT: 4, Start.LONG_SELECT: 8}
#: Start delimiter, address and index.
_HEAD = struct.Struct('>BBH')
_SUM = 1


@dataclass(frozen=True)
class Message:
    """
    What a master wants.

    :ivar address: of which inverter.
    :ivar index: of which parameter.
    :ivar value: the 4 or 8 bytes to set it to; empty to ask for it.
    """

    address: int
    index: int
    value: bytes = b''


def length(buffer: bytes) -> int:
    """Return how many bytes at the beginning belong together, 0 while more must come."""
    whole = _length(buffer[0])
    if whole:
        return whole if len(buffer) >= whole else 0
    return next((place for place, byte in enumerate(buffer) if _length(byte)), len(buffer))


def parse(frame: bytes) -> Message | None:
    """Return what a frame of a master says; ``None`` for any other, and for a wrong sum."""
    if len(frame) != _length(frame[0]) or check_sum(frame[:-1]) != frame[-1]:
        return None
    _, address, index = _HEAD.unpack_from(frame)
    return Message(address, index, frame[_HEAD.size : -_SUM])


def check_sum(data: bytes) -> int:
    """Return the sum of all bytes, without carry."""
    return sum(data) & 0xFF


def data(index: int, value: bytes) -> bytes:
    """Return a DATA frame, or for a value of 8 bytes a LONG_DATA frame."""
    start = Start.LONG_DATA if len(value) == _VALUE[Start.LONG_SELECT] else Start.DATA
    return _summed(struct.pack('>BH', start, index) + value)


def acknowledge() -> bytes:
    """Return an ACK frame."""
    return _summed(bytes([Start.ACK]))


def refuse(code: ReturnCode) -> bytes:
    """Return a NACK frame."""
    return _summed(bytes([Start.NACK, code]))


def _length(start: int) -> int:
    """Return how long a master's frame is, 0 for a byte that begins none."""
    return _HEAD.size + _VALUE[Start(start)] + _SUM if start in _VALUE else 0


def _summed(head: bytes) -> bytes:
    return head + bytes([check_sum(head)])
