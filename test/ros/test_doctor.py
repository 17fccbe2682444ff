# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``ros2 doctor`` names every line and drive with its state, and fails for a fault."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

from bench import Bench
from connections import needs
from support.places import ROOT

from nfo_sinus_driver.demo.bench import own_domain

STAND_INS = Path(__file__).with_name('stand_ins')
#: As ros2doctor calls them.
PROGRAM = """
import json
from nfo_sinus_driver.node.doctor import DriveCheck, DriveReport
report, result = DriveReport().report(), DriveCheck().check()
assert DriveCheck().category() == DriveReport().category()
print(json.dumps([report.items, result.error, result.warning]))
"""


def asked(domain: int) -> tuple[dict[str, str], int, int, str]:
    """What the report says, how many errors and warnings the check has, and what it says."""
    path = os.environ.get('PYTHONPATH', '')
    if importlib.util.find_spec('ros2doctor') is None:
        path = f'{path}:{STAND_INS}'
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM],
        env={**os.environ, 'ROS_DOMAIN_ID': str(domain), 'PYTHONPATH': path},
        check=True, capture_output=True, text=True,
    )
    answer: list[Any] = json.loads(done.stdout)
    items, errors, warnings = answer
    return dict(items), errors, warnings, done.stderr


@needs('own')
def test_doctor_reports_drives_and_fails_for_a_fault(bench: Bench) -> None:
    drive = bench.simulator()
    bench.driver()
    client = bench.client().connected()
    report, errors, _, _ = asked(bench.domain)
    assert report['nfo_sinus_bus: line'] == 'ok: all drives answer'
    assert report['nfo_sinus: drive'].startswith('ok: ') and not errors
    drive.inject('fault', 5)
    client.wait_for('inv_st', lambda message: message.kind == message.FAULT, 'the fault')
    report, errors, _, said = asked(bench.domain)
    assert report['nfo_sinus: drive'].startswith('error: ') and 'Overload' in said
    assert errors == 1


def test_without_a_driver_nothing_is_wrong() -> None:
    with contextlib.ExitStack() as domains:
        # what a test has left behind may still be heard where it was: then in another domain
        for _ in range(3):
            report, errors, warnings, _ = asked(domains.enter_context(own_domain()))
            if 'drives' in report:
                break
    assert report['drives'].startswith('none') and (errors, warnings) == (0, 0)


def test_ros2doctor_finds_them() -> None:
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    for group, name in (('ros2doctor.report', 'DriveReport'), ('ros2doctor.checks', 'DriveCheck')):
        assert f"'{group}': [f'{name} = {{NAME}}.node.doctor:{name}']" in text
