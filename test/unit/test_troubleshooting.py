# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Every warning, error and refusal of the driver has an entry in ``docs/troubleshooting.md``.

Those of causes are made of them. The others stand in ``docs/troubleshooting.md.in``: code in the
first column of a table of messages, the whole text with ``…`` or an example for each value, or its
beginning.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
import re
import runpy

from support.places import ROOT

from nfo_sinus_driver.link import LinkError, Refused

_TOOL = runpy.run_path(str(ROOT / 'tools' / 'troubleshooting_page.py'))
nodes, texts = _TOOL['nodes'], _TOOL['texts']
#: Modules whose ``ValueError`` no operator reads: it is of a table, which every test loads, or of
#: the file of a drive, and is reported with its line; of a frame that no request makes; of what the
#: node asks before; of an operating record, which is put aside with a message of its own.
NEVER_SHOWN = {
    *(f'catalog/{name}.py' for name in ('codec', 'family', 'table')),
    *(f'catalog/declared/{name}.py' for name in ('register_map', 'yaml_file')),
    *(f'link/canopen/{name}.py' for name in ('lawicel', 'sdo')),
    *(f'link/pairs/{name}.py' for name in ('classic', 'movitrac')),
    *(f'operating_record/{name}.py' for name in ('figures', 'files')),
    *('drive/known/drive_state.py', 'drive/motion/setpoint.py', 'node/messages/messages.py'),
}
REFUSALS = {(str(Refused(n)),) for n in (1, 2, 3, 4, 5, 6, 8, 10, 11)}
Parts = tuple[str, ...]


def kinds_of(error: type) -> set[str]:
    """The names of a class and of all that are derived from it."""
    return {error.__name__}.union(*map(kinds_of, error.__subclasses__()))


SPEAKING = {
    *('error', 'warning', 'warn', 'fatal', 'critical', 'exception'), *kinds_of(LinkError),
    *('NodeError', 'NotPossible', 'ValueError', 'RuntimeError', 'StepError', 'RecordingError'),
}


def name_of(node: ast.AST) -> str:
    """The last name of what is called, such as ``warning`` of ``self._log.warning``."""
    return getattr(node, 'attr', getattr(node, 'id', ''))


def spoken(name: str, node: ast.AST) -> Iterator[Parts]:
    """What a node logs, raises or answers."""
    if isinstance(node, ast.Assign) and name_of(node.targets[0]) == 'message' and 'node/' in name:
        yield from texts(node.value)
    elif isinstance(node, ast.Call):
        # also a method of a log that is handed over
        called = {getattr(argument, 'attr', '') for argument in node.args} | {name_of(node.func)}
        called -= {'ValueError'} if name in NEVER_SHOWN else set()
        if called & SPEAKING or ast.unparse(node.func) == 'failed.append':
            yield from (parts for argument in node.args for parts in texts(argument))


def entries(page: str) -> list[str]:
    """What stands as code in the first columns of the tables of messages."""
    tables = re.findall(r'^\| message \|.*\n\|---.*\n((?:[|{].*\n)+)', page, re.MULTILINE)
    firsts = re.findall(r'^\|([^|]*)\|', ''.join(tables), re.MULTILINE)
    return [entry for first in firsts for entry in re.findall('`([^`]+)`', first)]


def without(these: Iterable[str], said: Iterable[Parts]) -> tuple[list[str], list[str]]:
    """Entries without a text, texts without an entry; a value is an example or ``…``."""
    unsaid, unfound = set(these), []
    for parts in said:
        text = ''.join(parts)
        # one word stands for anything, and so do a few letters with values around them
        if len(text) > 4 and ' ' in text and re.search('[a-z]', text):
            pattern = '(?:…+|[^…]*)'.join(map(re.escape, parts))
            found = {e for e in these if max(parts, key=len) in e and re.fullmatch(pattern, e)}
            unsaid -= found
            unfound += [] if found else ['…'.join(parts)]
    return sorted(unsaid), unfound


def test_what_is_logged_raised_and_answered_has_an_entry() -> None:
    said = {parts for name, node in nodes() for parts in spoken(name, node)} | REFUSALS
    assert ('cannot start: ', '') in said and len(said) > 200
    every = entries(_TOOL['page']())
    assert without(every, said)[1] == []
    assert [entry for entry in every if every.count(entry) > 1] == []


def test_an_entry_by_hand_is_still_said_and_the_rest_is_short() -> None:
    said = {parts for _, node in nodes() if isinstance(node, ast.Module) for parts in texts(node)}
    by_hand = _TOOL['by_hand']()
    assert len(entries(by_hand)) > 200
    assert without(entries(by_hand), said | REFUSALS)[0] == []
    about_no_message = re.sub(r'^\| `.*', '', by_hand, flags=re.MULTILINE)
    assert len(about_no_message.split()) <= 1500


def test_by_a_cause_without_a_remedy_nothing_is_wrong() -> None:
    *others, (title, informing, remedy) = _TOOL['remedies']()
    assert title.startswith('Nothing is wrong') and not remedy
    assert [group for group in others if not group[2] or group[0] == title] == []
    calls = [node for _, node in nodes() if isinstance(node, ast.Call)]
    graver = {
        name_of(part)
        for call in calls if name_of(call.func) in ('DriveError', 'notify')
        and ast.unparse(call.args[0]) != 'Severity.INFO' for part in ast.walk(call)
    }
    assert {'CANNOT_STOP', 'NOT_CONNECTED'} <= graver
    handed_on = {'LINE_FAILED', 'NOT_POSSIBLE', 'NOT_CHANGED', 'SEVERAL'}
    assert {cause.name for cause in informing} & graver <= handed_on


def test_what_has_no_entry_is_found() -> None:
    page = '| message | why |\n|---|---|\n| `the motor … broke: 5` | `it all` wore out |\n'
    source = "log.error(f'the motor {a} broke: %s', b)\nraise ValueError('it all')\nx = 'no one'"
    said = [parts for node in ast.walk(ast.parse(source)) for parts in spoken('', node)]
    assert said == [('the motor ', ' broke: ', ''), ('it all',)]
    assert without(entries(page), said) == ([], ['it all'])
    assert without(entries(page), [('the motor ', ' broke')])[0] == ['the motor … broke: 5']
