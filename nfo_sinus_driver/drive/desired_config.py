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

"""The state that a drive is wanted in, as a parameter file says, and how it differs from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.events import Severity
from nfo_sinus_driver.drive.parameter_writer import Change
from nfo_sinus_driver.drive.parameter_writer import ParameterError
from nfo_sinus_driver.drive.parameter_writer import show


class Settings(Protocol):
    """What is needed of the settings of a drive."""

    @property
    def values(self) -> Mapping[str, Value]:
        """The settings that the drive has, by key."""

    @property
    def data(self) -> Mapping[str, bytes]:
        """The same as they stand in the drive."""

    def describe(self, key: str, before: Value, data: bytes) -> Change:
        """Return the difference between a value and what data mean."""

    def exact(self, key: str, value: Value) -> Value:
        """Return a value as the drive would show it."""

    async def change_now(
        self, wanted: Mapping[str, Value], *, guarded: bool = True, told_as: Cause = Cause.CHANGED
    ) -> tuple[Change, ...]:
        """Write what differs, and read it back."""


class DesiredConfig:
    """What the settings of one drive shall be; used on the bus, readable from anywhere."""

    def __init__(self, parameters: Settings, inverter: DriveState) -> None:
        self._parameters = parameters
        self._inverter = inverter
        self._values: dict[str, Value] = {}

    @property
    def drift(self) -> tuple[Change, ...]:
        """What the drive has otherwise than it was wanted, as wanted -> what it has."""
        data, values = self._parameters.data, self._parameters.values
        return tuple(
            self._parameters.describe(key, wanted, data[key])
            for key, wanted in self._values.items()
            if key in data and values.get(key) != wanted
        )

    def follow(self, changed: Mapping[str, Value]) -> None:
        """Want what a person has set since, where a state is wanted at all."""
        self._values.update((key, changed[key]) for key in changed if key in self._values)

    def tell_drift(self, key: str) -> bool:
        """Say that a parameter is not as wanted; false if it is."""
        for drift in self.drift:
            if drift.key == key:
                self._inverter.tell(Severity.WARNING, _not_as_wanted(drift))
                return True
        return False

    async def apply_now(self, wanted: Mapping[str, Value], *, write: bool) -> None:
        """
        Take a state as the wanted one and bring the drive into it.

        What cannot be written is logged, and stays reported as drift.

        :param write: false to report only.
        :raises ParameterError: the drive cannot have a value, whatever its state.
        """
        inverter = self._inverter
        here = {key: value for key, value in wanted.items() if key in self._parameters.data}
        self._values = {key: self._parameters.exact(key, value) for key, value in here.items()}
        missing = [key for key in wanted if key not in here]
        if missing:
            absent = Report(Cause.WANTED_BUT_MISSING, keys=tuple(missing))
            inverter.tell(Severity.WARNING, absent)
        drifts = self.drift
        while drifts:
            refused: list[ParameterError] = []
            for drift in drifts:
                if not write:
                    inverter.tell(Severity.WARNING, _not_as_wanted(drift))
                    continue
                try:
                    await self._parameters.change_now(
                        {drift.key: drift.old}, told_as=Cause.CHANGED_AS_WANTED
                    )
                except ParameterError as error:
                    refused.append(error)
            if len(refused) == len(drifts):
                for refusal in refused:
                    why = refusal.report
                    inverter.tell(Severity.ERROR, Report(Cause.WANTED_BUT_REFUSED, why=why))
            # values that bound each other may stand in any order
            drifts = self.drift if write and len(refused) < len(drifts) else ()


def _not_as_wanted(drift: Change) -> Report:
    """Return what to say of a parameter that differs from what was wanted."""
    has = f'{show(drift.new)} {drift.unit}'.rstrip()
    return Report(Cause.NOT_AS_WANTED, key=drift.key, has=has, wanted=show(drift.old))
