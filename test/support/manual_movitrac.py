# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What [M4] prints of the MOVITRAC 31.

The list of chapter 4 is read by a program here, and by a person for the tables; the conversion list
of the appendix is a third opinion on indices and P numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
import functools
import re
from string import ascii_lowercase

from nfo_sinus_driver.catalog import Access, load_family
from support.manual_text import Fact, manual

FAMILY = load_family('movitrac31')
#: The row of each index; a digit of it has a row of its own after it.
BY_INDEX = {row.at('movitrac').index: row for row in reversed(FAMILY.values())}
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
#: How a number stands in four or eight bytes, and what one count is [M4 §3].
FORMATS = {
    '4-byte BCD': ('32', Fraction(1, 100)),
    '4-byte binary': ('32_be', Fraction(1)),
    '8-byte': ('32_hb', Fraction(1)),
}
#: Of these the unit belongs to the labels, or is uncertain [C78].
NO_UNIT = {272, 273, 298, 299, 300, 301}
UNITS = {'1/min': 'rpm', '%IN': '%', '% IN': '%', 'kHz': ''}
#: The manual lets a master write them; how a sign stands is not known, and by some the motor turns.
ONLY_READ = {98, 254, 256, 257, 258, 723} | {1000, 1001, 1002, 1004, 1010, 1011, 1012}
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
    #: As printed here or above: one cell is that of all rows until the next one.
    format: str
    access: str
    meaning: str


@functools.cache
def lines() -> list[Line]:
    """The parameter list of chapter 4."""
    text = manual(4)
    start = text.index(next(line for line in text if line.startswith('DISPLAY VALUES')))
    end = next(number for number, line in enumerate(text) if line.startswith('Conversion list'))
    found: list[Line] = []
    format_ = ''
    for line in text[start:end]:
        cells = [cell.strip() for cell in line.split('\t')]
        access = [cell for cell in cells if re.fullmatch(r'R ?/ ?[W-]', cell)]
        if re.match(r'(\d{3}|-)\t', line) and re.fullmatch(r'\d+', cells[2]):
            before, rest = cells[4 : cells.index(access[0])], cells[cells.index(access[0]) + 1 :]
            format_ = ''.join(before) or format_
            meaning = ' '.join(filter(None, rest))
            found.append(Line(*cells[:2], int(cells[2]), cells[3], format_, access[0], meaning))
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
    return meaning_of(next(other for other in lines() if other.number == number))


def typed(printed: str) -> str:
    """A text without subscripts and signs of the typesetter."""
    for sign, meant in SIGNS.items():
        printed = printed.replace(sign, meant)
    return re.sub(' +', ' ', re.sub(r'[{}$_]', '', printed)).strip()


def plain(printed: str) -> str:
    """The same without blanks, which are others in the names of the list."""
    return typed(printed).replace(' ', '')


def spans_in(text: str) -> list[tuple[Fraction, Fraction, Fraction | None]]:
    """The ranges that a text prints, and the step of each."""
    number = r'([+-]?\d+(?:\.\d+)?)'
    pattern = rf'{number} ?\.\.\.(?:0\.\.\.)? ?{number}(?:[a-zA-Z]*\s+Step\s+{number})?'
    return [
        (Fraction(low), Fraction(high), Fraction(step) if step else None)
        for low, high, step in re.findall(pattern, text.split('=')[0])
    ]


def labels_of(line: Line) -> dict[int, str]:
    """The labels that are printed of a row; terminals of one kind share a list."""
    text = meaning_of(line)
    group = {'60': '600', '61': '611'}.get(line.number[:2])
    if group is not None:
        text = '\n'.join(other.meaning for other in lines() if other.number[:2] == line.number[:2])
    return labels_in(text)


def labels_in(text: str) -> dict[int, str]:
    """The labels that a text prints."""
    parts = re.split(r'\b(\d+)(?:\.00)? ?= ?', text)
    # the text recognition has taken some capital I for a small l
    return {
        int(code): typed(label.replace('\n', ' '))
        .replace('lxt', 'Ixt').replace('I max', 'Imax').replace(' ≠ ', '≠')
        .removesuffix('(depends on S1)').rstrip(' /')
        for code, label in zip(parts[1::2], parts[2::2], strict=True)
    }


