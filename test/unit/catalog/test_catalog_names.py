# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""The settings and their names, which become ROS parameters."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from setting_names import SETTINGS

from nfo_sinus_driver.catalog import Access, Parameter, example_setting, load_family, usual_family

G2 = load_family('sinus_g2')
NAMES = Path(__file__).resolve().parents[4] / 'shared' / 'design' / 'parameter_names.csv'
FROZEN = list(csv.reader(SETTINGS.strip().splitlines()))
#: What a ROS parameter calls the type of a value.
ROS_TYPES = {float: 'double', int: 'integer', str: 'string', bool: 'bool'}


@pytest.mark.parametrize('parameter', list(G2.values()), ids=list(G2))
def test_zero_is_of_the_parameters_kind(parameter: Parameter) -> None:
    for protocol, place in parameter.addresses.items():
        raw = next(iter(parameter.labels), 0)
        value = parameter.decode(place.number.encode(raw), protocol)
        assert type(value) is parameter.kind


def test_settings_are_those_that_have_a_name() -> None:
    assert [
        [row.group, row.name, row.key, ROS_TYPES[row.kind]] for row in G2.settings
    ] == FROZEN
    assert len(FROZEN) == 120


def test_names_are_still_those_of_the_design() -> None:
    if not NAMES.exists():
        pytest.skip('the list of names is not beside this clone')
    with NAMES.open(encoding='utf-8', newline='') as stream:
        head, *lines = csv.reader(stream)
    assert head == ['group', 'manual_name', 'ros_parameter', 'type']
    assert lines == FROZEN


def test_what_is_no_setting() -> None:
    others = [row for row in G2.values() if not row.is_setting]
    assert {row.group for row in others} == {'Status', 'Fieldbus'}
    assert len(others) == 20 + 15
    assert all(row.access is Access.READ_WRITE for row in G2.settings)


def test_the_example_is_a_setting_of_the_usual_family() -> None:
    key, value = example_setting()
    parameter = load_family(usual_family())[key]
    assert parameter.is_setting
    assert parameter.decode(parameter.encode(value)) == value
