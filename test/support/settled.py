# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Whether memory, threads and descriptors of a process that ran for long have settled."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import statistics
from typing import NamedTuple

#: How many samples are needed: a quarter of them is compared with the one before.
LEAST = 8
#: How much each may still grow from the third quarter of the time to the last; a leak of this size
#: shows after some hours. Memory, MB: pages that are touched for the first time are no leak.
#: Threads: a pool gets one more when as many callbacks of a node meet as never before. Descriptors:
#: how many are open just then.
MOST_GROWTH = {'memory': 0.4, 'threads': 1, 'descriptors': 1}


class Sample(NamedTuple):
    """
    What a process has at one moment.

    :ivar memory: its resident memory, MB.
    :ivar threads: how many.
    :ivar descriptors: of open files.
    """

    memory: float
    threads: int
    descriptors: int

    @classmethod
    def of(cls, pid: int) -> Sample:
        """Return what a process has now (OSError: it has ended)."""
        folder = Path(f'/proc/{pid}')
        lines = (line.split() for line in (folder / 'status').read_text().splitlines())
        status = {words[0]: words[1] for words in lines if len(words) > 1}
        descriptors = sum(1 for _ in (folder / 'fd').iterdir())
        return cls(int(status['VmRSS:']) / 1024, int(status['Threads:']), descriptors)


def unsettled(samples: Sequence[Sample]) -> list[str]:
    """Return what has not settled, for the reader; samples are as far apart as each other."""
    if len(samples) < LEAST:
        return [f'{len(samples)} samples are too few, {LEAST} are needed']
    size = len(samples) // 4
    parts = samples[-2 * size : -size], samples[-size:]
    found = []
    for what, most in MOST_GROWTH.items():
        # the median: one that is there for a moment is no leak
        before, after = (
            statistics.median(getattr(sample, what) for sample in part) for part in parts
        )
        if after - before > most:
            found.append(
                f'{what} does not settle: {before:g} in the third quarter of the time, '
                f'{after:g} in the last'
            )
    return found