def list_of_movitrac() -> Iterator[Fact]:
    """Number, name, unit and access of each row; its labels, or its range and steps."""
    yield 'indices', {line.index for line in lines()}, set(BY_INDEX)
    for line in lines():
        row = BY_INDEX[line.index]
        yield f'{row.key} hexadecimal', int(line.hexadecimal, 16), line.index
        name, unit = re.fullmatch(r'(.*?)(?:\[([^]]*)\])?', line.name).groups('')
        number = rf'P(\d\d\d-P)?{line.number}\b.*i' if line.number != '-' else 'I'
        if line.index == 13 and line.number == '031':
            number = 'P030-P032.*i'
        described = re.search(rf'{number}ndex {line.index}: .', row.description)
        yield f'{row.key} description', True, bool(described)
        if line.index in SEVERAL:
            yield f'{row.key} name', SEVERAL[line.index], row.name
        else:
            yield f'{row.key} name', plain(NAMES.get(line.index, name)), plain(row.name)
        if line.index not in NO_UNIT:
            unit = re.sub(r'[$ _{}]', '', unit)
            yield f'{row.key} unit', UNITS.get(unit, unit), row.unit
        writable = 'W' in line.access and line.index not in ONLY_READ
        yield f'{row.key} access', Access.READ_WRITE if writable else Access.READ, row.access
        if writable:
            # what is only read are words of bits, too
            place = row.at('movitrac')
            ours = place.number.name.lstrip(ascii_lowercase), place.factor
            yield f'{row.key} format', FORMATS[line.format], ours
        if row.labels:
            # what is reserved has its code beside it, and a frequency its unit
            ours = {
                code: re.sub(r' \(\d+\)$| kHz$', '', label)
                for code, label in row.labels.items()
            }
            yield f'{row.key} labels', labels_of(line), ours
        elif line.index not in NO_RANGE:
            spans = spans_in(meaning_of(line))
            if line.index in (254, 256, 257, 258):
                # nothing between -10 and 10, too
                (low, *_), (_, high, step) = spans
                spans = [(low, high, step)]
            steps = [(low, step) for low, _, step in spans if step is not None]
            yield f'{row.key} steps', steps, list(row.steps)
            assert spans or row.key.startswith('status.'), row.key
            ends = (spans[0][0], spans[-1][1]) if spans else (None, None)
            yield f'{row.key} range', ends, (row.minimum, row.maximum)
    for card in (20, 21):
        row = FAMILY[f'status.option_x{card}']
        printed = (line.split('\t') for line in manual(4) if f'Option at X{card}: Bit' in line)
        byte, _, _, labels, *_ = next(cells for cells in printed if cells[0][:4] == 'Byte')
        yield f'{row.key} labels', labels_in(labels), dict(row.labels)
        # byte 0 comes first [C72]
        three = bytes([0] * int(byte.removeprefix('Byte ')) + [3]).ljust(4, b'\0')
        yield f'{row.key} byte', 3, row.at('movitrac').number.decode(three)


def conversion_list_of_movitrac() -> Iterator[Fact]:
    """The list of the appendix, from indices to P numbers."""
    text = '\n'.join(manual(4))
    text = text[text.index('Conversion list Index → Parameter:') :]
    triples = re.findall(r'(?<![\d.])(\d+)\t([0-9A-F]+)\t([^\t\n]*)', text)
    yield 'indices', {int(index) for index, _, _ in triples}, set(BY_INDEX)
    numbers: dict[int, set[str]] = {}
    for line in lines():
        numbers.setdefault(line.index, set()).add(line.number)
    for index, (code, number) in {int(first): rest for first, *rest in triples}.items():
        yield f'index {index}', int(code, 16), index
        printed = set(re.findall(r'\b\d{3}\b', number)) or {'-'}
        yield f'numbers of {index}', printed, printed & numbers[index]


def faults_of_movitrac() -> Iterator[Fact]:
    """The faults of the fault memory."""
    text = '\n'.join(line.meaning for line in lines() if line.index in range(8, 13))
    pairs = re.findall(r'(\d+) = ([^=]*?)(?=\s+\d+(?:-86)? =|\n)', text + '\n')
    printed = {int(code): label.strip() for code, label in pairs}
    for code, label in printed.items():
        ours = FAMILY.status_codes.get(code + 100)
        listed = label if label != 'No function' and code else None
        yield f'fault {code}', listed, ours and ours.text
    listed = {code - 100 for code in FAMILY.status_codes if code >= 100}
    yield 'faults', listed, listed & set(printed)
