# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The clock of the thread that has the line; it notices when that thread did not run."""

from __future__ import annotations

from collections.abc import Callable
import math

#: What is shorter is no pause, s: a busy computer delays a thread for a moment now and then.
SHORTEST_PAUSE = 0.5


class ThreadClock:
    """
    A steady clock that one thread reads, before and after whatever it waits for.

    A process may be stopped by a signal, swapped out or suspended with its computer. All that it
    sees of that is a wait that ends late. What it measures meanwhile says nothing of the line, and
    what has come may be old.

    :ivar paused: for how long the thread has not run so far, s.
    :ivar resumed_at: when it last went on after that, s.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        #: When the next reading is due at the latest.
        self._due = math.inf
        self.paused = 0.0
        self.resumed_at = -math.inf

    def __call__(self) -> float:
        """Return the time, s."""
        now = self._now()
        late = now - self._due
        if late >= SHORTEST_PAUSE:
            self.paused += late
            self.resumed_at = now
        self._due = now
        return now

    def until(self, moment: float) -> float:
        """Expect the thread to wait until a moment, which is returned."""
        self._due = max(self._due, moment)
        return moment
