# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What ends a driver from outside: its ``ros2`` command, and a signal while it is starting."""

from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys

from bench import PATIENCE, Bench, wait_until
import pytest

#: As ``ros2 run`` is: it waits for its child, passes nothing on, and SIGTERM ends it at once.
_ROS2 = """\
import subprocess, sys
process = subprocess.Popen(sys.argv[4:])
while process.returncode is None:
    try:
        process.communicate()
    except KeyboardInterrupt:
        pass
sys.exit(process.returncode)
"""

#: Runs a script that gets a signal when it imports a module.
_SIGNALLED = """\
import os, runpy, signal, sys
class Signal:
    def find_spec(self, name, *_):
        if name == MODULE and self in sys.meta_path:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGTERM)
sys.meta_path.insert(0, Signal())
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name='__main__')
"""


def _like_ros2_run(folder: Path) -> tuple[str, ...]:
    """A command that starts what follows as ``ros2 run`` does, by that name."""
    script = folder / 'ros2'
    script.write_text(_ROS2)
    return sys.executable, str(script), 'run', 'nfo_sinus_driver', 'driver'


def _children(pid: int) -> list[int]:
    return [int(word) for word in Path(f'/proc/{pid}/task/{pid}/children').read_text().split()]


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGKILL], ids=lambda n: n.name)
def test_the_end_of_the_ros2_run_that_started_it_stops_the_motor(
    bench: Bench, number: int
) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    ros2 = bench.driver(through=_like_ros2_run(bench.folder))
    client = bench.client().connected()
    (driver,) = _children(ros2.pid)
    with client.run_at(20.0):
        assert drive.state()['turning']
        ros2.signal(number)
        assert ros2.wait() == -number
        drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
        wait_until(lambda: not Path(f'/proc/{driver}/exe').exists(), 'the driver has ended')
    assert bench.drives.left(drive.state()), 'control was not given back'
    assert f'process {ros2.pid}, which this driver ends with, has ended' in ros2.text


def test_a_driver_outlives_a_parent_that_is_not_ros2(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    number = bench.folder / 'number'
    # as a daemon is started: the parent ends at once, and a supervisor of orphans takes over
    shell = bench.driver(through=('sh', '-c', f'"$@" & echo $! >{number}; sleep 2', 'sh'))
    assert shell.wait() == 0
    client = bench.client().connected()
    driver = int(number.read_text())
    try:
        with client.run_at(20.0):
            assert drive.state()['turning']
    finally:
        os.kill(driver, signal.SIGTERM)
    wait_until(lambda: not Path(f'/proc/{driver}/exe').exists(), 'the driver has ended')
    assert 'SIGTERM: stopping the motors' in shell.text


@pytest.mark.parametrize('module', ['rclpy', 'nfo_sinus_driver.node.drive.drive_node'])
def test_a_signal_while_it_is_still_loading_ends_it_cleanly(bench: Bench, module: str) -> None:
    bench.simulator(paced=True)
    code = _SIGNALLED.replace('MODULE', repr(module))
    driver = bench.driver(through=(sys.executable, '-c', code))
    assert driver.wait() == 0, driver.text
    assert 'SIGTERM: ended before the bus was opened, nothing was written' in driver.text
    assert not bench.requests()


def test_an_end_before_the_first_answer_says_that_a_motor_may_run_on(bench: Bench) -> None:
    drive = bench.simulator(paced=True)
    drive.inject('line-dead', 60.0)
    driver = bench.driver()
    wait_until(bench.frames, 'the driver asks for the drive')
    driver.signal(signal.SIGTERM)
    assert driver.wait() == 0, driver.text
    assert 'the drive has not answered yet: if its motor was left running' in driver.text


def test_as_process_1_under_ros2_run_it_says_that_no_signal_will_reach_it(bench: Bench) -> None:
    bench.simulator(paced=True)
    isolated = ('unshare', '--user', '--map-root-user', '--pid', '--fork', '--mount-proc')
    if subprocess.run((*isolated, 'true'), check=False, capture_output=True).returncode:
        pytest.skip('no process namespace may be made here')
    driver = bench.driver(through=(*isolated, '--kill-child', *_like_ros2_run(bench.folder)))
    wait_until(lambda: 'ros2 is process 1 of this container' in driver.text, 'the warning')
    driver.signal(signal.SIGKILL)
    driver.wait()
