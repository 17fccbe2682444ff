# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The MOVITRAC's serial protocol: frames, and what a drive answers [M4 §2.1].

A frame is known by its first byte, the start delimiter, and is cut by the length that goes with it:
nothing else marks its end. One with a wrong sum, or for another address, is not answered.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
import enum
import struct

from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.protocol import Protocol, Request, Station


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
    READ_ONLY = 0x12
    LOCKED = 0x13
    FACTORY_SETTING_RUNNING = 0x14
    TOO_LARGE = 0x15
    TOO_SMALL = 0x16
    OPTION_MISSING = 0x17
    NOT_BY_THIS_INTERFACE = 0x19
    UNAUTHORIZED = 0x1B
    NOT_INHIBITED = 0x1C
    INVALID_VALUE = 0x1D
    FACTORY_SETTING_STARTED = 0x1E
    NEEDS_4Q_1 = 0x22
    NEEDS_4Q_2 = 0x23
    HOIST_1_ACTIVE = 0x26
    HOIST_2_ACTIVE = 0x27
    VOLATILE = 0x28
    NEEDS_INHIBIT = 0x2B
    SIZE_UP_OR_RAPID_START_1 = 0x2C
    SIZE_UP_OR_RAPID_START_2 = 0x2D
    FOUR_Q_OR_DC_BRAKING_1 = 0x2F
    FOUR_Q_OR_DC_BRAKING_2 = 0x30
    ILLEGAL_MESSAGE = 0x34


#: The addresses that a drive can have [M4 §2.3.1].
ADDRESSES = range(64)

#: How many bytes of value a master's frame carries.
_VALUE = {Start.ENQUIRY: 0, Start.SELECT: 4, Start.LONG_SELECT: 8}
#: Start delimiter, address and index; and how long a frame is without its value.
_HEAD = struct.Struct('>BBH')
_EMPTY = _HEAD.size + 1


@dataclass(frozen=True)
class Message:
    """
    What a master wants.

    :ivar address: of which drive.
    :ivar index: of which parameter.
    :ivar value: the 4 or 8 bytes to set it to; empty to ask for it.
    """

    address: int
    index: int
    value: bytes = b''


def parse(frame: bytes) -> Message | None:
    """Return what a frame of a master says; ``None`` for any other, and for a wrong sum."""
    if len(frame) != _length(frame[0]) or sum(frame[:-1]) & 0xFF != frame[-1]:
        return None
    _, address, index = _HEAD.unpack_from(frame)
    return Message(address, index, frame[_HEAD.size : -1])


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
    return _EMPTY + _VALUE[Start(start)] if start in _VALUE else 0


def _summed(head: bytes) -> bytes:
    return head + bytes([sum(head) & 0xFF])


class Nack(Refused):
    """A service that is not carried out, or not without a word; ``code`` goes over the line."""

    def __init__(self, code: ReturnCode, text: str) -> None:
        super().__init__(Reason.STATE, text)
        self.code = code


class Server(abc.ABC):
    """
    What one drive does with the parameters that it is asked for; its family says.

    :ivar any_address: it answers whatever address it is asked by, as on RS-232 [M4 §2.4.4].
    """

    any_address: bool

    @abc.abstractmethod
    def enquiry(self, index: int) -> bytes:
        """Return the 4 or 8 bytes that stand at an index (Nack: they cannot be read)."""

    @abc.abstractmethod
    def select(self, index: int, value: bytes) -> None:
        """Set what stands at an index (Nack: it is not set, or there is something to know)."""


class Movitrac(Protocol):
    """Frames between a master and the drives at its line; there is no broadcast."""

    name = spoken = 'movitrac'
    # no manual says; a busy machine may hold the bytes of one frame apart for less
    pause = 0.1

    @staticmethod
    def cut(buffer: bytes) -> int:
        """Return how many bytes belong together, 0 while more must come."""
        if whole := _length(buffer[0]):
            return whole if len(buffer) >= whole else 0
        return next((place for place, byte in enumerate(buffer) if _length(byte)), len(buffer))

    @staticmethod
    def unwrap(frame: bytes) -> Request | None:
        """Return whom a frame is for, and the frame; ``None`` for what is none."""
        message = parse(frame)
        return None if message is None else Request(message.address, frame)

    @staticmethod
    def concerns(station: Station, request: Request) -> bool:
        """Whether the drive is meant."""
        server = station.servers['movitrac']
        assert isinstance(server, Server)
        return server.any_address or request.address == station.address

    @staticmethod
    def answer(station: Station, request: Request) -> bytes:
        """Let the drive carry out a request; return the answer's frame."""
        server, message = station.servers['movitrac'], parse(request.body)
        assert isinstance(server, Server) and message is not None
        try:
            if not message.value:
                return data(message.index, server.enquiry(message.index))
            server.select(message.index, message.value)
        except Nack as nack:
            return refuse(nack.code)
        return acknowledge()
