# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Motors whose drives measure sizes without a sign: none in reverse is reported as forward."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from support.described import SHIPPED, DescribedRig
from support.oddities import PLAIN, described

from nfo_sinus_driver.catalog import Fact, Role, load_family
from nfo_sinus_driver.cli.families import notes
from nfo_sinus_driver.drive import Cause

_FREQUENCY, _SPEED = 'measured.actual_frequency', 'measured.actual_speed'
SIZE = {'actual_frequency': {'register': 22, 'factor': 0.1}}
BOTH = {**SIZE, 'actual_speed': {'register': 23}}
SIZE_AND_DIRECTION = {
    'register': 11, 'factor': 0.1, 'unit': 'Hz', 'most': 60,
    'direction': {'register': 12, 'forward': 1, 'reverse': 2},
}
#: No sign, and nothing that reports the direction.
UNKNOWN: dict[str, dict[str, Any]] = {
    'frequency': {'measured': SIZE},
    'frequency, and pole pairs': {'measured': SIZE, 'motor': {'pole_pairs': 2}},
    'frequency and speed': {'measured': BOTH},
    'a direction beside the size': {'measured': BOTH, 'setpoint': SIZE_AND_DIRECTION},
    'a status with a ramp to a stop': {
        'measured': SIZE, 'status': {**PLAIN['status'], 'stopping': {'bit': 4}},
    },
    'speed alone': {
        'measured': {'actual_speed': BOTH['actual_speed']},
        'setpoint': {
            'register': 11, 'type': 'int16', 'unit': 'rpm', 'most': 1800, 'signed': True,
        },
    },
}


def watch_signs(rig: DescribedRig) -> None:
    """Have a measured value with another direction than that of the motor end the test."""

    def look() -> None:
        shown, turns = rig.drive.snapshot, rig.far.motor.frequency
        # a poll is younger than a tenth of a second
        if abs(turns) > 5:
            for value in (shown.frequency, shown.speed, shown.actual):
                assert not value * turns < 0, (value, turns)

    rig.looked = look


@pytest.mark.parametrize('name', UNKNOWN)
def test_a_size_has_the_direction_commanded_or_is_not_shown(tmp_path: Path, name: str) -> None:
    file = described(tmp_path, **UNKNOWN[name])
    ramps = {'ramp.accel': 2.0, 'ramp.decel': 2.0}
    with DescribedRig(file, telemetry_rate=10.0, parameters=ramps) as rig:
        rig.connect(parameters=True)
        rig.enable()
        watch_signs(rig)
        for frequency in (-20.0, 15.0, -15.0):
            rig.send(rig.unit(frequency))
            rig.pass_time(4.0)
            shown, measured = rig.drive.snapshot, rig.notes.telemetry[-1].values
            for value in (shown.actual, measured[rig.drive.state.measurements.turning.role]):
                assert value == pytest.approx(rig.unit(frequency), rel=0.03)
            assert shown.status is not None and Fact.REVERSE not in shown.status.valid
        # it turns in reverse until it stands
        rig.answer(rig.drive.stop())
        rig.wait_until(lambda: not rig.far.motor.driven, 10.0)
        rig.pass_time(1.0)
        shown = rig.drive.snapshot
        assert 0 in (shown.frequency, shown.speed)


@pytest.mark.parametrize('name', UNKNOWN)
def test_a_size_is_not_shown_while_others_command(tmp_path: Path, name: str) -> None:
    file = described(tmp_path, **UNKNOWN[name])
    named = _SPEED if name == 'speed alone' else _FREQUENCY
    with DescribedRig(
        file, telemetry_rate=10.0, control_method='monitor', measured=(named,)
    ) as rig:
        rig.connect(parameters=True)
        rig.pass_time(1.0)
        assert 0 in (rig.drive.snapshot.frequency, rig.drive.snapshot.speed)
        rig.far.motor.energise()
        rig.far.control_unit._run = True
        rig.far.write_raw('line.setpoint', 200 if name != 'speed alone' else 600)
        rig.pass_time(2.0)
        assert abs(rig.far.motor.frequency) > 15
        shown, telemetry = rig.drive.snapshot, rig.notes.telemetry[-1]
        values = [shown.frequency, shown.speed, shown.actual, telemetry.measured[named]]
        values += [telemetry.values[role] for role in (Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED)]
        assert all(map(math.isnan, values)), values
        assert shown.status is not None and shown.status.runs


def test_a_status_that_reports_reverse_gives_a_size_its_sign_and_takes_none_away(
    tmp_path: Path,
) -> None:
    status = {**PLAIN['status'], 'reverse': {'register': 23, 'bit': 15}}
    measured = {**SIZE, 'actual_speed': {'register': 23, 'type': 'int16'}}
    with DescribedRig(described(tmp_path, measured=measured, status=status)) as rig:
        rig.connect(parameters=True)
        rig.enable()
        for frequency in (20.0, -20.0):
            rig.follow(frequency)
            rig.pass_time(1.0)
            shown = rig.drive.snapshot
            assert shown.frequency * frequency > 0 and shown.speed * frequency > 0
            assert shown.status is not None and Fact.REVERSE in shown.status.valid
            assert (Fact.REVERSE in shown.status.facts) is (frequency < 0)


def test_check_reports_what_tells_no_direction(tmp_path: Path) -> None:
    said = 'nothing reports the direction'

    def found(**otherwise: Any) -> bool:
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        return any(said in note for note in notes(load_family(str(described(folder, **otherwise)))))

    assert all(found(**otherwise) for otherwise in UNKNOWN.values())
    assert not found()
    assert not found(measured=SIZE, status={**PLAIN['status'], 'reverse': {'bit': 4}})
    forward = {'register': 11, 'factor': 0.1, 'unit': 'Hz', 'most': 60}
    assert not found(measured=SIZE, setpoint=forward)
    for path in SHIPPED.values():
        assert not any(said in note for note in notes(load_family(str(path)))), path


@pytest.mark.parametrize('frequency', [20.0, -20.0])
def test_a_motor_that_starts_anew_after_a_silence_is_stopped_in_either_direction(
    tmp_path: Path, frequency: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    ramps = {'ramp.accel': 5.0, 'ramp.decel': 5.0}
    with DescribedRig(described(tmp_path, measured=SIZE), parameters=ramps) as rig:
        rig.connect()
        rig.enable()
        rig.follow(frequency)
        motor = rig.far.motor
        # it keeps its run command, which its file does not say, and the motor is braked meanwhile
        monkeypatch.setattr(rig.far.control_unit, 'restart', lambda: setattr(motor, 'rotor', 0.0))
        rig.far.power_cycle(0.6)
        rig.pass_time(1.5)
        assert rig.notes.said(Cause.SLOWER_AFTER_SILENCE), rig.notes.events
        assert not rig.drive.following and not rig.turns
