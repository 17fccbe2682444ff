# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How the steps of a profile come to the bus: in order, with a priority, and what they end by."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
import math
from types import SimpleNamespace
from typing import Any, cast

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog.profile import (
    Acknowledge,
    AcknowledgeThenWrite,
    Read,
    Steps,
    Until,
    Write,
)
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.steps import run_steps


class Noted:
    """ParameterAccess that note what is asked of them, and answer as the test says."""

    def __init__(self, *answers: Any) -> None:
        self.asked: list[tuple[Any, ...]] = []
        self.now = lambda: 0.0
        self._answers = list(answers)

    def _next(self, *asked: Any) -> Any:
        self.asked.append(asked)
        return self._answers.pop(0)

    def require_fitted(self, key: str) -> None:
        pass

    async def read(self, key: str, priority: Priority, *, retry: bool) -> Any:
        return self._next('read', key, priority, retry)

    async def write(self, step: Write, priority: Priority, *, permit: None) -> None:
        self._next('write', step, priority)

    async def acknowledge(self, key: str, priority: Priority) -> Any:
        return self._next('acknowledge', key, priority)

    async def acknowledge_and_write(self, key: str, step: Write) -> None:
        self._next('acknowledge and write', key, step)

    async def reached(self, condition: Callable[[Any], bool]) -> None:
        # a status from before the last write fulfils nothing
        assert not condition(SimpleNamespace(at=-1.0, word=1))
        self._next('until', condition(SimpleNamespace(at=math.inf, word=1)))


def test_each_step_brings_what_the_next_one_is_given() -> None:
    def steps() -> Steps[int]:
        first = yield Read('a', retry=False)
        yield Write('b', first)
        flags = yield Acknowledge('c')
        yield AcknowledgeThenWrite('c', Write('b', 0))
        yield Until(lambda status: status.word == 1)
        return int(first + flags)

    noted = Noted(3, None, 4, None, None)
    state = cast(DriveState, SimpleNamespace(params=noted, wait_until=noted.reached))
    done = run_steps(state, steps(), Priority.STOP)
    assert asyncio.run(done) == 7
    assert noted.asked == [
        ('read', 'a', Priority.STOP, False),
        ('write', Write('b', 3), Priority.STOP),
        ('acknowledge', 'c', Priority.STOP),
        ('acknowledge and write', 'c', Write('b', 0)),
        ('until', True),
    ]
