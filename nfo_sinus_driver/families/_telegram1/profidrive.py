# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
STW1 and ZSW1 of PROFIdrive, standard telegram 1, as far as drives share them ([M3 §7.2], [C111]).

A drive ignores STW1 as a whole without bit 10, and goes on as before [C107].
"""

from __future__ import annotations

import enum
import functools

from nfo_sinus_driver.catalog.status import State


class ControlWord(enum.IntFlag):
    """STW1."""

    ON = 1 << 0
    NO_COAST_STOP = 1 << 1
    NO_QUICK_STOP = 1 << 2
    ENABLE_OPERATION = 1 << 3
    ENABLE_RAMP = 1 << 4
    UNFREEZE_RAMP = 1 << 5
    ENABLE_SETPOINT = 1 << 6
    FAULT_ACK = 1 << 7
    CONTROL_BY_PLC = 1 << 10


class Status(enum.IntFlag):
    """ZSW1."""

    READY_ON = 1 << 0
    READY_OPERATE = 1 << 1
    OPERATION_ENABLED = 1 << 2
    FAULT = 1 << 3
    NO_COAST_STOP = 1 << 4
    NO_QUICK_STOP = 1 << 5
    SWITCHING_ON_INHIBITED = 1 << 6
    WARNING = 1 << 7
    #: The actual value is within the tolerance of the set-point.
    SETPOINT_REACHED = 1 << 8
    CONTROL_REQUESTED = 1 << 9


#: STW1 by which a drive is switched off ("ready to switch on"), switched on, and in operation.
OFF = (
    ControlWord.NO_COAST_STOP
    | ControlWord.NO_QUICK_STOP
    | ControlWord.ENABLE_RAMP
    | ControlWord.UNFREEZE_RAMP
    | ControlWord.ENABLE_SETPOINT
    | ControlWord.CONTROL_BY_PLC
)
ON = OFF | ControlWord.ON
RUN = ON | ControlWord.ENABLE_OPERATION

_PATTERN = (
    Status.SWITCHING_ON_INHIBITED
    | Status.READY_ON
    | Status.READY_OPERATE
    | Status.OPERATION_ENABLED
)
#: S1 to S4 by those bits [M3 §7.2.2].
_STATES = {
    0x40: State.SWITCH_ON_DISABLED,
    0x01: State.READY_TO_SWITCH_ON,
    0x03: State.SWITCHED_ON,
    0x07: State.OPERATION_ENABLED,
}


@functools.lru_cache(maxsize=256)
def state_of(word: int) -> State:
    """
    Return the state that ZSW1 shows, S1 to S4.

    Where bits 1 and 2 are echoes of STW1, one may come before the state that it belongs to: bit 6
    and bit 0, which are the drive's own, have the last word then.
    """
    if word & Status.FAULT:
        return State.FAULTED
    found = _STATES.get(word & _PATTERN)
    if found is not None:
        return found
    if word & Status.SWITCHING_ON_INHIBITED:
        return State.SWITCH_ON_DISABLED
    return State.READY_TO_SWITCH_ON if word & Status.READY_ON else State.NOT_READY_TO_SWITCH_ON
