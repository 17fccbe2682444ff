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
"""The table, and the page that it stands on."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from datetime import datetime
from datetime import timezone
from importlib.metadata import version
import os
from pathlib import Path
import platform
import subprocess

from measurements import Figures
from measurements import Measurement

_ROOT = Path(__file__).resolve().parents[1]
PAGE = _ROOT / 'docs' / 'performance.md'
#: Where a table begins and ends.
Marks = tuple[str, str]
SPEED: Marks = (
    '<!-- benchmark: from here to the end mark written by benchmark/run.py --write -->',
    '<!-- benchmark: end -->',
)
NOISE: Marks = (
    '<!-- noise: from here to the end mark written by benchmark/noise.py --write -->',
    '<!-- noise: end -->',
)

#: Title and figure of each column, and how many decimals.
_CYCLES = (
    ('time, ms', 'time', 2),
    ('p99, ms', 'p99', 2),
    ('limit, ms', 'limit', 2),
    ('time / limit', 'ratio', 3),
    ('gaps < t3.5', 'short_gaps', 0),
    ('master adds, ms', 'master_adds', 2),
    ('simulator adds, ms', 'simulator_adds', 2),
    ('driver says, ms', 'driver_says', 2),
    ('CPU, % of a core', 'cpu', 1),
    ('CPU, ms a transaction', 'cpu_transaction', 2),
    ('others, % of a core', 'others', 0),
)
_STOPS = (
    ('events', 'events', 0),
    ('median, ms', 'time', 2),
    ('p99, ms', 'p99', 2),
    ('longest, ms', 'longest', 2),
    ('transaction, ms', 'limit', 2),
    ('longest / transaction', 'ratio', 2),
    ('longest beyond it, ms', 'beyond', 2),
    ('polls', 'polls', 0),
    ('others, % of a core', 'others', 0),
)
_UNITS = {
    'ratio': ('time / limit', '', 3),
    'short_gaps': ('gaps < t3.5', '', 0),
    'cpu': ('CPU', ' %', 1),
    'time': ('median', ' ms', 2),
    'p99': ('p99', ' ms', 2),
    'beyond': ('beyond a transaction', ' ms', 2),
    'polls': ('polls', '', 0),
}

Row = tuple[Measurement, str, Figures]


def tables(rows: Sequence[Row]) -> str:
    """Return the tables in Markdown: that of cycles and set-points, and that of stops."""
    of_stops = [row for row in rows if row[0].group == 'stop']
    of_cycles = [row for row in rows if row[0].group != 'stop']
    found = [_table(some, columns) for some, columns in ((of_cycles, _CYCLES), (of_stops, _STOPS))]
    return '\n\n'.join(filter(None, found))


def _table(rows: Sequence[Row], columns: Sequence[tuple[str, str, int]]) -> str:
    if not rows:
        return ''
    titles = ['what', 'bit/s', 'drives', *(title for title, _, _ in columns), 'aims']
    lines = [_line(titles), _line(['---', *['---:'] * (len(titles) - 2), '---'])]
    for measurement, title, figures in rows:
        cells = [title, str(measurement.baud_rate), str(measurement.drives)]
        cells += [_number(figures.get(name), decimals) for _, name, decimals in columns]
        lines.append(_line([*cells, verdict(measurement.aims, figures)]))
    return '\n'.join(lines)


def verdict(aims: Figures, figures: Figures) -> str:
    """Return whether the aims are met, or what was missed and by how much."""
    missed = []
    judged = {name: most for name, most in aims.items() if name in figures}
    for name, most in judged.items():
        title, unit, decimals = _UNITS[name]
        excess = round(figures[name] - most, decimals)
        if excess > 0:
            missed.append(f'**{title} at most {most:g}{unit}: missed by {excess:g}{unit}**')
    if figures.get('lost'):
        missed.append(f'**{figures["lost"]:g} set-points never came there**')
    return '; '.join(missed) or ('met' if judged else '')


def circumstances(command: str, runs: int, loads: Sequence[float]) -> str:
    """Return where and how it was measured, as a list in Markdown."""
    packages = ('rclpy', 'pymodbus', 'minimalmodbus', 'pyserial')
    versions = ', '.join(f'{name} {_attempt(lambda name=name: version(name))}' for name in packages)
    now = datetime.now(timezone.utc)
    return '\n'.join(
        (
            f'* {now:%Y-%m-%d %H:%M} UTC, `{command}`, ' + _of(runs),
            f'* {_processor()}, {os.cpu_count()} cores, Linux {platform.release()}, '
            f'Python {platform.python_version()}',
            f'* driver at {_attempt(_revision)}; {versions}',
            f'* load average of the machine before each measurement: {min(loads):.2f} to '
            f'{max(loads):.2f}, in which the benchmark itself has its share',
        )
    )


def write(text: str, marks: Marks = SPEED) -> None:
    """
    Put what was measured on the page, between two marks.

    :raises ValueError: the page has no place for it.
    """
    first, last = marks
    before, begin, rest = PAGE.read_text().partition(first)
    _, end, after = rest.partition(last)
    if not begin or not end:
        raise ValueError(f'{PAGE.name} has lost its marks: {first} and {last}')
    PAGE.write_text(f'{before}{begin}\n\n{text}\n\n{end}{after}')


def _of(runs: int) -> str:
    return f'medians of {runs} runs' if runs > 1 else 'one run'


def _line(cells: Sequence[str]) -> str:
    return f'| {" | ".join(cells)} |'


def _number(value: float | None, decimals: int) -> str:
    return '' if value is None else f'{value:.{decimals}f}'


def _attempt(what: Callable[[], str]) -> str:
    """Return what something says of itself, or that it is not known."""
    try:
        return what()
    except (ImportError, OSError, subprocess.CalledProcessError):
        return 'of unknown version'


def _processor() -> str:
    for line in Path('/proc/cpuinfo').read_text().splitlines():
        if line.startswith('model name'):
            return line.partition(':')[2].strip()
    return platform.machine()


def _revision() -> str:
    command = ('git', '-C', str(_ROOT), 'describe', '--always', '--dirty')
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
