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

"""Which units of a line do not answer, and since when: counted in time, not in requests."""

from __future__ import annotations

import math

from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import PortError
from nfo_sinus_driver.link import Refused

#: A unit that has been silent for so long counts as missing, s: short enough to spare the others,
#: longer than a burst of noise.
_MISSING_AFTER = 2.0
#: The share of the time that all missing units may take together while others answer.
_MISSING_SHARE = 1 / 20


class Silences:
    """
    How long each unit has said nothing although it was asked; all times are of one clock, s.

    Silence begins when the first answer has failed to come, however long it was waited for: a unit
    that nobody asks is not silent, and one lost answer is no silence yet. Any valid frame ends it.

    Each request to a unit that is missing costs the others a whole time-out, so there is a pause
    behind it, in which none of the missing units is asked.
    """

    def __init__(self) -> None:
        self._heard_at: dict[int, float] = {}
        self._since: dict[int, float] = {}
        #: When any unit was heard.
        self._anybody_at = -math.inf
        self._pause_ends = -math.inf

    def note(
        self, unit: int, now: float, error: LinkError | None, seconds: float = 0.0
    ) -> None:
        """
        Take note of how a request to a unit ended; a refusal is an answer, too.

        :param seconds: for how long it has kept the line.
        """
        if error is None or error.heard or isinstance(error, Refused):
            self._heard_at[unit] = self._anybody_at = now
            self._since.pop(unit, None)
        elif self.is_missing(unit, now):
            self._pause_ends = now + seconds * (1 / _MISSING_SHARE - 1)
        if error is not None and not isinstance(error, (PortError, Refused)):
            self._since.setdefault(unit, now)

    def is_silent(self, unit: int) -> bool:
        """Tell whether a unit has not answered the last request to it."""
        return unit in self._since

    def heard_at(self, unit: int) -> float:
        """Return when the last valid frame of a unit came."""
        return self._heard_at.get(unit, -math.inf)

    def lasts(self, unit: int, now: float) -> float:
        """Return for how long a unit has been silent; 0 if it answers."""
        return now - self._since.get(unit, now)

    def is_missing(self, unit: int, now: float) -> bool:
        """Tell whether a unit has been silent for so long that it is asked seldom."""
        return self.lasts(unit, now) >= _MISSING_AFTER

    @property
    def missing_from(self) -> float:
        """From when on a missing unit may be asked again; at any time while nobody answers."""
        return min(self._pause_ends, self._anybody_at + _MISSING_AFTER)
