# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Compares the driver with its last release: fails where it has become slower.

Only ratios are compared, which another machine changes little: a cycle to the time of its bytes on
the wire; processor time and memory to those of the peer with as many drives, measured at the same
time; and processor time a transaction with many drives to that with one. The least of all runs
counts. The figures of the release are in release.json.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import json
import os
from pathlib import Path
import sys

from regressions import GROWTH, Figures, regressions
from rig import DRIVER
import speed

from nfo_sinus_driver.demo.bench import own_domain
from nfo_sinus_driver.version import VERSION

_RELEASE = Path(__file__).with_name('release.json')
_RATIOS = {
    'cycle / wire time': 'ratio',
    "processor time / peer's": 'cpu_to_peer',
    "processor time / peer's, subscribed to": 'heard_to_peer',
    "memory / peer's": 'memory_to_peer',
}
_CASES = (('modbus_rtu', 57600, 1), ('modbus_rtu', 57600, 8), ('modbus_rtu', 57600, 32))


def measured(runs: int) -> Figures:
    """Return the ratios, the least of so many runs."""
    found: dict[str, dict[str, list[float]]] = {}
    for _ in range(runs):
        for title, ratios in _ratios():
            print(title, {name: round(ratio, 3) for name, ratio in ratios.items()}, file=sys.stderr)
            for name, value in ratios.items():
                found.setdefault(title, {}).setdefault(name, []).append(value)
    return {
        title: {name: round(min(all_), 4) for name, all_ in ratios.items()}
        for title, ratios in found.items()
    }


def _ratios() -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the ratios of each number of drives, and of the most to one."""
    transactions = []
    for title, figures in speed.measure(3.0, _CASES):
        if title.startswith(DRIVER):
            yield title, {ratio: figures[name] for ratio, name in _RATIOS.items()}
            transactions.append(figures['cpu_transaction'])
    yield 'driver, many drives over one', {GROWTH: transactions[-1] / transactions[0]}


def main() -> int:
    """Measure, and compare or write; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=5, help='the least of so many (default: 5)')
    parser.add_argument('--write', action='store_true', help='these are the figures of a release')
    options = parser.parse_args()
    with own_domain() as domain:
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        now = measured(options.runs)
    if options.write:
        # a busy machine makes them larger, and the gate wider
        load = round(os.getloadavg()[0], 2)
        release = {'version': VERSION, 'load average': load, 'figures': now}
        _RELEASE.write_text(json.dumps(release, indent=2) + '\n')
        return 0
    release = json.loads(_RELEASE.read_text())
    worse = list(regressions(now, release['figures']))
    print('\n'.join(worse) or f'no slower than {release["version"]}')
    return 1 if worse else 0


if __name__ == '__main__':
    sys.exit(main())
