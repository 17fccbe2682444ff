# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Frames of a CAN bus, and what carries them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

#: The most bytes that a frame carries.
MOST_DATA = 8
#: The identifiers of standard frames; CANopen has no others.
IDENTIFIERS = range(0x800)
#: What the bits of an identifier are compared by where only its function code counts.
FUNCTION_CODE = 0x780


class Frame(NamedTuple):
    """
    A standard frame.

    :ivar identifier: which of :data:`IDENTIFIERS`; the least has precedence.
    :ivar remote: it has no data, but asks for that of the same length; only ever sent.
    """

    identifier: int
    data: bytes
    remote: bool = False


#: What is wrong where frames do not leave.
CANNOT_SEND = 'frames do not leave: is anybody else on the bus, with this bit rate?'


class CanPort(Protocol):
    """
    What carries frames.

    :ivar trouble: what keeps frames off the bus, as far as it knows; ``''``: nothing.
    """

    trouble: str

    def open(self) -> None:
        """
        Open it.

        :raises PortError: it is absent, not permitted, in use, or unable to do the settings.
        """

    def close(self) -> None:
        """Close it; harmless when it is closed already."""

    def send(self, frame: Frame) -> None:
        """
        Hand a frame over; :attr:`trouble` says where it could not leave.

        :raises PortError: it is gone.
        """

    def receive(self, until: float) -> Sequence[Frame]:
        """
        Return what has come; wait for the first frame until a moment of the clock, s.

        :returns: none when the time is over, or when what came was no whole frame.
        :raises PortError: it is gone.
        """
