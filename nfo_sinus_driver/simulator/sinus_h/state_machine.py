# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The states of the PROFINET module of a Sinus H, and the words that lead from one to the next.

The table of [M3 §6] is all there is: the diagram is missing, and with it perhaps exits that the
table does not print [C65].
"""

from __future__ import annotations

import enum


class Control(enum.IntFlag):
    """STW1 [M3 §7.2.1]."""

    ON = 1 << 0
    NO_COAST_STOP = 1 << 1
    NO_QUICK_STOP = 1 << 2
    ENABLE_OPERATION = 1 << 3
    ENABLE_RAMP = 1 << 4
    UNFREEZE_RAMP = 1 << 5
    ENABLE_SETPOINT = 1 << 6
    FAULT_ACKNOWLEDGE = 1 << 7
    CONTROL_BY_PLC = 1 << 10


class Status(enum.IntFlag):
    """ZSW1 [M3 §7.2.2]."""

    READY_TO_SWITCH_ON = 1 << 0
    READY_FOR_OPERATION = 1 << 1
    OPERATION = 1 << 2
    FAULT = 1 << 3
    NO_COAST_STOP = 1 << 4
    NO_QUICK_STOP = 1 << 5
    SWITCHING_ON_INHIBITED = 1 << 6
    WARNING = 1 << 7
    SPEED_REACHED = 1 << 8
    CONTROL_REQUESTED = 1 << 9


class State(enum.Enum):
    """The states of the module."""

    SWITCHING_ON_INHIBITED = 'S1'
    READY_FOR_SWITCHING_ON = 'S2'
    READY_FOR_OPERATION = 'S3'
    OPERATION = 'S4'


class Stop(enum.Enum):
    """How a motor is stopped that does not run any more."""

    #: As ADV-8 says.
    BY_MODE = 'by mode'
    #: It runs free.
    COAST = 'coast'


#: What follows only where unlisted exits are taken as other drives of the profile have them; with
#: LEVELS S1 is left, too, by a word that has been there all the time.
NONE, PROFIDRIVE, LEVELS = 'none', 'profidrive', 'levels'

_NO_STOP = Control.NO_COAST_STOP | Control.NO_QUICK_STOP
_SWITCH_ON = _NO_STOP | Control.ON
_ENABLE = _SWITCH_ON | Control.ENABLE_OPERATION


def coast_stop(word: Control) -> bool:
    """Whether bits 0 to 3 are the command CoastStop."""
    return not word & Control.NO_COAST_STOP


def quick_stop(word: Control) -> bool:
    """Whether they are the command QuickStop."""
    return not word & Control.NO_QUICK_STOP


def switch_off(word: Control) -> bool:
    """Whether they are the command SwitchOFF."""
    return word & _SWITCH_ON == _NO_STOP


def switch_on(word: Control) -> bool:
    """Whether they are the command SwitchON."""
    return word & _SWITCH_ON == _SWITCH_ON


def operation_enable(word: Control) -> bool:
    """Whether they are the command OperationEnable."""
    return word & _ENABLE == _ENABLE


def operation_disable(word: Control) -> bool:
    """Whether they are the command OperationDisable."""
    return word & _ENABLE == _SWITCH_ON


class StateMachine:
    """
    The state of the module; one telegram leads to the next state at most.

    :param unlisted: exits that the table does not print: ``none``, or those of ``profidrive``:
        QuickStop and CoastStop lead out of S3, and SwitchOFF out of S4; with ``levels`` SwitchON
        leads out of S1, too.

    :ivar state: where it is.
    :ivar stop: how the motor was stopped that ran last.
    """

    def __init__(self, unlisted: str = NONE) -> None:
        self.state = State.SWITCHING_ON_INHIBITED
        self.stop = Stop.COAST
        self._unlisted = unlisted in (PROFIDRIVE, LEVELS)
        self._by_level = unlisted == LEVELS

    def update(self, word: Control, *, inhibited: bool = False) -> None:
        """
        Take the control word of a telegram.

        :param inhibited: a fault is active: the module cannot be switched on.
        """
        if not word & Control.CONTROL_BY_PLC:
            # the whole word is ignored [M3 §7.2.1, C107]
            return
        if coast_stop(word):
            self.stop = Stop.COAST
        if self.state is State.SWITCHING_ON_INHIBITED:
            leaves = switch_off(word) or (self._by_level and switch_on(word))
            if leaves and not inhibited:
                self.state = State.READY_FOR_SWITCHING_ON
        elif self.state is State.READY_FOR_SWITCHING_ON:
            if quick_stop(word) or coast_stop(word):
                self.state = State.SWITCHING_ON_INHIBITED
            elif switch_on(word):
                self.state = State.READY_FOR_OPERATION
        elif self.state is State.READY_FOR_OPERATION:
            self._from_ready_for_operation(word)
        else:
            self._from_operation(word)

    def inhibit(self, stop: Stop) -> None:
        """Fall back to S1: a fault, or STOP at the keypad."""
        self.state = State.SWITCHING_ON_INHIBITED
        self.stop = stop

    def _from_ready_for_operation(self, word: Control) -> None:
        if switch_off(word):
            self.state = State.READY_FOR_SWITCHING_ON
        elif operation_enable(word):
            self.state = State.OPERATION
        elif self._unlisted and (quick_stop(word) or coast_stop(word)):
            self.state = State.SWITCHING_ON_INHIBITED

    def _from_operation(self, word: Control) -> None:
        if coast_stop(word):
            self.inhibit(Stop.COAST)
        elif quick_stop(word):
            self.inhibit(Stop.BY_MODE)
        elif operation_disable(word):
            self.state, self.stop = State.READY_FOR_OPERATION, Stop.BY_MODE
        elif self._unlisted and switch_off(word):
            self.state, self.stop = State.READY_FOR_SWITCHING_ON, Stop.BY_MODE


#: The bits of each state [M3 §7.2.2].
PATTERNS = {
    State.SWITCHING_ON_INHIBITED: Status.SWITCHING_ON_INHIBITED,
    State.READY_FOR_SWITCHING_ON: Status.READY_TO_SWITCH_ON,
    State.READY_FOR_OPERATION: Status.READY_TO_SWITCH_ON | Status.READY_FOR_OPERATION,
    State.OPERATION: Status.READY_TO_SWITCH_ON | Status.READY_FOR_OPERATION | Status.OPERATION,
}
