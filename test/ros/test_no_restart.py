# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Nothing turns by itself: after whatever stopped it, the motor waits for an enable."""

from __future__ import annotations

from collections.abc import Iterator
import signal

from bench import A_WHILE, PATIENCE, Bench, Client, Process, wait_until
from connections import Connection, needs
import pytest
from support.variants import hardest

from nfo_sinus_driver.demo.bench import own_domain
from nfo_sinus_driver.simulator.control import Client as Simulated

#: The computer has more to do than this one driver.
_MODEST = ('-p', 'poll_rate:=10.0')

#: One drive and its driver for all events: each test leaves it stopped.
Rig = tuple[Bench, Simulated, Client]


def _hardest(bench: Bench) -> tuple[str, ...]:
    """Return the options of the drive that makes it hardest, such as [C98]."""
    variant = hardest(bench.connection.model)
    options = (f'--{name.replace("_", "-")}={value}' for name, value in variant.items())
    return (*bench.drives.ramps(1), '--boot-time', '0.5', *options)


@pytest.fixture(scope='module')
def rig(tmp_path_factory: pytest.TempPathFactory, connection: Connection) -> Iterator[Rig]:
    with own_domain() as domain, Bench(domain, tmp_path_factory.mktemp('rig'), connection) as bench:
        drive = bench.simulator(*_hardest(bench))
        bench.driver(*_MODEST)
        yield bench, drive, bench.client().connected()


def _stays_still(drive: Simulated) -> None:
    """Watch the simulated motor for a while of its own time."""
    # what still coasts may be caught and ramped down first
    began = drive.wait_for(
        lambda state: not state['turning'] and not state['driven'], timeout=PATIENCE
    )['time']
    state = drive.wait_for(
        lambda state: state['turning'] or state['driven'] or state['time'] > began + A_WHILE,
        timeout=PATIENCE,
    )
    assert not state['turning'], state
    assert not state['driven'], state


def _turns_after_enable(drive: Simulated, client: Client) -> None:
    wait_until(lambda: client.enable().success, 'it can be enabled again', period=0.2)
    drive.wait_for(lambda state: state['turning'] and state['frequency'] > 15, timeout=PATIENCE)


def _fault_and_acknowledgement(bench: Bench, drive: Simulated, client: Client) -> None:
    overload = bench.drives.overload
    drive.inject('fault', overload.code)
    client.wait_for('status', lambda status: status.fault and not status.enabled, 'the fault')
    wait_until(lambda: f'stopped: fault {overload}' in bench.log, 'the reason in the log')
    # a stop may not be confirmed yet
    wait_until(lambda: overload.text in client.enable().message, 'it is refused, and why')
    assert client.call('fault_ack').message == f'acknowledged {overload}'


def _fault_that_stands(bench: Bench, drive: Simulated, client: Client) -> None:
    overheating = bench.drives.overheating
    drive.inject('fault', overheating.code, standing=True)
    client.wait_for('status', lambda status: status.fault and not status.enabled, 'the fault')
    refused = client.call('fault_ack')
    assert not refused.success
    assert f'{overheating.text} is still active' in refused.message
    drive.inject('ack-cause-gone')
    assert client.call('fault_ack').success


def _run_input_lost_and_back(bench: Bench, drive: Simulated, client: Client) -> None:
    drive.inject('run', False)
    client.wait_for('status', lambda status: not status.enabled, 'it is disabled')
    drive.inject('run', True)


def _keypad_stop(bench: Bench, drive: Simulated, client: Client) -> None:
    bench.drives.stop_at_keypad(
        drive,
        lambda: client.wait_for('status', lambda status: not status.enabled, 'it is disabled'),
    )


def _power_cycle(bench: Bench, drive: Simulated, client: Client) -> None:
    # a MOVITRAC that forgets nothing, and is back soon, does not tell (docs/drives/movitrac31.md)
    drive.inject('power-cycle', *([3.0] if bench.connection.model == 'movitrac31' else []))
    client.wait_for('status', lambda status: not status.enabled, 'it is disabled')
    client.wait_for('status', lambda status: status.connected, 'it is back')


def _line_gone_for_five_seconds(bench: Bench, drive: Simulated, client: Client) -> None:
    drive.inject('line-dead', 5.0)
    status = client.wait_for('status', lambda status: not status.connected, 'the line is gone')
    assert not status.enabled
    assert drive.state()['turning'], 'the drive runs on, and that is what makes this a test'
    client.wait_for('status', lambda status: status.connected, 'the line is back')


