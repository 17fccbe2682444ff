# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The CI files for GitHub are whole: what they run is there, and on both kinds of machine."""

from __future__ import annotations

import re
import shlex
import subprocess
from typing import Any

import pytest
from support.places import ROOT
import yaml

PATH = ROOT / '.github' / 'workflows' / 'ci.yaml'
SCRIPT = ROOT / '.ci' / 'ros2'
WORKFLOW: dict[Any, Any] = yaml.safe_load(PATH.read_text(encoding='utf-8'))
JOBS: dict[str, Any] = WORKFLOW['jobs']
APT = JOBS['apt']


def runs(job: str) -> list[str]:
    """The scripts of a job, with what a matrix gives put in."""
    scripts = [step['run'] for step in JOBS[job]['steps'] if 'run' in step]
    return [re.sub(r'\$\{\{ matrix\.ros \}\}', 'jazzy', one) for one in scripts]


def test_it_runs_for_every_change() -> None:
    # YAML takes the word `on` for a truth value
    when = WORKFLOW[True]
    assert {'push', 'pull_request'} <= when.keys()
    assert WORKFLOW['permissions'] == {'contents': 'read'}
    assert all(job['timeout-minutes'] <= 180 for name, job in JOBS.items() if name != 'all')


def test_all_is_run_each_night_and_for_no_change() -> None:
    assert WORKFLOW[True]['schedule']
    assert JOBS['all']['if'] == "github.event_name == 'schedule'"
    assert JOBS['all']['steps'][-1]['run'] == 'make all'


def test_ros_from_apt_is_tried_on_both_machines_and_kilted_may_fail() -> None:
    matrix = APT['strategy']['matrix']
    assert matrix == {'ros': ['jazzy', 'kilted'], 'machine': ['ubuntu-24.04', 'ubuntu-24.04-arm']}
    assert APT['continue-on-error'] == "${{ matrix.ros == 'kilted' }}"
    assert APT['container'].startswith('ros:${{ matrix.ros }}-')
    assert APT['runs-on'] == '${{ matrix.machine }}'


def test_all_that_needs_an_installed_ros_is_run() -> None:
    parts = set(re.findall(r'^check_(\w+)\(\)', SCRIPT.read_text(encoding='utf-8'), re.MULTILINE))
    called = [re.findall(r'\.ci/ros2 (\w+)', script) for script in runs('apt')]
    assert parts == {'launch', 'bag', 'cpp', 'control'}
    assert sorted(part for found in called for part in found) == sorted(parts)
    text = '\n'.join(runs('apt'))
    for command in ('rosdep install', 'colcon build', 'colcon test ', 'colcon test-result'):
        assert command in text
    assert runs('wheels') == ['.ci/run', 'make docs']


@pytest.mark.parametrize('job', JOBS)
def test_scripts_are_shell_and_what_they_start_is_there(job: str) -> None:
    for script in runs(job):
        subprocess.run(['bash', '-n'], input=script, text=True, check=True)
        for word in shlex.split(script, comments=True):
            path = word.removeprefix('src/nfo_sinus_driver/')
            if re.match(r'(\.ci|tools|examples)/', path):
                assert (ROOT / path).exists(), path


def test_a_job_in_a_container_names_no_path_of_its_host() -> None:
    # what these expressions give is where the runner has it, outside the container
    for name, job in JOBS.items():
        if 'container' in job:
            found = re.findall(r'\$\{\{\s*(?:github\.workspace|runner\.\w+)', yaml.safe_dump(job))
            assert found == [], name


def test_the_workspace_is_made_as_the_readme_says() -> None:
    page = (ROOT / 'README.md').read_text(encoding='utf-8')
    lines = '\n'.join(runs('apt'))
    for beginning in ('ln -s', 'colcon build', 'rosdep install --from-paths src -i'):
        (command,) = re.findall(rf'^    ({beginning}.*)$', page, re.MULTILINE)
        assert command in lines
    (clone,) = re.findall(r'git clone <this repository> (\S+)', page)
    checkout, *_ = APT['steps']
    assert checkout['with']['path'] == f'workspace/{clone}'


def test_the_script_is_shell() -> None:
    subprocess.run(['bash', '-n', str(SCRIPT)], check=True)


def test_it_is_said_that_it_has_not_run() -> None:
    assert '# Not run yet.' in PATH.read_text(encoding='utf-8')
    page = (ROOT / 'docs' / 'development.md').read_text(encoding='utf-8')
    assert '`.github/workflows/ci.yaml`' in page and 'has not run yet' in page
