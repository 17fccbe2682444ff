# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Every way out ends with the motor stopped, seen from the simulated drive's own state."""

from __future__ import annotations

import os
from pathlib import Path
import re
import signal
import subprocess

from bench import A_WHILE, EXECUTED, PATIENCE, Bench, wait_until
from connections import needs
from lifecycle_msgs.msg import Transition
import pytest
from std_srvs.srv import SetBool

#: Its inverter status in the start delay.
_START_DELAY = {'sinus_g2': 25, 'sinus_optimal': 54}


def _stops(bench: Bench, state: dict) -> bool:
    """Return whether the motor stands or is on its way: the drive drives it to a stop or not."""
    return not state['turning'] or bench.drives.stopping(state)


@pytest.mark.parametrize(
    'number',
    [
        signal.SIGINT,
        signal.SIGTERM,
        signal.SIGHUP,
        signal.SIGQUIT,
        signal.SIGUSR1,
        signal.SIGRTMIN,
    ],
    ids=lambda number: number.name,
)
def test_a_signal_stops_the_motor_and_leaves_no_fault(bench: Bench, number: int) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    # as a background job of a shell is started, and worse
    driver = bench.driver(through=('env', '--ignore-signal=INT,QUIT,HUP,TERM,USR1,RTMIN'))
    client = bench.client().connected()
    with client.run_at(20.0):
        assert drive.state()['turning']
        driver.signal(number)
        assert driver.wait() == 0, driver.text
        state = drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
    assert bench.drives.left(state), 'control was not given back'
    assert state['fault'] == 0


def test_no_thread_of_a_library_can_take_a_signal(bench: Bench) -> None:
    bench.simulator(paced=True)
    driver = bench.driver(through=EXECUTED)
    bench.client().connected()
    threads = Path(f'/proc/{driver.pid}/task')
    wait_until(lambda: len([*threads.iterdir()]) > 5, 'its threads')
    for thread in threads.iterdir():
        blocked = re.search(r'SigBlk:\t(\w+)', (thread / 'status').read_text(encoding='utf-8'))
        assert blocked
        term = int(blocked[1], 16) >> (signal.SIGTERM - 1) & 1
        assert term or int(thread.name) == driver.pid, thread.name


def test_the_end_of_the_launch_that_started_it_stops_the_motor(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    with subprocess.Popen(('sleep', '1000')) as launch:
        driver = bench.driver('--', '--end-with', str(launch.pid))
        client = bench.client().connected()
        with client.run_at(20.0):
            assert drive.state()['turning']
            # it says nothing to the driver, and no process waits for it
            launch.kill()
            assert driver.wait() == 0, driver.text
            state = drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
        assert bench.drives.left(state), 'control was not given back'
        assert state['fault'] == 0
        said = f'process {launch.pid}, which this driver ends with, has ended: stopping the motors'
        assert said in driver.text


@pytest.mark.parametrize('given', ['gone', 'soon', '0', ''])
def test_a_driver_that_ends_with_no_process_does_not_start(bench: Bench, given: str) -> None:
    if given == 'gone':
        with subprocess.Popen(('true',)) as launch:
            launch.wait()
        given = str(launch.pid)
    driver = bench.bare_driver('--', '--end-with', given)
    assert driver.wait() == 2
    assert 'cannot start: --end-with' in driver.text


def test_a_driver_without_a_folder_for_its_log_says_what_to_do(bench: Bench) -> None:
    nowhere = ('env', '-u', 'ROS_LOG_DIR', '-u', 'ROS_HOME', 'HOME=/proc/nowhere')
    driver = bench.bare_driver(through=nowhere)
    assert driver.wait() == 2
    assert 'cannot start: ROS has no folder for its logs, set ROS_LOG_DIR' in driver.text


def test_a_signal_does_not_wait_for_the_end_of_a_long_ramp(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1, 60), paced=True)
    driver = bench.driver('-p', 'shutdown_timeout:=1.0')
    client = bench.client().connected()
    with client.run_at(20.0):
        driver.signal(signal.SIGTERM)
        assert driver.wait() == 0, driver.text
        state = drive.state()
    assert state['turning']
    assert not bench.drives.commanded(state)
    assert state['driven'] and bench.drives.stopping(state)
    assert state['fault'] == 0


