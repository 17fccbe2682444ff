# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The page on the command line says everything that may be typed."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
import re

import pytest

from nfo_sinus_driver.cli.main import VERBS, make_parser
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
