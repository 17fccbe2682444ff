# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A motor that does not do what its set-points say is noticed, and stopped where that is meant."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from support.described import SHIPPED
from support.rig import CONNECTIONS, Connection, Rig
from support.variants import ramps
import yaml

from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.families.movitrac31.words import Bits

FOLLOWING = [name for name, kind in CONNECTIONS.items() if kind.reference == 'fieldbus']
BITS, SIZE = 'fieldbus.function_bits', 'fieldbus.remote_setpoint'
FORWARD, REVERSE = (int(Bits.ENABLE | turn) for turn in (Bits.CLOCKWISE, Bits.COUNTER_CLOCKWISE))


def is_setpoint(rig: Rig, key: str) -> bool:
    return key.endswith('setpoint') or any(
        key in (target.key, target.at) for target in rig.drive.model.profile.setpoints.values()
    )


#: Connections whose status word, if there is any, shows a ramp to a stop as a run.
UNREPORTED = ('classic v5.0', 'canopen, no DriveStatus', 'canopen, ds402')


# --- a drive that stops by itself ---


@pytest.mark.parametrize('connection', UNREPORTED)
@pytest.mark.parametrize('value', [20.0, -20.0])
@pytest.mark.parametrize('retard', [10.0, 40.0])
def test_a_run_input_that_is_back_before_the_motor_stands_does_not_start_it(
    connection: str, value: float, retard: float
) -> None:
    parameters = {'control.accel': 0.3, 'control.retard': retard}
    with Rig(connection, parameters=parameters, poll_rate=50.0) as rig:
        rig.turn(value)
        rig.pass_time(5.0)
        assert rig.far.motor.frequency == pytest.approx(value, abs=0.5)
        rig.far.set_run_input(False)
        rig.pass_time(retard / 5)
        size = abs(rig.far.motor.frequency)
        assert 5.0 < size < 19.0, 'it ramps to a stop'
        rig.far.set_run_input(True)
        rig.pass_time(1.0)
        assert abs(rig.far.motor.frequency) < size, 'it goes on to a stop'
        assert rig.notes.said(Cause.STOPPED_BY_ITSELF)
        rig.wait_until(lambda: not rig.far.motor.turning, retard)
        rig.pass_time(2.0)
        assert not rig.turns and not rig.drive.following


@pytest.mark.parametrize('mode', ['Speed', 'Torque'])
@pytest.mark.parametrize('connection', UNREPORTED)
def test_a_start_delay_shows_a_run_that_was_interrupted(connection: str, mode: str) -> None:
    slow = {'control.accel': 0.3, 'control.retard': 100.0, 'control.run_dly': 1.0}
    with Rig(connection, parameters={**slow, 'control.mode': mode}, poll_rate=50.0) as rig:
        rig.connect()
        rig.enable()
        rig.send(600.0 if mode == 'Speed' else 50.0)
        rig.pass_time(3.0)
        assert rig.far.motor.frequency > 10.0
        # too short for the speed to show it
        rig.far.set_run_input(False)
        rig.pass_time(0.1)
        rig.far.set_run_input(True)
        rig.pass_time(0.9)
        assert rig.notes.said(Cause.STOPPED_BY_ITSELF)
        rig.pass_time(1.0)
        assert not rig.turns and not rig.drive.following


def test_an_enable_waits_for_the_start_delay_of_a_motor_that_ramps_down() -> None:
    slow = {'control.accel': 0.3, 'control.retard': 60.0, 'control.run_dly': 1.0}
    with Rig('canopen, ds402', parameters=slow) as rig:
        rig.turn()
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        assert rig.far.motor.turning
        rig.enable()
        rig.pass_time(2.0)
        assert rig.turns and rig.drive.following and not rig.notes.said(Cause.STOPPED_BY_ITSELF)


@pytest.mark.parametrize('connection', UNREPORTED)
@pytest.mark.parametrize('retard', [8.0, 20.0])
def test_a_loaded_motor_that_ramps_down_does_not_stop_by_itself(
    connection: str, retard: float
) -> None:
    with Rig(connection, parameters={'control.accel': 0.3, 'control.retard': retard}) as rig:
        rig.turn()
        rig.far.motor.load = 1.0
        for value in (50.0, 45.0, 30.0, 20.0):
            rig.send(value)
            rig.pass_time(retard / 2)
            assert rig.drive.following


@pytest.mark.parametrize('connection', UNREPORTED)
def test_a_motor_that_ramps_to_other_set_points_does_not_stop_by_itself(connection: str) -> None:
    with Rig(connection, parameters={'control.accel': 1.5, 'control.retard': 4.0}) as rig:
        rig.turn()
        for value in (5.0, 20.0, -20.0, 12.0, 20.0, 3.0, -8.0, -20.0, 20.0):
            rig.send(value)
            rig.pass_time(1.7)
            assert rig.drive.following
        rig.far.motor.load = 0.9
        rig.pass_time(5.0)
        assert rig.drive.following


