# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Several drives of one line: found, started, commanded together, added and taken away."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from pathlib import Path
import subprocess
import sys
import threading

from bench import A_WHILE, PATIENCE, Bench, Client, holds_for, wait_until
from connections import needs
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
from std_msgs.msg import Float32

_COMMAND = (sys.executable, '-c', 'from nfo_sinus_driver.cli.main import main; exit(main())')
_ADDRESSES = ('--address', '1', '--address', '2', '--address', '3')
_THREE = """
nfo_sinus_bus: {{ros__parameters: {{drives: [infeed, middle, outfeed]}}}}
infeed: {{ros__parameters: {{address: 1}}}}
middle: {{ros__parameters: {{address: 2}}}}
outfeed: {{ros__parameters: {{address: 3, {third}}}}}
"""


def start(
    bench: Bench,
    third: str = 'telemetry_rate: 2.0',
    rate: str = '25.0',
    setpoint_timeout: str = '2.5',
) -> tuple:
    """Start three drives and the driver; return the simulator and a client of each drive."""
    simulator = bench.simulator(*_ADDRESSES, *bench.drives.ramps(1))
    parameters = bench.folder / 'three.yaml'
    parameters.write_text(_THREE.format(third=third))
    settings = ('-p', f'poll_rate:={rate}', '-p', f'setpoint_timeout:={setpoint_timeout}')
    bench.driver('--params-file', str(parameters), *settings)
    clients = [bench.client(name).connected() for name in ('/infeed', '/middle', '/outfeed')]
    return simulator, clients


def frequencies(simulator) -> list[int]:
    return [round(simulator.state(address)['frequency']) for address in (1, 2, 3)]


@contextlib.contextmanager
def setpoints_for_all(client: Client, value: float) -> Iterator[None]:
    """Publish a set-point for all drives over and over."""
    publisher = client.node.create_publisher(Float32, '/nfo_sinus_bus/setpoint_all', 1)
    wait_until(publisher.get_subscription_count, 'there is a subscriber')
    ended = threading.Event()

    def publish() -> None:
        while not ended.wait(0.1):
            publisher.publish(Float32(data=value))

    thread = threading.Thread(target=publish, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@pytest.mark.every_connection
@pytest.mark.shared
@needs('direct')
def test_one_message_moves_all_drives_that_are_enabled_and_none_that_is_watched(
    bench: Bench,
) -> None:
    simulator, clients = start(bench, third='control_method: monitor')
    assert bench.client('/nfo_sinus_bus').call('enable_all').success
    with setpoints_for_all(clients[0], 20.0):
        wait_until(lambda: frequencies(simulator) == [20, 20, 0], 'two turn')
        for client in clients[:2]:
            client.wait_for('status', lambda status: status.setpoint == 20.0, 'each says so')
        # one of them is stopped, and the other turns on
        assert clients[1].call('stop').success
        wait_until(lambda: frequencies(simulator) == [20, 0, 0], 'one turns')
        holds_for(A_WHILE, lambda: frequencies(simulator) == [20, 0, 0], 'it turns on')
    assert simulator.state(3)['writes'] == {}
    assert 'control_method is monitor' not in bench.log, 'it was not even asked'


@needs('direct')
def test_the_driver_starts_with_what_a_scan_has_written(bench: Bench) -> None:
    simulator = bench.simulator(*_ADDRESSES, *bench.drives.ramps(1))
    file = bench.folder / 'found.yaml'
    connection = bench.connection
    line = ('--protocol', connection.protocol, '--model', connection.model)
    line += ('--baud-rate', str(connection.baud_rate))
    done = subprocess.run(
        [*_COMMAND, 'scan', '--port', bench.port, *line, '--addresses', '1-4',
         '--response-timeout', '2.0', '--params', str(file)],
        capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    bench.bare_driver('--params-file', str(file))
    for address in (1, 2, 3):
        client = bench.client(f'/drive_{address}').connected()
        assert client.parameter('address') == address
    every_drive = bench.client('/nfo_sinus_bus')
    assert every_drive.call('enable_all').success
    with bench.client('/drive_2').setpoints(20.0):
        wait_until(lambda: frequencies(simulator) == [0, 20, 0], 'the second turns')
    assert 'unknown' not in bench.log and 'no such parameter' not in bench.log


@needs('rtu')
def test_the_file_for_32_drives_starts_as_many(bench: Bench) -> None:
    file = Path(__file__).resolve().parents[2] / 'config' / 'conveyor_32.yaml'
    missing = bench.folder / 'missing'
    bench.bare_driver('--params-file', str(file), '-p', f'port:={missing}')
    client = bench.client('/nfo_sinus_bus')
    names = {f'section_{number:02}: drive' for number in range(1, 33)}
    seen: dict[str, dict[str, str]] = {}

    def all_there() -> bool:
        for message in client.messages['diagnostics']:
            for status in message.status:
                seen[status.name] = {pair.key: pair.value for pair in status.values}
        return names <= seen.keys()

    wait_until(all_there, 'every drive has a node', timeout=3 * PATIENCE)
    assert {int(seen[name]['address']) for name in names} == set(range(1, 33))
    assert 'is no parameter' not in bench.log


@pytest.mark.every_connection
@needs('rtu')
def test_drives_are_taken_away_and_added_while_the_others_follow(bench: Bench) -> None:
    simulator, (infeed, middle, outfeed) = start(bench, rate='2.0', setpoint_timeout='20.0')

    def turn_on() -> bool:
        return all(
            client.newest('status').enabled and abs(client.newest('status').actual - 20.0) < 1.0
            for client in (infeed, outfeed)
        )

    with infeed.run_at(20.0), outfeed.run_at(20.0), middle.run_at(20.0):
        assert middle.change_state(Transition.TRANSITION_DEACTIVATE)
        assert turn_on()
        assert middle.change_state(Transition.TRANSITION_CLEANUP)
        assert middle.state() == 'unconfigured'
        wait_until(lambda: not simulator.state(2)['driven'], 'it stands')
        assert simulator.state(2)['source'] == 'stop'
        asked = sum(request.startswith('02') for request in bench.requests())
        holds_for(A_WHILE, turn_on, 'the others follow')
        # it is left alone altogether, as one that is taken off the line
        assert sum(request.startswith('02') for request in bench.requests()) == asked
        simulator.inject('silence', 3600.0, address=2)
        assert not middle.change_state(Transition.TRANSITION_CONFIGURE)
        assert turn_on()
        simulator.inject('silence', 0.0, address=2)
        # all its parameters are read beside the polls of the others
        request = Transition(id=Transition.TRANSITION_CONFIGURE)
        configured = middle.call_async('change_state', ChangeState, transition=request)
        wait_until(configured.done, 'it is configured', timeout=3 * PATIENCE)
        assert configured.result().success
        assert middle.change_state(Transition.TRANSITION_ACTIVATE)
        # its set-points flow on, and nothing turns before it is enabled
        holds_for(A_WHILE, lambda: not simulator.state(2)['turning'], 'it stands')
        assert middle.enable().success
        wait_until(lambda: frequencies(simulator) == [20, 20, 20], 'all turn')
        assert turn_on()
    for line in bench.log.splitlines():
        if 'infeed' in line or 'outfeed' in line:
            assert not any(word in line for word in ('stopp', 'lost', 'no set-point')), line
