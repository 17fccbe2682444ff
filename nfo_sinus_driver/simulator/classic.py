# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The Classic protocol: messages, whom they are for, and what comes back ([M0 §6.1], [M2]).

What a drive says to a message is its :class:`Server`'s business.
"""

from __future__ import annotations

import abc

from nfo_sinus_driver.simulator import classic_frames
from nfo_sinus_driver.simulator.classic_frames import BROADCAST, POINT_TO_POINT, LineError
from nfo_sinus_driver.simulator.protocol import OnSerialLine, Request, Station
from nfo_sinus_driver.simulator.timing import Timing

#: How long the rest of a message may take (s). No manual says [C86].
_PAUSE = 1.0


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
        """Take note of a message that is not carried out; return whether it is answered by NAK."""


class Classic(OnSerialLine):
    """Classic messages: whom they are for, and what the drive says to them."""

    name = 'classic'
    spoken = 'classic'

    @staticmethod
    def gap(timing: Timing) -> float:
        """None: EOT begins a message."""
        return 0.0

    @staticmethod
    def patience(timing: Timing) -> float:
        """A second."""
        return _PAUSE

    @staticmethod
    def cut(buffer: bytes) -> int:
        """Return how many bytes belong together, 0 while more must come."""
        return classic_frames.length(buffer)

    @staticmethod
    def unwrap(frame: bytes) -> Request | None:
        """Return whom a message is for, and the message; ``None`` if it does not tell."""
        address = classic_frames.address(frame)
        if address is None:
            return None
        return Request(address, frame, whole=not classic_frames.parse(frame).wrong)

    @staticmethod
    def concerns(station: Station, request: Request) -> bool:
        """Whether the drive is meant; an ENQUIRY to all is for nobody [C86]."""
        if request.address == BROADCAST:
            return classic_frames.is_select(request.body)
        return request.address in (POINT_TO_POINT, station.address)

    @staticmethod
    def answer(station: Station, request: Request) -> bytes:
        """Let the drive carry out a message; return the answer, empty if there is none."""
        server = station.servers['classic']
        assert isinstance(server, Server)
        small = server.lower_case
        sender = station.address if server.own_address else request.address
        message = classic_frames.parse(request.body, small_letters=small)
        to_all = request.address == BROADCAST
        answer = b''
        try:
            if message.wrong:
                raise Wrong(message.wrong)
            if message.value is None:
                word = server.enquiry(message.id)
                answer = classic_frames.reply(sender, message.id, word, small_letters=small)
            else:
                server.select(message.id, message.value, to_all=to_all)
                answer = classic_frames.acknowledge(sender, True)
        except Wrong as wrong:
            if server.refused(wrong.flag):
                answer = classic_frames.acknowledge(sender, False)
        return b'' if to_all else answer
