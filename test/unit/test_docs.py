# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The documentation: everything public stands in it, and what it names exists."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
import re
import runpy

import pytest
from support.places import MSG_DEFS, ROOT

from nfo_sinus_driver.node.parameters.settings import BUS_SETTINGS, DRIVE_SETTINGS
from nfo_sinus_driver.simulator.main import _inject_parser, _parser

PACKAGE = ROOT / 'nfo_sinus_driver'
DOCS = ROOT / 'docs'
PAGES = (*ROOT.glob('*.md'), *DOCS.rglob('*.md'))
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
SETTINGS = {*BUS_SETTINGS, *DRIVE_SETTINGS}
#: Arguments of remapping, and the example of a message, that look like parameters.
NO_PARAMETERS = {'__node', '__ns', 'name'}


def read(path: Path) -> str:
    return path.read_text(encoding='utf-8')


# --- what is public -------------------------------------------------------------------------------


def topics_and_services() -> set[str]:
    """The names that the nodes give their topics and services."""
    sources = map(read, (PACKAGE / 'node').rglob('*.py'))
    named = re.compile(r"'(~/[a-z_]+|/diagnostics)'")
    return {name for source in sources for name in named.findall(source)}


def executables() -> set[str]:
    return set(re.findall(r"f'([a-z-]+) = \{NAME\}", read(ROOT / 'setup.py')))


def launch_arguments(paths: Iterable[Path] = LAUNCH_FILES) -> set[str]:
    """The arguments of launch files, whether or not they overrule a parameter."""
    pattern = re.compile(r"(?:DeclareLaunchArgument|declare)\(\s*'(\w+)'|\n    '(\w+)': \('/\*\*")
    return {''.join(names) for path in paths for names in pattern.findall(read(path))}


def options(parser: argparse.ArgumentParser) -> set[str]:
    """The options of a parser, and its verbs with theirs."""
    names = [name for action in parser._actions for name in action.option_strings]
    found = {name for name in names if name[:2] == '--'}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found |= set(action.choices).union(*map(options, action.choices.values()))
    return found - {'--help'}


def make_targets() -> set[str]:
    """The targets that ``make help`` lists."""
    return set(re.findall(r'^([a-z-]+):.*##', read(ROOT / 'Makefile'), re.MULTILINE))


def fields(message: str) -> set[str]:
    """The fields of a message; constants are none."""
    return set(re.findall(r'^[\w/\[\]]+ +([a-z_0-9]+) *(?:#.*)?$', message, re.MULTILINE))


# --- what is written ------------------------------------------------------------------------------


def code_of(text: str) -> list[str]:
    """Every piece of code, between backticks or in lines by itself."""
    return [*re.findall(r'`([^`]+)`', text), *re.findall(r'^ {4} *(.*)$', text, re.MULTILINE)]


def documented(text: str) -> set[str]:
    """Every word that stands as code in the first column of some table."""
    cells = re.findall(r'^\|([^|]*)\|', text, re.MULTILINE)
    # without the brackets of what may be left out
    return {word.strip('[],') for cell in cells for span in code_of(cell) for word in span.split()}


