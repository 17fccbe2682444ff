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

"""
Control through the control word: the generic state machine of the G2 [M0 §7.1 tables 14 to 16], and
the few bits of it that the Optimal has [M1].

The same register and the opposite order: the G2 is switched on and then enabled, the Optimal
enabled and then switched on [C54].
"""

from __future__ import annotations

import contextlib

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Meaning
from nfo_sinus_driver.catalog import State
from nfo_sinus_driver.drive.advice import CONTROLLED_ELSEWHERE
from nfo_sinus_driver.drive.control_method import Reached
from nfo_sinus_driver.drive.control_method import Removal
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.reference import Reference
from nfo_sinus_driver.drive.reference import references
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.families.sinus_g2.words import Control
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.families.sinus_g2.words import Status
from nfo_sinus_driver.families.sinus_optimal import words as words_optimal
from nfo_sinus_driver.link import Refused

_WORD = 'fieldbus.drive_control'
_MASK = 'fieldbus.drv_ctrl_write_mask'
_STATUS = 'fieldbus.drive_status'

#: Power and ramps; with it the G2 waits in READY_TO_SWITCH_ON.
_READY = (
    Control.NET_CTRL
    | Control.ENABLE_VOLTAGE
    | Control.DISABLE_QUICK_STOP
    | Control.ENABLE_RFG
    | Control.UNLOCK_RFG
    | Control.USE_REF_FOR_RFG
)
_RUN = Control.SWITCH_ON | Control.ENABLE_OP | Control.ENABLE_REV_OP
_OPTIMAL_READY = words_optimal.Control.BUS_CONTROL
_OPTIMAL_RUN = words_optimal.Control.SWITCH_ON


