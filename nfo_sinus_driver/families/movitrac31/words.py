# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Words of the MOVITRAC 31: function bits (index 281), terminals (index 13), inverter status (index
284), and who controls it [M4 §4].

Byte 0 is sent first, so bit 0 of byte 3 is bit 0 of the number [C72].

Whether status number and fault code in index 284 are binary or packed decimal digits is not said
[C105]; [M4 §3.2] calls the format "uncoded". Each byte is read by itself, so that nothing has to be
known of the drive:

- A status number of 0Ah to 0Fh can only be binary, one of 14h to 19h only decimal.
- 10h to 13h are read as decimal 10 to 13. Binary they would be 16 to 18, positioning and
  synchronous operation, in which this driver does not enable; or 19, coast, shown as 13, rapid
  stop: the motor is not commanded in either.
- A fault code is binary if that is one that the manual lists, else decimal. So fault 45, a time-out
  of the line, is always shown; some others mean one fault this way and another that way, and P060
  says for certain which it is.
"""

from __future__ import annotations

import enum
import functools

from nfo_sinus_driver.catalog.status import Fact, Role, State, StatusWord

#: P841, who controls the drive.
STANDARD = 'Standard'
REMOTE_SETPOINT = 'Remote setpoint'
REMOTE_CONTROL = 'Remote control'
FIELDBUS = 'Fieldbus'


class Bits(enum.IntFlag):
    """Function bits: the command word of the line."""

    CLOCKWISE = 1 << 0
    COUNTER_CLOCKWISE = 1 << 1
    ENABLE = 1 << 2
    SET_2 = 1 << 3
    #: Acknowledges a fault when it changes from 0 to 1.
    RESET = 1 << 6
    #: Releases the motor at once.
    CONTROLLER_INHIBIT = 1 << 8
    RAMP_2 = 1 << 12
    HOLD_CONTROL = 1 << 15


#: The bit of each terminal in index 13: 41 to 43 and 47 to 51, 52 to 54.
TERMINALS = {
    **{terminal: 1 << bit for bit, terminal in enumerate((41, 42, 43, 47, 48, 49, 50, 51))},
    **{terminal: 1 << bit for bit, terminal in enumerate((52, 53, 54), 16)},
}


class Number(enum.IntEnum):
    """The status number of index 284."""

    CONTROLLER_INHIBIT = 0
    NO_ENABLE = 1
    START_MAGNETIZATION = 2
    STOP_MAGNETIZATION = 3
    RAPID_START = 4
    HEATING_CURRENT = 5
    DC_BRAKING = 6
    DC_HOLDING_CURRENT = 7
    SXR_DETERMINATION = 8
    DC_BRAKING_AVAILABLE = 9
    ENABLE = 10
    CHANGE_OF_DIRECTION = 11
    NORMAL_STOP = 12
    RAPID_STOP = 13
    HOLD_CONTROL = 14
    BRAKING_TIME = 15
    REFERENCE_TRAVEL = 16
    POSITIONING = 17
    SYNCHRONOUS_OPERATION = 18
    COAST = 19


#: The parameter set that is in use; set: 2.
IN_SET_2 = 1 << 3
#: Set: the motor turns clockwise, which is forward.
_CLOCKWISE = 1 << 4
FAULT = 0xFF << 24
#: The codes of the faults that the manual lists.
_FAULTS = frozenset(
    (
        *(*range(1, 8), *range(10, 15), *range(17, 29), 33, 34, *range(36, 40), 41),
        *(*range(43, 46), *range(50, 53), *range(54, 66), 87),
    )
)
#: What a status code begins at that is a fault code.
_FIRST_FAULT = 100
#: A status code that means nothing, and the highest that the message InvSt has room for.
_NO_NUMBER = 99
_HIGHEST = 255

#: What a motor that is not commanded does, and one that stops; all else counts as running, so that
#: a stop is not taken for confirmed by what the manual does not explain.
_STATES = {
    Number.CONTROLLER_INHIBIT: State.SWITCH_ON_DISABLED,
    Number.COAST: State.SWITCH_ON_DISABLED,
    Number.NO_ENABLE: State.READY_TO_SWITCH_ON,
    Number.RAPID_START: State.SWITCHED_ON,
    Number.HEATING_CURRENT: State.SWITCHED_ON,
    Number.DC_HOLDING_CURRENT: State.SWITCHED_ON,
    Number.STOP_MAGNETIZATION: State.STOPPING,
    Number.DC_BRAKING: State.STOPPING,
    Number.NORMAL_STOP: State.STOPPING,
    Number.BRAKING_TIME: State.STOPPING,
    Number.RAPID_STOP: State.QUICK_STOP,
}
_RELEASED = (State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON)


def code_of(word: int) -> int:
    """Return the status code that index 284 reports: the status number, or 100 + fault code."""
    fault = word >> 24
    if not fault:
        number = _number(word)
        return _NO_NUMBER if number is None else number
    if fault not in _FAULTS and _decimal(fault) in _FAULTS:
        fault = _decimal(fault)
    return min(_FIRST_FAULT + fault, _HIGHEST)


@functools.lru_cache(maxsize=256)
def state_of(word: int) -> State:
    """
    Return the state that index 284 shows; UNKNOWN for a number that the manual does not list.

    With a fault the motor may still ramp to a stop, or coast: the number reports [C105].
    """
    number = _number(word)
    state = State.UNKNOWN if number is None else _STATES.get(number, State.OPERATION_ENABLED)
    if not word & FAULT:
        return state
    return State.FAULTED if state in _RELEASED else State.FAULT_REACTION_ACTIVE


def _number(word: int) -> Number | None:
    """Return the status number, whether binary or decimal [C105]."""
    byte = word >> 16 & 0xFF
    number = byte if byte < 0x10 else _decimal(byte)
    return Number(number) if 0 <= number <= max(Number) else None


def _decimal(byte: int) -> int:
    """Return what two packed digits mean; -1 if one is none."""
    digits = f'{byte:02x}'
    return int(digits) if digits.isdecimal() else -1


STATUS_WORD = StatusWord(
    state=state_of,
    by_bit={FAULT: Fact.FAULT},
    by_clear_bit={_CLOCKWISE: Fact.REVERSE},
    by_state={
        State.READY_TO_SWITCH_ON: Fact.READY,
        State.SWITCHED_ON: Fact.READY | Fact.SWITCHED_ON,
        State.OPERATION_ENABLED: Fact.READY | Fact.SWITCHED_ON | Fact.OPERATION_ENABLED,
        State.STOPPING: Fact.SWITCHED_ON | Fact.STOPPING,
        State.QUICK_STOP: Fact.SWITCHED_ON | Fact.STOPPING | Fact.QUICK_STOP_ACTIVE,
        State.SWITCH_ON_DISABLED: Fact.SWITCH_ON_DISABLED,
    },
    code=code_of,
    # status number and fault code are published as a code
    shown=0xFFFF,
    # it goes on saying Enable, or Normal stop, whatever the motor does
    by_frequency=True,
    sizes=frozenset((Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED)),
)
