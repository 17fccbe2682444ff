# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What of a product runs before every commit: each value, and each law over each kind."""

from __future__ import annotations

import itertools
from pathlib import Path
import re
import sys

from hypothesis import given, strategies as st
from support.chosen import KINDS, NEEDED, chosen
from support.rig import CONNECTIONS

sys.path.append(str(Path(__file__).resolve().parents[2] / 'mutants'))
from mutants import MUTANTS

LAWS = Path(__file__).resolve().parents[1] / 'drive' / 'test_laws.py'
SIZES = st.lists(st.integers(1, 6), min_size=1, max_size=3)


@given(SIZES)
def test_each_value_of_each_axis_has_a_test_and_few_are_more(sizes: list[int]) -> None:
    cells = [
        (f'law[{cell}]', {f'axis{at}': value for at, value in enumerate(cell)})
        for cell in itertools.product(*map(range, sizes))
    ]
    names = chosen(cells)
    met = [params for name, params in cells if name in names]
    for at, size in enumerate(sizes):
        assert {params[f'axis{at}'] for params in met} == set(range(size))
    assert len(met) <= sum(sizes)


def connections_of(law: str) -> set[str]:
    """Return those over which a law runs."""
    cells = [(f'{law}[{connection}]', {'connection': connection}) for connection in CONNECTIONS]
    names = chosen(cells)
    return {params['connection'] for name, params in cells if name in names}


@given(st.text(max_size=9))
def test_each_law_is_tested_over_each_kind_of_connection(law: str) -> None:
    assert connections_of(f'test/unit/drive/test_laws.py::{law}') >= set(KINDS)
    # those of other files in turn
    assert len(connections_of(law) & set(KINDS)) == len(KINDS) / 2


def test_each_connection_is_met_by_several_laws() -> None:
    found = re.findall(r'^def (test_\w+)', LAWS.read_text(encoding='utf-8'), re.MULTILINE)
    laws = [f'test/unit/drive/test_laws.py::{name}' for name in found]
    cells = [
        (f'{law}[{connection}]', {'connection': connection})
        for law in laws
        for connection in CONNECTIONS
    ]
    names = chosen(cells)
    for connection in CONNECTIONS:
        assert sum(name.endswith(f'[{connection}]') for name in names) > 2, connection


def test_what_is_needed_is_needed_by_a_mutant() -> None:
    assert set(NEEDED.values()) <= {mutant.what for mutant in MUTANTS}
