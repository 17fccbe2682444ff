# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The table of control: every row of it is visited in histories that the laws judge.

What it allows: :mod:`test_control_table`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import contextlib

from any_order_machine import AnyOrder
from any_order_machines import G2ModeScmd
import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.drive.known import control_state
from nfo_sinus_driver.drive.known.control_state import TRANSITIONS, ControlEvent, ControlState

Row = tuple[ControlState, ControlEvent]


class Visited(dict[Row, ControlState]):
    """The table, which notes the rows that are looked up."""

    def __init__(self, table: Mapping[Row, ControlState]) -> None:
        super().__init__(table)
        self.rows: set[Row] = set()

    def get(self, row: Row, default: ControlState) -> ControlState:  # type: ignore[override]
        self.rows.add(row)
        return super().get(row, default)


@contextlib.contextmanager
def history(**how: object) -> Iterator[AnyOrder]:
    """Begin a history, and judge it as a whole at its end."""
    state = G2ModeScmd()
    state.begin(**how)  # type: ignore[arg-type]
    try:
        yield state
    finally:
        state.teardown()


def test_every_row_is_visited(monkeypatch: pytest.MonkeyPatch) -> None:
    visited = Visited(TRANSITIONS)
    monkeypatch.setattr(control_state, 'TRANSITIONS', visited)
    with history() as state:
        # a whole day's work, and its end with the motor running
        state.run_motor(wait=1.0)
        state.stop(wait=2.5)
        state.fault(5, standing=False, wait=1.0)
        state.enable(wait=1.0)
        state.acknowledge(wait=1.0)
        state.enable_without_run_input(wait=2.5)
        state.run_input_on(wait=1.0)
        state.run_motor(wait=1.0)
        state.shut_down(wait=1.0)
        # the line lost: standing, running, and while the driver ends
        state.lose_line('silent', '', 9.0, wait=2.5)
        state.break_line('silent', wait=9.0)
        state.stop(wait=0.4)
        state.mend_line(wait=2.5)
        state.break_line('silent', wait=9.0)
        state.shut_down(wait=1.0)
        state.mend_line(wait=5.0)
        # the end while it is lost, standing, being enabled, and stopping
        state.shut_down(wait=1.0)
        state.shut_down(wait=1.0)
        state.enable(wait=0.004)
        state.shut_down(wait=1.0)
        state.run_motor(wait=1.0)
        state.stop(wait=0.0)
        state.shut_down(wait=1.0)
    with history(delay=1) as state:
        # the port gone at each moment of an enable that waits for the delayed start: once it is the
        # poll that finds out
        for step in range(50):
            if (ControlState.ENABLING, ControlEvent.LOST) in visited.rows:
                break
            state.enable(wait=0.4 + 0.005 * step)
            state.break_line('gone', wait=1.0)
            state.mend_line(wait=2.5)
    with history() as state:
        # a fault that keeps the drive from taking the stop: over, lost, and the end, long after the
        # stop was tried or right behind
        soon = [('shut down', 0.05 * number) for number in range(1, 8)]
        for end, wait in (('', 1.0), ('lost', 1.0), *soon):
            state.run_motor(wait=1.0)
            state.fault(5, standing=True, wait=wait)
            if end == 'lost':
                state.break_line('silent', wait=9.0)
                state.mend_line(wait=5.0)
            elif end:
                state.shut_down(wait=1.0)
            state.end_cause(wait=0.1)
            state.acknowledge(wait=1.0)
    with history() as state:
        # a tuning: to its end, stopped, lost, and the end
        state.tune(Procedure.CALCULATE, give='', wait=5.0)
        state.let(5.0)
        for end in ('stop', 'lost', 'shut down', 'stop and shut down'):
            state.tune(Procedure.STATOR_RESISTANCE, after=1.0, give='')
            if 'stop' in end:
                state.stop(wait=0.0)
            if end == 'lost':
                state.break_line('silent', wait=9.0)
                state.mend_line(wait=5.0)
            if 'shut' in end:
                state.shut_down(wait=1.0)
            state.let(6.0)
    with history() as state:
        # a tuning that is refused before it has written anything, and the port gone in one: once
        # it is the poll that finds out
        state.fault(5, standing=False, wait=1.0)
        state.tune(Procedure.STATOR_RESISTANCE, give='')
        state.acknowledge(wait=1.0)
        for step in range(50):
            if (ControlState.PROCEDURE, ControlEvent.LOST) in visited.rows:
                break
            state.tune(Procedure.STATOR_RESISTANCE, after=0.4 + 0.005 * step, give='')
            state.break_line('gone', wait=1.0)
            state.mend_line(wait=2.5)
            state.let(6.0)
    with Rig('classic v5.0') as rig:
        # firmware that has to be under control to take a setting, before it is connected to again
        rig.connect()
        rig.line.state = 'silent'
        rig.wait_until(lambda: not rig.drive.snapshot.connected)
        rig.line.mend()
        rig.result(rig.drive.parameters.change({'control.accel': 2.0}))
    table = set(visited)
    unvisited = sorted(f'{event.name} in {state.name}' for state, event in table - visited.rows)
    assert unvisited == []
