# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The page on the command line says everything that may be typed."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
import re

import pytest

from nfo_sinus_driver.cli.main import VERBS, make_parser, parse
from nfo_sinus_driver.cli.options import DEFAULTS

PAGE = Path(__file__).resolve().parents[3] / 'docs' / 'command_line.md'


def rows() -> Iterator[tuple[str, str]]:
    """What stands as code in the first column of a table, and the row."""
    for line in PAGE.read_text(encoding='utf-8').splitlines():
        if line.startswith('| `'):
            for span in re.findall(r'`([^`]+)`', line.split('|')[1]):
                yield span, line


def verb_parsers() -> dict[str, argparse.ArgumentParser]:
    """The parsers of the verbs, by name."""
    for action in make_parser()._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    raise AssertionError('there are no verbs')


def test_every_verb_can_be_typed_and_stands_in_the_page() -> None:
    assert set(verb_parsers()) == set(VERBS)
    assert set(VERBS) <= {span.split()[0] for span, _ in rows()}


@pytest.mark.parametrize('verb', VERBS)
def test_every_verb_says_what_it_takes(verb: str) -> None:
    # a bare % in a help text raises
    said = verb_parsers()[verb].format_help()
    assert said.startswith(f'usage: nfo-sinus {verb}')
    assert '%(' not in said


@pytest.mark.parametrize('verb', VERBS)
def test_every_option_stands_in_the_page(verb: str) -> None:
    written = {word.strip('[]') for span, _ in rows() for word in span.split()}
    for action in verb_parsers()[verb]._actions:
        assert action.help
        for option in action.option_strings:
            assert option in ('-h', '--help') or option in written


@pytest.mark.parametrize(('name', 'default'), DEFAULTS.items())
def test_every_default_stands_in_the_page(name: str, default: object) -> None:
    option = f'--{name.replace("_", "-")}'
    row = next(line for span, line in rows() if span.split()[0] == option)
    assert row.split('|')[2].strip().strip('`').startswith(str(default))


def said_by(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[object, str, str]:
    """The exit status of what was typed, and what it says."""
    with pytest.raises(SystemExit) as ended:
        parse(words)
    return ended.value.code, *capsys.readouterr()


def test_the_verbs_come_first_and_the_options_of_the_line_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    status, said, _ = said_by(capsys, 'help')
    assert status == 0 and said == said_by(capsys, '--help')[1]
    assert said_by(capsys) == (2, '', said)
    places = [said.index(f'\n    {verb} ') for verb in VERBS]
    assert places == sorted(places) and places[-1] < said.index('--port')
    for verb in VERBS:
        of_verb = said_by(capsys, 'help', verb)[1]
        assert of_verb == said_by(capsys, verb, '--help')[1]
        # where they are is said
        assert of_verb.count('--port') == 1 and 'nfo-sinus --help' in of_verb


@pytest.mark.parametrize(
    ('words', 'says'),
    [
        (('--adress', '2', 'info'), 'did you mean --address'),
        (('info', '--adress=2'), 'did you mean --address'),
        (('run', '10', '--setpoint-mx', '60'), 'did you mean --setpoint-max?'),
        (('scan', '--addresses', 'abc'), 'abc is no list of addresses, such as 1-10,20'),
        (('scan', '--addresses', '1-'), '1- is no list of addresses'),
        (('scan', '--addresses', '1-300'), '300 is not possible'),
        (('stopp',), 'did you mean stop?'),
        (('info', '--address', '300'), 'address'),
        (('get',), 'NAME'),
    ],
)
def test_a_wrong_argument_gets_one_line(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], says: str
) -> None:
    status, out, said = said_by(capsys, *words)
    assert (status, out) == (2, '') and says in said
    assert said.startswith('nfo-sinus') and said.count('\n') == 1
