# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Through a PLC by telegram 1, with ROS: the laws over Optimal, Sinus H and G2.

A run is over each of them, and every other case over one: over all it is tested without ROS.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from pathlib import Path
import signal
from typing import Any

from bench import A_WHILE, PATIENCE, Bench, Client, wait_until
from connections import TELEGRAM1, Connection
from nfo_sinus_msgs.msg import DriveStatus
import pytest

from nfo_sinus_driver.demo.bench import own_domain
from nfo_sinus_driver.simulator.control import Client as Simulated

#: Any will do that stops a motor: the telegram does not tell which it is.
FAULT = {'sinus_optimal': 5, 'sinus_h': 11, 'sinus_g2': 5}
RAMPS = {
    'sinus_optimal': ('--set', 'control.accel=0.5', '--set', 'control.retard=0.5'),
    # by its frequency alone it is seen that it ramps down
    'sinus_g2': ('--set', 'control.accel=0.5', '--set', 'control.retard=3'),
    'sinus_h': (),
}
#: As patient as a busy machine needs it.
PATIENT = ('-p', 'response_timeout:=2.0', '-p', 'lost_after:=5.0')
RUNS = {'sinus_optimal': 0x0001, 'sinus_h': 0x0008, 'sinus_g2': 0x0001}


@pytest.fixture
def behind(request: pytest.FixtureRequest) -> Connection:
    """Return a connection through a PLC, whichever is asked for of the others."""
    return TELEGRAM1[request.param]


@pytest.fixture
def bench(tmp_path: Path, behind: Connection) -> Iterator[Bench]:
    with own_domain() as domain, Bench(domain, tmp_path, behind) as made:
        yield made
        assert made.violations() == []


def start(bench: Bench, *plc: str, settings: tuple[str, ...] = PATIENT) -> tuple[Simulated, Client]:
    drive = bench.simulator(*RAMPS[bench.connection.model], *plc)
    bench.driver(*settings)
    client = bench.client()
    wait_until(lambda: client.state() == 'active', 'it is active')
    client.wait_for('status', lambda status: status.connected, 'it is connected')
    return drive, client


def enable(client: Client) -> None:
    # what was found under control may be being stopped
    wait_until(lambda: client.enable().success, 'it can be enabled', period=0.2)


def stands(drive: Simulated) -> dict[str, Any]:
    state: dict[str, Any] = drive.wait_for(
        lambda state: not state['turning'] and not state['driven'], timeout=PATIENCE
    )
    return state


def stays(bench: Bench, drive: Simulated) -> None:
    """Nothing turns while set-points go on, and no run bit stands."""
    began = stands(drive)['time']
    state = drive.wait_for(
        lambda state: state['driven'] or state['time'] > began + A_WHILE, timeout=PATIENCE
    )
    assert not state['driven'] and not state['turning'], state
    assert not state['plc']['stw1'] & RUNS[bench.connection.model]


def turns(client: Client, value: float) -> None:
    client.wait_for('status', lambda status: abs(status.actual - value) < 1, f'{value}')


@pytest.mark.parametrize('behind', TELEGRAM1, indirect=True)
def test_a_run_and_what_ends_it(bench: Bench) -> None:
    drive, client = start(bench)
    model = bench.connection.model
    enable(client)
    with client.setpoints(20.0):
        turns(client, 20.0)
        status = client.latest('status')
        assert status.control_method == DriveStatus.TELEGRAM1
        assert status.enabled and status.state == DriveStatus.OPERATION_ENABLED
        assert client.call('stop').message == 'stopping: it ramps down'
        stays(bench, drive)
        enable(client)
        turns(client, 20.0)
        assert client.call('quick_stop').message == bench.drives.quick_stopped
        stays(bench, drive)
        enable(client)
        turns(client, 20.0)
        drive.inject('fault', FAULT[model])
        client.wait_for('status', lambda status: status.fault and not status.enabled, 'the fault')
        wait_until(lambda: not client.enable().success, 'it is refused')
        assert client.call('fault_ack').success
        stays(bench, drive)
        enable(client)
        turns(client, 20.0)


@pytest.mark.parametrize('behind', ['sinus_g2'], indirect=True)
def test_by_the_mailbox_settings_are_parameters_and_a_fault_has_its_name(bench: Bench) -> None:
    unlimited = (*PATIENT, '-p', 'max_requests:=0.0')
    drive, client = start(bench, '--layout', '2', settings=unlimited)
    assert len([name for name in client.parameter_names() if name.startswith('motor.')]) > 5
    assert client.set_parameters(**{'control.accel': 1.5}).successful
    assert drive.wait_for(lambda state: state['parameters']['control.accel'] == 1.5)
    drive.inject('fault', 3)
    client.wait_for('inv_st', lambda shown: shown.code == 3 and 'fan' in shown.remedy, 'its name')
    assert 'Temp Hi' in client.call('fault_ack').message


