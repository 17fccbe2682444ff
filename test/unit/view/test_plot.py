# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The running plot: every value has a column, and zero is on the axis."""

from __future__ import annotations

import math

from hypothesis import given, strategies as st

from nfo_sinus_driver.view.plot import plot, span

_VALUES = st.lists(st.floats(-1e6, 1e6) | st.just(math.nan), max_size=100)


def test_columns_stand_on_the_bottom_and_the_newest_is_at_the_right() -> None:
    assert plot([0.0, 1.0, 2.0, 4.0], 6, 2, (0.0, 4.0)) == ['     █', '  ▁▄██']


def test_what_is_not_known_leaves_a_gap() -> None:
    assert plot([1.0, math.nan, 1.0], 3, 1, (0.0, 1.0)) == ['█ █']


def test_reverse_hangs_below_zero() -> None:
    axis = span([-20.0, 20.0])
    assert axis == (-20.0, 20.0)
    assert plot([-20.0, 0.0, 20.0], 3, 2, axis) == ['  █', '▁██']


def test_noise_is_no_event() -> None:
    assert span([0.0, 0.01], 1.0) == (0.0, 1.0)
    assert span([-0.01, 0.0], 1.0) == (-1.0, 0.0)
    assert span([], 1.0) == (0.0, 1.0)


@given(_VALUES, st.floats(0.0, 1e3))
def test_the_axis_has_zero_and_all_values_on_it(values: list[float], least: float) -> None:
    low, high = span(values, least)
    assert low <= 0.0 <= high
    # but for what floating-point numbers lose
    assert high - low >= least * (1 - 1e-9)
    assert all(math.isnan(value) or low <= value <= high for value in values)


@given(_VALUES, st.integers(0, 60), st.integers(1, 8))
def test_every_value_has_its_column(values: list[float], width: int, height: int) -> None:
    lines = plot(values, width, height, span(values))
    assert [len(line) for line in lines] == [width] * height
    if not width:
        return
    for place, value in enumerate(reversed(values[-width:]), 1):
        column = [line[-place] for line in lines]
        assert (column[-1] == ' ') == math.isnan(value)
        # no hole within a column
        assert ''.join(column).strip(' ').count(' ') == 0
