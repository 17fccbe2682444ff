# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The commands: where what they need is not installed, each says so in a sentence."""

from __future__ import annotations

import ast
from pathlib import Path
import re
import subprocess
import sys

import pytest
from support.places import ROOT

from nfo_sinus_driver import commands

SETUP = (ROOT / 'setup.py').read_text(encoding='utf-8')
#: The commands by name, and what setup.py starts for each.
COMMANDS = dict(re.findall(r"f'([a-z-]+) = \{NAME\}\.commands:(\w+)'", SETUP))
#: Those that are of no use without ROS.
NEED_ROS = {'driver', 'monitor', 'plot', 'record'}


def test_every_command_is_there() -> None:
    assert COMMANDS.keys() == commands.COMMANDS.keys()
    assert COMMANDS.keys() >= {*NEED_ROS, 'families', 'nfo-sinus', 'simulator'}
    for name, (module, function) in commands.COMMANDS.items():
        path = (ROOT / module.replace('.', '/')).with_suffix('.py')
        defined = [
            node.name
            for node in ast.parse(path.read_text(encoding='utf-8')).body
            if isinstance(node, ast.FunctionDef)
        ]
        assert function in defined, name


@pytest.mark.parametrize('name', commands.COMMANDS)
def test_a_command_says_in_a_sentence_what_is_not_installed(name: str) -> None:
    # as `pip install` of the clone leaves it: nothing but the standard library
    program = (
        f'import sys; sys.path.insert(0, {str(ROOT)!r}); '
        f'from nfo_sinus_driver.commands import {COMMANDS[name]} as command; sys.exit(command())'
    )
    done = subprocess.run(
        [sys.executable, '-I', '-S', '-c', program, '--help'],
        capture_output=True, text=True, timeout=120, check=False,
    )
    assert (done.returncode, done.stdout) == (2, ''), done.stderr
    (sentence,) = done.stderr.splitlines()
    if name in NEED_ROS:
        assert re.match(rf'{name}: needs ROS 2 \(.*\): source ', sentence), sentence
    else:
        assert re.match(rf'{name}: needs the library \w+ \(apt install python3-', sentence)
        assert f"pip install '.[{'simulator' if name == 'simulator' else 'cli'}]'" in sentence


def test_ctrl_c_while_a_command_is_loaded_ends_it_in_silence(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / 'slow_to_load.py').write_text('raise KeyboardInterrupt', encoding='utf-8')
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(commands.COMMANDS, 'nfo-sinus', ('slow_to_load', 'main'))
    assert commands.nfo_sinus() == 130


def test_what_is_wrong_in_the_driver_itself_is_no_missing_library(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(commands.COMMANDS, 'driver', ('nfo_sinus_driver.not_there', 'main'))
    with pytest.raises(ModuleNotFoundError, match='nfo_sinus_driver'):
        commands.driver()
