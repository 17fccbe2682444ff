# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What [M1] prints of the NFO Sinus Optimal."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
import re

from nfo_sinus_driver.catalog import Access, load_family
from nfo_sinus_driver.families.sinus_optimal.words import ControlWord, Mode, Smode, Status
from support.manual_text import Fact, between, manual

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


def registers_of_optimal() -> Iterator[Fact]:
    """Name, ADI, registers, type, scaling or coding and remark of each parameter."""
    table = between(manual(1), 'Parameter Name\tADI', 'Control from terminals and use')
    rows = [[*cells, ''][:6] for cells in table if len(cells) > 4 and cells[1].isdigit()]
    yield 'rows', len(rows), len(OPTIMAL)
    for cells, row in zip(rows, OPTIMAL.values(), strict=False):
        name, adi, addresses, type_, coding, remark = cells
        place = row.at('modbus')
        numbers = [int(number, 16) for number in re.findall(r'([0-9A-F]{4})h', addresses)]
        yield name, name.split(' (')[0], row.name
        ours = [*place.occupied[0], *place.occupied[-1]]
        yield f'{name} registers', [numbers[0], numbers[-1]], ours
        yield f'{name} ADI', f'M1 ADI {adi}', row.source.split('; ')[0]
        yield f'{name} number', int(adi), (numbers[0] - 0x210) // 4 + 1
        yield f'{name} type', type_.lower(), place.codec.name.partition('_')[0]
        reads = row.access in (Access.READ, Access.ACKNOWLEDGE)
        yield f'{name} access', remark == 'Read only', reads
        scaling = re.sub(r'\$|\\mathrm|[{}]', '', coding)
        scaling = re.sub(r'\\times|\u00d7', 'x', scaling)
        unit, factor = SCALES.get(scaling, ('', '1'))
        yield f'{name} scaling', (unit, Fraction(factor)), (row.unit, place.factor)
        yield f'{name} coding', True, scaling in SCALES or row.group == 'Fieldbus'
    codings = {cells[0]: cells[4] for cells in rows}
    modes = {int(code): name.upper() for code, name in re.findall(r'(\d) = (\w+)', codings['MODE'])}
    yield 'MODE', modes, {mode.value: mode.name for mode in Mode}
    printed = re.findall(r'([0-9A-F]+)h? = \w+', codings['SMODE (Command)'])
    yield 'SMODE', {int(code, 16) for code in printed}, {code.value for code in Smode}


def codes_of_optimal() -> Iterator[Fact]:
    """Each status code, its text and description; the last page has two tables side by side."""
    seen = []
    end = 'Control inverter using DriveControl'
    for cells in between(manual(1), 'Code\tText\tDescription', end):
        if len(cells) == 4:
            cells = cells[1:]  # an empty cell, and once a stray 1 [C59]
        for first in range(0, len(cells) - 2, 3):
            code, text, description = cells[first : first + 3]
            if code.isdigit():
                entry = OPTIMAL.status_code(int(code))
                yield f'code {code}', (text, description), (entry.text, entry.description)
                seen.append(entry.code)
    yield 'codes', sorted(seen), sorted(OPTIMAL.status_codes)


def bits_of_optimal() -> Iterator[Fact]:
    """The bits of the control word and of the status word."""
    for bits, title, end in (
        (ControlWord, 'Drive control bit field', 'Drive status bit field'),
        (Status, 'Drive status bit field', 'An example of communication'),
    ):
        ours = {bit.value.bit_length() - 1: bit.name for bit in bits}
        for cells in between(manual(1), title, end):
            if cells[0].isdigit():
                number, name, description = cells
                echo = re.search(r'bit (\d)', description)
                if echo and name == 'Not used':
                    # both words number an echo by the bit of the control word
                    name = f'echo {number if bits is ControlWord else echo[1]}'
                printed = name.removesuffix(' cmd').upper().replace(' ', '_')
                yield f'{title} {number}', printed, ours.pop(int(number), 'NOT_USED')
        yield title, {}, ours
