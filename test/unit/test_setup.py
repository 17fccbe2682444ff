# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What each target of make sets up, with a Python that only notes what it is asked for."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import shutil
import subprocess

import pytest
from support.places import ROOT

if not (ROOT / 'msg_defs').is_dir():
    pytest.skip('make works on main', allow_module_level=True)

PYTHON = """#!/bin/sh
echo "$*" >> "{log}"
for last; do :; done
case "$*" in
  *version_info*) echo 3.12 ;;
  *sysconfig*) echo "{include}" ;;
  *'-m venv'*) mkdir -p "$last/bin" && cp "{python}" "$last/bin/python" ;;
  *ros-jazzy.txt*) mkdir -p .venv/share/ament_index ;;
  *'--packages-select'*) mkdir -p "build/$5" "install/$5" && touch install/setup.bash
esac
"""
Make = Callable[..., list[str]]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """What the Python was asked for by a target, in a copy of what make needs."""
    clone, log, python = (tmp_path / name for name in ('clone', 'log', 'python3.12'))
    for folder in ('msg_defs', 'requirements', 'tools'):
        shutil.copytree(ROOT / folder, clone / folder)
    for name in ('Makefile', 'package.xml', 'setup.py', 'setup.cfg'):
        shutil.copy(ROOT / name, clone / name)
    for name in ('config', 'examples', 'launch', 'nfo_sinus_driver/families/acme'):
        (clone / name).mkdir(parents=True)
    (clone / 'nfo_sinus_driver/families/acme/roles.csv').touch()
    (tmp_path / 'Python.h').touch()
    text = PYTHON.format(log=log, include=tmp_path, python=python)
    python.write_text(text, encoding='utf-8')
    python.chmod(0o755)
    environment = {
        'PATH': os.environ['PATH'], 'HOME': str(tmp_path), 'CXX': 'true', 'PYTHON': str(python)
    }

    def run(*targets: str) -> list[str]:
        log.write_text('', encoding='utf-8')
        done = subprocess.run(
            ['make', *targets], cwd=clone, env=environment, check=False,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )
        assert done.returncode == 0, done.stdout
        return log.read_text(encoding='utf-8').splitlines()

    return run


def installed(asked: list[str]) -> set[str]:
    """The files whose requirements were installed."""
    words = [word for line in asked for word in line.split()]
    begin = '--requirement=requirements/'
    return {word.removeprefix(begin) for word in words if word.startswith(begin)}


def made(asked: list[str]) -> list[str]:
    """The environments that were made, by their folders."""
    return [Path(line.split()[-1]).name for line in asked if line.startswith('-m venv')]


@pytest.mark.parametrize('target', ['demo', 'run'])
def test_the_demo_sets_up_nothing_that_only_tests_use(make: Make, target: str) -> None:
    asked = make(target)
    assert installed(asked) == {'run.txt', 'demo.txt', 'ros-jazzy.txt'}
    assert made(asked) == ['.venv']
    assert asked[-1].startswith('-m nfo_sinus_driver.demo')
    again = make(target)
    assert not installed(again) and not made(again)
    # the tests add theirs, and take nothing away
    later = make('setup')
    assert installed(later) == {'test.txt', 'without-ros.txt', 'noble.txt'}
    assert made(later) == ['without-ros', 'noble']
    assert not [line for line in later if 'colcon' in line]
    assert not installed(make('setup')) and not installed(make(target))


def test_all_is_set_up_where_tests_come_first(make: Make) -> None:
    asked = make('setup')
    files = {path.name for path in (ROOT / 'requirements').glob('*.txt')}
    of_kilted = {'ros-kilted.txt'}
    assert installed(asked) == {
        name for name in files if not name.startswith('constraints')
    } - of_kilted
    assert made(asked) == ['.venv', 'without-ros', 'noble']
