# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a line has to know about a protocol."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol as Interface

from nfo_sinus_driver.simulator.line_faults import Reply
from nfo_sinus_driver.simulator.timing import Timing


@dataclass(frozen=True)
class Request:
    """
    A frame that came in.

    :ivar address: whom it is for.
    :ivar body: what the protocol made of the rest.
    :ivar whole: it arrived undamaged; a drive may yet have something to say to one that did not.
    """

    address: int
    body: bytes
    whole: bool = True


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

    def heard(self) -> None:
        """Take note that a valid frame addressed to it arrived."""

    def advance_to(self, now: float) -> None:
        """Catch up with the caller's clock (s); the first call only sets the clock."""


class Protocol(Interface):
    """How frames look, whom they concern and what comes back."""

    name: str
    #: The protocol that the drives themselves speak: the one behind a gateway.
    spoken: str
    #: Bytes go over a serial line, not through a gateway.
    serial: bool

    def gap(self, timing: Timing) -> float:
        """The silence that a drive keeps between two frames (s)."""

    def patience(self, timing: Timing) -> float:
        """The silence after which what is no whole frame is given up (s)."""

    def cut(self, buffer: bytes) -> int:
        """How many bytes at the beginning belong together; 0 while only silence can tell."""

    def unwrap(self, frame: bytes) -> Request | None:
        """What the bytes say; ``None`` when they say nothing to anybody."""

    def concerns(self, station: Station, request: Request) -> bool:
        """Whether the station is meant, alone or with others."""

    def answer(self, station: Station, request: Request) -> bytes:
        """Let the station carry out a request; return its answer's frame, perhaps none."""

    def instead(self, request: Request, there: bool) -> Reply | None:
        """
        What comes when no answer of a station does: a gateway has something to say, a wire has not.

        :param there: there is such a station, though it keeps silent.
        """


class OnSerialLine:
    """What all protocols on a wire have in common: silence where nobody answers."""

    serial = True

    @staticmethod
    def instead(request: Request, there: bool) -> Reply | None:
        """Nothing: on a wire, silence is silence."""
        return None
