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
#: How much memory may still grow from one quarter of the time to the next, MB: pages that are
#: touched for the first time are no leak, and a leak of this size shows after some hours.
MOST_GROWTH = 0.4


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
    second, third, last = samples[size : 2 * size], samples[-2 * size : -size], samples[-size:]
    found = []
    before, after = (statistics.median(one.memory for one in part) for part in (third, last))
    if after - before > MOST_GROWTH:
        found.append(
            f'memory has not settled: {before:.1f} MB in the third quarter of the time, '
            f'{after:.1f} MB in the last'
        )
    for what in ('threads', 'descriptors'):
        # one that is there for a moment is no leak
        most = max(getattr(one, what) for one in second)
        least = min(getattr(one, what) for one in last)
        if least > most:
            found.append(
                f'{what} do not stand: {most} at most in the second quarter of the time, {least} '
                'at least in the last'
            )
    return found
