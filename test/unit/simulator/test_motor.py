# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The motor of a simulated drive."""

import math

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.simulator.motor import Motor, Nameplate, Regulation

STEP = 0.005


def advance(motor, seconds, step=STEP):
    for _ in range(round(seconds / step)):
        motor.advance(step)


def running(demand, *, load=0.3, seconds=0.0, **settings):
    motor = Motor(Nameplate())
    motor.load = load
    for name, value in settings.items():
        setattr(motor, name, value)
    motor.demand = demand
    motor.energise()
    advance(motor, seconds)
    return motor


@given(demand=st.floats(-100, 100), accel=st.floats(0.5, 10))
def test_accel_is_the_time_from_zero_to_f_nom(demand, accel):
    motor = running(demand, accel=accel)
    seconds = 0.0
    while motor.ramp != demand:
        motor.advance(STEP)
        seconds += STEP
    assert seconds == pytest.approx(accel * abs(demand) / 50, abs=1.5 * STEP)


def test_retard_is_the_time_from_f_nom_to_zero_and_reversing_goes_through_it():
    motor = running(50, accel=1.0, retard=4.0, seconds=2)
    motor.demand = -50
    assert motor.trend == -1, 'it is seen at once'
    for seconds, ramp in ((2, 25), (2, 0), (0.6, -30)):
        advance(motor, seconds)
        assert motor.ramp == pytest.approx(ramp, abs=0.5)
    assert motor.trend == 1
    assert motor.rotor_speed < 0
    motor.demand = 0
    advance(motor, 2.5)
    assert motor.ramp == 0
    assert motor.at_zero or abs(motor.rotor_speed) < 5


def test_at_nominal_load_it_is_what_the_nameplate_says():
    for sign in (1, -1):
        motor = running(sign * 50, load=1.0, seconds=8)
        assert motor.rotor_speed == pytest.approx(sign * 1440, abs=1)
        assert motor.current == pytest.approx(3.4, rel=0.01)
        assert motor.voltage == 400
        assert 1500 < motor.power < 2000
        assert 0.6 < motor.power_factor < 0.95
        assert motor.torque == pytest.approx(sign * 1.0, abs=0.01)
        apparent = math.sqrt(3) * motor.voltage * motor.current
        assert motor.power == pytest.approx(apparent * motor.power_factor)


def test_slip_grows_with_the_load_unless_the_speed_is_regulated():
    speeds = [running(40, load=load, seconds=6).rotor_speed for load in (0.0, 0.5, 1.0)]
    assert 1200 >= speeds[0] > speeds[1] > speeds[2]
    assert speeds[0] == pytest.approx(1200, abs=0.5)
    motor = running(40, load=1.0, seconds=6, regulation=Regulation.SPEED)
    assert motor.rotor_speed == pytest.approx(1200, abs=0.5)
    assert motor.frequency > 40.5


def test_a_released_rotor_coasts_for_some_seconds_and_is_caught():
    motor = running(50, accel=1.0, seconds=3)
    motor.release()
    assert motor.voltage_on
    assert (motor.frequency, motor.speed, motor.current, motor.voltage) == (0, 0, 0, 0)
    assert (motor.ramp, motor.torque, motor.trend) == (0, 0, 0)
    advance(motor, 0.05)
    assert not motor.voltage_on
    assert motor.rotor_speed > 1400
    advance(motor, 1)
    before = motor.rotor
    motor.energise()
    assert motor.ramp == before
    advance(motor, 0.1)
    assert motor.rotor >= before - 1
    advance(motor, 2)
    motor.release(at_once=True)
    assert not motor.voltage_on, 'the mains are off'
    advance(motor, 2)
    assert 400 < motor.rotor_speed < 800
    advance(motor, 10)
    assert motor.settled and not motor.turning


def test_too_much_load_meets_the_current_limit_and_never_turns_the_rotor_backwards():
    motor = running(50, load=0.5, seconds=6)
    assert not motor.limited
    motor.load = 6.0
    advance(motor, 3)
    assert motor.limited
    assert motor.current == pytest.approx(5.1, rel=0.02)
    assert 0 <= motor.rotor_speed < 1000
    motor.load = 0.3
    advance(motor, 8)
    assert not motor.limited
    assert motor.rotor_speed > 1450
    motor = running(50, load=100.0)
    for _ in range(2000):
        motor.advance(STEP)
        assert motor.rotor > -0.5


def test_braking_hard_lifts_the_dc_link_and_works_the_chopper():
    motor = running(50, load=0.05, accel=1.0, retard=0.5, seconds=3)
    assert 555 < motor.dc_link < 575
    motor.demand = 0
    values, chopper = [], False
    for _ in range(200):
        motor.advance(STEP)
        values.append(motor.dc_link)
        chopper = chopper or motor.chopper
    assert 650 < max(values) < 800 and chopper
    advance(motor, 2)
    assert 555 < motor.dc_link < 575
    motor, values = running(50, seconds=6), []
    for _ in range(100):
        motor.advance(STEP)
        values.append(motor.dc_link)
    assert 0.2 < max(values) - min(values) < 10, 'it ripples'


def test_torque_regulation_accelerates_until_the_load_balances():
    motor = running(0.2, load=1.0, seconds=10, regulation=Regulation.TORQUE)
    assert motor.torque == pytest.approx(0.2, abs=0.01)
    first = motor.rotor_speed
    motor.demand = 0.6
    advance(motor, 10)
    assert motor.rotor_speed > first + 100
    motor.demand = 1.5
    advance(motor, 10)
    assert motor.rotor == pytest.approx(50)
    motor.demand = 0
    advance(motor, 20)
    assert not motor.turning
    motor.demand = -0.5
    advance(motor, 3)
    assert motor.rotor_speed < -100


def test_it_warms_up_and_cools_down():
    motor = running(50, load=1.0, seconds=60)
    warm = motor.temperature
    assert 5 < warm < 15
    motor.release()
    advance(motor, 60)
    assert motor.temperature < warm


@given(
    demands=st.lists(st.floats(-150, 150), min_size=1, max_size=5),
    load=st.floats(0, 5),
    times=st.floats(0.2, 20),
    regulation=st.sampled_from([Regulation.FREQUENCY, Regulation.SPEED]),
)
def test_whatever_is_asked_it_stays_within_reason(demands, load, times, regulation):
    motor = running(0, load=load, accel=times, retard=times, regulation=regulation)
    for demand in demands:
        motor.demand = demand
        for _ in range(100):
            motor.advance(STEP)
            assert abs(motor.rotor) < 160
            assert abs(motor.frequency) < 170
            assert 0 <= motor.current <= 5.2
            assert 0 <= motor.voltage <= 400
            assert 300 < motor.dc_link < 1000
            assert -1 <= motor.power_factor <= 1


def test_neither_the_step_nor_a_nameplate_without_slip_matters_much():
    fine = running(40)
    advance(fine, 3.0, 0.001)
    assert running(40, seconds=3.0).rotor == pytest.approx(fine.rotor, abs=0.05)
    motor = Motor(Nameplate(speed=1500.0, magnetising=3.4))
    motor.demand = 50
    motor.energise()
    advance(motor, 8)
    assert motor.rotor_speed == pytest.approx(1500, abs=10)
