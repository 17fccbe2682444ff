# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
ControlWord, StatusWord and Error_Code of DS402 [M0 table 11].

The manual prints their names and indices; their bits are those of CiA 402, velocity mode.
"""

from __future__ import annotations

import enum
import functools

from nfo_sinus_driver.catalog.status import Fact, State, StatusWord


class ControlWord(enum.IntFlag):
    """ControlWord (6040h)."""

    SWITCH_ON = 1 << 0
    ENABLE_VOLTAGE = 1 << 1
    #: 0: quick stop.
    NO_QUICK_STOP = 1 << 2
    ENABLE_OPERATION = 1 << 3
    ENABLE_RAMP = 1 << 4
    UNLOCK_RAMP = 1 << 5
    REFERENCE_RAMP = 1 << 6
    FAULT_RESET = 1 << 7


class Status(enum.IntFlag):
    """StatusWord (6041h)."""

    READY_TO_SWITCH_ON = 1 << 0
    SWITCHED_ON = 1 << 1
    OPERATION_ENABLED = 1 << 2
    FAULT = 1 << 3
    VOLTAGE_ENABLED = 1 << 4
    #: 0: a quick stop is going on.
    NO_QUICK_STOP = 1 << 5
    SWITCH_ON_DISABLED = 1 << 6
    #: The control word is processed: the bus has control.
    REMOTE = 1 << 9
    TARGET_REACHED = 1 << 10
    INTERNAL_LIMIT = 1 << 11


#: The commands "shutdown", "switch on" and "enable operation", with the ramp generator in use.
SHUTDOWN = (
    ControlWord.ENABLE_VOLTAGE
    | ControlWord.NO_QUICK_STOP
    | ControlWord.ENABLE_RAMP
    | ControlWord.UNLOCK_RAMP
    | ControlWord.REFERENCE_RAMP
)
SWITCH_ON = SHUTDOWN | ControlWord.SWITCH_ON
ENABLE_OPERATION = SWITCH_ON | ControlWord.ENABLE_OPERATION
DISABLE_VOLTAGE = ControlWord(0)

#: Which bits count, and which of them are set.
_STATES = (
    (0x4F, 0x00, State.NOT_READY_TO_SWITCH_ON),
    (0x4F, 0x40, State.SWITCH_ON_DISABLED),
    (0x6F, 0x21, State.READY_TO_SWITCH_ON),
    (0x6F, 0x23, State.SWITCHED_ON),
    (0x6F, 0x27, State.OPERATION_ENABLED),
    (0x6F, 0x07, State.QUICK_STOP),
    (0x4F, 0x0F, State.FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, State.FAULTED),
)


@functools.lru_cache(maxsize=256)
def state_of(word: int) -> State:
    """Return the state that StatusWord shows; UNKNOWN for a pattern that CiA 402 does not have."""
    return next((state for mask, bits, state in _STATES if word & mask == bits), State.UNKNOWN)


STATUS_WORD = StatusWord(
    state=state_of,
    by_bit={
        Status.READY_TO_SWITCH_ON: Fact.READY,
        Status.SWITCHED_ON: Fact.SWITCHED_ON,
        Status.OPERATION_ENABLED: Fact.OPERATION_ENABLED,
        Status.FAULT: Fact.FAULT,
        Status.VOLTAGE_ENABLED: Fact.VOLTAGE_ENABLED,
        Status.SWITCH_ON_DISABLED: Fact.SWITCH_ON_DISABLED,
        Status.REMOTE: Fact.NETWORK_CONTROL,
        Status.TARGET_REACHED: Fact.SETPOINT_REACHED,
        Status.INTERNAL_LIMIT: Fact.LIMIT_ACTIVE,
    },
    by_state={State.QUICK_STOP: Fact.QUICK_STOP_ACTIVE},
    # on the ramp to a stop it may say that operation is enabled
    by_frequency=True,
    # or, as a machine of CiA 402 has no state for that ramp, what comes after it
    hides_ramp=True,
)

#: What the first digit of Error_Code says, and by which class the rest is named [CiA 402].
_CLASSES = {
    0x1: 'generic',
    0x2: 'current',
    0x3: 'voltage',
    0x4: 'temperature',
    0x5: 'hardware of the drive',
    0x6: 'software of the drive',
    0x7: 'additional modules',
    0x8: 'monitoring',
    0x9: 'external',
}


def error_text(code: int) -> str:
    """Return what Error_Code (603Fh) says; ``''`` where it says nothing."""
    if not code:
        return ''
    named = _CLASSES.get(code >> 12)
    return f'error code {code:04X}h' + (f' ({named})' if named else '')
