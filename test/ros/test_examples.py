# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Each example against simulated drives, as a process of its own; what turns is asked of them."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
import contextlib
import dataclasses
import functools
import importlib
import math
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
from typing import Any
from xml.etree import ElementTree

from bench import PATIENCE, Bench, Client, Process, wait_until
from connections import needs
from geometry_msgs.msg import Twist
import pytest

_FOLDER = Path(__file__).parents[2] / 'examples'
_CPP = _FOLDER / 'cpp_client'
_DOCS = Path(__file__).parents[2] / 'docs' / 'examples.md'
#: What no test has to wait for: a machine may rest for longer than a drive may be silent.
_PATIENT = '--status-timeout', f'{PATIENCE:g}'
_NOT_CONFIRMED = 'THE STOP IS NOT CONFIRMED'

_TWO = """
nfo_sinus_bus: {ros__parameters: {drives: [left, right]}}
left: {ros__parameters: {address: 1}}
right: {ros__parameters: {address: 2}}
"""
_NAMES = ('/left', '/right')


def start(bench: Bench, name: str, *arguments: str) -> Process:
    """Start an example as a background job of a shell is started, which ignores Ctrl-C."""
    command = ['env', '--ignore-signal=INT,QUIT', sys.executable, str(_FOLDER / f'{name}.py')]
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(bench.domain)}
    number = len(list(bench.folder.glob(f'{name}*.log')))
    process = Process([*command, *arguments], environment, bench.folder / f'{name}{number}.log')
    bench.callback(process.end)
    return process


def says(process: Process, text: str) -> None:
    """Wait until an example has said something."""
    wait_until(lambda: text in process.text or not process.running, f'it says: {text}')
    assert text in process.text, process.text


def one(bench: Bench) -> Any:
    """Start a drive that is quick, and its driver; return what looks into it."""
    drive = bench.simulator(*bench.drives.ramps(1))
    # a busy machine may hold the client up; none of these tests is about it
    bench.driver('-p', 'setpoint_timeout:=10.0')
    bench.client().connected()
    return drive


def two(bench: Bench, *arguments: str) -> Any:
    """Start two drives that are quick, and their driver; return what looks into them."""
    drives = bench.simulator('--address', '1', '--address', '2', *bench.drives.ramps(1))
    parameters = bench.folder / 'two.yaml'
    parameters.write_text(_TWO)
    bench.driver('--params-file', str(parameters), *arguments)
    for name in _NAMES:
        bench.client(name).connected()
    return drives


def stands(drive: Any, address: int | None = None) -> dict[str, Any]:
    """Wait until a motor stands; return the state of its drive."""
    return drive.wait_for(
        lambda state: not state['turning'], timeout=PATIENCE, address=address
    )


def _tells(fault: Any) -> Callable[[Any], bool]:
    return lambda inv_st: inv_st.code == (fault.reported or fault.code)


def runs(process: Process, drive: Any, frequency: float, address: int | None = None) -> None:
    """Wait until a motor follows a set-point, Hz, that an example sends."""

    def follows(state: dict[str, Any]) -> bool:
        assert process.running, f'the example has ended:\n{process.text}'
        return abs(state['frequency'] - frequency) < 0.5

    try:
        drive.wait_for(follows, timeout=PATIENCE, address=address)
    except TimeoutError as error:
        raise AssertionError(f'{error}; the example says:\n{process.text}') from error


# --- one drive --------------------------------------------------------------------------------


def ride(bench: Bench, *arguments: str) -> Process:
    """Start a ride that lasts until something ends it, unless the arguments say otherwise."""
    return start(bench, 'ride', '--rate', '100', '--hold', '3600', *_PATIENT, *arguments)


@needs('reverse')
def test_a_run_goes_up_and_down_and_stops(bench: Bench) -> None:
    drive = one(bench)
    process = ride(bench, '--frequency', '-20', '--hold', '1.5')
    runs(process, drive, -20.0)
    assert process.wait() == 0, process.text
    assert not bench.drives.commanded(drive.state())
    stands(drive)
    assert '/nfo_sinus/stop: stop' in process.text


