# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What scales a set-point or a measured value does not change under a motor that is enabled."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from support.described import SHIPPED, DescribedRig
from support.oddities import ODD, described
from support.rig import Rig

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog.declared import read
from nfo_sinus_driver.drive import Cause, Severity

#: The shipped files whose set-points a parameter scales, and which.
SCALED = {
    name: scale
    for name, path in SHIPPED.items()
    if (scale := read(path).parameters['line.setpoint'].scale)
}
SPEED_SCALE = 'fieldbus.spd_scl_numerator'
DIMENSION = 'fieldbus.vl_dimension_factor_numerator'


def watch_speed(rig: Rig, most: float) -> None:
    """Have a motor that turns faster end the test."""

    def look() -> None:
        assert abs(rig.far.motor.frequency) < most, rig.far.motor.frequency

    rig.looked = look


def assert_stopped_for(rig: Rig, key: str) -> None:
    """The motor was stopped because of this parameter, and only an enable helps."""
    assert not rig.drive.following and not rig.turns
    (report,) = [event for event in rig.notes.events if Cause.SCALE_CHANGED in event.text.causes]
    assert report.severity is Severity.WARNING and key in report.text
    rig.looked = lambda: None


def test_some_shipped_files_have_scales() -> None:
    assert set(SCALED) >= {'abb_acs355', 'danfoss_fc101', 'siemens_v20'}


@pytest.mark.parametrize('name', SCALED)
def test_a_scale_that_is_changed_at_the_keypad_stops_the_motor(name: str) -> None:
    with DescribedRig(SHIPPED[name]) as rig:
        rig.turn()
        rig.far.set_from_keypad(SCALED[name], 100.0)
        rig.pass_time(1.5)
        assert_stopped_for(rig, SCALED[name])
        rig.wait_until(lambda: not rig.far.motor.turning)
        rig.enable()
        rig.follow(20.0)


@pytest.mark.parametrize('name', SCALED)
def test_a_scale_that_is_changed_at_standstill_turns_no_motor_too_fast(name: str) -> None:
    with DescribedRig(SHIPPED[name], poll_rate=5.0) as rig:
        rig.connect()
        rig.enable()
        rig.pass_time(0.5)
        watch_speed(rig, 21.0)
        rig.far.set_from_keypad(SCALED[name], 100.0)
        rig.pass_time(0.3)
        rig.send(20.0)
        rig.pass_time(1.5)
        assert_stopped_for(rig, SCALED[name])


@pytest.mark.parametrize('name', SCALED)
def test_a_measured_value_is_right_after_a_change_at_the_keypad(name: str) -> None:
    with DescribedRig(SHIPPED[name]) as rig:
        rig.connect()
        step = rig.drive.params.limits('line.setpoint')[2]
        before = float(rig.far.peek(SCALED[name]))
        rig.far.set_from_keypad(SCALED[name], 100.0)
        rig.pass_time(1.5)
        assert not rig.notes.said(Cause.SCALE_CHANGED)
        assert rig.drive.params.limits('line.setpoint')[2] == pytest.approx(step * 100 / before)
        rig.enable()
        rig.follow(20.0)


def test_a_setting_is_right_after_a_change_of_its_scale() -> None:
    with Rig(parameters={'control.mode': 'Speed', 'speed.c_fix1': 1500}) as rig:
        rig.connect(parameters=True)
        for above in (3, 1):
            rig.far.memory.put(SPEED_SCALE, above)
            rig.wait_until(
                lambda above=above: rig.drive.parameters.values['speed.c_fix1'] == 1500 * above
            )


@pytest.mark.parametrize('frequency', [0.0, 20.0])
@pytest.mark.parametrize('name', ['abb_acs355', 'danfoss_fc101', 'siemens_v20', 'odd'])
def test_no_client_changes_a_scale_while_the_motor_is_enabled(
    tmp_path: Path, name: str, frequency: float
) -> None:
    odd = described(tmp_path, **ODD['in parts of a parameter'])
    path, key = (odd, 'limit.maximum') if name == 'odd' else (SHIPPED[name], SCALED[name])
    with DescribedRig(path) as rig:
        rig.connect(parameters=True)
        rig.enable()
        if frequency:
            rig.follow(frequency)
        watch_speed(rig, 21.0)
        answer = rig.answer(rig.drive.parameters.change({key: 60.0}))
        assert key in answer and 'the motor is enabled' in answer, answer
        rig.pass_time(1.5)
        assert rig.drive.following
        rig.answer(rig.drive.stop())
        rig.wait_until(lambda: not rig.far.motor.turning)
        assert '60' in rig.answer(rig.drive.parameters.change({key: 60.0}))


@pytest.mark.parametrize('name', SCALED)
def test_by_a_scale_of_0_no_motor_starts_and_every_motor_stops(name: str) -> None:
    with DescribedRig(SHIPPED[name]) as rig:
        rig.turn()
        rig.far.memory.put(SCALED[name], 0)
        rig.pass_time(1.5)
        assert_stopped_for(rig, SCALED[name])
        assert not rig.drive.stop_unconfirmed
        answer = rig.answer(rig.drive.enable())
        assert f'{SCALED[name]} is 0' in answer
        rig.pass_time(0.5)
        assert not rig.drive.stop_unconfirmed


@pytest.mark.parametrize(
    ('connection', 'key'),
    [
        *((name, SPEED_SCALE) for name in ('rtu', 'classic', 'canopen', 'rtu, control word')),
        ('canopen, ds402', DIMENSION),
    ],
)
@pytest.mark.parametrize('speed', [0.0, 600.0])
def test_another_master_that_changes_a_scale_stops_the_motor(
    connection: str, key: str, speed: float
) -> None:
    with Rig(connection, parameters={'control.mode': 'Speed'}) as rig:
        rig.connect()
        rig.enable()
        rig.send(speed / rig.connection.hertz)
        rig.pass_time(2.0)
        rig.far.memory.put(key, 3)
        rig.far.control_unit.settle()
        # the first poll that begins from now on shows it at standstill
        rig.pass_time(0.4)
        watch_speed(rig, 65.0 if speed else 1.0)
        rig.send(600.0 / rig.connection.hertz)
        rig.pass_time(1.5)
        assert_stopped_for(rig, key)


JOINT: dict[str, tuple[Role, Callable[[float], float]]] = {
    'movitrac': (Role.POLE_PAIRS, lambda pairs: pairs + 1),
    'described': (Role.NOMINAL_FREQUENCY, lambda frequency: frequency - 10),
}


@pytest.mark.parametrize('connection', JOINT)
def test_what_scales_the_commands_of_a_joint_is_one(connection: str) -> None:
    role, other = JOINT[connection]
    with Rig(connection) as rig:
        rig.connect(parameters=True)
        rig.enable()
        rig.send(20.0)
        rig.pass_time(2.0)
        key = rig.drive.model.key(role)
        value = other(float(rig.drive.parameters.values[key]))
        answer = rig.answer(rig.drive.parameters.change({key: value}))
        assert 'the motor is enabled' in answer, answer
        assert rig.drive.following
        if not rig.drive.model[key].stopped:
            rig.far.set_from_keypad(key, value)
            rig.wait_until(lambda: not rig.drive.following, 30.0)
            rig.pass_time(0.5)
            assert_stopped_for(rig, key)
