# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The table of control states, explored whole with a model of drive and line, in every run.

The table is the one of the driver. Drive, line, and what the driver writes in each state are a
model of docs/control.md: a drive keeps its run command through a fault, a gateway may hold up to
three frames and pass them on in any order, the line goes and comes back, the power too. Every state
that can be reached is visited, every step from it is judged by every law, and every single change
of the table breaks one of them.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

import pytest

from nfo_sinus_driver.drive.known.control_state import (
    COMMANDED,
    TRANSITIONS,
    ControlEvent as Event,
    ControlState as State,
    ControlTable,
)
from nfo_sinus_driver.drive.known.exclusive_access import ExclusiveAccess

_Table = Mapping[tuple[State, Event], State]

#: How many frames a gateway holds at most.
_MOST_HELD = 3
_STOPPING = frozenset((State.STOPPING, State.BLOCKED))


class World(NamedTuple):
    """
    What the driver believes, and what is so.

    :ivar run: the drive has a run command. :ivar held: frames in a gateway, ``run`` or ``stop``.
    :ivar answered: the drive has answered the stop in progress, and no status has come since.
    """

    control: State = State.OFFLINE
    run: bool = False
    fault: bool = False
    up: bool = True
    held: tuple[str, ...] = ()
    answered: bool = False

    @property
    def turns(self) -> bool:
        return self.run and not self.fault


class Step(NamedTuple):
    before: World
    name: str
    after: World

    def __str__(self) -> str:
        return f'{self.before.control.name} -> {self.name} -> {self.after.control.name}'

    def leaves(self, states: Iterable[State]) -> bool:
        return self.before.control in states and self.after.control not in states

    def enters(self, states: Iterable[State]) -> bool:
        return self.before.control not in states and self.after.control in states


def steps(table: _Table, world: World, most_held: int = _MOST_HELD) -> Iterator[Step]:
    """All that can happen next: by a client, in the world, or by the driver itself."""
    control, _, fault, up, held, answered = world
    room = len(held) < most_held

    def step(name: str, *events: Event, **changed: object) -> Step:
        now = control
        for event in events:
            now = table.get((now, event), now)
        if now is State.STOPPING and control is not State.STOPPING:
            changed['answered'] = False
        return Step(world, name, world._replace(control=now, **changed))  # type: ignore[arg-type]

    def hold(frame: str) -> tuple[str, ...]:
        return tuple(sorted((*held, frame)))

    yield step('client enables', Event.ENABLE)
    yield step('client stops', Event.STOP)
    if control in (State.IDLE, State.OFFLINE):
        yield step('procedure begins', Event.BEGIN)
    yield step('fault', fault=True)
    yield step('fault ends', fault=False)
    yield step('line breaks', up=False)
    yield step('line is back', up=True)
    yield step('power cycle', run=False, fault=False)
    for number, frame in enumerate(held):
        run = world.run if fault and frame == 'run' else frame == 'run'
        yield step(f'late {frame}', held=held[:number] + held[number + 1 :], run=run)
    if not up:
        yield step('loss', Event.LOST)
        return
    shown = (Event.STOP,) if world.turns else ()
    if control is State.OFFLINE:
        yield step('connect', Event.CONNECTED, *shown)
    elif control is State.IDLE:
        yield step('poll', *shown)
    elif control is State.ENABLING:
        yield step('refused before', Event.REFUSED)
        yield step('run refused', Event.STOP)
        yield step('run not heard', Event.STOP)
        if not fault:
            yield step('run', Event.RUNNING, run=True)
            yield step('run without an answer', Event.STOP, run=True)
        if room:
            yield step('run held', Event.STOP, held=hold('run'))
    elif control is State.ENABLED:
        yield step('poll', *(() if world.turns else (Event.STOP,)))
    elif control is State.PROCEDURE:
        yield step('procedure energises', run=not fault)
        yield step('procedure ends', Event.END, run=False)
        yield step('procedure fails', Event.STOP)
    elif control is State.STOPPING:
        yield step('stop', run=False, answered=True)
        if fault:
            yield step('stop refused in a fault', Event.FAULT_BLOCKS)
        else:
            yield step('stop without an answer', run=False)
        if room:
            yield step('stop held', held=hold('stop'))
        if answered:
            yield step('poll', *(() if world.turns else (Event.STOPPED,)), answered=False)
    elif control is State.BLOCKED:
        yield step('poll', *(() if fault else (Event.FAULT_OVER,)))


