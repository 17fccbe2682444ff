# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How a G2 is commanded by the drive profile of its CANopen module ([M0 table 11], [C121])."""

from __future__ import annotations

from collections.abc import Mapping
import contextlib
from typing import ClassVar

from nfo_sinus_driver.catalog.profile import (
    FAULT_GONE,
    Acknowledge,
    AcknowledgeThenWrite,
    ControlMethod,
    Holder,
    NotPossible,
    Read,
    Refusal,
    Removal,
    SetpointTarget,
    Steps,
    Until,
    Write,
    one_step,
    try_steps,
)
from nfo_sinus_driver.catalog.status import Meaning, State, StatusCode
from nfo_sinus_driver.families.sinus_g2.ds402 import words
from nfo_sinus_driver.families.sinus_g2.words import HOLDERS, INHIBITED, Mode

CONTROL_WORD = 'fieldbus.control_word'
STATUS_WORD = 'fieldbus.status_word'
MODE_OF_OPERATION = 'fieldbus.modes_of_operation_display'
_ERROR_CODE = 'fieldbus.error_code'
_DIMENSION = (
    'fieldbus.vl_dimension_factor_numerator', 'fieldbus.vl_dimension_factor_denominator'
)
_LEAST = 'fieldbus.vl_velocity_min_amount'
_MODE = 'fieldbus.mode'
_INV_ST_WITH_ACK = 'fieldbus.inv_st_with_ack'

#: By the mode of operation that is active (6061h). A speed that the bus may ask for is at most
#: that [M2 table 2].
SETPOINTS: Mapping[str, SetpointTarget] = {
    'Speed': SetpointTarget('fieldbus.vl_target_velocity', 9000.0, nominal='motor.n_nom'),
    'Torque': SetpointTarget('fieldbus.target_torque', 200.0, nominal=100.0),
}


