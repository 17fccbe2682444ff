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

"""Control through MODE and SCMD [M0 §7.2 tables 17 and 18], or MODE and SMODE [M1]."""

from __future__ import annotations

from collections.abc import Sequence
import contextlib

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Mode
from nfo_sinus_driver.catalog import Scmd
from nfo_sinus_driver.catalog.inv_st import SIO_FAIL
from nfo_sinus_driver.catalog.words_optimal import Mode as OptimalMode
from nfo_sinus_driver.catalog.words_optimal import Smode
from nfo_sinus_driver.drive.control_method import Reached
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.reference import Reference
from nfo_sinus_driver.drive.reference import references
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.drive.settings import CONTROL_MODES
from nfo_sinus_driver.link import Refused


class ModeScmd:
    """
    Control of one Sinus G2 through MODE and SCMD; a control method.

    :param run: the run command, which says where the reference comes from.
    """

    name = 'mode_scmd'
    coasts = True
    #: The parameter that takes the run command; its codes for stop and run are the same on both.
    _command = 'fieldbus.scmd'

    def __init__(self, registers: Registers, run: int = Scmd.FIELDBUS) -> None:
        self._registers = registers
        self._run = run

    async def in_control(self, priority: Priority) -> bool:
        """Tell whether the bus has control of the drive, from us or from whom was here before."""
        return await self._registers.read('fieldbus.mode', priority) == Mode.BUS

    async def take_control(self) -> None:
        """
        Put the drive under bus control with no run command standing.

        :raises DriveError: it is tuning.
        """
        mode = await self._registers.read('fieldbus.mode', Priority.SERVICE)
        if mode == Mode.INHIBIT:
            raise DriveError('the drive lets nobody take control now (MODE is Inhibit: tuning?)')
        if mode == Mode.BUS:
            await self._registers.write(self._command, Scmd.STOP, Priority.SERVICE)
        else:
            await self._registers.write('fieldbus.mode', Mode.BUS, Priority.SERVICE)

    async def zero_setpoint(self, control_mode: str, priority: Priority) -> None:
        """
        Write set-point 0 in the unit of a control mode, and read it back.

        :raises DriveError: the drive keeps another value.
        """
        await Reference(self._registers, control_mode).set_to_zero(priority)

    async def run(self, reached: Reached) -> None:
        """Give the run command; once, for nobody knows what has happened before a second one."""
        await self._registers.write(self._command, self._run, Priority.SERVICE, once=True)

    async def stop(self, control_mode: str) -> None:
        """
        Take the run command back and write set-point 0, at the head of the bus.

        Does nothing to a drive that is not under bus control.

        :raises LinkError: the drive does not answer, or refuses although the bus has control.
        """
        try:
            await self._registers.write(self._command, Scmd.STOP, Priority.STOP, once=True)
            for reference in self._references(control_mode):
                await reference.write_zero(Priority.STOP)
        except Refused:
            if await self.in_control(Priority.STOP):
                raise

    async def quick_stop(self, control_mode: str) -> None:
        """Release the motor at once, as <Stop> on the keypad does; control is given back."""
        await self._registers.write('fieldbus.mode', Mode.STOP, Priority.STOP)
        for reference in self._references(control_mode):
            # a drive may well refuse a set-point while the bus has no control
            with contextlib.suppress(Refused):
                await reference.write_zero(Priority.STOP, once=False)

    def _references(self, control_mode: str) -> Sequence[Reference]:
        """Return where a set-point may stand that the motor would follow."""
        return references(self._registers, (control_mode,))

    async def release(self) -> None:
        """Give control back; never by MODE = Ext, which can start the motor [C43]."""
        if await self.in_control(Priority.SERVICE):
            await self._registers.write('fieldbus.mode', Mode.STOP, Priority.SERVICE)

    async def acknowledge(self, code: int) -> str:
        """Acknowledge a fault; a serial fault is ended by MODE = Stop [M0 §6.1.5], [C42]."""
        await self._registers.acknowledge('fieldbus.inv_st_with_ack', Priority.SERVICE)
        if code != SIO_FAIL:
            return ''
        # older firmware obeys no MODE while the fault stands [C9]
        why = await self._registers.acknowledge_serial_fault()
        await self._registers.write('fieldbus.mode', Mode.STOP, Priority.SERVICE)
        return why


class ModeSmode(ModeScmd):
    """
    Control of one Sinus Optimal through MODE and SMODE [M1]; a control method.

    Its MODE has no Stop: 1 is Manual, the keypad's, and 2 is Auto, which may start the motor and is
    never written [C51]. It has no way to release the motor at once [C96].

    Nothing tells its control mode, so whichever is assumed, every set-point is 0 before it runs: an
    old one in the register of the other mode would turn the motor.
    """

    coasts = False
    _command = 'fieldbus.smode'

    async def take_control(self) -> None:
        """Put the drive under bus control with no run command standing."""
        if await self.in_control(Priority.SERVICE):
            await self._registers.write(self._command, Smode.STOP, Priority.SERVICE)
        else:
            await self._registers.write('fieldbus.mode', OptimalMode.BUS, Priority.SERVICE)

    async def zero_setpoint(self, control_mode: str, priority: Priority) -> None:
        """
        Write set-point 0 for every control mode, and read it back.

        :raises DriveError: the drive keeps another value.
        """
        for reference in self._references(control_mode):
            await reference.set_to_zero(priority)

    def _references(self, control_mode: str) -> Sequence[Reference]:
        return references(self._registers, CONTROL_MODES)

    async def quick_stop(self, control_mode: str) -> None:
        """Stop as usual: there is no other way."""
        await self.stop(control_mode)

    async def release(self) -> None:
        """Give control back to the keypad, once no run command stands."""
        if await self.in_control(Priority.SERVICE):
            await self._registers.write(self._command, Smode.STOP, Priority.SERVICE)
            await self._registers.write('fieldbus.mode', OptimalMode.MANUAL, Priority.SERVICE)

    async def acknowledge(self, code: int) -> str:
        """Acknowledge a fault by reading the status that does [M1]."""
        await self._registers.acknowledge('fieldbus.inv_st_with_ack', Priority.SERVICE)
        return ''
