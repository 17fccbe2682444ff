# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What processes take of the machine: its processor and its memory."""

from __future__ import annotations

from collections.abc import Iterable
import ctypes
import os
from pathlib import Path
import sys
import time

_TICK = 1 / os.sysconf('SC_CLK_TCK')
#: user, nice, system, irq, softirq and steal in the first line of /proc/stat.
_BUSY = (1, 2, 3, 6, 7, 8)
#: Names in /proc/PID/smaps_rollup; those that together are not shared with anybody come last.
_RSS, _PSS, *_OWN = ('Rss', 'Pss', 'Private_Clean', 'Private_Dirty')

_libc = ctypes.CDLL(None, use_errno=True)


def of_process(pid: int) -> float:
    """
    Return the time that all threads of a process have taken, s.

    The sum of utime and stime in ``/proc/PID/stat``, but to the nanosecond: there it is cut to
    hundredths of a second, which is too coarse for short windows.
    """
    clock = ctypes.c_int()
    error = _libc.clock_getcpuclockid(pid, ctypes.byref(clock))
    if error:
        raise OSError(error, f'process {pid} has no clock: {os.strerror(error)}')
    return time.clock_gettime(clock.value)


def of_all_but(pids: Iterable[int]) -> float:
    """Return the time that everybody else on this machine has taken, s."""
    fields = Path('/proc/stat').read_text().split()
    return sum(int(fields[index]) for index in _BUSY) * _TICK - sum(map(of_process, pids))


def memory(pid: int) -> dict[str, float]:
    """
    Return the memory of a process, MB.

    :returns: ``rss``: all that it has in memory; ``pss``: the same with what it shares divided
        among all who share it; ``uss``: what it shares with nobody.
    """
    lines = Path(f'/proc/{pid}/smaps_rollup').read_text().splitlines()[1:]
    found = {name: int(rest.split()[0]) for name, _, rest in (x.partition(':') for x in lines)}
    return {
        'rss': found[_RSS] / 1024,
        'pss': found[_PSS] / 1024,
        'uss': sum(found[name] for name in _OWN) / 1024,
    }


def await_calm(most: float, patience: float) -> None:
    """Wait until others take less than so many cores, but no longer than patience (s)."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        before, since = of_all_but((os.getpid(),)), time.monotonic()
        time.sleep(1.0)
        if (of_all_but((os.getpid(),)) - before) / (time.monotonic() - since) < most:
            return
    print('the machine does not become calm', file=sys.stderr, flush=True)
