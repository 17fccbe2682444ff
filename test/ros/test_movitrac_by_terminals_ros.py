# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A MOVITRAC that its terminals start, by topics and services: control_method remote_setpoint."""

from __future__ import annotations

from pathlib import Path

from bench import Bench, wait_until
from connections import CONNECTIONS
from nfo_sinus_msgs.msg import DriveStatus

from nfo_sinus_driver.demo.bench import own_domain


def test_the_terminals_start_the_motor_and_the_set_point_topic_gives_its_frequency(
    tmp_path: Path,
) -> None:
    with own_domain() as domain, Bench(domain, tmp_path, CONNECTIONS['movitrac']) as bench:
        drive = bench.simulator('--set', 'serial.control_mode=Remote setpoint')
        bench.driver('-p', 'control_method:=remote_setpoint')
        client = bench.client().connected()
        refused = client.enable()
        assert not refused.success
        assert 'no terminal with a direction is closed (41 or 42)' in refused.message
        drive.inject('terminal', 41, 'closed')
        with client.run_at(20.0):
            status = client.wait_for('status', lambda status: status.enabled, 'it is enabled')
            assert status.control_method == DriveStatus.REMOTE_SETPOINT == 7
            drive.inject('terminal', 41, 'open')
            wait_until(lambda: not drive.state()['turning'], 'the motor stands')
            client.wait_for('status', lambda status: not status.enabled, 'it is not enabled')
        assert client.call('stop').success
