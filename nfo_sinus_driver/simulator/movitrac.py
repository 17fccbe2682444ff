# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The MOVITRAC's serial protocol: frames, whom they are for, and what comes back [M4 §2.1].

What a drive says to a frame is its :class:`Server`'s business. A frame with a wrong sum, or for
another address, is answered by nobody.
"""

from __future__ import annotations

import abc

from nfo_sinus_driver.simulator import movitrac_frames
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.movitrac_frames import ReturnCode
from nfo_sinus_driver.simulator.protocol import OnSerialLine, Request, Station
from nfo_sinus_driver.simulator.timing import Timing

#: The silence after which the rest of a frame is not waited for (s). No manual says; a busy
#: machine may hold the bytes of one frame apart for less.
_PAUSE = 0.1


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
        """
        Set what stands at an index.

        :raises Nack: it is not set, or there is something to know of it.
        """


class Movitrac(OnSerialLine):
    """Frames between a master and the drives at its line."""

    name = 'movitrac'
    spoken = 'movitrac'

    @staticmethod
    def gap(timing: Timing) -> float:
        """None: the start delimiter begins a frame."""
        return 0.0

    @staticmethod
    def patience(timing: Timing) -> float:
        """A tenth of a second."""
        return _PAUSE

    @staticmethod
    def cut(buffer: bytes) -> int:
        """Return how many bytes belong together, 0 while more must come."""
        return movitrac_frames.length(buffer)

    @staticmethod
    def unwrap(frame: bytes) -> Request | None:
        """Return whom a frame is for, and the frame; ``None`` for what is none."""
        message = movitrac_frames.parse(frame)
        return None if message is None else Request(message.address, frame)

    @staticmethod
    def concerns(station: Station, request: Request) -> bool:
        """Whether the drive is meant; there is no broadcast."""
        return _server(station).any_address or request.address == station.address

    @staticmethod
    def answer(station: Station, request: Request) -> bytes:
        """Let the drive carry out a request; return the answer's frame."""
        server = _server(station)
        message = movitrac_frames.parse(request.body)
        assert message is not None
        try:
            if not message.value:
                return movitrac_frames.data(message.index, server.enquiry(message.index))
            server.select(message.index, message.value)
        except Nack as nack:
            return movitrac_frames.refuse(nack.code)
        return movitrac_frames.acknowledge()


def _server(station: Station) -> Server:
    server = station.servers['movitrac']
    assert isinstance(server, Server)
    return server
