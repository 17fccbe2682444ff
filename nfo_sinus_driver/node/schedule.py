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
"""What is done by the clock: functions that are due again and again."""

from __future__ import annotations

from collections.abc import Callable
import heapq
import itertools
import math

#: The golden ratio: beginnings that are this part of a period apart never crowd.
_SPREAD = (math.sqrt(5) - 1) / 2


class Schedule:
    """
    Functions, each with its period, the next one in front.

    No thread and no clock: who has both asks what is due. Functions with the same period begin at
    different moments of it, so that those of many drives do not come all at once.
    """

    def __init__(self) -> None:
        self._count = itertools.count()
        self._entries: list[tuple[float, int, float, Callable[[], None]]] = []

    def add(self, now: float, period: float, function: Callable[[], None]) -> None:
        """Have a function become due within a period (s) from now, and then once in each."""
        number = next(self._count)
        first = now + period * (1 - number * _SPREAD % 1)
        heapq.heappush(self._entries, (first, number, period, function))

    @property
    def next_moment(self) -> float:
        """When something becomes due, s on the clock of the caller; infinity if nothing will."""
        return self._entries[0][0] if self._entries else math.inf

    def take_due(self, now: float) -> Callable[[], None] | None:
        """Return a function that is due, once however late it is, or ``None``."""
        if self.next_moment > now:
            return None
        moment, number, period, function = self._entries[0]
        late = (now - moment) // period
        heapq.heapreplace(
            self._entries, (moment + (late + 1) * period, number, period, function)
        )
        return function
