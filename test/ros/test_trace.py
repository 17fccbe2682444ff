# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A whole ride, judged from the trace that the simulated drive's end of the line has written."""

from __future__ import annotations

import signal

from bench import Bench
from lifecycle_msgs.msg import Transition
from support.trace_laws import violations
from ways import needs

from nfo_sinus_driver.link import LineSettings

_BAUD_RATE = 19200

pytestmark = needs('rtu')


def test_a_ride_breaks_no_law_on_the_wire(bench: Bench) -> None:
    drive = bench.simulator(
        '--baud', str(_BAUD_RATE), '--set', 'control.accel=1', '--set', 'control.retard=1'
    )
    driver = bench.driver('-p', f'baud_rate:={_BAUD_RATE}', '-p', 'drive_timeout:=3.0')
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
    frames = bench.frames()
    requests = [frame['hex'] for frame in frames if frame['direction'] == 'request']
    runs = [request for request in requests if request.startswith('010602980101')]
    assert len(runs) == 5, 'every enable but the refused one, whose run command is withdrawn, too'
    assert violations(frames, LineSettings(_BAUD_RATE).frame_gap) == []
    state = drive.state()
    assert state['ack_reads'] == 0
    assert state['mode_ext_writes'] == 0
    assert state['fault'] == 0
