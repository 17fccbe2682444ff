# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""What every simulated line has, whatever its protocol: a port, its faults, a speed."""

from __future__ import annotations

import abc

from nfo_sinus_driver.simulator.line_faults import LineFaults
from nfo_sinus_driver.simulator.ports import Port, PortError
from nfo_sinus_driver.simulator.timing import Timing

#: How long to wait before a port that could not come back is tried again (s).
_TRY_AGAIN = 0.1


class Wire(abc.ABC):
    """
    A line, and the port that a master opens.

    :ivar name: of its protocol.
    :ivar speed: how fast it is, and in what format, as it is printed.
    """

    name: str
    speed: str

    def __init__(self, port: Port, timing: Timing, faults: LineFaults) -> None:
        self.port = port
        self.timing = timing
        self.faults = faults
        self._gone_until: float | None = None
        self._going = False

    def hang_up(self, until: float) -> None:
        """Let the port disappear, as an adapter that is pulled out, and come back ``until``."""
        # not here: the thread of the line may be waiting for the port
        self._going = True
        self._gone_until = until

    def set_traffic(self, rate: float, now: float) -> None:
        """
        Let others send frames that are for no unit here.

        :param rate: how many a second; 0: none.
        :raises ValueError: there are no others on such a line.
        """
        raise ValueError(f'{self.name} has no frames of others: only a CAN bus has')

    @abc.abstractmethod
    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that were read at ``now``."""

    def act(self, now: float) -> None:
        """Do everything that is due."""
        self._act(now)
        if self._going:
            self._going = False
            self.port.hang_up()
            self._unplugged()
        if self._gone_until is not None and self._gone_until <= now:
            try:
                self.port.come_back()
                self._gone_until = None
            except PortError:
                self._gone_until = now + _TRY_AGAIN

    @property
    def due(self) -> float:
        """When :meth:`act` has something to do again; infinity when nothing is to come."""
        if self._going:
            return float('-inf')
        back = float('inf') if self._gone_until is None else self._gone_until
        return min(self._due, back)

    @abc.abstractmethod
    def _act(self, now: float) -> None:
        """Do what is due on the line."""

    @property
    @abc.abstractmethod
    def _due(self) -> float:
        """When something is due on the line; infinity when nothing is to come."""

    @abc.abstractmethod
    def _unplugged(self) -> None:
        """Record that the port has disappeared."""
