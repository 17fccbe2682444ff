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
"""One entry of the error log of a drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
import math
import time
from typing import NamedTuple


class Reading(NamedTuple):
    """What was measured when a fault came."""

    name: str
    value: float
    unit: str

    def __str__(self) -> str:
        return f'{self.name} {self.value:g} {self.unit}'


class StoredEntry(NamedTuple):
    """
    An entry as it stands in the drive; what is the same in all is the same entry.

    :ivar code: as the inverter status has it; 0 ends the log.
    :ivar hours: the operating time when it happened, h; ``None`` of a drive that keeps none.
    :ivar readings: what was measured then, of a drive that keeps that.
    """

    code: int
    hours: float | None = None
    readings: Sequence[Reading] = ()


#: What stands where there is none.
NO_ENTRY = StoredEntry(0)


@dataclass(frozen=True)
class LogEntry:
    """
    One entry of the error log.

    :ivar code: as the inverter status has it.
    :ivar text: as on the display.
    :ivar operating_time: the drive's operating time when it happened, h; NaN of a drive that keeps
        none.
    :ivar age: operating hours ago; NaN if the drive does not tell.
    :ivar at: when it happened, s of ``time.monotonic``, as exactly as that is known: it was seen
        to come, or the drive is known to have had power ever since; else NaN.
    :ivar latest: it cannot have been later, s of ``time.monotonic``; NaN if there is no age.
    :ivar readings: what was measured then, of a drive that keeps that.
    """

    code: int
    text: str
    operating_time: float
    age: float
    at: float = math.nan
    latest: float = math.nan
    readings: Sequence[Reading] = ()

    @property
    def wall_time(self) -> str:
        """The local time, such as ``2026-11-21 17:02``, or that time ``or before``."""
        if not math.isnan(self.at):
            return _local(self.at)
        latest = '' if math.isnan(self.latest) else _local(self.latest)
        return f'{latest} or before' if latest else ''

    @property
    def what(self) -> str:
        """The text, and what was measured then."""
        readings = ', '.join(map(str, self.readings))
        return f'{self.text} ({readings})' if readings else self.text

    @property
    def hours(self) -> str:
        """The operating time, such as ``1234.5 h``; ``''`` if the drive keeps none."""
        return '' if math.isnan(self.operating_time) else f'{self.operating_time:.1f} h'

    def __str__(self) -> str:
        hours = f' at {self.hours}' if self.hours else ''
        age = '' if math.isnan(self.age) else f', {self.age:.1f} operating hours ago'
        wall_time = f' ({self.wall_time})' if self.wall_time else ''
        return f'{self.code} {self.what}{hours}{age}{wall_time}'


def _local(at: float) -> str:
    try:
        moment = datetime.fromtimestamp(time.time() - time.monotonic() + at)
    except (ValueError, OverflowError, OSError):
        # no calendar goes back so far: the drive tells nonsense
        return ''
    return moment.isoformat(' ', 'minutes')
