# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The generic state machine of the drive [M0 §7.1, tables 14 to 16].

Every way of control ends here: DriveControl reaches it directly, MODE and SCMD and the terminals
are translated to control words for it [M0 §7].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import enum

from nfo_sinus_driver.families.sinus_g2.words import Control, Scmd, Status
from nfo_sinus_driver.simulator.sinus.control_unit import TERMINAL_SHARE

#: Without both of these the power is off, or a quick stop is wanted [M0 table 14].
_POWER = Control.ENABLE_VOLTAGE | Control.DISABLE_QUICK_STOP


class Phase(enum.Enum):
    """
    The states of [M0 table 16].

    The status word shows DISABLE and SHUTDOWN alike [C37]; inside they differ.
    """

    NOT_READY_TO_SWITCH_ON = 'NOT_READY_TO_SWITCH_ON'
    SWITCH_ON_DISABLED = 'SWITCH_ON_DISABLED'
    READY_TO_SWITCH_ON = 'READY_TO_SWITCH_ON'
    SWITCHED_ON = 'SWITCHED_ON'
    OPERATION_ENABLED = 'OPERATION_ENABLED'
    DISABLE = 'DISABLE'
    SHUTDOWN = 'SHUTDOWN'
    QUICK_STOP = 'QUICK_STOP'
    FAULT_REACTION_ACTIVE = 'FAULT_REACTION_ACTIVE'
    FAULTED = 'FAULTED'


@dataclass(frozen=True)
class Conditions:
    """
    What the state machine is told about the rest of the drive.

    :ivar initialised: the self-test is over.
    :ivar fault: a fault is present, or not yet acknowledged.
    :ivar brake: StMode, the manual's ShutdownOptionCode: brake on the ramp, else coast.
    :ivar at_zero: zero rpm is reached.
    :ivar voltage: there is still voltage on the motor.
    """

    initialised: bool = True
    fault: bool = False
    brake: bool = True
    at_zero: bool = True
    voltage: bool = False


class StateMachine:
    """The generic state machine; its direction, 1 or -1, is kept while the motor brakes."""

    def __init__(self) -> None:
        self.phase = Phase.NOT_READY_TO_SWITCH_ON
        self.word = Control(0)
        self.direction = 1
        self._asked = 0
        self._asked_here = False
        self._braked = False

    @property
    def driven(self) -> bool:
        """Whether the power stage works on the motor; it coasts otherwise."""
        if self.phase is Phase.SHUTDOWN:
            return not self._braked
        return self.phase in (Phase.OPERATION_ENABLED, Phase.DISABLE)

    def update(self, word: Control, conditions: Conditions) -> None:
        """Take a control word and what became of the drive, and go as far as they lead."""
        self._take(word)
        for _ in Phase:
            following = self._following(conditions)
            if following is self.phase:
                return
            self.phase = following
            self._asked_here = False
            self._braked = False

    def asks_reset(self, word: Control) -> bool:
        """Whether ``word``, coming now, acknowledges a fault: bit 7 rises in FAULTED."""
        rises = bool(word & ~self.word & Control.RESET_MALFUNCTION)
        return rises and self.phase is Phase.FAULTED

    def status(self) -> Status:
        """The status word's bits that this machine decides, as the patterns of table 16 show."""
        status = _PATTERNS[self.phase]
        if self.phase in _DIRECTED:
            status |= Status.OP_ENABLED if self.direction > 0 else Status.REV_OP_ENABLED
        if self.word & Control.ENABLE_VOLTAGE or self.driven:
            status |= Status.VOLTAGE_ENABLED
        echo = self.phase in _ECHOES and self.word & Control.DISABLE_QUICK_STOP
        if echo:
            status |= Status.QUICK_STOP_DISABLED
        return status

    def _take(self, word: Control) -> None:
        self.word = word
        forward = bool(word & Control.ENABLE_OP)
        reverse = bool(word & Control.ENABLE_REV_OP)
        # both bits together mean: no change [M0 table 14, bit 3]
        asked = self._asked if forward and reverse else int(forward) - int(reverse)
        if asked != self._asked and self.phase is Phase.SWITCHED_ON:
            self._asked_here = True
        self._asked = asked
        if asked:
            self.direction = asked

    def _following(self, now: Conditions) -> Phase:
        """The state after this one: the exits of [M0 table 16], one paragraph a state."""
        word, phase = self.word, self.phase
        power = word & _POWER == _POWER
        on = bool(word & Control.SWITCH_ON)
        coast = bool(word & Control.OVERRIDE_COAST)

        if phase is Phase.FAULT_REACTION_ACTIVE:
            return phase if now.voltage else Phase.FAULTED
        if phase is Phase.FAULTED:
            return phase if now.fault else Phase.SWITCH_ON_DISABLED
        if now.fault:
            return Phase.FAULT_REACTION_ACTIVE

        if phase is Phase.NOT_READY_TO_SWITCH_ON:
            return Phase.SWITCH_ON_DISABLED if now.initialised else phase

        if phase is Phase.SWITCH_ON_DISABLED:
            again = not on or bool(word & Control.AUTO_INIT)
            return Phase.READY_TO_SWITCH_ON if power and again else phase

        if phase is Phase.READY_TO_SWITCH_ON:
            if not power:
                return Phase.SWITCH_ON_DISABLED
            return Phase.SWITCHED_ON if on else phase

        if phase is Phase.SWITCHED_ON:
            if not (power and on):
                return phase if now.voltage else Phase.READY_TO_SWITCH_ON
            event = self._asked_here or not word & Control.EVENT_TRIGGERED_OP
            return Phase.OPERATION_ENABLED if self._asked and event else phase

        if phase is Phase.QUICK_STOP:
            return phase if now.voltage else Phase.SWITCH_ON_DISABLED

        # what is left has the motor running: OPERATION_ENABLED, DISABLE and SHUTDOWN
        if not power:
            return Phase.QUICK_STOP
        if phase is Phase.SHUTDOWN:
            if on:
                return Phase.OPERATION_ENABLED
            self._braked = self._braked or coast or not now.brake or now.at_zero
            return Phase.READY_TO_SWITCH_ON if self._braked and not now.voltage else phase
        if not on:
            return Phase.SHUTDOWN
        if self._asked:
            return Phase.OPERATION_ENABLED
        if phase is Phase.DISABLE and (now.at_zero or coast):
            return Phase.SWITCHED_ON
        return Phase.DISABLE


