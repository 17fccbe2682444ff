# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Over every connection to a drive: the same node, one whole run, and the same motor at the end.

The laws over every connection are in test/unit/drive/test_laws.py, in virtual time.
"""

from __future__ import annotations

from collections.abc import Iterator
import signal

from bench import A_WHILE, PATIENCE, Bench, Client, wait_until
from connections import Connection, needs
from lifecycle_msgs.msg import Transition
from nfo_sinus_msgs.msg import DriveStatus
from parameter_bench import refused, set_one
import pytest
from setting_names import SETTINGS

from nfo_sinus_driver.demo.bench import own_domain
from nfo_sinus_driver.simulator.control import Client as Simulated

pytestmark = pytest.mark.every_connection

#: So slow that a motor which is let go stands soon, Hz.
_SPEED = 8.0
EITHER_WAY = pytest.mark.parametrize(
    'frequency', [_SPEED, pytest.param(-_SPEED, marks=needs('reverse'))]
)
_BOOT = ('--boot-time', '0.5')
#: The computer has more to do than this one driver.
_MODEST = ('-p', 'poll_rate:=10')

_NAMES = {line.split(',')[2] for line in SETTINGS.splitlines() if line}

def _simulator(bench: Bench) -> Simulated:
    return bench.simulator(*bench.drives.ramps(0.3), *_BOOT)


class Rig:
    """One drive and its driver for the tests that leave both as they were."""

    def __init__(self, bench: Bench) -> None:
        self.connection = bench.connection
        self.drives = bench.drives
        self.drive = _simulator(bench)
        self.driver = bench.driver(*_MODEST)
        self.client: Client = bench.client().connected()

    def stands(self) -> None:
        """Wait until the motor stands and nothing will make it turn."""
        self.drive.wait_for(_stands, timeout=PATIENCE)

    def stays_still(self) -> None:
        """Watch the motor for a while of its own time, once it stands."""
        _stays_still(self.drive)


@pytest.fixture(scope='module')
def the_rig(tmp_path_factory: pytest.TempPathFactory, connection: Connection) -> Iterator[Rig]:
    with own_domain() as domain, Bench(domain, tmp_path_factory.mktemp('rig'), connection) as bench:
        yield Rig(bench)


@pytest.fixture
def rig(the_rig: Rig) -> Rig:
    """The rig, connected and at rest."""
    the_rig.client.connected()
    assert the_rig.client.call('stop').success
    the_rig.stands()
    return the_rig


def _stands(state: dict) -> bool:
    return not state['turning'] and not state['driven']


def _stays_still(drive: Simulated) -> None:
    began = drive.wait_for(_stands, timeout=PATIENCE)['time']
    state = drive.wait_for(
        lambda state: not _stands(state) or state['time'] > began + A_WHILE / 2, timeout=PATIENCE
    )
    assert _stands(state), state


# --- connected ----------------------------------------------------------------------------------


@needs('parameters')
def test_every_parameter_that_there_is_over_this_connection_is_there(rig: Rig) -> None:
    has = rig.client.parameter_names() & _NAMES
    assert _NAMES - has == rig.connection.beyond
    parameters = rig.drive.state()['parameters']
    for name in ('control.accel', 'freque.f_fix1', 'control.st_mode', 'motor.u_nom'):
        assert rig.client.parameter(name) == parameters[name]


@needs('parameters')
def test_a_parameter_is_set_refused_and_followed(rig: Rig) -> None:
    writes = sum(rig.drive.state()['writes'].values())
    assert set_one(rig.client, 'freque.f_fix1', 12.5).successful
    state = rig.drive.state()
    assert state['parameters']['freque.f_fix1'] == 12.5
    assert sum(state['writes'].values()) == writes + 1
    refused(set_one(rig.client, 'freque.f_fix1', 151.0), 'freque.f_fix1', '0 to 150')
    assert rig.client.parameter('freque.f_fix1') == 12.5
    rig.drive.inject('set', 'freque.f_fix1', 17.5)
    assert rig.client.call('refresh_parameters').success
    wait_until(lambda: rig.client.parameter('freque.f_fix1') == 17.5, 'it follows')
    assert sum(rig.drive.state()['writes'].values()) == writes + 1


@needs('bare')
def test_a_drive_without_parameters_refuses_them(rig: Rig) -> None:
    assert not rig.client.parameter_names() & _NAMES
    refused(set_one(rig.client, 'control.accel', 6.0), 'control.accel')
    refused(rig.client.set_parameters(drive_timeout=2.0), 'drive_timeout')


# --- turning ------------------------------------------------------------------------------------


@EITHER_WAY
def test_it_turns_either_way_and_stops(rig: Rig, frequency: float) -> None:
    client = rig.client
    assert rig.driver.text.count('connected: ') == 1
    with client.run_at(frequency):
        state = rig.drive.state()
        assert state['frequency'] == pytest.approx(frequency, abs=1)
        status = client.latest('status')
        assert status.enabled
        if status.valid & DriveStatus.VALID_SETPOINT_REACHED:
            status = client.wait_for('status', lambda status: status.setpoint_reached, 'reached')
        if status.valid & DriveStatus.VALID_REVERSE:
            # on a busy machine a status from before it turned may come last
            client.wait_for(
                'status', lambda status: status.reverse == (frequency < 0), 'the direction'
            )
        if 'direct' in rig.connection.features:
            wait_until(
                lambda: client.newest('inv_st').text == rig.drive.state()['inv_st_text'],
                'the text on the display',
            )
        client.wait_for('telemetry', lambda m: abs(m.frequency - frequency) < 1, 'telemetry')
        answer = client.call('stop')
        assert answer.success
        # so short a ramp may be over by then
        assert answer.message.startswith(('stopping: it ramps down', 'stopped')), answer.message
        rig.stays_still()
    assert not rig.drives.commanded(rig.drive.state())


# --- the way out --------------------------------------------------------------------------------


@pytest.mark.shared
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
def test_a_signal_stops_the_motor_and_gives_control_back(bench: Bench, number: int) -> None:
    """And a whole run, on a line that takes its time, has broken no law."""
    drive = bench.simulator(*bench.drives.ramps(0.3), *_BOOT)
    driver = bench.driver(*_MODEST)
    client = bench.client().connected()
    with client.run_at(_SPEED):
        driver.signal(number)
        assert driver.wait() == 0, driver.text
        state = drive.wait_for(_stands, timeout=PATIENCE)
    assert bench.drives.left(state)
    assert not state['fault']
    assert bench.violations() == []


@needs('timeout')
def test_kill_is_survived_by_the_drive_timeout_alone(bench: Bench) -> None:
    drive = _simulator(bench)
    # so long that no busy machine is silent for it
    driver = bench.driver(*_MODEST, '-p', 'drive_timeout:=3.0')
    client = bench.client().connected()
    with client.run_at(_SPEED):
        driver.signal(signal.SIGKILL)
        assert driver.wait() == -signal.SIGKILL
        assert drive.state()['driven']
        state = drive.wait_for(lambda state: not state['driven'], timeout=PATIENCE)
        assert state['fault'], 'the drive stopped for another reason'
        # the next one finds the fault, tells it, and lets nothing turn
        bench.driver(*_MODEST)
        client.wait_for('status', lambda status: status.connected, 'a new driver')
        _stays_still(drive)
        client.wait_for('inv_st', lambda message: message.text == bench.drives.silence, 'the fault')
        assert client.call('fault_ack').success
        wait_until(lambda: client.enable().success, 'it can be enabled', period=0.2)
        drive.wait_for(lambda state: state['frequency'] > _SPEED - 1, timeout=PATIENCE)


@needs('watched')
def test_monitor_writes_nothing(bench: Bench) -> None:
    drive = _simulator(bench)
    bench.driver(*_MODEST, '-p', 'control_method:=monitor')
    client = bench.client().connected()
    with client.setpoints(_SPEED):
        for service in ('stop', 'quick_stop', 'fault_ack'):
            assert 'monitor' in client.call(service).message
        assert 'monitor' in client.enable().message
        client.wait_for('telemetry', lambda message: True, 'telemetry flows')
        for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP):
            assert client.change_state(transition)
    state = drive.state()
    assert not state['writes']
    assert not state['command_writes']
    assert not state.get('ack_reads') and not state.get('sio_err_reads')