class DriveControl:
    """
    Control of one Sinus G2 through DriveControl and DriveStatus; a control method.

    :param local_reference: the reference is the drive's own, not the one from the bus (NetRef).
    """

    name = 'drive_control'
    coasts = True

    def __init__(self, registers: Registers, *, local_reference: bool = False) -> None:
        self._registers = registers
        self._ready = _READY if local_reference else _READY | Control.NET_REF

    async def in_control(self, priority: Priority) -> bool:
        """Tell whether the network has control, by us or by whom was here before."""
        word = int(await self._registers.read_number(_STATUS, priority))
        return bool(word & Status.CTRL_FROM_NET)

    async def take_control(self, reached: Reached) -> None:
        """
        Request control with bit 0 low, so that a run command is an edge later [C35].

        :raises DriveError: it is tuning.
        """
        if await self._registers.read('fieldbus.mode', Priority.SERVICE) == Mode.INHIBIT:
            raise DriveError('the drive lets nobody take control now (MODE is Inhibit: tuning?)')
        await self._registers.write(_WORD, self._ready, Priority.SERVICE)

    async def zero_setpoint(self, control_mode: str, priority: Priority) -> None:
        """
        Write set-point 0 in the unit of a control mode, and read it back.

        :raises DriveError: the drive keeps another value.
        """
        await Reference(self._registers, control_mode).set_to_zero(priority)

    async def run(self, reached: Reached) -> None:
        """
        Switch on, then give the direction, each when the drive shows a state before it.

        From a motor that is still on its way to a stop bit 0 leads back to OPERATION_ENABLED, and
        without a direction from there to DISABLE, which shows as SHUTDOWN does ([M0 table 16],
        [C37]).
        """
        await reached(lambda seen: seen.state in (State.READY_TO_SWITCH_ON, State.STOPPING))
        switched_on = self._ready | Control.SWITCH_ON
        await self._registers.write(_WORD, switched_on, Priority.SERVICE, once=True)
        await reached(lambda seen: seen.state in (State.SWITCHED_ON, State.STOPPING))
        # reverse is the sign of the set-point; both direction bits at once mean no change [C36]
        await self._registers.write(
            _WORD, switched_on | Control.ENABLE_OP, Priority.SERVICE, once=True
        )

    async def stop(self, control_mode: str) -> None:
        """
        Take the run command back, so that the drive goes to SHUTDOWN, and write set-point 0.

        Does nothing to a drive that is not under bus control: who has control stays as it is.

        :raises LinkError: the drive does not answer, or refuses although the bus has control.
        """
        try:
            await self._change(~_RUN, Control(0), Priority.STOP)
            for reference in references(self._registers, (control_mode,)):
                await reference.write_zero(Priority.STOP)
        except Refused:
            if await self.in_control(Priority.STOP):
                raise

    async def quick_stop(self, control_mode: str) -> None:
        """Go to QUICK_STOP, which coasts [C96]; control is kept."""
        await self._change(
            ~(_RUN | Control.DISABLE_QUICK_STOP), Control.OVERRIDE_COAST, Priority.STOP, once=False
        )
        for reference in references(self._registers, (control_mode,)):
            with contextlib.suppress(Refused):
                await reference.write_zero(Priority.STOP, once=False)

    async def release(self) -> None:
        """
        Give control back by MODE = Stop, once the motor stands.

        Resetting NetCtrl would hand control to whatever is local, which may be a RUN input that is
        active.
        """
        if await self.in_control(Priority.SERVICE):
            await self._registers.write('fieldbus.mode', Mode.STOP, Priority.SERVICE)

    async def remove(self, control_mode: str) -> Removal:
        """Reset the run bits; where that is refused, write set-point 0 and MODE = Stop."""
        try:
            await self._change(~_RUN, Control(0), Priority.SERVICE, once=False)
            return Removal.COMMAND
        except Refused:
            pass
        try:
            await self._registers.write('fieldbus.mode', Mode.STOP, Priority.SERVICE)
            if not await self.in_control(Priority.SERVICE):
                return Removal.COMMAND
        except Refused:
            pass
        try:
            await self.zero_setpoint(control_mode, Priority.SERVICE)
        except (Refused, DriveError):
            return Removal.NOTHING
        return Removal.SETPOINT

    async def acknowledge(self, code: int, control_mode: str) -> str:
        """
        Acknowledge a fault by one rising edge of bit 7, whoever has control [M0 table 16].

        A serial fault by MODE = Stop alone first, else by reading SioErr [C99]. Over Classic
        nothing can be written while any fault is active, so that reading has to do [M0 §6.1.5]; the
        run bits that stand then lead nowhere without a new edge [M0 table 16].

        :raises DriveError: a serial fault is left, for keypad or terminals keep the control that
            MODE = Stop would take from them.
        """
        registers, why, elsewhere = self._registers, '', False
        if Meaning.SERIAL_FAILURE in registers.model.status_code(code).meanings:
            elsewhere = await registers.read('fieldbus.mode', Priority.SERVICE) == Mode.EXT
            if not elsewhere:
                with contextlib.suppress(Refused):
                    await registers.write('fieldbus.mode', Mode.STOP, Priority.SERVICE)
            why = await registers.acknowledge_serial_fault()
        try:
            for add in (Control(0), Control.RESET_MALFUNCTION, Control(0)):
                await self._change(~(_RUN | Control.RESET_MALFUNCTION), add, Priority.SERVICE)
        except Refused:
            if await self.remove(control_mode) is not Removal.COMMAND:
                # refused while the cause of the fault lasts: the status will tell
                with contextlib.suppress(Refused):
                    await registers.acknowledge_and_write(
                        'fieldbus.inv_st_with_ack', _WORD, self._ready
                    )
            else:
                await registers.acknowledge('fieldbus.inv_st_with_ack', Priority.SERVICE)
        if elsewhere and await registers.read('fieldbus.inv_st', Priority.SERVICE) == code:
            raise DriveError(CONTROLLED_ELSEWHERE)
        return why

    async def _change(
        self, keep: Control, add: Control, priority: Priority, *, once: bool = True
    ) -> None:
        """Change some bits of the control word and leave the others to who has control."""
        if self._registers.reaches(_MASK):
            # in one transaction: the AND mask first, then the OR mask [M0 §7.1]
            masks = int(keep) & 0xFFFF | int(add) << 16
            await self._registers.write(_MASK, masks, priority, once=once)
            return
        word = Control(int(await self._registers.read_number(_WORD, priority)))
        await self._registers.write(_WORD, word & keep | add, priority, once=once)


