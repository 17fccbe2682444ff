# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a shell completes, and which version everything says that it is."""

from __future__ import annotations

import os
from pathlib import Path
import re
import subprocess

from cli_bench import COMMAND
import pytest
from support.places import MSG_DEFS, ROOT

from nfo_sinus_driver.cli.main import VERBS, main
from nfo_sinus_driver.simulator.main import main as simulator
from nfo_sinus_driver.version import VERSION


def completed(line: str, folder: Path) -> set[str]:
    """What a shell is offered for the last word of a line."""
    offered = folder / 'offered'
    asked = {
        '_ARGCOMPLETE': '1', '_ARGCOMPLETE_IFS': '\n', '_ARGCOMPLETE_STDOUT_FILENAME': str(offered),
        'COMP_LINE': f'nfo-sinus {line}', 'COMP_POINT': str(len(f'nfo-sinus {line}')),
    }
    subprocess.run(COMMAND, env={**os.environ, **asked}, cwd=ROOT, timeout=60, check=True)
    return {word.strip() for word in offered.read_text().split('\n') if word}


def test_a_shell_completes_verbs_options_and_values(tmp_path: Path) -> None:
    assert completed('', tmp_path) >= {*VERBS}
    assert completed('--', tmp_path) >= {'--port', '--version'}
    assert completed('mo', tmp_path) == {'monitor'}
    assert completed('--address 2 sto', tmp_path) == {'stop'}
    assert completed('run --set', tmp_path) == {'--setpoint-max'}
    assert completed('run --control-mode S', tmp_path) == {'Speed'}
    assert completed('--protocol cl', tmp_path) == {'classic'}


def test_the_script_for_the_shell_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    for shell in ('bash', 'zsh'):
        assert main(['completion', shell]) == 0
        assert 'nfo-sinus' in capsys.readouterr().out


@pytest.mark.parametrize('command', [main, simulator])
def test_commands_say_their_version(
    command: object, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        command(['--version'])
    assert end.value.code == 0
    assert capsys.readouterr().out == f'nfo_sinus_driver {VERSION}\n'


def test_all_files_have_the_same_version() -> None:
    found = {
        match
        for path, pattern in (
            (ROOT / 'package.xml', '<version>(.*)</version>'),
            (MSG_DEFS / 'package.xml', '<version>(.*)</version>'),
            (ROOT / 'setup.py', "version='(.*)'"),
        )
        for match in re.findall(pattern, path.read_text(encoding='utf-8'))
    }
    assert found == {VERSION}
