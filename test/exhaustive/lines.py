# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Lines of several drives for ``make exhaustive``: at each request all that can happen to them."""

from __future__ import annotations

from collections.abc import Callable

from support.line_runs import CALLS, HAPPENS, KINDS, LineRun

_CALLS = tuple(CALLS)
_NUMBERS = {happens: number for number, happens in enumerate(HAPPENS)}


class LineMachine:
    """
    One kind of line.

    With the nth request the nth call of :data:`~support.line_runs.CALLS` goes with what happens, in
    turn for each that can: so each meets each at some request.
    """

    def __init__(self, name: str) -> None:
        self._kind = KINDS[name]
        self.__name__ = f'Line_{name.replace(",", "").replace(" ", "_")}'

    def begin(self, wrong: Callable[[str, str, bool], str]) -> LineRun:
        """Return a run; ``wrong`` is that of a run of one drive."""
        asked = -1

        def happens(key: str, writes: bool) -> tuple[str, str] | None:
            nonlocal asked
            asked += 1
            what = wrong('', key, writes)
            call = _CALLS[(asked + _NUMBERS.get(what, 0)) % len(_CALLS)]
            return (what, call) if what else None

        return LineRun(self._kind, happens)


LINES = tuple(map(LineMachine, KINDS))
