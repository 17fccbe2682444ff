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
"""
How fast the driver is, and how fast others are: prints one table.

Simulated drives on a line that takes its time, the driver and its users, each a process of its
own. docs/performance.md explains the rows.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import os
import signal
import statistics
import sys
import time

from measurements import Effort
from measurements import Figures
from measurements import Measurement
from measurements import all_measurements
import page
import processor

_WHOLE = Effort(window=5.0, setpoints=500, events=3)
_QUICK = Effort(window=3.0, setpoints=60, events=1)
#: The machine is calm when everybody else takes less than this, cores.
_CALM = 0.5
#: What may not happen in any run, so that a median would hide it.
_COUNTED = ('short_gaps', 'lost')
#: What counts in every run: the events, and the longest that any of them took.
_SUMMED = (*_COUNTED, 'events')
_WORST = ('longest', 'ratio', 'beyond', 'polls')


def main() -> None:
    """Measure and print the table."""
    options = _parser().parse_args()
    # end what was started, however this ends
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    # nobody else's drives may hear what is published here
    os.environ['ROS_DOMAIN_ID'] = str(options.domain)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    chosen = [row for row in all_measurements() if not options.only or row.group in options.only]
    runs = 1 if options.quick else options.runs
    effort = _QUICK if options.quick else _WHOLE
    measured: list[list[dict[str, Figures]]] = [[] for _ in chosen]
    loads = []
    for run in range(1, runs + 1):
        for measurement, results in zip(chosen, measured, strict=True):
            results.append(_measure(measurement, effort, options.calm, loads))
            _tell(f'run {run} of {runs}', measurement, results[-1])
    rows = [
        (measurement, title, merged(measurement.group, [found[title] for found in results]))
        for measurement, results in zip(chosen, measured, strict=True)
        for title in results[0]
    ]
    text = f'{page.circumstances(_command(), runs, loads)}\n\n{page.tables(rows)}'
    print(text)
    if options.write:
        page.write(text)


def _measure(
    measurement: Measurement, effort: Effort, patience: float, loads: list[float]
) -> dict[str, Figures]:
    """Measure, again while the machine is not calm and there is patience (s)."""
    deadline = time.monotonic() + patience
    counted: dict[tuple[str, str], float] = {}
    while True:
        processor.await_calm(_CALM, deadline - time.monotonic())
        loads.append(os.getloadavg()[0])
        rows = measurement.measure(effort)
        # it is no excuse that others were busy
        for title, figures in rows.items():
            for name in figures.keys() & set(_COUNTED):
                figures[name] += counted.get((title, name), 0.0)
                counted[title, name] = figures[name]
        others = max(figures['others'] for figures in rows.values())
        if others < 100 * _CALM or time.monotonic() > deadline:
            return rows


def merged(group: str, results: list[Figures]) -> Figures:
    """Return the medians of the runs; what must never happen is counted over all of them."""
    names = {name for figures in results for name in figures}
    return {
        name: _merging(group, name)([figures[name] for figures in results if name in figures])
        for name in names
    }


def _merging(group: str, name: str) -> Callable[[list[float]], float]:
    if name in _SUMMED:
        return sum
    return max if group == 'stop' and name in _WORST else statistics.median


def _command() -> str:
    """Return the command that was given; what ran ahead of others on the machine says so."""
    nice = os.nice(0)
    words = [*(['nice', '-n', str(nice)] if nice else []), 'python', 'benchmark/run.py']
    return ' '.join([*words, *sys.argv[1:]])


def _tell(run: str, measurement: Measurement, rows: dict[str, Figures]) -> None:
    where = f'{measurement.baud_rate} bit/s, {measurement.drives} drives'
    for title, figures in rows.items():
        told = ', '.join(f'{name} {value:.3f}' for name, value in figures.items())
        print(f'{run}: {title}, {where}: {told}', file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add('--runs', type=int, default=5, help='how often everything is measured (default: 5)')
    add('--quick', action='store_true', help='one short run, to see that it works')
    groups = list(dict.fromkeys(row.group for row in all_measurements()))
    add('--only', action='append', choices=groups, help='only these rows; may be repeated')
    add(
        '--calm',
        type=float,
        default=0.0,
        metavar='SECONDS',
        help='wait until the machine is calm, and measure again what was disturbed, for so long '
        'at most with each measurement',
    )
    add('--write', action='store_true', help=f'put the table into docs/{page.PAGE.name}')
    add('--domain', type=int, default=90, metavar='ID', help='ROS domain (default: 90)')
    return parser


if __name__ == '__main__':
    main()