class Explored(NamedTuple):
    """Every state that can be reached, with the step that has reached it first, and every step."""

    came_by: Mapping[World, Step | None]
    steps: tuple[Step, ...]

    def way_to(self, world: World) -> list[str]:
        way = []
        while (step := self.came_by[world]) is not None:
            way.append(step.name)
            world = step.before
        return way[::-1]

    def after(self, begin: Iterable[World], *, backwards: bool = False) -> set[World]:
        """All that the driver, or the world that gets well, leads to from there, or from where."""
        nexts = defaultdict(list)
        for before, name, after in self.steps:
            if name not in _ILL:
                here, other = (after, before) if backwards else (before, after)
                nexts[here].append(other)
        reached, queue = set(begin), deque(begin)
        while queue:
            for world in nexts[queue.popleft()]:
                if world not in reached:
                    reached.add(world)
                    queue.append(world)
        return reached


#: What does not help: a stop has to end without it.
_ILL = frozenset(
    ('client enables', 'client stops', 'procedure begins', 'fault', 'line breaks', 'power cycle')
)


def explore(table: _Table, most_held: int = _MOST_HELD) -> Explored:
    """Visit every state, breadth first."""
    came_by: dict[World, Step | None] = {World(): None}
    queue, taken = deque(came_by), []
    while queue:
        for step in steps(table, queue.popleft(), most_held):
            taken.append(step)
            if step.after not in came_by:
                came_by[step.after] = step
                queue.append(step.after)
    return Explored(came_by, tuple(taken))


# --- the laws of single steps: each says what a step may not be -----------------------------------


def motion_begins_by_a_client_alone(step: Step) -> bool:
    by = {'client enables': State.ENABLING, 'procedure begins': State.PROCEDURE}
    return not step.enters(COMMANDED) or by.get(step.name) is step.after.control


def it_begins_when_a_client_asks(step: Step) -> bool:
    if step.name == 'client enables' and step.before.control is State.IDLE:
        return step.after.control is State.ENABLING
    return step.name != 'procedure begins' or step.after.control is State.PROCEDURE


def a_status_alone_makes_it_enabled(step: Step) -> bool:
    entered = step.enters((State.ENABLED,))
    return entered == (step.name == 'run' and step.before.control is State.ENABLING)


def motion_ends_by_a_stop(step: Step) -> bool:
    without = {
        'refused before': (State.ENABLING, State.IDLE),
        'procedure ends': (State.PROCEDURE, State.IDLE),
    }
    if step.name in without:
        return (step.before.control, step.after.control) == without[step.name]
    return not step.leaves(COMMANDED) or step.after.control is State.STOPPING


def a_client_stops_from_everywhere(step: Step) -> bool:
    return step.name != 'client stops' or step.after.control in _STOPPING


def a_loss_is_a_stop_where_it_was_commanded(step: Step) -> bool:
    if step.name != 'loss':
        return True
    if step.before.control in COMMANDED | _STOPPING:
        return step.after.control is State.STOPPING
    return step.after.control is State.OFFLINE


def a_stop_ends_by_a_status_alone(step: Step) -> bool:
    confirmed = step.name == 'poll' and step.before.control is State.STOPPING
    return not step.leaves(_STOPPING) or (confirmed and step.after.control is State.IDLE)


def no_stop_is_confirmed_while_it_turns(step: Step) -> bool:
    return not (step.leaves(_STOPPING) and step.after.turns)


def a_confirmed_stop_ends(step: Step) -> bool:
    confirmed = step.before.control is State.STOPPING and step.name == 'poll'
    return not confirmed or step.before.turns or step.after.control is State.IDLE


def a_fault_blocks_by_its_refusal_alone(step: Step) -> bool:
    refused = step.name == 'stop refused in a fault'
    return step.enters((State.BLOCKED,)) == refused


def the_end_of_the_fault_is_the_next_stop(step: Step) -> bool:
    over = step.before.control is State.BLOCKED and step.name == 'poll' and not step.before.fault
    return not over or step.after.control is State.STOPPING


def what_turns_unasked_is_stopped_by_the_next_status(step: Step) -> bool:
    looked = step.name in ('poll', 'connect') and step.before.turns
    unasked = step.before.control in (State.IDLE, State.OFFLINE)
    return not (looked and unasked) or step.after.control is State.STOPPING


