# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Every ``ros2`` command of the documentation: what it names is there, and it runs as typed.

The tool is no wheel: where it is not installed, what a command says is held against the types,
programs and files that there are, and the running is skipped.
"""

from __future__ import annotations

import functools
import importlib
import os
from pathlib import Path
import re
import shlex
import shutil
import signal
import subprocess
from typing import Any

from bench import PATIENCE, Bench, wait_until
from connections import needs
import pytest
from rosidl_parser.definition import AbstractNestedType, NamespacedType
from support.typed import ROOT, Typed, typed
import yaml

_ALL = typed('ros2')
#: Nodes and programs of other packages, which are installed with them.
_OF_OTHERS = (
    'diagnostic_aggregator', 'rqt_robot_monitor', 'foxglove_bridge', 'plotjuggler',
    'nav2_lifecycle_manager', '/lifecycle_manager', 'nfo_sinus_cpp_client', 'ros2 security',
    'ros2 daemon', 'nav2_msgs', 'control_msgs',
)
_OURS = [command for command in _ALL if not any(other in command.text for other in _OF_OTHERS)]
#: What commands and shows a running drive by the names of its node.
_NODE = re.compile(r'ros2 (topic|service|param|action) .*?(/nfo_sinus(?:_bus)?)(?=[/ ]|$)')
#: Needs another drive or another bus, or a file that the page has made before.
_ELSEWHERE = ('allow_communication_changes', 'serial.control_mode', 'setpoint_all', 'enable_all')


def _words(command: Typed) -> list[str]:
    return [word for word in shlex.split(command.text) if word != '>']


def _fill(message: Any, values: dict[str, Any]) -> None:
    """Take over values as ``ros2 topic pub`` does; an unknown name is an error."""
    types = dict(zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True))
    for name, value in values.items():
        assert name in types, f'{type(message).__name__} has no {name}'
        if isinstance(types[name], NamespacedType) and isinstance(value, dict):
            _fill(getattr(message, name), value)
        elif isinstance(types[name], AbstractNestedType):
            assert isinstance(value, list), name
        else:
            # the field itself looks whether that can be
            setattr(message, name, type(getattr(message, name))(value))


def test_there_are_such_commands() -> None:
    verbs = {_words(command)[1] for command in _OURS}
    assert {'topic', 'service', 'param', 'action', 'run', 'launch'} <= verbs
    assert len(_OURS) > 25
    with pytest.raises(AssertionError, match='has no datum'):
        _fill(importlib.import_module('std_msgs.msg').Float32(), {'datum': 1.0})


@pytest.mark.parametrize('command', _OURS, ids=str)
def test_what_a_command_names_is_there(command: Typed) -> None:
    words = _words(command)
    types = [word for word in words if re.fullmatch(r'\w+/(msg|srv|action)/\w+', word)]
    if types:
        package, folder, name = types[0].split('/')
        type_ = getattr(importlib.import_module(f'{package}.{folder}'), name)
        message = {'msg': lambda: type_, 'srv': lambda: type_.Request, 'action': lambda: type_.Goal}
        for text in words[words.index(types[0]) + 1 :]:
            _fill(message[folder]()(), yaml.safe_load(text))
    if words[1] == 'run':
        scripts = (ROOT / 'setup.py').read_text()
        assert words[2] == 'nfo_sinus_driver' and f"f'{words[3]} = " in scripts
    elif words[1] == 'launch':
        assert words[2] == 'nfo_sinus_driver' and (ROOT / 'launch' / words[3]).is_file()
        assert all(':=' in word for word in words[4:])


@pytest.mark.skipif(shutil.which('ros2') is None, reason='the ros2 tool is not installed')
@needs('states', 'parameters')
@pytest.mark.timeout(20 * PATIENCE)
def test_commands_for_a_running_drive_run_as_they_are_typed(bench: Bench) -> None:
    # the tool leaves a helper of its own behind
    bench.callback(_run, 'ros2 daemon stop', bench)
    bench.simulator()
    bench.driver()
    client = bench.client().connected()
    done = []
    for command in _OURS:
        if not _NODE.match(command.text) or any(word in command.text for word in _ELSEWHERE):
            continue
        wait_until(functools.partial(_runs, command, bench), f'{command} finds its node')
        done.append(command)
    assert len(done) > 10
    # whatever they have done to it
    assert client.call('stop').success


def _runs(command: Typed, bench: Bench) -> bool:
    """Run a command; false where the tool has not found the node yet."""
    status, said = _run(command.text, bench)
    if 'Node not found' in said or 'Could not find' in said:
        return False
    assert status == 0, f'{command}\n{said}'
    for complaint in ('Traceback', 'not found', 'failed', 'success=False'):
        assert complaint not in said, f'{command}\n{said}'
    return True


def _run(text: str, bench: Bench) -> tuple[int, str]:
    """Run what is typed, or see that it begins what has no end; return status and output."""
    endless = ' topic echo ' in text or ' pub -r ' in text
    log = bench.folder / 'typed.log'
    with log.open('wb') as stream:
        process = subprocess.Popen(
            ['bash', '-c', text],
            cwd=bench.folder,
            env={**os.environ, 'ROS_DOMAIN_ID': str(bench.domain), 'PYTHONUNBUFFERED': '1'},
            stdin=subprocess.DEVNULL, stdout=stream, stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        if endless:
            wait_until(lambda: log.stat().st_size > 50 or process.poll() is not None, text)
        status = 0 if endless and process.poll() is None else process.wait(PATIENCE)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
            process.wait(PATIENCE)
    return status, log.read_text()


@pytest.mark.skipif(shutil.which('ros2') is None, reason='the ros2 tool is not installed')
@pytest.mark.parametrize(
    'name', sorted(set(re.findall(r"f'([\w-]+) = ", (Path(ROOT) / 'setup.py').read_text())))
)
def test_ros2_run_finds_every_program(name: str) -> None:
    done = subprocess.run(
        ['ros2', 'run', 'nfo_sinus_driver', name, '--version'],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE, check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('nfo_sinus_driver ')
