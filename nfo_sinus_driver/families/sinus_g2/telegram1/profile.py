# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a G2 is commanded by telegram 1, through a PLC on PROFIBUS [M0 §6.3].

The words are those of PROFIdrive [C111]. A master that maps DriveControl and DriveStatus in their
place [M0 §7.3, tables 14 to 16] is chosen by name: :data:`PROFILE` has it among its ``words``.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from nfo_sinus_driver.catalog.directed import with_direction
from nfo_sinus_driver.catalog.profile import Profile, SetpointTarget, Steps, Until
from nfo_sinus_driver.catalog.speed_mode import SpeedMode
from nfo_sinus_driver.catalog.status import Fact, Role, State
from nfo_sinus_driver.families._telegram1 import method, profidrive
from nfo_sinus_driver.families._telegram1.method import Telegram1, Words
from nfo_sinus_driver.families.sinus_g2 import words as drivecontrol

#: SpdScl, which multiplies speeds that come over the bus [M0 §8.3.2]; a mailbox is too slow to
#: follow it.
_SPEED_SCALE = ('fieldbus.spd_scl_numerator', 'fieldbus.spd_scl_denominator')
_STARTABLE = (State.READY_TO_SWITCH_ON, State.STOPPING)


class G2Telegram1(Telegram1):
    """
    Control by STW1 of PROFIdrive: switched on, then enabled; the sign of the set-point reverses.

    A stop clears ON and leaves operation enabled: so the motor stops as StMode says.
    """

    coasts = True
    procedures = drivecontrol.PROCEDURES
    unfollowed_scale = _SPEED_SCALE
    ready = int(profidrive.OFF)
    runs = int(profidrive.ControlWord.ON)
    # bit 9 of ZSW1 asks for control, and does not say that the bus has it
    echoes = True

    def take_control(self) -> Steps[None]:
        """Go to "ready to switch on", with bit 0 low, so that a run command is an edge later."""
        yield method.begin(self.ready)
        yield Until(
            lambda status: status.state is State.READY_TO_SWITCH_ON
            and bool((status.word or 0) & self.control)
        )

    def run(self) -> Steps[None]:
        """Switch on, then enable operation when the drive shows that it is switched on."""
        yield method.following(int(profidrive.ON))
        yield Until(lambda status: status.state is State.SWITCHED_ON)
        yield method.following(int(profidrive.RUN), retry=False)

    def stopping(self, word: int) -> int:
        """Return the word that leaves operation enabled: without it the motor would coast."""
        return self.ready | profidrive.ControlWord.ENABLE_OPERATION

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Release the motor at once, by the coast stop; control is kept."""
        yield method.begin(self.ready & ~profidrive.ControlWord.NO_COAST_STOP)


_READY = (
    drivecontrol.ControlWord.ENABLE_VOLTAGE
    | drivecontrol.ControlWord.DISABLE_QUICK_STOP
    | drivecontrol.ControlWord.ENABLE_RFG
    | drivecontrol.ControlWord.UNLOCK_RFG
    | drivecontrol.ControlWord.USE_REF_FOR_RFG
    | drivecontrol.ControlWord.NET_CTRL
    | drivecontrol.ControlWord.NET_REF
)


_ON = int(_READY | drivecontrol.ControlWord.SWITCH_ON)


class G2DriveControl(Telegram1):
    """Control by DriveControl: switched on, then enabled [C54]."""

    coasts = True
    procedures = drivecontrol.PROCEDURES
    unfollowed_scale = _SPEED_SCALE
    ready = int(_READY)
    runs = int(
        drivecontrol.ControlWord.SWITCH_ON
        | drivecontrol.ControlWord.ENABLE_OP
        | drivecontrol.ControlWord.ENABLE_REV_OP
    )

    def take_control(self) -> Steps[None]:
        """Request control with bit 0 low, so that a run command is an edge later [C35]."""
        yield method.begin(self.ready)
        yield Until(lambda status: bool((status.word or 0) & self.control))

    def run(self) -> Steps[None]:
        """Switch on, then give the direction, each when the drive shows a state before it."""
        yield Until(lambda status: status.state in _STARTABLE)
        yield method.following(_ON, retry=False)
        yield Until(lambda status: status.state in (State.SWITCHED_ON, State.STOPPING))
        yield method.following(_ON | drivecontrol.ControlWord.ENABLE_OP, retry=False)

    def setpoint_target(self, target: SetpointTarget) -> SetpointTarget:
        """Return where sizes go, with the direction by bits 3 and 13 ([M0 table 14], [C120])."""
        forward = method.following(_ON | drivecontrol.ControlWord.ENABLE_OP)
        reverse = method.following(_ON | drivecontrol.ControlWord.ENABLE_REV_OP)
        return with_direction(target, method.NEXT, int(forward.value), int(reverse.value))

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Go to QUICK_STOP, which coasts [C96]; control is kept."""
        word = self.ready & ~drivecontrol.ControlWord.DISABLE_QUICK_STOP
        yield method.begin(int(word | drivecontrol.ControlWord.OVERRIDE_COAST))