@needs('timeout')
def test_a_clean_exit_during_a_long_ramp_leaves_no_fault_behind_a_drive_timeout(
    bench: Bench,
) -> None:
    drive = bench.simulator(*bench.drives.ramps(1, 60), paced=True)
    driver = bench.driver('-p', 'shutdown_timeout:=1.0', '-p', 'drive_timeout:=2.0')
    client = bench.client().connected()
    with client.run_at(20.0):
        driver.signal(signal.SIGTERM)
        assert driver.wait() == 0, driver.text
    ended = drive.state()['time']
    state = drive.wait_for(lambda state: state['time'] > ended + 3.0, timeout=PATIENCE)
    assert state['fault'] == 0
    assert bench.drives.stopping(state)
    assert not bench.drives.commanded(state)
    assert not state['error_log']


@needs('timeout')
def test_kill_is_survived_by_the_drive_timeout_alone(bench: Bench) -> None:
    drive = bench.simulator(
        *bench.drives.ramps(1, 60), *bench.drives.no_timeout
    , paced=True)
    # so long that no busy machine is silent for it
    driver = bench.driver('-p', 'drive_timeout:=3.0')
    client = bench.client().connected()
    with client.run_at(20.0):
        assert bench.drives.has_timeout(drive.state(), 3.0)
        driver.signal(signal.SIGKILL)
        assert driver.wait() == -signal.SIGKILL
        state = drive.wait_for(lambda state: not state['driven'], timeout=PATIENCE)
    assert state['fault'], 'the drive stopped for another reason'


@needs('sio_tot')
def test_the_driver_after_one_that_was_killed_puts_back_what_that_one_has_found(
    bench: Bench,
) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), *bench.drives.timeout(8.0), paced=True)
    settings = ('-p', 'drive_timeout:=-1.0', '-p', 'lost_after:=3.0')
    driver = bench.driver(*settings)
    client = bench.client().connected()
    with client.run_at(20.0):
        assert bench.drives.has_timeout(drive.state(), 3.5)
        driver.signal(signal.SIGKILL)
        assert driver.wait() == -signal.SIGKILL
        state = drive.wait_for(lambda state: not state['driven'], timeout=PATIENCE)
    assert bench.drives.has_timeout(state, 3.5)
    driver = bench.driver(*settings)
    wait_until(lambda: 'was ended before it could put back' in bench.log, 'it is recalled')
    client = bench.client().connected()
    assert client.call('fault_ack').success
    # older firmware takes settings only while the bus has control
    assert client.call('enable', SetBool, data=True).success
    driver.signal(signal.SIGTERM)
    assert driver.wait() == 0, driver.text
    assert bench.drives.has_timeout(drive.state(), 8.0)


