# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The table of control: what may lead to a turning motor, and that the docs show it as it is."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import pytest

from nfo_sinus_driver.drive.control_state import COMMANDED, TRANSITIONS, ControlEvent, ControlState

PAGE = Path(__file__).parents[3] / 'docs' / 'control.md'


def reached(start: ControlState, without: frozenset[ControlEvent]) -> set[ControlState]:
    """Return where the table leads from a state while some events do not happen."""
    found, new = set[ControlState](), {start}
    while new:
        found |= new
        new = {
            state
            for (before, event), state in TRANSITIONS.items()
            if before in found and event not in without
        } - found
    return found


def diagram() -> str:
    """Return the table as a drawing, in the language of Mermaid."""
    ways: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for (before, event), after in TRANSITIONS.items():
        ways[before.name, after.name].append(event.name)
    lines = [f'    {one} --> {other}: {", ".join(events)}' for (one, other), events in ways.items()]
    return '\n'.join(('```mermaid', 'stateDiagram-v2', '    [*] --> OFFLINE', *lines, '```'))


def tables() -> str:
    """Return what the states and the events mean, and the table, in Markdown."""
    states = [f'| {state.name} | {state.value} |' for state in ControlState]
    events = [f'| {event.name} | {event.value} |' for event in ControlEvent]
    names = [state.name for state in ControlState]
    rows = []
    for event in ControlEvent:
        cells = [TRANSITIONS.get((state, event)) for state in ControlState]
        rows.append(f'| {event.name} | {" | ".join(cell.name if cell else "" for cell in cells)} |')
    return '\n'.join(
        (
            *('| state | what it is |', '|---|---|', *states, ''),
            *('| event | what it is |', '|---|---|', *events, ''),
            f'| event | {" | ".join(names)} |',
            f'|{"---|" * (len(names) + 1)}',
            *rows,
        )
    )


def test_nothing_but_enable_and_a_procedure_may_make_the_motor_turn() -> None:
    begins = frozenset((ControlEvent.ENABLE, ControlEvent.BEGIN))
    for state in set(ControlState) - COMMANDED:
        assert not reached(state, begins) & COMMANDED


def test_only_a_motor_that_nobody_stops_can_be_enabled() -> None:
    enabled = [before for before, event in TRANSITIONS if event is ControlEvent.ENABLE]
    assert enabled == [ControlState.IDLE]
    running = [before for before, event in TRANSITIONS if event is ControlEvent.RUNNING]
    assert running == [ControlState.ENABLING]


@pytest.mark.parametrize('event', [ControlEvent.STOP, ControlEvent.LOST, ControlEvent.CLOSE])
def test_what_ends_it_ends_it_from_everywhere(event: ControlEvent) -> None:
    for state in COMMANDED - {ControlState.ABORTING}:
        after = TRANSITIONS[state, event]
        assert after not in COMMANDED or after is ControlState.ABORTING


def test_nothing_leads_out_of_closed() -> None:
    assert reached(ControlState.CLOSED, frozenset()) == {ControlState.CLOSED}


def test_every_state_is_reached_and_left() -> None:
    assert reached(ControlState.OFFLINE, frozenset()) == set(ControlState)
    for state in set(ControlState) - {ControlState.CLOSED}:
        assert ControlState.IDLE in reached(state, frozenset((ControlEvent.CLOSE,)))


def test_the_page_shows_the_table_as_it_is() -> None:
    page = PAGE.read_text(encoding='utf-8')
    for part in (diagram(), tables()):
        assert part in page, f'docs/control.md has to show:\n\n{part}'
