# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Moments of the steady clock as stamps of a node's clock, in the order of publication.

The bus measures by the steady clock, messages have the node's time. A thread that is kept waiting
between reading the one and the other would make a stamp that is wrong by that wait.
"""

from __future__ import annotations

from collections.abc import Callable
import math
import time

#: Readings of the steady clock so close before and after one of the node's are good enough, ns.
_NEAR = 200_000
_READINGS = 5
#: The latest stamp that a message can have, in January 2038: its seconds have 31 bits, ns.
_LATEST = 2**31 * 10**9 - 1


class Stamps:
    """
    What the node's clock showed at a moment of ``time.monotonic``.

    :param now: the node's clock, in ns: the wall clock or simulated time.
    :param steady: ``time.monotonic_ns``, or a test's.
    """

    def __init__(
        self, now: Callable[[], int], steady: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._now = now
        self._steady = steady

    def of(self, moment: float) -> int:
        """Return the node's time of a moment (s), in ns, as far as a message has it; 0 for NaN."""
        if math.isnan(moment):
            return 0
        steady, now = self._together()
        # simulated time begins at zero, and times before it cannot be
        return min(max(0, now - (steady - round(moment * 1e9))), _LATEST)

    def now(self) -> int:
        """Return the node's time, in ns, as far as a message has it."""
        return min(self._now(), _LATEST)

    def _together(self) -> tuple[int, int]:
        """Return what both clocks show at once."""
        readings = []
        for _ in range(_READINGS):
            before, now, after = self._steady(), self._now(), self._steady()
            readings.append((after - before, (before + after) // 2, now))
            if after - before <= _NEAR:
                break
        _, steady, now = min(readings)
        return steady, now


class Sequence:
    """The stamps of one topic: none is before the last, unless the clock itself was set back."""

    def __init__(self, stamps: Stamps) -> None:
        self._stamps = stamps
        self._last = 0

    def next(self, moment: float) -> int:
        """Return the stamp of the next message, about a moment of ``time.monotonic``, in ns."""
        stamp = self._stamps.of(moment)
        if self._last <= self._stamps.now():
            stamp = max(stamp, self._last)
        self._last = stamp
        return stamp
