# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The ends of each setting, read from the text of the manuals: places, ranges, steps and codes.

No number here is one of the driver's: of its tables there are only the names of the settings and,
of the MOVITRAC, the wording of labels, some of which have a unit or their code besides. A test that
needs the ends is skipped where the manuals are not beside the clone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
import functools
import re
from typing import TypeAlias

from support import manual_g2, manual_movitrac

Value: TypeAlias = float | int | str | bool

#: The greatest number of a type, where no range is printed [C21], or it depends on the inverter
#: [C34]. None of these settings has a sign on Modbus, so that the least is 0 on every bus [C23].
_MOST = {'UINT16': 0xFFFF, 'UINT32': 0xFFFFFFFF, 'SINT16': 0x7FFF}


@dataclass(frozen=True)
class Ends:
    """
    What is printed of one setting on one bus.

    :ivar places: its registers, its Classic id, or its index.
    :ivar counts: both ends of a number, or each label in the order of print; and what they are on
        the bus.
    :ivar step: of a number, at its low end.
    :ivar beyond: one step below and above, and half a step from the low end; or what is no label.
    :ivar long: it has the 8-byte format of a MOVITRAC.
    """

    name: str
    places: tuple[int, ...]
    counts: Mapping[Value, int]
    step: float | None
    beyond: tuple[Value, ...]
    unit: str = ''
    stopped: bool = False
    long: bool = False

    @property
    def low(self) -> Value:
        return next(iter(self.counts))

    @property
    def high(self) -> Value:
        return list(self.counts)[-1]

    def words(self, value: Value) -> tuple[int, ...]:
        """An end or a label in the registers of a G2, the low word first."""
        return tuple(self.counts[value] >> 16 * at & 0xFFFF for at in range(len(self.places)))

    def data(self, value: Value) -> str:
        """An end or a label in a frame of a MOVITRAC [M4 §3.1, §3.3]."""
        count = self.counts[value]
        return ''.join(f'0{digit}' for digit in f'{count:08x}') if self.long else f'{count:08}'


#: What :class:`Ends` has of a range: counts, step and what is beyond.
_Range: TypeAlias = tuple[Mapping[Value, int], float | None, tuple[Value, ...]]


def _number(
    kind: type[float] | type[int], low: Fraction, high: Fraction, steps: list[Fraction],
    count: Fraction,
) -> _Range:
    """The range of a number, with its steps from the low end on, and what one count is."""
    beyond = [low - steps[0], high + steps[-1]]
    if kind is float:
        beyond.append(low + steps[0] / 2)
    counts = {kind(end): int(end / count) for end in (low, high)}
    return counts, float(steps[0]), tuple(kind(cell) for cell in beyond)


def _list(labels: Mapping[int, str]) -> _Range:
    """The range of what has a label for each count: a switch, one of some numbers, or a text."""
    texts = list(labels.values())
    if texts in (['OFF', 'ON'], ['Off', 'On'], ['No', 'Yes']):
        return dict(zip((False, True), labels, strict=True)), None, ()
    if all(re.fullmatch(r'-?\d+', text) for text in texts):
        numbers = [int(text) for text in texts]
        low, high = min(numbers), max(numbers)
        return dict(zip(numbers, labels, strict=True)), None, (low - 1, low + 1, high + 1)
    return {text: count for count, text in labels.items()}, None, ('None such',)


@functools.cache
def of_g2(protocol: str, dialect: str = '2.03') -> Mapping[str, Ends]:
    """
    The settings that a G2 has on one bus, by name.

    Places, types and steps are those of [M0 table 2, 4], ranges and units those of [M2 table 1];
    the scaled groups have their default scaling [M0 §8.3]. CANopen has the numbers of Modbus.
    """
    classic, modbus = (
        {line.parameters[0].key: line for line in manual_g2.lines_of(table)} for table in (2, 4)
    )
    old = {cells[0]: cells[3:] for cells in manual_g2.rows_of_old_manual()}
    found = {}
    for key, line in (classic if protocol == 'classic' else modbus).items():
        id_ = classic[key].cells[0]
        if key.startswith('status.') or (dialect == '5.0' and id_ not in old):
            continue
        place, type_, *scaling = line.cells
        printed, decimals, unit, when = old.get(id_, [''] * 4)
        places = tuple(int(number, 16) for number in re.findall(r'E?([0-9A-F]{4})h?', place))
        if type_ == 'ENUM':
            labels = manual_g2.labels_of(line.parameters[0], line)
            known = re.findall(r'= (\d+)', printed)
            if dialect == '5.0' and known:
                labels = {code: label for code, label in labels.items() if str(code) in known}
            range_ = _list(labels)
        else:
            count = _count_of(scaling)
            # whole numbers are those that no bus divides
            whole = not any('/' in cell for row in (classic, modbus) for cell in row[key].cells[2:])
            low, high = manual_g2.counts_of(printed)
            old_count = Fraction(1, 10 ** int(decimals or 0))
            if key == 'serial.address':
                low, high = manual_g2.addresses_on(protocol)
            # the least of (I-magn + 1)
            least = old_count if '+ 1' in printed else (low or 0) * old_count
            most = _MOST[type_] * count if high is None else high * old_count
            range_ = _number(int if whole else float, least, most, [count], count)
        if not printed and 'Hz' in ''.join(scaling):
            unit = 'Hz'
        found[key] = Ends(key, places, *range_, unit, when == 'Init')
    return found


def _count_of(scaling: list[str]) -> Fraction:
    """What one count is, by the column for scaling of [M0 table 2, 4]."""
    divided = re.search(r'/10 <sup>(\d)|/(\w+Scl)', ''.join(scaling))
    if divided is None:
        return Fraction(1)
    digits, scale = divided.groups()
    return Fraction(1, 10 ** int(digits)) if digits else manual_g2.default_of(scale)


@functools.cache
def of_movitrac() -> Mapping[str, Ends]:
    """The settings of a MOVITRAC, by name [M4 §4]; one count is 0.01 or, of a long one, 1."""
    found = {}
    for line in manual_movitrac.lines():
        row = manual_movitrac.BY_INDEX[line.index]
        only_read = 'W' not in line.access or line.index in manual_movitrac.ONLY_READ
        if only_read or row.key.startswith('fieldbus.'):
            continue
        long = line.format == '8-byte'
        if row.labels:
            labels = manual_movitrac.labels_of(line)
            if not all(label.isdigit() for label in labels.values()):
                labels = {code: row.labels[code] for code in labels}
            range_ = _list({100 * code: label for code, label in sorted(labels.items())})
        else:
            spans = manual_movitrac.spans_in(manual_movitrac.meaning_of(line))
            count = Fraction(1) if long else Fraction(1, 100)
            steps = [step or count for _, _, step in spans]
            range_ = _number(int if long else float, spans[0][0], spans[-1][1], steps, count)
        found[row.key] = Ends(row.key, (line.index,), *range_, long=long)
    return found
