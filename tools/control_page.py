# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of docs/control.md, made from the states of contact and control; ``make pages``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
import enum
from pathlib import Path
import re

from nfo_sinus_driver.drive.known import contact, control_state

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'control.md'


def page() -> str:
    """Return the page with these tables made again."""
    text = PAGE.read_text(encoding='utf-8')
    for head, table in (
        ('| contact | ', _list('contact', contact.ContactState)),
        ('| what happens | ', _ways(
            'what happens', contact.ContactState, contact.ContactEvent, contact.TRANSITIONS)),
        ('| recognition | ', _list('recognition', contact.Recognition, 'what is written')),
        ('| state | ', _list('state', control_state.ControlState)),
        ('| event | ', _ways(
            'event',
            control_state.ControlState,
            control_state.ControlEvent,
            control_state.TRANSITIONS)),
    ):
        rows = rf'^{re.escape(head)}.*\n(?:\|.*\n)+'
        text, found = re.subn(rows, lambda _, made=table: made, text, flags=re.MULTILINE)
        assert found == 1, f'{PAGE} has no place for the table that begins with {head}'
    return text


def _list(name: str, values: Iterable[enum.Enum], what: str = 'what it is') -> str:
    rows = [f'| {value.name} | {value.value} |\n' for value in values]
    return ''.join((f'| {name} | {what} |\n|---|---|\n', *rows))


def _ways(
    name: str,
    states: Iterable[enum.Enum],
    events: Iterable[enum.Enum],
    transitions: Mapping[tuple[enum.Enum, enum.Enum], enum.Enum],
) -> str:
    states = list(states)
    rows = []
    for event in events:
        after = [transitions.get((state, event)) for state in states]
        cells = [event.name, event.value, *(state.name if state else '' for state in after)]
        rows.append(f'| {" | ".join(cells)} |\n')
    names = ' | '.join(state.name for state in states)
    rule = '---|' * (2 + len(states))
    return ''.join((f'| {name} | what it is | {names} |\n|{rule}\n', *rows))
