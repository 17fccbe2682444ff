# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A lock for coroutines on the bus."""

from __future__ import annotations

from collections import deque

from nfo_sinus_driver.bus.tasks import Task
from nfo_sinus_driver.bus.worker import Bus

#: No polling is needed: the one that leaves wakes the next one, s.
_LONG = 60.0


class Lock:
    """A lock for coroutines on the bus, in the order in which they came."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        #: The holder, and behind it those that wait.
        self._tasks: deque[Task | None] = deque()

    async def __aenter__(self) -> None:
        task = self._bus.current
        self._tasks.append(task)
        try:
            while self._tasks[0] is not task:
                await self._bus.sleep(_LONG)
        except BaseException:
            self._tasks.remove(task)
            raise

    async def __aexit__(self, *_: object) -> None:
        self._tasks.popleft()
        if self._tasks:
            self._bus.wake(self._tasks[0])
