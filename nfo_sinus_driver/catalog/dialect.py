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
What each model means by its words: the same register and bit say different things ([C49] to [C55]).

A :class:`Dialect` turns the status word and the inverter status code into facts and groups that
mean the same on every model, so that who drives or simulates one need not ask which it is.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass
import enum
import functools

from nfo_sinus_driver.catalog import inv_st
from nfo_sinus_driver.catalog import words
from nfo_sinus_driver.catalog import words_optimal
from nfo_sinus_driver.catalog.inv_st import Kind
from nfo_sinus_driver.catalog.words import State


class Fact(enum.IntFlag):
    """What a drive may say of itself; names and values are those of the message DriveStatus."""

    READY = 1 << 0
    SWITCHED_ON = 1 << 1
    OPERATION_ENABLED = 1 << 2
    FAULT = 1 << 3
    ALARM = 1 << 4
    VOLTAGE_ENABLED = 1 << 5
    QUICK_STOP_ACTIVE = 1 << 6
    SWITCH_ON_DISABLED = 1 << 7
    NETWORK_REFERENCE = 1 << 8
    NETWORK_CONTROL = 1 << 9
    SETPOINT_REACHED = 1 << 10
    LIMIT_ACTIVE = 1 << 11
    SLEEPING = 1 << 12
    STOP_MODE_BRAKE = 1 << 13
    REVERSE = 1 << 14
    STOPPING = 1 << 15
    RUN_INPUT_MISSING = 1 << 16


@dataclass(frozen=True)
class Codes:
    """
    Inverter status codes by what they mean.

    :ivar bus_standby: motor off, waiting for a command over the bus.
    :ivar bus_running: running under bus control.
    :ivar slowing: those in which the speed may decrease under bus control, be it to a stop.
    :ivar terminals: standing by or running under terminal control.
    :ivar keypad: running where neither the bus nor the terminals have control.
    :ivar local_running: those of these two in which the motor is driven.
    :ivar running: the motor is driven, on whose command ever.
    :ivar anonymous: they do not say who controls.
    :ivar start_delay: the run command is there and the start is delayed.
    :ivar tuning: a tuning procedure is going on.
    :ivar tuned: one has ended well.
    :ivar tuning_failed: one has not.
    :ivar current_limit: the current limit holds the motor back.
    :ivar sio_fail: the serial line was silent for too long, or damaged.
    :ivar bus_fail: the same of the fieldbus.
    """

    bus_standby: frozenset[int]
    bus_running: frozenset[int]
    slowing: frozenset[int]
    terminals: frozenset[int]
    keypad: frozenset[int]
    local_running: frozenset[int]
    running: frozenset[int]
    anonymous: frozenset[int]
    start_delay: int
    tuning: int
    tuned: frozenset[int]
    tuning_failed: frozenset[int]
    current_limit: int = inv_st.CURRENT_LIMIT
    sio_fail: int = inv_st.SIO_FAIL
    bus_fail: int = inv_st.BUS_FAIL


@dataclass(frozen=True)
class Dialect:
    """
    How one model speaks.

    :ivar control: the bits of its control word.
    :ivar status: the bits of its status word.
    :ivar mode: the codes of MODE.
    :ivar command: the codes of SCMD or SMODE.
    :ivar state: gives the state that a status word shows.
    :ivar stateless: a status word may show none; where not, such a word is none of this drive.
    :ivar writes_and_reads: it has Modbus function 23 ([M0 §6.2.3], [C57]).
    :ivar by_bit: which facts each bit of the status word tells.
    :ivar by_state: which facts only the state tells.
    :ivar codes: its inverter status codes by what they mean.
    """

    control: type[enum.IntFlag]
    status: type[enum.IntFlag]
    mode: type[enum.IntEnum]
    command: type[enum.IntEnum]
    state: Callable[[int], State]
    by_bit: Mapping[int, Fact]
    by_state: Mapping[State, Fact]
    codes: Codes
    stateless: bool = False
    writes_and_reads: bool = False

    def may_say(self, word: int) -> bool:
        """Tell whether a status word is one of those that the manual knows."""
        return self.stateless or self.state(word) is not State.UNKNOWN

    @functools.cached_property
    def valid(self) -> Fact:
        """The facts that this model tells at all; of the others nothing is known."""
        valid = Fact.ALARM  # where no bit tells it, the inverter status does
        for fact in (*self.by_bit.values(), *self.by_state.values()):
            valid |= fact
        return valid

    def facts(self, word: int, listed: Kind) -> Fact:
        """
        Return what a status word says.

        :param listed: the kind of the inverter status code read with it, as its table has it.
        """
        facts = self._bits(word) | self.by_state.get(self.state(word), Fact(0))
        return facts | Fact.ALARM if self.kind(word, listed) is Kind.ALARM else facts

    def kind(self, word: int, listed: Kind) -> Kind:
        """
        Return how grave the inverter status is: the bits have the last word ([C50], [C95]).

        :param listed: as its table has it.
        """
        facts = self._bits(word)
        if Fact.FAULT in facts:
            return Kind.FAULT
        if Fact.ALARM in self.by_bit.values():
            return Kind.ALARM if Fact.ALARM in facts else Kind.STATUS
        return Kind.ALARM if listed is Kind.FAULT else listed

    @functools.cached_property
    def _pairs(self) -> tuple[tuple[int, int], ...]:
        # plain numbers: this is done with every poll, and flags take their time
        return tuple((int(bit), int(fact)) for bit, fact in self.by_bit.items())

    def _bits(self, word: int) -> Fact:
        facts = 0
        for bit, fact in self._pairs:
            if word & bit:
                facts |= fact
        return Fact(facts)