def test_runs_that_end_early_leave_the_motor_stopped(bench: Bench) -> None:
    # one after the other, for the start of a driver is what takes long
    drive = one(bench)
    process = ride(bench)
    runs(process, drive, 20.0)
    process.signal(signal.SIGINT)
    # another one cuts nothing short
    process.signal(signal.SIGHUP)
    assert process.wait() == 1, process.text
    assert not bench.drives.commanded(drive.state())
    assert 'interrupted' in process.text and _NOT_CONFIRMED not in process.text
    stands(drive)
    # another client stops it
    process = ride(bench)
    runs(process, drive, 20.0)
    assert bench.client().call('stop').success
    assert process.wait() == 1, process.text
    assert '/nfo_sinus: a stop was requested: /nfo_sinus/stop' in process.text, process.text
    stands(drive)
    # nothing confirms the stop
    process = ride(bench)
    runs(process, drive, 20.0)
    drive.inject('silence', 3600.0)
    assert process.wait() == 1
    assert 'the drive does not respond' in process.text
    assert _NOT_CONFIRMED in process.text
    # it is stopped as soon as it answers
    drive.inject('silence', 0.0)
    stands(drive)


def test_a_fault_is_reported_and_acknowledged_only_where_that_is_wanted(bench: Bench) -> None:
    drive = one(bench)
    overload = bench.drives.overload
    process = ride(bench)
    runs(process, drive, 20.0)
    drive.inject('fault', overload.code)
    assert process.wait() == 1, process.text
    shown = bench.client().wait_for('inv_st', _tells(overload), 'fault')
    sentence = f'{overload}: {shown.description}. {shown.remedy}'
    assert shown.remedy and sentence in process.text
    assert '--acknowledge' in process.text
    assert drive.state()['fault'] == overload.code
    # without the flag nothing begins
    process = ride(bench)
    assert process.wait() == 1
    assert sentence in process.text and 'stop: ' not in process.text
    assert drive.state()['fault'] == overload.code
    # with it a ride begins
    process = ride(bench, '--acknowledge')
    runs(process, drive, 20.0)
    assert sentence in process.text and 'acknowledged' in process.text
    drive.inject('fault', overload.code)
    # and another fault ends it: acknowledged, but nothing turns again
    assert process.wait() == 1
    assert process.text.count(sentence) == 2
    assert drive.state()['fault'] == 0
    assert not bench.drives.commanded(drive.state())
    assert not drive.state()['driven']


def test_a_run_that_makes_no_sense_does_not_begin(bench: Bench) -> None:
    process = ride(bench, '--rate', '0')
    assert process.wait() == 2
    assert 'argument --rate: invalid' in process.text


# --- a conveyor -------------------------------------------------------------------------------


@needs('scmd')
def test_a_conveyor_stops_all_when_one_drops_out(bench: Bench) -> None:
    drives = two(bench)
    right = bench.client('/right')

    def dropped_out(happens: Callable[[], object], message: str) -> Process:
        process = start(bench, 'conveyor', '--drives', *_NAMES, *_PATIENT)
        for address in (1, 2):
            runs(process, drives, 20.0, address)
        happens()
        assert process.wait() == 1, process.text
        assert message in process.text
        assert not bench.drives.commanded(drives.state(1))
        stands(drives, 1)
        return process

    process = dropped_out(lambda: right.enable(False), '/right: a disable was requested')
    assert _NOT_CONFIRMED not in process.text
    stands(drives, 2)

    silence = functools.partial(drives.inject, 'silence', 3600.0, address=2)
    process = dropped_out(silence, '/right: the drive does not respond')
    assert f'{_NOT_CONFIRMED}, use the RUN input or the emergency stop: right: ' in process.text
    assert drives.state(2)['turning']
    # it is stopped as soon as it answers
    drives.inject('silence', 0.0, address=2)
    stands(drives, 2)
    right.wait_for('status', lambda status: status.connected, 'it is back')

    overload = bench.drives.overload
    fault = functools.partial(drives.inject, 'fault', overload.code, address=2)
    process = dropped_out(fault, '/right: the drive has a fault')
    assert f'/right: {overload}: ' in process.text
    assert _NOT_CONFIRMED not in process.text
    assert not drives.state(2)['driven']


