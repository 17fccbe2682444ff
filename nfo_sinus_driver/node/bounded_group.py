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


"""A callback group that takes some callbacks at once, but not any number."""

from __future__ import annotations

import threading

from rclpy.callback_groups import CallbackGroup


class BoundedCallbackGroup(CallbackGroup):
    """
    Lets a number of callbacks run at once; what comes then waits in the queue of its entity.

    :param most: how many.
    """

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most
        self._running = 0
        self._lock = threading.Lock()

    def can_execute(self, entity: object) -> bool:
        """Tell whether one more may run."""
        return self._running < self._most

    def beginning_execution(self, entity: object) -> bool:
        """Let one begin, if it may."""
        with self._lock:
            begins = self._running < self._most
            self._running += begins
            return begins

    def ending_execution(self, entity: object) -> None:
        """Take note that one has ended."""
        with self._lock:
            self._running -= 1