# --- after a set-point time-out -------------------------------------------------------------------


# nothing but its set-point stops that one
@pytest.mark.parametrize(
    'connection', [name for name in FOLLOWING if name != 'described, by set-point']
)
def test_a_motor_that_does_not_slow_down_after_a_time_out_is_stopped(connection: str) -> None:
    with Rig(connection, setpoint_timeout=2.5) as rig:
        rig.turn()
        # the drive takes set-point 0, and does not follow it
        rig.meet = lambda key, data: 'ignored' if is_setpoint(rig, key) and data else None
        rig.send(None)
        rig.pass_time(10.0)
        assert rig.notes.said(Cause.SETPOINT_TIMED_OUT)
        # as it is measured; a speed with the slip of the motor, where its frequency is controlled
        hertz = rig.drive.state.measurements.turning.unit == 'Hz'
        turns = ('20 Hz',) if hertz else ('600 rpm', '590 rpm')
        assert any(rig.notes.said(f'does not slow down at set-point 0 ({turn}') for turn in turns)
        assert not rig.drive.following
        # one that has nothing but its set-point is stopped by force, when no ramp is that slow
        rig.wait_until(lambda: not rig.drive.stop_unconfirmed, 10.0)
        assert not rig.turns


@pytest.mark.parametrize('connection', FOLLOWING)
def test_a_motor_that_slows_down_after_a_time_out_is_not_stopped(connection: str) -> None:
    with Rig(connection, setpoint_timeout=2.5) as rig:
        rig.turn()
        rig.send(None)
        rig.pass_time(15.0)
        assert rig.far.motor.frequency == pytest.approx(0.0, abs=0.5)
        assert rig.drive.following


def test_the_slowest_ramp_is_not_taken_for_none() -> None:
    with Rig('movitrac') as rig:
        rig.turn()
        _, down = ramps('movitrac31', 0.5, 0.5)
        rig.far.set_from_keypad(down, 2000.0)
        rig.send(None)
        rig.pass_time(40.0)
        assert 18 < rig.far.motor.frequency < 19.9
        assert rig.drive.following


def test_a_least_frequency_that_the_keypad_sets_keeps_no_motor_turning() -> None:
    with Rig('movitrac') as rig:
        rig.turn(35.0)
        rig.far.set_from_keypad('frequency.f_min_1', 30.0)
        rig.send(None)
        rig.pass_time(12.0)
        assert not rig.drive.following
        assert rig.far.motor.frequency == 0


def test_what_a_start_depends_on_does_not_change_while_the_motor_is_enabled() -> None:
    with Rig('movitrac', allow_communication_changes=True) as rig:
        rig.turn()
        rig.answer(rig.drive.parameters.read())
        profile = rig.drive.model.profile
        before = {key: rig.far.memory.raw(key) for key in profile.start_settings}
        for moment in ('it turns', 'it stands'):
            for key in rig.drive.parameters.values.keys() & profile.start_settings:
                answer = rig.answer(rig.drive.parameters.change({key: other(rig, key)}))
                assert 'the motor is enabled' in answer, (moment, key, answer)
            rig.send(0.0)
            rig.pass_time(2.0)
        assert before == {key: rig.far.memory.raw(key) for key in profile.start_settings}
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        rig.answer(rig.drive.parameters.change({'frequency.f_min_1': 30.0}))
        assert rig.far.memory.number('frequency.f_min_1') == 30


def other(rig: Rig, key: str) -> Any:
    """Return another value of a setting than it has."""
    labels = rig.drive.model[key].labels
    now = rig.drive.parameters.values[key]
    if isinstance(now, bool):
        return not now
    return next(label for label in labels.values() if label != now) if labels else now + 1.0


# --- another master -------------------------------------------------------------------------------


def test_a_motor_that_another_master_reverses_is_stopped_and_its_direction_shown() -> None:
    with Rig('movitrac') as rig:
        rig.turn()
        shown = []
        rig.looked = lambda: shown.append(rig.notes.snapshot.frequency)
        rig.far.write_raw(BITS, REVERSE)
        rig.pass_time(3.0)
        assert rig.notes.said(Cause.TURNS_BACKWARDS)
        assert min(shown) < -2.0
        assert not rig.drive.following
        assert not rig.turns


