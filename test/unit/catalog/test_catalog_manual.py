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


"""The table against the manuals' own text, where that lies beside the clone."""

from __future__ import annotations

from collections.abc import Iterator
import csv
from pathlib import Path
import re

import pytest

from nfo_sinus_driver.catalog import Parameter
from nfo_sinus_driver.catalog import Protocol
from nfo_sinus_driver.catalog import load_model

SHARED = Path(__file__).resolve().parents[4] / 'shared'
G2 = load_model('sinus_g2')

#: Names that the manuals spell in more than one way [C28] [C29], as the catalog does.
SPELLINGS = {
    'adress': 'address',
    'sw ver': 'swver',
    'drvctrl write mask': 'drvctrlwritemask',
    'drivecontrolmaskwrite': 'drvctrlwritemask',
    'i-limit': 'i-limt',
    'cosφ': 'cos-φ',
    'cos φ': 'cos-φ',
    'kp-sp': 'kp-spd',
    'ti-sp': 'ti-spd',
    'siadr': 'address',
    'unit*': 'unit',
    'bus fail / auto reset': 'autoreset',
    'bus fail / auto stop': 'autostop',
    'auto reset': 'autoreset',
    'auto stop': 'autostop',
}
#: Groups of the manual whose parameters the catalog does not have yet, or not yet all.
LATER = {'Freque', 'Speed', 'Torque', 'PI Reg', 'Output', 'Error'}


def manual(short: str) -> list[str]:
    """The lines of a manual; the test is skipped where it is not there."""
    number = {'M0': '000', 'M2': '002'}[short]
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


def by_name(name: str) -> Parameter | None:
    """The parameter of a manual's name, outside the groups that come later."""
    exact = {row.name: row for row in G2.values() if row.group not in LATER}
    bare = name.split(' (')[0]
    for spelling in (name, bare):
        if spelling in exact:
            return exact[spelling]
    lower = {known.lower(): row for known, row in exact.items() if known != 'MODE'}
    return lower.get(SPELLINGS.get(bare.lower(), bare.lower()))


def rows_of(table: Iterator[list[str]]) -> Iterator[tuple[Parameter, list[str]]]:
    """The rows whose parameter the catalog has, without the groups that come later."""
    group = ''
    for cells in table:
        if cells[0].startswith('Parameter group '):
            group = cells[0].removeprefix('Parameter group ')
        elif len(cells) > 1 and group not in LATER:
            row = by_name(cells[0])
            if row is not None:
                yield row, cells


def type_in(cell: str, words: int) -> set[str]:
    """What the catalog may call a type that the manual prints."""
    if cell == 'ENUM':
        # the words of control have no labels in the table, so they are plain numbers
        return {'ENUM', 'UINT16'}
    return {'UINT32'} if cell == '2 * UINT16' and words == 2 else {cell}


@pytest.mark.parametrize(('start', 'end'), [('### 6.2.5', 'Table 4:'), ('### 6.2.6', 'Table 5:')])
def test_modbus_registers_and_types(start: str, end: str) -> None:
    seen = set()
    for row, cells in rows_of(between(manual('M0'), start, end)):
        registers = re.findall(r'([0-9A-F]{4})h', cells[1])
        place = row.place(Protocol.MODBUS)
        assert place.address == int(registers[0], 16), row.key
        assert place.type.name in type_in(cells[2], place.words), row.key
        if cells[2] != '2 * UINT16':
            assert list(place.occupied) == [int(register, 16) for register in registers]
        seen.add(row.key)
    assert len(seen) >= {'Table 4:': 50, 'Table 5:': 12}[end], seen


@pytest.mark.parametrize(('start', 'end'), [('### 6.1.6', 'Table 2:'), ('### 6.1.7', 'Table 3:')])
def test_classic_ids_and_types(start: str, end: str) -> None:
    seen = set()
    for row, cells in rows_of(between(manual('M0'), start, end)):
        ids = re.findall(r'E([0-9A-F]{4})', cells[1])
        if not ids:
            continue  # to be defined, says the manual [C27]
        place = row.place(Protocol.CLASSIC)
        assert place.addresses == tuple(int(number, 16) for number in ids), row.key
        assert place.type.name in type_in(cells[2], place.words), row.key
        seen.add(row.key)
    assert len(seen) >= {'Table 2:': 50, 'Table 3:': 12}[end], seen


@pytest.mark.parametrize(('start', 'end'), [('### 6.1.6', 'Table 2:'), ('### 6.2.5', 'Table 4:')])
def test_enumerations(start: str, end: str) -> None:
    seen = set()
    for row, cells in rows_of(between(manual('M0'), start, end)):
        text = re.sub(r'</?sup>', '', cells[-1]).replace('m 3', 'm³') + ' '
        pairs = re.findall(r'(\d+) = (.+?)(?= \(Obsolete| \d+ = | $)', text)
        if cells[2] == 'ENUM':
            labels = {int(code): label.strip() for code, label in pairs}
            if labels.get(5) == '8b Op 1':
                labels[5] += 's'  # a letter lost in print [C5]
            assert labels == row.labels, row.key
            seen.add(row.key)
    assert len(seen) >= 10, seen


