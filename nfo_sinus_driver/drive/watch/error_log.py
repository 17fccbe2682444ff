# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The error log of a drive and its kWh counter: read, watched, erased, reset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import logging
import math

from nfo_sinus_driver.bus import Priority, Task
from nfo_sinus_driver.catalog import ErrorLogArea, InverterStatus, Reset, Role
from nfo_sinus_driver.catalog.error_log import TICK
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.snapshot import LogEntry
from nfo_sinus_driver.drive.motion.procedure import Procedures
from nfo_sinus_driver.link import Address, LinkError, Refused

_log = logging.getLogger(__name__)

_HOUR = 3600.0
#: By how much the clocks of drive and computer may drift apart, h for each h.
_DRIFT = 1e-4
#: How often the log is read anew when an entry came in meanwhile.
_READINGS = 3
#: A counter that was reset may have counted on since, kWh.
_NEARLY_NOTHING = 0.1
#: How often the log is read for faults between two polls, s.
_PERIOD = 30.0
#: How often to check whether the drive responds again, s.
_WAIT = 1.0
#: How often the entry of a fault is looked for, s, and how many times.
_RETRY_PERIOD = 0.2
_TRIES = 10
#: An entry that was reported so shortly before a poll showed its fault is that fault's, s.
_SOON = 2.0


