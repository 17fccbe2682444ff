# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The catalog against a second, independent copy of the manuals: both ends of every setting."""

from __future__ import annotations

import re

import pytest
from support.addresses import packed
from support.parameter_ends import ENDS, Ends

from nfo_sinus_driver.catalog import Access, Parameter, load_family

G2 = load_family('sinus_g2')
SETTINGS = pytest.mark.parametrize('ends', ENDS, ids=[ends.name for ends in ENDS])


def parameter(ends: Ends) -> tuple[Parameter, str]:
    """Return the catalog's row, and Modbus, or Classic for what Modbus lacks."""
    return G2[ends.name], 'classic' if ends.register is None else 'modbus'


def refusal(ends: Ends, value: float | int | str | bool, protocol: str) -> str:
    """Return what the catalog says against a value."""
    with pytest.raises(ValueError) as refused:
        G2[ends.name].encode(value, protocol)
    return str(refused.value)


def test_the_same_settings_and_no_others() -> None:
    groups = {ends.name.partition('.')[0] for ends in ENDS}
    settings = {key for key in G2 if key.partition('.')[0] in groups}
    assert settings == {ends.name for ends in ENDS}
    assert len(ENDS) == len(settings) == 120


@SETTINGS
def test_where_it_stands(ends: Ends) -> None:
    row, protocol = parameter(ends)
    if ends.register is None:
        assert 'modbus' not in row.addresses
    else:
        assert row.at('modbus').index == ends.register
    assert row.at(protocol).codec.size == 2 * ends.words
    assert tuple(f'E{id_:04X}' for id_ in row.at('classic').numbers) == ends.classic


@SETTINGS
def test_what_it_is(ends: Ends) -> None:
    row, _ = parameter(ends)
    assert row.kind is type(ends.low)
    # the unit of the process is the drive's choice: the catalog leaves it open [C12]
    assert row.unit == ends.unit.replace('Unit', '')
    assert row.stopped == ends.stopped
    assert row.access is (Access.READ if ends.read_only else Access.READ_WRITE)


@SETTINGS
def test_both_ends_there_and_back(ends: Ends) -> None:
    row, protocol = parameter(ends)
    for value, words in ((ends.low, ends.low_words), (ends.high, ends.high_words)):
        assert len(words) == ends.words
        assert row.encode(value, protocol) == packed(*words)
        back = row.decode(packed(*words), protocol)
        assert back == value
        assert type(back) is type(value)


@SETTINGS
def test_one_step_beyond_each_end(ends: Ends) -> None:
    _, protocol = parameter(ends)
    for value in (ends.below, ends.above):
        if value is not None:
            assert refusal(ends, value, protocol)
            # the ranges of M2 are those of Classic in the first place
            assert 'M2' not in ends.note or refusal(ends, value, 'classic')


@pytest.mark.parametrize('ends', [pytest.param(e, id=e.name) for e in ENDS if e.neighbours])
def test_between_two_steps(ends: Ends) -> None:
    assert ends.between is not None
    assert ends.neighbours is not None
    row, protocol = parameter(ends)
    said = re.findall(r'-?\d+(?:\.\d+)?', refusal(ends, ends.between, protocol).partition(': ')[2])
    assert {float(number) for number in said} >= set(ends.neighbours)
    for neighbour in ends.neighbours:
        assert row.decode(row.encode(neighbour, protocol), protocol) == neighbour


@pytest.mark.parametrize('ends', [pytest.param(e, id=e.name) for e in ENDS if e.codes])
def test_every_label(ends: Ends) -> None:
    row, protocol = parameter(ends)
    for label, code in ends.codes:
        assert row.encode(label, protocol) == packed(code)
        assert row.decode(packed(code), protocol) == label
    assert {(label, code) for code, label in row.labels.items()} == set(ends.codes)
