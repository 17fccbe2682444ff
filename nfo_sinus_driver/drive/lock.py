# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What coroutines on the bus do one after the other."""

from __future__ import annotations

from collections import deque

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Task

#: Nobody has to look: who leaves wakes the next one, s.
_LONG = 60.0


class Lock:
    """Lets one coroutine on the bus at a time in, in the order in which they came."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        #: Who is in, and behind it who waits.
        self._tasks: deque[Task] = deque()

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
