# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""
The tables of the MOVITRAC against the manual's own text, where that lies beside the clone.

The list of chapter 4 is read by a program here, and by a person for the tables; the conversion list
of the appendix is a third opinion on indices and P numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
import functools
import re

from manual_text import manual

from nfo_sinus_driver.catalog import Access, Parameter, load_family

FAMILY = load_family('movitrac31')
BY_INDEX = {row.at('movitrac').index: row for row in FAMILY.values()}
#: Several rows of the manual are bits of one index; these have a name of their own [C73].
SEVERAL = {13: 'Status binary inputs and outputs', 237: 'Option at X20, option at X21'}
#: What is misprinted, with the reading that is followed [C74].
NAMES = {
    601: 'Setpoint description PO1',
    602: 'Setpoint description PO2',
    603: 'Setpoint description PO3',
    618: 'PI3 Actual value (hex)',
}
REFERENCES = {'286': '329'}
#: Of these the unit belongs to the labels, or is uncertain [C78].
NO_UNIT = {272, 273, 298, 299, 300, 301}
UNITS = {'1/min': 'rpm', '%IN': '%', '% IN': '%', 'kHz': ''}
#: The manual lets a master write them; how a sign stands is not known, nor tried are 8 bytes.
ONLY_READ = {98, 254, 256, 257, 258, 723} | {263, 265, 302, 304, *range(1000, 1005)}
ONLY_READ |= {1010, 1011, 1012}
#: Words, and what is printed as a list of codes but has its texts in status_codes.csv.
NO_RANGE = {8, 9, 10, 11, 12, 13, 197, 214, 215, 237, 281, 284}
SIGNS = {'\\times': '\N{MULTIPLICATION SIGN}', '\\pm': '±', '\\neq': '≠'}
#: What stands above the rows of a chapter or page, and numbers of figures.
HEADING = re.compile(r'[A-Z /0]+|Par\. No\..*|dec\thex.*|\d{5}A(EN|XX)')


@dataclass
class Line:
    """One row of the list: what is printed in it, and in the rows below that belong to it."""

    number: str
    name: str
    index: int
    hexadecimal: str
    access: str
    meaning: str


@functools.cache
def lines() -> list[Line]:
    """The parameter list of chapter 4."""
    text = manual('M4')
    start = text.index(next(line for line in text if line.startswith('DISPLAY VALUES')))
    end = next(number for number, line in enumerate(text) if line.startswith('Conversion list'))
    found: list[Line] = []
    for line in text[start:end]:
        cells = [cell.strip() for cell in line.split('\t')]
        access = [cell for cell in cells if re.fullmatch(r'R ?/ ?[W-]', cell)]
        if re.match(r'(\d{3}|-)\t', line) and re.fullmatch(r'\d+', cells[2]):
            rest = cells[cells.index(access[0]) + 1 :]
            meaning = ' '.join(filter(None, rest))
            found.append(Line(*cells[:2], int(cells[2]), cells[3], access[0], meaning))
        elif found and not HEADING.fullmatch(line.strip()):
            found[-1].meaning += '\n' + ' '.join(cell for cell in cells if cell not in access)
    return found


def meaning_of(line: Line) -> str:
    """What is printed of a row, by itself or where it refers to."""
    reference = re.match(r'→ N[or]\.(\d+)', line.meaning)
    if reference is None:
        text = line.meaning.replace('$', '').replace('\\dots', '...').replace('10 ⁸ -1', '99999999')
        return text.replace('-2^{31} ', '-2147483648').replace('2^{31} - 1', '2147483647')
    number = REFERENCES.get(reference[1], reference[1])
    return meaning_of(next(one for one in lines() if one.number == number))


def plain(printed: str) -> str:
    """A text without subscripts and signs of the typesetter, in a shape that can be compared."""
    for sign, meant in SIGNS.items():
        printed = printed.replace(sign, meant)
    return re.sub(r'[{}$_ ]', '', printed)


def test_every_index_of_the_list_is_there_once() -> None:
    assert {line.index for line in lines()} == set(BY_INDEX)
    assert len(BY_INDEX) == 315
    assert len({line.index for line in lines() if 'W' in line.access}) == 239
    for line in lines():
        assert int(line.hexadecimal, 16) == line.index


