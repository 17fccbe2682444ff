# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a shell completes, and which version everything says that it is."""

from __future__ import annotations

from pathlib import Path
import re
import shutil
import subprocess

import pytest

from nfo_sinus_driver.cli.completion import script
from nfo_sinus_driver.cli.main import VERBS, main
from nfo_sinus_driver.simulator.main import main as simulator
from nfo_sinus_driver.version import VERSION

ROOT = Path(__file__).resolve().parents[3]

needs_bash = pytest.mark.skipif(shutil.which('bash') is None, reason='there is no bash')


def completed(*typed: str) -> set[str]:
    """What bash offers for the last word of what was typed."""
    words = ' '.join(f"'{word}'" for word in ('nfo-sinus', *typed))
    asked = (
        f'{script("bash")}\nCOMP_WORDS=({words}); COMP_CWORD={len(typed)}; _nfo_sinus\n'
        'echo "${COMPREPLY[@]}"'
    )
    done = subprocess.run(
        ('bash', '-c', asked), capture_output=True, text=True, timeout=60, check=True
    )
    assert not done.stderr
    return set(done.stdout.split())


@needs_bash
def test_a_shell_completes_verbs_options_and_values() -> None:
    assert completed('') >= {*VERBS, '--port', '--version'}
    assert completed('mo') == {'monitor'}
    assert completed('--address', '2', 'tu') == {'tune'}
    assert completed('tune', '') >= {'full', 'rs', '--yes'}
    assert completed('run', '--set') == {'--setpoint-max'}
    assert completed('run', '--control-mode', 'S') == {'Speed'}
    assert completed('--protocol', 'cl') == {'classic'}
    # a file name, as by default
    assert completed('load', 'con') == set()


@needs_bash
def test_the_script_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['completion']) == 0
    assert capsys.readouterr().out.rstrip() == script('bash').rstrip()
    assert script('zsh').startswith('autoload -U +X bashcompinit')


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
        for name, pattern in (
            ('package.xml', '<version>(.*)</version>'),
            ('msg_defs/package.xml', '<version>(.*)</version>'),
            ('setup.py', "version='(.*)'"),
        )
        for match in re.findall(pattern, (ROOT / name).read_text(encoding='utf-8'))
    }
    assert found == {VERSION}
