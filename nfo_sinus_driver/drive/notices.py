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

from collections.abc import Mapping
import math

from nfo_sinus_driver.catalog import Fact
from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog import Meaning
from nfo_sinus_driver.drive.inverter import Inverter
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.drive.snapshot import Severity

#: What comes and goes is told again only when it was away for so long, s.
_AGAIN_AFTER = 10.0

#: Whether it is there, and how grave it is.
_SEVERITIES: Mapping[str, Severity] = {
    'limit': Severity.WARNING,
    'alarm': Severity.WARNING,
    'sleep': Severity.INFO,
}


class Notices:
    """Tells of alarms, the current limit and sleep of one drive; nothing is stopped by them."""

    def __init__(self, inverter: Inverter) -> None:
        self._inverter = inverter
        #: When each was last there.
        self._seen_at: dict[str, float] = {}
        #: An alarm stood when it was last looked at, with a code that is no alarm's.
        self._unnamed = False

    def take(self, seen: InverterStatus) -> None:
        """Tell what has begun."""
        for name, text in self._texts(seen).items():
            before = self._seen_at.get(name, -math.inf)
            self._seen_at[name] = seen.at
            if seen.at - before > _AGAIN_AFTER:
                self._inverter.tell(_SEVERITIES[name.partition(' ')[0]], text)
        self._unnamed = seen.kind is Kind.ALARM and not seen.listed.remedy

    def _texts(self, seen: InverterStatus) -> Mapping[str, str]:
        """Return what is there, each alarm by its code."""
        told, entry = self._inverter.describe(), seen.listed
        texts: dict[str, str] = {}
        by_code = seen.means(Meaning.CURRENT_LIMIT)
        limited = by_code or Fact.LIMIT_ACTIVE in seen.facts
        if limited and not seen.faulted:
            (limit,) = seen.model.codes(Meaning.CURRENT_LIMIT)
            texts['limit'] = f'the current limit holds the motor back ({told}). {limit.remedy}'
        if seen.kind is Kind.ALARM and not by_code:
            if entry.remedy:
                texts[f'alarm {seen.code}'] = f'alarm {told}: {entry.description}. {entry.remedy}'
            elif self._unnamed and not limited:
                # once only, it came or went between the two readings
                texts['alarm'] = f'alarm, the status does not say which ({told}): see its display'
        if Fact.SLEEPING in seen.facts:
            texts['sleep'] = (
                f'the drive sleeps ({told}), for its set-point is below its sleep frequency: '
                'a greater one wakes it'
            )
        return texts