class OptimalDriveControl:
    """
    Control of one Sinus Optimal through Drive Control and Drive Status [M1]; a control method.

    Its reference comes from the terminals alone ([C54], [C56]), and it has no quick stop [C96].
    """

    name = 'drive_control'
    coasts = False

    def __init__(self, registers: Registers) -> None:
        self._registers = registers

    async def in_control(self, priority: Priority) -> bool:
        """Tell whether the bus has control, by us or by whom was here before."""
        word = int(await self._registers.read_number(_STATUS, priority))
        return bool(word & words_optimal.Status.CONTROL_FROM_BUS)

    async def take_control(self, reached: Reached) -> None:
        """
        Take control with neither Enable nor Switch on.

        Who lost it to keypad or terminals has to ask anew: the bit may still stand in the word.
        """
        if not await self.in_control(Priority.SERVICE):
            await self._registers.write(_WORD, words_optimal.Control(0), Priority.SERVICE)
        await self._registers.write(_WORD, _OPTIMAL_READY, Priority.SERVICE)

    async def zero_setpoint(self, control_mode: str, priority: Priority) -> None:
        """Do nothing: the reference is none of ours."""

    async def run(self, reached: Reached) -> None:
        """Enable, then switch on, when the drive shows that it is enabled."""
        enabled = _OPTIMAL_READY | words_optimal.Control.ENABLE
        await self._registers.write(_WORD, enabled, Priority.SERVICE)
        await reached(lambda seen: bool((seen.word or 0) & words_optimal.Status.ENABLED))
        await self._registers.write(_WORD, enabled | _OPTIMAL_RUN, Priority.SERVICE, once=True)

    async def stop(self, control_mode: str) -> None:
        """
        Reset Switch on, and leave the other bits to who has control.

        :raises LinkError: the drive does not answer, or refuses although the bus has control.
        """
        word = int(await self._registers.read_number(_WORD, Priority.STOP, once=True))
        try:
            await self._registers.write(_WORD, word & ~_OPTIMAL_RUN, Priority.STOP, once=True)
        except Refused:
            if await self.in_control(Priority.STOP):
                raise

    async def quick_stop(self, control_mode: str) -> None:
        """Stop as usual: there is no other way."""
        await self.stop(control_mode)

    async def release(self) -> None:
        """
        Take Enable back, and keep the bus control.

        Without it the terminals would have control, and a RUN input that is active might start the
        motor; [M1] names no way to give control back to nobody.
        """
        if await self.in_control(Priority.SERVICE):
            await self._registers.write(_WORD, _OPTIMAL_READY, Priority.SERVICE)

    async def remove(self, control_mode: str) -> Removal:
        """Reset Switch on."""
        word = int(await self._registers.read_number(_WORD, Priority.SERVICE))
        try:
            await self._registers.write(_WORD, word & ~_OPTIMAL_RUN, Priority.SERVICE)
        except Refused:
            return Removal.NOTHING
        return Removal.COMMAND

    async def acknowledge(self, code: int, control_mode: str) -> str:
        """Acknowledge a fault by one rising edge of bit 7 [M1]."""
        word = int(await self._registers.read_number(_WORD, Priority.SERVICE))
        low = word & ~(words_optimal.Control.FAULT_ACK | _OPTIMAL_RUN)
        for written in (low, low | words_optimal.Control.FAULT_ACK, low):
            await self._registers.write(_WORD, written, Priority.SERVICE)
        return ''
