# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The calls that nav2's lifecycle manager makes, to two drives by its parameter file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
import time

from bench import A_WHILE, Bench, Client, holds_for, wait_until
from connections import needs
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import GetState
import pytest
import yaml

_CONFIG = Path(__file__).parents[2] / 'config'
#: How long the manager waits for the answer to get_state, s; for change_state it waits for ever.
_PATIENCE = 2.0

_DRIVES = """
nfo_sinus_bus: {ros__parameters: {drives: [left_wheel, right_wheel]}}
left_wheel: {ros__parameters: {address: 1, autostart: false}}
right_wheel: {ros__parameters: {address: 2, autostart: false}}
"""

_AFTER = {
    Transition.TRANSITION_CONFIGURE: State.PRIMARY_STATE_INACTIVE,
    Transition.TRANSITION_ACTIVATE: State.PRIMARY_STATE_ACTIVE,
    Transition.TRANSITION_DEACTIVATE: State.PRIMARY_STATE_INACTIVE,
    Transition.TRANSITION_CLEANUP: State.PRIMARY_STATE_UNCONFIGURED,
    Transition.TRANSITION_UNCONFIGURED_SHUTDOWN: State.PRIMARY_STATE_FINALIZED,
}
_UP = (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)
_DOWN = (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP)
_OFF = (*_DOWN, Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)


class Manager:
    """A stand-in for the lifecycle manager."""

    def __init__(self, bench: Bench) -> None:
        nodes = yaml.safe_load((_CONFIG / 'nav2' / 'lifecycle_manager.yaml').read_text())
        parameters = nodes['/**/lifecycle_manager_drives']['ros__parameters']
        self.clients: list[Client] = [bench.client(f'/{n}') for n in parameters['node_names']]

    def go(self, transitions: Iterable[int]) -> bool:
        """Take all nodes through transitions; the first one that fails ends it."""
        for transition in transitions:
            up = transition in _UP
            for client in self.clients if up else reversed(self.clients):
                client.change_state(transition)
                # it goes by the state, and not by the answer
                if _state(client) != _AFTER[transition]:
                    return False
        return True


def _state(client: Client) -> int:
    """Return a state that came in time; once in three it may have been the machine that stood."""
    for _ in range(3):
        begun = time.monotonic()
        state: int = client.call('get_state', GetState).current_state.id
        if time.monotonic() - begun < _PATIENCE:
            return state
    pytest.fail(f'no get_state answered within {_PATIENCE:g} s')


def start(bench: Bench) -> tuple:
    simulator = bench.simulator('--address', '1', '--address', '2')
    parameters = bench.folder / 'drives.yaml'
    parameters.write_text(_DRIVES)
    bench.driver('--params-file', str(parameters))
    return simulator, Manager(bench), bench.client('/nfo_sinus_bus')


def test_start_pause_resume_reset_and_shutdown(bench: Bench) -> None:
    simulator, manager, every_drive = start(bench)
    assert manager.go(_UP), 'startup'
    answer = every_drive.call('enable_all')
    assert answer.success, answer.message
    left, right = manager.clients
    with left.setpoints(20.0), right.setpoints(20.0):
        for address in (1, 2):
            wait_until(lambda a=address: simulator.state(a)['turning'], 'it turns')
        assert manager.go(_DOWN[:1]), 'pause'
        for address in (1, 2):
            wait_until(lambda a=address: not simulator.state(a)['turning'], 'it stops')
        assert manager.go(_UP[1:]), 'resume'
        for client in manager.clients:
            client.connected()
        holds_for(
            A_WHILE,
            lambda: not any(simulator.state(address)['turning'] for address in (1, 2)),
            'they are not enabled',
        )
        assert every_drive.call('enable_all').success
        wait_until(lambda: simulator.state(1)['turning'], 'it turns')
        assert manager.go(_DOWN), 'reset'
    assert not any(simulator.state(address)['turning'] for address in (1, 2))
    # a start once more, and then the end
    assert manager.go(_UP), 'startup'
    assert manager.go(_OFF), 'shutdown'
    assert left.state() == right.state() == 'finalized'


@needs('direct')
def test_start_that_finds_a_drive_silent_fails_and_can_be_repeated(bench: Bench) -> None:
    simulator, manager, _ = start(bench)
    simulator.inject('silence', 3600.0, address=2)
    assert not manager.go(_UP)
    assert [client.state() for client in manager.clients] == ['inactive', 'unconfigured']
    simulator.inject('silence', 0.0, address=2)
    # the first one refuses to be configured again, and is where it should be all the same
    assert manager.go(_UP)


def test_transition_that_cannot_be_is_answered(bench: Bench) -> None:
    _, manager, _ = start(bench)
    client = manager.clients[0]
    assert not client.change_state(Transition.TRANSITION_ACTIVATE)
    assert not client.change_state(99)
    assert client.state() == 'unconfigured'
