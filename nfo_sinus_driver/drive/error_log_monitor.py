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

"""The watch over the error log of one drive: a new entry is told, whoever saw the fault."""

from __future__ import annotations

from collections.abc import Sequence
import logging
import math
import time

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.bus import Task
from nfo_sinus_driver.catalog.error_log import TICK
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.error_log import ErrorLog
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.events import Severity
from nfo_sinus_driver.drive.log_entry import LogEntry
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.drive.snapshot import Listener
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import Refused

_log = logging.getLogger(__name__)

#: How often it is looked whether a fault that nobody saw has left an entry, s.
_PERIOD = 30.0
#: How often it is looked whether the drive is there again, s.
_WAIT = 1.0
#: How often the entry of a fault that was seen is looked for, s, and how many times.
_RETRY_PERIOD = 0.2
_TRIES = 10
#: An entry that was told so shortly before a poll saw its fault is that fault's, s.
_SOON = 2.0


class ErrorLogMonitor:
    """
    Watches the error log of one drive in the background; used on the bus alone.

    It is read when a fault comes, and now and then: a fault that was acknowledged between two
    polls, or while the drive was not reached, has left an entry too. Nothing is acknowledged by it.
    """

    def __init__(self, bus: Bus, inverter: DriveState, log: ErrorLog, listener: Listener) -> None:
        self._bus = bus
        self._inverter = inverter
        self._error_log = log
        self._listener = listener
        self._task: Task | None = None
        #: The newest entry, as it was read; ``None`` if there is none.
        self.newest: LogEntry | None = None
        #: The same as it stands in the drive, 0 if there is none; ``None`` before the first look.
        self._known: int | None = None
        self._looked_at = self._told_at = -math.inf
        #: The fault whose entry is looked for, and how often yet.
        self._fault: InverterStatus | None = None
        self._tries = 0

    def begin(self) -> None:
        """
        Watch from now on, where it is documented how to read the log.

        Where entries have no time, nothing tells a new one from the same fault before.
        """
        if not self._error_log.timed:
            return
        self._known = None
        self._looked_at = self._told_at = -math.inf
        self._inverter.on_fault = self._expect
        self._expect()
        self._task = self._bus.spawn(self._watch_for_ever())

    def end(self) -> None:
        """Leave the log alone."""
        self._inverter.on_fault = lambda: None
        if self._task is not None:
            task, self._task = self._task, None
            self._bus.cancel(task)

    def _expect(self) -> None:
        """Look for the entry of the fault that stands, if one does."""
        self._fault, self._tries = self._inverter.fault, _TRIES
        if self._task is not None:
            self._bus.wake(self._task)

    async def _watch_for_ever(self) -> None:
        inverter = self._inverter
        while True:
            there = inverter.connected and inverter.answering
            if there:
                try:
                    await self._look()
                except Refused as error:
                    if error.code != Refused.BUSY:
                        # asked for what it does not have, a Classic drive may stop the motor
                        not_watched = Report(Cause.LOG_NOT_WATCHED, error=str(error))
                        inverter.tell(Severity.INFO, not_watched)
                        return
                except DriveError as error:
                    _log.debug('%s', error)
                except LinkError:
                    # the poll says so if the drive is lost
                    inverter.missed()
            await self._bus.sleep(self._pause() if there else _WAIT)

    def _pause(self) -> float:
        if self._fault is not None and self._tries:
            self._tries -= 1
            return _RETRY_PERIOD
        self._fault = None
        return _PERIOD

    async def _look(self) -> None:
        """Read what is new, and tell it."""
        log, known, began = self._error_log, self._known, time.monotonic()
        news = await log.newer_than(known, Priority.TELEMETRY)
        now = await log.read_time(Priority.TELEMETRY)
        newest = self._known = news[0] if news else known or 0
        fault = self._fault
        if known is None:
            self.newest = next(iter(log.understood(news, now)), None)
            # what is older than this driver is no news, but for the fault that stands
            code = fault and fault.code
            news = [entry for entry in news if log.area.code(entry) == code]
        elif not news and fault is not None and self._repeats(fault, newest, now):
            news = [newest]
        for entry in reversed(news):
            at = self._moment(entry, began)
            if not math.isnan(at):
                log.note_sighting(entry, at)
        self._looked_at = began
        if news:
            self._told_at = time.monotonic()
            self._tell(log.understood(news, now))

    def _repeats(self, fault: InverterStatus, newest: int, now: float) -> bool:
        """Tell whether a fault has left the same entry as the one before, within one tick."""
        area = self._error_log.area
        same = area.code(newest) == fault.code and now - area.hours(newest) < 2 * TICK
        return same and self._told_at < fault.at - _SOON

    def _moment(self, entry: int, began: float) -> float:
        """Return when a new entry came, as far as that was seen; else NaN."""
        fault = self._fault
        code = self._error_log.area.code(entry)
        if fault and fault.code == code and self._inverter.fault_is_fresh:
            return fault.at
        return began if began - self._looked_at < 2 * _PERIOD else math.nan

    def _tell(self, entries: Sequence[LogEntry]) -> None:
        """Tell of new entries, the newest of which is the first."""
        self.newest = entries[0]
        codes = {entry.code for entry in entries}
        code = None
        if self._fault is not None and self._fault.code in codes:
            code, self._fault = self._fault.code, None
        for entry in reversed(entries):
            if entry.code == code:
                self._inverter.tell(Severity.INFO, Report(Cause.LOG_ENTRY, entry=entry))
            else:
                unseen = Report(Cause.LOG_ENTRY_UNSEEN, entry=entry)
                self._inverter.tell(Severity.WARNING, unseen)
            try:
                self._listener.on_log_entry(entry)
            except Exception:
                _log.exception('an entry of the error log could not be told')