@needs('scmd')
def test_a_conveyor_ends_by_ctrl_c_and_by_a_status_that_is_too_old(bench: Bench) -> None:
    drives = two(bench)
    process = start(bench, 'conveyor', '--drives', *_NAMES, *_PATIENT, '--frequency', '-15')
    for address in (1, 2):
        runs(process, drives, -15.0, address)
    process.signal(signal.SIGINT)
    assert process.wait() == 0, process.text
    for address in (1, 2):
        assert not bench.drives.commanded(drives.state(address))
        stands(drives, address)

    # no drive is polled so often
    process = start(bench, 'conveyor', '--drives', *_NAMES, '--status-timeout', '0.001')
    assert process.wait() == 1, process.text
    assert ': no status for ' in process.text
    for address in (1, 2):
        assert not bench.drives.commanded(drives.state(address))
        stands(drives, address)


# --- a robot ----------------------------------------------------------------------------------

#: m, m, motor turns for each of the wheel, Hz.
_RADIUS, _TRACK, _GEAR, _POLE_PAIRS, _MOST = 0.1, 0.5, 20.0, 2, 30.0


@contextlib.contextmanager
def steered(client: Client, linear: float, angular: float) -> Iterator[None]:
    """Publish a Twist over and over, m/s and rad/s."""
    twist = Twist()
    twist.linear.x, twist.angular.z = linear, angular
    publisher = client.node.create_publisher(Twist, '/cmd_vel', 10)
    timer = client.where_it_spins(
        lambda: client.node.create_timer(0.05, lambda: publisher.publish(twist))
    )
    try:
        yield
    finally:
        client.where_it_spins(lambda: client.node.destroy_timer(timer))
        client.where_it_spins(lambda: client.node.destroy_publisher(publisher))


def hertz(rim: float) -> float:
    """Return the frequency of a motor whose wheel's rim moves at m/s."""
    return rim / (2 * math.pi * _RADIUS) * _GEAR * _POLE_PAIRS


@needs('scmd')
def test_a_robot_follows_twists_and_stops_when_they_end_or_a_wheel_does(bench: Bench) -> None:
    drives = two(bench, '-p', 'setpoint_timeout:=1.0')
    client = bench.client('/left')
    settings = {
        'left_drive': '/left', 'right_drive': '/right', 'wheel_radius': _RADIUS, 'track': _TRACK,
        'gear_ratios': [_GEAR, -_GEAR], 'pole_pairs': _POLE_PAIRS, 'max_frequency': _MOST,
        'status_timeout': PATIENCE,
    }
    words = [word for name, value in settings.items() for word in ('-p', f'{name}:={value}')]
    run = functools.partial(start, bench, 'twist_robot', '--ros-args', *words)
    process = run()
    # a curve to the left
    with steered(client, 0.3, 0.2):
        runs(process, drives, hertz(0.3 - 0.2 * _TRACK / 2), 1)
        runs(process, drives, -hertz(0.3 + 0.2 * _TRACK / 2), 2)
    # no set-points come any more
    for name in ('left', 'right'):
        wait_until(
            lambda name=name: re.search(rf'{name}.*no set-point for 1 s', bench.log),
            f'the driver misses the set-points of {name}',
        )
    for address in (1, 2):
        runs(process, drives, 0.0, address)
    with steered(client, math.nan, 0.0):
        says(process, 'a Twist that is not finite is ignored')
    # beyond the limit backwards, and it is enabled all the while
    assert client.newest('status').enabled
    with steered(client, -9.0, 0.0):
        runs(process, drives, -_MOST, 1)
        runs(process, drives, _MOST, 2)
        process.signal(signal.SIGTERM)
        assert process.wait() == 0, process.text
    for address in (1, 2):
        assert not bench.drives.commanded(drives.state(address))
        stands(drives, address)

    process = run()
    with steered(client, 0.0, -1.0):
        runs(process, drives, hertz(_TRACK / 2), 1)
        runs(process, drives, hertz(_TRACK / 2), 2)
        assert client.call('stop').success
        assert process.wait() == 1, process.text
    assert '/left: a stop was requested: /left/stop called by ' in process.text, process.text
    assert not bench.drives.commanded(drives.state(2))
    stands(drives, 2)


def test_a_robot_that_is_too_fast_keeps_to_its_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(_FOLDER))
    base = importlib.import_module('twist_robot').Base(
        _RADIUS, _TRACK, (_GEAR, -_GEAR), _POLE_PAIRS, _MOST
    )
    assert base.frequencies(0.2, 0.0) == pytest.approx([hertz(0.2), -hertz(0.2)])
    slow, fast = base.frequencies(0.2, 0.4), base.frequencies(2.0, 4.0)
    assert abs(slow[0]) < abs(slow[1]) < _MOST == pytest.approx(abs(fast[1]))
    assert fast[0] / fast[1] == pytest.approx(slow[0] / slow[1])
    with pytest.raises(ValueError, match='more than 0'):
        dataclasses.replace(base, wheel_radius=0.0)


