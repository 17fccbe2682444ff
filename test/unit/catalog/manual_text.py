# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""Reading the tables of the manuals' text, as a second opinion on the catalog."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import re

import pytest

from nfo_sinus_driver.catalog import Parameter, load_family

SHARED = Path(__file__).resolve().parents[4] / 'shared'
G2 = load_family('sinus_g2')

#: Names that the manuals spell in more than one way, or wrongly [C29], once they are squashed.
SPELLINGS = {
    'adress': 'address',
    'siadr': 'address',
    'sitout': 'siotot',
    'ilimit': 'ilimt',
    'kpspdp': 'kpspd',
    'tispdp': 'tispd',
    'kpsp': 'kpspd',
    'tisp': 'tispd',
    'overload/overid': 'overload/overld',
    'imagnlow/imagnlow': 'imagnlow/imaglow',
    'curlow/errcnttriescurrentlowalarm': 'curlow/errcnt',
    'busfail/autoreset': 'autoreset',
    'busfail/autostop': 'autostop',
    'drivecontrolmaskwrite': 'drvctrlwritemask',
}
#: Names under which the tables of PROFIBUS and CANopen have two parameters of the catalog.
PAIRS = {
    'invst': ['invst+', 'invst'],
    'spdscl': ['spdsclnumerator', 'spdscldenominator'],
}
#: Rows that are no parameter: a command, the error log, and what is to be defined [C16].
NO_PARAMETER = re.compile(r'Tuning|E-?logg|\.\.|(Frq|Trq|Reg)Scl|(Display )?Name|\(|$')


@dataclass(frozen=True)
class Line:
    """One row of a table: the parameters that it is about, and what is beside the name."""

    parameters: list[Parameter]
    name: str
    cells: list[str]


def manual(short: str) -> list[str]:
    """The lines of a manual; the test is skipped where it is not there."""
    number = {'M0': '000', 'M2': '002', 'M4': '004'}[short]
    found = sorted((SHARED / 'manuals').glob(f'{number}_*.txt'))
    if not found:
        pytest.skip(f'{short} is not beside this clone')
    return found[0].read_text(encoding='utf-8').splitlines()


def between(lines: list[str], start: str, end: str) -> Iterator[list[str]]:
    """The rows between two lines, as cells."""
    first = next(number for number, line in enumerate(lines) if line.startswith(start))
    for line in lines[first:]:
        if line.startswith(end):
            return
        yield [cell.strip() for cell in line.split('\t')]


def squashed(name: str) -> str:
    """What is left of a name without blanks, hyphens and remarks."""
    with_ack = '+' if '(With Ack)' in name else ''
    name = re.sub(r'\(.*?\)|[\s*-]', '', name).casefold()
    return SPELLINGS.get(name, name) + with_ack


def index() -> dict[tuple[str, str], Parameter]:
    """The catalog by group and squashed name."""
    return {(squashed(row.group), squashed(row.name)): row for row in G2.values()}


def lines_of(table: int) -> Iterator[Line]:
    """The rows of one of the tables of parameters of M0; a name that nobody knows is an error."""
    start, end = {
        2: ('### 6.1.6', 'Table 2:'),
        3: ('### 6.1.7', 'Table 3:'),
        4: ('### 6.2.5', 'Table 4:'),
        5: ('### 6.2.6', 'Table 5:'),
        9: ('## 6.3.6', 'Table 9:'),
        10: ('### 6.3.7', 'Table 10:'),
        12: ('### 6.4.3', 'Table 12:'),
        13: ('#### 6.4.4', 'Table 13:'),
    }[table]
    known = index()
    group = 'fieldbus'
    for name, *cells in between(manual('M0'), start, end):
        if name.startswith('Parameter group '):
            group = squashed(name.removeprefix('Parameter group '))
        elif cells and not NO_PARAMETER.match(name):
            names = PAIRS.get(squashed(name), [squashed(name)]) if table > 5 else [squashed(name)]
            # the set-points stand in Status and among the words of control [C28]
            groups = (group, 'status') if group == 'fieldbus' else (group,)
            keys = [(where, one) for one in names for where in groups]
            found = [known[key] for key in keys if key in known]
            assert len(found) == len(names), f'table {table}: nobody knows {name} of {group}'
            yield Line(found, name, cells)


def labels_in(text: str) -> dict[int, str]:
    """The enumeration in a cell of M0: codes and labels."""
    text = re.sub(r'</?sup>', '', text).replace('m 3 ', 'm³') + ' '
    pairs = re.findall(r'([0-9A-F]+h|\d+) = (.+?)(?= \(Obsolete| Also | \w+ = | $)', text)
    return {
        int(code.removesuffix('h'), 16 if code.endswith('h') else 10): label.strip()
        for code, label in pairs
    }


def settings_of_m2() -> Iterator[tuple[Parameter, list[str]]]:
    """The rows of [M2 table 1], by their Classic id, with the group of the catalog."""
    classic = [row for row in G2.values() if 'classic' in row.addresses]
    by_id = {row.at('classic').index: row for row in classic}
    for cells in between(manual('M2'), 'ID\tName\tDescription', 'Table 1.'):
        if re.fullmatch(r'E[0-9A-F]{4}', cells[0]) and len(cells) == 7 and cells[1]:
            row = by_id[int(cells[0][1:], 16)]
            assert squashed(cells[1]) == squashed(row.name), cells[0]
            yield row, cells
