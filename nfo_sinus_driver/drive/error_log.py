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
import contextlib
import math
import time

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import ErrorLogArea
from nfo_sinus_driver.catalog import RememberedFault
from nfo_sinus_driver.catalog import Reset
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.log_entry import NO_ENTRY
from nfo_sinus_driver.drive.log_entry import LogEntry
from nfo_sinus_driver.drive.log_entry import Reading
from nfo_sinus_driver.drive.log_entry import StoredEntry
from nfo_sinus_driver.drive.operating_clock import TICK
from nfo_sinus_driver.drive.operating_clock import OperatingClock
from nfo_sinus_driver.drive.parameter_access import ParameterAccess
from nfo_sinus_driver.drive.procedure import Procedures
from nfo_sinus_driver.link import Address
from nfo_sinus_driver.link import Refused

#: The operating time of an entry [M2 §9].
_TICKS = 0xFFFFFF
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
        self._sightings: list[tuple[StoredEntry, float]] = []

    @property
    def documented(self) -> bool:
        """A manual says where it stands."""
        return bool(self._memory) or self._registers.protocol in self._inverter.model.error_logs

    @property
    def _memory(self) -> Sequence[RememberedFault]:
        return self._inverter.model.profile.fault_memory

    async def read_now(self, most: int = 0) -> tuple[LogEntry, ...]:
        """
        Read the error log, newest entry first ([M0 §8.4], [M2 §9], [M4 §4]).

        :param most: how many entries at most; 0 is all that every drive has [C4].
        :raises DriveError: the model's is not documented, or it cannot be read.
        """
        entries, limit = self._sizes()
        found = await self._read(min(most or entries, limit), NO_ENTRY, Priority.POLL)
        return self.understood(found, await self.read_time(Priority.POLL))

    async def newer_than(
        self, known: StoredEntry | None, priority: Priority
    ) -> list[StoredEntry]:
        """
        Read the entries that are newer than one, as they stand in the drive, newest first.

        :param known: the newest one so far; ``None`` for only the newest.
        :raises DriveError: the model's log is not documented, or it cannot be read.
        """
        entries, _ = self._sizes()
        if known is None:
            return await self._read(1, NO_ENTRY, priority)
        return await self._read(entries, known, priority)

    async def read_time(self, priority: Priority) -> float:
        """Read the operating time, h, and have the clock follow it; NaN if the drive has none."""
        once = priority > Priority.POLL
        key = self._inverter.model.key(Role.OPERATING_TIME)
        if not key:
            return math.nan
        hours, at = await self._registers.read_at(key, priority, once=once)
        assert not isinstance(hours, str)
        self.clock.note(float(hours), at)
        return float(hours)

    def note_sighting(self, entry: StoredEntry, at: float) -> None:
        """Remember when an entry came, s of ``time.monotonic``."""
        self._sightings = [(entry, at), *self._sightings[: _REMEMBERED - 1]]

    def understood(self, entries: Sequence[StoredEntry], now: float) -> tuple[LogEntry, ...]:
        """
        Return what entries say, newest first.

        :param now: the operating time, h; NaN if nobody knows.
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
            self._require_documented()
            async with self._procedures.in_standby(access):
                await self._procedures.command(access, Reset.ERROR_LOG)
                if (await self._entry(0)).code:
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

    def _require_documented(self) -> None:
        if not self.documented:
            raise DriveError(Report(Cause.LOG_UNDOCUMENTED, model=self._inverter.model.name))

    @property
    def _area(self) -> ErrorLogArea:
        return self._inverter.model.error_logs[self._registers.protocol]

    def _sizes(self) -> tuple[int, int]:
        """Return how many entries every drive has, and how many some have."""
        self._require_documented()
        if self._memory:
            return len(self._memory), len(self._memory)
        return self._area.entries, self._area.limit

    async def _read(
        self, limit: int, known: StoredEntry, priority: Priority
    ) -> list[StoredEntry]:
        """Read the entries down to one that is known, while none comes in."""
        for _ in range(_TRIES):
            entries = await self._read_down(limit, known, priority)
            # an entry that came in meanwhile has moved the others
            if not entries or await self._entry(0, priority) == entries[0]:
                return entries
        raise DriveError(Report(Cause.LOG_CHANGES))

    async def _read_down(
        self, limit: int, known: StoredEntry, priority: Priority
    ) -> list[StoredEntry]:
        """Read entries until one is empty or known, or until there are no more."""
        every, _ = self._sizes()
        found: list[StoredEntry] = []
        while len(found) < limit:
            try:
                entry = await self._entry(len(found), priority)
            except Refused:
                if len(found) < every:
                    raise
                break
            if not entry.code or entry == known:
                break
            found.append(entry)
        return found

    async def _entry(self, number: int, priority: Priority = Priority.POLL) -> StoredEntry:
        """Read one entry; who waits for it goes by turns with the polls."""
        # nobody waits for what is read in the background, so it is not asked for again at once
        once = priority > Priority.POLL
        if self._memory:
            return await self._remembered(self._memory[number], priority, once)
        data = await self._registers.read_from(
            Address(*self._area.place(number)), priority, once=once
        )
        raw = self._area.codec.decode(data)
        return StoredEntry(raw >> 24, (raw & _TICKS) * TICK)

    async def _remembered(
        self, entry: RememberedFault, priority: Priority, once: bool
    ) -> StoredEntry:
        fault = int(await self._registers.read_number(entry.number, priority, once=once))
        if not fault:
            return NO_ENTRY
        readings: list[Reading] = []
        for name, key in entry.readings.items():
            # one that nobody can read, such as a temperature below zero, is left out [C105]
            with contextlib.suppress(ValueError):
                value = await self._registers.read_number(key, priority, once=once)
                readings.append(Reading(name, value, self._inverter.model[key].unit))
        return StoredEntry(entry.first + fault, readings=tuple(readings))

    def _understood(self, entry: StoredEntry, now: float, sighted_at: float) -> LogEntry:
        code, then = entry.code, math.nan if entry.hours is None else entry.hours
        # one tick of doubt, for the drive rounds
        age = at = latest = math.nan
        if now > then - TICK:
            age = max(0.0, now - then)
            at = self.clock.moment(then)
            latest = time.monotonic() - max(0.0, age - TICK) * 3600
        if not math.isnan(sighted_at):
            at = sighted_at
        text = self._inverter.text_of(code)
        return LogEntry(code, text, round(then, 1), age, at, latest, entry.readings)
