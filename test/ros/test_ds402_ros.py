# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A G2 by the drive profile of its CANopen module, with ROS; the laws are tested without it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from bench import PATIENCE, Bench, wait_until
from connections import CONNECTIONS
from nfo_sinus_msgs.msg import DriveStatus
import pytest

from nfo_sinus_driver.demo.bench import own_domain

OVERVOLTAGE = 8
RAMPS = ('--set', 'control.accel=0.5', '--set', 'control.retard=0.5')


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with own_domain() as domain, Bench(domain, tmp_path, CONNECTIONS['canopen']) as made:
        yield made
        assert made.violations() == []


def test_a_run_by_the_drive_profile_alone(bench: Bench) -> None:
    alone = ('--canopen-state-machine', 'absent', '--set', 'control.mode=Speed')
    drive = bench.simulator(*RAMPS, *alone)
    bench.driver('-p', 'control_method:=ds402')
    client = bench.client().connected()
    with client.run_at(-600.0):
        status = client.messages['status'][-1]
        assert status.control_method == DriveStatus.DS402
        assert (status.control_mode, status.unit) == (DriveStatus.SPEED, 'rpm')
        assert status.state == DriveStatus.OPERATION_ENABLED
        assert status.valid & DriveStatus.VALID_NETWORK_CONTROL and status.network_control
        # no bit of it says so: the sign of the speed does
        assert status.valid & DriveStatus.VALID_REVERSE and status.reverse
        drive.inject('fault', OVERVOLTAGE)
        client.wait_for('status', lambda status: status.fault, 'the fault')
        drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
        response = client.call('fault_ack')
        assert response.success and 'error code 3210h (voltage)' in response.message
        assert not drive.state()['driven']
    with client.run_at(600.0):
        response = client.call('stop')
        assert response.success, response.message
        drive.wait_for(lambda state: not state['driven'], timeout=PATIENCE)


def test_drive_control_that_a_module_lacks_is_refused_and_said(bench: Bench) -> None:
    bench.simulator('--canopen-state-machine', 'absent')
    driver = bench.driver('-p', 'control_method:=drive_control')
    client = bench.client()
    client.wait_for('status', lambda status: not status.connected, 'it is not connected')
    remedy = 'set control_method of /nfo_sinus to another one (mode_scmd, ds402)'
    wait_until(lambda: remedy in driver.text, 'the log says what to set')