@pytest.mark.parametrize(('start', 'end'), [('### 6.1.6', 'Table 2:'), ('### 6.2.5', 'Table 4:')])
def test_factors(start: str, end: str) -> None:
    protocol = {'Table 2:': Protocol.CLASSIC, 'Table 4:': Protocol.MODBUS}[end]
    units = {'kW': {'kW': 1, 'W': 1000}, 'KWh': {'kWh': 1}, 'Kwh': {'kWh': 1}}
    units |= {'MWh': {'kWh': 1000}, 'Mwh': {'kWh': 1000}, 'Unit': {'': 1}, '1': {'': 1}}
    units |= {name: {name: 1} for name in ('A', 'Ω', 'H', 's', 'h', 'V', 'Hz', '°C', '%', 'rpm')}
    seen = set()
    for row, cells in rows_of(between(manual('M0'), start, end)):
        if row.labels or len(cells) < 4:
            continue
        text = re.sub(r'</?sup>|\s|\*', '', cells[3])
        divided = re.search(r'(°C|%|1|[^\W\d_]+)/10(\d)', text)
        scaled = re.match(r'(Hz|rpm|Nm)/(FrqScl|SpdScl|TrqScl)', text)
        plain = re.fullmatch(r'V|Hz|rpm|s|W', text)
        factor = row.factor(protocol)
        if scaled:
            assert row.scale == scaled[2], row.key
        elif divided:
            times = units[divided[1]][row.unit]
            assert factor == pytest.approx(times / 10 ** int(divided[2])), row.key
        elif plain:
            assert (row.unit, factor) == (plain[0], 1), row.key
        else:
            continue
        seen.add(row.key)
    assert len(seen) >= 35, seen


@pytest.mark.parametrize(
    ('start', 'end'), [('### 6.4.3', 'Table 12:'), ('#### 6.4.4', 'Table 13:')]
)
def test_canopen_index_gives_the_same_register(start: str, end: str) -> None:
    # one numbering behind all buses: index 2000h + ADI, register 210h + 4 (ADI - 1)
    from_base = {'control.accel': 2, 'control.retard': 2}
    seen = set()
    for row, cells in rows_of(between(manual('M0'), start, end)):
        index = re.fullmatch(r'([0-9A-F]{4})h', cells[1])
        if index is None:
            continue
        register = 0x210 + 4 * (int(index[1], 16) - 0x2001)
        register += from_base.get(row.key, 0)
        assert row.place(Protocol.MODBUS).address == register, row.key
        seen.add(row.key)
    assert len(seen) >= {'Table 12:': 35, 'Table 13:': 6}[end], seen


def test_ranges_decimals_and_units_of_classic() -> None:
    seen = set()
    for cells in between(manual('M2'), 'ID\tName\tDescription', 'Table 1.'):
        row = by_name(cells[1]) if len(cells) >= 7 else None
        if row is None or row.labels or cells[6] != row_type(row):
            continue
        decimals = int(cells[4] or 0)
        low, high = limits(cells[3])
        if row.key != 'serial.address':  # Modbus has more addresses [C10]
            for bound, count in ((row.minimum, low), (row.maximum, high)):
                if count is not None:
                    assert bound is not None and bound * 10**decimals == count, row.key
        assert row.decimals == decimals, row.key
        assert row.unit == cells[5].replace('Unit*', ''), row.key
        seen.add(row.key)
    assert len(seen) >= 20, seen


def row_type(row: Parameter) -> str:
    """The type that [M2 table 1] prints for a parameter."""
    return 'Init' if row.stopped else 'Init/Run'


def limits(text: str) -> tuple[int | None, int | None]:
    """The raw counts of a range; ``None`` where it depends on the inverter."""
    found = re.fullmatch(r'(\d+) ?[\u2013-] ?(\d+|\(.*\))', text)
    if found is None:
        return None, None
    return int(found[1]), int(found[2]) if found[2].isdigit() else None


def test_inverter_status() -> None:
    seen = set()
    for cells in between(manual('M0'), '### 8.2', 'Table 19:'):
        if len(cells) < 4 or not cells[0].isdigit():
            continue
        entry = G2.inv_st(int(cells[0]))
        assert entry.text == cells[1]
        assert entry.requires_ack == (cells[2] == 'X')
        if cells[3] and entry.code:
            assert entry.description == cells[3].rstrip('.')
        seen.add(entry.code)
    assert seen == {*range(41), 45, 46, 47}


def test_inverter_status_of_old_firmware() -> None:
    seen = set()
    for cells in between(manual('M2'), 'Value\tDisplay Text', 'Table 3 Values'):
        if cells[0].isdigit():
            assert G2.inv_st(int(cells[0])).old_text == cells[1]
            seen.add(int(cells[0]))
    assert seen == set(range(48))


def test_names_and_types_of_the_settings() -> None:
    path = SHARED / 'design' / 'parameter_names.csv'
    if not path.exists():
        pytest.skip('the list of names is not beside this clone')
    with path.open(encoding='utf-8', newline='') as stream:
        listed = {line['ros_parameter']: line for line in csv.DictReader(stream)}
    types = {'double': float, 'integer': int, 'string': str, 'bool': bool}
    seen = 0
    for key, row in G2.items():
        if key in listed:
            assert row.name == listed[key]['manual_name']
            assert row.group == listed[key]['group']
            assert row.kind is types[listed[key]['type']], key
            seen += 1
        else:
            assert row.group in ('Status', 'Fieldbus'), key
    assert seen >= 35
