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

"""Every state and exit of [M0 table 16]."""

from hypothesis import given
from hypothesis import strategies as st
import pytest

from nfo_sinus_driver.catalog import State
from nfo_sinus_driver.families.sinus_g2.words import Control
from nfo_sinus_driver.families.sinus_g2.words import Status
from nfo_sinus_driver.families.sinus_g2.words import state_of
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Conditions
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Phase
from nfo_sinus_driver.simulator.sinus_g2.state_machine import StateMachine

POWER = Control.ENABLE_VOLTAGE | Control.DISABLE_QUICK_STOP
ON = POWER | Control.SWITCH_ON
FORWARD = ON | Control.ENABLE_OP
REVERSE = ON | Control.ENABLE_REV_OP
BOTH = FORWARD | REVERSE
EVENT = Control.EVENT_TRIGGERED_OP

MOVING = Conditions(at_zero=False, voltage=True)
RESTING = Conditions()
NOT_READY = Conditions(initialised=False)
FAULT = Conditions(fault=True)
FAULT_MOVING = Conditions(fault=True, at_zero=False, voltage=True)
COASTING = Conditions(brake=False, at_zero=False, voltage=True)
RELEASED = Conditions(brake=False, at_zero=False)
BRAKED = Conditions(at_zero=True, voltage=True)
LET_GO = Conditions(at_zero=False)


def machine_in(phase, word=FORWARD):
    machine = StateMachine()
    machine.update(word, NOT_READY)
    machine.phase = phase
    return machine


