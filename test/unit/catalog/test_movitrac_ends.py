# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of the MOVITRAC 31 against a second, independent copy of [M4]: ends and labels."""

from __future__ import annotations

from collections import Counter
import re

from support.movitrac_ends import COUNTS, ENDS, Ends, Value

from nfo_sinus_driver.catalog import load_family

MOVITRAC = load_family('movitrac31')


def refusal(ends: Ends, value: Value) -> str:
    """Return what the catalog says against a value; ``''``: it takes it."""
    try:
        MOVITRAC[ends.name].encode(value, 'movitrac')
    except ValueError as refused:
        return str(refused)
    return ''


def numbers(text: str) -> set[float]:
    """Return the numbers in a reason."""
    return {float(number) for number in re.findall(r'-?\d+(?:\.\d+)?(?:e-?\d+)?', text)}


def wrong(ends: Ends) -> list[str]:
    """Return what of a setting is not as the manual has it."""
    row = MOVITRAC[ends.name]
    found = [] if row.at('movitrac').index == ends.index else ['index']
    number = f'{ends.number}, index' if ends.number else 'Index'
    if not row.description.startswith(f'{number} {ends.index}: '):
        found.append(f'description {row.description}')
    for value, raw in ((ends.low, ends.low_raw), (ends.high, ends.high_raw), *ends.codes):
        data = row.encode(value, 'movitrac')
        back = row.decode(data, 'movitrac')
        if (data.hex(), back, type(back)) != (raw, value, type(value)):
            found.append(f'{value!r} is {data.hex()}, and back {back!r}')
    for value in ends.neighbours or ():
        if row.decode(row.encode(value, 'movitrac'), 'movitrac') != value:
            found.append(f'{value!r} does not come back')
    for value, bound in ((ends.below, ends.low), (ends.above, ends.high)):
        if value is None:
            continue
        said = refusal(ends, value)
        if isinstance(bound, str):
            named = all(str(label) in said for label, _ in ends.codes)
        else:
            named = bound in numbers(said)
        if not said or not named:
            found.append(f'{value!r}: {said!r}')
    if ends.between is not None and not numbers(refusal(ends, ends.between)) >= {*ends.neighbours}:
        found.append(f'{ends.between!r}: {refusal(ends, ends.between)!r}')
    return found


def test_the_same_settings_and_no_others() -> None:
    assert Counter(ends.card for ends in ENDS) == COUNTS
    assert {ends.name for ends in ENDS} == {row.key for row in MOVITRAC.settings}


def test_both_ends_and_every_label_there_and_back_and_nothing_beyond() -> None:
    assert {ends.name: found for ends in ENDS if (found := wrong(ends))} == {}


def test_a_wrong_row_of_the_copy_would_be_noticed() -> None:
    ramp = next(ends for ends in ENDS if ends.name == 'ramp.t11_up')
    assert wrong(ramp._replace(index=26)) and wrong(ramp._replace(high_raw='00200001'))
    assert wrong(ramp._replace(above=1000.0)) and wrong(ramp._replace(between=0.05))
