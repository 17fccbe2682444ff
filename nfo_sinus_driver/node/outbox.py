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

"""What is waiting to be published: one thread sends it, so that the bus never waits for ROS."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import logging
import threading

_log = logging.getLogger(__name__)

#: More than this many waiting messages are too old to be of use; the oldest are dropped.
_MOST_WAITING = 1000


class Outbox:
    """Runs functions in the order in which they were put in, on a thread of its own."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque(maxlen=_MOST_WAITING)
        self._something = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name='outbox', daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def put(self, function: Callable[[], None]) -> None:
        """Have a function run soon, from any thread."""
        self._waiting.append(function)
        self._something.set()

    def close(self, timeout: float = 2.0) -> None:
        """Send what is waiting, then end."""
        self._closing = True
        self._something.set()
        if self._thread.is_alive():
            self._thread.join(timeout)

    def _work(self) -> None:
        while True:
            self._something.wait()
            self._something.clear()
            while self._waiting:
                function = self._waiting.popleft()
                try:
                    function()
                except Exception:
                    # one message that cannot be sent must not silence the others
                    _log.exception('a message could not be published')
            if self._closing:
                return