# --- C++ --------------------------------------------------------------------------------------


def lacking() -> str:
    """Return what is not here to build the client in C++; empty if all is."""
    programs = [name for name in ('cmake', 'c++') if not shutil.which(name)]
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(':')
    packages = [
        name
        for name in ('ament_cmake', 'rclcpp')
        if not any(Path(prefix, 'share', name, 'cmake').is_dir() for prefix in prefixes)
    ]
    return ', '.join([*programs, *packages])


def test_the_files_of_the_cpp_client_agree() -> None:
    package = ElementTree.parse(_CPP / 'package.xml').getroot()
    (name,) = (part.text for part in package.iter('name'))
    depends = {part.text for part in package.iter('depend')}
    assert package.get('format') == '3'
    assert [part.text for part in package.iter('buildtool_depend')] == ['ament_cmake']
    assert [part.text for part in package.iter('build_type')] == ['ament_cmake']
    assert [part.text for part in package.iter('license')] == ['Apache-2.0']

    cmake = (_CPP / 'CMakeLists.txt').read_text(encoding='utf-8')
    commands = [
        (command, words.split()) for command, words in re.findall(r'^(\w+)\(([^)]*)\)', cmake, re.M)
    ]
    called = dict(commands)
    assert called['project'][0] == name
    assert commands[-1] == ('ament_package', [])
    found = {words[0]: words[1:] for command, words in commands if command == 'find_package'}
    assert found.keys() == depends | {'ament_cmake'}
    assert set(map(tuple, found.values())) == {('REQUIRED',)}
    target, source = called['add_executable']
    linked = [re.sub(r'::.*|_TARGETS|\W', '', word) for word in called['target_link_libraries']]
    assert linked == [target, 'PRIVATE', *sorted(depends)]
    # where `ros2 run` looks
    assert called['install'] == ['TARGETS', target, 'DESTINATION', 'lib/${PROJECT_NAME}']

    text = (_CPP / source).read_text(encoding='utf-8')
    assert set(re.findall(r'#include "(\w+)/', text)) == depends
    assert f'ros2 run {name} {target} ' in text
    assert f'ros2 run {name} {target}' in _DOCS.read_text(encoding='utf-8')


@pytest.mark.skipif(bool(lacking()), reason=f'not here: {lacking()}')
def test_the_cpp_client_turns_the_motor_and_stops_it(bench: Bench) -> None:
    build = bench.folder / 'build'
    for command in (
        ['cmake', '-S', _CPP, '-B', build, f'-DPython3_EXECUTABLE={sys.executable}'],
        ['cmake', '--build', build],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    drive = one(bench)
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(bench.domain)}
    for duration, signals, status in ((2.0, (), 0), (3600.0, (signal.SIGINT,), 1)):
        command = [str(build / 'cpp_client'), '--ros-args', '-p', f'duration:={duration}']
        log = bench.folder / f'cpp_client{status}.log'
        process = Process([*command, '-p', 'frequency:=-20.0'], environment, log)
        bench.callback(process.end)
        runs(process, drive, -20.0)
        for number in signals:
            process.signal(number)
        assert process.wait() == status, process.text
        assert not bench.drives.commanded(drive.state())
        stands(drive)


# --- what is written --------------------------------------------------------------------------


@pytest.mark.parametrize('path', sorted(_FOLDER.glob('*.py')), ids=lambda path: path.name)
def test_an_example_says_how_it_is_run_and_what_it_takes(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding='utf-8'))
    page = _DOCS.read_text(encoding='utf-8')
    assert f'`examples/{path.name}`' in page
    if path.name != 'drive_client.py':
        assert f'python3 examples/{path.name}' in ast.get_docstring(tree)
        assert f'python3 examples/{path.name}' in page
    # options and parameters
    texts = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    options = {text for text in texts if re.fullmatch('--[a-z-]+', str(text))}
    names = {
        key.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign) and getattr(node.targets[0], 'id', '') == 'PARAMETERS'
        for key in node.value.keys
    }
    named = set(re.findall(r'[\w-]+', page))
    assert (options | names) - named == set()
