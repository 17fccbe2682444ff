# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``make exhaustive`` finds what is wrong with a driver, and each of its cases can be run."""

from __future__ import annotations

from pathlib import Path
import runpy

import pytest

from nfo_sinus_driver.drive.motion.stopping import StopSequence

TOOL = runpy.run_path(str(Path(__file__).resolve().parents[2] / 'exhaustive' / 'run.py'))


def test_what_can_go_wrong_can_happen_to_each_machine() -> None:
    known = {*TOOL['FAULTS'], *TOOL['REFUSALS']}
    for machine in TOOL['EVERY_MACHINE']:
        assert [name for name in TOOL['faults_of'](machine)
                if name not in known and not callable(getattr(machine, name, None))] == []


def _complaint(machine: str, *case: tuple[int, str]) -> str:
    kinds = {kind.__name__: kind for kind in TOOL['EVERY_MACHINE']}
    return TOOL['complaint_of'](TOOL['Run'](kinds[machine], TOOL['Given'](case)))


@pytest.mark.parametrize('machine', ['G2ModeScmd', 'Movitrac', 'SinusH', 'Described'])
def test_a_driver_that_does_not_stop_is_found(
    machine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert _complaint(machine, (100, 'answer lost')) == ''
    monkeypatch.setattr(StopSequence, 'start', lambda *_: None)
    assert _complaint(machine) != ''