class ErrorLog:
    """
    The error log and the kWh counter of one drive; used on the bus alone.

    :raises DriveError: a method cannot do it, or the model's log is not documented.
    """

    def __init__(self, state: DriveState, procedures: Procedures) -> None:
        self._state = state
        self._params = state.params
        self._procedures = procedures
        #: From this operating hour on the drive is known to have had power; NaN: not known.
        self.powered_since = math.nan
        #: When it showed that hour, s of the clock of the bus.
        self._shown_at = math.nan
        #: Where it is, if not where it was read first.
        self._moved: ErrorLogArea | None = None

    @property
    def documented(self) -> bool:
        """A manual says where it is in the drive."""
        return self._params.protocol in self._state.model.error_logs

    @property
    def reached(self) -> bool:
        """It can be read just now."""
        return self.documented and self._params.reaches_space(self.area.space)

    @property
    def timed(self) -> bool:
        """It is documented, and its entries have a time."""
        return self.documented and self.area.timed

    async def read_now(self, most: int = 0) -> tuple[LogEntry, ...]:
        """Read it, newest first; ``most`` entries at most, 0: the 32 that every drive has [C4]."""
        area = self.area
        entries = await self._read(min(most or area.entries, area.limit), 0, Priority.POLL)
        if not area.timed:
            return tuple([await self._with_readings(*found) for found in entries])
        return self.decode([entry for _, entry in entries], await self.read_time(Priority.POLL))

    async def _with_readings(self, number: int, entry: int) -> LogEntry:
        """Return what an entry without a time says, and what the drive has kept of it."""
        kept: list[str] = []
        for what, key in self.area.readings_of(number):
            try:
                data = await self._params.read_data(key, Priority.POLL)
                kept.append(f'{what} {self._shown(key, data)}')
            except (Refused, ValueError):
                # what cannot be read is left out
                continue
        code = self.area.code(entry)
        text = self.area.unknown(entry) or self._state.nameplate.text_of(code)
        return LogEntry(code, text, readings=(*await self._also(number), *kept))

    async def _also(self, number: int) -> list[str]:
        """Return what else has happened before the fault of an entry was acknowledged."""
        found: list[str] = []
        for message in range(1, self.area.messages):
            code = self.area.code(await self._entry(number, Priority.POLL, message))
            if not code:
                break
            found.append(f'also {code} {self._state.nameplate.text_of(code)}')
        return found

    def _shown(self, key: str, data: bytes) -> str:
        """Return a value that the drive has kept with an entry; a bit field in hexadecimal."""
        parameter = self._params.model[key]
        if parameter.kind is int:
            return f'{data.hex().upper()}h'
        return f'{self._params.number(key, data):g} {parameter.unit}'

    async def newer_than(self, known: int | None, priority: Priority) -> list[int]:
        """
        Read the entries that are newer than one, as the drive encodes them, newest first.

        :param known: the newest one so far; 0 if there was none, ``None`` for only the newest.
        """
        limit = 1 if known is None else self.area.entries
        return [entry for _, entry in await self._read(limit, known or 0, priority)]

    async def read_time(self, priority: Priority) -> float:
        """Read the operating time, h, which shows whether the drive was off meanwhile."""
        key = self._state.model.key(Role.OPERATING_TIME)
        reply = await self._params.read_reply(key, priority, retry=priority <= Priority.POLL)
        hours = self._params.number(key, reply.data)
        elapsed = (reply.arrived - self._shown_at) / _HOUR
        # the hours shown are less than a tick behind those counted
        if not hours > self.powered_since + elapsed * (1 - _DRIFT) - TICK:
            self.powered_since, self._shown_at = hours, reply.arrived
        return hours

    def connected(self) -> None:
        """Note that the drive may have been off until now."""
        self.powered_since = math.nan

    def decode(self, entries: Sequence[int], now: float) -> tuple[LogEntry, ...]:
        """
        Decode entries, newest first, at operating time ``now``, h.

        The age of an entry is the difference of operating times, to a tick, if the drive has had
        power ever since.
        """
        return tuple(self._decode(entry, now) for entry in entries)

    async def erase_now(self) -> Report:
        """Erase the error log by SCMD [M0 table 18], and check that it is empty."""
        with self._procedures.begun(Reset.ERROR_LOG) as access:
            area = self.area
            async with self._procedures.in_standby(access):
                await self._procedures.command(access, Reset.ERROR_LOG)
                if area.code(await self._entry(0, Priority.POLL)):
                    raise DriveError(Cause.LOG_NOT_ERASED)
        return Report(Cause.LOG_ERASED)

    async def reset_energy_now(self) -> Report:
        """Reset the kWh counter E-Out, from firmware 4.38 on [M0 table 18], and check it."""
        energy = self._state.model.key(Role.ENERGY)
        self._procedures.require(Reset.ENERGY)
        if not self._params.reaches(energy):
            # behind a PLC without a mailbox, which this says
            await self._params.read_number(energy, Priority.SERVICE)
        if not self._state.nameplate.has(energy):
            since, identity = self._state.model[energy].since, self._state.nameplate.identity
            raise DriveError(
                Cause.ENERGY_RESET_UNKNOWN,
                what=Reset.ENERGY.value,
                since=float(since or 0),
                firmware=identity.versions if identity else '',
            )
        with self._procedures.begun(Reset.ENERGY) as access:
            async with self._procedures.in_standby(access):
                before = await self._params.read_number(energy, Priority.SERVICE)
                await self._procedures.command(access, Reset.ENERGY)
                after = await self._params.read_number(energy, Priority.SERVICE)
                if after > min(before, _NEARLY_NOTHING):
                    raise DriveError(Cause.ENERGY_NOT_RESET, key=energy, energy=after)
        return Report(Cause.ENERGY_RESET, key=energy, before=before, after=after)

    @property
    def area(self) -> ErrorLogArea:
        """Where it is in the drive."""
        if not self.documented:
            raise DriveError(Cause.LOG_UNDOCUMENTED, model=self._state.model.name)
        return self._moved or self._state.model.error_logs[self._params.protocol]

    async def _read(self, limit: int, known: int, priority: Priority) -> list[tuple[int, int]]:
        """
        Read the entries down to a known one; again if one comes in meanwhile.

        :returns: the number of each, too.
        """
        area = self.area
        for _ in range(_READINGS):
            entries = await self._read_down(area, limit, known, priority)
            # an entry that came in meanwhile has moved the others
            if not entries or await self._read_down(area, 1, 0, priority) == entries[:1]:
                return entries
        raise DriveError(Cause.LOG_CHANGES)

    async def _read_down(
        self, area: ErrorLogArea, limit: int, known: int, priority: Priority
    ) -> list[tuple[int, int]]:
        """Read entries until one is empty or known, or until there are no more."""
        found: list[tuple[int, int]] = []
        for number in range(area.limit):
            try:
                entry = await self._entry(number, priority)
            except Refused:
                if number < area.entries:
                    raise
                break
            if area.sub_stride and not number and not area.code(entry):
                # no fault is active
                continue
            if not area.code(entry) or entry == known:
                break
            found.append((number, entry))
            if len(found) == limit:
                break
        return found

    async def _entry(self, number: int, priority: Priority, message: int = 0) -> int:
        area = self.area
        try:
            return await self._entry_of(area, number, priority, message)
        except Refused as error:
            if number or area.elsewhere is None or error.code != Refused.ILLEGAL_ADDRESS:
                raise
            area = replace(area, first=area.elsewhere, elsewhere=None)
            try:
                entry = await self._entry_of(area, number, priority)
            except Refused:
                raise error from None
            self._moved = area
            return entry

    async def _entry_of(
        self, area: ErrorLogArea, number: int, priority: Priority, message: int = 0
    ) -> int:
        # no client waits for what is read in the background, so it is not retried at once
        data = await self._params.read_from(
            Address(*area.place(number, message)), priority, retry=priority <= Priority.POLL
        )
        return area.codec.decode(data)

    def _decode(self, entry: int, now: float) -> LogEntry:
        code, then = self.area.code(entry), self.area.hours(entry)
        clock, age, at, latest = self._state.bus.now, math.nan, math.nan, math.nan
        # one tick of tolerance, for the drive rounds
        if now > then - TICK:
            age = max(0.0, now - then)
            latest = clock() - max(0.0, age - TICK) * _HOUR
            # an entry in the tick of the first reading may be from before it was switched on
            if then > self.powered_since:
                at = clock() - age * _HOUR
        text = self._state.nameplate.text_of(code)
        return LogEntry(code, text, round(then, 1), age, at, latest, now=clock)


