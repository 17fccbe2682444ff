# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a line has to know about a protocol, and about who is at the line."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol as Interface

from nfo_sinus_driver.simulator.line_faults import Reply
from nfo_sinus_driver.simulator.timing import Timing


@dataclass(frozen=True)
class Request:
    """
    A frame that came in.

    :ivar address: whom it is for.
    :ivar body: what the protocol made of the rest.
    :ivar whole: it arrived undamaged; a drive may yet have something to say to one that did not.
    :ivar transaction: what its answer is known by, where it is numbered.
    """

    address: int
    body: bytes
    whole: bool = True
    transaction: int = 0


class Station(Interface):
    """Who is at a line: a drive, or what stands between the line and the drives."""

    @property
    def address(self) -> int:
        """The address that is in effect."""

    @property
    def servers(self) -> Mapping[str, object]:
        """What answers the requests, by the protocols of the tables."""

    @property
    def listening(self) -> bool:
        """Whether it hears the line and answers."""

    @property
    def response_time(self) -> float:
        """How long it waits before it answers (s)."""

    def hears(self, protocol: str, timing: Timing) -> bool:
        """Whether it is set to this protocol, speed and format."""

    def note_frame(self) -> None:
        """Record that a valid frame addressed to it arrived."""

    def advance_to(self, now: float) -> None:
        """Catch up with the caller's clock (s); the first call only sets the clock."""


class Protocol(abc.ABC):
    """
    How frames look, whom they concern and what comes back; by default as on a plain wire.

    :param wait: how long a gateway waits for a drive (s), before it says that there was none.
    """

    name: ClassVar[str]
    #: The protocol that the drives themselves speak: the one behind a gateway.
    spoken: ClassVar[str]
    #: Bytes go over a serial line, not through a gateway.
    serial: ClassVar[bool] = True
    #: The silence after which what is no whole frame is given up (s).
    pause: ClassVar[float] = 1.0

    def __init__(self, wait: float = 0.0) -> None:
        self.wait = wait

    def gap(self, timing: Timing) -> float:
        """The silence that a drive keeps between two frames (s): none where a byte begins one."""
        return 0.0

    def patience(self, timing: Timing) -> float:
        """The silence after which what is no whole frame is given up (s)."""
        return self.pause

    @staticmethod
    @abc.abstractmethod
    def unwrap(frame: bytes) -> Request | None:
        """Return what the bytes say; ``None`` when they say nothing."""

    @abc.abstractmethod
    def cut(self, buffer: bytes) -> int:
        """Return how many bytes at the beginning belong together; 0 while more must come."""

    @staticmethod
    def concerns(station: Station, request: Request) -> bool:
        """Whether the station is meant, alone or with others."""
        return request.address == station.address

    @abc.abstractmethod
    def answer(self, station: Station, request: Request) -> bytes:
        """Let the station carry out a request; return its answer's frame, perhaps none."""

    def instead(self, request: Request, there: bool) -> Reply | None:
        """
        Return what comes when no answer of a station does: a gateway's; on a wire, silence.

        :param there: there is such a station, though it keeps silent.
        """
        return None
