# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The rules by which Hypothesis makes up histories of a line of several drives."""

from __future__ import annotations

from typing import ClassVar

from any_order_machine import WAITS
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule
from support.line_runs import CALLS, HAPPENS, KINDS, LineRun

#: What ends the driver is a rule of its own.
_CALLS = [name for name in CALLS if not name.startswith('end')]
_RUNS = precondition(lambda self: self.run is not None)


class LineOrder(RuleBasedStateMachine):
    """
    All motors turn, something happens to the line, and things are called for, again and again.

    :cvar kind: one of :data:`~support.line_runs.KINDS`.
    """

    kind: ClassVar[str]

    def __init__(self) -> None:
        super().__init__()
        self.run: LineRun | None = None
        self._is_whole = True

    @initialize()
    def begin(self) -> None:
        self.run = LineRun(KINDS[self.kind], lambda key, writes: None)
        self.run.rig.connect()
        self.run.begin_again()

    def teardown(self) -> None:
        if self.run is not None:
            self.run.rig.close()

    def let(self, seconds: float) -> None:
        """Let time pass, and judge."""
        assert self.run is not None
        self.run.rig.pass_time(seconds)
        broken = self.run.laws.broken
        assert not broken, '; '.join(broken)

    @_RUNS
    @rule(
        what=st.sampled_from(list(HAPPENS)),
        call=st.sampled_from(_CALLS),
        after=st.sampled_from((0.0, 0.3, 2.0)),
        wait=st.sampled_from((1.0, 2.5, 4.5)),
    )
    def happen(
        self, what: str, call: str = 'no stop', after: float = 0.3, wait: float = 4.5
    ) -> None:
        """Let something happen to a whole line, and call for something then."""
        assert self.run is not None
        # what happens twice has no law of its own
        if not self._is_whole:
            self.put_right()
        self._is_whole = what == 'nothing'
        HAPPENS[what](self.run)
        self.let(after)
        self.call(call, wait)

    @_RUNS
    @rule(call=st.sampled_from(_CALLS), wait=WAITS)
    def call(self, call: str, wait: float = 0.4) -> None:
        assert self.run is not None
        CALLS[call][1](self.run)
        self.let(wait)

    @_RUNS
    @rule(hertz=st.sampled_from((20.0, 5.0, 50.0, None)), wait=WAITS)
    def give(self, hertz: float | None, wait: float = 1.0) -> None:
        assert self.run is not None
        self.run.give(hertz)
        self.let(wait)

    @_RUNS
    @rule(wait=st.sampled_from((4.5, 9.0)))
    def wait(self, wait: float) -> None:
        self.let(wait)

    @_RUNS
    @rule()
    def put_right(self) -> None:
        """Let the motors run again."""
        assert self.run is not None
        self.run.begin_again()
        self._is_whole = True

    @_RUNS
    @rule()
    def end(self) -> None:
        """End the driver, and begin with another one."""
        assert self.run is not None
        self.run.end()
        self.run.outlast_driver()
        self.let(0.0)
        self.run.begin_with_another_driver()
        self._is_whole = True


def _of(kind: str) -> type[LineOrder]:
    name = f'Line_{kind.replace(",", "").replace(" ", "_")}'
    return type(name, (LineOrder,), {'kind': kind})


LINES = [_of(kind) for kind in KINDS]
