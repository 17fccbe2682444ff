# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of states and events, written so that they are read as they are drawn."""

from __future__ import annotations

from collections.abc import Mapping
import enum
from typing import TypeVar

_State = TypeVar('_State', bound=enum.Enum)
_Event = TypeVar('_Event', bound=enum.Enum)


def read_table(
    table: str, states: type[_State], events: type[_Event]
) -> Mapping[tuple[_State, _Event], _State]:
    """
    Return where each event leads from each state.

    :param table: one row an event, one column a state; a dot where nothing changes, or the event is
        refused: that is missing in what is returned.
    """
    head, *rows = (line.split() for line in table.strip().splitlines())
    return {
        (states[before], events[event]): states[after]
        for event, *cells in rows
        for before, after in zip(head, cells, strict=True)
        if after != '.'
    }
