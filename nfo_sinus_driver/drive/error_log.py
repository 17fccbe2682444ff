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

from dataclasses import dataclass
import math

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import ERROR_LOG
from nfo_sinus_driver.catalog import ErrorLogArea
from nfo_sinus_driver.catalog import Scmd
from nfo_sinus_driver.drive.errand import Errands
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.inverter import Inverter
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.link import Address
from nfo_sinus_driver.link import Refused

#: The operating time of an entry [M2 §9].
_HOURS_PER_TICK = 0.1
_TICKS = 0xFFFFFF
#: How often the log is read anew when an entry came in meanwhile.
_TRIES = 3
_ENERGY = 'status.e_out'
#: A counter that was reset may have counted on since, kWh.
_NEARLY_NOTHING = 0.1


@dataclass(frozen=True)
class LogEntry:
    """
    One entry of the error log.

    :ivar code: as the inverter status has it.
    :ivar text: as on the display.
    :ivar operating_time: the drive's operating time when it happened, h.
    :ivar age: operating hours ago; NaN if the drive does not tell.
    """

    code: int
    text: str
    operating_time: float
    age: float

    def __str__(self) -> str:
        age = '' if math.isnan(self.age) else f', {self.age:.1f} operating hours ago'
        return f'{self.code} {self.text} at {self.operating_time:.1f} h{age}'


class ErrorLog:
    """The error log and the kWh counter of one drive; used on the bus alone."""

    def __init__(self, inverter: Inverter, registers: Registers, errands: Errands) -> None:
        self._inverter = inverter
        self._registers = registers
        self._errands = errands

    async def read_now(self, most: int = 0) -> tuple[LogEntry, ...]:
        """
        Read the error log, newest entry first ([M0 §8.4], [M2 §9]).

        :param most: how many entries at most; 0 is all that every drive has, 32 [C4].
        :raises DriveError: the model's is not documented, or it cannot be read.
        """
        area = self._area()
        limit = min(most or area.entries, area.limit)
        for _ in range(_TRIES):
            words = await self._read(area, limit)
            # an entry that came in meanwhile has moved the others
            if not words or await self._entry(area, 0) == words[0]:
                break
        else:
            raise DriveError('the drive writes into its error log all the time: try again')
        now = await self._registers.read_number('status.op_time', Priority.POLL)
        return tuple(self._understood(entry, now) for entry in words)

    async def erase_now(self) -> str:
        """
        Erase the error log by SCMD [M0 table 18], and see that it is empty.

        :raises DriveError: it was not erased, and why.
        """
        what = 'erasing the error log'
        self._errands.require(what)
        area = self._area()
        async with self._errands.sent(what):
            await self._errands.tell(Scmd.ERASE_E_LOG)
            if await self._entry(area, 0) >> 24:
                raise DriveError('the drive took the command, but its error log is not empty')
        return 'the error log is erased'

    async def reset_energy_now(self) -> str:
        """
        Reset the kWh counter E-Out by SCMD, from firmware 4.38 on [M0 table 18], and see it at 0.

        :raises DriveError: it was not reset, and why.
        """
        what = 'resetting the kWh counter'
        self._errands.require(what)
        if not self._inverter.has(_ENERGY):
            told = self._inverter.identity
            raise DriveError(
                f'{what} came with firmware 4.38; this drive has '
                f'{(told and told.versions) or "an older one"}'
            )
        async with self._errands.sent(what):
            before = await self._registers.read_number(_ENERGY, Priority.SERVICE)
            await self._errands.tell(Scmd.RESET_E_OUT)
            after = await self._registers.read_number(_ENERGY, Priority.SERVICE)
            if after > min(before, _NEARLY_NOTHING):
                raise DriveError(f'the drive took the command, but {_ENERGY} is {after:g} kWh')
        return f'{_ENERGY}: {before:.3f} -> {after:.3f} kWh'

    def _area(self) -> ErrorLogArea:
        if not self._inverter.has('fieldbus.scmd'):
            raise DriveError(
                f'the error log of this model ({self._inverter.model.name}) is not documented [M1]'
            )
        return ERROR_LOG[self._registers.protocol]

    async def _read(self, area: ErrorLogArea, limit: int) -> list[int]:
        """Read entries until one is empty, or until there are no more."""
        found: list[int] = []
        while len(found) < limit:
            try:
                entry = await self._entry(area, len(found))
            except Refused:
                if len(found) < area.entries:
                    raise
                break
            if not entry >> 24:
                break
            found.append(entry)
        return found

    async def _entry(self, area: ErrorLogArea, number: int) -> int:
        """Read one entry as 32 bits; who waits for it goes by turns with the polls."""
        first = area.address(number)
        classic = self._registers.protocol.value == 'classic'
        numbers = (first, first + 1) if classic else (first,)
        words = await self._registers.read_from(Address(numbers, area.TYPE.words), Priority.POLL)
        return area.TYPE.to_raw(words)

    def _understood(self, entry: int, now: float) -> LogEntry:
        code = entry >> 24
        then = (entry & _TICKS) * _HOURS_PER_TICK
        # one tick of doubt, for the drive rounds
        age = max(0.0, now - then) if now > then - _HOURS_PER_TICK else math.nan
        return LogEntry(code, self._inverter.text_of(code), round(then, 1), age)
