# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a Sinus Optimal is commanded: by MODE and SMODE, or by Drive Control [M1].

The registers are those of the G2, and the means nearly those; [M1] forbids to mix the two methods:
what one has started the other does not stop.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import (
    FAULT_GONE,
    ControlMethod,
    Holder,
    Procedure,
    Profile,
    Read,
    Refusal,
    Removal,
    Reset,
    SetpointTarget,
    Status,
    Steps,
    Until,
    Wait,
    Write,
    one_step,
    try_steps,
)
from nfo_sinus_driver.catalog.status import StatusCode
from nfo_sinus_driver.families.sinus_g2.profile import (
    CONTROL_WORD,
    MODE,
    MOST,
    STATUS_WORD,
    ModeScmd,
)
from nfo_sinus_driver.families.sinus_optimal import words
from nfo_sinus_driver.families.sinus_optimal.telegram1.profile import OptimalTelegram1
from nfo_sinus_driver.families.sinus_optimal.words import ControlWord, Mode, Smode

_HOLDERS: Mapping[Value, Holder] = {
    Mode.MANUAL: Holder.LOCAL,
    Mode.AUTO: Holder.LOCAL,
    Mode.BUS: Holder.BUS,
}
_SETPOINTS = {
    'Freque': SetpointTarget(
        'fieldbus.input_freq_setpoint', 150.0, followed='status.control_freq'
    ),
    'Speed': SetpointTarget(
        'fieldbus.input_speed_setpoint', 9000.0, followed='status.control_speed'
    ),
}
_READY = ControlWord.BUS_CONTROL
_ENABLED = _READY | ControlWord.ENABLE
_RUN = ControlWord.SWITCH_ON
#: Where control is handed to the bus, and Enable is taken; [M1] does not say what of a motor that
#: is enabled already.
_ENABLES = words.Status.READY | words.Status.ENABLED
#: The motor is driven, be it to a stop.
_DRIVEN = words.Status.SWITCHED_ON | words.Status.STOPPING
#: How long the drive is given for a step that no status shows, s; [M1] prints no time.
_UNSHOWN = 0.2


