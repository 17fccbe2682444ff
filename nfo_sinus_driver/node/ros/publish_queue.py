# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Publishes on a thread, soon or by the clock, so that no bus waits for ROS."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import heapq
import itertools
import logging
import math
import threading
import time
from typing import TypeVar

_log = logging.getLogger(__name__)

#: With more waiting messages than this the oldest are too old to be of use, and are dropped.
_MOST_WAITING = 1000
#: The same for the values of one stream; its topic keeps no more.
_MOST_OF_A_STREAM = 10
#: How long what may wait does so at most, s: to wake the thread costs more than what it then does.
_LONGEST_WAIT = 0.1

_T = TypeVar('_T')


class PublishQueue:
    """
    Runs functions on a thread of its own: in the order in which they were put in, or by the clock.

    The clock is the steady one of this machine, whatever clock the nodes use.
    """

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque(maxlen=_MOST_WAITING)
        #: What publishes the values of each stream that has some; it has every second turn.
        self._streams: deque[Callable[[], None]] = deque()
        self._stream_went = False
        #: These are never dropped, and go first.
        self._urgent: deque[Callable[[], None]] = deque()
        self._schedule = Schedule()
        self._something = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name='publish queue', daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    @property
    def alive(self) -> bool:
        """The thread works."""
        return self._thread.is_alive()

    def put(self, function: Callable[[], None]) -> None:
        """Run a function soon, from any thread."""
        self._waiting.append(function)
        self._something.set()

    def stream(
        self, publish: Callable[[_T], None], is_urgent: Callable[[_T], bool] = lambda value: True
    ) -> Callable[[_T], None]:
        """
        Return what has values published soon, from any thread, in the order in which they come.

        Where they come faster than they are published the oldest are dropped: what is published
        then is less, but never old.

        :param is_urgent: returns whether a value is published at once; else it may wait for 0.1 s.
        """
        waiting: deque[_T] = deque(maxlen=_MOST_OF_A_STREAM)
        queued = False

        def put(value: _T) -> None:
            nonlocal queued
            waiting.append(value)
            if not queued:
                queued = True
                self._streams.append(publish_waiting)
            # not only when it is full: this thread may come late
            if is_urgent(value) or 2 * len(waiting) >= _MOST_OF_A_STREAM:
                self._something.set()

        def publish_waiting() -> None:
            nonlocal queued
            queued = False
            # those that come meanwhile have their turn after what else waits
            for _ in range(len(waiting)):
                self._run(lambda: publish(waiting.popleft()))

        return put

    def put_first(self, function: Callable[[], None]) -> None:
        """Run a function before all that wait, however many; from any thread."""
        self._urgent.append(function)
        self._something.set()

    def put_every(self, period: float, function: Callable[[], None]) -> None:
        """Run a function once in every period, s; from any thread."""
        self.put_first(lambda: self._schedule.add(time.monotonic(), period, function))

    def close(self, timeout: float = 2.0) -> None:
        """Run what is waiting, then end."""
        self._closing = True
        self._something.set()
        if self._thread.is_alive():
            self._thread.join(timeout)

    def _work(self) -> None:
        while True:
            self._something.wait(self._time_to_spare())
            self._something.clear()
            while (function := self._next()) is not None:
                self._run(function)
            if self._closing:
                return

    def _next(self) -> Callable[[], None] | None:
        if self._urgent:
            return self._urgent.popleft()
        # what is due by the clock is little, and must not wait for the end of what is too much
        due = self._schedule.take_due(time.monotonic())
        if due is not None or not (self._waiting or self._streams):
            return due
        self._stream_went = bool(self._streams) and not (self._stream_went and self._waiting)
        return (self._streams if self._stream_went else self._waiting).popleft()

    def _run(self, function: Callable[[], None]) -> None:
        try:
            function()
        except Exception:
            # one message that cannot be sent must not silence the others
            _log.exception('a message could not be published')

    def _time_to_spare(self) -> float:
        """Return for how long nothing is due by the clock, nor may wait any longer, s."""
        return min(max(0.0, self._schedule.next_moment - time.monotonic()), _LONGEST_WAIT)


#: The golden ratio: starts that are this part of a period apart never crowd.
_SPREAD = (math.sqrt(5) - 1) / 2


class Schedule:
    """
    Functions, each with its period, the next one in front.

    No thread and no clock: the caller has both, and takes what is due. Functions with the same
    period start at different moments of it, so that those of many drives do not run all at once.
    """

    def __init__(self) -> None:
        self._count = itertools.count()
        self._entries: list[tuple[float, int, float, Callable[[], None]]] = []

    def add(self, now: float, period: float, function: Callable[[], None]) -> None:
        """Make a function due within a period (s) from now, and then once in each."""
        number = next(self._count)
        first = now + period * (1 - number * _SPREAD % 1)
        heapq.heappush(self._entries, (first, number, period, function))

    @property
    def next_moment(self) -> float:
        """When something becomes due, s on the clock of the caller; infinity if nothing will."""
        return self._entries[0][0] if self._entries else math.inf

    def take_due(self, now: float) -> Callable[[], None] | None:
        """Return a function that is due, once however late, or ``None``."""
        if self.next_moment > now:
            return None
        moment, number, period, function = self._entries[0]
        late = (now - moment) // period
        heapq.heapreplace(self._entries, (moment + (late + 1) * period, number, period, function))
        return function
