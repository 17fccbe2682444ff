# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Commands, events of the drive and losses of the line in any order; see ``any_order_laws.py``.

Hypothesis makes up the histories, and shortens one that breaks a law to what is needed for it. What
it prints then can be run as it stands.
"""

from __future__ import annotations

import os

from any_order_lines import LINES, LineOrder
from any_order_machine import AnyOrder
from any_order_machines import MACHINES, G2DriveControl, G2ModeScmd, OptimalModeScmd
from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis.stateful import run_state_machine_as_test
import pytest
from support.examples import FULL
from support.line_runs import HAPPENS

#: How many histories a campaign has in all, 0: a normal run; and where they come from.
HISTORIES = int(os.environ.get('HISTORIES', '0'))
SEED = int(os.environ.get('SEED', '0'))
#: So many go to a worker at a time.
_SHARE = 100
#: Always the same histories, so that what passes once passes on every machine.
NORMAL = settings(
    max_examples=40 if FULL else 2,
    stateful_step_count=30,
    derandomize=True,
    deadline=None,
    database=None,
    phases=(Phase.generate,),
    suppress_health_check=list(HealthCheck),
    print_blob=False,
)
#: A step of a line takes as long as one of each of its drives.
NORMAL_OF_LINES = settings(NORMAL, max_examples=20, stateful_step_count=12)
#: A line runs again after one in so many of the things that can happen to it.
_ONE_IN = 1 if FULL else 5
#: What breaks a law is shortened.
CAMPAIGN = settings(
    NORMAL,
    max_examples=_SHARE,
    derandomize=False,
    phases=(Phase.generate, Phase.shrink),
)


@pytest.mark.parametrize('machine', MACHINES)
def test_each_event_ends_a_run(machine: type[AnyOrder]) -> None:
    """Whatever hypothesis makes up, each event has its history, and so has what follows it."""
    state = machine()
    state.begin_for_each_event()
    try:
        for event in dict.fromkeys(machine.enders):
            state.end_run(event, after=0.2, wait=1.0)
            if state.rig.far.faults:
                state.end_fault(wait=1.0)
            if not state.rig.far.control_unit.run_input:
                state.run_input_on(wait=1.0)
            state.put_right()
        # a refused enable leaves nothing by which the motor starts later
        state.enable_without_run_input(wait=1.0)
        state.run_input_on(wait=2.5)
        state.put_right()
        for give in ('', 'stop', 'deactivate'):
            state.lose_line('silent', give, 9.0, wait=2.5)
        state.put_right()
        # a program that has ended
        state.run_motor(wait=1.0)
        state.send(None, wait=4.0)
        state.run_motor(wait=1.0)
        # the next driver finds the motor running
        state.kill(wait=1.0)
        state.let(2.5)
    finally:
        state.teardown()


@pytest.mark.parametrize('machine', LINES if FULL else LINES[2::3])
def test_a_line_runs_again_whatever_happened_to_it(machine: type[LineOrder]) -> None:
    state = machine()
    state.begin()
    try:
        for happens in list(HAPPENS)[LINES.index(machine) % _ONE_IN :: _ONE_IN]:
            state.happen(happens)
            state.put_right()
        state.end()
    finally:
        state.teardown()


@pytest.mark.parametrize('machine', [G2ModeScmd, G2DriveControl, OptimalModeScmd])
def test_a_set_point_from_before_enable_turns_nothing(machine: type[AnyOrder]) -> None:
    state = machine()
    state.begin()
    try:
        state.set_once(20.0)
        state.enable(wait=1.0)
        assert state.rig.drive.following
        assert state.rig.far.motor.frequency == 0
        # nor does one from the run before
        state.send(20.0, wait=1.0)
        assert state.rig.far.motor.frequency > 19.0
        state.send(None, wait=0.1)
        state.stop(wait=2.0)
        state.enable(wait=1.0)
        assert state.rig.drive.following
        assert state.rig.far.motor.frequency == 0
    finally:
        state.teardown()


@pytest.mark.parametrize('machine', [G2ModeScmd, G2DriveControl])
def test_a_fault_that_ends_by_itself_ends_the_run(machine: type[AnyOrder]) -> None:
    state = machine()
    state.begin(restart_after=1)
    try:
        for wait in (0.6, 1.0):
            state.run_motor(wait=wait)
            state.fault(5, standing=True, wait=wait)
            state.end_cause(wait=0.9)
            assert state.rig.far.faults and not state.rig.far.motor.driven
            driven = []
            for _ in range(100):
                state.let(0.02)
                driven.append(state.rig.far.motor.driven)
            assert not state.rig.far.faults and not state.laws.standing
            # who refuses every command while a fault is active cannot be stopped before it ends
            assert any(driven) == (state.method == 'mode_scmd')
            assert not driven[-1]
    finally:
        state.teardown()


@pytest.mark.skipif(HISTORIES > 0, reason='a campaign')
@pytest.mark.timeout(900)
@pytest.mark.parametrize('machine', MACHINES)
def test_any_order(machine: type[AnyOrder]) -> None:
    run_state_machine_as_test(machine, settings=NORMAL)


@pytest.mark.skipif(not FULL or HISTORIES > 0, reason='with FULL=1, and in a campaign')
@pytest.mark.timeout(900)
@pytest.mark.parametrize('machine', LINES)
def test_any_order_on_a_line(machine: type[LineOrder]) -> None:
    run_state_machine_as_test(machine, settings=NORMAL_OF_LINES)


@pytest.mark.skipif(not HISTORIES, reason='only in a campaign')
@pytest.mark.timeout(3600)
@pytest.mark.parametrize('part', range(-(-HISTORIES // _SHARE)))
def test_campaign(part: int) -> None:
    """Go through a share of the histories; each has a seed of its own, and a machine in turn."""
    machines = (*MACHINES, *LINES)
    machine = machines[part % len(machines)]
    seeded = seed(f'{SEED} {part}')(type(machine.__name__, (machine,), {}))
    run_state_machine_as_test(seeded, settings=CAMPAIGN)