def test_numbers_names_units_and_access() -> None:
    for line in lines():
        row = BY_INDEX[line.index]
        name, unit = re.fullmatch(r'(.*?)(?:\[([^]]*)\])?', line.name).groups('')  # type: ignore[union-attr]
        number = rf'P(\d\d\d-P)?{line.number}\b' if line.number != '-' else 'Index'
        if line.index == 13 and line.number == '031':
            number = 'P030-P032'
        assert re.search(number, row.description), row.key
        assert f'ndex {line.index}: ' in row.description
        if line.index in SEVERAL:
            assert row.name == SEVERAL[line.index]
        else:
            assert plain(row.name) == plain(NAMES.get(line.index, name)), row.key
        if line.index not in NO_UNIT:
            unit = re.sub(r'[$ _{}]', '', unit)
            assert row.unit == UNITS.get(unit, unit), row.key
        writable = 'W' in line.access and line.index not in ONLY_READ
        assert row.access is (Access.READ_WRITE if writable else Access.READ), row.key


def spans_in(text: str) -> list[tuple[Fraction, Fraction, Fraction | None]]:
    """The ranges that a text prints, and the step of each."""
    number = r'([+-]?\d+(?:\.\d+)?)'
    pattern = rf'{number} ?\.\.\.(?:0\.\.\.)? ?{number}(?:[a-zA-Z]*\s+Step\s+{number})?'
    return [
        (Fraction(low), Fraction(high), Fraction(step) if step else None)
        for low, high, step in re.findall(pattern, text.split('=')[0])
    ]


def test_ranges_and_steps() -> None:
    for line in lines():
        row = BY_INDEX[line.index]
        if row.labels or line.index in NO_RANGE:
            continue
        spans = spans_in(meaning_of(line))
        if row.key.startswith('status.') and not spans:
            assert row.minimum is None, row.key
            continue
        if line.index in (254, 256, 257, 258):
            # nothing between -10 and 10, too
            (low, *_), (_, high, step) = spans
            spans = [(low, high, step)]
        assert (row.minimum, row.maximum) == (spans[0][0], spans[-1][1]), row.key
        steps = [(low, step) for low, _, step in spans if step is not None]
        assert list(row.steps) == steps, row.key


def labels_of(line: Line) -> dict[int, str]:
    """The labels that are printed of a row; terminals of one kind share a list."""
    text = meaning_of(line)
    group = {'60': '600', '61': '611'}.get(line.number[:2])
    if group is not None:
        text = '\n'.join(one.meaning for one in lines() if one.number[:2] == line.number[:2])
    parts = re.split(r'\b(\d+)(?:\.00)? ?= ?', text)
    return {int(code): label for code, label in zip(parts[1::2], parts[2::2], strict=True)}


def test_labels() -> None:
    checked = 0
    for line in lines():
        row: Parameter = BY_INDEX[line.index]
        if not row.labels:
            continue
        printed = labels_of(line)
        assert set(printed) == set(row.labels), row.key
        for code, label in row.labels.items():
            # what is reserved has its code beside it, and a frequency its unit
            label = re.sub(r' \(\d+\)$| kHz$', '', label)
            text = plain(printed[code].replace('\n', ' '))
            # the text recognition has taken some capital I for a small l
            text = text.replace('lxt', 'Ixt').removesuffix('(dependsonS1)').rstrip('/')
            assert text == plain(label), (row.key, code)
        checked += 1
    assert checked == sum(bool(row.labels) for row in FAMILY.values())


def test_the_conversion_list_agrees() -> None:
    text = '\n'.join(manual('M4'))
    text = text[text.index('Conversion list Index → Parameter:') :]
    triples = re.findall(r'(?<![\d.])(\d+)\t([0-9A-F]+)\t([^\t\n]*)', text)
    found = {int(index): (int(code, 16), number) for index, code, number in triples}
    assert set(found) == set(BY_INDEX)
    numbers: dict[int, set[str]] = {}
    for line in lines():
        numbers.setdefault(line.index, set()).add(line.number)
    for index, (code, number) in found.items():
        assert code == index
        told = set(re.findall(r'\b\d{3}\b', number))
        if told:
            assert told <= numbers[index], index
        else:
            assert numbers[index] == {'-'}, index


def test_faults() -> None:
    text = '\n'.join(line.meaning for line in lines() if line.index in range(8, 13))
    pairs = re.findall(r'(\d+) = ([^=]*?)(?=\s+\d+(?:-86)? =|\n)', text + '\n')
    printed = {int(code): label.strip() for code, label in pairs}
    named = {code: label for code, label in printed.items() if label != 'No function' and code}
    listed = {code - 100: row.text for code, row in FAMILY.status_codes.items() if code >= 100}
    assert named == listed


