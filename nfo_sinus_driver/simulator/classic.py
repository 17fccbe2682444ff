# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The Classic protocol: messages, whom they are for, and what comes back ([M0 §6.1], [M2]).

Messages are cut by their length: a check sum may be any control character, EOT among them. What a
drive answers is its :class:`Server`'s business.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
import enum
import functools
import operator
import re

from nfo_sinus_driver.simulator.protocol import Protocol, Request, Station

STX, ETX, EOT, ENQ, ACK, NAK = 0x02, 0x03, 0x04, 0x05, 0x06, 0x15

#: Added to an address, so that it is no control character.
_ADDRESS = 0x20
#: All drives answer to this one: it is for a line with one drive [M0 §6.1.4].
POINT_TO_POINT = 0
#: All drives obey a SELECT to this one, and none answers.
BROADCAST = 95
ADDRESSES = range(POINT_TO_POINT, BROADCAST + 1)

_ENQUIRY_LENGTH = 8
_SELECT_LENGTH = 15
_PREFIX = b'E'
_ENQUIRY = re.compile(rb'(?s)..(.)([0-9A-Fa-f]{4})\x05')
_SELECT = re.compile(rb'(?s)..\x02(.)([0-9A-Fa-f]{4})=([0-9A-Fa-f]{4})\x03.')
_SMALL = re.compile(rb'[a-f]')


class LineError(enum.IntFlag):
    """What may go wrong on the line: the flags by which a drive reports it [M2 table 4]."""

    BLOCKED = 1 << 0
    PARITY = 1 << 1
    CHECK_SUM = 1 << 2
    STRUCTURE = 1 << 3
    TIMEOUT = 1 << 4
    PREFIX = 1 << 5
    NOT_PERMITTED = 1 << 6
    UNKNOWN = 1 << 7
    UNREADABLE = 1 << 8
    UNWRITABLE = 1 << 9
    OUT_OF_RANGE = 1 << 10
    OVERRUN = 1 << 14


_NOTHING = LineError(0)


@dataclass(frozen=True)
class Message:
    """
    A message from a master.

    :ivar id: the parameter's number.
    :ivar value: what to set it to; ``None`` in an ENQUIRY.
    :ivar wrong: what is wrong with it, 0 for nothing; the rest counts only then.
    """

    id: int = 0
    value: int | None = None
    wrong: LineError = _NOTHING


def parse(frame: bytes, *, small_letters: bool = True) -> Message:
    """Return what a message says, or what is wrong with it."""
    select = _SELECT.fullmatch(frame)
    match = select or _ENQUIRY.fullmatch(frame)
    if match is None or (not small_letters and _SMALL.search(b''.join(match.groups()[1:]))):
        return Message(wrong=LineError.STRUCTURE)
    if select and check_sum(frame[3:-1]) != frame[-1]:
        return Message(wrong=LineError.CHECK_SUM)
    if match[1] != _PREFIX:
        return Message(wrong=LineError.PREFIX)
    return Message(int(match[2], 16), int(select[3], 16) if select else None)


def check_sum(data: bytes) -> int:
    """Return the BCC of what lies between STX, excluded, and ETX, included [C44]."""
    return functools.reduce(operator.xor, data, 0)


def reply(sender: int, id_: int, word: int, *, small_letters: bool) -> bytes:
    """Return a REPLY: the value of a parameter."""
    digits = '04x' if small_letters else '04X'
    text = _PREFIX + f'{id_:{digits}}={word:{digits}}'.encode('ascii') + bytes([ETX])
    return bytes([sender + _ADDRESS, STX]) + text + bytes([check_sum(text)])


def acknowledge(sender: int, yes: bool) -> bytes:
    """Return ACK or NAK."""
    return bytes([sender + _ADDRESS, ACK if yes else NAK])


class Wrong(Exception):
    """A message that is not carried out, and the flag that says why."""

    def __init__(self, flag: LineError) -> None:
        super().__init__(flag.name)
        self.flag = flag


class Server(abc.ABC):
    """What one drive does with Classic messages; its family says, also what it answers as [C86]."""

    own_address: bool
    lower_case: bool

    @abc.abstractmethod
    def enquiry(self, id_: int) -> int:
        """Return the word that stands at an id (Wrong: it cannot be read)."""

    @abc.abstractmethod
    def select(self, id_: int, word: int, *, to_all: bool) -> None:
        """Set what stands at an id (Wrong: it cannot be set, or not now)."""

    @abc.abstractmethod
    def refused(self, flag: LineError) -> bool:
        """Record a message that is not carried out; return whether it is answered by NAK."""


class Classic(Protocol):
    """Classic messages; no manual says how long the rest of one may take [C86]."""

    name = spoken = 'classic'

    @staticmethod
    def cut(buffer: bytes) -> int:
        """
        Return how many bytes at the beginning belong together, 0 while more must come.

        An EOT where none can be begins a message, and ends what was before it.
        """
        if buffer[0] != EOT:
            return max(buffer.find(EOT), 0)
        whole = _SELECT_LENGTH if buffer[2:3] == bytes([STX]) else _ENQUIRY_LENGTH
        # of the check sum, the last byte of a SELECT, everything is expected
        safe = whole - 1 if whole == _SELECT_LENGTH else whole
        again = buffer.find(EOT, 1, safe)
        if again > 0:
            return again
        return whole if len(buffer) >= whole else 0

    @staticmethod
    def unwrap(frame: bytes) -> Request | None:
        """Return whom a message is for, and the message; ``None`` if it does not say."""
        if len(frame) < 2 or frame[0] != EOT or frame[1] - _ADDRESS not in ADDRESSES:
            return None
        return Request(frame[1] - _ADDRESS, frame, whole=not parse(frame).wrong)

    @staticmethod
    def concerns(station: Station, request: Request) -> bool:
        """Whether the drive is meant; an ENQUIRY to all is for none [C86]."""
        if request.address == BROADCAST:
            return request.body[2:3] == bytes([STX])
        return request.address in (POINT_TO_POINT, station.address)

    @staticmethod
    def answer(station: Station, request: Request) -> bytes:
        """Let the drive carry out a message; return the answer, empty if there is none."""
        server = station.servers['classic']
        assert isinstance(server, Server)
        small = server.lower_case
        sender = station.address if server.own_address else request.address
        message = parse(request.body, small_letters=small)
        to_all = request.address == BROADCAST
        answer = b''
        try:
            if message.wrong:
                raise Wrong(message.wrong)
            if message.value is None:
                word = server.enquiry(message.id)
                answer = reply(sender, message.id, word, small_letters=small)
            else:
                server.select(message.id, message.value, to_all=to_all)
                answer = acknowledge(sender, True)
        except Wrong as wrong:
            if server.refused(wrong.flag):
                answer = acknowledge(sender, False)
        return b'' if to_all else answer