class ErrorLogMonitor:
    """
    Watches the error log of one drive in the background; used on the bus alone.

    It is read when a fault comes, and now and then: a fault that was acknowledged between two
    polls, or while the drive was not reached, has left an entry, too. Reading acknowledges nothing.
    """

    def __init__(self, state: DriveState, log: ErrorLog) -> None:
        self._bus = state.bus
        self._state = state
        self._error_log = log
        self._task: Task | None = None
        #: The newest entry, as it was read; ``None`` if there is none.
        self.newest: LogEntry | None = None
        #: The same as the drive encodes it, 0 if there is none; ``None`` before the first reading.
        self._known: int | None = None
        self._looked_at = self._reported_at = -math.inf
        #: The fault whose entry is looked for, and how many tries are left.
        self._fault: InverterStatus | None = None
        self._tries = 0

    def begin(self) -> None:
        """
        Watch from now on, if the log is documented and its entries have a time.

        Without a time, a new entry looks like the one before of the same fault.
        """
        if not self._error_log.timed or not self._error_log.reached:
            return
        self._known = None
        self._looked_at = self._reported_at = -math.inf
        self.expect()
        self._task = self._bus.spawn(self._watch_repeatedly())

    def end(self) -> None:
        """Stop watching."""
        self._bus.cancel(self._task)

    def expect(self) -> None:
        """Look for the entry of the active fault."""
        self._fault, self._tries = self._state.fault, _TRIES
        self._bus.wake(self._task)

    async def _watch_repeatedly(self) -> None:
        state = self._state
        while True:
            there = state.contact.connected and state.contact.responsive
            if there:
                try:
                    await self._read_log()
                except Refused as error:
                    if not error.is_busy:
                        # a request for what it lacks may make a Classic drive stop the motor
                        state.notify(Severity.INFO, Cause.LOG_NOT_WATCHED, error=str(error))
                        return
                except DriveError as error:
                    _log.debug('%s', error)
                except LinkError:
                    # the poll reports it if the drive is lost
                    state.missed()
            await self._bus.sleep(self._pause() if there else _WAIT)

    def _pause(self) -> float:
        if self._fault is not None and self._tries:
            self._tries -= 1
            return _RETRY_PERIOD
        self._fault = None
        return _PERIOD

    async def _read_log(self) -> None:
        log, known, began = self._error_log, self._known, self._state.bus.now()
        news = await log.newer_than(known, Priority.TELEMETRY)
        now = await log.read_time(Priority.TELEMETRY)
        newest = self._known = news[0] if news else known or 0
        fault = self._fault
        if known is None:
            self.newest = next(iter(log.decode(news, now)), None)
            # entries older than this driver are no news, but for that of the active fault
            code = fault and fault.code
            news = [entry for entry in news if log.area.code(entry) == code]
        elif not news and fault is not None and self._repeats(fault, newest, now):
            news = [newest]
        entries = [self._dated(entry, began) for entry in log.decode(news, now)]
        self._looked_at = began
        if entries:
            self._reported_at = self._state.bus.now()
            self._report(entries)

    def _repeats(self, fault: InverterStatus, newest: int, now: float) -> bool:
        """Return whether a fault has left the same entry as the one before, within one tick."""
        area = self._error_log.area
        same = area.code(newest) == fault.code and now - area.hours(newest) < 2 * TICK
        return same and self._reported_at < fault.at - _SOON

    def _dated(self, entry: LogEntry, began: float) -> LogEntry:
        """Return a new entry with the moment when it came, where that is known."""
        fault = self._fault
        if fault and fault.code == entry.code and self._state.fault_is_fresh:
            return replace(entry, at=fault.at)
        return replace(entry, at=began) if began - self._looked_at < 2 * _PERIOD else entry

    def _report(self, entries: Sequence[LogEntry]) -> None:
        self.newest = entries[0]
        codes = {entry.code for entry in entries}
        code = None
        if self._fault is not None and self._fault.code in codes:
            code, self._fault = self._fault.code, None
        for entry in reversed(entries):
            if entry.code == code:
                self._state.notify(Severity.INFO, Cause.LOG_ENTRY, entry=entry)
            else:
                self._state.notify(Severity.WARNING, Cause.LOG_ENTRY_UNSEEN, entry=entry)
            try:
                self._state.listener.on_log_entry(entry)
            except Exception:
                _log.exception('an entry of the error log could not be reported')
