# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Long life: the driver at full rate for an hour, its memory and descriptors counted.

Simulated drives that run, on a line that takes its time, the driver, a publisher of set-points and
a listener to everything. Says at the end how memory and descriptors grew after the first minutes,
and what the log said; ends with 1 if they grew or the log went on and on.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time

from driver_rig import DriverRig
import resources
from rig import use_domain

_BAUD_RATE = 57600
#: Caches and pools fill up in this time, s; of a short run, half of it.
_WARM_UP = 300.0
#: More than this is growth: MB, descriptors and lines.
_MOST_GROWTH = 1.0
_MOST_LINES = 20
_MOST_LINES_DRIVE = 5

#: Time (s), memory (MB), descriptors and processor time (s).
Sample = tuple[float, float, int, float]


def main() -> int:
    """Run, sample, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=60.0)
    parser.add_argument('--drives', type=int, default=1)
    parser.add_argument(
        '--domain', type=int, metavar='ID', help='ROS domain (default: one of its own)'
    )
    options = parser.parse_args()
    # end what was started, however this ends
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    use_domain(options.domain)
    # a set-point that is late on a busy machine is none of the driver's business
    with DriverRig(_BAUD_RATE, options.drives, setpoint_timeout=60.0) as rig:
        rig.listener.enable_all()
        publisher = rig.start_script('publisher.py', '0', *rig.names)
        samples = _sample(rig, 60.0 * options.minutes)
        if publisher.poll() is not None:
            raise SystemExit(f'the publisher has ended:\n{rig.log}')
        return _judge(samples, rig.log.splitlines(), options.drives)


def _sample(rig: DriverRig, seconds: float) -> list[Sample]:
    """Sample regularly."""
    samples: list[Sample] = []
    pid = rig.driver.pid
    started = time.monotonic()
    period = max(1.0, seconds / 60)
    while (now := time.monotonic() - started) < seconds:
        descriptors = len(os.listdir(f'/proc/{pid}/fd'))
        memory, core = resources.memory(pid)['rss'], resources.of_process(pid)
        samples.append((now, memory, descriptors, core))
        print(
            f'{now:7.0f} s {memory:8.2f} MB {descriptors:4} descriptors {core:8.1f} s of a core',
            flush=True,
        )
        time.sleep(period)
    return samples


def _judge(samples: list[Sample], lines: list[str], drives: int) -> int:
    warm = [sample for sample in samples if sample[0] >= min(_WARM_UP, samples[-1][0] / 2)]
    first, last = warm[0], warm[-1]
    memory, descriptors = last[1] - first[1], last[2] - first[2]
    core = 100 * (last[3] - first[3]) / max(1e-9, last[0] - first[0])
    print(
        f'after the warm-up: {memory:+.2f} MB, {descriptors:+} descriptors, {core:.1f} % of a core'
    )
    print(f'{len(lines)} lines in the log:')
    print('\n'.join(lines))
    most_lines = _MOST_LINES + _MOST_LINES_DRIVE * drives
    return int(memory > _MOST_GROWTH or descriptors > 0 or len(lines) > most_lines)


if __name__ == '__main__':
    sys.exit(main())