@needs('timeout')
def test_a_drive_is_kept_alive_while_its_node_is_inactive(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    # what keeps it alive is polls, and parameters that are read again; polls alone have a test of
    # their own (test_poll_schedule)
    settings = ('drive_timeout:=6.0', 'poll_rate:=0.1', 'telemetry_rate:=0.0')
    bench.driver(*(word for setting in settings for word in ('-p', setting)))
    client = bench.client().connected()
    with client.run_at(20.0):
        assert client.call('stop').success
        running = drive.state()['time']
        state = drive.wait_for(
            lambda state: state['fault'] or state['time'] > running + 8.0, timeout=PATIENCE
        )
        assert not state['fault']
        assert client.change_state(Transition.TRANSITION_DEACTIVATE)
        stopped = drive.state()['time']
        state = drive.wait_for(
            lambda state: state['fault'] or state['time'] > stopped + 8.0, timeout=PATIENCE
        )
    assert not state['fault']
    assert bench.drives.taken(state), 'control is still ours, and that makes this a test'


@needs('direct')
def test_without_a_drive_timeout_the_driver_warns_once(bench: Bench) -> None:
    bench.simulator(paced=True)
    driver = bench.driver()
    bench.client().connected()
    warning = (
        'set drive_timeout' if bench.connection.tells else 'the motor runs on; use the RUN input'
    )
    wait_until(lambda: warning in driver.text, 'the warning')
    assert driver.text.count(warning) == 1


def test_deactivate_stops_the_motor_and_is_not_undone(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    bench.driver()
    client = bench.client().connected()
    with client.run_at(20.0):
        assert client.change_state(Transition.TRANSITION_DEACTIVATE)
        assert _stops(bench, drive.state())
        drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
        stood = drive.state()['time']
        state = drive.wait_for(
            lambda state: state['time'] > stood + 2.5 or state['turning'], timeout=PATIENCE
        )
        assert not state['turning']
        assert client.state() == 'inactive', 'autostart undid what a person did'
        assert not client.enable().success


def test_deactivate_ends_an_enable_that_is_on_its_way(bench: Bench) -> None:
    # slow answers keep the enable long enough on its way
    drive = bench.simulator('--turnaround', '0.1', *bench.drives.ramps(1), paced=True)
    driver = bench.driver('-p', 'response_timeout:=1.0')
    client = bench.client().connected()
    with client.setpoints(20.0):
        enable = client.call_async('enable', SetBool, data=True)
        drive.wait_for(bench.drives.taken, timeout=PATIENCE)
        assert client.change_state(Transition.TRANSITION_DEACTIVATE)
        wait_until(enable.done, 'enable answers')
        assert 'stopped while it was being enabled' in enable.result().message
        assert client.change_state(Transition.TRANSITION_ACTIVATE)
        began = drive.state()['time']
        state = drive.wait_for(
            lambda state: state['turning'] or state['time'] > began + A_WHILE, timeout=PATIENCE
        )
        assert not state['turning']
    driver.signal(signal.SIGINT)
    assert driver.wait() == 0, driver.text
    assert bench.drives.left(drive.state())


@needs('delay')
def test_disable_does_not_wait_for_an_enable_in_its_start_delay(bench: Bench) -> None:
    drive = bench.simulator('--set', 'control.run_dly=3000', paced=True)
    bench.driver()
    client = bench.client().connected()
    enable = client.call_async('enable', SetBool, data=True)
    drive.wait_for(
        lambda state: state['inv_st'] == _START_DELAY[bench.connection.model], timeout=PATIENCE
    )
    other = bench.client()
    assert other.enable(False).success
    wait_until(enable.done, 'enable answers')
    assert not enable.result().success
    drive.wait_for(lambda state: not bench.drives.commanded(state), timeout=PATIENCE)


def test_cleanup_gives_control_back_without_mode_ext(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    bench.driver()
    client = bench.client().connected()
    with client.run_at(20.0):
        assert client.change_state(Transition.TRANSITION_DEACTIVATE)
        assert client.change_state(Transition.TRANSITION_CLEANUP)
    state = drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
    assert bench.drives.left(state)
    assert state['fault'] == 0


def test_lifecycle_shutdown_stops_the_motor(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    bench.driver()
    client = bench.client().connected()
    with client.run_at(20.0):
        assert client.change_state(Transition.TRANSITION_ACTIVE_SHUTDOWN)
        assert _stops(bench, drive.state())
        state = drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
    assert bench.drives.left(state)


def test_a_setpoint_that_is_no_longer_refreshed_ramps_the_motor_down(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    driver = bench.driver('-p', 'setpoint_timeout:=3.0')
    client = bench.client().connected()
    with client.run_at(20.0):
        pass
    drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
    assert bench.drives.commanded(drive.state()), 'it is still enabled'
    wait_until(lambda: 'no set-point for 3 s' in driver.text, 'the warning')
    with client.setpoints(15.0):
        client.wait_for('status', lambda status: status.actual > 14, 'it moves again')
    assert driver.text.count('no set-point for') == 1


def test_ctrl_z_does_not_suspend_the_driver(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    driver = bench.driver()
    client = bench.client().connected()
    with client.run_at(20.0):
        driver.signal(signal.SIGTSTP)
        wait_until(lambda: 'SIGTSTP ignored' in driver.text, 'the warning')
        assert client.call('stop').success
        drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)


def test_a_driver_that_was_suspended_takes_no_signal_for_granted(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    driver = bench.driver()
    client = bench.client().connected()
    with client.run_at(20.0):
        driver.signal(signal.SIGSTOP)
        stood = drive.state()['time']
        # longer than it ever waits for a signal
        drive.wait_for(lambda state: state['time'] > stood + 1.0, timeout=PATIENCE)
        driver.signal(signal.SIGCONT)
        driver.signal(signal.SIGTSTP)
        wait_until(lambda: 'SIGTSTP ignored' in driver.text, 'the warning')
        assert driver.text.count('ignored') == 1, driver.text
        assert driver.running


def test_an_exit_does_not_wait_for_a_reader_that_does_not_read(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    pipe = bench.folder / 'pipe'
    os.mkfifo(pipe)
    with open(os.open(pipe, os.O_RDWR | os.O_NONBLOCK), 'wb', buffering=0) as full:
        while full.write(b'.'):
            continue
        into_the_pipe = ('sh', '-c', f'exec "$@" >{pipe} 2>&1', 'sh')
        driver = bench.driver('--log-level', 'debug', through=into_the_pipe)
        client = bench.client().connected()
        with client.run_at(20.0):
            driver.signal(signal.SIGTERM)
            assert driver.wait() == 0
        state = drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
    assert bench.drives.left(state), 'control was not given back'


def test_a_driver_whose_streams_are_closed_takes_its_log_for_no_signal(bench: Bench) -> None:
    bench.simulator(*bench.drives.ramps(1), paced=True)
    driver = bench.driver(through=('sh', '-c', 'exec "$@" <&- >&- 2>&-', 'sh'))
    client = bench.client().connected()
    with client.run_at(20.0):
        driver.signal(signal.SIGTERM)
        assert driver.wait() == 0


def test_an_exit_with_a_dead_line_says_that_the_stop_is_not_confirmed(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    driver = bench.driver('-p', 'shutdown_timeout:=1.0')
    client = bench.client().connected()
    with client.run_at(20.0):
        drive.inject('line-dead', 60.0)
        driver.signal(signal.SIGINT)
        assert driver.wait() == 1
    wait_until(lambda: 'NOT confirmed' in driver.text, 'the log says why')


def test_an_exit_that_cannot_release_a_drive_whose_stop_is_confirmed_says_only_that(
    bench: Bench,
) -> None:
    drive = bench.simulator(*bench.drives.ramps(10), paced=True)
    driver = bench.driver('-p', 'shutdown_timeout:=2.0')
    client = bench.client().connected()
    with client.run_at(20.0):
        driver.signal(signal.SIGTERM)
        wait_until(lambda: 'stopping: ' in driver.text, 'it ramps down')
        drive.inject('silence', 60.0)
        assert driver.wait() == 0, driver.text
    assert 'nothing is left to stop, but control of the drive is not released' in driver.text
    assert 'WITHOUT a confirmed stop' not in driver.text


def test_an_exit_claims_no_stop_of_a_drive_that_is_lost_and_was_not_enabled(bench: Bench) -> None:
    drive = bench.simulator()
    driver = bench.driver('-p', 'shutdown_timeout:=1.0')
    client = bench.client().connected()
    drive.inject('silence', 60.0)
    client.wait_for('status', lambda status: not status.connected, 'it is lost')
    driver.signal(signal.SIGTERM)
    assert driver.wait() == 0, driver.text
    assert 'control of the drive is not released' in driver.text
    assert 'is confirmed' not in driver.text
