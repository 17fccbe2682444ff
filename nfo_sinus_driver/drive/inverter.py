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

"""What is known of one drive: who it is, what its status says, whether it answers."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from fractions import Fraction
import logging
import math

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog import Model
from nfo_sinus_driver.catalog import Status
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.drive.settings import DriveSettings
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.drive.snapshot import Listener
from nfo_sinus_driver.drive.snapshot import Severity

_log = logging.getLogger(__name__)

_UNITS = {'Freque': 'Hz', 'Speed': 'rpm', 'Torque': '%'}


@dataclass(frozen=True)
class Identity:
    """
    Who answers; ``''`` is what it does not tell.

    :ivar firmware: SWVer, such as 4.38 [M0 §8.1].
    :ivar motor_firmware: NFOVer, such as 4018.
    :ivar vendor: who made it.
    :ivar model: its product name and size, such as ``NFO Sinus 1.50/400`` [M0 §6.2.4].
    :ivar serial: its serial number.
    """

    firmware: float
    motor_firmware: int
    vendor: str = ''
    model: str = ''
    serial: str = ''

    @property
    def versions(self) -> str:
        """Both firmwares, such as ``4.38 / 4018``."""
        return f'{self.firmware:.2f} / {self.motor_firmware}'

    def __str__(self) -> str:
        serial = (f'serial {self.serial}',) if self.serial else ()
        model = (self.model,) if self.model else ()
        return ', '.join((*model, f'firmware {self.versions}', *serial))


class Inverter:
    """The driver's knowledge of one drive; used on the bus alone, readable from anywhere."""

    def __init__(
        self, model: Model, registers: Registers, listener: Listener, settings: DriveSettings
    ) -> None:
        self.model = model
        self.settings = settings
        self._registers = registers
        self._listener = listener
        self.connected = False
        #: The last poll was answered; while it was not, nobody else should wait for the drive.
        self.answering = False
        self.identity: Identity | None = None
        self.seen: InverterStatus | None = None
        #: Hz and rpm, as last polled.
        self.frequency = math.nan
        self.speed = math.nan
        self.control_mode = ''
        self.unit = ''
        #: SioTot, s; 0 turns the drive's own time-out off.
        self.sio_tot = 0.0
        #: AutoStop: without it the motor runs on when SioTot has passed [C91].
        self.auto_stop = False

    async def look(self, priority: Priority, *, once: bool = False) -> InverterStatus:
        """
        Read the status, without acknowledging anything.

        :param once: do not repeat a request when nobody answers.
        :raises LinkError: the drive does not answer.
        """
        word, at = await self._registers.read_at('fieldbus.drive_status', priority, once=once)
        code = await self._registers.read_number('fieldbus.inv_st', priority, once=once)
        assert isinstance(word, int)
        # the upper half is described nowhere [C24]
        kind = self.model.inv_st(int(code)).kind
        if kind is Kind.FAULT and not word & Status.FAULTED:
            # either the fault came between the two, or the drive treats it as an alarm [C95]
            word, at = await self._registers.read_at('fieldbus.drive_status', priority, once=once)
            assert isinstance(word, int)
        seen = InverterStatus(at, word & 0xFFFF, int(code))
        # a look of low priority may be overtaken by one that began later
        if self.seen is None or seen.at >= self.seen.at:
            self.seen = seen
        return seen

    async def read_timeout(self) -> None:
        """Read whether the drive has a time-out of its own."""
        self.sio_tot = await self._registers.read_number('serial.sio_tot', Priority.SERVICE)
        words = await self._registers.read_words('serial.auto_stop', Priority.SERVICE)
        # a code that means neither ON nor OFF is not relied upon
        self.auto_stop = words == self._registers.words('serial.auto_stop', True)

    async def identify(self) -> Identity:
        """
        Find out whether somebody answers, and with which firmware.

        :raises LinkError: nobody does.
        """
        firmware = await self._registers.read_number('fieldbus.sw_ver', Priority.SERVICE)
        motor = await self._registers.read_number('fieldbus.nfo_ver', Priority.SERVICE)
        self.identity = Identity(firmware, int(motor))
        return self.identity

    async def introduce(self) -> Identity:
        """
        Ask the drive who it is, beyond what :meth:`identify` has found.

        Nothing depends on it: many drives do not tell [C57].

        :raises PortError: the port is not open.
        """
        assert self.identity is not None
        told = await self._registers.identify(Priority.SERVICE)
        self.identity = dataclasses.replace(
            self.identity,
            vendor=told.vendor,
            model=f'{told.product} {told.model}'.strip(),
            serial=told.serial,
        )
        return self.identity

    async def read_control_mode(self, priority: Priority = Priority.SERVICE) -> str:
        """Read which quantity is controlled: ``Freque``, ``Speed``, ``Torque`` or ``PI-Reg``."""
        self.control_mode = await self.read_label('control.mode', priority)
        if self.control_mode == 'PI-Reg':
            self.unit = await self.read_label('pi_reg.unit', priority)
        else:
            self.unit = _UNITS.get(self.control_mode, '')
        return self.control_mode

    async def read_label(self, key: str, priority: Priority = Priority.SERVICE) -> str:
        """Read a parameter that is an enumeration."""
        return str(await self._registers.read(key, priority))

    async def read_number(self, key: str) -> float:
        """Read a parameter that is a number."""
        return await self._registers.read_number(key, Priority.SERVICE)

    @property
    def kind(self) -> Kind:
        """How grave the inverter status is; the fault bit has the last word [C95]."""
        if self.seen is None:
            return Kind.STATUS
        kind = self.model.inv_st(self.seen.code).kind
        if self.seen.faulted:
            return Kind.FAULT
        return Kind.ALARM if kind is Kind.FAULT else kind

    @property
    def text(self) -> str:
        """The inverter status as on the display."""
        if self.seen is None:
            return ''
        firmware = Fraction(self.identity.firmware) if self.identity else None
        return self.model.inv_st_text(self.seen.code, firmware)

    def describe(self) -> str:
        """Return the inverter status for a message: code and text."""
        if self.seen is None:
            return 'its status is not known'
        return f'{self.seen.code} {self.text}'

    def has(self, key: str) -> bool:
        """Tell whether the drive's firmware is new enough for a parameter."""
        since = self.model[key].since
        firmware = self.identity.firmware if self.identity else math.inf
        return since is None or firmware > float(since) - 0.001

    def tell(self, severity: Severity, text: str) -> None:
        """Say something to a person; what cannot be told keeps nothing from being done."""
        try:
            self._listener.on_event(severity, text)
        except Exception:
            _log.exception('this could not be told: %s', text)
