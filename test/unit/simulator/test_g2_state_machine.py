# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Every state and exit of [M0 table 16]."""

from hypothesis import given, strategies as st

from nfo_sinus_driver.catalog import State
from nfo_sinus_driver.families.sinus_g2.words import ControlWord, Status, state_of
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Conditions, Phase, StateMachine

VOLTAGE, QUICK = ControlWord.ENABLE_VOLTAGE, ControlWord.DISABLE_QUICK_STOP
POWER = VOLTAGE | QUICK
ON = POWER | ControlWord.SWITCH_ON
FORWARD = ON | ControlWord.ENABLE_OP
REVERSE = ON | ControlWord.ENABLE_REV_OP
BOTH = FORWARD | REVERSE
EVENT, COAST = ControlWord.EVENT_TRIGGERED_OP, ControlWord.OVERRIDE_COAST

MOVING = Conditions(at_zero=False, voltage=True)
RESTING = Conditions()
NOT_READY = Conditions(initialised=False)
FAULT = Conditions(fault=True)
FAULT_MOVING = Conditions(fault=True, at_zero=False, voltage=True)
COASTING = Conditions(brake=False, at_zero=False, voltage=True)
RELEASED = Conditions(brake=False, at_zero=False)
BRAKED = Conditions(at_zero=True, voltage=True)
LET_GO = Conditions(at_zero=False)

#: From, control word, conditions, to, the control word before. SWITCHED_ON goes on at once where
#: quick stop or voltage say so, and SHUTDOWN by way of OPERATION_ENABLED.
EXITS = (
    ('NOT_READY_TO_SWITCH_ON', ON, NOT_READY, 'NOT_READY_TO_SWITCH_ON', ON),
    ('NOT_READY_TO_SWITCH_ON', 0, RESTING, 'SWITCH_ON_DISABLED', 0),
    ('SWITCH_ON_DISABLED', ON, RESTING, 'SWITCH_ON_DISABLED', ON),
    ('SWITCH_ON_DISABLED', VOLTAGE, RESTING, 'SWITCH_ON_DISABLED', 0),
    ('SWITCH_ON_DISABLED', QUICK, RESTING, 'SWITCH_ON_DISABLED', 0),
    ('SWITCH_ON_DISABLED', POWER, RESTING, 'READY_TO_SWITCH_ON', ON),
    ('SWITCH_ON_DISABLED', ON | ControlWord.AUTO_INIT, RESTING, 'SWITCHED_ON', 0),
    ('READY_TO_SWITCH_ON', POWER, RESTING, 'READY_TO_SWITCH_ON', 0),
    ('READY_TO_SWITCH_ON', VOLTAGE, RESTING, 'SWITCH_ON_DISABLED', 0),
    ('READY_TO_SWITCH_ON', QUICK, RESTING, 'SWITCH_ON_DISABLED', 0),
    ('READY_TO_SWITCH_ON', ON, RESTING, 'SWITCHED_ON', 0),
    ('SWITCHED_ON', ON, RESTING, 'SWITCHED_ON', ON),
    ('SWITCHED_ON', POWER, MOVING, 'SWITCHED_ON', ON),
    ('SWITCHED_ON', BOTH, RESTING, 'SWITCHED_ON', ON),
    ('SWITCHED_ON', FORWARD | EVENT, RESTING, 'SWITCHED_ON', FORWARD),
    ('SWITCHED_ON', POWER, RESTING, 'READY_TO_SWITCH_ON', ON),
    ('SWITCHED_ON', ON & ~QUICK, RESTING, 'SWITCH_ON_DISABLED', ON),
    ('SWITCHED_ON', ON & ~VOLTAGE, RESTING, 'SWITCH_ON_DISABLED', ON),
    ('SWITCHED_ON', FORWARD, RESTING, 'OPERATION_ENABLED', ON),
    ('SWITCHED_ON', REVERSE, RESTING, 'OPERATION_ENABLED', ON),
    ('SWITCHED_ON', FORWARD | EVENT, RESTING, 'OPERATION_ENABLED', ON),
    ('SWITCHED_ON', REVERSE | EVENT, RESTING, 'OPERATION_ENABLED', FORWARD),
    ('OPERATION_ENABLED', FORWARD, MOVING, 'OPERATION_ENABLED', FORWARD),
    ('OPERATION_ENABLED', REVERSE, MOVING, 'OPERATION_ENABLED', FORWARD),
    ('OPERATION_ENABLED', BOTH, MOVING, 'OPERATION_ENABLED', FORWARD),
    ('OPERATION_ENABLED', FORWARD & ~VOLTAGE, MOVING, 'QUICK_STOP', FORWARD),
    ('OPERATION_ENABLED', FORWARD & ~QUICK, MOVING, 'QUICK_STOP', FORWARD),
    ('OPERATION_ENABLED', FORWARD & ~ControlWord.SWITCH_ON, MOVING, 'SHUTDOWN', FORWARD),
    ('OPERATION_ENABLED', ON, MOVING, 'DISABLE', FORWARD),
    ('DISABLE', ON, MOVING, 'DISABLE', ON),
    ('DISABLE', ON & ~VOLTAGE, MOVING, 'QUICK_STOP', ON),
    ('DISABLE', ON & ~QUICK, MOVING, 'QUICK_STOP', ON),
    ('DISABLE', POWER, MOVING, 'SHUTDOWN', ON),
    ('DISABLE', REVERSE, MOVING, 'OPERATION_ENABLED', ON),
    ('DISABLE', ON, BRAKED, 'SWITCHED_ON', ON),
    ('DISABLE', ON | COAST, MOVING, 'SWITCHED_ON', ON),
    ('SHUTDOWN', POWER, MOVING, 'SHUTDOWN', ON),
    ('SHUTDOWN', POWER, BRAKED, 'SHUTDOWN', ON),
    ('SHUTDOWN', POWER, COASTING, 'SHUTDOWN', ON),
    ('SHUTDOWN', POWER, RESTING, 'READY_TO_SWITCH_ON', ON),
    ('SHUTDOWN', POWER, RELEASED, 'READY_TO_SWITCH_ON', ON),
    ('SHUTDOWN', POWER | COAST, LET_GO, 'READY_TO_SWITCH_ON', ON),
    ('SHUTDOWN', QUICK, MOVING, 'QUICK_STOP', ON),
    ('SHUTDOWN', VOLTAGE, MOVING, 'QUICK_STOP', ON),
    ('SHUTDOWN', FORWARD, MOVING, 'OPERATION_ENABLED', FORWARD),
    ('SHUTDOWN', ON, MOVING, 'DISABLE', POWER),
    ('QUICK_STOP', FORWARD, MOVING, 'QUICK_STOP', ON),
    ('QUICK_STOP', 0, RESTING, 'SWITCH_ON_DISABLED', ON),
    ('FAULT_REACTION_ACTIVE', ON, FAULT_MOVING, 'FAULT_REACTION_ACTIVE', ON),
    ('FAULT_REACTION_ACTIVE', ON, FAULT, 'FAULTED', ON),
    ('FAULTED', ON, FAULT, 'FAULTED', ON),
    ('FAULTED', ON, RESTING, 'SWITCH_ON_DISABLED', ON),
)


