# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is reported is a value where it is noticed, and has a sentence where it is shown."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
import functools
import itertools
from pathlib import Path
import re
import string

from support.said import CALLS

from nfo_sinus_driver.catalog import families, load_family
from nfo_sinus_driver.cli import console as cli
from nfo_sinus_driver.drive import Cause, Report
from nfo_sinus_driver.drive.known.changes import ParameterChange
from nfo_sinus_driver.drive.known.events import sentence
from nfo_sinus_driver.link import PROTOCOLS

PACKAGE = Path(__file__).resolve().parents[3] / 'nfo_sinus_driver'
DRIVE = sorted((PACKAGE / 'drive').rglob('*.py'))
REPORTING = [*DRIVE, *(path for room in ('cli', 'node') for path in (PACKAGE / room).rglob('*.py'))]
#: What the tables of contact and control mean, drawn in the docs; and how to write a setting that
#: is wrong.
WITH_SENTENCES = {'contact.py', 'control_state.py', 'events.py', 'settings.py'}
#: Mistakes in the program, and wrong values: they are reported as NOT_POSSIBLE.
SPEAKING = {'AssertionError', 'ValueError', 'debug', 'exception'}
WORD = re.compile(r"(?:^| )\(?[a-z][a-z'-]*[:,.;)]?(?= |$)")


def trees(paths: list[Path]) -> Iterator[tuple[str, ast.Module]]:
    for path in paths:
        yield path.name, ast.parse(path.read_text(encoding='utf-8'))


def name_of(call: ast.Call) -> str:
    return getattr(call.func, 'id', '') or getattr(call.func, 'attr', '')


def texts(node: ast.AST) -> Iterator[str]:
    """What a program says, but for docstrings, its own mistakes and its log of these."""
    mistake = isinstance(node, ast.Call) and name_of(node) in SPEAKING
    docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    if mistake or docstring or isinstance(node, ast.Assert):
        return
    if isinstance(node, ast.JoinedStr):
        yield ''.join(
            str(part.value) if isinstance(part, ast.Constant) else '0' for part in node.values
        )
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    else:
        for child in ast.iter_child_nodes(node):
            yield from texts(child)


def reported_by(call: ast.Call) -> ast.expr | None:
    """The cause that a call makes a report of."""
    places = {'Report': 0, 'report': 0, 'DriveError': 0, 'notify': 1, '_notify': 1}
    place = places.get(name_of(call))
    if place is None or len(call.args) <= place or isinstance(call.args[place], ast.Call):
        return None
    return call.args[place]


def causes_in(node: ast.AST) -> set[Cause]:
    return {
        Cause[part.attr]
        for part in ast.walk(node)
        if isinstance(part, ast.Attribute) and getattr(part.value, 'id', '') == 'Cause'
    }


def fields_of(cause: Cause) -> set[str]:
    parts = string.Formatter().parse(cause.value)
    return {re.split(r'[.\[]', name)[0] for _, name, _, _ in parts if name} - {'call'}


def sentences(trees: Iterable[tuple[str, ast.Module]]) -> list[tuple[str, str]]:
    return [
        (name, text)
        for name, tree in trees
        for text in texts(tree)
        if len(WORD.findall(text)) >= 4
    ]


def test_drive_has_no_sentence() -> None:
    silent = [path for path in DRIVE if path.name not in WITH_SENTENCES]
    assert sentences(trees(silent)) == []
    # one would be found
    tree = ast.parse("'''Such as this one here.'''\nx = f'{a}: the motor is enabled'")
    assert len(sentences([('x.py', tree)])) == 1


def test_every_cause_has_a_sentence_and_is_reported() -> None:
    reported = {cause for _, tree in trees(REPORTING) for cause in causes_in(tree)}
    assert reported == set(Cause)


def test_every_sentence_is_given_what_it_needs() -> None:
    """Also where the cause is chosen before: some report without one has what it needs."""
    given: list[tuple[Cause, set[str]]] = []
    chosen: set[Cause] = set()
    general: list[set[str]] = []
    for _, tree in trees(REPORTING):
        named: set[Cause] = set()
        for call in ast.walk(tree):
            what = reported_by(call) if isinstance(call, ast.Call) else None
            if isinstance(call, ast.Call) and what is not None:
                values = {str(keyword.arg) for keyword in call.keywords}
                values |= {'status', 'enable_input'} if name_of(call) == 'report' else set()
                causes = causes_in(what)
                given += [(cause, values) for cause in causes]
                general += [] if causes else [values]
                named |= causes
        chosen |= causes_in(tree) - named
    assert [(cause, values) for cause, values in given if not fields_of(cause) <= values] == []
    never = chosen - {cause for cause, _ in given}
    assert never
    for cause in never:
        assert any(fields_of(cause) <= values for values in general), cause


