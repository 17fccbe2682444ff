# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The table, and the page that it stands on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from importlib.metadata import version
import os
from pathlib import Path
import platform
import subprocess

from row import Row

_ROOT = Path(__file__).resolve().parents[1]
PAGE = _ROOT / 'docs' / 'performance.md'

#: Title, name of the figure, decimals.
Column = tuple[str, str, int]

_CPU: tuple[Column, ...] = (
    ('CPU, % of a core', 'cpu', 1),
    ('CPU, ms a transaction', 'cpu_transaction', 2),
)
_OTHERS: Column = ('others, % of a core', 'others', 0)
_SPEED: tuple[Column, ...] = (
    ('cycle, ms', 'time', 1),
    ('p99, ms', 'p99', 1),
    ('cycle / limit', 'ratio', 3),
    ("cycle / bare loop's", 'bare_ratio', 3),
    ('gaps < t3.5', 'short_gaps', 0),
    *_CPU,
    ('CPU / that with one drive', 'cpu_to_one', 2),
    ("CPU / bare loop's", 'cpu_to_bare', 2),
)
_START: tuple[Column, ...] = (
    ('RSS, MB', 'rss', 1),
    ('PSS, MB', 'pss', 1),
    ('USS, MB', 'uss', 1),
    ('start, s', 'start', 2),
    ('from the first request, s', 'start_line', 2),
    ('wire time, s', 'start_wire', 2),
    ('start / wire time', 'start_ratio', 2),
    ('from the first request / wire time', 'start_line_ratio', 3),
    ('end, s', 'ended', 2),
)
_MASTERS: tuple[Column, ...] = (
    ('cycle, ms', 'time', 1),
    ('p99, ms', 'p99', 1),
    ('limit, ms', 'limit', 1),
    ('cycle / limit', 'ratio', 3),
    ('gaps < t3.5', 'short_gaps', 0),
    ('master adds, ms', 'master_adds', 2),
    ('simulator adds, ms', 'simulator_adds', 2),
    *_CPU,
    _OTHERS,
)
_ENABLED: tuple[Column, ...] = (
    ('cycle, ms', 'time', 1),
    ('cycle / limit', 'ratio', 3),
    ('plain limit, ms', 'plain', 1),
    ('cycle / plain limit', 'plain_ratio', 3),
    ('polls and set-points / plain limit', 'polls_ratio', 3),
    *_CPU,
    _OTHERS,
)
_DELAYS: tuple[Column, ...] = (
    ('events', 'events', 0),
    ('median, ms', 'time', 2),
    ('p99, ms', 'p99', 2),
    ('longest, ms', 'longest', 2),
    ('transaction, ms', 'limit', 2),
    ('longest beyond a transaction, ms', 'beyond', 2),
    ('of that the machine stood still, ms', 'stood_still', 1),
)
_EVENTS: tuple[Column, ...] = (
    *_DELAYS,
    ("of that in the sender's call, ms", 'in_sender', 1),
    ('never came', 'lost', 0),
    ('gaps < t3.5', 'short_gaps', 0),
    ('CPU, % of a core', 'cpu', 1),
    _OTHERS,
)
_STOPS: tuple[Column, ...] = (*_DELAYS, ('polls', 'polls', 0), _OTHERS)
#: The tables of any group: which rows stand in each, and its columns.
_TABLES: tuple[tuple[tuple[str, ...], tuple[Column, ...]], ...] = (
    (('driver',), _SPEED),
    (('driver',), _START),
    (('driver', 'other'), _MASTERS),
    (('event',), _EVENTS),
    (('enabled',), _ENABLED),
    (('stop',), _STOPS),
)
#: Where the comparison with others tells no aim of its own: it is told before.
_WITHOUT_AIMS = (_MASTERS,)


def tables(rows: Sequence[Row]) -> str:
    """Return the tables of a group in Markdown."""
    found = []
    for kinds, columns in _TABLES:
        some = [row for row in rows if row.table in kinds]
        if some:
            found.append(_table(some, columns))
    return '\n\n'.join(found)


def _table(rows: Sequence[Row], columns: Sequence[Column]) -> str:
    judged = columns not in _WITHOUT_AIMS
    titles = ['what', 'bit/s', 'drives', *(title for title, _, _ in columns)]
    lines = [
        _line([*titles, *(['aims'] if judged else [])]),
        _line(['---', *['---:'] * (len(titles) - 1), *(['---'] if judged else [])]),
    ]
    for row in rows:
        cells = [row.what, str(row.baud_rate), str(row.drives)]
        cells += [_number(row.figures.get(name), decimals) for _, name, decimals in columns]
        lines.append(_line([*cells, *([verdict(row, columns)] if judged else [])]))
    return '\n'.join(lines)


def verdict(row: Row, columns: Sequence[Column]) -> str:
    """Return whether the aims are met, or what was missed and by how much."""
    missed = []
    judged = [column for column in columns if {column[1]} <= row.aims.keys() & row.figures.keys()]
    for title, name, decimals in judged:
        excess = round(row.figures[name] - row.aims[name], decimals)
        if excess > 0:
            missed.append(f'**{title} at most {row.aims[name]:g}: missed by {excess:g}**')
    if row.figures.get('lost'):
        missed.append(f'**{row.figures["lost"]:g} set-points never came there**')
    return '; '.join(missed) or ('met' if judged else '')


def summary(group: str, rows: Sequence[Row]) -> str:
    """Return what a user wants to know of a group, a line each; '' if it says nothing of it."""
    found = {(row.what, row.baud_rate, row.drives): row.figures for row in rows}
    try:
        if group == 'setpoints':
            return _stop_summary(found['service stop', 57600, 32])
        if group == 'rtu':
            few, many = found['driver', 57600, 1], found['driver', 57600, 32]
            return _cycle_summary(few, many)
    except KeyError:
        # not everything was measured
        return ''
    return ''


def _stop_summary(stop: dict[str, float]) -> str:
    return (
        f'* **Stop:** {stop["time"]:.1f} ms from the call of `~/stop` to its command on the line, '
        f'{stop["longest"]:.1f} ms at most ({stop["events"]:.0f} calls; 32 drives that run, on a '
        f'full line at 57600 bit/s, where one transaction takes {stop["limit"]:.1f} ms).'
    )


def _cycle_summary(few: dict[str, float], many: dict[str, float]) -> str:
    return (
        f'* **Cycle:** status and frequency of one drive every {few["time"]:.0f} ms, of 32 '
        f'drives every {many["time"]:.0f} ms (57600 bit/s): {few["ratio"]:.2f} and '
        f'{many["ratio"]:.2f} times what the bytes themselves take on the wire.\n'
        f'* **Processor:** {many["cpu"]:.0f} % of a core with 32 drives on a full line, and '
        f'{few["cpu"]:.0f} % with one: {many["cpu_transaction"]:.2f} and '
        f'{few["cpu_transaction"]:.2f} ms a transaction, where a bare loop in Python takes '
        f'{many["cpu_transaction"] / many["cpu_to_bare"]:.2f}.'
    )


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


def write(text: str, name: str) -> None:
    """
    Put what was measured on the page, between the two marks of that name.

    :raises ValueError: the page has no place for it.
    """
    first = f'<!-- {name}: from here to the end mark written by benchmark/ with --write -->'
    last = f'<!-- {name}: end -->'
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
