# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The view beside the running driver, on a terminal: what it shows, and the keys that stop."""

from __future__ import annotations

import signal
import subprocess
import sys

from bench import PATIENCE, Bench, wait_until
from connections import needs
import pytest

from nfo_sinus_driver.node.monitor import GraphSource

_TWO = """
/**/nfo_sinus_bus: {ros__parameters: {drives: [drive_2, drive_10]}}
/**/drive_2: {ros__parameters: {address: 1}}
/**/drive_10: {ros__parameters: {address: 2}}
"""
#: What the key for the row above sends.
_UP = '\x1b[A'


def start(bench: Bench) -> object:
    """Start a driver with two drives in a namespace; return the simulated line."""
    simulator = bench.simulator('--address', '1', '--address', '2')
    parameters = bench.folder / 'two.yaml'
    parameters.write_text(_TWO)
    bench.driver('--params-file', str(parameters), '-r', '__ns:=/conveyor')
    for name in ('/conveyor/drive_2', '/conveyor/drive_10'):
        bench.client(name).connected()
    return simulator


@pytest.mark.parametrize('columns', [80, 160])
@needs('watched', 'states')
def test_a_fault_a_lost_line_and_stops_by_keys(bench: Bench, columns: int) -> None:
    simulator = start(bench)
    first = bench.client('/conveyor/drive_2').connected()
    second = bench.client('/conveyor/drive_10').connected()
    view = bench.view(columns=columns)
    view.wait_for('2 drives', '■ 2 standing', 'drive_2', 'drive_10', '% used')
    # a screen may be read while it is drawn
    wait_until(lambda: 0 < view.text.find('drive_2') < view.text.find('drive_10'), 'in order')

    assert first.enable().success and second.enable().success
    with first.setpoints(20.0), second.setpoints(25.0):
        # no standstill before this: with its message it is taken for what was asked for
        view.wait_for('► 2 running', '20.0 Hz', '25.0 Hz', 'enabled')
        # whatever is discovered first is chosen, and remains so when the other comes above it
        view.press(_UP + 's')
        wait_until(lambda: not simulator.state(1)['turning'], 'the one that was chosen stands')
        view.wait_for('■ 1 standing', '► 1 running')
        assert simulator.state(2)['turning'], 'the other one runs on'
        view.press('a')
        wait_until(lambda: not simulator.state(2)['turning'], 'all stand')
        view.wait_for('■ 2 standing')

    simulator.inject('fault', bench.drives.overload.code, address=2)
    view.wait_for('✗ 1 fault')
    view.press('n')
    view.wait_for('/conveyor/drive_10  ✗', 'do: ')
    view.press('k')
    view.wait_for('■ 2 standing', 'fault_ack: acknowledged', gone=['✗'])
    simulator.inject('fault', bench.drives.overload.code, address=2)
    view.wait_for('✗ 1 fault')
    view.press('e')
    view.wait_for('error log: ')
    view.press('e')
    simulator.inject('silence', 3600.0, address=1)
    view.wait_for('? 1 silent', '✗ 1 fault')
    simulator.inject('silence', 0.0, address=1)
    view.wait_for('■ 1 standing', gone=['silent'])
    view.press('q')
    assert view.wait() == 0
    assert view.settings == view.before, 'the terminal is as it was'


def test_a_stop_waits_until_its_service_is_discovered(bench: Bench) -> None:
    simulator = bench.simulator(*bench.drives.ramps(1))
    bench.driver()
    client = bench.client().connected()
    source = GraphSource(client.node.context)
    try:
        wait_until(lambda: source.next_picture().drives, 'the drive is found', period=0.25)
        with client.run_at(20.0):
            # as on a busy machine, where its topics come before its services
            source._driver_nodes['/nfo_sinus'].stop = None
            source.stop('/nfo_sinus')
            wait_until(
                lambda: source.next_picture() and not simulator.state()['turning'],
                'it stands',
                period=0.25,
            )
    finally:
        source.close()


@pytest.mark.each_kind
@needs('watched')
def test_a_motor_that_turns_is_not_shown_as_standing(bench: Bench) -> None:
    # of some drives no state is known, only what their status comes to
    simulator = bench.simulator(*bench.drives.ramps(1))
    bench.driver()
    client = bench.client().connected()
    view = bench.view()
    view.wait_for('■ 1 standing')
    with client.run_at(20.0):
        view.wait_for('► 1 running', gone=['standing'])
    view.press('a')
    wait_until(lambda: not simulator.state()['turning'], 'it stands')
    view.wait_for('■ 1 standing')


def test_a_driver_that_is_gone_is_not_shown_as_if_it_were_there(bench: Bench) -> None:
    bench.simulator()
    driver = bench.driver()
    bench.client().connected()
    view = bench.view()
    view.wait_for('1 drive ', '/nfo_sinus', gone=['not connected'])
    driver.signal(signal.SIGKILL)
    view.wait_for('· 1 gone', 'its driver is gone')
    view.press('sa')
    # by a service that is there no more, or by one without a response
    view.wait_for('/nfo_sinus: ', 'NOT')
    bench.driver()
    view.wait_for('■ 1 standing', gone=['gone'])
    # the new one is known by its services, too
    bench.client().connected()
    wait_until(lambda: _stopped(view), 'it is stopped by the key', period=1.0)


def _stopped(view) -> bool:
    # what is known of the stops before is known until one is confirmed
    view.press('sa')
    return 'NOT' not in view.text and 'not answered' not in view.text


@needs('watched')
def test_stop_all_leaves_out_no_drive_whose_line_is_not_looked_at(bench: Bench) -> None:
    simulator = start(bench)
    client = bench.client('/conveyor/drive_2').connected()
    # the line of another driver, which has no port
    bench.bare_driver('-r', '__ns:=/other', '-p', f'port:={bench.folder / "nowhere"}')
    view = bench.view('/conveyor/drive_2', '/other')
    view.wait_for('1 standing', '/other/nfo_sinus_bus')
    with client.run_at(20.0):
        view.wait_for('► 1 running')
        view.press('a')
        wait_until(lambda: not simulator.state(1)['turning'], 'it stands')


def test_before_there_is_a_driver_it_says_how_one_is_started(bench: Bench) -> None:
    view = bench.view()
    view.wait_for('no drives', 'ros2 run nfo_sinus_driver driver', 'ROS_DOMAIN_ID')
    bench.simulator()
    bench.driver()
    view.wait_for('1 drive ')


@needs('watched')
def test_only_the_namespaces_that_were_given(bench: Bench) -> None:
    start(bench)
    bench.view('/robot').wait_for('No drive in /robot yet')
    bench.view('conveyor').wait_for('2 drives')
    bench.view('/conveyor/drive_2').wait_for('1 drive ')


@pytest.mark.parametrize('end', [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_however_it_is_ended_the_terminal_is_as_it_was(bench: Bench, end: int) -> None:
    view = bench.view()
    view.wait_for('No drive yet')
    view.signal(end)
    assert view.wait() == 0
    assert view.settings == view.before


def test_without_a_terminal_it_says_so() -> None:
    done = subprocess.run(
        [sys.executable, '-m', 'nfo_sinus_driver.node.monitor'],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE, check=False,
    )
    assert done.returncode == 2
    assert 'the view needs a terminal' in done.stderr
