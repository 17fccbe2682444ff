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

from dataclasses import dataclass
import math

from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import PortError
from nfo_sinus_driver.link import Refused

#: One lost answer is noise, however long it was waited for.
_FEWEST = 2


@dataclass
class _Unit:
    """
    What was heard of one unit.

    :ivar heard_at: when its last valid frame came, s; a refusal is one, too.
    :ivar asked_at: when the first request was sent that it has not answered since; infinity while
        there is none, for a unit that is not asked is not silent.
    :ivar unanswered: how many it has not.
    """

    heard_at: float = -math.inf
    asked_at: float = math.inf
    unanswered: int = 0


class Silences:
    """How long each unit has said nothing although it was asked; all times are of one clock."""

    def __init__(self) -> None:
        self._units: dict[int, _Unit] = {}

    def note(self, unit: int, started: float, now: float, error: LinkError | None) -> None:
        """Take note of how a transaction ended that was on the line from ``started`` to ``now``."""
        heard = self._of(unit)
        if error is None or isinstance(error, Refused):
            self._units[unit] = _Unit(now)
        elif not isinstance(error, PortError):
            heard.asked_at = min(heard.asked_at, started)
            heard.unanswered += 1

    def is_silent(self, unit: int) -> bool:
        """Tell whether a unit has not answered the last request to it."""
        return self._of(unit).unanswered > 0

    def heard_at(self, unit: int) -> float:
        """Return when the last valid frame of a unit came, s."""
        return self._of(unit).heard_at

    def lasts(self, unit: int, now: float) -> float:
        """Return how long a unit has answered nothing, s; 0 until it was asked twice."""
        heard = self._of(unit)
        return now - heard.asked_at if heard.unanswered >= _FEWEST else 0.0

    def _of(self, unit: int) -> _Unit:
        return self._units.setdefault(unit, _Unit())