_READY = Status.READY_TO_SWITCH_ON | Status.QUICK_STOP_DISABLED
_ON = _READY | Status.SWITCHED_ON
_STOPPING = Status.STOPPING | Status.READY_TO_SWITCH_ON | Status.SWITCHED_ON

#: The fixed bits of each state [M0 table 16].
_PATTERNS = {
    Phase.NOT_READY_TO_SWITCH_ON: Status(0),
    Phase.SWITCH_ON_DISABLED: Status.SWITCH_ON_DISABLED,
    Phase.READY_TO_SWITCH_ON: _READY,
    Phase.SWITCHED_ON: _ON,
    Phase.OPERATION_ENABLED: _ON,
    Phase.DISABLE: _STOPPING | Status.QUICK_STOP_DISABLED,
    Phase.SHUTDOWN: _STOPPING | Status.QUICK_STOP_DISABLED,
    Phase.QUICK_STOP: _STOPPING,
    Phase.FAULT_REACTION_ACTIVE: _STOPPING | Status.FAULTED,
    Phase.FAULTED: Status.FAULTED,
}
#: States that show the direction in bits 2 and 14.
_DIRECTED = frozenset(
    {
        Phase.OPERATION_ENABLED,
        Phase.DISABLE,
        Phase.SHUTDOWN,
        Phase.QUICK_STOP,
        Phase.FAULT_REACTION_ACTIVE,
    }
)
#: States whose bit 5 is free: they echo the control word.
_ECHOES = frozenset(
    {
        Phase.NOT_READY_TO_SWITCH_ON,
        Phase.SWITCH_ON_DISABLED,
        Phase.FAULT_REACTION_ACTIVE,
        Phase.FAULTED,
    }
)


#: The motor is released: MODE = Stop.
RELEASED = Control(0)
#: Ready, waiting for a run command. From a run it stops the motor as StMode says.
STANDBY = Control.ENABLE_VOLTAGE | Control.DISABLE_QUICK_STOP | Control.AUTO_INIT
#: Runs, but for the direction.
RUNNING = (
    STANDBY | Control.SWITCH_ON | Control.ENABLE_RFG | Control.UNLOCK_RFG | Control.USE_REF_FOR_RFG
)

#: SCMD codes that run the motor.
RUN_COMMANDS = frozenset(code for code in Scmd if code & 1 and code < Scmd.FULL_TUNING)

#: The references that do not come over the bus, as shares of the nominal value.
_ANALOG_SHARE = 0.6
_FIXED_SHARES = (0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)


def local_share(code: int, fixed: Mapping[int, float]) -> float:
    """
    Return the reference of an SCMD run code other than Fieldbus, as a share of the nominal value.

    :param fixed: shares that the drive's own fixed references (1 to 7) have, where it has them.
    """
    if code in (Scmd.TERMINAL, Scmd.OP_MODE):
        return TERMINAL_SHARE
    sign = -1 if code & 4 else 1
    number = code >> 3
    if number == 0:
        return sign * _ANALOG_SHARE
    return sign * fixed.get(number, _FIXED_SHARES[number - 1])
