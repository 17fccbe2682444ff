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

from collections.abc import Awaitable
from collections.abc import Sequence
import contextlib

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Meaning
from nfo_sinus_driver.drive.advice import CONTROLLED_ELSEWHERE
from nfo_sinus_driver.drive.control_method import Reached
from nfo_sinus_driver.drive.control_method import Removal
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.reference import Reference
from nfo_sinus_driver.drive.reference import references
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.drive.settings import CONTROL_MODES
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.families.sinus_optimal.words import Mode as OptimalMode
from nfo_sinus_driver.families.sinus_optimal.words import Smode
from nfo_sinus_driver.link import Refused

#: The priority of what an acknowledgement takes: with it the motor might go on.
_ACK = Priority.SERVICE


class ModeScmd:
    """
    Control of one Sinus G2 through MODE and SCMD; a control method.

    :param run: the run command, which says where the reference comes from.
    """

    name = 'mode_scmd'
    coasts = True
    #: The parameter that takes the run command; its codes for stop and run are the same on both.
    _command = 'fieldbus.scmd'
    #: What releases the motor soonest; SCMD = Stop would let it ramp down.
    _soonest: tuple[str, int] = ('fieldbus.mode', Mode.STOP)

    def __init__(self, registers: Registers, run: int = Scmd.FIELDBUS) -> None:
        self._registers = registers
        self._run = run

    async def in_control(self, priority: Priority) -> bool:
        """Tell whether the bus has control of the drive, from us or from whom was here before."""
        return await self._registers.read('fieldbus.mode', priority) == Mode.BUS

    async def take_control(self, reached: Reached) -> None:
        """
        Put the drive under bus control with no run command standing.

        No manual says that a drive forgets the run command of an earlier session when control is
        taken, so the stop is the very next frame.

        :raises DriveError: it is tuning.
        """
        mode = await self._registers.read('fieldbus.mode', Priority.SERVICE)
        if mode == Mode.INHIBIT:
            raise DriveError('the drive lets nobody take control now (MODE is Inhibit: tuning?)')
        if mode != Mode.BUS:
            await self._registers.write('fieldbus.mode', Mode.BUS, Priority.SERVICE)
            try:
                await self._registers.write(self._command, Scmd.STOP, Priority.STOP)
                return
            except Refused:
                # too soon for it, as it seems
                await reached(lambda seen: seen.from_bus)
        await self._registers.write(self._command, Scmd.STOP, Priority.STOP)

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

        Does nothing to a drive that is under the control of its keypad or terminals.

        :raises LinkError: the drive does not answer, or refuses although the bus has control or,
            under Inhibit, nobody can say who has: it may be tuning [C101].
        """
        try:
            await self._registers.write(self._command, Scmd.STOP, Priority.STOP, once=True)
            for reference in self._references(control_mode):
                await reference.write_zero(Priority.STOP)
        except Refused:
            mode = await self._registers.read('fieldbus.mode', Priority.STOP)
            if mode in (Mode.INHIBIT, Mode.BUS):
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

    async def remove(self, control_mode: str) -> Removal:
        """Write SCMD = Stop, set-point 0 and MODE = Stop, and read back what can be read."""
        command = await self._taken(self._registers.write(self._command, Scmd.STOP, _ACK))
        setpoint = await self._setpoint_removed(control_mode)
        command |= await self._control_removed()
        if command:
            return Removal.COMMAND
        return Removal.SETPOINT if setpoint else Removal.NOTHING

    async def _setpoint_removed(self, control_mode: str) -> bool:
        """Write set-point 0 wherever the motor would follow one; tell whether it is."""
        references = self._references(control_mode)
        writes = [reference.set_to_zero(_ACK) for reference in references]
        return bool(writes) and all([await self._taken(write) for write in writes])

    async def _control_removed(self) -> bool:
        """Write MODE = Stop, with which no run command stands; tell whether it is."""
        taken = await self._taken(self._registers.write('fieldbus.mode', Mode.STOP, _ACK))
        return taken and not await self.in_control(_ACK)

    @staticmethod
    async def _taken(write: Awaitable[None]) -> bool:
        """Tell whether the drive takes a write, and keeps it where that is looked at."""
        try:
            await write
        except (Refused, DriveError):
            return False
        return True

    async def acknowledge(self, code: int, control_mode: str) -> str:
        """
        Acknowledge a fault: a serial one by MODE = Stop, else by reading SioErr ([C42], [C99]).

        Any other by reading the status that acknowledges, once nothing is left that could turn the
        motor. If the drive lets go of nothing, what releases it soonest is the very next frame.

        :raises DriveError: a serial fault is left, for keypad or terminals keep the control that
            MODE = Stop would take from them.
        """
        listed = self._registers.model.status_code(code)
        if Meaning.SERIAL_FAILURE not in listed.meanings:
            await self._acknowledge_by_reading(control_mode)
            return ''
        elsewhere = await self._controlled_elsewhere()
        if not elsewhere:
            await self._control_removed()
        why = ''
        if await self._shows(code):
            # older firmware obeys no MODE that is for it alone while the fault is active [C9]
            why = await self._registers.acknowledge_serial_fault()
        if await self._shows(code):
            await self._acknowledge_by_reading(control_mode)
            if elsewhere and await self._shows(code):
                raise DriveError(CONTROLLED_ELSEWHERE)
        return why

    async def _controlled_elsewhere(self) -> bool:
        """Tell whether keypad or terminals have control, which MODE = Stop would take from them."""
        return await self._registers.read('fieldbus.mode', _ACK) == Mode.EXT

    async def _shows(self, code: int) -> bool:
        return await self._registers.read('fieldbus.inv_st', _ACK) == code

    async def _acknowledge_by_reading(self, control_mode: str) -> None:
        key = 'fieldbus.inv_st_with_ack'
        ours = await self.in_control(_ACK)
        if ours and await self.remove(control_mode) is not Removal.COMMAND:
            # refused while the cause of the fault lasts: the status will tell
            with contextlib.suppress(Refused):
                await self._registers.acknowledge_and_write(key, *self._soonest)
        else:
            await self._registers.acknowledge(key, _ACK)


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
    _soonest = ('fieldbus.smode', Smode.STOP)

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

    async def _control_removed(self) -> bool:
        """Leave control where it is: Manual would hand it to the keypad."""
        return False

    async def _controlled_elsewhere(self) -> bool:
        """Tell that it does not matter: MODE is not written here."""
        return False