def headings(text: str) -> set[str]:
    """The anchors of a page; a title that comes again has a number behind it."""
    titles = re.findall(r'^#+ (.+)$', text, re.MULTILINE)
    plain = [re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-') for title in titles]
    again = [
        f'{anchor}-{plain[:at].count(anchor)}'
        for at, anchor in enumerate(plain)
        if anchor in plain[:at]
    ]
    return {*plain, *again}


def named_targets(text: str) -> set[str]:
    """The make targets that a page speaks of."""
    return {line.split()[1] for line in code_of(text) if re.match(r'make [a-z]', line)}


def broken_links(page: Path, text: str) -> Iterator[str]:
    """Links that lead nowhere."""
    for file, anchor in re.findall(r'\]\(([^)#\s:]*)(?:#([^)\s]*))?\)', text):
        target = page.parent / file if file else page
        if not target.exists() or (anchor and anchor not in headings(read(target))):
            yield f'{file}#{anchor}'


def missing(page: Path, text: str) -> set[str]:
    """The links, commands, parameters and files that a page names and are not there."""
    code = '\n'.join(code_of(text))
    parameters = re.findall(r'(?<![\w/])(\w+):=', code)
    started = re.findall(r'ros2 run nfo_sinus_driver ([\w-]+)', code)
    launched = re.findall(r'ros2 launch nfo_sinus_driver (\S+)', code)
    ends = 'py|md|yaml|rules|csv|rst|json|xml|service'
    files = re.findall(rf'^[\w.-]+/[\w./-]*\.(?:{ends})$', code, re.MULTILINE)
    return {
        *broken_links(page, text),
        *(named_targets(text) - make_targets()),
        *({*parameters} - SETTINGS - launch_arguments() - NO_PARAMETERS),
        *({*started} - executables()),
        *({*launched} - {path.name for path in LAUNCH_FILES}),
        *(file for file in files if not ((ROOT / file).exists() or (PACKAGE / file).exists())),
    }


# --- the tests ------------------------------------------------------------------------------------


def test_what_is_public_is_documented() -> None:
    names = topics_and_services() | executables() | SETTINGS | launch_arguments()
    assert names >= {'~/status', '~/enable', '/diagnostics', 'driver', 'port', 'exit_timeout'}
    page = read(DOCS / 'interface.md')
    # a name of older versions
    assert names - documented(page) == {'~/disable_all'}
    for path in LAUNCH_FILES:
        assert {'namespace', 'port'} & launch_arguments([path])
        assert f'ros2 launch nfo_sinus_driver {path.name}' in page


def test_what_is_made_of_the_pages_is_current(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / 'tools')
    pages = runpy.run_path(str(ROOT / 'tools' / 'pages.py'))['pages']()
    assert len(pages) >= 4
    assert [path.name for path, text in pages.items() if read(path) != text] == [], 'make pages'


def test_simulator_and_make_targets_are_documented() -> None:
    names = options(_parser()) | options(_inject_parser())
    assert names - documented(read(DOCS / 'simulator.md')) == set()
    assert make_targets() >= {'demo', 'test'}
    assert make_targets() - named_targets(read(DOCS / 'development.md')) == set()


def test_messages_are_documented() -> None:
    page = read(DOCS / 'messages.md')
    names = {path.stem for kind in ('msg', 'srv', 'action') for path in MSG_DEFS.rglob(f'*.{kind}')}
    assert {name for name in names if not re.search(rf'\b{name}\b', page)} == set()
    for name in ('DriveStatus', 'InvSt', 'Telemetry', 'BusStatistics'):
        found = fields(read(MSG_DEFS / 'msg' / f'{name}.msg')) - {'header'}
        assert len(found) > 5, name
        assert {field for field in found if f'`{field}`' not in page} == set(), name


def test_what_a_page_names_exists() -> None:
    assert {page: names for page in PAGES if (names := missing(page, read(page)))} == {}
    wrong = '`make tea` `-p sugar:=2` `config/no.yaml` `ros2 run nfo_sinus_driver x` [y](no.md#z)'
    assert missing(DOCS / 'x.md', wrong) == {'tea', 'sugar', 'config/no.yaml', 'x', 'no.md#z'}


def test_parameter_files_name_parameters_that_exist() -> None:
    for path in (ROOT / 'config').glob('*.yaml'):
        # test/ros/test_config_names.py has those of another node
        if path.name != 'diagnostic_aggregator.yaml':
            names = set(re.findall(r'^    (\w+):', read(path), re.MULTILINE))
            assert 'port' in names and names - SETTINGS == set(), path


def test_every_reading_that_is_cited_is_listed() -> None:
    listed = set(re.findall(r'^(\d+)\. ', read(DOCS / 'readings.md'), re.MULTILINE))
    paths = [*PACKAGE.rglob('*.py'), *PACKAGE.rglob('*.csv'), *DOCS.rglob('*.md')]
    cited = re.compile(r'\bC(\d+)\b(?=[\],;])')
    found = {number: path.name for path in paths for number in cited.findall(read(path))}
    assert found.keys() > {'12', '98'}
    assert {number: name for number, name in found.items() if number not in listed} == {}


def test_the_picture_of_control_names_the_time_outs_of_its_page() -> None:
    named = re.findall(r'\| the driver \| `(\w+)` \|', read(DOCS / 'control.md'))
    picture = read(DOCS / 'control_states.svg')
    assert 'lost_after' in named and [name for name in named if name not in picture] == []


def test_the_readme_says_what_is_a_safety_function_and_what_is_not() -> None:
    # law 10: it stands near the top, where it is read
    top = ' '.join(read(ROOT / 'README.md')[:2000].split())
    assert all(word in top for word in ('safety function', 'RUN input', 'drive_timeout'))
