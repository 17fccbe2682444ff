# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A gateway that lets reads pass and no writes: what is not acknowledged has not happened."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib

from bench import FULL_RATE, Bench, wait_until
from connections import needs
from device_server import DeviceServer
import pytest

pytestmark = needs('rtu')

_SPEED = 20.0
#: Longer than it takes until the stop is said to fail, too, also on a busy machine, s.
_SOON = 12.0


@pytest.fixture
def server(bench: Bench) -> Iterator[DeviceServer]:
    """Return a device server between a driver and its drive."""
    bench.drive = bench.simulator(*bench.drives.ramps(0.3), paced=True)
    server = DeviceServer(bench.port)
    bench.port = server.port
    yield server
    server.close()


@pytest.mark.parametrize('ends', ['0 is given', 'set-points cease'])
def test_a_set_point_that_is_not_acknowledged_ends_the_enable(
    bench: Bench, server: DeviceServer, ends: str
) -> None:
    driver = bench.driver(*FULL_RATE, '-p', 'setpoint_timeout:=2.0')
    client = bench.client().connected()
    with client.run_at(_SPEED):
        server.reads_only = True
    given = client.setpoints(0.0) if ends == '0 is given' else contextlib.nullcontext()
    with given:
        status = client.wait_for('status', lambda now: not now.enabled, 'no longer enabled')
        assert status.connected
        assert status.stop_reason == status.REASON_SETPOINT_REFUSED
        wait_until(lambda: 'CANNOT STOP THE MOTOR' in driver.text, 'it is said', _SOON)
    assert 'was not acknowledged for' in driver.text
    assert 'ramps to a stop' not in driver.text
    assert bench.drive.state()['turning']
    server.reads_only = False
    bench.drive.wait_for(lambda state: not state['driven'], timeout=_SOON)
    wait_until(lambda: 'the stop is confirmed now' in driver.text, 'it is confirmed')