_Bits = profidrive.Status
PROFILE = Profile(
    title='NFO Sinus G2',
    enable_input='RUN input (DIN1)',
    status_word=Words(
        state=lambda word: profidrive.state_of(word & 0xFFFF),
        by_bit={
            _Bits.READY_ON: Fact.READY,
            _Bits.READY_OPERATE: Fact.SWITCHED_ON,
            _Bits.OPERATION_ENABLED: Fact.OPERATION_ENABLED,
            _Bits.FAULT: Fact.FAULT,
            _Bits.SWITCHING_ON_INHIBITED: Fact.SWITCH_ON_DISABLED,
            _Bits.WARNING: Fact.ALARM,
            _Bits.SETPOINT_REACHED: Fact.SETPOINT_REACHED,
            _Bits.CONTROL_REQUESTED: Fact.NETWORK_CONTROL,
        },
        by_state={},
        by_clear_bit={_Bits.NO_QUICK_STOP: Fact.QUICK_STOP_ACTIVE},
        stateless=True,
        code=method.code_by(profidrive.state_of, fault=_Bits.FAULT, warning=_Bits.WARNING),
        # on the ramp to a stop the states look alike, and bit 15 only says that pulses are enabled
        by_frequency=True,
        only_frequency=True,
    ),
    holders={},
    methods={'telegram1': G2Telegram1},
    setpoints=method.setpoints(150.0),
    bit_fields=drivecontrol.BIT_FIELDS.union(
        method.BIT_FIELDS, ('profidrive.warning_word', 'profidrive.warning_word_2')
    ),
    active_method=method.active_method,
    writes_and_reads=True,
    mailbox='profibus',
    # it decides what a set-point means
    start_settings=frozenset({'control.mode'}),
    narrow=drivecontrol.NARROW,
    # [M0 §5.3.1]
    cuts_off={'serial.bus_type': 'None'},
    # a tenth above what a set-point may be, for a motor may be overhauled
    most={Role.ACTUAL_FREQUENCY: 165.0, Role.ACTUAL_SPEED: 9900.0},
    # those of SpdSet and SpdAct, by the factory's SpdScl ([M0 §6.3 table 9, §8.3.2], [M2 table 2])
    speed_mode=SpeedMode(
        (method.ACTUAL, method.SETPOINT),
        count=lambda nominal: Fraction(1),
        most=lambda nominal: 9000.0,
    ),
)
PROFILE = replace(
    PROFILE,
    words={
        'profidrive': PROFILE,
        'drivecontrol': replace(
            PROFILE,
            methods={'telegram1': G2DriveControl},
            status_word=Words(
                state=lambda word: drivecontrol.state_of(word & 0xFFFF),
                by_bit=drivecontrol.STATUS_WORD.by_bit,
                by_state=drivecontrol.STATUS_WORD.by_state,
                frequency_beside=True,
                code=method.code_by(
                    drivecontrol.state_of, fault=drivecontrol.Status.FAULTED
                ),
            ),
        ),
    },
)
