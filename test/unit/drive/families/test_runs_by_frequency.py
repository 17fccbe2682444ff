# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A described drive whose run shows in its output frequency alone, as of a YL620."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.described import DescribedRig
from support.oddities import PLAIN, described

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.catalog.declared import DescriptionError
from nfo_sinus_driver.cli.families import notes
from nfo_sinus_driver.drive import Cause

_TURNS = {'register': 22, 'except': [0]}
BY_FREQUENCY: dict[str, dict[str, Any]] = {
    'frequency': {'status': {**PLAIN['status'], 'running': _TURNS}},
    'frequency, in another row': {
        'status': {'register': 20, 'running': {**_TURNS, 'register': 40}, 'fault': {'bit': 3}},
        'measured': {'actual_frequency': {'register': 40, 'type': 'int16', 'factor': 0.1}},
    },
}


@pytest.fixture(params=BY_FREQUENCY)
def rig(request: pytest.FixtureRequest, tmp_path: Path) -> DescribedRig:
    return DescribedRig(described(tmp_path, **BY_FREQUENCY[request.param]))


def test_it_is_enabled_at_set_point_0_and_stays_so(rig: DescribedRig) -> None:
    with rig:
        rig.connect()
        rig.enable()
        rig.pass_time(5.0)
        for frequency in (20.0, -15.0, 10.0):
            rig.follow(frequency)
        rig.send(0.0)
        rig.pass_time(6.0)
        assert rig.drive.following and not rig.far.motor.turning
        rig.follow(20.0)
        assert 'stop' in rig.answer(rig.drive.stop())
        rig.wait_until(lambda: not rig.far.motor.driven, 10.0)
        rig.assert_only_enable_helps(20.0)
        rig.lose_the_line()
        rig.assert_only_enable_helps(20.0)


def test_one_that_stands_against_its_set_points_is_stopped(rig: DescribedRig) -> None:
    with rig:
        rig.turn(20.0)
        # as by STOP at its keypad
        rig.far.control_unit._run = False
        rig.far.control_unit.settle()
        rig.wait_until(lambda: not rig.drive.following, 6.0)
        assert rig.notes.said(Cause.STOPPED_BY_ITSELF)
        rig.assert_only_enable_helps(20.0)


def test_one_that_never_turns_is_stopped(rig: DescribedRig) -> None:
    with rig:
        rig.connect()
        rig.enable()
        rig.far.control_unit._run = False
        rig.send(20.0)
        rig.wait_until(lambda: not rig.drive.following, 6.0)
        assert rig.notes.said(Cause.STOPPED_BY_ITSELF)


@pytest.mark.parametrize('register', [22, 40])
def test_a_frequency_that_is_another_one_each_time_is_no_damage(
    tmp_path: Path, register: int
) -> None:
    """The status beside it is what has to stand still while both are read."""
    measured = {'register': register, 'type': 'int16', 'factor': 0.01}
    runs = {'register': register, 'except': [0]}
    file = described(
        tmp_path, status={'register': 20, 'running': runs, 'fault': {'bit': 3}},
        measured={'actual_frequency': measured},
    )
    with DescribedRig(file, parameters={'ramp.accel': 10.0, 'ramp.decel': 10.0}) as rig:
        rig.connect()
        rig.enable()
        rig.follow(40.0)
        assert 'stop' in rig.answer(rig.drive.stop())
        rig.wait_until(lambda: not rig.far.motor.turning, 15.0)
        assert not rig.notes.said(Cause.LOST)


def test_a_speed_alone_does_not_show_that_a_motor_stands_against_set_points_in_hz(
    tmp_path: Path,
) -> None:
    status = {**PLAIN['status'], 'running': {'register': 23, 'except': [0]}}
    speed = {'actual_speed': {'register': 23, 'type': 'int16'}}
    with pytest.raises(DescriptionError, match='a running that is a measured value needs measured'):
        DescribedRig(described(tmp_path, status=status, measured=speed))
    setpoint = {
        'register': 11, 'type': 'int16', 'factor': 1, 'unit': 'rpm', 'most': 1800, 'signed': True,
    }
    # as of a set-point in rpm it does
    with DescribedRig(
        described(tmp_path, status=status, measured=speed, setpoint=setpoint)
    ) as rig:
        rig.connect()
        rig.enable()
        rig.follow(20.0)
        rig.far.control_unit._run = False
        rig.far.control_unit.settle()
        rig.wait_until(lambda: not rig.drive.following, 6.0)
        assert rig.notes.said(Cause.STOPPED_BY_ITSELF)


def test_a_slow_ramp_is_no_stop(tmp_path: Path) -> None:
    file = described(tmp_path, **BY_FREQUENCY['frequency'])
    with DescribedRig(file, parameters={'ramp.accel': 60.0, 'ramp.decel': 10.0}) as rig:
        rig.connect()
        rig.enable()
        for frequency in (5.0, -2.0, 2.0):
            rig.send(frequency)
            rig.pass_time(10.0)
            assert rig.drive.following


def test_check_reports_it(tmp_path: Path) -> None:
    said = 'its status shows a run only while the motor turns'
    for otherwise, reported in (({}, False), (BY_FREQUENCY['frequency'], True)):
        (folder := tmp_path / str(reported)).mkdir()
        found = notes(load_family(str(described(folder, **otherwise))))
        assert any(said in note for note in found) is reported


def test_a_drive_that_stays_in_standby_has_no_enable_input_that_its_file_does_not_name(
    tmp_path: Path,
) -> None:
    for named, control in ((False, {}), (True, {'enable_input': 'enable terminal (X5)'})):
        (folder := tmp_path / str(named)).mkdir()
        with DescribedRig(described(folder, control={**PLAIN['control'], **control})) as rig:
            rig.connect()
            rig.far.control_unit.run_input = False
            answer = rig.answer(rig.drive.enable())
            assert ('its enable terminal (X5) is not active' in answer) is named, answer
            assert named or 'stays in standby after the run command' in answer