_G2 = words.Status
_OPTIMAL = words_optimal.Status

DIALECTS: Mapping[str, Dialect] = {
    'sinus_g2': Dialect(
        control=words.Control,
        status=words.Status,
        mode=words.Mode,
        command=words.Scmd,
        state=words.state_of,
        by_bit={
            _G2.READY_TO_SWITCH_ON: Fact.READY,
            _G2.SWITCHED_ON: Fact.SWITCHED_ON,
            _G2.OP_ENABLED: Fact.OPERATION_ENABLED,
            _G2.FAULTED: Fact.FAULT,
            _G2.VOLTAGE_ENABLED: Fact.VOLTAGE_ENABLED,
            _G2.SWITCH_ON_DISABLED: Fact.SWITCH_ON_DISABLED,
            _G2.REF_FROM_NET: Fact.NETWORK_REFERENCE,
            _G2.CTRL_FROM_NET: Fact.NETWORK_CONTROL,
            _G2.SETPOINT_REACHED: Fact.SETPOINT_REACHED,
            _G2.LIMIT_ACTIVE: Fact.LIMIT_ACTIVE,
            _G2.REV_OP_ENABLED: Fact.OPERATION_ENABLED | Fact.REVERSE,
            _G2.STOPPING: Fact.STOPPING,
        },
        # bit 5 is undefined outside the driven states [M0 table 16]
        by_state={State.QUICK_STOP: Fact.QUICK_STOP_ACTIVE},
        codes=Codes(
            bus_standby=inv_st.BUS_STANDBY,
            bus_running=inv_st.BUS_RUNNING,
            # the chopper takes what a motor gives back that slows down
            slowing=inv_st.BUS_SLOWING | {inv_st.BRAKE_CHOPPER},
            terminals=inv_st.TERMINALS,
            keypad=inv_st.KEYPAD,
            local_running=inv_st.LOCAL_RUNNING,
            running=frozenset({inv_st.BRAKE_CHOPPER, inv_st.CURRENT_LIMIT}),
            anonymous=frozenset(
                {inv_st.START_DELAY, inv_st.BRAKE_CHOPPER, inv_st.CURRENT_LIMIT}
            ),
            start_delay=inv_st.START_DELAY,
            tuning=inv_st.TUNING,
            tuned=frozenset({45, 46, 47}),
            tuning_failed=frozenset({16, 17}),
        ),
        writes_and_reads=True,
    ),
    'sinus_optimal': Dialect(
        control=words_optimal.Control,
        status=words_optimal.Status,
        mode=words_optimal.Mode,
        command=words_optimal.Smode,
        state=words_optimal.state_of,
        by_bit={
            _OPTIMAL.READY: Fact.READY,
            _OPTIMAL.SWITCHED_ON: Fact.SWITCHED_ON,
            _OPTIMAL.FAULT_ACTIVE: Fact.FAULT,
            _OPTIMAL.DISABLED: Fact.RUN_INPUT_MISSING,
            _OPTIMAL.ALARM_ACTIVE: Fact.ALARM,
            _OPTIMAL.CONTROL_FROM_BUS: Fact.NETWORK_CONTROL,
            _OPTIMAL.SETPOINT_REACHED: Fact.SETPOINT_REACHED,
            _OPTIMAL.LIMIT_ACTIVE: Fact.LIMIT_ACTIVE,
            _OPTIMAL.SLEEP_ACTIVE: Fact.SLEEPING,
            _OPTIMAL.STOPMODE_BRAKE: Fact.STOP_MODE_BRAKE,
            _OPTIMAL.REVERSE: Fact.REVERSE,
            _OPTIMAL.STOPPING: Fact.STOPPING,
        },
        # its bit Enabled only says that a run command would be taken [C55]
        by_state={State.OPERATION_ENABLED: Fact.OPERATION_ENABLED},
        codes=Codes(
            bus_standby=frozenset({37}),
            bus_running=frozenset({38, 39, 40}),
            slowing=frozenset({26, 32, 40}),
            terminals=inv_st.TERMINALS,
            # of Final Freq, Accel and Decel [M1] does not say who controls: nobody else is left
            keypad=frozenset({30, 31, 32}),
            local_running=frozenset({34, 35, 36}),
            running=frozenset({26, 27, 30, 31, 32}),
            anonymous=frozenset({24, 25, 26, 27, 30, 31, 32, 54}),
            start_delay=54,
            tuning=28,
            tuned=frozenset({44, 45, 46, 47}),
            tuning_failed=frozenset({16, 17, 18, 19}),
        ),
        # [M1] describes bits and no states
        stateless=True,
    ),
}
