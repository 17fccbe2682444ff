# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Control and status words of the Sinus Optimal, and the codes of its MODE and SMODE [M1].

The registers are those of the G2, the meaning is not ([C51], [C52], [C54], [C55]): never mix these
with those.
"""

from __future__ import annotations

import enum
import functools

from nfo_sinus_driver.catalog.status import Fact, State, StatusWord


class Mode(enum.IntEnum):
    """Who controls the drive; only BUS means the same as on the G2 [C51]."""

    MANUAL = 1
    #: Never written: with RUN active it may start the motor [C51].
    AUTO = 2
    BUS = 3


class Smode(enum.IntEnum):
    """Start and stop commands under MODE = Bus: these and no other [C52]."""

    STOP = 0x00
    #: Run; the set-point comes from the terminals.
    TERMINAL = 0x81
    #: Run; the set-point comes from Input Freq Setpoint or Input Speed Setpoint.
    FIELDBUS = 0x101


class ControlWord(enum.IntFlag):
    """Drive Control: BUS_CONTROL before ENABLE, and that before SWITCH_ON ([M1], [C54])."""

    SWITCH_ON = 1 << 0
    #: Does nothing but come back in the status word.
    ECHO_1 = 1 << 1
    ECHO_2 = 1 << 2
    ENABLE = 1 << 3
    #: Acknowledges a fault when it changes from 0 to 1.
    FAULT_ACK = 1 << 7
    BUS_CONTROL = 1 << 14


class Status(enum.IntFlag):
    """Drive Status ([M1], [C55])."""

    #: Ready to receive the enable command.
    READY = 1 << 0
    #: The output stage is active.
    SWITCHED_ON = 1 << 1
    #: Ready to receive the run command.
    ENABLED = 1 << 2
    FAULT_ACTIVE = 1 << 3
    #: What control bits 1 and 2 are; voltage and quick stop are not reported [C55].
    ECHO_1 = 1 << 4
    ECHO_2 = 1 << 5
    #: No run signal on terminal DIN1.
    DISABLED = 1 << 6
    ALARM_ACTIVE = 1 << 7
    CONTROL_FROM_BUS = 1 << 9
    SETPOINT_REACHED = 1 << 10
    LIMIT_ACTIVE = 1 << 11
    #: The output is suspended in sleep mode.
    SLEEP_ACTIVE = 1 << 12
    STOPMODE_BRAKE = 1 << 13
    #: The motor turns in reverse.
    REVERSE = 1 << 14
    STOPPING = 1 << 15


@functools.lru_cache(maxsize=256)
def state_of(word: int) -> State:
    """
    Return the state that a Drive Status word shows.

    [M1] has no state machine: this is derived from what it says of each bit, and what speaks of a
    turning motor goes first. UNKNOWN if no bit speaks of a state. QUICK_STOP and
    NOT_READY_TO_SWITCH_ON never come, for nothing reports them.
    """
    if word & Status.FAULT_ACTIVE:
        # while the output stage is still on, the motor is not released
        return State.FAULT_REACTION_ACTIVE if word & Status.SWITCHED_ON else State.FAULTED
    for bits, state in _STATES:
        if word & bits:
            return state
    return State.UNKNOWN


#: What any of these bits says where no earlier one is set.
_STATES = (
    (Status.STOPPING, State.STOPPING),
    # who sleeps keeps the run command and starts again by itself
    (Status.SWITCHED_ON | Status.SLEEP_ACTIVE, State.OPERATION_ENABLED),
    (Status.DISABLED, State.SWITCH_ON_DISABLED),
    # enabled comes before switched on here, the other way round than on the G2 [C54]
    (Status.ENABLED, State.SWITCHED_ON),
    (Status.READY, State.READY_TO_SWITCH_ON),
)

STATUS_WORD = StatusWord(
    state=state_of,
    by_bit={
        Status.READY: Fact.READY,
        Status.SWITCHED_ON: Fact.SWITCHED_ON,
        Status.FAULT_ACTIVE: Fact.FAULT,
        Status.DISABLED: Fact.RUN_INPUT_MISSING,
        Status.ALARM_ACTIVE: Fact.ALARM,
        Status.CONTROL_FROM_BUS: Fact.NETWORK_CONTROL,
        Status.SETPOINT_REACHED: Fact.SETPOINT_REACHED,
        Status.LIMIT_ACTIVE: Fact.LIMIT_ACTIVE,
        Status.SLEEP_ACTIVE: Fact.SLEEPING,
        Status.STOPMODE_BRAKE: Fact.STOP_MODE_BRAKE,
        Status.REVERSE: Fact.REVERSE,
        Status.STOPPING: Fact.STOPPING,
    },
    # its bit Enabled only says that a run command would be taken [C55]
    by_state={State.OPERATION_ENABLED: Fact.OPERATION_ENABLED},
    # [M1] describes bits and no states
    stateless=True,
)
