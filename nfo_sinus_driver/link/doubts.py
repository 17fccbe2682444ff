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

"""Which answers may still be on their way, so that no late one is taken for the right one."""

from __future__ import annotations

from collections.abc import Sequence
import time
from typing import Any

from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.modbus_pdu import Read
from nfo_sinus_driver.link.modbus_pdu import Request

#: How late an answer may come, in time-outs, before it counts as lost for good.
LATEST_ANSWER = 4

#: The heads of answers that may still come, and until when.
Doubt = dict[bytes, float]


class Doubts:
    """
    What may still come from each unit.

    :param response_timeout: how long an answer is waited for, s.
    """

    def __init__(self, response_timeout: float) -> None:
        self._response_timeout = response_timeout
        self._probes: dict[int, tuple[Address, ...]] = {}
        self._of: dict[int, Doubt] = {}
        #: Of answers that were right, and yet may come once more.
        self._repeated: dict[int, Doubt] = {}

    def use_probes(self, unit: int, probes: Sequence[Address]) -> None:
        """Name parameters of different sizes that are safe to read at any time."""
        self._probes[unit] = tuple(probes)

    def add(self, request: Request[Any]) -> None:
        """Expect an answer to a request, one more than has come."""
        self._of.setdefault(request.unit, {})[request.answer_head] = self._latest()

    def repeated(self, request: Request[Any]) -> None:
        """Expect that the answer just got comes once more; what it says is right all the same."""
        self._repeated[request.unit] = {request.answer_head: self._latest()}

    def may_repeat(self, request: Request[Any]) -> bool:
        """Tell whether an answer of this shape may come once more."""
        return request.answer_head in _without_past(self._repeated.get(request.unit, {}))

    def answered(self, unit: int) -> None:
        """Forget which answer may come once more, for another has come."""
        self._repeated.pop(unit, None)

    def of(self, unit: int) -> Doubt:
        """Return what may still come from a unit, without what is too late by now."""
        doubt = self._of[unit] = _without_past(self._of.get(unit, {}))
        return doubt

    def end(self, unit: int) -> None:
        """Forget what a unit may still say: units answer in order, and this one has."""
        self._of.pop(unit, None)

    def clear(self) -> None:
        """Forget everything but the probes."""
        self._of.clear()
        self._repeated.clear()

    def _latest(self) -> float:
        return time.monotonic() + (LATEST_ANSWER - 1) * self._response_timeout

    def probe(self, unit: int) -> tuple[Read | None, float]:
        """
        Return a request whose answer cannot be confused with any that may still come.

        :returns: ``None`` if there is none yet, and when there will be (``time.monotonic``).
        """
        doubt = _without_past(self._repeated.get(unit, {})) | self.of(unit)
        probes = [
            Read(unit, address.numbers[0], address.words)
            for address in self._probes.get(unit, ())
        ]
        for probe in probes:
            if probe.answer_head not in doubt:
                return probe, 0.0
        # not until nothing is in doubt: a write that fails again and again must not keep reads out
        ends = [doubt[probe.answer_head] for probe in probes] or doubt.values()
        return None, max(ends)


def _without_past(doubt: Doubt) -> Doubt:
    now = time.monotonic()
    return {head: until for head, until in doubt.items() if until > now}
