# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``config/nfo-sinus.service``: systemd takes it, and it leaves time to stop every motor."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path
import re
import shutil
import signal
import subprocess

import pytest

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.signals import ENDING

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / 'config'
SERVICE = CONFIG / 'nfo-sinus.service'


@pytest.fixture(scope='module')
def unit() -> dict[str, list[str]]:
    """Every setting of the unit with its values; lines that end in a backslash go on."""
    found: dict[str, list[str]] = {}
    text = re.sub(r'^[#;].*\n', '', SERVICE.read_text(), flags=re.MULTILINE)
    for name, value in re.findall(r'^(\w+)=(.*)$', text.replace('\\\n', ' '), re.MULTILINE):
        found.setdefault(name, []).append(value)
    return found


def constants_of(path: Path) -> dict[str, float]:
    """The numbers that a module calls by a name."""
    return {
        node.targets[0].id: node.value.value
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and isinstance(node.value, ast.Constant)
    }


def longest_end(shutdown_timeout: float) -> float:
    """How long the driver may take from the signal to its end, s."""
    main = constants_of(ROOT / 'nfo_sinus_driver' / 'node' / 'main.py')
    closing = inspect.signature(Bus.close).parameters['timeout'].default
    # the stop, then the release; then the bus, the queue, the set-points, the callbacks and the
    # executors they belong to, the lifecycle
    waits = 2 * (shutdown_timeout + main['_LAST_ANSWER'])
    return float(waits + closing + 5 * main['_LAST_CALLBACK'])


def test_service_leaves_time_enough_to_stop_every_motor(unit: dict[str, list[str]]) -> None:
    given = [
        float(found)
        for path in CONFIG.glob('*.yaml')
        for found in re.findall(r'^\s+shutdown_timeout: ([\d.]+)', path.read_text(), re.MULTILINE)
    ]
    shutdown_timeout = max([DriveSettings(address=1).shutdown_timeout, *given])
    (timeout,) = unit['TimeoutStopSec']
    assert float(timeout) >= longest_end(shutdown_timeout)
    # what the comment of the file and docs/operations.md say to reckon with
    assert longest_end(100.0) <= 2 * 100.0 + 20
    assert float(timeout) >= 2 * shutdown_timeout + 20


def test_service_ends_the_driver_by_a_signal_that_stops_the_motors(
    unit: dict[str, list[str]],
) -> None:
    (name,) = unit['KillSignal']
    assert signal.Signals[name] in ENDING
    # the main process is the driver itself, which alone gets the signal
    assert unit['KillMode'] == ['mixed']
    (command,) = unit['ExecStart']
    assert ' exec ' in command
    assert 'ros2 run' not in command


def test_service_starts_the_driver_again_after_a_crash_but_not_for_a_wrong_parameter(
    unit: dict[str, list[str]],
) -> None:
    assert unit['Restart'] == ['on-failure']
    assert unit['RestartPreventExitStatus'] == ['2']
    assert int(unit['StartLimitBurst'][0]) * float(unit['RestartSec'][0]) < float(
        unit['StartLimitIntervalSec'][0]
    ), 'the limit would never be reached'


def test_service_may_use_the_port_and_little_else(unit: dict[str, list[str]]) -> None:
    groups = re.findall(r'GROUP="(\w+)"', (CONFIG / '99-nfo-sinus-serial.rules').read_text())
    assert unit['SupplementaryGroups'] == groups
    assert unit['User'] != ['root'] and unit['NoNewPrivileges'] == ['true']


def test_service_starts_what_is_installed(unit: dict[str, list[str]]) -> None:
    (command,) = unit['ExecStart']
    (executable,) = re.findall(r'/lib/nfo_sinus_driver/([\w-]+)"', command)
    assert f"f'{executable} = " in (ROOT / 'setup.py').read_text()
    (script,) = re.fullmatch(r"/bin/bash -c '([^']*)'", command).groups()
    # systemd makes one dollar of two
    script = script.replace('$$', '$')
    subprocess.run(['/bin/bash', '-n', '-c', script], check=True)
    named = set(re.findall(r'\$(\w+)', script))
    assert named == {'NFO_SINUS_SETUP', 'NFO_SINUS_PARAMS', 'NFO_SINUS_ARGS'}
    assert named <= {one.partition('=')[0] for one in unit['Environment']}


def test_service_is_a_unit_for_systemd() -> None:
    analyze = shutil.which('systemd-analyze')
    if analyze is None:
        pytest.skip('systemd-analyze is not installed')
    done = subprocess.run(
        [analyze, 'verify', str(SERVICE)], capture_output=True, text=True, check=False
    )
    # it speaks of other units of the machine, too
    said = [line for line in done.stderr.splitlines() if SERVICE.name in line]
    assert said == []