def _adapter_unplugged(bench: Bench, drive: Simulated, client: Client) -> None:
    drive.inject('hangup')
    client.wait_for('status', lambda status: not status.enabled, 'it is disabled')
    client.wait_for('status', lambda status: status.connected, 'the port is back')


def _mode_changed_at_the_drive(bench: Bench, drive: Simulated, client: Client) -> None:
    bench.drives.run_by_terminals(drive)
    client.wait_for('status', lambda status: not status.enabled, 'it is disabled')
    bench.drives.end_run_by_terminals(drive)


def _stop_service(bench: Bench, drive: Simulated, client: Client) -> None:
    # the ramp is short, and its end may come before the drive is asked
    answer = client.call('stop').message
    assert answer.startswith(('stopping: it ramps down', 'stopped (')), answer


def _quick_stop_service(bench: Bench, drive: Simulated, client: Client) -> None:
    assert client.call('quick_stop').message == bench.drives.quick_stopped


def _disable(bench: Bench, drive: Simulated, client: Client) -> None:
    assert client.enable(False).success


@pytest.mark.parametrize(
    'event',
    [
        _fault_and_acknowledgement,
        _fault_that_stands,
        pytest.param(_run_input_lost_and_back, marks=needs('direct', 'run_input')),
        pytest.param(_keypad_stop, marks=needs('keypad')),
        _power_cycle,
        _line_gone_for_five_seconds,
        _adapter_unplugged,
        pytest.param(_mode_changed_at_the_drive, marks=needs('direct')),
        _stop_service,
        _quick_stop_service,
        _disable,
    ],
    ids=lambda event: event.__name__.strip('_'),
)
def test_nothing_turns_again_until_enable(rig: Rig, event) -> None:
    bench, drive, client = rig
    client.connected()
    with client.run_at(20.0):
        event(bench, drive, client)
        _stays_still(drive)
        _turns_after_enable(drive, client)
        assert client.call('stop').success
        _stays_still(drive)


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGKILL], ids=lambda n: n.name)
def test_a_restarted_driver_lets_nothing_turn(bench: Bench, number: int) -> None:
    drive = bench.simulator(*_hardest(bench))
    driver: Process = bench.driver()
    client = bench.client().connected()
    with client.run_at(20.0):
        driver.signal(number)
        driver.wait()
        if number == signal.SIGKILL:
            assert drive.state()['driven'], 'the drive runs on, and that makes this a test'
        bench.driver()
        _stays_still(drive)
        client.wait_for('status', lambda status: status.connected, 'it is connected')
        _stays_still(drive)
        _turns_after_enable(drive, client)


@needs('direct')
def test_enable_without_run_input_is_refused_and_withdrawn(bench: Bench) -> None:
    drive = bench.simulator(*_hardest(bench), '--no-run-input')
    bench.driver()
    client = bench.client().connected()
    with client.setpoints(20.0):
        refused = client.enable()
        assert not refused.success
        assert bench.drives.without_run_input in refused.message
        drive.wait_for(lambda state: not bench.drives.commanded(state), timeout=PATIENCE)
        drive.inject('run', True)
        _stays_still(drive)


def test_setpoints_from_before_enable_do_not_count(bench: Bench) -> None:
    drive = bench.simulator(*_hardest(bench))
    bench.driver()
    client = bench.client().connected()
    client.publish(20.0)
    assert client.enable().success
    began = drive.state()['time']
    state = drive.wait_for(
        lambda state: state['turning'] or state['time'] > began + A_WHILE, timeout=PATIENCE
    )
    assert not state['turning']
    status = client.latest('status')
    assert status.enabled
    assert status.setpoint == 0


@needs('direct', 'local')
def test_a_drive_that_is_run_from_its_terminals_is_left_alone(bench: Bench) -> None:
    drive = bench.simulator(*_hardest(bench))
    bench.drives.run_by_terminals(drive)
    running = drive.wait_for(lambda state: state['driven'], timeout=PATIENCE)
    driver = bench.driver()
    client = bench.client().connected()
    assert client.call('stop').message.startswith('the bus has no control of this drive')
    driver.signal(signal.SIGINT)
    assert driver.wait() == 0
    state = drive.state()
    assert state['driven']
    assert state['mode'] == running['mode']
    assert not bench.drives.taken(state)
