# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A whole run, judged from the trace that the simulated drive's end of the line has written."""

from __future__ import annotations

import signal

from bench import FULL_RATE, Bench
from connections import needs
from lifecycle_msgs.msg import Transition
from line_commands import run_commands
from support.wire import Request, understand

pytestmark = needs('states')


def _requests(bench: Bench) -> list[Request]:
    """Return what was asked for on the line, but for who the drive is."""
    asked = [
        understand(bytes.fromhex(frame['hex']), bench.connection.protocol)
        for frame in bench.frames()
        if frame['direction'] == 'request'
    ]
    return [request for request in asked if request is not None]


def test_a_run_breaks_no_law_on_the_wire(bench: Bench) -> None:
    connection = bench.connection
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    driver = bench.driver(*FULL_RATE, '-p', 'drive_timeout:=16.0')
    client = bench.client().connected()
    with client.run_at(20.0):
        client.wait_for('telemetry', lambda message: message.frequency > 15, 'telemetry')
    with client.setpoints(-15.0):
        client.wait_for('status', lambda status: status.actual < -14, 'reverse')
        assert client.call('stop').success
        assert client.enable().success
        client.wait_for('status', lambda status: status.actual < -14, 'reverse again')
        assert client.call('quick_stop').success
        drive.inject('run', False)
        assert not client.enable().success
        drive.inject('run', True)
        assert client.enable().success
        assert client.change_state(Transition.TRANSITION_DEACTIVATE)
        assert client.change_state(Transition.TRANSITION_CLEANUP)
        assert client.change_state(Transition.TRANSITION_CONFIGURE)
        assert client.change_state(Transition.TRANSITION_ACTIVATE)
        assert client.enable().success
    driver.signal(signal.SIGTERM)
    assert driver.wait() == 0, driver.text
    # the fifth is that of the enable that was refused, where it is not known before
    assert run_commands(connection, _requests(bench)) == 4 + (not bench.drives.tells_run_input)
    assert bench.violations() == []
    state = drive.state()
    assert not state.get('ack_reads') and not state.get('mode_ext_writes')
    assert state['fault'] == 0
