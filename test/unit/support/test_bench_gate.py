# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The gate of the benchmark fails on what has become slower, and on nothing else."""

from __future__ import annotations

import json
import runpy

import pytest
from support.places import ROOT

FOLDER = ROOT / 'benchmark'
ONE = 'driver, modbus_rtu, 57600 bit/s, 1 drive'
# in a file of its own: the rig needs ROS
SPACE = runpy.run_path(str(FOLDER / 'regressions.py'))
REGRESSIONS, ALLOWED = SPACE['regressions'], SPACE['ALLOWED']


@pytest.mark.parametrize('name', ALLOWED)
def test_what_is_slower_than_allowed_is_named(name: str) -> None:
    release = {ONE: dict.fromkeys(ALLOWED, 2.0)}
    limit = 2.0 * ALLOWED[name]
    assert list(REGRESSIONS({ONE: {**release[ONE], name: limit}}, release)) == []
    (said,) = REGRESSIONS({ONE: {**release[ONE], name: limit + 0.01}}, release)
    assert said.startswith(f'{ONE}: {name} is') and '2.000' in said


def test_what_is_faster_passes_and_what_was_not_measured_does_not() -> None:
    release = {ONE: dict.fromkeys(ALLOWED, 2.0)}
    assert list(REGRESSIONS({ONE: dict.fromkeys(ALLOWED, 0.5)}, release)) == []
    with pytest.raises(KeyError):
        list(REGRESSIONS({}, release))


def test_the_release_has_every_ratio() -> None:
    release = json.loads((FOLDER / 'release.json').read_text(encoding='utf-8'))
    *by_number, growth = release['figures'].values()
    assert len(by_number) == 3
    assert all(figures.keys() | growth.keys() == ALLOWED.keys() for figures in by_number)
