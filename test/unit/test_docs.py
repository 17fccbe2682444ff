# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The documentation: everything public stands in it, and what it names exists."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
import re
import runpy
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from support.places import MSG_DEFS, ROOT

from nfo_sinus_driver.node.settings import BUS_SETTINGS, DRIVE_SETTINGS
from nfo_sinus_driver.simulator.family import every_injection, every_option
from nfo_sinus_driver.version import VERSION

PACKAGE = ROOT / 'nfo_sinus_driver'
INTERFACE = ROOT / 'docs' / 'interface.md'
SIMULATOR = ROOT / 'docs' / 'simulator.md'
MESSAGES = ROOT / 'docs' / 'messages.md'
DEVELOPMENT = ROOT / 'docs' / 'development.md'
DECLARATION = ROOT / 'QUALITY_DECLARATION.md'
PAGES = (
    *(ROOT / f'{name}.md' for name in ('README', 'CONTRIBUTING', 'SECURITY')),
    DECLARATION,
    *sorted((ROOT / 'docs').rglob('*.md')),
)
PICTURES = sorted((ROOT / 'docs').glob('*.svg'))
#: Parameters of another node than the driver's; test/ros/test_config_names.py has those.
OF_OTHERS = {'diagnostic_aggregator.yaml'}
CONFIGS = sorted(path for path in (ROOT / 'config').glob('*.yaml') if path.name not in OF_OTHERS)
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
SETTINGS = {*BUS_SETTINGS, *DRIVE_SETTINGS}
#: A citation of a manual, with the link that says what M0 is.
CITATION = re.compile(r'\[(?P<manual>M[0-4])\b[^\]]*\](\([^)]*\))?')
#: Arguments of remapping, and the example of a message, that look like parameters.
NO_PARAMETERS = {'__node', '__ns', 'name'}


def read(path: Path) -> str:
    return path.read_text(encoding='utf-8')


# --- what is public -------------------------------------------------------------------------------


