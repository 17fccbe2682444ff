# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The counters and times of one line, and of each unit on it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
import math

from nfo_sinus_driver.link import Clock, DamagedAnswer, LinkError, NoAnswer, Refused

#: Of how many of the last transactions the round trips are kept: of a line, and of one unit.
_ROUND_TRIPS = 1000
_ROUND_TRIPS_OF_A_UNIT = 200
#: Over how long the utilisation is taken, s.
_WINDOW = 2.0
#: What goes wrong, by the name under which it is counted.
_FAILURES = {'timeouts': NoAnswer, 'damaged': DamagedAnswer, 'refused': Refused}


@dataclass(frozen=True)
class Statistics:
    """
    The figures of a line, or of one unit on it; times in seconds, NaN where not measured yet.

    :ivar utilisation: share of the last two seconds in which the line was in use, or in use for
        this unit, 0 to 1.
    :ivar cycle_time: how long the last round of polling took; of a line, that of its slowest unit.
    :ivar transactions: requests sent, answered or not.
    :ivar foreign_frames: requests of another master on the line; of one unit always 0.
    :ivar reconnects: how often the port was opened again, or the unit was connected to again.
    """

    utilisation: float
    cycle_time: float
    transactions: int
    timeouts: int
    damaged: int
    refused: int
    retries: int
    reconnects: int
    round_trip_min: float
    round_trip_mean: float
    round_trip_median: float
    round_trip_p99: float
    round_trip_max: float
    foreign_frames: int = 0


class Tally:
    """What is counted of a line, or of one unit; of round trips only the last are kept."""

    def __init__(self, round_trips: int = _ROUND_TRIPS) -> None:
        self._counts = dict.fromkeys(('transactions', *_FAILURES), 0)
        self._retries = 0
        #: Every opening or connection but the first is a reconnect.
        self._opened = 0
        #: How long the last round of polling took, s.
        self.cycle_time = math.nan
        self._round_trips: deque[float] = deque(maxlen=round_trips)
        self._busy: deque[tuple[float, float]] = deque()

    def transaction(
        self, now: float, seconds: float, error: LinkError | None, silence: float
    ) -> None:
        """
        Count a transaction that kept the line busy until ``now``, and how it ended.

        :param silence: for how long the line was kept silent for it before, s.
        """
        self._busy.append((now, silence + seconds))
        while self._busy[0][0] < now - _WINDOW:
            self._busy.popleft()
        if error is None or isinstance(error, Refused):
            self._round_trips.append(seconds)
        self._counts['transactions'] += 1
        if error is not None:
            for name, failure in _FAILURES.items():
                self._counts[name] += isinstance(error, failure)

    def opened(self) -> None:
        """Count that the port was opened, or the unit connected to."""
        self._opened += 1

    def retry(self) -> None:
        """Count a request that is sent again."""
        self._retries += 1

    def cycle(self, seconds: float) -> None:
        """Record how long one round of polling took, s."""
        self.cycle_time = seconds

    def statistics(self, cycle_time: float, now: float) -> Statistics:
        """Return the present figures."""
        start = now - _WINDOW
        busy = sum(seconds for end, seconds in self._busy.copy() if end >= start)
        trips = sorted(self._round_trips.copy())
        return Statistics(
            utilisation=min(1.0, busy / _WINDOW),
            cycle_time=cycle_time,
            **self._counts,
            retries=self._retries,
            reconnects=max(0, self._opened - 1),
            round_trip_min=_at(trips, 0.0),
            round_trip_mean=sum(trips) / len(trips) if trips else math.nan,
            round_trip_median=_at(trips, 0.5),
            round_trip_p99=_at(trips, 0.99),
            round_trip_max=_at(trips, 1.0),
        )


def _at(trips: list[float], share: float) -> float:
    """Return the least of some sorted times that this share of them does not exceed."""
    return trips[max(1, math.ceil(share * len(trips))) - 1] if trips else math.nan


class Recorder:
    """Takes the measurements of a line; written by the bus worker alone, read by anyone."""

    def __init__(self, now: Clock) -> None:
        self._now = now
        self._line = Tally()
        self._units: dict[int, Tally] = {}

    def opened(self) -> None:
        """Count that the port was opened."""
        self._line.opened()

    def connected(self, unit: int) -> None:
        """Count that a unit was connected to."""
        self._of(unit).opened()

    def transaction(
        self,
        unit: int,
        now: float,
        seconds: float,
        error: LinkError | None,
        silence: float = 0.0,
    ) -> None:
        """Count a transaction as :meth:`Tally.transaction`."""
        for tally in (self._line, self._of(unit)):
            tally.transaction(now, seconds, error, silence)

    def retry(self, unit: int) -> None:
        """Count a request to a unit that is sent again."""
        for tally in (self._line, self._of(unit)):
            tally.retry()

    def cycle(self, unit: int, seconds: float) -> None:
        """Record how long one round of polling took for a unit; NaN: it is no longer polled."""
        self._of(unit).cycle(seconds)

    def statistics(self, unit: int | None = None) -> Statistics:
        """Return the present figures of the line, or of one unit on it."""
        if unit is not None:
            # reading changes nothing: this is called by any thread
            tally = self._units.get(unit) or Tally()
            return tally.statistics(tally.cycle_time, self._now())
        cycles = (tally.cycle_time for tally in self._units.copy().values())
        known = (cycle for cycle in cycles if not math.isnan(cycle))
        return self._line.statistics(max(known, default=math.nan), self._now())

    def _of(self, unit: int) -> Tally:
        if unit not in self._units:
            self._units[unit] = Tally(_ROUND_TRIPS_OF_A_UNIT)
        return self._units[unit]
