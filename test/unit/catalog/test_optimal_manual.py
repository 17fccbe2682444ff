# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""The Optimal's tables against [M1]'s own text, where that lies beside the clone."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
import re

import pytest

from nfo_sinus_driver.catalog import Access, load_family
from nfo_sinus_driver.families.sinus_optimal.words import Control, Mode, Smode, Status

MANUALS = Path(__file__).resolve().parents[4] / 'shared' / 'manuals'
OPTIMAL = load_family('sinus_optimal')
#: What the scaling column says, as unit and factor.
SCALES = {
    'mA (A x 10^3)': ('A', '0.001'),
    'W (kW x 10 ³)': ('W', '1'),
    '1 x 10 ³': ('', '0.001'),
    'Hz x 10^1': ('Hz', '0.1'),
    'rpm': ('rpm', '1'),
    'h x 10 ² (one tick per every 36 s)': ('h', '0.01'),
}


@pytest.fixture(scope='module')
def lines() -> list[str]:
    """The manual, line by line."""
    found = sorted(MANUALS.glob('001_*.txt'))
    if not found:
        pytest.skip('M1 is not beside this clone')
    return found[0].read_text(encoding='utf-8').splitlines()


def between(lines: list[str], start: str, end: str) -> Iterator[list[str]]:
    """The rows between two lines, as cells."""
    first = next(number for number, line in enumerate(lines) if line.startswith(start))
    for line in lines[first:]:
        if line.startswith(end):
            return
        yield [cell.strip() for cell in line.split('\t')]


def registers(lines: list[str]) -> list[list[str]]:
    """Name, ADI, registers, type, scaling or coding, remark of each parameter."""
    table = between(lines, 'Parameter Name\tADI', 'Control from terminals and use')
    rows = [cells for cells in table if len(cells) > 4 and cells[1].isdigit()]
    return [[*cells, ''][:6] for cells in rows]


def test_registers(lines: list[str]) -> None:
    rows = registers(lines)
    assert len(rows) == len(OPTIMAL)
    for (name, adi, addresses, type_, coding, remark), row in zip(
        rows, OPTIMAL.values(), strict=True
    ):
        assert row.name == name.split(' (')[0]
        numbers = [int(number, 16) for number in re.findall(r'([0-9A-F]{4})h', addresses)]
        place = row.at('modbus')
        assert [*place.occupied[0], *place.occupied[-1]] == [numbers[0], numbers[-1]], name
        assert (numbers[0] - 0x210) // 4 + 1 == int(adi), name
        assert row.source.split('; ')[0] == f'M1 ADI {adi}', name
        assert place.codec.name.startswith(type_.lower()), name
        assert (remark == 'Read only') == (row.access in (Access.READ, Access.ACKNOWLEDGE)), name
        scaling = re.sub(r'\$|\\mathrm|[{}]', '', coding)
        scaling = re.sub(r'\\times|\u00d7', 'x', scaling)
        unit, factor = SCALES.get(scaling, ('', '1'))
        assert (row.unit, place.factor) == (unit, Fraction(factor)), name
        assert scaling in SCALES or row.group == 'Fieldbus', name


def test_codes_of_mode_and_smode(lines: list[str]) -> None:
    coding = {cells[0]: cells[4] for cells in registers(lines)}
    modes = {int(code): name for code, name in re.findall(r'(\d) = (\w+)', coding['MODE'])}
    assert {mode.value: mode.name for mode in Mode} == {
        code: name.upper() for code, name in modes.items()
    }
    printed = re.findall(r'([0-9A-F]+)h? = \w+', coding['SMODE (Command)'])
    assert {code.value for code in Smode} == {int(code, 16) for code in printed}


def status_codes(lines: list[str]) -> Iterator[tuple[int, str, str]]:
    """Each code, its text and its description; the last page has two tables side by side."""
    for cells in between(lines, 'Code\tText\tDescription', 'Control inverter using DriveControl'):
        if len(cells) == 4:
            cells = cells[1:]  # an empty cell, and once a stray 1 [C59]
        for first in range(0, len(cells) - 2, 3):
            code, text, description = cells[first : first + 3]
            if code.isdigit():
                yield int(code), text, description


def test_inverter_status(lines: list[str]) -> None:
    seen = []
    for code, text, description in status_codes(lines):
        entry = OPTIMAL.status_code(code)
        assert (entry.text, entry.description) == (text, description), code
        seen.append(code)
    assert sorted(seen) == list(range(64))


@pytest.mark.parametrize(
    ('title', 'bits'),
    [('Drive control bit field', Control), ('Drive status bit field', Status)],
)
def test_bits(lines: list[str], title: str, bits: type[Control] | type[Status]) -> None:
    end = {Control: 'Drive status bit field', Status: 'An example of communication'}[bits]
    seen = {}
    for cells in between(lines, title, end):
        if cells[0].isdigit():
            number, name, description = cells
            echo = re.search(r'bit (\d)', description)
            if echo and name == 'Not used':
                # both words number an echo by the bit of the control word
                name = f'echo {number if bits is Control else echo[1]}'
            seen[int(number)] = name.removesuffix(' cmd').upper().replace(' ', '_')
    assert sorted(seen) == list(range(16))
    used = {number: name for number, name in seen.items() if name != 'NOT_USED'}
    assert {bit.value.bit_length() - 1: bit.name for bit in bits} == used
