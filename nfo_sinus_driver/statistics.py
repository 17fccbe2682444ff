# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Counters and times of one line."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
import math
import time

from nfo_sinus_driver.link import DamagedAnswer
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import NoAnswer
from nfo_sinus_driver.link import Refused

#: Of how many of the last transactions the round trips are kept.
_ROUND_TRIPS = 1000
#: Over how long the utilisation is taken, s.
_WINDOW = 2.0


@dataclass(frozen=True)
class Statistics:
    """
    How a line is doing; times in seconds, NaN where nothing was measured yet.

    :ivar utilisation: share of the last two seconds in which the line was in use, 0 to 1.
    :ivar cycle_time: how long the slowest drive's last round of polling took.
    :ivar transactions: requests sent, answered or not.
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
    round_trip_p99: float
    round_trip_max: float


class Recorder:
    """Takes the measurements; written by the bus worker alone, read by anyone."""

    def __init__(self) -> None:
        self.transactions = 0
        self.timeouts = 0
        self.damaged = 0
        self.refused = 0
        self.retries = 0
        self.reconnects = 0
        self._opened = 0
        self._round_trips: deque[float] = deque(maxlen=_ROUND_TRIPS)
        self._busy: deque[tuple[float, float]] = deque()
        self._cycles: dict[int, float] = {}

    def opened(self) -> None:
        """Count that the port was opened; every time but the first is a reconnect."""
        self.reconnects = self._opened
        self._opened += 1

    def transaction(self, now: float, seconds: float, error: LinkError | None) -> None:
        """Count a transaction that kept the line busy until ``now``, and how it ended."""
        self.busy(now, seconds)
        if error is None or isinstance(error, Refused):
            self.answered(seconds)
        self.timeouts += isinstance(error, NoAnswer)
        self.damaged += isinstance(error, DamagedAnswer)
        self.refused += isinstance(error, Refused)

    def busy(self, now: float, seconds: float) -> None:
        """Count a transaction that kept the line busy until ``now``."""
        self.transactions += 1
        self._busy.append((now, seconds))
        while self._busy[0][0] < now - _WINDOW:
            self._busy.popleft()

    def answered(self, seconds: float) -> None:
        """Record the round trip of a transaction that was answered."""
        self._round_trips.append(seconds)

    def retry(self) -> None:
        """Count a request that is sent again."""
        self.retries += 1

    def cycle(self, unit: int, seconds: float) -> None:
        """Record how long one round of polling took for a unit."""
        self._cycles[unit] = seconds

    def forget_cycle(self, unit: int) -> None:
        """Take a unit that is no longer polled out."""
        self._cycles.pop(unit, None)

    def statistics(self) -> Statistics:
        """Return the present figures."""
        start = time.monotonic() - _WINDOW
        busy = sum(seconds for end, seconds in tuple(self._busy) if end >= start)
        trips = sorted(self._round_trips.copy())
        cycles = tuple(self._cycles.copy().values())
        return Statistics(
            utilisation=min(1.0, busy / _WINDOW),
            cycle_time=max(cycles, default=math.nan),
            transactions=self.transactions,
            timeouts=self.timeouts,
            damaged=self.damaged,
            refused=self.refused,
            retries=self.retries,
            reconnects=self.reconnects,
            round_trip_min=trips[0] if trips else math.nan,
            round_trip_mean=sum(trips) / len(trips) if trips else math.nan,
            round_trip_p99=trips[math.ceil(0.99 * len(trips)) - 1] if trips else math.nan,
            round_trip_max=trips[-1] if trips else math.nan,
        )
