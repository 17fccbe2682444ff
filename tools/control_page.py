# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of docs/control.md, made from the states of control; ``make pages``."""

from __future__ import annotations

from pathlib import Path
import re

from nfo_sinus_driver.drive.known.control_state import TRANSITIONS, ControlEvent, ControlState

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'control.md'


def page() -> str:
    """Return the page with these tables made again."""
    text = PAGE.read_text(encoding='utf-8')
    made, found = re.subn(
        r'^\| state \| what it is \|\n(?:\|.*\n)+\n\| event \|.*\n(?:\|.*\n)+',
        lambda _: _tables(), text, flags=re.MULTILINE,
    )
    assert found == 1, f'{PAGE} has no place for the tables of states and events'
    return made


def _tables() -> str:
    names = [state.name for state in ControlState]
    states = [f'| {state.name} | {state.value} |\n' for state in ControlState]
    events = []
    for event in ControlEvent:
        after = [TRANSITIONS.get((state, event)) for state in ControlState]
        cells = [event.name, event.value, *(one.name if one else '' for one in after)]
        events.append(f'| {" | ".join(cells)} |\n')
    return ''.join((
        '| state | what it is |\n|---|---|\n', *states,
        f'\n| event | what it is | {" | ".join(names)} |\n|{"---|" * (2 + len(names))}\n', *events,
    ))
