# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A device server that stops passing bytes until it is connected to again."""

from __future__ import annotations

from collections.abc import Iterator
import signal

from bench import FULL_RATE, Bench, wait_until
from connections import needs
from device_server import DeviceServer
import pytest

pytestmark = needs('rtu')

_SPEED = 20.0
#: Longer than it may take to find out, to connect again and to stop, also on a busy machine, s.
_SOON = 10.0


@pytest.fixture
def server(bench: Bench) -> Iterator[DeviceServer]:
    """Return a device server between a driver and its drive."""
    bench.drive = bench.simulator(*bench.drives.ramps(0.3), paced=True)
    server = DeviceServer(bench.port)
    bench.port = server.port
    yield server
    server.close()


def test_the_motor_stops_although_the_system_reports_no_error(
    bench: Bench, server: DeviceServer
) -> None:
    driver = bench.driver(*FULL_RATE)
    client = bench.client().connected()
    with client.run_at(_SPEED):
        server.mute = True
        bench.drive.wait_for(lambda state: not state['driven'], timeout=_SOON)
    assert server.clients == 2
    client.wait_for('status', lambda status: status.connected and not status.enabled, 'it answers')
    wait_until(lambda: 'drives answer again' in driver.text, 'it is reported')
    assert driver.text.count('the port is opened again') == 1


def test_an_end_connects_once_more_before_it_gives_up(bench: Bench, server: DeviceServer) -> None:
    driver = bench.driver(
        *FULL_RATE, '-p', 'lost_after:=30.0', '-p', 'shutdown_timeout:=30.0'
    )
    client = bench.client().connected()
    with client.run_at(_SPEED):
        server.mute = True
        driver.signal(signal.SIGTERM)
        assert driver.wait() == 0
    assert server.clients == 2
    # it may still be on its ramp
    wait_until(lambda: not bench.drive.state()['turning'], 'the motor stands')
