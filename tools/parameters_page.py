# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""docs/parameters.md: all parameters for people, made from the tables; ``make pages``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
import functools
import re

from nfo_sinus_driver.catalog.error_log import ErrorLogArea
from nfo_sinus_driver.catalog.family import (
    Family,
    example_setting,
    families,
    load_family,
    usual_family,
)
from nfo_sinus_driver.catalog.parameter import Access, Parameter

_KINDS = {float: 'double', int: 'integer', str: 'string', bool: 'bool'}
_ACCESS = {
    Access.READ: 'read',
    Access.WRITE: 'write',
    Access.READ_WRITE: 'read, write',
    Access.ACKNOWLEDGE: 'reading acknowledges',
}
#: Enumerations with more labels than this stand below the table.
_MOST_LABELS = 7

_INTRODUCTION = """\
<!-- Made from the tables in nfo_sinus_driver/families by `make pages`: change those. -->

# Parameters

What a drive has, as its maker's manuals print it: [settings](#settings), which are the ROS
parameters of its node, and what it measures and is controlled by, which are
[topics](interface.md#topics) and [services](interface.md#services).

    ros2 param list /nfo_sinus
    ros2 param describe /nfo_sinus {setting}
    ros2 param set /nfo_sinus {setting} {value}

How to read the tables:

- **ROS parameter** and **Parameter** are the names to type, for `nfo-sinus get` and, of what can
  only be read, for the driver's parameter `measured`, too; **Display** is the maker's name.
- **Values** are in the unit beside them, on every bus. Where an end is open, or no range is
  printed, it depends on the inverter, or the manual does not say: the drive decides.
- A number in parentheses is the code of a value in its register; `false` is 0 and `true` is 1.
- **Step** is the difference between two values that the drive can hold. Two steps: the one over
  Modbus, then the one over the Classic protocol. The steps of frequencies, speeds, torques and of
  the process regulator are the factory's; the drive's scale factors change them.
- **Option**: the option cards of which the drive needs one for it.
- **Stopped**: it can only be written while the motor stands still. The driver wants that of the
  settings of the line, too ([what is not to be set](interface.md#drive-parameters)).
- **Modbus** is the first holding register, counted from 0, **Classic** the parameter's id (two: the
  low word first), **PROFIBUS** its parameter number (PNU), on PROFINET, too, **CANopen** its index.
- A **type** with bits behind it, such as `[0:23]`: only these bits count, on one of the buses.
- **From** is the first firmware that has it; empty: all have it.

Numbers like 0220h are hexadecimal. A column that would be empty is left out.
"""

_SETTINGS = """\
The name of the ROS parameter, and of the setting on the drive's own display; {count} in all:
{groups}.
"""

_NO_SETTINGS = 'Its manual prints none.\n'

_ONLY_READ = """\
Read-only ROS parameters, where the drive has them.
"""

_TIMED = """\
Entries of two words, the newest first: the operating time in 0.1 h, 24 bits, and the code of the
inverter status above it. Code 0 ends the log.
"""
_UNTIMED = """\
The codes of the last faults, the newest first, without a time; what the drive measured at that
moment, where it keeps that, is shown with them. Code 0 ends the log.
"""
_LOG_HEAD = """
| bus | first entry | next entry | entries |
|---|---|---|---|
"""
#: How each numbering is printed: the title of its column, a number in it, and how far it is to the
#: next entry of an error log. Any other is printed by its name and in decimal numbers.
_SPACES = {
    'register': ('Modbus', '{:04X}h', '{} registers on'),
    'id': ('Classic', 'E{:04X}', '{} ids on'),
    'pnu': ('PROFIBUS', 'P{}', 'the next number'),
    'object': ('CANopen', '{:04X}h', 'the next index'),
}


def _printed(space: str) -> tuple[str, str, str]:
    return _SPACES.get(space, (space.capitalize(), '{}', '{} numbers on'))


_Column = tuple[str, Callable[[Parameter], str]]


def page() -> str:
    """Return the whole page in Markdown."""
    # the usual one first, so that who looks for it finds it there
    names = sorted(families(), key=lambda name: name != usual_family())
    setting, value = example_setting()
    taken: list[str] = []
    parts = [part for name in names for part in _family(load_family(name), taken)]
    return '\n'.join([_INTRODUCTION.format(setting=setting, value=value), *parts])


def _family(family: Family, taken: list[str]) -> Iterator[str]:
    """Return the parts of a family; links to titles that were ``taken`` before have a number."""
    yield f'## {family.profile.title}\n'
    groups = list(dict.fromkeys(parameter.group for parameter in family.settings))
    yield '### Settings\n'
    if groups:
        names = ', '.join(f'[{group}](#{_anchor(group, taken)})' for group in groups)
        taken += groups
        yield _SETTINGS.format(count=len(family.settings), groups=names)
    else:
        yield _NO_SETTINGS
    for group in groups:
        rows = [parameter for parameter in family.settings if parameter.group == group]
        yield f'#### {group}\n'
        yield _table(_SETTING_COLUMNS, rows)
        yield from _long_lists(rows)
    only_read = [row for row in family.kept if not row.is_setting]
    if only_read:
        yield '### Only read\n'
        yield _ONLY_READ
        yield _table(_OTHER_COLUMNS, only_read)
    for group, title in (('Status', 'Measured values'), ('Fieldbus', 'Words of the bus')):
        rows = [parameter for parameter in family.values() if parameter.group == group]
        if rows:
            yield f'### {title}\n'
            yield _table(_OTHER_COLUMNS, rows)
    if family.error_logs:
        yield '### Error log\n'
        timed = any(area.timed for area in family.error_logs.values())
        head = (_TIMED if timed else _UNTIMED) + _LOG_HEAD
        yield head + ''.join(map(_log_row, family.error_logs.values()))


