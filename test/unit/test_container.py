# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The container is built by the commands for a workspace."""

from __future__ import annotations

import json
from pathlib import Path
import re

import yaml

from nfo_sinus_driver.drive import DriveSettings

ROOT = Path(__file__).resolve().parents[2]
DOCKERFILE = (ROOT / 'Dockerfile').read_text(encoding='utf-8')
#: Lines of a command that goes on, joined.
RUN = re.sub(r'\\\n\s*', '', DOCKERFILE)


def commands(page: str, beginning: str) -> list[str]:
    """The commands of a page that begin so."""
    lines = (ROOT / page).read_text(encoding='utf-8').splitlines()
    return [line.strip() for line in lines if line.strip().startswith(beginning)]


def test_it_is_built_and_used_as_the_pages_say() -> None:
    for beginning in ('rosdep install', 'colcon build'):
        (command,) = commands('README.md', beginning)
        assert command in RUN
    (link,) = commands('README.md', 'ln -s')
    assert f'RUN {link}\n' in RUN
    build, run = commands('README.md', 'docker')
    assert f'#   {build}\n' in DOCKERFILE and f'#   {run}\n' in DOCKERFILE
    assert ' --init ' in run
    *_, launch = run.partition('ros2 launch nfo_sinus_driver ')
    assert (ROOT / 'launch' / launch).is_file()


def test_what_it_copies_is_where_it_is_built() -> None:
    assert 'FROM ros:jazzy\n' in DOCKERFILE
    assert 'WORKDIR /workspace\nCOPY . src/nfo_sinus_driver\n' in DOCKERFILE
    ignored = (ROOT / '.dockerignore').read_text(encoding='utf-8').split()
    # what was built outside is for another place
    assert {'.venv', 'build', 'install'} <= set(ignored)


def test_the_development_container_is_the_same() -> None:
    path = ROOT / '.devcontainer' / 'devcontainer.json'
    wanted = json.loads(path.read_text(encoding='utf-8'))
    build = wanted['build']
    assert (path.parent / build['dockerfile']).resolve() == ROOT / 'Dockerfile'
    assert (path.parent / build['context']).resolve() == ROOT
    target = wanted['workspaceFolder']
    assert f'target={target},' in wanted['workspaceMount']
    assert target == '/workspace/src/nfo_sinus_driver'
    assert wanted['init'] is True


def test_the_end_of_a_container_reaches_the_driver_and_leaves_it_time() -> None:
    text = (ROOT / 'docs' / 'compose.yaml').read_text(encoding='utf-8')
    (service,) = yaml.safe_load(text)['services'].values()
    # no ros2 between: the driver handles every signal, and compose sees how it ended
    executable, *arguments = service['command'].split()
    workspace, _, name = executable.rpartition('/install/nfo_sinus_driver/lib/nfo_sinus_driver/')
    assert f'WORKDIR {workspace}\n' in DOCKERFILE
    assert f"f'{name} = " in (ROOT / 'setup.py').read_text(encoding='utf-8')
    assert arguments[0] == '--ros-args'
    assert executable in (ROOT / 'docs' / 'container.md').read_text(encoding='utf-8')
    assert service['restart'].startswith('on-failure:')
    grace = float(service['stop_grace_period'].removesuffix('s'))
    needed = 2 * DriveSettings(address=1).shutdown_timeout + 20
    assert grace >= needed


def test_so_it_does_with_ros2_launch() -> None:
    assert '\nSTOPSIGNAL SIGINT\n' in DOCKERFILE
    assert '\nENV TINI_KILL_PROCESS_GROUP=1\n' in DOCKERFILE
    page = (ROOT / 'docs' / 'container.md').read_text(encoding='utf-8').replace('\\\n', '')
    (command,) = re.findall(r'docker run .* ros2 launch .*', page)
    assert ' --init ' in command
    (grace,) = re.findall(r'--stop-timeout (\d+)', command)
    (limit,) = re.findall(r'exit_timeout:=(\d+)', command)
    # launch must not kill the driver before the container does
    assert float(grace) - 5 <= float(limit) <= float(grace)
    *_, launch = command.partition('ros2 launch nfo_sinus_driver ')
    assert (ROOT / 'launch' / launch.split()[0]).is_file()
