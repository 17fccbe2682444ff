# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive that scales the speeds of the bus turns as fast as its set-point says [C114]."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from support.rig import CONNECTIONS, Rig

from nfo_sinus_driver.drive import Cause

#: The manual of firmware before 4.28 has no SpdScl, and the telegram carries no speed.
SCALED_CONNECTIONS = [
    name for name, connection in CONNECTIONS.items()
    if connection.model == 'sinus_g2' and connection.protocol != 'telegram1' and 'v5.0' not in name
]
SCALES = [(2, 1), (1, 1), (0, 1), (1, 0), (-1, 10)]


def scaled(connection: str, numerator: int, denominator: int, **settings: float) -> Rig:
    """Return a rig whose drive scales speeds, and takes them."""
    parameters = {
        'control.mode': 'Speed',
        'fieldbus.spd_scl_numerator': numerator,
        'fieldbus.spd_scl_denominator': denominator,
    }
    return Rig(connection, parameters=parameters, **settings)


@pytest.mark.parametrize(
    ('connection', 'scale'),
    [*((name, (1, 10)) for name in SCALED_CONNECTIONS), *(('rtu', scale) for scale in SCALES)],
)
def test_speeds_are_in_rpm_whatever_the_scale(connection: str, scale: tuple[int, int]) -> None:
    with scaled(connection, *scale) as rig:
        rig.connect()
        rig.enable()
        for speed in (300.0, -300.0):
            rig.send(speed / rig.connection.hertz)
            rig.pass_time(1.5)
            shown = rig.drive.snapshot
            assert [rig.far.motor.speed, shown.speed, shown.actual, shown.setpoint] == (
                pytest.approx([speed] * 4, abs=3)
            )
        # what cannot be a scale is none
        used = scale in ((1, 10), (2, 1))
        reported = sum(Cause.SPEED_SCALE in event.text.causes for event in rig.notes.events)
        assert reported == used
        rig.answer(rig.drive.stop())
        # a setting, too
        rig.far.memory.put('speed.c_fix1', 1500)
        read = rig.result(rig.drive.measure('speed.c_fix1'))
        assert read == (1500 * scale[0] / scale[1] if used else 1500)


@pytest.mark.parametrize('mode', ['Speed', 'Freque'])
@pytest.mark.parametrize('words', ['telegram1 g2, speed', 'telegram1 g2, drivecontrol'])
def test_behind_a_plc_a_scale_of_speeds_keeps_a_motor_from_running_by_speeds(
    words: str, mode: str
) -> None:
    speed = mode == 'Speed'
    driver = {'expected_control_mode': mode, **({'nominal_speed': 1500.0} if speed else {})}
    connection = dataclasses.replace(
        CONNECTIONS[words], plc={'layout': 2},
        driver={**CONNECTIONS[words].driver, **driver}, parameters={'control.mode': mode},
    )
    with Rig(connection, parameters={'fieldbus.spd_scl_numerator': 2}) as rig:
        rig.connect()
        answer = rig.answer(rig.drive.enable())
        assert ('fieldbus.spd_scl_denominator are 2/1' in answer) == speed
        assert rig.drive.following != speed
        # it keeps no fault from being acknowledged
        rig.far.trip(rig.a_fault)
        rig.pass_time(0.5)
        rig.acknowledged += 1
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())


def test_a_scale_that_was_changed_since_connect_counts_from_the_next_enable_on() -> None:
    with scaled('rtu', 1, 1) as rig:
        rig.connect()
        rig.far.memory.put('fieldbus.spd_scl_numerator', 10)
        rig.enable()
        rig.send(300.0)
        rig.pass_time(4.0)
        assert rig.far.motor.speed == pytest.approx(300.0, abs=10)
        assert rig.notes.said(Cause.SPEED_SCALE)


def test_a_speed_that_the_scale_cannot_carry_is_clamped() -> None:
    with scaled('rtu', 1, 10, setpoint_max=9000.0) as rig:
        rig.connect()
        rig.enable()
        rig.send(9000.0)
        rig.pass_time(1.0)
        assert rig.far.memory.raw('status.spd_set') == 0x7FFF
        assert rig.drive.snapshot.setpoint_clamped


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'canopen'])
def test_scales_that_cannot_be_read_are_chosen(connection: str) -> None:
    # FrqScl 1/100: a set-point of 20 Hz is 2000 counts, and 200 counts are 2 Hz
    with Rig(connection, frequency_scale=0.01) as rig:
        registers, key = rig.drive.params, 'status.frq_set'
        codec = registers.model[key].at(registers.protocol).codec
        assert codec.decode(registers.encode(key, 20.0)) == 2000
        assert registers.value(key, registers.encode(key, 20.0)) == 20.0
        assert registers.limits(key)[2] == 0.01


#: Setting and its value, control mode, set-point, and its counts; a fixed value of 100 counts. That
#: the simulated drive has the factory's scale does not matter: both ways are counts.
CHOSEN = {
    'frequency_scale': (0.2, 'Freque', 20.0, 100, 'freque.f_fix1', 20.0),
    'torque_scale': (0.5, 'Torque', 20.0, 40, 'torque.t_fix1', 50.0),
    # the settings of the regulator have tenths, as printed [M0 table 4]
    'process_scale': (0.2, 'PI-Reg', 40.0, 200, 'pi_reg.r_fix1', 10.0),
}


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'canopen'])
@pytest.mark.parametrize('scale', CHOSEN)
def test_a_scale_that_is_chosen_counts_for_set_points_measured_values_and_settings(
    connection: str, scale: str
) -> None:
    unit, mode, setpoint, counts, key, value = CHOSEN[scale]
    settings: dict[str, Any] = {scale: unit}
    parameters = {'control.mode': mode, 'control.accel': 0.2}
    with Rig(connection, parameters=parameters, **settings) as rig:
        rig.connect(parameters=True)
        rig.enable()
        rig.keep(lambda: rig.drive.set_setpoint(setpoint))
        rig.pass_time(2.0)
        assert rig.far.memory.raw(rig.far.control_unit.setpoint_key) == counts
        assert rig.drive.snapshot.setpoint == setpoint
        assert rig.drive.snapshot.actual == pytest.approx(setpoint, abs=3 * unit, rel=0.07)
        rig.answer(rig.drive.stop())
        rig.result(rig.drive.parameters.change({key: value}))
        assert rig.far.memory.raw(key) == 100
        assert rig.result(rig.drive.measure(key)) == value
        # these are in Hz whatever the scale is [M0 §8.3.1]
        assert rig.result(rig.drive.measure('motor.f_nom')) == 50
        assert rig.result(rig.drive.measure('output.f_max')) == rig.far.peek('output.f_max')
