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
"""Who takes how much of the processor."""

from __future__ import annotations

from collections.abc import Iterable
import os
from pathlib import Path
import sys
import time

_TICK = 1 / os.sysconf('SC_CLK_TCK')
#: user, nice, system, irq, softirq and steal in the first line of /proc/stat.
_BUSY = (1, 2, 3, 6, 7, 8)


def of_process(pid: int) -> float:
    """Return the time that all threads of a process have taken, s."""
    fields = Path(f'/proc/{pid}/stat').read_text().rsplit(') ', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) * _TICK


def of_all_but(pids: Iterable[int]) -> float:
    """Return the time that everybody else on this machine has taken, s."""
    fields = Path('/proc/stat').read_text().split()
    return sum(int(fields[index]) for index in _BUSY) * _TICK - sum(map(of_process, pids))


def await_calm(most: float, patience: float) -> None:
    """Wait until others take less than so many cores, but no longer than patience (s)."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        before, since = of_all_but((os.getpid(),)), time.monotonic()
        time.sleep(1.0)
        if (of_all_but((os.getpid(),)) - before) / (time.monotonic() - since) < most:
            return
    print('the machine does not become calm', file=sys.stderr, flush=True)
