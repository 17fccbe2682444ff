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


"""The error log of a drive and its kWh counter: read, erased, reset."""

from __future__ import annotations

from collections.abc import Sequence
import math
import time

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import ErrorLogArea
from nfo_sinus_driver.catalog import Reset
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog.error_log import TICK
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.log_entry import LogEntry
from nfo_sinus_driver.drive.operating_clock import OperatingClock
from nfo_sinus_driver.drive.parameter_access import ParameterAccess
from nfo_sinus_driver.drive.procedure import Procedures
from nfo_sinus_driver.link import Address
from nfo_sinus_driver.link import Refused

#: Of how many entries it is remembered when they came.
_REMEMBERED = 128
#: How often the log is read anew when an entry came in meanwhile.
_TRIES = 3
#: A counter that was reset may have counted on since, kWh.
_NEARLY_NOTHING = 0.1


class ErrorLog:
    """The error log and the kWh counter of one drive; used on the bus alone."""

    def __init__(
        self, inverter: DriveState, registers: ParameterAccess, procedures: Procedures
    ) -> None:
        self._inverter = inverter
        self._registers = registers
        self._procedures = procedures
        self.clock = OperatingClock()
        #: Entries that were seen to come, and when, the newest first.
        self._sightings: list[tuple[int, float]] = []

    @property
    def documented(self) -> bool:
        """A manual says where it stands."""
        return self._registers.protocol in self._inverter.model.error_logs

    @property
    def timed(self) -> bool:
        """It is documented, and tells when an error happened."""
        return self.documented and self.area.timed

    async def read_now(self, most: int = 0) -> tuple[LogEntry, ...]:
        """
        Read the error log, newest entry first ([M0 §8.4], [M2 §9]).

        :param most: how many entries at most; 0 is all that every drive has, 32 [C4].
        :raises DriveError: the model's is not documented, or it cannot be read.
        """
        area = self.area
        limit = min(most or area.entries, area.limit)
        entries = await self._read(area, limit, 0, Priority.POLL)
        if not area.timed:
            return tuple([await self._with_readings(*found) for found in enumerate(entries)])
        return self.understood(entries, await self.read_time(Priority.POLL))

    async def _with_readings(self, number: int, entry: int) -> LogEntry:
        """Return what an entry without a time says, and what the drive has kept of it."""
        told: list[str] = []
        for what, key in self.area.readings_of(number):
            try:
                value = await self._registers.read_number(key, Priority.POLL)
            except (Refused, ValueError):
                # what cannot be told, such as a temperature below 0, is left out
                continue
            told.append(f'{what} {value:g} {self._inverter.model[key].unit}')
        code = self.area.code(entry)
        return LogEntry(code, self._inverter.text_of(code), readings=tuple(told))

    async def newer_than(self, known: int | None, priority: Priority) -> list[int]:
        """
        Read the entries that are newer than one, as they stand in the drive, newest first.

        :param known: the newest one so far; 0 if there was none, ``None`` for only the newest.
        :raises DriveError: the model's log is not documented, or it cannot be read.
        """
        area = self.area
        if known is None:
            return await self._read(area, 1, 0, priority)
        return await self._read(area, area.entries, known, priority)

    async def read_time(self, priority: Priority) -> float:
        """Read the operating time, h, and have the clock follow it."""
        once = priority > Priority.POLL
        key = self._inverter.model.key(Role.OPERATING_TIME)
        hours, at = await self._registers.read_at(key, priority, once=once)
        assert not isinstance(hours, str)
        self.clock.note(float(hours), at)
        return float(hours)

    def note_sighting(self, entry: int, at: float) -> None:
        """Remember when an entry came, s of ``time.monotonic``."""
        self._sightings = [(entry, at), *self._sightings[: _REMEMBERED - 1]]

    def understood(self, entries: Sequence[int], now: float) -> tuple[LogEntry, ...]:
        """
        Return what entries say, newest first.

        :param now: the operating time, h.
        """
        sightings = list(self._sightings)
        found: list[LogEntry] = []
        for entry in entries:
            sighting = next((one for one in sightings if one[0] == entry), None)
            if sighting is not None:
                sightings.remove(sighting)
            found.append(self._understood(entry, now, sighting[1] if sighting else math.nan))
        return tuple(found)

    async def erase_now(self) -> Report:
        """
        Erase the error log by SCMD [M0 table 18], and see that it is empty.

        :raises DriveError: it was not erased, and why.
        """
        with self._procedures.begun(Reset.ERROR_LOG) as access:
            area = self.area
            async with self._procedures.in_standby(access):
                await self._procedures.command(access, Reset.ERROR_LOG)
                if area.code(await self._entry(area, 0)):
                    raise DriveError(Report(Cause.LOG_NOT_ERASED))
        return Report(Cause.LOG_ERASED)

    async def reset_energy_now(self) -> Report:
        """
        Reset the kWh counter E-Out by SCMD, from firmware 4.38 on [M0 table 18], and see it at 0.

        :raises DriveError: it was not reset, and why.
        """
        energy = self._inverter.model.key(Role.ENERGY)
        self._procedures.require(Reset.ENERGY)
        if not self._inverter.has(energy):
            since, told = self._inverter.model[energy].since, self._inverter.identity
            raise DriveError(
                Report(
                    Cause.ENERGY_RESET_UNKNOWN,
                    what=Reset.ENERGY.value,
                    since=float(since or 0),
                    firmware=told.versions if told else '',
                )
            )
        with self._procedures.begun(Reset.ENERGY) as access:
            async with self._procedures.in_standby(access):
                before = await self._registers.read_number(energy, Priority.SERVICE)
                await self._procedures.command(access, Reset.ENERGY)
                after = await self._registers.read_number(energy, Priority.SERVICE)
                if after > min(before, _NEARLY_NOTHING):
                    raise DriveError(Report(Cause.ENERGY_NOT_RESET, key=energy, energy=after))
        return Report(Cause.ENERGY_RESET, key=energy, before=before, after=after)

    @property
    def area(self) -> ErrorLogArea:
        """
        Where it stands.

        :raises DriveError: the model's is not documented.
        """
        if not self.documented:
            raise DriveError(Report(Cause.LOG_UNDOCUMENTED, model=self._inverter.model.name))
        return self._inverter.model.error_logs[self._registers.protocol]

    async def _read(
        self, area: ErrorLogArea, limit: int, known: int, priority: Priority
    ) -> list[int]:
        """Read the entries down to one that is known, while none comes in."""
        for _ in range(_TRIES):
            entries = await self._read_down(area, limit, known, priority)
            # an entry that came in meanwhile has moved the others
            if not entries or await self._entry(area, 0, priority) == entries[0]:
                return entries
        raise DriveError(Report(Cause.LOG_CHANGES))

    async def _read_down(
        self, area: ErrorLogArea, limit: int, known: int, priority: Priority
    ) -> list[int]:
        """Read entries until one is empty or known, or until there are no more."""
        found: list[int] = []
        while len(found) < limit:
            try:
                entry = await self._entry(area, len(found), priority)
            except Refused:
                if len(found) < area.entries:
                    raise
                break
            if not area.code(entry) or entry == known:
                break
            found.append(entry)
        return found

    async def _entry(
        self, area: ErrorLogArea, number: int, priority: Priority = Priority.POLL
    ) -> int:
        """Read one entry as 32 bits; who waits for it goes by turns with the polls."""
        # nobody waits for what is read in the background, so it is not asked for again at once
        data = await self._registers.read_from(
            Address(*area.place(number)), priority, once=priority > Priority.POLL
        )
        return area.codec.decode(data)

    def _understood(self, entry: int, now: float, sighted_at: float) -> LogEntry:
        code, then = self.area.code(entry), self.area.hours(entry)
        # one tick of doubt, for the drive rounds
        age = at = latest = math.nan
        if now > then - TICK:
            age = max(0.0, now - then)
            at = self.clock.moment(then)
            latest = time.monotonic() - max(0.0, age - TICK) * 3600
        if not math.isnan(sighted_at):
            at = sighted_at
        return LogEntry(code, self._inverter.text_of(code), round(then, 1), age, at, latest)