@pytest.mark.parametrize('connection', ['rtu', 'optimal', 'movitrac'])
def test_a_motor_that_another_master_speeds_up_is_reported_and_set_back(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        key = rig.drive.model.profile.setpoints['Freque'].key
        rig.far.memory.set(key, 45.0)
        rig.far.write_raw(key, rig.far.memory.raw(key))
        rig.pass_time(2.0)
        assert rig.notes.said(Cause.FASTER_THAN_SETPOINT)
        assert rig.far.motor.frequency == pytest.approx(20.0, abs=0.5)
        assert rig.drive.following


# --- a scale that is wrong ------------------------------------------------------------------------


def with_factor(folder: Path, place: str, factor: Any) -> str:
    """Return the file of a VFD-EL whose set-point or measured frequency has another factor."""
    file = yaml.safe_load(SHIPPED['delta_vfd_el'].read_text(encoding='utf-8'))
    node = file['setpoint'] if place == 'setpoint' else file['measured']['actual_frequency']
    node['factor'] = factor
    if place == 'setpoint':
        node['most'] = min(600, int(60000 * Fraction(str(factor))))
    path = folder / 'rescaled.vfd.yaml'
    path.write_text(yaml.safe_dump(file), encoding='utf-8')
    return str(path)


@pytest.mark.parametrize(
    ('place', 'factor', 'value', 'said'),
    [
        ('setpoint', 0.1, 5.0, '10 times its set-point of 5'),
        ('setpoint', 0.1, -4.0, '10 times its set-point of -4'),
        ('setpoint', 0.001, 40.0, '1/10 of its set-point of 40'),
        ('setpoint', '1/3000', 20.0, '1/30 of its set-point of 20'),
        ('measured', 0.001, 20.0, '10 times its set-point of 20'),
        ('measured', 1.0, 50.0, '1/100 of its set-point of 50'),
    ],
)
def test_a_speed_that_is_a_multiple_of_the_set_point_names_the_scale_once(
    tmp_path: Path, place: str, factor: Any, value: float, said: str
) -> None:
    # the drive has another factor than the file of the driver
    file = with_factor(tmp_path, place, factor)
    own = {'model': str(SHIPPED['delta_vfd_el'])}
    with Rig(Connection('modbus_rtu', file, 'custom', driver=own)) as rig:
        rig.connect()
        rig.enable()
        rig.send(value)
        rig.pass_time(20.0)
        assert rig.notes.said(said), rig.notes.events
        assert sum('another scale' in event.text for event in rig.notes.events) == 1
        assert rig.drive.following


@pytest.mark.parametrize('connection', FOLLOWING)
def test_no_motor_that_follows_has_a_wrong_scale(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        for value in (50.0, 5.0, 0.5, 0.0):
            rig.send(value)
            rig.pass_time(12.0)
        assert rig.drive.following and not rig.notes.said(Cause.OTHER_SCALE)


@pytest.mark.parametrize('ramp', [100.0, 600.0, 2000.0])
@pytest.mark.parametrize(('first', 'second'), [(45.0, 4.4), (4.4, 45.0)])
def test_a_ramp_that_passes_a_multiple_is_no_scale(
    ramp: float, first: float, second: float
) -> None:
    with Rig('movitrac') as rig:
        rig.turn(first)
        rig.pass_time(5.0)
        for key in ramps('movitrac31', 0.5, 0.5):
            rig.far.set_from_keypad(key, ramp)
        rig.send(second)
        rig.pass_time(min(ramp, 200.0))
        assert rig.drive.following and not rig.notes.said(Cause.OTHER_SCALE)


@pytest.mark.parametrize('connection', FOLLOWING)
def test_no_change_of_a_set_point_is_taken_for_another_master(connection: str) -> None:
    forward_only = CONNECTIONS[connection].model == 'sinus_h'
    with Rig(connection) as rig:
        rig.turn()
        for value in (40.0, -40.0, 10.0, 0.0, -5.0, 5.0, -30.0, 50.0, 1.0, -1.0, 20.0):
            for pause in (0.3, 2.5):
                rig.send(abs(value) if forward_only else value)
                rig.pass_time(pause)
        assert rig.drive.following
        assert not rig.notes.said(Cause.FASTER_THAN_SETPOINT)


def test_a_motor_that_ramps_through_an_earlier_set_point_is_not_stopped() -> None:
    with Rig('movitrac') as rig:
        for key in ramps('movitrac31', 0.5, 0.5):
            rig.far.set_from_keypad(key, 60.0)
        rig.connect()
        rig.enable()
        for value in (30.0, -30.0):
            rig.send(value)
            rig.pass_time(25.0)
            assert rig.drive.following
        assert rig.notes.events[-1].severity is not Severity.WARNING


@pytest.mark.parametrize('pause', [0.9, 0.95, 1.0, 1.05, 1.1, 1.5])
@pytest.mark.parametrize('first', [20.0, -20.0])
def test_a_motor_that_ramps_slowly_through_a_pause_at_0_is_not_stopped(
    first: float, pause: float
) -> None:
    # however long the set-point is 0 between the two directions
    with Rig('movitrac') as rig:
        rig.turn(20.0)
        rig.send(first)
        rig.pass_time(3.0)
        _, down = ramps('movitrac31', 0.5, 0.5)
        rig.far.set_from_keypad(down, 200.0)
        rig.send(0.0)
        rig.pass_time(pause)
        rig.send(-first)
        rig.pass_time(3.0)
        assert rig.far.motor.frequency * first > 0
        assert rig.drive.following, rig.notes.events