#: Terminals, keys, registers, and settings that no bus has, by the family that has them.
NAMES = {
    'sinus_g2': {'DIN1', 'RUN', 'MODE', 'SCMD', 'InvSt', 'FrqScl', 'TrqScl', 'RegScl', 'SpdScl'},
    'sinus_optimal': {'DIN1', 'RUN', 'MODE', 'SCMD', 'InvSt', 'SMODE'},
    'sinus_h': {'STW1', 'ZSW1', 'PRT'},
    'movitrac31': {'41', '42', '43', 'X4', 'X20', *(f'P{number}' for number in range(100, 1000))},
}
for _family, _names in NAMES.items():
    # one such as SioTot is no other word; one such as Mode may be
    _names |= {
        word
        for parameter in load_family(_family).values()
        for word in re.findall(r'\w+', parameter.name)
        if re.search('[a-z][A-Z]', word)
    }
EVERY_NAME = set().union(*NAMES.values())
#: Files and sentences for the families that one protocol reaches.
OF_PROTOCOL = {
    'classic.py': 'classic',
    'movitrac.py': 'movitrac',
    PROTOCOLS['movitrac'].check: 'movitrac',
}
SAYING = [
    path
    for room in ('bus', 'cli', 'drive', 'link', 'node', 'view')
    for path in sorted((PACKAGE / room).glob('*.py'))
]


def foreign_names(said: str, family: str) -> set[str]:
    """What a sentence names that a family does not have."""
    return set(re.findall(r'\w+', said)) & EVERY_NAME - NAMES[family]


@functools.cache
def families_on(protocol: str) -> list[str]:
    return [
        name
        for name in families()
        if any(protocol in parameter.addresses for parameter in load_family(name).values())
    ]


def test_what_all_families_share_names_nothing_of_one() -> None:
    named = []
    for path, (_, tree) in zip(SAYING, trees(SAYING), strict=True):
        for text in texts(tree):
            protocol = OF_PROTOCOL.get(path.name) or OF_PROTOCOL.get(text)
            possible = families() if protocol is None else families_on(protocol)
            if ' ' in text:
                named += [(text, name) for name in possible if foreign_names(text, name)]
    assert named == []


def test_no_sentence_for_one_family_names_what_another_has() -> None:
    named = []
    for name in families():
        family = load_family(name)
        said = [f'{code.description} {code.remedy}' for code in family.status_codes.values()]
        terminal = family.profile.enable_input
        said += [cause.value.replace('{enable_input}', terminal) for cause in Cause]
        named += [(name, text) for text in said if foreign_names(text, name)]
    assert named == []


def test_every_sentence_can_be_made() -> None:
    code = load_family('sinus_g2').status_code(5)
    for cause in Cause:
        parts = string.Formatter().parse(cause.value)
        numbers = {name: 1.0 for _, name, spec, _ in parts if name and spec}
        values = {name: name for name in fields_of(cause)} | numbers
        values |= {'fault': code, 'alarm': code, 'limit': code}
        text = sentence(Report(cause, **values), CALLS)
        assert text and not set(text) & set('{}'), cause
    assert [cause for cause in Cause if '~/' in cause.value] == []


def test_a_report_within_a_report() -> None:
    fault = Report(Cause.FAULT, status='5 Overload', fault=load_family('sinus_g2').status_code(5))
    text = cli.say(Report(Cause.STOPPED_BECAUSE_OF_FAULT, why=fault))
    assert text.startswith('stopped: fault 5 Overload: The power monitor has tripped')
    assert text.endswith('; then type nfo-sinus ack, then run it again to go on')


def test_several_reports_and_several_values() -> None:
    back = Report(Cause.PUT_BACK, keys=('a', 'b'))
    keeps = Report(Cause.DRIVE_KEEPS, value='7 s')
    text = sentence(Report(Cause.SEVERAL, reports=(keeps, back)), CALLS)
    assert text == 'the drive keeps 7 s; put back: a, b'
    changes = tuple(itertools.repeat(ParameterChange('a', 1, 2, 's'), 2))
    report = Report(Cause.TUNING_CHANGED, how=keeps, changes=changes)
    assert sentence(report, CALLS).endswith('; changed: a: 1 -> 2 s, a: 1 -> 2 s')


def test_what_is_not_known_is_said_so() -> None:
    text = sentence(Report(Cause.STOP_CONFIRMED_LATE, status=''), CALLS)
    assert text == 'the stop is confirmed now: its status is not known'
    text = sentence(Report(Cause.SETTINGS_REFRESHED, count=3, changed=()), CALLS)
    assert text == '3 parameters read, changed: none'


def test_reports_are_compared_by_what_they_say() -> None:
    assert Report(Cause.LOST, why=Report(Cause.ENDING)) == Report(
        Cause.LOST, why=Report(Cause.ENDING)
    )
    assert Report(Cause.NO_RESPONSE, address=1) != Report(Cause.NO_RESPONSE, address=2)
