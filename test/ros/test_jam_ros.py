# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A jam as a user meets it: warned of, then stopped; what cannot notice one is refused."""

from __future__ import annotations

from pathlib import Path

from bench import Bench, Client, wait_until
from connections import CONNECTIONS, needs
from diagnostic_msgs.msg import DiagnosticStatus
from nfo_sinus_msgs.msg import DriveStatus

from nfo_sinus_driver.demo.bench import own_domain

_JAM = {'jam_current': 4.0, 'jam_speed': 8.0, 'jam_time': 1.0}
#: A load that holds the motor, at the current limit of the drive; and what is usual.
_BLOCKED, _FREE = 60.0, 0.3


def _diagnosis(client: Client, level: bytes, text: str) -> None:
    """Wait until the diagnosis of the drive has a level, and says something."""
    client.wait_for(
        'diagnostics',
        lambda message: any(
            status.name.endswith(': drive') and status.level == level and text in status.message
            for status in message.status
        ),
        f'the diagnosis says {text!r}',
    )


@needs('own')
def test_a_jam_is_warned_of_and_stops_the_motor_once_that_is_wanted(bench: Bench) -> None:
    simulator = bench.simulator(*bench.drives.ramps(1))
    arguments = [word for name, value in _JAM.items() for word in ('-p', f'{name}:={value}')]
    bench.driver(*arguments, '-p', 'telemetry_rate:=10.0')
    client = bench.client().connected()
    with client.run_at(20.0):
        simulator.inject('load', _BLOCKED)
        wait_until(lambda: 'jammed: its motor has taken ' in bench.log, 'the warning')
        assert 'nothing is stopped, for on_jam is warn' in bench.log
        _diagnosis(client, DiagnosticStatus.WARN, 'jammed: its motor has taken ')
        assert client.latest('status').enabled
        simulator.inject('load', _FREE)
        _diagnosis(client, DiagnosticStatus.OK, '')
        # all of it can be changed while the motor runs
        assert client.set_parameters(on_jam='stop', jam_current=4.5, jam_time=1.5).successful
        client.wait_for('status', lambda status: abs(status.actual - 20.0) < 1, 'it turns again')
        simulator.inject('load', _BLOCKED)
        status = client.wait_for(
            'status',
            lambda status: status.stop_reason == DriveStatus.REASON_JAM and not status.enabled,
            'it is stopped',
        )
        assert status.stop_text.startswith('its motor has taken ')
        assert status.stop_text.endswith('(jam_current 4.5 A, jam_speed 8 Hz): free what is stuck')
        # the set-points go on
        simulator.inject('load', _FREE)
        wait_until(lambda: not simulator.state()['turning'], 'the motor stands')
        count = len(client.messages['status'])
        wait_until(lambda: len(client.messages['status']) > count + 10, 'some statuses')
        assert not any(status.enabled for status in client.messages['status'][count:])
        assert not simulator.state()['turning']
        assert client.enable().success
        client.wait_for('status', lambda status: abs(status.actual - 20.0) < 1, 'it turns')
    assert 'then call /nfo_sinus/enable to go on' in bench.log


@needs('own')
def test_what_cannot_notice_a_jam_is_refused(bench: Bench) -> None:
    bench.simulator()
    bench.driver('-p', 'telemetry_rate:=2.0')
    client = bench.client().connected()
    refused = client.set_parameters(jam_current=4.0)
    assert not refused.successful and 'jam_current needs jam_speed' in refused.reason
    refused = client.set_parameters(jam_current=4.0, jam_speed=8.0, telemetry_rate=0.0)
    assert not refused.successful and 'jam_current needs telemetry_rate' in refused.reason
    # whole numbers will do
    assert client.set_parameters(jam_current=4, jam_speed=8).successful
    refused = client.set_parameters(telemetry_rate=0.5)
    assert not refused.successful and 'jam_time 2 s: ' in refused.reason


def test_a_family_that_does_not_measure_its_current_is_refused(tmp_path: Path) -> None:
    with own_domain() as domain, Bench(domain, tmp_path, CONNECTIONS['movitrac']) as bench:
        bench.simulator()
        driver = bench.driver(
            '-p', 'telemetry_rate:=2.0', '-p', 'jam_current:=4.0', '-p', 'jam_speed:=8.0'
        )
        assert driver.wait() == 2
        reason = 'jam_current: movitrac31 with control_method function_bits measures no current'
        assert f'{reason}; set jam_current to 0' in driver.text


def test_a_plc_that_does_not_show_the_current_is_refused_at_configure(tmp_path: Path) -> None:
    with own_domain() as domain, Bench(domain, tmp_path, CONNECTIONS['telegram1_h']) as bench:
        bench.simulator()
        bench.driver(
            '-p', 'telemetry_rate:=2.0', '-p', 'jam_current:=4.0', '-p', 'jam_speed:=8.0'
        )
        client = bench.client()
        reason = 'jam_current is set, and this drive does not tell its current ('
        wait_until(lambda: reason in bench.log, 'the reason')
        assert client.state() in ('unconfigured', 'configuring')
        # and is tried again, as whatever keeps it from the drive
        assert client.set_parameters(jam_current=0.0).successful
        client.connected()
