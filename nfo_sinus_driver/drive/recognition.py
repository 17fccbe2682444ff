# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Whether it is known what answers at an address: before, nothing is written there."""

from __future__ import annotations

import math

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive.events import Cause, DriveError, Report


class Recognition:
    """
    Whether the drive at an address was recognised; for coroutines on the bus.

    To a drive of another make a stop may be a run command. So only one is written to that was
    recognised since the port was opened, and was not silent since for so long that another one may
    be in its place (``bus.scheduler.EXCHANGE``).

    :param enable_input: what keeps its motor still, for an operator.
    """

    def __init__(self, bus: Bus, unit: int, enable_input: str) -> None:
        self._bus = bus
        self._unit = unit
        self._enable_input = enable_input
        self._since = math.nan

    @property
    def holds(self) -> bool:
        """It was recognised, and no other can be in its place by now."""
        return self._is_same_since(self._since)

    @property
    def since_port_opened(self) -> bool:
        """It was recognised since the port was opened; another one may be in its place by now."""
        return self._since >= self._bus.silences.opened_at

    def begin(self) -> None:
        """Note that all was read just now that tells its family."""
        self._since = self._bus.now()

    def end(self) -> None:
        """Note that another one answers."""
        self._since = math.nan

    def require(self, began: float = math.inf) -> None:
        """
        Make sure, at the moment of sending, that it may be written to (DriveError: not).

        :param began: when the first of several writes that belong together was wanted, s.
        """
        if not self.holds or not self._is_same_since(began):
            raise self.error(Report(Cause.NO_ANSWER_YET))

    def _is_same_since(self, at: float) -> bool:
        return at >= self._bus.silences.there_since(self._unit, self._bus.now())

    def error(self, why: Report) -> DriveError:
        """Return the error of a write that is not sent."""
        return DriveError(
            Cause.NOT_RECOGNISED, address=self._unit, why=why, enable_input=self._enable_input
        )
