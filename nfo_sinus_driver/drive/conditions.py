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

"""What a drive says of itself and nobody has to act on: told when it begins."""

from __future__ import annotations

from collections.abc import Iterator
import math

from nfo_sinus_driver.catalog import Fact
from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog import Meaning
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.events import Severity
from nfo_sinus_driver.drive.snapshot import InverterStatus

#: What comes and goes is told again only when it was away for so long, s.
_AGAIN_AFTER = 10.0

class Conditions:
    """Tells of alarms, the current limit and sleep of one drive; nothing is stopped by them."""

    def __init__(self, inverter: DriveState) -> None:
        self._inverter = inverter
        #: When each was last there.
        self._seen_at: dict[tuple[Cause, int], float] = {}
        #: An alarm stood when it was last looked at, with a code that is no alarm's.
        self._unnamed = False

    def take(self, seen: InverterStatus) -> None:
        """Tell what has begun."""
        for severity, report in self._reports(seen):
            # each alarm by its code
            name = (report.cause, seen.code if report.cause is Cause.ALARM else 0)
            before = self._seen_at.get(name, -math.inf)
            self._seen_at[name] = seen.at
            if seen.at - before > _AGAIN_AFTER:
                self._inverter.tell(severity, report)
        self._unnamed = seen.kind is Kind.ALARM and not seen.listed.remedy

    def _reports(self, seen: InverterStatus) -> Iterator[tuple[Severity, Report]]:
        """Yield what is there."""
        by_code = seen.means(Meaning.CURRENT_LIMIT)
        limited = by_code or Fact.LIMIT_ACTIVE in seen.facts
        if limited and not seen.faulted:
            (limit,) = seen.model.codes(Meaning.CURRENT_LIMIT)
            yield Severity.WARNING, self._inverter.report(Cause.CURRENT_LIMITED, limit=limit)
        if seen.kind is Kind.ALARM and not by_code:
            if seen.listed.remedy:
                yield Severity.WARNING, self._inverter.report(Cause.ALARM, alarm=seen.listed)
            elif self._unnamed and not limited:
                # once only, it came or went between the two readings
                yield Severity.WARNING, self._inverter.report(Cause.ALARM_UNNAMED)
        if Fact.SLEEPING in seen.facts:
            yield Severity.INFO, self._inverter.report(Cause.ASLEEP)