def _log_row(area: ErrorLogArea) -> str:
    bus, first, following = _printed(area.space)
    entries = f'{area.entries}' + (f' to {area.limit}' if area.limit > area.entries else '')
    if area.sub_stride is not None:
        following = f'{area.sub_stride} sub-indices on'
    return f'| {bus} | {first.format(area.first)} | {following.format(area.stride)} | {entries} |\n'


def _table(columns: Sequence[_Column], rows: Sequence[Parameter]) -> str:
    """Return a table without the columns that would be empty."""
    columns = (*columns, *_addresses())
    cells = {title: [show(row) for row in rows] for title, show in columns}
    full = {title: column for title, column in cells.items() if any(column)}
    lines = [list(full), ['---'] * len(full), *zip(*full.values(), strict=True)]
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)


def _long_lists(rows: Sequence[Parameter]) -> Iterator[str]:
    lists: dict[str, list[str]] = {}
    for parameter in rows:
        if parameter.kind is str and len(parameter.labels) > _MOST_LABELS:
            lists.setdefault(_labels(parameter), []).append(f'`{parameter.key}`')
    for labels, keys in lists.items():
        are = 'is' if len(keys) == 1 else 'are each'
        yield f'{", ".join(keys)} {are} one of {labels}.\n'


def _labels(parameter: Parameter) -> str:
    if parameter.kind is int:
        return ', '.join(parameter.labels.values())
    return ', '.join(f'`{label}` ({code})' for code, label in parameter.labels.items())


def _values(parameter: Parameter) -> str:
    if parameter.kind is bool:
        return '`false`, `true`'
    if parameter.labels:
        count = len(parameter.labels)
        return _labels(parameter) if count <= _MOST_LABELS else f'one of {count}, see below'
    low, high = parameter.minimum, parameter.maximum
    ends = [] if low is None else [_number(low) if high is not None else f'from {_number(low)}']
    ends += [] if high is None else [_number(high) if low is not None else f'up to {_number(high)}']
    return ' to '.join(ends)


def _step(parameter: Parameter) -> str:
    if parameter.labels:
        return ''
    if parameter.steps:
        return parameter.shown_steps
    steps = [_number(address.factor) for address in parameter.addresses.values()]
    return ', '.join(dict.fromkeys(steps))


def _column(space: str) -> _Column:
    """Return the column of a numbering."""
    title, shown, _ = _printed(space)

    def cell(parameter: Parameter) -> str:
        found = [a for a in parameter.addresses.values() if a.space == space]
        # a sub-index is the id of another word
        numbers = [n for a in found for n in (a.numbers if space == 'id' else a.numbers[:1])]
        return ', '.join(map(shown.format, numbers))

    return title, cell


def _types(parameter: Parameter) -> str:
    names = [address.codec.name for address in parameter.addresses.values()]
    # the order of bytes is left out, the bits that count are not
    return ', '.join(dict.fromkeys(re.sub(r'_[a-z]+', '', name).upper() for name in names))


def _number(number: Fraction) -> str:
    return f'{float(number):.6f}'.rstrip('0').rstrip('.')


def _anchor(title: str, taken: Sequence[str]) -> str:
    before = taken.count(title)
    return title.lower().replace(' ', '-') + (f'-{before}' if before else '')


@functools.cache
def _addresses() -> tuple[_Column, ...]:
    """Return the columns of all numberings that any family has."""
    parameters = [parameter for name in families() for parameter in load_family(name).values()]
    spaces = [address.space for parameter in parameters for address in parameter.addresses.values()]
    return (
        *map(_column, dict.fromkeys((*_SPACES, *spaces))),
        ('From', lambda row: '' if row.since is None else _number(row.since)),
    )


_SETTING_COLUMNS: tuple[_Column, ...] = (
    ('ROS parameter', lambda row: f'`{row.key}`'),
    ('Display', lambda row: row.name),
    ('Meaning', lambda row: row.description),
    ('Type', lambda row: _KINDS[row.kind]),
    ('Values', _values),
    ('Unit', lambda row: row.unit),
    ('Step', _step),
    ('Stopped', lambda row: 'yes' if row.stopped else ''),
    ('Option', lambda row: row.option),
)
_OTHER_COLUMNS: tuple[_Column, ...] = (
    ('Parameter', lambda row: f'`{row.key}`'),
    ('Display', lambda row: row.name),
    ('Meaning', lambda row: row.description),
    ('Access', lambda row: _ACCESS[row.access]),
    ('Values', _values),
    ('Unit', lambda row: row.unit),
    ('Step', lambda row: _step(row) if row.unit or row.kind is float else ''),
    ('Option', lambda row: row.option),
    ('Type', _types),
)
