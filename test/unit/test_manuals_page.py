# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""docs/manuals.csv: what serves a row of a manual is there."""

from __future__ import annotations

import ast
import fnmatch
from pathlib import Path
import re
import runpy

import pytest
from test_docs import fields, headings, read, topics_and_services

from nfo_sinus_driver.catalog import Family, load_family
from nfo_sinus_driver.cli.main import VERBS
from nfo_sinus_driver.cli.parameter_file import readable
from nfo_sinus_driver.node.parameters.settings import BUS_SETTINGS, DRIVE_SETTINGS

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / 'docs'
_TOOL = runpy.run_path(str(ROOT / 'tools' / 'manuals_page.py'))
ROWS = _TOOL['rows']()
#: The drives that each manual is about.
FAMILIES = {
    'M0': 'sinus_g2', 'M1': 'sinus_optimal', 'M2': 'sinus_g2', 'M3': 'sinus_h', 'M4': 'movitrac31',
}
MESSAGES = {
    '~/status': 'DriveStatus', '~/inv_st': 'InvSt', '~/telemetry': 'Telemetry',
    '~/statistics': 'BusStatistics', '~/measured': 'Measured',
}
SETTINGS = {**BUS_SETTINGS, **DRIVE_SETTINGS}
OFFERED = topics_and_services()


def is_there(name: str, family: Family) -> bool:
    """Whether there is what a row names: topic, field, service, setting, parameter, verb, place."""
    if name.startswith(('~/', '/')):
        return _is_offered(*name.split())
    if name.startswith('nfo-sinus '):
        return name.split()[1] in VERBS
    if '.md' in name:
        file, _, anchor = name.partition('#')
        return (DOCS / file).is_file() and anchor in headings(read(DOCS / file))
    setting, _, value = name.partition(': ')
    if setting in SETTINGS:
        return not value or value in _choices(setting, family)
    ways = [load_family(family.name, method) for method in family.profile.methods]
    return any(fnmatch.filter(readable(way), name) for way in ways)


def _is_offered(topic: str, field: str = '') -> bool:
    if not field:
        return topic in OFFERED
    message = read(ROOT / 'msg_defs' / 'msg' / f'{MESSAGES[topic]}.msg')
    return topic in OFFERED and field in fields(message)


def _choices(setting: str, family: Family) -> set[str]:
    methods = family.profile.methods
    if setting == 'control_method':
        return {'monitor', *methods}
    if setting == 'reference':
        return {reference for method in methods.values() for reference in method.references}
    return set(SETTINGS[setting].choices)


def missing(row: dict[str, str]) -> list[str]:
    """What a row names, in either of its last columns, and is not there."""
    family = load_family(FAMILIES[row['manual']])
    named = [*_TOOL['served_by'](row), *re.findall('`([^`]+)`', row['why'])]
    return [name for name in named if not is_there(name, family)]


def test_what_a_row_names_is_there() -> None:
    found = {f'{row["manual"]} {row["place"]} {row["what"]}': missing(row) for row in ROWS}
    assert {row: names for row, names in found.items() if names} == {}


def is_test(name: str) -> bool:
    """Whether there is a test of this name."""
    file, _, function = name.partition('::')
    path = ROOT / 'test' / file
    return path.is_file() and f'\ndef {function}(' in read(path)


def test_what_is_served_has_a_test_that_shows_it() -> None:
    # what is done by hand at the drive, a wire or a jumper, is only documented
    documented = re.compile(r'drives/\w+\.md#')
    wrong = [
        (row['manual'], row['place'], row['what'])
        for row in ROWS
        if not all(map(is_test, _TOOL['shown_by'](row)))
        or (row['status'] == 'not' and row['shown_by'])
        or (
            row['status'] != 'not' and not row['shown_by']
            and not all(map(documented.match, _TOOL['served_by'](row)))
        )
    ]
    assert wrong == []


def test_a_row_says_what_serves_it_or_why_it_is_not_served() -> None:
    assert [row for row in ROWS if list(row) != _TOOL['COLUMNS'] or None in row.values()] == []
    wrong = [
        row for row in ROWS
        if row['status'] not in _TOOL['STATUSES']
        or bool(row['served_by']) is (row['status'] == 'not')
        or bool(row['why']) is (row['status'] == 'served')
        or not row['place'] or not row['what']
    ]
    assert wrong == []
    whole = [(row['manual'], row['place'], row['what']) for row in ROWS]
    assert [entry for entry in whole if whole.count(entry) > 1] == []


#: What gives the text of the manuals to a test; without it that is skipped.
READS_MANUALS = {'of_g2', 'of_movitrac', 'ends_of', 'list_of_movitrac', 'READERS'}


def reads_manuals(named: str) -> bool:
    """Whether a test is skipped where the manuals are not beside the clone."""
    file, _, name = named.partition('::')
    tree = ast.parse(read(ROOT / 'test' / file))
    (test,) = (node for node in ast.walk(tree) if getattr(node, 'name', '') == name)
    names = {node.id for node in ast.walk(test) if isinstance(node, ast.Name)}
    return not names.isdisjoint(READS_MANUALS)


def test_the_page_says_which_rows_need_the_manuals_or_have_no_test() -> None:
    shown = [_TOOL['shown_by'](row) for row in ROWS if row['status'] != 'not']
    skipped = sum(bool(tests) and all(map(reads_manuals, tests)) for tests in shown)
    documented = sum(not tests for tests in shown)
    page = ' '.join(_TOOL['page']().split())
    assert f'{skipped} rows rest on tests alone that are skipped where' in page
    assert f'{documented} rows are sentences of these pages, and rest on no test' in page


def test_what_is_not_served_has_one_of_eleven_reasons() -> None:
    reasons = {row['why'] for row in ROWS if row['status'] == 'not'}
    assert len(reasons) <= 11, sorted(reasons)


def test_every_manual_has_rows_and_a_page_of_its_drive() -> None:
    assert {row['manual'] for row in ROWS} == _TOOL['MANUALS'].keys() == FAMILIES.keys()
    for _, drive in _TOOL['MANUALS'].values():
        text = read(DOCS / 'drives' / f'{drive}.md')
        assert '(../manuals.md#' in text, drive
        # where a program is found is no text to read
        text = text.replace('ros2 run nfo_sinus_driver ', '')
        words = [word for word in text.split() if re.search(r'\w', word)]
        assert len(words) <= 600, drive


@pytest.mark.parametrize(
    'name',
    [
        '~/none', '~/status none', 'nfo-sinus none', 'control_method: none', 'reference: none',
        'protocol: none', 'motor.none', 'none.*', 'none', 'none.md#at-all', 'interface.md#none',
    ],
)
def test_what_is_not_there_is_found(name: str) -> None:
    assert missing({'manual': 'M0', 'served_by': name, 'why': f'by `{name}`'}) == [name, name]
