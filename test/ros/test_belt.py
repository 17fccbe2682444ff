# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Set-points and status in the unit of a belt."""

from __future__ import annotations

from collections.abc import Callable

from bench import Bench, wait_until
from connections import needs
from nfo_sinus_msgs.msg import DriveStatus
import pytest
from std_msgs.msg import Float32

_BELT = ('-p', 'scale:=0.02', '-p', 'unit:=m/s')


@needs('reverse')
@pytest.mark.parametrize('sign', [1, -1])
def test_a_belt_is_commanded_and_reported_in_its_own_unit(bench: Bench, sign: int) -> None:
    simulator = bench.simulator()
    bench.driver('-p', f'scale:={sign * 0.02}', '-p', 'unit:=m/s')
    client = bench.client().connected()
    assert client.enable().success
    with client.setpoints(-0.4):
        # 0.02 m/s a hertz
        wait_until(lambda: abs(simulator.state()['frequency'] + sign * 20.0) < 0.2, '20 Hz')
        status = wait_until(
            lambda: abs((status := client.messages['status'][-1]).actual + 0.4) < 0.005 and status,
            'it is reported',
        )
        # another topic may arrive later, although it was published with this status
        client.wait_for(
            'actual_frequency', lambda message: abs(abs(message.data) - 20.0) < 0.5,
            'in Hz all the same',
        )
    assert status.unit == 'm/s'
    assert status.setpoint == pytest.approx(-0.4, abs=0.001)
    if status.valid & DriveStatus.VALID_REVERSE:
        assert status.reverse == (sign > 0), 'what the motor does is reported as it is'


@needs('reverse')
def test_the_limit_is_in_the_unit_of_the_drive(bench: Bench) -> None:
    simulator = bench.simulator()
    bench.driver(*_BELT, '-p', 'setpoint_max:=15.0')
    client = bench.client().connected()
    assert client.enable().success
    with client.setpoints(1.0):
        wait_until(lambda: simulator.state()['frequency'] > 14.8, 'it is at the limit')
        status = wait_until(
            lambda: (status := client.messages['status'][-1]).setpoint_clamped and status,
            'it says so',
        )
        assert status.setpoint == pytest.approx(0.3, abs=0.001)
    assert simulator.state()['frequency'] < 15.2


def test_it_is_not_changed_under_a_motor_that_follows_set_points(bench: Bench) -> None:
    bench.simulator()
    bench.driver(*_BELT)
    client = bench.client().connected()
    assert client.enable().success
    for name, value in (('scale', 0.01), ('unit', 'mm/s'), ('gear_ratio', 2.0)):
        refused = client.set_parameters(**{name: value})
        assert not refused.successful
        assert refused.reason == f'{name} can only be changed while the drive is not enabled'
    # the same again is no change: what was dumped can be loaded
    assert client.set_parameters(scale=0.02).successful
    assert client.call('stop').success
    assert client.set_parameters(scale=0.01, gear_ratio=2.0).successful
    assert client.set_parameters(unit='').successful
    wait_until(lambda: client.messages['status'][-1].unit == 'Hz', "the drive's own unit")
    refused = client.set_parameters(scale=0.0)
    assert not refused.successful and 'never 0' in refused.reason


def test_a_scale_that_is_none_is_refused_at_the_start(bench: Bench) -> None:
    bench.simulator()
    driver = bench.driver('-p', 'scale:=0.0')
    assert driver.wait() == 2
    assert 'scale 0' in driver.text and 'never 0' in driver.text


@pytest.mark.every_connection
@pytest.mark.shared
@needs('direct')
def test_one_set_point_for_all_is_in_the_unit_of_each_drive(bench: Bench) -> None:
    simulator = bench.simulator('--address', '1', '--address', '2')
    parameters = bench.folder / 'two.yaml'
    parameters.write_text("""
nfo_sinus_bus: {ros__parameters: {drives: [left, right]}}
left: {ros__parameters: {address: 1, scale: 0.02, unit: m/s}}
right: {ros__parameters: {address: 2, scale: 0.04, unit: m/s}}
""")
    bench.driver('--params-file', str(parameters))
    left, right = (bench.client(name).connected() for name in ('/left', '/right'))
    every_drive = bench.client('/nfo_sinus_bus')
    publisher = every_drive.node.create_publisher(Float32, '/nfo_sinus_bus/setpoint_all', 1)

    def publishing(condition: Callable[[], object], what: str) -> None:
        def published() -> object:
            publisher.publish(Float32(data=0.4))
            return condition()

        wait_until(published, what, period=0.05)

    assert every_drive.call('enable_all').success
    publishing(
        lambda: all(
            abs(simulator.state(unit)['frequency'] - hertz) < 0.2
            for unit, hertz in ((1, 20.0), (2, 10.0))
        ),
        'each has 0.4 m/s',
    )
    assert [client.messages['status'][-1].unit for client in (left, right)] == ['m/s', 'm/s']
    assert every_drive.call('stop_all').success
    wait_until(lambda: not any(simulator.state(unit)['turning'] for unit in (1, 2)), 'both stand')