def calls(source: str, *names: str) -> Iterator[ast.Call]:
    """Every call of a function or method of one of these names."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            function = node.func
            name = function.attr if isinstance(function, ast.Attribute) else ''
            if (function.id if isinstance(function, ast.Name) else name) in names:
                yield node


def texts(node: ast.AST) -> Iterator[str]:
    """Every text below a node of the syntax tree."""
    for child in ast.walk(node):
        if isinstance(child, ast.Constant) and isinstance(child.value, str):
            yield child.value


def keys_of(source: str, variable: str) -> set[str]:
    """The keys of the dictionary that a variable of a module is."""
    for node in ast.parse(source).body:
        targets = node.targets if isinstance(node, ast.Assign) else []
        target = node.target if isinstance(node, ast.AnnAssign) else None
        names = [name.id for name in (*targets, target) if isinstance(name, ast.Name)]
        if variable in names and isinstance(node.value, ast.Dict):
            return {key.value for key in node.value.keys}
    return set()


def topics_and_services(source: str) -> set[str]:
    """The names that a node gives its topics and services."""
    pattern = re.compile(r'~/[a-z_]+|/diagnostics')
    return {text for text in texts(ast.parse(source)) if pattern.fullmatch(text)}


def launch_arguments(source: str) -> set[str]:
    """The arguments of a launch file."""
    declared = calls(source, 'DeclareLaunchArgument', 'declare')
    first = (call.args[0] for call in declared)
    names = {argument.value for argument in first if isinstance(argument, ast.Constant)}
    return names | keys_of(source, 'OVERRIDES')


def of_simulator(main: str) -> set[str]:
    """The options of the simulator, and the verbs and switches of ``simulator inject``."""
    verbs = [call.args[0] for call in calls(main, 'add_parser')]
    found = {verb.value for verb in verbs if isinstance(verb, ast.Constant)}
    for call in calls(main, 'add', 'add_argument'):
        found |= {text for text in texts(call) if re.fullmatch('--[a-z-]+', text)}
    found |= {f'--{name.replace("_", "-")}' for name in every_option()}
    for name, injection in every_injection().items():
        found.add(name)
        found |= {f'--{one.name}' for one in injection.arguments if one.type is bool}
    return found


def make_targets() -> set[str]:
    """The targets that ``make help`` lists."""
    return set(re.findall(r'^([a-z-]+):.*##', read(ROOT / 'Makefile'), re.MULTILINE))


def fields(message: str) -> set[str]:
    """The fields of a message; constants are none."""
    return set(re.findall(r'^[\w/\[\]]+ +([a-z_0-9]+) *(?:#.*)?$', message, re.MULTILINE))


# --- what is written ------------------------------------------------------------------------------


def code_spans(text: str) -> list[str]:
    """Every piece of code between backticks."""
    return re.findall(r'`([^`]+)`', text)


def code_of(text: str) -> list[str]:
    """Every piece of code, between backticks or in lines by itself."""
    lines = [line.strip() for line in text.splitlines() if line.startswith('    ')]
    return [*code_spans(text), *lines]


def documented(text: str) -> set[str]:
    """Every word that stands as code in the first column of some table."""
    rows = [line.split('|')[1] for line in text.splitlines() if line.startswith('|')]
    spans = [span for cell in rows for span in code_spans(cell)]
    # without the brackets of what may be left out
    return {word.strip('[],') for span in spans for word in span.split()}


def headings(text: str) -> set[str]:
    """The anchors of a page; a title that comes again has a number behind it."""
    titles = re.findall(r'^#+ (.+)$', text, re.MULTILINE)
    plain = [re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-') for title in titles]
    again = [f'{one}-{plain[:at].count(one)}' for at, one in enumerate(plain) if one in plain[:at]]
    return {*plain, *again}


def links(text: str) -> list[tuple[str, str]]:
    """The relative links of a page: file, if any, and anchor, if any."""
    found = re.findall(r'\]\(([^)#\s]*)(?:#([^)\s]*))?\)', text)
    return [(file, anchor) for file, anchor in found if '://' not in file]


def broken_links(page: Path, text: str) -> list[str]:
    """Links that lead nowhere."""
    broken = []
    for file, anchor in links(text):
        target = page.parent / file if file else page
        if not target.exists():
            broken.append(file)
        elif anchor and anchor not in headings(read(target)):
            broken.append(f'{file}#{anchor}')
    return broken


def named_targets(text: str) -> set[str]:
    """The make targets that a page speaks of."""
    return {match[1] for piece in code_of(text) if (match := re.match(r'make ([a-z-]+)', piece))}


def named_parameters(text: str) -> set[str]:
    """The parameters and launch arguments that the commands of a page set."""
    names = {name for piece in code_of(text) for name in re.findall(r'(?<![\w/])(\w+):=', piece)}
    return names - NO_PARAMETERS


def named_files(text: str) -> set[str]:
    """The files of the project that a page names with their folder."""
    pattern = re.compile(r'[\w.-]+/[\w./-]*\.(?:py|md|yaml|rules|csv|rst|json|xml|service)')
    return {span for span in code_spans(text) if pattern.fullmatch(span)}


# --- the tests ------------------------------------------------------------------------------------


def all_launch_arguments() -> set[str]:
    return {name for path in LAUNCH_FILES for name in launch_arguments(read(path))}


def test_the_first_sentence_says_what_it_drives_by_the_word_that_people_look_for() -> None:
    for name, begin in (
        ('README.md', r'# nfo_sinus_driver\s+'), ('docs/README.md', r'# Documentation\s+'),
        ('docs/index.html', '<title>'), ('package.xml', r'<description>\s*'),
        (MSG_DEFS / 'package.xml', r'<description>\s*'), ('setup.py', "description='"),
    ):
        first = re.search(rf'{begin}([^.]*)', read(ROOT / name))
        assert first is not None and 'variable-frequency drives (VFDs' in first[1], name


def test_what_is_public_is_documented() -> None:
    topics = {
        name for path in (PACKAGE / 'node').glob('*.py') for name in topics_and_services(read(path))
    }
    executables = set(re.findall(r"f'([a-z-]+) = \{NAME\}", read(ROOT / 'setup.py')))
    names = topics | executables | SETTINGS
    assert names >= {
        *('~/status', '~/setpoint', '~/enable', '/diagnostics', 'driver', 'simulator'),
        *('port', 'drives', 'address', 'drive_timeout'),
    }
    page = read(INTERFACE)
    # a name of older versions
    assert names - documented(page) == {'~/disable_all'}


def test_what_is_made_of_the_pages_is_current(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / 'tools')
    pages = runpy.run_path(str(ROOT / 'tools' / 'pages.py'))['pages']()
    assert len(pages) >= 4
    assert [path.name for path, text in pages.items() if read(path) != text] == [], 'make pages'


@pytest.mark.parametrize('path', LAUNCH_FILES, ids=lambda path: path.name)
def test_launch_file_is_documented(path: Path) -> None:
    names = launch_arguments(read(path))
    assert {'namespace', 'port'} & names
    assert names - documented(read(INTERFACE)) == set()
    assert f'ros2 launch nfo_sinus_driver {path.name}' in read(INTERFACE)
    compile(read(path), path, 'exec')


def test_simulator_and_make_targets_are_documented() -> None:
    folder = PACKAGE / 'simulator'
    names = of_simulator(read(folder / 'main.py'))
    assert {'--link', '--paced', '--standing', 'fault', 'power-cycle', 'state'} <= names
    # a name of older versions
    assert names - documented(read(SIMULATOR)) == {'--baud'}
    assert {'demo', 'test', 'run'} <= make_targets()
    assert make_targets() - named_targets(read(DEVELOPMENT)) == set()


def test_messages_are_documented() -> None:
    names = {path.stem for kind in ('msg', 'srv', 'action') for path in MSG_DEFS.rglob(f'*.{kind}')}
    page = read(MESSAGES)
    missing = {name for name in names if not re.search(rf'\b{name}\b', page)}
    for name in ('DriveStatus', 'InvSt', 'Telemetry', 'BusStatistics'):
        found = fields(read(MSG_DEFS / 'msg' / f'{name}.msg'))
        assert len(found) > 5, name
        missing |= {f'{name}.{field}' for field in found if f'`{field}`' not in page}
    assert missing - {f'{name}.header' for name in names} == set()


def test_what_a_page_names_exists() -> None:
    parameters = SETTINGS | all_launch_arguments()
    missing = {}
    for page in PAGES:
        text = read(page)
        missing[page.name] = [
            *broken_links(page, text),
            *named_targets(text) - make_targets(),
            *named_parameters(text) - parameters,
            *(name for name in named_files(text)
              if not any((folder / name).exists() for folder in (ROOT, PACKAGE))),
        ]
    assert {page: names for page, names in missing.items() if names} == {}


def test_every_reading_that_is_cited_is_listed() -> None:
    listed = set(re.findall(r'^(\d+)\. ', read(ROOT / 'docs' / 'readings.md'), re.M))
    found = {
        number: path.name
        for folder, kinds in ((PACKAGE, ('*.py', '*.csv')), (ROOT / 'docs', ('*.md',)))
        for kind in kinds
        for path in folder.rglob(kind)
        for number in re.findall(r'\bC(\d+)\b(?=[\],;])', read(path))
    }
    assert found.keys() > {'12', '98'}
    assert {number: name for number, name in found.items() if number not in listed} == {}


def test_every_page_is_in_the_index() -> None:
    index = {file for file, _ in links(read(ROOT / 'docs' / 'README.md'))}
    docs = ROOT / 'docs'
    pages = {page.relative_to(docs).as_posix() for page in docs.rglob('*.md')}
    assert pages - index == {'README.md'}


def test_the_site_has_every_page_that_is_in_the_index() -> None:
    # `make docs` makes it, checks every link, and is part of `make all`
    docs = ROOT / 'docs'
    conf = runpy.run_path(str(docs / 'conf.py'))
    made = {path for pattern in conf['include_patterns'] for path in ROOT.glob(pattern)}
    linked = {(docs / file).resolve() for file, _ in links(read(docs / 'README.md'))}
    assert [path for path in linked if path not in made] == []
    assert all((docs / name).is_file() for name in conf['html_extra_path'])
    assert re.search(r'sphinx-build -q -W -E ', read(ROOT / 'Makefile'))
    assert re.search(r'^all:.*\n(?:\t.*\n)*?\t.*\bdocs\b', read(ROOT / 'Makefile'), re.MULTILINE)


def test_the_site_is_not_made_where_a_link_leads_nowhere() -> None:
    # Sphinx refuses such a link; only rosdoc2, which leaves some pages out, is given its text
    conf = ROOT / 'docs' / 'conf.py'
    page = '[a](nowhere.md) [b](drives) [c](control.md) [d](https://example.org/x)'
    for names, left in (
        ({}, '[a](nowhere.md) b [c](control.md) [d](https://example.org/x)'),
        ({'rosdoc2_settings': {}}, 'a b [c](control.md) [d](https://example.org/x)'),
    ):
        source = [page]
        prepare = runpy.run_path(str(conf), init_globals=names)['_prepare']
        prepare(SimpleNamespace(srcdir=ROOT), 'docs/monitor', source)
        assert source == [left]


def test_every_claim_of_the_quality_declaration_has_its_place_or_is_not_met() -> None:
    rows = re.findall(r'^\| (.+?) \| ((?:not )?met) \| (.*?) ?\|$', read(DECLARATION), re.MULTILINE)
    tables = re.findall(r'^\| requirement \| state', read(DECLARATION), re.MULTILINE)
    # [5] has one more, of libraries
    assert len(tables) == 7 and len(rows) > 25
    assert [what for what, state, where in rows if state == 'met' and not where] == []
    # the version is what it says it waits for
    assert ('level 4' in read(DECLARATION)) is VERSION.startswith('0.')


def test_pictures_are_whole_and_shown_and_say_what_they_show() -> None:
    for path in PICTURES:
        drawing = ElementTree.parse(path).getroot()
        assert {'title', 'desc'} <= {part.tag.rpartition('}')[2] for part in drawing}, path
        shown = re.compile(rf'!\[[^\]]+\]\({re.escape(path.name)}\)')
        assert any(shown.search(read(page)) for page in PAGES), path


def test_the_picture_of_control_names_the_time_outs_of_its_page() -> None:
    docs = ROOT / 'docs'
    named = re.findall(r'\| the driver \| `(\w+)` \|', read(docs / 'control.md'))
    assert {'setpoint_timeout', 'lost_after'} <= set(named)
    picture = read(docs / 'control_states.svg')
    assert not [name for name in named if name not in picture]


def test_parameter_files_name_parameters_that_exist() -> None:
    for path in CONFIGS:
        names = set(re.findall(r'^    (\w+):', read(path), re.MULTILINE))
        assert 'port' in names, path
        assert names - SETTINGS == set(), path


def test_a_page_says_what_the_first_citation_of_a_manual_is() -> None:
    pages = [*(ROOT / 'docs').glob('*.md'), *(ROOT / 'docs' / 'drives').glob('*.md')]
    generated = ('manuals.md', 'parameters.md')
    for page in pages:
        if page.name not in ('readings.md', 'README.md', *generated):
            first = {one['manual']: one[0] for one in reversed([*CITATION.finditer(read(page))])}
            bare = [text for text in first.values() if 'readings.md)' not in text]
            assert not bare, f'{page}: link {bare} to readings.md, which names the manuals'


# --- the checker itself ---------------------------------------------------------------------------


def test_checker_sees_what_is_missing(tmp_path: Path) -> None:
    page = 'Prose of `port`.\n\n| name | meaning |\n|---|---|\n| `address [N]` | as `model` |\n'
    assert documented(page) == {'address', 'N'}
    assert named_targets('Type `make tea`.\n\n    make it\n\nWe make none.') == {'tea', 'it'}
    parameters = '`-p sugar:=2` and\n\n    run milk:=1 -r __ns:=/x -r ~/tea:=/x'
    assert named_parameters(parameters) == {'sugar', 'milk'}
    assert named_files('`config/no.yaml`, `no.yaml`, `/dev/x`') == {'config/no.yaml'}
    path = tmp_path / 'page.md'
    path.write_text('# The first\n\n## What, then?\n')
    for link in ('page.md', '#the-first', 'page.md#what-then', 'https://example.org/x'):
        assert broken_links(path, f'[see\nthere]({link})') == []
    for link in ('other.md', '#the-last', 'page.md#then', '../nowhere/'):
        assert broken_links(path, f'[there]({link})') == [link]


def test_the_readme_says_what_is_a_safety_function_and_what_is_not() -> None:
    # law 10: it stands near the top, where it is read
    top = ' '.join(read(ROOT / 'README.md')[:2000].split())
    assert 'safety function' in top
    assert 'RUN input' in top
    assert 'drive_timeout' in top
