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


"""When the drive's operating time was what: it stands still while the drive has no power."""

from __future__ import annotations

import math

from nfo_sinus_driver.catalog.error_log import TICK

_HOUR = 3600.0
#: By how much the clocks of drive and computer may drift apart, s for each s.
_DRIFT = 1e-4


class OperatingClock:
    """
    Maps operating time to the steady clock, as far back as the drive is known to have had power.

    Every reading says within one tick when the drive's hours would have begun if it had had power
    all the time. While it has power all readings agree, and together they are finer than a tick;
    one that does not fit shows that it was off, and nothing from before can be mapped any more.
    """

    def __init__(self) -> None:
        #: The moment of operating hour 0 is between these, s of ``time.monotonic``.
        self._earliest, self._latest = -math.inf, math.inf
        self._noted_at = math.nan
        #: From this operating time on the drive is known to have had power, h.
        self.since = math.nan

    def note(self, hours: float, at: float) -> None:
        """
        Take a reading of the operating time.

        :param hours: what was read, h.
        :param at: when, s of ``time.monotonic``.
        """
        drift = 0.0 if math.isnan(self._noted_at) else _DRIFT * max(0.0, at - self._noted_at)
        self._noted_at = at
        latest = at - hours * _HOUR
        earliest = latest - TICK * _HOUR
        low = max(self._earliest - drift, earliest)
        high = min(self._latest + drift, latest)
        if math.isnan(self.since) or low > high:
            low, high, self.since = earliest, latest, hours
        self._earliest, self._latest = low, high

    def moment(self, hours: float) -> float:
        """
        Return when the operating time was so, to a tick or so; NaN if that is not known.

        :param hours: h, cut off to ticks.
        :returns: s of ``time.monotonic``.
        """
        # what is in the tick of the first reading may be from before the drive was switched on
        if math.isnan(self.since) or hours < self.since + TICK / 2:
            return math.nan
        middle = (self._earliest + self._latest) / 2 + (hours + TICK / 2) * _HOUR
        return min(middle, self._noted_at)
