# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The example that switches controllers by the drives, against a stand-in for their manager."""

from __future__ import annotations

import os
from pathlib import Path
import sys
from typing import Any

from bench import A_WHILE, PATIENCE, Bench, Client, Process, holds_for, wait_until
from connections import needs
import pytest
from rclpy.qos import qos_profile_services_default

# no wheel has it: where ROS itself is installed, it comes with ros2_control
_srv = pytest.importorskip('controller_manager_msgs.srv')

_EXAMPLE = Path(__file__).parents[2] / 'examples' / 'controller_stopper.py'
_TWO = """
nfo_sinus_bus: {ros__parameters: {drives: [left_wheel, right_wheel]}}
left_wheel: {ros__parameters: {address: 1, stop_with: [right_wheel]}}
right_wheel: {ros__parameters: {address: 2, stop_with: [left_wheel]}}
"""
_SWITCH = '/controller_manager/switch_controller'
_NAME = 'diff_drive_controller'

pytestmark = needs('own')


class Manager:
    """What `controller_manager` does with a call, and what it was called for."""

    def __init__(self, client: Client) -> None:
        self.active: bool | None = None
        self.calls: list[bool] = []
        #: How many calls fail from now on, as for a controller that is not loaded yet.
        self.failures = 0
        self._client = client
        self._service: Any = None

    def start(self, active: bool) -> None:
        """Begin to serve, with the controller in some state."""
        self.active = active
        self._service = self._client.where_it_spins(
            lambda: self._client.node.create_service(
                _srv.SwitchController, _SWITCH, self._switch,
                qos_profile=qos_profile_services_default,
            )
        )

    def end(self) -> None:
        """Serve no more."""
        self._client.where_it_spins(lambda: self._client.node.destroy_service(self._service))

    def _switch(self, request: Any, response: Any) -> Any:
        given = (list(request.activate_controllers), list(request.deactivate_controllers))
        assert given in (([_NAME], []), ([], [_NAME]))
        assert request.strictness == request.BEST_EFFORT
        self.calls.append(given[0] == [_NAME])
        response.ok = not self.failures
        self.failures = max(0, self.failures - 1)
        if response.ok:
            self.active = self.calls[-1]
        return response


def start(bench: Bench) -> tuple[Any, Any, Manager, Process]:
    """Start two drives, their driver, a manager and the example."""
    simulator = bench.simulator('--address', '1', '--address', '2', *bench.drives.ramps(1))
    parameters = bench.folder / 'two.yaml'
    parameters.write_text(_TWO)
    driver = bench.driver('--params-file', str(parameters))
    for wheel in ('/left_wheel', '/right_wheel'):
        bench.client(wheel).connected()
    manager = Manager(bench.client('/left_wheel'))
    manager.start(active=True)
    command = [
        sys.executable, str(_EXAMPLE), '--ros-args', '-p', f'status_timeout:={PATIENCE / 10}'
    ]
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(bench.domain)}
    example = Process(command, environment, bench.folder / 'stopper.log')
    bench.callback(example.end)
    return simulator, driver, manager, example


def test_controllers_are_active_while_all_drives_are_enabled(bench: Bench) -> None:
    simulator, driver, manager, example = start(bench)
    wait_until(lambda: manager.active is False, 'nothing is enabled')
    left, right = bench.client('/left_wheel'), bench.client('/right_wheel')
    every_drive = bench.client('/nfo_sinus_bus')
    assert left.enable(True).success
    holds_for(A_WHILE, lambda: not manager.active, 'one of both is not enough')
    assert right.enable(True).success
    wait_until(lambda: manager.active, 'both are enabled')
    simulator.inject('fault', 5, address=1)
    wait_until(lambda: not manager.active, 'one has a fault, and the other one stops with it')
    assert left.call('fault_ack').success
    # the first call fails, and is made again
    manager.failures = 1
    count = len(manager.calls)
    assert every_drive.call('enable_all').success
    wait_until(lambda: manager.active, 'both are enabled again')
    assert manager.calls[count:] == [True, True]
    holds_for(A_WHILE, lambda: len(manager.calls) == count + 2, 'it calls on a change alone')
    # another manager has its controllers as it was told
    manager.end()
    wait_until(lambda: not left.node.count_services(_SWITCH), 'it is gone')
    assert left.call('stop').success
    manager.start(active=True)
    wait_until(lambda: not manager.active, 'what is there now is deactivated, too')
    assert every_drive.call('enable_all').success
    wait_until(lambda: manager.active, 'both are enabled again')
    # a driver that has died says nothing more
    driver.signal(9)
    wait_until(lambda: not manager.active, 'no status comes')
    example.end()
    assert 'Traceback' not in example.text
    assert f'{_NAME} activated' in example.text
