# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One row of a table: what was measured, where, and what was aimed at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
import statistics

Figures = dict[str, float]

#: What counts in every run, so that a median would hide it.
_NEVER = ('short_gaps', 'lost')
_SUMMED = (*_NEVER, 'events')
#: The longest that any event of any run took.
_WORST = ('longest', 'longest_ratio', 'beyond', 'in_sender', 'stood_still', 'polls')


@dataclass(frozen=True)
class Effort:
    """
    How much is measured in one run.

    :ivar window: how long cycles are watched at least, s.
    :ivar rounds: how many cycles a window has at least.
    :ivar setpoints: how many set-points are published.
    :ivar stops: how many drives are stopped by their service on a line of many.
    :ivar events: how many of each kind have to stop a motor.
    """

    window: float
    rounds: int
    setpoints: int
    stops: int
    events: int


@dataclass(frozen=True)
class Row:
    """
    One row.

    :ivar table: which tables it stands in; :mod:`page` knows them.
    :ivar aims: the most that is aimed at, by the name of the figure.
    """

    table: str
    what: str
    baud_rate: int
    drives: int
    figures: Figures
    aims: Figures = field(default_factory=dict)


def merged(rows: Sequence[Row]) -> Row:
    """Return one row for the same row of several runs."""
    names = dict.fromkeys(name for row in rows for name in row.figures)
    figures = {
        name: _merging(name)([row.figures[name] for row in rows if name in row.figures])
        for name in names
    }
    return replace(rows[0], figures=figures)


def blamed(rows: Sequence[Row]) -> Row:
    """Return the last of some rows, with what should never happen and did in the others."""
    figures = dict(rows[-1].figures)
    for name in figures.keys() & set(_NEVER):
        figures[name] = sum(row.figures[name] for row in rows)
    return replace(rows[-1], figures=figures)


def _merging(name: str) -> Callable[[list[float]], float]:
    if name in _SUMMED:
        return sum
    return max if name in _WORST else statistics.median