@pytest.mark.parametrize('behind', ['sinus_h'], indirect=True)
def test_parameters_by_address_are_those_that_the_user_names(bench: Bench) -> None:
    own = ('-p', 'drive_addresses:=["drv.acc_time=1105h:0.1:s:rw", "drv.max_freq=1104h:0.01:Hz"]')
    drive, client = start(bench, '--layout', '2', settings=(*PATIENT, *own))
    assert client.parameter('drv.max_freq') == 60.0
    assert client.set_parameters(**{'drv.acc_time': 1.5}).successful
    assert drive.wait_for(lambda state: state['parameters']['drv.acc_time'] == 1.5)
    assert 'only read' in client.set_parameters(**{'drv.max_freq': 50.0}).reason


@pytest.mark.parametrize('behind', ['sinus_optimal', 'sinus_g2'], indirect=True)
def test_in_speed_mode_the_speed_is_published(bench: Bench) -> None:
    in_speed = ('-p', 'expected_control_mode:=Speed', '-p', 'nominal_speed:=1500')
    _, client = start(bench, '--set', 'control.mode=Speed', settings=(*PATIENT, *in_speed))
    enable(client)
    with client.setpoints(600.0):
        turns(client, 600.0)
        status = client.latest('status')
        assert status.control_mode == DriveStatus.SPEED and status.unit == 'rpm'
        client.wait_for('actual_speed', lambda speed: abs(speed.data - 600) < 5, 'it is published')
        assert math.isnan(client.latest('actual_frequency').data)
        refused = client.set_parameters(expected_control_mode='Freque')
        assert 'while the node is unconfigured' in refused.reason
        assert client.call('stop').message == 'stopping: it ramps down'


@pytest.mark.parametrize('behind', ['sinus_optimal'], indirect=True)
def test_without_its_nominal_speed_speed_mode_is_refused(bench: Bench) -> None:
    bench.simulator()
    bench.driver('-p', 'expected_control_mode:=Speed')
    wait_until(lambda: 'set nominal_speed first, in rpm, such as 1500' in bench.log, 'the reason')


@pytest.mark.parametrize(
    ('behind', 'number'),
    [('sinus_optimal', signal.SIGTERM), ('sinus_h', signal.SIGKILL)],
    indirect=['behind'],
)
def test_an_end_of_the_driver_stops_the_motor(bench: Bench, number: int) -> None:
    drive, client = start(bench)
    enable(client)
    with client.setpoints(20.0):
        turns(client, 20.0)
        driver = bench._drivers[-1]
        driver.signal(number)
        # of a driver that was killed the PLC takes care, within its time
        assert driver.wait() == (0 if number == signal.SIGTERM else -number)
        stands(drive)
        following = bench.driver(*PATIENT)
        # a request before that may go to the one that was killed
        wait_until(lambda: 'the drive is not enabled' in following.text, 'the next one hears us')
        client.wait_for('status', lambda status: status.connected, 'it is connected')
        stays(bench, drive)
        enable(client)
        turns(client, 20.0)


@pytest.mark.parametrize(
    ('behind', 'link'),
    [
        ('sinus_g2', 'fieldbus-cut'),
        ('sinus_optimal', 'plc-stop'),
        ('sinus_h', 'line-dead'),
        ('sinus_g2', 'hangup'),
    ],
    indirect=['behind'],
)
def test_a_link_that_is_cut(bench: Bench, link: str) -> None:
    settings = ('-p', 'response_timeout:=1.0', '-p', 'lost_after:=1.5')
    drive, client = start(bench, settings=settings)
    enable(client)
    with client.setpoints(20.0):
        turns(client, 20.0)
        drive.inject(link, *(() if link == 'hangup' else (4.0,)))
        client.wait_for('status', lambda status: not status.enabled, 'it is disabled')
        wait_until(lambda: 'lost: ' in bench.log, 'the loss is reported')
        client.wait_for('status', lambda status: status.connected, 'it is back')
        stays(bench, drive)
        enable(client)
        turns(client, 20.0)


@pytest.mark.parametrize('behind', ['sinus_h'], indirect=True)
def test_a_plc_that_answers_slowly(bench: Bench) -> None:
    drive, client = start(bench, '--answer-time', '0.05:0.4')
    enable(client)
    with client.setpoints(15.0):
        turns(client, 15.0)
        assert client.call('stop').success
        stays(bench, drive)


@pytest.mark.parametrize('behind', ['sinus_optimal'], indirect=True)
def test_a_drive_that_is_not_released(bench: Bench) -> None:
    drive, client = start(bench, '--not-released')
    assert 'has not released the drive to ROS' in client.enable().message
    drive.inject('release', 'on')
    enable(client)
    with client.setpoints(15.0):
        turns(client, 15.0)
        drive.inject('release', 'off')
        client.wait_for('status', lambda status: not status.enabled, 'it is disabled')
        drive.inject('release', 'on')
        stays(bench, drive)