# by name: from, control word, conditions, to, the control word before
EXITS = {
    'not_ready_to_switch_on_stays_during_the_self_test': (
        'NOT_READY_TO_SWITCH_ON', ON, NOT_READY, 'NOT_READY_TO_SWITCH_ON', ON,
    ),
    'not_ready_to_switch_on_leaves_when_initialised': (
        'NOT_READY_TO_SWITCH_ON', 0, RESTING, 'SWITCH_ON_DISABLED', 0,
    ),
    'switch_on_disabled_stays_while_bit_0_is_set': (
        'SWITCH_ON_DISABLED', ON, RESTING, 'SWITCH_ON_DISABLED', ON,
    ),
    'switch_on_disabled_stays_without_quick_stop_disabled': (
        'SWITCH_ON_DISABLED', Control.ENABLE_VOLTAGE, RESTING, 'SWITCH_ON_DISABLED', 0,
    ),
    'switch_on_disabled_stays_without_voltage_enabled': (
        'SWITCH_ON_DISABLED', Control.DISABLE_QUICK_STOP, RESTING, 'SWITCH_ON_DISABLED', 0,
    ),
    'switch_on_disabled_leaves_on_bits_1_and_2_with_bit_0_low': (
        'SWITCH_ON_DISABLED', POWER, RESTING, 'READY_TO_SWITCH_ON', ON,
    ),
    'switch_on_disabled_leaves_on_auto_init': (
        'SWITCH_ON_DISABLED', ON | Control.AUTO_INIT, RESTING, 'SWITCHED_ON', 0,
    ),
    'ready_to_switch_on_stays_with_bit_0_low': (
        'READY_TO_SWITCH_ON', POWER, RESTING, 'READY_TO_SWITCH_ON', 0,
    ),
    'ready_to_switch_on_leaves_on_quick_stop': (
        'READY_TO_SWITCH_ON', Control.ENABLE_VOLTAGE, RESTING, 'SWITCH_ON_DISABLED', 0,
    ),
    'ready_to_switch_on_leaves_on_voltage_disabled': (
        'READY_TO_SWITCH_ON', Control.DISABLE_QUICK_STOP, RESTING, 'SWITCH_ON_DISABLED', 0,
    ),
    'ready_to_switch_on_leaves_on_switch_on': (
        'READY_TO_SWITCH_ON', ON, RESTING, 'SWITCHED_ON', 0,
    ),
    'switched_on_stays_without_direction': (
        'SWITCHED_ON', ON, RESTING, 'SWITCHED_ON', ON,
    ),
    'switched_on_stays_while_there_is_voltage': (
        'SWITCHED_ON', POWER, MOVING, 'SWITCHED_ON', ON,
    ),
    'switched_on_stays_on_both_directions': (
        'SWITCHED_ON', BOTH, RESTING, 'SWITCHED_ON', ON,
    ),
    'switched_on_stays_on_an_old_direction_if_an_event_is_required': (
        'SWITCHED_ON', FORWARD | EVENT, RESTING, 'SWITCHED_ON', FORWARD,
    ),
    'switched_on_leaves_on_switch_off': (
        'SWITCHED_ON', POWER, RESTING, 'READY_TO_SWITCH_ON', ON,
    ),
    # and on from there at once
    'switched_on_leaves_on_quick_stop': (
        'SWITCHED_ON', ON & ~Control.DISABLE_QUICK_STOP, RESTING, 'SWITCH_ON_DISABLED', ON,
    ),
    'switched_on_leaves_on_voltage_disabled': (
        'SWITCHED_ON', ON & ~Control.ENABLE_VOLTAGE, RESTING, 'SWITCH_ON_DISABLED', ON,
    ),
    'switched_on_leaves_on_forward': (
        'SWITCHED_ON', FORWARD, RESTING, 'OPERATION_ENABLED', ON,
    ),
    'switched_on_leaves_on_reverse': (
        'SWITCHED_ON', REVERSE, RESTING, 'OPERATION_ENABLED', ON,
    ),
    'switched_on_leaves_on_a_direction_that_comes_if_an_event_is_required': (
        'SWITCHED_ON', FORWARD | EVENT, RESTING, 'OPERATION_ENABLED', ON,
    ),
    'switched_on_leaves_on_a_direction_that_changes_if_an_event_is_required': (
        'SWITCHED_ON', REVERSE | EVENT, RESTING, 'OPERATION_ENABLED', FORWARD,
    ),
    'operation_enabled_stays_with_a_direction': (
        'OPERATION_ENABLED', FORWARD, MOVING, 'OPERATION_ENABLED', FORWARD,
    ),
    'operation_enabled_stays_on_reverse': (
        'OPERATION_ENABLED', REVERSE, MOVING, 'OPERATION_ENABLED', FORWARD,
    ),
    'operation_enabled_stays_on_both_directions': (
        'OPERATION_ENABLED', BOTH, MOVING, 'OPERATION_ENABLED', FORWARD,
    ),
    'operation_enabled_leaves_on_voltage_disabled': (
        'OPERATION_ENABLED', FORWARD & ~Control.ENABLE_VOLTAGE, MOVING, 'QUICK_STOP', FORWARD,
    ),
    'operation_enabled_leaves_on_quick_stop': (
        'OPERATION_ENABLED', FORWARD & ~Control.DISABLE_QUICK_STOP, MOVING, 'QUICK_STOP', FORWARD,
    ),
    'operation_enabled_leaves_on_switch_off': (
        'OPERATION_ENABLED', FORWARD & ~Control.SWITCH_ON, MOVING, 'SHUTDOWN', FORWARD,
    ),
    'operation_enabled_leaves_on_a_lost_direction': (
        'OPERATION_ENABLED', ON, MOVING, 'DISABLE', FORWARD,
    ),
    'disable_stays_while_it_brakes': (
        'DISABLE', ON, MOVING, 'DISABLE', ON,
    ),
    'disable_leaves_on_voltage_disabled': (
        'DISABLE', ON & ~Control.ENABLE_VOLTAGE, MOVING, 'QUICK_STOP', ON,
    ),
    'disable_leaves_on_quick_stop': (
        'DISABLE', ON & ~Control.DISABLE_QUICK_STOP, MOVING, 'QUICK_STOP', ON,
    ),
    'disable_leaves_on_switch_off': (
        'DISABLE', POWER, MOVING, 'SHUTDOWN', ON,
    ),
    'disable_leaves_on_a_direction': (
        'DISABLE', REVERSE, MOVING, 'OPERATION_ENABLED', ON,
    ),
    'disable_leaves_at_zero_rpm': (
        'DISABLE', ON, BRAKED, 'SWITCHED_ON', ON,
    ),
    'disable_leaves_on_coast': (
        'DISABLE', ON | Control.OVERRIDE_COAST, MOVING, 'SWITCHED_ON', ON,
    ),
    'shutdown_stays_while_it_brakes': (
        'SHUTDOWN', POWER, MOVING, 'SHUTDOWN', ON,
    ),
    'shutdown_stays_at_zero_rpm_while_there_is_voltage': (
        'SHUTDOWN', POWER, BRAKED, 'SHUTDOWN', ON,
    ),
    'shutdown_stays_while_it_coasts_and_there_is_voltage': (
        'SHUTDOWN', POWER, COASTING, 'SHUTDOWN', ON,
    ),
    'shutdown_leaves_when_it_has_braked_and_the_voltage_is_off': (
        'SHUTDOWN', POWER, RESTING, 'READY_TO_SWITCH_ON', ON,
    ),
    'shutdown_leaves_when_it_coasts_and_the_voltage_is_off': (
        'SHUTDOWN', POWER, RELEASED, 'READY_TO_SWITCH_ON', ON,
    ),
    'shutdown_leaves_when_coast_is_chosen_and_the_voltage_is_off': (
        'SHUTDOWN', POWER | Control.OVERRIDE_COAST, LET_GO, 'READY_TO_SWITCH_ON', ON,
    ),
    'shutdown_leaves_on_voltage_disabled': (
        'SHUTDOWN', Control.DISABLE_QUICK_STOP, MOVING, 'QUICK_STOP', ON,
    ),
    'shutdown_leaves_on_quick_stop': (
        'SHUTDOWN', Control.ENABLE_VOLTAGE, MOVING, 'QUICK_STOP', ON,
    ),
    'shutdown_leaves_on_switch_on': (
        'SHUTDOWN', FORWARD, MOVING, 'OPERATION_ENABLED', FORWARD,
    ),
    # by way of OPERATION_ENABLED, which a lost direction leaves
    'shutdown_leaves_on_switch_on_without_direction': (
        'SHUTDOWN', ON, MOVING, 'DISABLE', POWER,
    ),
    'quick_stop_stays_while_there_is_voltage': (
        'QUICK_STOP', FORWARD, MOVING, 'QUICK_STOP', ON,
    ),
    'quick_stop_leaves_when_the_voltage_is_off': (
        'QUICK_STOP', 0, RESTING, 'SWITCH_ON_DISABLED', ON,
    ),
    'fault_reaction_active_stays_while_there_is_voltage': (
        'FAULT_REACTION_ACTIVE', ON, FAULT_MOVING, 'FAULT_REACTION_ACTIVE', ON,
    ),
    'fault_reaction_active_leaves_when_the_voltage_is_off': (
        'FAULT_REACTION_ACTIVE', ON, FAULT, 'FAULTED', ON,
    ),
    'faulted_stays_while_the_fault_stands': (
        'FAULTED', ON, FAULT, 'FAULTED', ON,
    ),
    'faulted_leaves_when_the_fault_is_gone_and_acknowledged': (
        'FAULTED', ON, RESTING, 'SWITCH_ON_DISABLED', ON,
    ),
}