def a_drive_at_standstill_connects_to_idle(step: Step) -> bool:
    return step.name != 'connect' or step.before.turns or step.after.control is State.IDLE


# --- the laws of the whole ------------------------------------------------------------------------


def every_stop_can_end(explored: Explored) -> str:
    stands = [
        world
        for world in explored.came_by
        if world.control is State.IDLE and not (world.run or world.held)
    ]
    ends = explored.after(stands, backwards=True)
    for world in explored.came_by:
        if world.control in _STOPPING and world not in ends:
            return ', '.join(explored.way_to(world))
    return ''


def it_runs_again_after_a_stop(explored: Explored) -> str:
    runs = [step.after for step in explored.steps if step.enters((State.ENABLED,))]
    stopped = {step.after for step in explored.steps if step.leaves(_STOPPING)}
    again = any(set(explored.way_to(world)) & {'client stops'} for world in runs if world.turns)
    asked = any(step.before in stopped and step.enters(COMMANDED) for step in explored.steps)
    return '' if runs and (again or asked) else 'it never runs, or never again'


_OF_STEPS: tuple[Callable[[Step], bool], ...] = (
    motion_begins_by_a_client_alone,
    it_begins_when_a_client_asks,
    a_status_alone_makes_it_enabled,
    motion_ends_by_a_stop,
    a_client_stops_from_everywhere,
    a_loss_is_a_stop_where_it_was_commanded,
    a_stop_ends_by_a_status_alone,
    no_stop_is_confirmed_while_it_turns,
    a_confirmed_stop_ends,
    a_fault_blocks_by_its_refusal_alone,
    the_end_of_the_fault_is_the_next_stop,
    what_turns_unasked_is_stopped_by_the_next_status,
    a_drive_at_standstill_connects_to_idle,
)
_OF_THE_WHOLE: tuple[Callable[[Explored], str], ...] = (
    every_stop_can_end,
    it_runs_again_after_a_stop,
)


def broken(explored: Explored) -> Iterator[str]:
    """Each law that is broken, with its number and the shortest way to where it is."""
    for number, holds in enumerate(_OF_STEPS, 1):
        step = next((step for step in explored.steps if not holds(step)), None)
        if step is not None:
            way = ', '.join([*explored.way_to(step.before), step.name])
            yield f'C{number} {holds.__name__}: {step}, after {way}'
    for number, check in enumerate(_OF_THE_WHOLE, len(_OF_STEPS) + 1):
        if what := check(explored):
            yield f'C{number} {check.__name__}: {what}'


def changes() -> Iterator[tuple[str, _Table]]:
    """Every single change of the table: a transition leads elsewhere, or nowhere."""
    for (state, event), to in TRANSITIONS.items():
        for other in State:
            if other is not to:
                changed = {**TRANSITIONS, (state, event): other}
                yield f'{state.name} {event.name} -> {other.name}, not {to.name}', changed


@pytest.mark.parametrize('guard', ['the driver ends', 'a procedure goes on'])
def test_nothing_begins_while_that_is_so(guard: str) -> None:
    for state in State:
        for event in (Event.ENABLE, Event.BEGIN):
            table = ControlTable(lambda: 1.0)
            table.state = state
            if guard == 'the driver ends':
                table.close()
            else:
                table.access = ExclusiveAccess('tuning')
            assert not table.accepts(event)
            table.dispatch(event)
            assert table.state is state
            # and it is stopped as ever
            table.dispatch(Event.STOP)
            assert table.stopping


def test_no_law_is_broken_in_any_state() -> None:
    explored = explore(TRANSITIONS)
    assert {world.control for world in explored.came_by} == set(State)
    assert not list(broken(explored))


def test_every_single_change_of_the_table_breaks_a_law() -> None:
    kept = [what for what, table in changes() if not any(broken(explore(table, most_held=1)))]
    assert not kept


@pytest.mark.parametrize('most_held', [0, 1])
def test_only_a_run_command_that_a_gateway_held_turns_a_motor_after_a_confirmed_stop(
    most_held: int,
) -> None:
    explored = explore(TRANSITIONS, most_held)
    unasked = [
        step
        for step in explored.steps
        if step.after.turns
        and not step.before.turns
        and step.after.control in (State.IDLE, State.OFFLINE)
    ]
    # a fault may be between: a run command that came during it turns the motor when it is over
    assert bool(unasked) is bool(most_held)
    for step in unasked:
        assert 'late run' in (*explored.way_to(step.before), step.name)
