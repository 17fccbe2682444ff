# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The bond of a drive's node, against a stand-in for the end that nav2's lifecycle manager has."""

from __future__ import annotations

import importlib.util
import itertools
import time
from typing import Any

from bench import A_WHILE, Bench, Client, holds_for, wait_until
from connections import needs
from lifecycle_msgs.msg import Transition
import pytest

_TWO = """
nfo_sinus_bus: {ros__parameters: {drives: [left, right]}}
left: {ros__parameters: {address: 1, autostart: false}}
right: {ros__parameters: {address: 2, autostart: false}}
"""
#: After what silence the manager takes a node for dead, s.
_TIMEOUT = 4.0
_IS_INSTALLED = importlib.util.find_spec('bond') is not None

pytestmark = needs('own')
#: No wheel has the message; nav2 brings it.
with_message = pytest.mark.skipif(not _IS_INSTALLED, reason='the package bond is not installed')


class Manager:
    """Hears the heartbeats of all nodes on the topic, and when they came."""

    def __init__(self, client: Client) -> None:
        status: Any = importlib.import_module('bond.msg').Status
        self.heard: list[tuple[float, Any]] = []
        client.node.create_subscription(
            status, '/bond', lambda message: self.heard.append((time.monotonic(), message)), 100
        )

    def of(self, name: str) -> list[Any]:
        """Return what one node has said."""
        return [message for _, message in self.heard if message.id == name]

    def is_alive(self, name: str) -> bool:
        """Return whether a bond is formed, and not broken."""
        last = [(at, message) for at, message in self.heard if message.id == name][-1:]
        return any(message.active and time.monotonic() - at < _TIMEOUT for at, message in last)


def start(bench: Bench, bond: bool) -> tuple[Any, Any, Client, Client]:
    """Start two drives and their driver."""
    simulator = bench.simulator('--address', '1', '--address', '2')
    parameters = bench.folder / 'two.yaml'
    parameters.write_text(_TWO)
    driver = bench.driver('--params-file', str(parameters), '-p', f'bond:={bond}'.lower())
    return simulator, driver, bench.client('/left'), bench.client('/right')


def bring_up(*clients: Client) -> None:
    """Configure and activate nodes."""
    for client in clients:
        for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            assert client.change_state(transition)


@with_message
def test_an_active_node_has_a_bond(bench: Bench) -> None:
    simulator, driver, left, right = start(bench, bond=True)
    manager = Manager(left)
    holds_for(A_WHILE, lambda: not manager.heard, 'none is active')
    bring_up(left, right)
    wait_until(lambda: manager.is_alive('left') and manager.is_alive('right'), 'both are formed')
    wait_until(lambda: len(manager.of('left')) > 20, 'it beats')
    beats = manager.of('left')
    assert {message.active for message in beats} == {True}
    assert len({message.instance_id for message in beats}) == 1
    assert beats[0].instance_id != manager.of('right')[0].instance_id
    assert (round(beats[0].heartbeat_period, 3), beats[0].heartbeat_timeout) == (0.1, _TIMEOUT)
    times = [at for at, message in manager.heard if message.id == 'left']
    assert max(b - a for a, b in itertools.pairwise(times)) < _TIMEOUT
    # a drive that is lost is no node that is gone
    simulator.inject('silence', 3600.0, address=2)
    right.wait_for('status', lambda status: not status.connected, 'it is lost')
    holds_for(A_WHILE, lambda: manager.is_alive('right'), 'its bond goes on')
    # it ends with the state, and another one begins with the next
    assert left.change_state(Transition.TRANSITION_DEACTIVATE)
    wait_until(lambda: not manager.is_alive('left'), 'it is broken, and not by a time-out')
    assert [message.active for message in manager.of('left')[-2:]] == [True, False]
    count = len(manager.of('left'))
    holds_for(A_WHILE, lambda: len(manager.of('left')) == count, 'nothing follows')
    assert left.change_state(Transition.TRANSITION_ACTIVATE)
    wait_until(lambda: manager.is_alive('left'), 'it is formed again')
    assert manager.of('left')[-1].instance_id != beats[0].instance_id
    # and with the driver, whose drive on the right cannot be asked
    driver.end()
    wait_until(lambda: not manager.of('left')[-1].active, 'the end is told')
    assert not manager.of('right')[-1].active


@with_message
def test_a_driver_that_is_killed_breaks_it_by_silence(bench: Bench) -> None:
    _, driver, left, _ = start(bench, bond=True)
    manager = Manager(left)
    bring_up(left)
    wait_until(lambda: manager.is_alive('left'), 'it is formed')
    driver.signal(9)
    wait_until(lambda: not manager.is_alive('left'), 'the manager finds it dead')
    assert manager.of('left')[-1].active


@with_message
def test_a_deactivation_that_fails_keeps_it(bench: Bench) -> None:
    simulator, _, left, _ = start(bench, bond=True)
    manager = Manager(left)
    bring_up(left)
    with left.run_at(20.0):
        simulator.inject('silence', 3600.0, address=1)
        assert not left.change_state(Transition.TRANSITION_DEACTIVATE)
    assert left.state() == 'active'
    holds_for(A_WHILE, lambda: manager.is_alive('left'), 'the node is active')
    assert len({message.instance_id for message in manager.of('left')}) == 1
    simulator.inject('silence', 0.0, address=1)


def test_off_is_no_bond(bench: Bench) -> None:
    _, _, left, _ = start(bench, bond=False)
    bring_up(left)
    assert not left.node.count_publishers('/bond')


@pytest.mark.skipif(_IS_INSTALLED, reason='the package bond is installed')
def test_where_the_message_is_not_installed_it_is_refused(bench: Bench) -> None:
    bench.simulator()
    driver = bench.driver('-p', 'bond:=true', fails=True)
    assert driver.wait() == 2
    assert 'bond is true, but the package bond is not installed: apt install ros-' in driver.text
