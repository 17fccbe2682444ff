# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Notes when one core of this machine stood still; a process of its own, for each core.

It does nothing but sleep for a few milliseconds, again and again. When it wakes much later than it
asked to, something other than the driver kept the core: the machine below this virtual one, or the
kernel. Prints a line for each time: from when to when, s of the steady clock.
"""

from __future__ import annotations

import argparse
import os
import time

#: Between two looks, s.
_PERIOD = 0.004
#: Who wakes so much later than asked has stood still, s: no process keeps a core from one that
#: has slept for so long.
_STOOD_STILL = 0.02


def main() -> None:
    """Look until ended."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('core', type=int)
    os.sched_setaffinity(0, {parser.parse_args().core})
    before = time.monotonic()
    while True:
        time.sleep(_PERIOD)
        now = time.monotonic()
        if now - before > _PERIOD + _STOOD_STILL:
            print(before, now, flush=True)
        before = now


if __name__ == '__main__':
    main()