@pytest.mark.parametrize(
    ('begin', 'word', 'conditions', 'end', 'before'), EXITS.values(), ids=EXITS
)
def test_table_16(begin, word, conditions, end, before):
    machine = machine_in(Phase[begin], Control(before))
    machine.update(Control(word), conditions)
    assert machine.phase is Phase[end]


def test_every_state_has_its_exits():
    left = {begin for begin, _, _, end, _ in EXITS.values() if begin != end}
    assert left == set(Phase.__members__)


@pytest.mark.parametrize(
    'phase',
    [phase for phase in Phase if phase is not Phase.FAULTED],
    ids=lambda phase: f'{phase.value.lower()}_leaves_on_a_fault',
)
def test_table_16_fault(phase):
    machine = machine_in(phase)
    machine.update(FORWARD, FAULT_MOVING)
    assert machine.phase is Phase.FAULT_REACTION_ACTIVE
    assert not machine.driven


def test_braking_in_shutdown_lets_go_at_zero_and_stays_off():
    machine = machine_in(Phase.OPERATION_ENABLED)
    machine.update(POWER, MOVING)
    assert machine.phase is Phase.SHUTDOWN
    assert machine.driven
    machine.update(POWER, BRAKED)
    assert not machine.driven
    machine.update(POWER, MOVING)
    assert not machine.driven
    machine.update(POWER, RESTING)
    assert machine.phase is Phase.READY_TO_SWITCH_ON


@pytest.mark.parametrize(
    ('word', 'conditions'), [(POWER, COASTING), (POWER | Control.OVERRIDE_COAST, MOVING)]
)
def test_shutdown_may_coast(word, conditions):
    machine = machine_in(Phase.OPERATION_ENABLED)
    machine.update(word, conditions)
    assert machine.phase is Phase.SHUTDOWN
    assert not machine.driven


@pytest.mark.parametrize(
    ('phase', 'rises', 'resets'),
    [
        (Phase.FAULTED, True, True),
        (Phase.FAULTED, False, False),
        (Phase.FAULT_REACTION_ACTIVE, True, False),
        (Phase.OPERATION_ENABLED, True, False),
    ],
)
def test_only_a_rising_bit_7_resets_and_only_when_faulted(phase, rises, resets):
    machine = machine_in(phase, Control(0) if rises else Control.RESET_MALFUNCTION)
    assert machine.asks_reset(Control.RESET_MALFUNCTION) is resets


SHOWN = {
    Phase.DISABLE: State.STOPPING,
    Phase.SHUTDOWN: State.STOPPING,
}


@given(
    phase=st.sampled_from(list(Phase)),
    word=st.integers(0, 0xFFFF),
    reverse=st.booleans(),
)
def test_the_status_word_shows_the_state(phase, word, reverse):
    machine = machine_in(phase, Control(word))
    machine.direction = -1 if reverse else 1
    shown = state_of(int(machine.status()))
    assert shown is SHOWN.get(phase, State.__members__.get(phase.value))


@pytest.mark.parametrize(('word', 'bit'), [(FORWARD, 'OP_ENABLED'), (REVERSE, 'REV_OP_ENABLED')])
def test_the_direction_is_kept_while_it_stops(word, bit):
    machine = machine_in(Phase.SWITCHED_ON, ON)
    machine.update(word, RESTING)
    machine.update(ON, MOVING)
    assert machine.phase is Phase.DISABLE
    assert machine.status() & Status[bit]
    assert machine.status() & Status.STOPPING


@given(st.lists(st.tuples(st.integers(0, 0xFFFF), st.tuples(*[st.booleans()] * 5))))
def test_any_words_in_any_conditions_leave_it_in_a_state(inputs):
    machine = StateMachine()
    for word, (initialised, fault, brake, at_zero, voltage) in inputs:
        machine.update(Control(word), Conditions(initialised, fault, brake, at_zero, voltage))
        assert machine.phase in Phase
        assert not (machine.driven and fault)
