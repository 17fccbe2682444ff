# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``make demo`` and ``make run`` do what they promise."""

from __future__ import annotations

import os
from pathlib import Path
import re
import signal
import subprocess
import sys

from bench import Bench, Process, _executable, wait_until
from connections import needs
import pytest
import rclpy
from rclpy.node import Node

from nfo_sinus_driver.demo.bench import own_domain

_DEMO_TIME = 300.0
#: As a shell starts its background jobs.
_BACKGROUND = ('env', '--ignore-signal=INT,QUIT')


def test_the_demo_runs_to_its_end_with_nothing_but_ros(tmp_path: Path) -> None:
    # what records and draws it is not installed: test_demo_record.py has the other case
    libraries = ('rosbag2_py', 'rosbags', 'matplotlib')
    for name in libraries:
        (tmp_path / f'{name}.py').write_text(f'raise ImportError("No module named {name}")')
    path = f'{tmp_path}:{os.environ.get("PYTHONPATH", "")}'
    done = subprocess.run(
        [sys.executable, '-m', 'nfo_sinus_driver.demo', '--output', str(tmp_path / 'here')],
        env={**os.environ, 'PYTHONPATH': path},
        capture_output=True,
        text=True,
        timeout=_DEMO_TIME,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for step in ('enable: enabled', '30.0 Hz', '-20.0 Hz', 'Overload', 'acknowledged 5', 'stop:'):
        assert step in done.stdout, done.stdout
    [line] = [line for line in done.stdout.splitlines() if 'neither a bag nor a plot' in line]
    assert 'neither rosbag2_py nor rosbags is installed (apt install ros-' in line
    assert 'No module named matplotlib (apt install python3-matplotlib)' in line
    assert not (tmp_path / 'here').exists()


@needs('own')
def test_ctrl_c_ends_the_demo(bench: Bench) -> None:
    command = [*_BACKGROUND, sys.executable, '-m', 'nfo_sinus_driver.demo']
    folder = bench.folder / 'output'
    process = Process(
        [*command, '--output', str(folder)], dict(os.environ), bench.folder / 'demo.log'
    )
    bench.callback(process.end)
    wait_until(lambda: 'enable: enabled' in process.text, 'it runs')
    process.signal(signal.SIGINT)
    assert process.wait() == 130, process.text
    assert 'ended before the run was done' in process.text
    assert 'Traceback' not in process.text
    assert not (folder / 'ride.png').exists()


@needs('own')
def test_make_run_ends_with_the_motor_stopped(bench: Bench) -> None:
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(bench.domain)}
    command = [*_BACKGROUND, sys.executable, '-m', 'nfo_sinus_driver.demo.run']
    process = Process(command, environment, bench.folder / 'make_run.log')
    bench.callback(process.end)
    client = bench.client().connected()
    with client.run_at(15.0):
        port = re.search(r'simulator inject --link (\S+)', process.text)
        assert port, process.text
        process.signal(signal.SIGINT)
        assert process.wait() == 0
    wait_until(lambda: 'control released' in process.text, 'the driver stopped the motor')
    assert not os.path.exists(port[1]), 'the simulator left its port behind'


@needs('own')
@pytest.mark.parametrize('installed', [False, True])
def test_make_run_prints_only_lines_that_work_here(bench: Bench, installed: bool) -> None:
    folder = bench.folder / 'path'
    folder.mkdir()
    if installed:
        (folder / 'ros2').write_text('#!/bin/sh\n')
        (folder / 'ros2').chmod(0o755)
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(bench.domain), 'PATH': str(folder)}
    command = [sys.executable, '-m', 'nfo_sinus_driver.demo.run']
    process = Process(command, environment, bench.folder / 'make_run.log')
    bench.callback(process.end)
    wait_until(lambda: 'Ctrl-C stops' in process.text, 'it says what to try')
    lines = [line.split() for line in process.text.splitlines() if line.startswith('  ')]
    programs = [line[0] for line in lines]
    assert ('ros2' in programs) is installed
    if not installed:
        root = Path(__file__).resolve().parents[2]
        scripts = {path.name for path in Path(_executable('simulator')).parent.iterdir()}
        for first, program, *rest in lines:
            assert (root / first).is_file()
            assert program in scripts or (root / rest[0]).is_file(), program


def test_a_domain_in_which_another_program_is_is_not_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with own_domain() as number:
        pass
    # it may have drives of the same names
    monkeypatch.setattr('nfo_sinus_driver.demo.bench._DOMAINS', (number,))
    context = rclpy.context.Context()
    rclpy.init(context=context, domain_id=number)
    try:
        another = Node('another', context=context)
        with pytest.raises(RuntimeError, match='no ROS domain is free'), own_domain():
            pass
        another.destroy_node()
    finally:
        rclpy.shutdown(context=context)
