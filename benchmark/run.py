# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How fast the driver is, how soon it stops a motor, how it bears noise and silence: prints tables.

Simulated drives on a line that takes its time, a master and its clients, each a process of its
own. The peer is what a user would write instead; benchmark/results.md explains the rows.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from datetime import datetime, timezone
from importlib.metadata import version
import os
from pathlib import Path
import platform
import signal
import statistics
import subprocess
import sys

import commands
import noise
import silence
import speed

from nfo_sinus_driver.demo.bench import own_domain

_PAGE = Path(__file__).resolve().parents[1] / 'benchmark' / 'results.md'
_LIBRARIES = ('rclpy', 'minimalmodbus', 'pyserial')
_MARK = '<!-- {}: from here to the end mark written by benchmark/ with --write -->'
_END = '<!-- {}: end -->'
Rows = Iterator[tuple[str, dict[str, float]]]
Columns = tuple[tuple[str, str, int], ...]
#: The measurements: their columns, whole and quick.
_GROUPS: dict[str, tuple[Columns, Callable[[], Rows], Callable[[], Rows]]] = {
    'speed': (speed.COLUMNS, lambda: speed.measure(5.0), lambda: speed.measure(3.0)),
    'commands': (
        commands.COLUMNS, lambda: commands.measure(500), lambda: commands.measure(100)
    ),
    'noise': (noise.COLUMNS, lambda: noise.measure(60.0), lambda: noise.measure(10.0, 3)),
    'silence': (silence.COLUMNS, silence.measure, lambda: silence.measure((57600,))),
}


def main() -> None:
    """Measure and print the tables."""
    options = _parser().parse_args()
    # end what was started, however this ends
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    runs = options.runs or (1 if options.quick else 5)
    with own_domain() as domain:
        os.environ['ROS_DOMAIN_ID'] = str(domain if options.domain is None else options.domain)
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        for group in options.only or _GROUPS:
            columns, whole, quick = _GROUPS[group]
            # noise lasts long enough for one run, and virtual time is the same in each
            times = 1 if group in ('noise', 'silence') else runs
            found: dict[str, list[dict[str, float]]] = {}
            for _ in range(times):
                for title, figures in (quick if options.quick else whole)():
                    found.setdefault(title, []).append(figures)
                    print(title, {name: round(figure, 3) for name, figure in figures.items()},
                          file=sys.stderr, flush=True)
            text = f'{_circumstances(times)}\n\n{_table(columns, found)}'
            print(f'{group}\n\n{text}\n')
            if options.write:
                _write(group, text)


def _table(columns: Columns, found: dict[str, list[dict[str, float]]]) -> str:
    """Return the medians of all runs as a table in Markdown."""
    titles = ('what', *(title for title, _, _ in columns))
    lines = [f'| {" | ".join(titles)} |', '| --- ' + '| ---: ' * len(columns) + '|']
    for title, runs in found.items():
        cells = [title]
        for _, name, decimals in columns:
            values = [figures[name] for figures in runs if name in figures]
            cells.append(f'{statistics.median(values):.{decimals}f}' if values else '')
        lines.append(f'| {" | ".join(cells)} |')
    return '\n'.join(lines)


def _circumstances(runs: int) -> str:
    now = datetime.now(timezone.utc)
    commit = subprocess.run(
        ['git', 'rev-parse', '--short', 'HEAD'],
        cwd=_PAGE.parent, capture_output=True, text=True, check=False,
    ).stdout.strip()
    libraries = ', '.join(f'{name} {version(name)}' for name in _LIBRARIES)
    command = ' '.join(('make bench', *sys.argv[1:]))
    times = 'one run' if runs == 1 else f'medians of {runs} runs'
    return (
        f'* {now:%Y-%m-%d %H:%M} UTC, `{command}`, {times}\n'
        f'* {os.cpu_count()} cores, Linux {platform.release()}, Python '
        f'{platform.python_version()}; load average {os.getloadavg()[0]:.2f}\n'
        f'* driver at {commit or "?"}; {libraries}'
    )


def _write(group: str, text: str) -> None:
    """Put a table into the page, between its marks."""
    page = _PAGE.read_text()
    before, begin, rest = page.partition(_MARK.format(group))
    _, end, after = rest.partition(_END.format(group))
    if not end:
        raise SystemExit(f'{_PAGE.name} has no marks for the table {group}')
    _PAGE.write_text(f'{before}{begin}\n\n{text}\n\n{end}{after}')


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add('--runs', type=int, help='how often everything is measured (default: 5; --quick: 1)')
    add('--quick', action='store_true', help='shorter windows, fewer events, one run')
    add('--only', action='append', choices=_GROUPS, help='only these tables; may be repeated')
    add('--write', action='store_true', help=f'put the tables into benchmark/{_PAGE.name}')
    add('--domain', type=int, metavar='ID', help='ROS domain (default: one of its own)')
    return parser


if __name__ == '__main__':
    main()
