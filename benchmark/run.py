# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How fast the driver is, and how fast others are: prints tables.

Simulated drives on a line that takes its time, the driver and its users, each a process of its
own. docs/performance.md explains the rows.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time

from measurements import Measurement, all_measurements
import page
import resources
from rig import use_domain
from row import Effort, Row, blamed, merged

_WHOLE = Effort(window=5.0, rounds=5, setpoints=500, stops=40, events=3)
_QUICK = Effort(window=3.0, rounds=3, setpoints=100, stops=10, events=1)
#: The machine is calm when everybody else takes less than this, cores.
_CALM = 0.5
#: How often a measurement is tried; a busy machine can spoil one.
_ATTEMPTS = 2


def main() -> None:
    """Measure and print the tables."""
    parser = _parser()
    options = parser.parse_args()
    if options.write and options.baud:
        parser.error('--write replaces whole tables: not with --baud')
    # end what was started, however this ends
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    use_domain(options.domain)
    chosen = [
        one
        for one in all_measurements()
        if (one.group in options.only if options.only else not (options.quick and one.minor))
        and (not options.baud or one.baud_rate in options.baud)
    ]
    runs = options.runs or (1 if options.quick else 5)
    effort = _QUICK if options.quick else _WHOLE
    measured: list[list[list[Row]]] = [[] for _ in chosen]
    loads: list[float] = []
    for run in range(1, runs + 1):
        for measurement, results in zip(chosen, measured, strict=True):
            began = time.monotonic()
            try:
                results.append(_measure(measurement, effort, options.calm, loads))
            except RuntimeError as error:
                # the others are not lost with it
                _say(f'{measurement}: NOT MEASURED: {error}')
                continue
            took = time.monotonic() - began
            _tell(f'run {run} of {runs}, {took:.0f} s', measurement, results[-1])
    rows: dict[str, list[Row]] = {}
    for measurement, results in zip(chosen, measured, strict=True):
        found = [merged(same) for same in zip(*results, strict=True)]
        rows.setdefault(measurement.group, []).extend(found)
    circumstances = page.circumstances(_command(), runs, loads)
    for group, found in rows.items():
        text = f'{circumstances}\n\n{page.tables(found)}'
        summary = page.summary(group, found)
        print(f'{group}\n\n{summary}\n\n{text}\n')
        if options.write:
            page.write(text, group)
            if summary:
                page.write(summary, f'summary of {group}')


def _measure(
    measurement: Measurement, effort: Effort, patience: float, loads: list[float]
) -> list[Row]:
    """Measure, again while the machine is not calm and there is patience (s)."""
    deadline = time.monotonic() + patience
    failures = 0
    measured: list[list[Row]] = []
    while True:
        if patience:
            resources.await_calm(_CALM, deadline - time.monotonic())
        loads.append(os.getloadavg()[0])
        try:
            measured.append(measurement.measure(effort))
        except RuntimeError as error:
            failures += 1
            if failures == _ATTEMPTS:
                raise
            _say(f'{measurement}: tried again: {error}')
            continue
        others = max(row.figures['others'] for row in measured[-1])
        if others < 100 * _CALM or time.monotonic() > deadline:
            # it is no excuse that others were busy
            return [blamed(same) for same in zip(*measured, strict=True)]


def _command() -> str:
    """Return the command that was given; what ran ahead of others on the machine says so."""
    nice = os.nice(0)
    words = [*(['nice', '-n', str(nice)] if nice else []), 'python', 'benchmark/run.py']
    return ' '.join([*words, *sys.argv[1:]])


def _tell(run: str, measurement: Measurement, rows: list[Row]) -> None:
    for row in rows:
        told = ', '.join(f'{name} {value:.3f}' for name, value in row.figures.items())
        where = f'{measurement.what}, {row.baud_rate} bit/s, {row.drives} drives'
        _say(f'{run}: {row.what} ({where}): {told}')


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add('--runs', type=int, help='how often everything is measured (default: 5; --quick: 1)')
    add('--quick', action='store_true', help='shorter windows, fewer events, one run')
    groups = list(dict.fromkeys(one.group for one in all_measurements()))
    add('--only', action='append', choices=groups, help='only these tables; may be repeated')
    rates = sorted({one.baud_rate for one in all_measurements()})
    add('--baud', action='append', type=int, choices=rates, help='only at this rate')
    add(
        '--calm',
        type=float,
        default=0.0,
        metavar='SECONDS',
        help='wait until the machine is calm, and measure again what was disturbed, for so long '
        'at most with each measurement',
    )
    add('--write', action='store_true', help=f'put the tables into docs/{page.PAGE.name}')
    add('--domain', type=int, metavar='ID', help='ROS domain (default: one of its own)')
    return parser


if __name__ == '__main__':
    main()
