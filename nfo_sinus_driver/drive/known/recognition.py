# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Whether it is known what answers at an address: before, nothing is written there.

To a drive of another make a stop may be a run command, so whatever writes passes this gate. But
what is owed to a motor that runs is no less: the gate before a stop is the smallest there is.

=======================  ===========================================================================
nothing is known         Nothing is written. All that tells the family is read first.
it is recognised         Anything is written, until another drive may be in its place: its port was
                         opened again, or it was silent for more than 3 s.
it was recognised here   A stop is written as soon as one look shows the same drive again.
a stop became due        It is written twice, whatever has come since: what may be written is judged
                         when it becomes due (:class:`~..motion.stopping.StopSequence`).
=======================  ===========================================================================
"""

from __future__ import annotations

import math

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report


class Recognition:
    """
    Whether the drive at an address was recognised; for coroutines on the bus.

    :param enable_input: what keeps its motor still, for an operator.
    """

    def __init__(self, bus: Bus, unit: int, enable_input: str) -> None:
        self._bus = bus
        self._unit = unit
        self._enable_input = enable_input
        #: When all was read that tells its family, and when one look has shown that it is there.
        self._since = self._looked_at = math.nan

    @property
    def holds(self) -> bool:
        """It was recognised, and no other can be in its place by now."""
        return self._is_same_since(self._since)

    @property
    def allows_stop(self) -> bool:
        """The same, for a stop: it was looked at, or is lost only now."""
        newest = self._since if math.isnan(self._looked_at) else self._looked_at
        return self._is_same_since(newest, to_stop=True)

    @property
    def since_port_opened(self) -> bool:
        """It was recognised since the port was opened; another one may be in its place by now."""
        return self._since >= self._bus.silences.opened_at

    @property
    def was_here(self) -> bool:
        """It was recognised behind this port, however often that was opened since."""
        return self._since >= self._bus.silences.moved_at

    def begin(self) -> None:
        """Note that all was read just now that tells its family."""
        self._since = self._bus.now()
        self._looked_at = math.nan

    def look_again(self) -> None:
        """Note that what was recognised here was seen again just now."""
        self._looked_at = self._bus.now()

    def end(self) -> None:
        """Note that another one answers."""
        self._since = self._looked_at = math.nan

    def require(self, began: float = math.inf) -> None:
        """
        Make sure, at the moment of sending, that it may be written to (DriveError: not).

        :param began: when the first of several writes that belong together was wanted, s.
        """
        if not self.holds or not self._is_same_since(began):
            raise self.error(Report(Cause.NO_ANSWER_YET))

    def _is_same_since(self, at: float, *, to_stop: bool = False) -> bool:
        there_since = self._bus.silences.there_since(
            self._unit, self._bus.now(), to_stop=to_stop
        )
        return at >= there_since

    def error(self, why: Report) -> DriveError:
        """Return the error of a write that is not sent."""
        return DriveError(
            Cause.NOT_RECOGNISED, address=self._unit, why=why, enable_input=self._enable_input
        )
