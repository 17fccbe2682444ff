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
Control and status words of the Sinus H [M3 §7.2].

Bits 1, 2, 4, 5 and 9 of ZSW1 come back as they were sent [C104]: that they stand says that the
drive has heard, and nothing of the motor, for which the actual value speaks.
"""

from __future__ import annotations

import enum
import functools

from nfo_sinus_driver.catalog.status import Fact
from nfo_sinus_driver.catalog.status import State
from nfo_sinus_driver.families._telegram1 import method
from nfo_sinus_driver.families._telegram1.method import Words


class Control(enum.IntFlag):
    """STW1 [M3 §7.2.1]; without bit 10 all of it is ignored [C107]."""

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
    """ZSW1 [M3 §7.2.2]."""

    READY_ON = 1 << 0
    #: What control bit 0 is, and bit 3.
    ECHO_ON = 1 << 1
    ECHO_ENABLE_OPERATION = 1 << 2
    FAULT = 1 << 3
    ECHO_NO_COAST_STOP = 1 << 4
    ECHO_NO_QUICK_STOP = 1 << 5
    SWITCHING_ON_INHIBITED = 1 << 6
    WARNING = 1 << 7
    SETPOINT_REACHED = 1 << 8
    ECHO_CONTROL_BY_PLC = 1 << 9


_PATTERN = (
    Status.SWITCHING_ON_INHIBITED
    | Status.READY_ON
    | Status.ECHO_ON
    | Status.ECHO_ENABLE_OPERATION
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
    Return the state that ZSW1 shows, S1 to S4 [M3 §6]; UNKNOWN for a pattern that is none.

    An echo may come before the state that it belongs to: bit 6 and bit 0, which are the drive's
    own, have the last word then.
    """
    if word & Status.FAULT:
        return State.FAULTED
    found = _STATES.get(word & _PATTERN)
    if found is not None:
        return found
    if word & Status.SWITCHING_ON_INHIBITED:
        return State.SWITCH_ON_DISABLED
    return State.READY_TO_SWITCH_ON if word & Status.READY_ON else State.NOT_READY_TO_SWITCH_ON


STATUS_WORD = Words(
    state=state_of,
    by_bit={
        Status.READY_ON: Fact.READY,
        Status.FAULT: Fact.FAULT,
        Status.SWITCHING_ON_INHIBITED: Fact.SWITCH_ON_DISABLED,
        Status.WARNING: Fact.ALARM,
        Status.SETPOINT_REACHED: Fact.SETPOINT_REACHED,
        # the drive has heard that we want it, and the PLC lets us
        Status.ECHO_CONTROL_BY_PLC: Fact.NETWORK_CONTROL,
    },
    by_state={},
    stateless=True,
    code=lambda word: method.code_of(
        word, state_of(word), fault=Status.FAULT, warning=Status.WARNING
    ),
    by_frequency=True,
    only_frequency=True,
)