def machine_in(phase, word=FORWARD):
    machine = StateMachine()
    machine.update(word, NOT_READY)
    machine.phase = phase
    return machine


def test_every_exit_of_table_16_leads_where_it_says():
    wrong = []
    for begin, word, conditions, end, before in EXITS:
        machine = machine_in(Phase[begin], ControlWord(before))
        machine.update(ControlWord(word), conditions)
        if machine.phase is not Phase[end]:
            wrong.append((begin, word, conditions, end, machine.phase))
    assert not wrong
    assert {row[0] for row in EXITS if row[0] != row[3]} == set(Phase.__members__), 'all are left'


def test_every_state_is_left_by_a_fault():
    for phase in set(Phase) - {Phase.FAULTED}:
        machine = machine_in(phase)
        machine.update(FORWARD, FAULT_MOVING)
        assert machine.phase is Phase.FAULT_REACTION_ACTIVE, phase
        assert not machine.driven


def test_braking_in_shutdown_lets_go_at_zero_and_stays_off():
    machine = machine_in(Phase.OPERATION_ENABLED)
    driven = []
    for conditions in (MOVING, BRAKED, MOVING):
        machine.update(POWER, conditions)
        driven.append((machine.phase, machine.driven))
    assert driven == [(Phase.SHUTDOWN, True), (Phase.SHUTDOWN, False), (Phase.SHUTDOWN, False)]
    machine.update(POWER, RESTING)
    assert machine.phase is Phase.READY_TO_SWITCH_ON


def test_shutdown_may_coast():
    for word, conditions in ((POWER, COASTING), (POWER | COAST, MOVING)):
        machine = machine_in(Phase.OPERATION_ENABLED)
        machine.update(word, conditions)
        assert (machine.phase, machine.driven) == (Phase.SHUTDOWN, False)


def test_only_a_rising_bit_7_resets_and_only_when_faulted():
    for phase, rises, resets in (
        (Phase.FAULTED, True, True),
        (Phase.FAULTED, False, False),
        (Phase.FAULT_REACTION_ACTIVE, True, False),
        (Phase.OPERATION_ENABLED, True, False),
    ):
        machine = machine_in(phase, ControlWord(0) if rises else ControlWord.RESET_MALFUNCTION)
        assert machine.asks_reset(ControlWord.RESET_MALFUNCTION) is resets, phase


@given(st.sampled_from(list(Phase)), st.integers(0, 0xFFFF), st.booleans())
def test_the_status_word_shows_the_state(phase, word, reverse):
    machine = machine_in(phase, ControlWord(word))
    machine.direction = -1 if reverse else 1
    stopping = phase in (Phase.DISABLE, Phase.SHUTDOWN)
    expected = State.STOPPING if stopping else State.__members__.get(phase.value)
    assert state_of(int(machine.status())) is expected


def test_the_direction_is_kept_while_it_stops():
    for word, bit in ((FORWARD, Status.OP_ENABLED), (REVERSE, Status.REV_OP_ENABLED)):
        machine = machine_in(Phase.SWITCHED_ON, ON)
        machine.update(word, RESTING)
        machine.update(ON, MOVING)
        assert machine.phase is Phase.DISABLE
        assert machine.status() & bit and machine.status() & Status.STOPPING


@given(st.lists(st.tuples(st.integers(0, 0xFFFF), st.tuples(*[st.booleans()] * 5))))
def test_any_words_in_any_conditions_leave_it_in_a_state(inputs):
    machine = StateMachine()
    for word, (initialised, fault, brake, at_zero, voltage) in inputs:
        machine.update(ControlWord(word), Conditions(initialised, fault, brake, at_zero, voltage))
        assert machine.phase in Phase
        assert not (machine.driven and fault)