class ModeSmode(ModeScmd):
    """
    Control through MODE and SMODE, whose codes for stop and run are those of SCMD.

    Its MODE has no Stop: 1 is Manual, the keypad's, and 2 is Auto, which may start the motor and is
    never written [C51]. It has no way to release the motor at once [C96].

    Nothing reports its control mode, so whichever is assumed, every set-point is 0 before it runs:
    an old one in the register of the other mode would turn the motor.
    """

    means = 'SMODE'
    references = ('fieldbus', 'terminal')
    coasts = False
    procedures: ClassVar[Mapping[Procedure | Reset, Write]] = {}
    _command = 'fieldbus.smode'
    _soonest = Write('fieldbus.smode', Smode.STOP)

    def holder(self) -> Steps[Holder]:
        """Tell who has control of the drive."""
        return _HOLDERS.get((yield Read(MODE)), Holder.UNKNOWN)

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """
        Write set-point 0 for every control mode, and read it back.

        :raises NotPossible: the drive keeps another value.
        """
        for target in self._targets(control_mode):
            yield from target.set_to_zero()

    def _targets(self, control_mode: str) -> Sequence[SetpointTarget]:
        return tuple(_SETPOINTS.values())

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Stop as usual: there is no other way."""
        return self.stop(control_mode)

    def release(self) -> Steps[None]:
        """Give control back to the keypad, once no run command stands."""
        if (yield from self.in_control()):
            yield Write(self._command, Smode.STOP)
            yield Write(MODE, Mode.MANUAL)

    def _remove_control(self) -> Steps[bool]:
        """Leave control where it is: Manual would hand it to the keypad."""
        yield from ()
        return False

    def _controlled_elsewhere(self) -> Steps[bool]:
        """Tell that it does not matter: MODE is not written here."""
        yield from ()
        return False


class DriveControl(ControlMethod):
    """
    Control through Drive Control and Drive Status: enabled, then switched on [C54].

    Its reference comes from the terminals alone ([C54], [C56]), and it has no quick stop [C96].
    """

    means = 'control word'
    references = ('terminal',)
    control_retained = (
        'from the terminals an active RUN input might start the motor; take control at the keypad '
        'to give it to them'
    )

    def in_control(self) -> Steps[bool]:
        """Return whether the bus has control, taken by this session or an earlier one."""
        return bool(int((yield Read(STATUS_WORD))) & words.Status.CONTROL_FROM_BUS)

    def holder(self) -> Steps[Holder]:
        """Tell who has control of the drive."""
        return Holder.BUS if (yield from self.in_control()) else Holder.LOCAL

    def take_control(self) -> Steps[None]:
        """
        Take control without Switch on; a motor that still ramps keeps Enable [C109].

        Where Enable is taken away the drive has to show that, too: else what it has shown before
        would be taken for the answer to the Enable that follows. Who lost control to keypad or
        terminals has to ask anew, for the bit may still stand in the word.
        """
        shown = int((yield Read(STATUS_WORD)))
        from_bus = bool(shown & words.Status.CONTROL_FROM_BUS)
        word = int((yield Read(CONTROL_WORD)))
        asked = bool(word & ControlWord.BUS_CONTROL)
        ramps = from_bus and bool(shown & _DRIVEN) and bool(word & ControlWord.ENABLE)
        ready = _ENABLED if ramps else _READY
        if asked and not from_bus:
            yield Write(CONTROL_WORD, ControlWord(0))
            yield Wait(_UNSHOWN)
        yield Write(CONTROL_WORD, ready)
        if from_bus and not asked:
            # by MODE: no status shows when the bit is taken
            yield Wait(_UNSHOWN)

        def is_taken(status: Status) -> bool:
            shown = status.word or 0
            released = ramps or not shown & words.Status.ENABLED
            return bool(shown & words.Status.CONTROL_FROM_BUS) and released

        yield Until(is_taken)

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """Do nothing: the reference is none of ours."""
        yield from ()

    def run(self) -> Steps[None]:
        """Enable when the drive is ready for it, and switch on when it shows that."""
        yield Until(lambda status: bool((status.word or 0) & _ENABLES))
        yield Write(CONTROL_WORD, _ENABLED)
        yield Until(lambda status: bool((status.word or 0) & words.Status.ENABLED))
        yield Write(CONTROL_WORD, _ENABLED | _RUN, retry=False)

    def stop(self, control_mode: str) -> Steps[None]:
        """Reset Switch on, and leave the other bits to who has control."""
        yield from self._stop_by(self._switch_off(retry=False))

    def _switch_off(self, *, retry: bool = True) -> Steps[None]:
        word = int(_ENABLED)
        try:
            word = int((yield Read(CONTROL_WORD, retry=retry)))
        except Refusal:
            # then what the driver wrote last, but never while keypad or terminals have control
            if not (yield from self.perhaps_in_control()):
                raise
        yield Write(CONTROL_WORD, word & ~_RUN, retry=retry)

    def force_stop(self, control_mode: str) -> Steps[bool]:
        """Reset Switch on, then take Enable away, by which the motor is released [C109]."""
        obeyed = yield from try_steps(self._switch_off())
        return (yield from try_steps(one_step(Write(CONTROL_WORD, _READY)))) or obeyed

    def release(self) -> Steps[None]:
        """
        Remove Enable, and keep the bus control.

        Without it the terminals would have control, and a RUN input that is active might start the
        motor; [M1] names no way to give control back.
        """
        if (yield from self.in_control()):
            yield Write(CONTROL_WORD, _READY)

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Reset Switch on."""
        obeyed = yield from try_steps(self._switch_off())
        return Removal.COMMAND if obeyed else Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """Acknowledge a fault by one rising edge of bit 7 [M1]."""
        word = int((yield Read(CONTROL_WORD)))
        low = word & ~(ControlWord.FAULT_ACK | _RUN)
        yield Write(CONTROL_WORD, low)
        if word & ControlWord.FAULT_ACK:
            yield Wait(_UNSHOWN)
        yield Write(CONTROL_WORD, low | ControlWord.FAULT_ACK)
        yield FAULT_GONE
        yield Write(CONTROL_WORD, low)
        return ''


def _active_method(status: Status | None) -> Steps[str]:
    """Return by which control method the motor was started."""
    word = int((yield Read(CONTROL_WORD)))
    return 'drive_control' if word & ControlWord.SWITCH_ON else 'mode_scmd'


PROFILE = Profile(
    title='NFO Sinus Optimal',
    enable_input='RUN input (DIN1)',
    status_word=words.STATUS_WORD,
    holders=_HOLDERS,
    methods={
        'mode_scmd': ModeSmode,
        'drive_control': DriveControl,
        'telegram1': OptimalTelegram1,
    },
    setpoints=_SETPOINTS,
    measured=(
        'fieldbus.input_freq_setpoint',
        'fieldbus.input_speed_setpoint',
        'status.control_freq',
        'status.control_speed',
    ),
    bit_fields=frozenset((CONTROL_WORD, 'fieldbus.drive_status')),
    active_method=_active_method,
    # it has no function 43 [C57]: who answers it as another maker is none
    vendor='NFO',
    most=MOST,
)
