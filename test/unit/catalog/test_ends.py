# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The settings against second, independent copies of the manuals: ends, steps and labels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
import re
from typing import Any

import pytest
from support import movitrac_ends, parameter_ends
from support.addresses import packed

from nfo_sinus_driver.catalog import Parameter, Value, load_family

FAMILIES = {
    'sinus_g2': {ends.name: ends for ends in parameter_ends.ENDS},
    'movitrac31': {ends.name: ends for ends in movitrac_ends.ENDS},
}
SETTINGS = pytest.mark.parametrize('family', FAMILIES)


def refusal(row: Parameter, value: Value, protocol: str) -> str:
    """What the catalog says against a value; ``''``: it takes it."""
    try:
        row.encode(value, protocol)
    except ValueError as refused:
        return str(refused)
    return ''


def numbers(text: str) -> set[float]:
    """The numbers in a reason, without those of the name before it."""
    found = re.findall(r'-?\d+(?:\.\d+)?(?:e-?\d+)?', text.partition(': ')[2])
    return {float(number) for number in found}


def what_g2_prints(row: Parameter, ends: Any) -> Iterator[object]:
    """Where a setting of the G2 stands and what it is: printed and ours, one after the other."""
    modbus = row.addresses.get('modbus')
    yield from (ends.register, modbus and modbus.index)
    yield from (ends.classic, tuple(f'E{id_:04X}' for id_ in row.at('classic').numbers))
    # the unit of the process is the drive's choice: the catalog leaves it open [C12]
    yield from (ends.unit.replace('Unit', ''), row.unit)
    yield from (ends.stopped, row.stopped)
    yield from (ends.read_only, not row.is_setting)


def what_movitrac_prints(row: Parameter, ends: Any) -> Iterator[object]:
    yield from (ends.index, row.at('movitrac').index)
    number = f'{ends.number}, index' if ends.number else 'Index'
    yield from (f'{number} {ends.index}', row.description.partition(': ')[0])
    yield from (ends.card == '', row.option == '')


def wrong(family: str, ends: Any) -> list[object]:
    """What of a setting is not as the manual has it."""
    row = load_family(family)[ends.name]
    if family == 'sinus_g2':
        protocol = 'classic' if ends.register is None else 'modbus'
        pairs = list(what_g2_prints(row, ends))
        low, high = packed(*ends.low_words), packed(*ends.high_words)
        codes = [(label, packed(code)) for label, code in ends.codes]
        # the ranges of M2 are those of Classic in the first place
        refusing = {protocol} | ({'classic'} if 'M2' in ends.note else set())
    else:
        protocol, refusing = 'movitrac', {'movitrac'}
        pairs = list(what_movitrac_prints(row, ends))
        low, high = bytes.fromhex(ends.low_raw), bytes.fromhex(ends.high_raw)
        codes = [(label, bytes.fromhex(raw)) for label, raw in ends.codes]
    found: list[object] = [
        both for both in zip(pairs[::2], pairs[1::2], strict=True) if both[0] != both[1]
    ]
    if codes and len(codes) != len(row.labels):
        found.append(row.labels)
    for value, data in ((ends.low, low), (ends.high, high), *codes):
        back = row.decode(data, protocol)
        if (row.encode(value, protocol), back, type(back)) != (data, value, row.kind):
            found.append((value, data.hex(), back))
    for value in ends.neighbours or ():
        if row.decode(row.encode(value, protocol), protocol) != value:
            found.append((value, 'does not come back'))
    for value, bound in ((ends.below, ends.low), (ends.above, ends.high)):
        for one in refusing if value is not None else ():
            said = refusal(row, value, one)
            bounded = one != protocol or bound in numbers(said)
            named = all(str(label) in said for label, _ in codes) if codes else bounded
            if not said or not named:
                found.append((value, said))
    if ends.between is not None:
        said = refusal(row, ends.between, protocol)
        if not numbers(said) >= {*ends.neighbours}:
            found.append((ends.between, said))
    return found


@SETTINGS
def test_the_same_settings_and_no_others(family: str) -> None:
    cards = Counter(getattr(ends, 'card', '') for ends in FAMILIES[family].values())
    counts = {'sinus_g2': {'': 120}, 'movitrac31': movitrac_ends.COUNTS}
    assert cards == counts[family]
    assert {row.key for row in load_family(family).settings} == set(FAMILIES[family])


@SETTINGS
def test_both_ends_and_every_label_there_and_back_and_nothing_beyond(family: str) -> None:
    found = {name: wrong(family, ends) for name, ends in FAMILIES[family].items()}
    assert {name: mistakes for name, mistakes in found.items() if mistakes} == {}


def test_a_wrong_row_of_the_copy_would_be_noticed() -> None:
    ramp = FAMILIES['movitrac31']['ramp.t11_up']
    for changed in ({'index': 26}, {'high_raw': '00200001'}, {'above': 1000.0}, {'between': 0.05}):
        assert wrong('movitrac31', ramp._replace(**changed)), changed
    ramp = FAMILIES['sinus_g2']['control.accel']
    for changed in (
        *({'register': 0x27C}, {'classic': ('E001C',)}, {'unit': 'h'}, {'stopped': True}),
        *({'high_words': (0, 8)}, {'above': 499.0}, {'between': 5.0}),
    ):
        assert wrong('sinus_g2', replace(ramp, **changed)), changed
