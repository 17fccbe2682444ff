# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The driver of this clone beside that of another, at the same time: which takes more processor.

Each has a full line of its own, and both are watched in the same seconds. One after the other, two
runs of the same driver differ by a fifth on a shared machine; at the same time, by a fiftieth.

    tools/run python benchmark/compare.py ../other_clone [--drives 8] [--setpoints] [--turns 3]

The other clone has been set up (make setup). The last lines are medians of the turns; the ratio is
the median of their ratios, for only the two figures of one turn are of the same seconds.
"""

from __future__ import annotations

import argparse
import json
import operator
import os
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile

from driver_rig import DriverRig
from resources import memory
from rig import FOLDER, use_domain
import setpoints
import speed

_UNCOMPILED = 'PYTHONDONTWRITEBYTECODE'
#: What is compared, and how it is shown.
_SHOWN = {
    'cpu': 'CPU, % of a core',
    'cpu_transaction': 'CPU, ms a transaction',
    'ratio': 'cycle / limit',
    'rss': 'RSS, MB',
    'uss': 'USS, MB',
}


def main() -> None:
    """Compare two drivers, or be the one that watches one of them."""
    options = _parser().parse_args()
    if options.own:
        _watch_own(options)
        return
    run = options.other.resolve() / 'tools' / 'run'
    if not run.exists():
        raise SystemExit(f'{options.other} is no clone of this project: it has no tools/run')
    print('| turn | drives | what | this | the other | this / the other |')
    print('| --- | ---: | --- | ---: | ---: | ---: |')
    found = []
    with tempfile.TemporaryDirectory() as folder:
        driver = Path(folder, 'driver')
        driver.write_text(f'#!/bin/sh\nexec "{run}" driver "$@"\n')
        driver.chmod(0o755)
        paths = [os.environ['PATH'], f'{folder}:{os.environ["PATH"]}']
        for turn in range(1, options.turns + 1):
            found.append(_turn(options, paths))
            _show(str(turn), options.drives, *found[-1])
    for what in _SHOWN:
        own, other = ([turn[what] for turn in turns] for turns in zip(*found, strict=True))
        ratios = map(operator.truediv, own, other)
        _row('median', options.drives, what, *map(statistics.median, (own, other, ratios)))


def _turn(options: argparse.Namespace, paths: list[str]) -> list[dict[str, float]]:
    """Watch both at the same time; return the figures of each."""
    command = [sys.executable, str(FOLDER / 'compare.py'), *sys.argv[1:], '--own']
    # who compiles at every start takes other memory than who does not, as an installed driver
    environment = {name: value for name, value in os.environ.items() if name != _UNCOMPILED}
    watchers = [
        subprocess.Popen(
            command, env={**environment, 'PATH': path}, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )
        for path in paths
    ]
    for watcher in watchers:
        assert watcher.stdout is not None
        if not watcher.stdout.readline():
            raise SystemExit('a driver did not come to its line; what it said is above')
    # both wait for the other
    for watcher in watchers:
        assert watcher.stdin is not None
        watcher.stdin.write('go\n')
        watcher.stdin.flush()
    return [json.loads(watcher.communicate()[0]) for watcher in watchers]


def _watch_own(options: argparse.Namespace) -> None:
    """Bring a driver to its line, say so, and watch it when told to."""
    use_domain(None)
    settings = setpoints.SETTINGS if options.setpoints else {}
    with DriverRig(setpoints.BAUD_RATE, options.drives, **settings) as rig:
        if options.setpoints:
            setpoints.give_the_same(rig)
        print('there', flush=True)
        sys.stdin.readline()
        window = rig.watch(rig.driver, options.seconds)
        figures = {**speed.cycles(window, rig), **memory(rig.driver.pid)}
    print(json.dumps({what: figures[what] for what in _SHOWN}))


def _show(turn: str, drives: int, own: dict[str, float], other: dict[str, float]) -> None:
    for what in _SHOWN:
        _row(turn, drives, what, own[what], other[what], own[what] / other[what])


def _row(turn: str, drives: int, what: str, own: float, other: float, ratio: float) -> None:
    shown = _SHOWN[what]
    print(f'| {turn} | {drives} | {shown} | {own:.2f} | {other:.2f} | {ratio:.3f} |', flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add('other', type=Path, help='the other clone, set up')
    add('--drives', type=int, default=8, choices=range(1, 33), metavar='1..32', help='(8)')
    add('--seconds', type=float, default=30.0, help='how long both are watched (30)')
    add('--turns', type=int, default=3, help='how often (3)')
    add('--setpoints', action='store_true', help='motors run, by set-points that stay the same')
    # what it starts itself: who watches one of the two
    add('--own', action='store_true', help=argparse.SUPPRESS)
    return parser


if __name__ == '__main__':
    main()
