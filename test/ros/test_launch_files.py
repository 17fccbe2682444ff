# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The launch files end with the status of the driver, as far as launch can."""

from __future__ import annotations

import os
from pathlib import Path
import re
import signal
import sys

from bench import Bench, Process, wait_until
from connections import needs
import pytest
from support.places import ROOT

pytest.importorskip('launch_ros', reason='launch is not installed')

#: As `ros2 launch` does it without a terminal.
LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

path, *arguments = sys.argv[1:]
service = LaunchService(noninteractive=True)
source = PythonLaunchDescriptionSource(path)
given = [tuple(one.split(':=')) for one in arguments]
service.include_launch_description(
    LaunchDescription([IncludeLaunchDescription(source, launch_arguments=given)])
)
sys.exit(service.run())
"""


def launch(bench: Bench, name: str, *arguments: str) -> Process:
    """Launch a file in the domain of a bench."""
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(bench.domain)}
    command = [sys.executable, '-c', LAUNCH, str(ROOT / 'launch' / name), *arguments]
    # the driver of the package is installed, its code that of this clone
    environment['PYTHONPATH'] = f'{ROOT}:{environment.get("PYTHONPATH", "")}'
    process = Process(command, environment, bench.folder / 'launch.log')
    bench.callback(process.end)
    return process


@needs('own')
def test_a_driver_that_does_not_start_makes_launch_fail(bench: Bench) -> None:
    process = launch(bench, 'driver.launch.py', 'port:=/dev/null', 'address:=999')
    assert process.wait() == 1, process.text
    assert 'address 999: allowed are' in process.text
    assert 'the driver has ended with status 2, so launch will end with 1' in process.text


@needs('own')
@pytest.mark.parametrize('killed', [False, True])
def test_a_driver_that_is_killed_makes_launch_fail_and_ctrl_c_does_not(
    bench: Bench, killed: bool
) -> None:
    port = Path(bench.folder) / 'line'
    process = launch(bench, 'simulation.launch.py', f'link:={port}')
    bench.client().connected()
    if killed:
        (pid,) = re.findall(r'\[driver-\d+\]: process started with pid \[(\d+)\]', process.text)
        os.kill(int(pid), signal.SIGKILL)
    else:
        process.signal(signal.SIGINT)
    assert process.wait() == int(killed), process.text
    assert ('ended with status -9' in process.text) is killed
    wait_until(lambda: not port.exists(), 'the simulated drive has ended')


@needs('own')
def test_the_clock_and_who_configures_the_drives_are_arguments(bench: Bench) -> None:
    port = Path(bench.folder) / 'line'
    arguments = (f'port:={port}', 'autostart:=false', 'use_sim_time:=true')
    process = launch(bench, 'driver.launch.py', *arguments)
    client = bench.client()
    wait_until(lambda: client.state() == 'unconfigured', 'nothing configures it')
    assert client.parameter('use_sim_time') is True and client.parameter('autostart') is False
    process.signal(signal.SIGINT)
    assert process.wait() == 0, process.text


@needs('own')
def test_a_switch_that_is_none_starts_nothing(bench: Bench) -> None:
    process = launch(bench, 'driver.launch.py', 'autostart:=never')
    assert process.wait() == 1 and 'autostart:=never: write true or false' in process.text
    assert 'process started' not in process.text
