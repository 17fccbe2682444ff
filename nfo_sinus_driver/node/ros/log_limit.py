# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What would be logged with every message is logged once in ten seconds.

Set-points come 200 times a second, and so does an error with each of them: without a limit it
fills the disk.
"""

from __future__ import annotations

from collections.abc import Hashable
import logging
import math
import threading
import time
import traceback

_log = logging.getLogger(__name__)

#: How often the same is logged, s.
PERIOD = 10.0


class LogLimit:
    """Which lines are logged: each kind once in a period, however frequent; for any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        #: When each kind was logged last, s, and how many were left out since.
        self._kinds: dict[Hashable, tuple[float, int]] = {}

    def left_out(self, kind: Hashable, now: float) -> int | None:
        """Return how many of a kind were left out before this one; ``None``: so is this one."""
        with self._lock:
            logged_at, count = self._kinds.get(kind, (-math.inf, 0))
            if now - logged_at < PERIOD:
                self._kinds[kind] = logged_at, count + 1
                return None
            self._kinds[kind] = now, 0
            return count


class ErrorLimit(logging.Filter):
    """
    Limits the errors of the driver itself, which have a traceback.

    Of one kind are those of one type, from one place, that are logged at one place.
    """

    def __init__(self) -> None:
        super().__init__()
        self._limit = LogLimit()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a line is logged; one that is says how many were not."""
        if not record.exc_info:
            return True
        type_, _, trace = record.exc_info
        place = [(frame.filename, frame.lineno) for frame in traceback.extract_tb(trace)[-1:]]
        kind = record.pathname, record.lineno, type_, *place
        left_out = self._limit.left_out(kind, time.monotonic())
        if left_out:
            record.msg = f'{record.getMessage()} ({left_out} of the same were not logged)'
            record.args = ()
        return left_out is not None


def limit_errors() -> logging.Handler:
    """Log all errors of this process on standard error, within limits; return what does it."""
    handler = logging.StreamHandler()
    handler.addFilter(ErrorLimit())
    logging.getLogger().addHandler(handler)
    threading.excepthook = lambda end: _log.error('error in a thread', exc_info=end.exc_value)
    return handler