class Ds402(ControlMethod):
    """
    Control by ControlWord and StatusWord; MODE hands control over, and commands nothing.

    Reverse is the sign of the set-point. While the bus has no control ("remote" is 0) the control
    word is not processed (CiA 402).
    """

    means = 'ControlWord'
    references = ('fieldbus',)
    coasts = True
    older = False
    addressing: ClassVar[str] = 'canopen'
    unused_scales = _DIMENSION
    needs = (CONTROL_WORD, STATUS_WORD, MODE_OF_OPERATION)

    def in_control(self) -> Steps[bool]:
        """Return whether the bus has control, taken by this session or an earlier one."""
        return bool(int((yield Read(STATUS_WORD))) & words.Status.REMOTE)

    def holder(self) -> Steps[Holder]:
        """Tell who has control of the drive; where it has no MODE, whether the bus has it."""
        try:
            return HOLDERS.get((yield Read(_MODE)), Holder.UNKNOWN)
        except Refusal:
            return Holder.BUS if (yield from self.in_control()) else Holder.UNKNOWN

    def require_startable(self) -> Steps[None]:
        """
        Ensure that a set-point means rpm, and that set-point 0 does not turn the motor.

        :raises NotPossible: the drive multiplies set-points, or has a least speed (CiA 402).
        """
        numerator, denominator = _DIMENSION
        above = yield from _read(numerator, 1)
        below = yield from _read(denominator, 1)
        if above != below:
            raise NotPossible(
                f'vl dimension factor (object 604Ch) is {above}/{below}, so that set-points do '
                'not mean rpm: set it to 1/1'
            )
        least = yield from _read(_LEAST, 0)
        if least:
            raise NotPossible(
                f'vl velocity min amount (object 6046h) is {least} rpm, so that the motor would '
                'turn at set-point 0: set it to 0'
            )

    def take_control(self) -> Steps[None]:
        """
        Switch off, so that a run command is an edge later, under control of the bus.

        The module holds the drive in bus mode [M0 §6.4]; one that has left it is put back. What
        stands in the control word then counts from that moment on, and what is written before may
        not count at all: it is switched off by the very next frame, and again.

        :raises NotPossible: MODE is Inhibit.
        """
        if (yield from self.holder()) is Holder.INHIBITED:
            raise NotPossible(f'control of the drive cannot be taken now ({INHIBITED})')
        if not (yield from self.in_control()):
            yield Write(_MODE, Mode.BUS)
            yield from try_steps(one_step(Write(CONTROL_WORD, words.SHUTDOWN, head=True)))
            yield Until(lambda status: bool((status.word or 0) & words.Status.REMOTE))
        yield Write(CONTROL_WORD, words.SHUTDOWN)

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """
        Write set-point 0 for the mode of operation that is active, and read it back.

        :raises NotPossible: the drive keeps another value, or takes none in this mode.
        """
        if control_mode not in SETPOINTS:
            raise NotPossible(
                f'the drive takes no set-point by DS402: its mode of operation (object 6061h) is '
                f'{control_mode}, and neither 2 (velocity) nor 4 (torque)'
            )
        yield from SETPOINTS[control_mode].set_to_zero()

    def run(self) -> Steps[None]:
        """
        Switch on, then enable operation, each when the drive shows a state before it.

        A motor that still ramps to a stop may show that operation is enabled, and is led back to it
        by the same commands.
        """
        ramps = State.OPERATION_ENABLED
        yield Until(lambda status: status.state in (State.READY_TO_SWITCH_ON, ramps))
        yield Write(CONTROL_WORD, words.SWITCH_ON, retry=False)
        yield Until(lambda status: status.state in (State.SWITCHED_ON, ramps))
        yield Write(CONTROL_WORD, words.ENABLE_OPERATION, retry=False)

    def stop(self, control_mode: str) -> Steps[None]:
        """
        Switch off, so that the motor stops as Shutdown option code says, and write set-point 0.

        Each step by itself [C126].
        """
        yield from self._command(words.SHUTDOWN, control_mode, retry=False)

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Take the voltage away: the motor coasts ([M0 table 16], [C96]); control is kept."""
        yield from self._command(words.DISABLE_VOLTAGE, control_mode, retry=True)

    def has_run_command(self) -> Steps[bool | None]:
        """Return whether the control word has more than "shutdown"; ``None``: it is not read."""
        try:
            word = int((yield Read(CONTROL_WORD)))
        except Refusal:
            return None
        return bool(word & words.ControlWord.SWITCH_ON)

    def force_stop(self, control_mode: str) -> Steps[bool]:
        """Switch off, take the voltage away, and take control away by MODE = Stop."""
        obeyed = yield from super().force_stop(control_mode)
        return (yield from try_steps(one_step(Write(_MODE, Mode.STOP)))) or obeyed

    def release(self) -> Steps[None]:
        """Give control back by MODE = Stop, if the drive takes it, once the motor stands."""
        if (yield from self.in_control()):
            yield from try_steps(one_step(Write(_MODE, Mode.STOP)))

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Switch off; where that is refused, MODE = Stop, and set-point 0."""
        if (yield from try_steps(one_step(Write(CONTROL_WORD, words.SHUTDOWN)))):
            return Removal.COMMAND
        released = yield from try_steps(one_step(Write(_MODE, Mode.STOP)))
        if released and not (yield from self.perhaps_in_control()):
            return Removal.COMMAND
        zero = yield from try_steps(self.zero_setpoint(control_mode))
        return Removal.SETPOINT if zero else Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault by one rising edge of bit 7, without voltage; return Error_Code.

        A serial fault by MODE = Stop first [C99]. Where the control word is refused, or is not
        processed because the bus has no control, by reading the status that acknowledges.
        """
        error = words.error_text((yield from _read(_ERROR_CODE, 0)))
        serial = Meaning.SERIAL_FAILURE in shown.meanings
        if serial and (yield from self.holder()) is not Holder.LOCAL:
            yield from try_steps(one_step(Write(_MODE, Mode.STOP)))
        reset = yield from try_steps(self._reset_fault())
        if not (reset and (yield from self.perhaps_in_control())):
            yield from self._acknowledge_by_reading(control_mode)
        return error

    def _command(self, word: words.ControlWord, control_mode: str, *, retry: bool) -> Steps[None]:
        target = SETPOINTS.get(control_mode)
        zeroes = () if target is None else (target.zero(retry=retry),)
        yield from self._stop_by(one_step(Write(CONTROL_WORD, word, retry=retry)), *zeroes)

    @staticmethod
    def _reset_fault() -> Steps[None]:
        yield Write(CONTROL_WORD, words.DISABLE_VOLTAGE, retry=False)
        reset = words.DISABLE_VOLTAGE | words.ControlWord.FAULT_RESET
        yield Write(CONTROL_WORD, reset, retry=False)
        yield FAULT_GONE
        yield Write(CONTROL_WORD, words.DISABLE_VOLTAGE, retry=False)

    def _acknowledge_by_reading(self, control_mode: str) -> Steps[None]:
        ours = yield from self.perhaps_in_control()
        if ours and (yield from self.remove(control_mode)) is not Removal.COMMAND:
            # refused while the cause of the fault lasts: the status will tell
            with contextlib.suppress(Refusal):
                stop = Write(CONTROL_WORD, words.DISABLE_VOLTAGE)
                yield AcknowledgeThenWrite(_INV_ST_WITH_ACK, stop)
        else:
            yield Acknowledge(_INV_ST_WITH_ACK)


def _read(key: str, otherwise: int) -> Steps[int]:
    """Return the number of an object; another where the drive does not have it."""
    try:
        return int((yield Read(key)))
    except Refusal:
        return otherwise
