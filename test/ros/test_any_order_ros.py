# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Fixed histories of commands and of what happens to a drive, in an order that a seed makes up.

In virtual time, and in thousands, that is ``test_any_order.py``; here it is the node as it is used,
by its topics and services. What counts is what the simulated drive does.
"""

from __future__ import annotations

import contextlib
import random
from typing import Any

from bench import PATIENCE, Bench, Client, wait_until
from connections import needs
import pytest
from support.drives import Drives

from nfo_sinus_driver.simulator.control import Client as Simulated

pytestmark = needs('states')

_BOOT = ('--boot-time', '0.2')
_EAGER = ('-p', 'poll_rate:=20.0', '-p', 'setpoint_timeout:=0.3')
#: For how long nothing may start, s of the simulated drive; longer than a few polls.
_A_MOMENT = 0.2


class Walk(contextlib.ExitStack):
    """
    One history, and the law: nothing turns without an enable and set-points since the last loss.

    :ivar enabled: it was enabled, and nothing has happened since that ends that.
    """

    def __init__(self, drives: Drives, drive: Simulated, client: Client) -> None:
        super().__init__()
        self._drives = drives
        self._drive = drive
        self._client = client
        self.enabled = False
        #: A client publishes set-points.
        self._sends = False
        self._sending = self.enter_context(contextlib.ExitStack())

    def judge(self) -> None:
        """Wait for what has to follow, and see that nothing else does."""
        client, drive = self._client, self._drive
        client.wait_for('status', lambda status: status.connected, 'it is connected')
        client.wait_for(
            'status', lambda status: status.enabled == self.enabled, f'enabled: {self.enabled}'
        )
        if self.enabled and self._sends:
            drive.wait_for(lambda state: state['frequency'] > 15, timeout=PATIENCE)
            return

        def moves(state: dict[str, Any]) -> bool:
            # enabled without set-points it has current and stands; without current it may coast
            return bool(state['driven'] and (state['turning'] or not self.enabled))

        stood = drive.wait_for(lambda state: not moves(state), timeout=PATIENCE)
        state = drive.wait_for(
            lambda state: moves(state) or state['time'] > stood['time'] + _A_MOMENT,
            timeout=PATIENCE,
        )
        assert not moves(state), state

    # --- commands ---------------------------------------------------------------------------------

    def enable(self) -> None:
        state = self._drive.state()
        response = self._client.enable()
        assert response.success != bool(state['fault']), response.message
        self.enabled = response.success

    def set_points(self) -> None:
        if not self._sends:
            self._sending.enter_context(self._client.setpoints(20.0))
            self._sends = True

    def no_set_points(self) -> None:
        self._sending.close()
        self._sends = False

    def run_motor(self) -> None:
        """Put right what is in the way, enable it and send set-points."""
        self._drive.inject('run', True)
        self.fault_ack()
        wait_until(lambda: self._client.enable().success, 'it can be enabled', period=0.05)
        self.enabled = True
        self.set_points()
        self.judge()

    def stop(self) -> None:
        assert self._client.call('stop').success
        self.enabled = False

    def quick_stop(self) -> None:
        assert self._client.call('quick_stop').success
        self.enabled = False

    def fault_ack(self) -> None:
        self._drive.inject('ack-cause-gone')
        wait_until(lambda: self._client.call('fault_ack').success, 'acknowledged', period=0.05)
        assert not self._drive.state()['fault']

    # --- what happens to it -----------------------------------------------------------------------

    def fault(self) -> None:
        self._drive.inject('fault', self._drives.overload.code, standing=True)
        self.enabled = False
        self.judge()
        assert not self._client.call('fault_ack').success
        self.judge()
        self.fault_ack()

    def run_input(self) -> None:
        self._drive.inject('run', False)
        self.enabled = False
        self.judge()
        self._drive.inject('run', True)

    def keypad_stop(self) -> None:
        self._drives.stop_at_keypad(self._drive, self._noticed)
        self.enabled = False

    def _noticed(self) -> None:
        self._client.wait_for('status', lambda status: not status.enabled, 'it is disabled')

    def power_cycle(self) -> None:
        self._drive.inject('power-cycle')
        self._drive.wait_for(lambda state: not state['silent'], timeout=PATIENCE)
        self.enabled = False

    def silence(self) -> None:
        """Let it be silent for so long that it is lost; the motor runs on meanwhile."""
        self._drive.inject('silence', PATIENCE)
        self._client.wait_for('status', lambda status: not status.connected, 'it is lost')
        self._drive.inject('silence', 0.0)
        self.enabled = False


#: What ends a run; each has one to end.
ENDS = (
    Walk.stop,
    Walk.quick_stop,
    Walk.fault,
    Walk.run_input,
    Walk.keypad_stop,
    Walk.power_cycle,
    Walk.silence,
)
#: What comes after whatever was before.
OTHERS = (Walk.enable, Walk.set_points, Walk.no_set_points)


@pytest.mark.parametrize('seed', [1])
@pytest.mark.parametrize(
    'method',
    [
        pytest.param('mode_scmd', marks=needs('scmd')),
        pytest.param('drive_control', marks=needs('scmd')),
        pytest.param('function_bits', marks=needs('movitrac')),
    ],
)
def test_any_order(bench: Bench, method: str, seed: int) -> None:
    drive = bench.simulator(*bench.drives.ramps(0.2), *_BOOT, paced=True)
    bench.driver(*_EAGER, '-p', f'control_method:={method}')
    history = random.Random(seed)
    with Walk(bench.drives, drive, bench.client().connected()) as walk:
        for event in history.sample(ENDS + OTHERS, len(ENDS + OTHERS)):
            if event in ENDS:
                walk.run_motor()
            event(walk)
            walk.judge()
