# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Every warning, error and refusal of the driver has an entry in ``docs/troubleshooting.md``.

What there is to find is read from the code: the templates of all causes but those that only inform,
what is given to ``error`` and ``warning`` of a logger, and the texts of exceptions. An entry is
code in the first column of a table of messages: the whole sentence, with ``…`` or an example for
each value.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
import itertools
from pathlib import Path
import re
import string

import pytest

from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.link import Refused

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / 'nfo_sinus_driver'
PAGE = ROOT / 'docs' / 'troubleshooting.md'

#: Answers of commands that succeed, and changes that were requested: nothing is wrong.
SUCCESSES = {
    *(Cause.ENABLED, Cause.ENABLED_ALREADY, Cause.STOPPED, Cause.STOPPING, Cause.COASTING),
    *(Cause.RAMPING, Cause.QUICK_STOPPED, Cause.RAPID_STOPPING),
    *(Cause.ACKNOWLEDGED, Cause.ACKNOWLEDGED_DETAILED),
    *(Cause.CONTROL_RELEASED, Cause.ONLY_WATCHED, Cause.TUNED, Cause.LOG_ERASED),
    *(Cause.ENERGY_RESET, Cause.SETTINGS_REFRESHED, Cause.CHANGED, Cause.CHANGED_AS_WANTED),
    Cause.CHANGED_FOR_TIMEOUT,
    # who stopped the motor, as ~/status has it
    *(Cause.STOP_REQUESTED, Cause.DISABLE_REQUESTED, Cause.QUICK_STOP_REQUESTED),
    *(Cause.STOP_ALL_REQUESTED, Cause.ACKNOWLEDGE_REQUESTED, Cause.TRANSITION_REQUESTED),
    *(Cause.DRIVER_ENDS, Cause.ENABLE_FAILED, Cause.PROCEDURE_ENDED, Cause.PROCEDURE_CANCELLED),
}
SENTENCES = {cause: cause.value for cause in Cause}
#: The simulator and the command line have pages of their own, and no log.
OTHER_PROGRAMS = ('simulator', 'cli')
#: Modules whose ``ValueError`` no operator reads, and why.
NEVER_SHOWN = {
    'catalog/codec.py': 'a table of a drive is wrong: found when it is loaded, by every test',
    'catalog/family.py': 'the same',
    'catalog/table.py': 'the same',
    'catalog/declared/places.py': 'the file of a drive is wrong: reported with its line',
    'catalog/declared/yaml_file.py': 'the same',
    'link/lawicel.py': 'a frame that no request makes; the rate was checked before',
    'link/classic.py': 'a frame that no request makes; the address was checked before, and nothing '
    'reads by a broadcast',
    'link/movitrac.py': 'a frame that no request makes; the address was checked before',
    'link/sdo.py': 'no parameter of a table has such a size',
    'drive/drive_state.py': 'the node makes another session, and asks before',
    'drive/setpoint.py': 'the node takes finite numbers only, and says so itself',
    'node/messages.py:inv_st': 'made only of a status that came',
}
LEVELS = {'error', 'warning', 'warn', 'fatal', 'critical', 'exception'}
#: Exceptions that carry a sentence to whatever reads the log, an answer or the terminal; and all
#: that are a kind of ``LinkError``.
EXCEPTIONS = {
    *('LinkError', 'NodeError', 'NotPossible', 'ValueError', 'RuntimeError', 'StepError'),
    'RecordingError',
}


# --- what the code says ---------------------------------------------------------------------------

_Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Sentence:
    """A sentence: its cause or line, and its fixed words, with a value between any two of them."""

    where: str
    parts: tuple[str, ...]

    @property
    def has_words(self) -> bool:
        """It says something itself, and does not only hand on what others say."""
        return bool(re.search('[a-z]', ''.join(self.parts)))

    @cached_property
    def pattern(self) -> re.Pattern[str]:
        """What an entry for it looks like; a value is an example or ``…``, never some of both."""
        return re.compile('(?:…+|[^…]*)'.join(map(re.escape, self.parts)))

    def is_in(self, entry: str) -> bool:
        """Return whether an entry is one for it."""
        return all(part in entry for part in self.parts) and bool(self.pattern.fullmatch(entry))

    def __str__(self) -> str:
        return f'{self.where}: {"…".join(self.parts)}'


def of_template(where: str, template: str) -> Sentence:
    """Return the sentence of a template of ``str.format``."""
    parts = ['']
    for text, field, _, _ in string.Formatter().parse(template):
        parts[-1] += text
        if field is not None:
            parts.append('')
    return Sentence(where, tuple(parts))


def of_parts(where: str, parts: tuple[str, ...]) -> Sentence:
    """Return the sentence of a text; what logging puts in is a value, too."""
    return Sentence(where, tuple(itertools.chain(*(re.split('%[sdr]', part) for part in parts))))


def parts_of(node: ast.expr) -> tuple[str, ...] | None:
    """Return the fixed parts of a text or an f-string, ``None`` for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return (node.value,)
    if not isinstance(node, ast.JoinedStr):
        return None
    parts = ['']
    for value in node.values:
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            parts[-1] += value.value
        else:
            parts.append('')
    return tuple(parts)


def name_of(node: ast.expr) -> str:
    """Return the last name of what is called, such as ``warning`` of ``self._log.warning``."""
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ''


class Code:
    """Modules, by their paths in the package, and where the texts in them come from."""

    def __init__(self, modules: Mapping[str, str]) -> None:
        self._trees = {path: ast.parse(source) for path, source in modules.items()}
        self._parents = {
            child: node
            for tree in self._trees.values()
            for node in ast.walk(tree)
            for child in ast.iter_child_nodes(node)
        }
        #: What functions return or yield, with the function and its module, by its name.
        self._results: dict[str, list[tuple[str, _Function, ast.expr]]] = {}
        for path, node in self.nodes():
            if isinstance(node, ast.Return | ast.Yield) and node.value is not None:
                function = self.function_around(node)
                if function is not None:
                    result = path, function, node.value
                    self._results.setdefault(function.name, []).append(result)

    def nodes(self) -> Iterator[tuple[str, ast.AST]]:
        """Yield every node of every module, and the path of that."""
        for path, tree in self._trees.items():
            for node in ast.walk(tree):
                yield path, node

    def function_around(self, node: ast.AST) -> _Function | None:
        """Return the function that something stands in."""
        while node in self._parents:
            node = self._parents[node]
            if isinstance(node, _Function):
                return node
        return None

    def kinds_of(self, name: str) -> set[str]:
        """Return the names of all classes that are derived from a class."""
        classes = [node for _, node in self.nodes() if isinstance(node, ast.ClassDef)]
        found, before = {name}, set[str]()
        while found != before:
            before = found
            kinds = {one.name for one in classes if found & set(map(name_of, one.bases))}
            found = found | kinds
        return found

    def logged(self) -> Iterator[Sentence]:
        """Yield what is logged as a warning or an error."""
        for path, node in self.nodes():
            if not isinstance(node, ast.Call):
                continue
            handed_over = any(
                isinstance(one, ast.Attribute) and one.attr in LEVELS for one in node.args
            )
            if name_of(node.func) in LEVELS or handed_over:
                yield from self._sentences(path, node, node.args)

    def raised(self) -> Iterator[Sentence]:
        """Yield the texts of exceptions."""
        speaking = EXCEPTIONS | self.kinds_of('LinkError')
        for path, node in self.nodes():
            if not isinstance(node, ast.Call):
                continue
            name, around = name_of(node.func), self.function_around(node)
            shown = not {path, f'{path}:{around.name if around else ""}'} & NEVER_SHOWN.keys()
            if name in speaking and (name != 'ValueError' or shown):
                yield from self._sentences(path, node, node.args)

    def answered(self) -> Iterator[Sentence]:
        """Yield what the nodes put into the message of an answer themselves."""
        for path, node in self.nodes():
            if isinstance(node, ast.Assign) and path.startswith('node/'):
                texts = [node.value for target in node.targets if name_of(target) == 'message']
                yield from self._sentences(path, node, texts)
            elif isinstance(node, ast.Call) and ast.unparse(node.func) == 'failed.append':
                yield from self._sentences(path, node, node.args)

    def texts(self) -> Iterator[Sentence]:
        """Yield every text that there is."""
        for path, node in self.nodes():
            if isinstance(node, ast.expr) and (parts := parts_of(node)) is not None:
                yield of_parts(f'{path}:{node.lineno}', parts)

    def _sentences(
        self, path: str, node: ast.expr | ast.stmt, given: Iterable[ast.expr]
    ) -> Iterator[Sentence]:
        for value in given:
            for parts in self._resolved(path, value, ()):
                yield of_parts(f'{path}:{node.lineno}', parts)

    def _resolved(
        self, path: str, node: ast.expr, seen: tuple[ast.AST, ...]
    ) -> Iterator[tuple[str, ...]]:
        """Yield the texts that an expression may be."""
        parts = parts_of(node)
        if parts is not None:
            yield parts
        elif node in seen:
            return
        elif isinstance(node, ast.Name):
            for value in self._values_of(path, node):
                yield from self._resolved(path, value, (*seen, node))
        elif isinstance(node, ast.IfExp):
            yield from self._resolved(path, node.body, seen)
            yield from self._resolved(path, node.orelse, seen)
        elif isinstance(node, ast.Starred):
            yield from self._resolved(path, node.value, seen)
        elif isinstance(node, ast.BoolOp | ast.Tuple):
            for value in node.values if isinstance(node, ast.BoolOp) else node.elts:
                yield from self._resolved(path, value, seen)
        elif isinstance(node, ast.Call):
            func = node.func
            if isinstance(func, ast.Attribute) and parts_of(func.value):
                # a text that is stripped
                yield from self._resolved(path, func.value, seen)
            elif isinstance(func, ast.Name) or ast.unparse(func).rpartition('.')[0] == 'self':
                for where, value in self._results_of(name_of(func), is_property=False):
                    yield from self._resolved(where, value, (*seen, node))
        elif isinstance(node, ast.Attribute):
            for where, value in self._results_of(node.attr, is_property=True):
                yield from self._resolved(where, value, (*seen, node))

    def _values_of(self, path: str, name: ast.Name) -> Iterator[ast.expr]:
        """Yield what a name may stand for: assigned, gone through, or given by a caller."""
        around = self.function_around(name)
        for node in ast.walk(around or self._trees[path]):
            if isinstance(node, ast.Assign):
                names = [one.id for one in node.targets if isinstance(one, ast.Name)]
                yield from [node.value] if name.id in names else []
            elif isinstance(node, ast.For) and name_of(node.target) == name.id:
                yield node.iter
        if around is None:
            return
        given = [argument.arg for argument in around.args.args if argument.arg != 'self']
        if name.id not in given:
            for node in self._trees[path].body:
                if isinstance(node, ast.Assign) and name_of(node.targets[0]) == name.id:
                    yield node.value
            return
        at = given.index(name.id)
        for node in ast.walk(self._trees[path]):
            if isinstance(node, ast.Call) and name_of(node.func) == around.name:
                yield from node.args[at : at + 1]

    def _results_of(self, name: str, *, is_property: bool) -> Iterator[tuple[str, ast.expr]]:
        """Yield what functions or properties of a name return or yield, and where they stand."""
        for path, function, value in self._results.get(name, ()):
            decorators = map(ast.unparse, function.decorator_list)
            if is_property == ('property' in decorators):
                yield path, value


def informs(node: ast.AST) -> bool:
    """Return whether a node tells something as information."""
    if isinstance(node, ast.Call) and name_of(node.func) == 'notify':
        return ast.unparse(node.args[0]) == 'Severity.INFO'
    value = node.value if isinstance(node, ast.Yield) else None
    return isinstance(value, ast.Tuple) and ast.unparse(value.elts[0]) == 'Severity.INFO'


def refuses(node: ast.AST) -> bool:
    """Return whether a node tells something graver, or raises it."""
    name = name_of(node.func) if isinstance(node, ast.Call) else ''
    return name == 'DriveError' or (name == 'notify' and not informs(node))


def causes_in(node: ast.AST) -> Iterator[ast.Attribute]:
    """Yield every mention of a cause below a node."""
    for child in ast.walk(node):
        if isinstance(child, ast.Attribute) and name_of(child.value) == 'Cause':
            yield child


def only_informing(code: Code) -> set[Cause]:
    """Return the causes that are reported as information wherever they are mentioned."""
    nodes = [node for _, node in code.nodes()]
    informing = {one for node in nodes if informs(node) for one in causes_in(node)}
    mentions = {one for node in nodes if isinstance(node, ast.Attribute) for one in (node,)
                if name_of(one.value) == 'Cause'}
    other = {mention.attr for mention in mentions - informing}
    return {Cause[mention.attr] for mention in mentions if mention.attr not in other}


# --- what the page says ---------------------------------------------------------------------------


def entries(page: str) -> list[str]:
    """Return what stands as code in the first columns of the tables of messages."""
    found: list[str] = []
    of_messages = False
    for line in page.splitlines():
        of_messages = line.startswith('| message |') or (of_messages and line.startswith('|'))
        if of_messages:
            found += re.findall(r'`([^`]+)`', line.split('|')[1])
    return found


def missing(sentences: Iterable[Sentence], page: str) -> list[str]:
    """Return the sentences that have no entry."""
    found = entries(page)
    return [
        str(one)
        for one in sentences
        if one.has_words and not any(one.is_in(entry) for entry in found)
    ]


# --- the tests ------------------------------------------------------------------------------------


@cache
def code() -> Code:
    """Return all that an operator may read of; not when each worker collects the tests."""
    return Code({
        path.relative_to(PACKAGE).as_posix(): path.read_text(encoding='utf-8')
        for path in sorted(PACKAGE.rglob('*.py'))
        if path.relative_to(PACKAGE).parts[0] not in OTHER_PROGRAMS
    })


PAGE_TEXT = PAGE.read_text(encoding='utf-8')


REFUSALS = [Sentence(f'exception {n}', (str(Refused(n)),)) for n in (*range(1, 12), 99)]
REFUSED = Sentence('99', ('the drive refused (exception ', ')'))


def templates() -> Iterator[Sentence]:
    """Yield the sentence of each cause by which something is wrong."""
    silent = SUCCESSES | only_informing(code())
    for cause, template in SENTENCES.items():
        if cause not in silent:
            yield of_template(cause.name, template)


@pytest.mark.parametrize(
    ('read', 'known'),
    [
        (
            templates,
            (
                *('CANNOT STOP THE MOTOR: …', 'the current limit holds the motor back'),
                *('lost: …; retrying; it is stopped as soon', 'the stop is NOT confirmed: …'),
            ),
        ),
        (
            lambda: code().logged(),
            (
                *('cannot start: …', 'error in a service of …', '…; retrying'),
                'set-point … ignored: it is not a finite number',  # given by a caller
                'parameter … was given to …, but there is none of',  # yielded by a function
                'error in the driver: …',  # assigned before
            ),
        ),
        (
            lambda: code().raised(),
            (
                '… does not exist: … Ports found: …',
                'port is empty: name a device, such as /dev/ttyUSB0',
                # a constant
                'the drive lets no one take control now (MODE is Inhibit: tuning?)',
            ),
        ),
        (lambda: code().answered(), ('the bus did not get to it',)),
    ],
    ids=['causes', 'logged', 'exceptions', 'answers'],
)
def test_every_message_has_an_entry(
    read: Callable[[], Iterator[Sentence]], known: tuple[str, ...]
) -> None:
    found = list(read())
    said = {'…'.join(one.parts) for one in found}
    assert [one for one in known if not any(one in sentence for sentence in said)] == []
    assert missing(found, PAGE_TEXT) == []


def test_every_refusal_of_a_drive_has_an_entry() -> None:
    assert missing([REFUSED], PAGE_TEXT) == []
    known = [one for one in REFUSALS if not one.parts[0].startswith('the drive refused')]
    assert len(known) > 5
    assert missing(known, PAGE_TEXT) == []


def test_every_entry_is_still_said_and_stands_once() -> None:
    said = [*code().texts(), *REFUSALS, REFUSED]
    said += [of_template(cause.name, text) for cause, text in SENTENCES.items()]
    # a few words with values around them would stand for anything
    telling = [one for one in said if one.has_words and len(''.join(one.parts)) > 4]
    found = entries(PAGE_TEXT)
    assert [entry for entry in found if not any(one.is_in(entry) for one in telling)] == []
    assert [entry for entry in found if found.count(entry) > 1] == []


def test_exceptions_are_needed_and_right() -> None:
    graver = {
        mention.attr for _, node in code().nodes() if refuses(node) for mention in causes_in(node)
    }
    assert {'CANNOT_STOP', 'NOT_CONNECTED'} <= graver
    assert not {cause.name for cause in SUCCESSES} & graver
    assert not SUCCESSES & only_informing(code()), 'these are left out anyway'
    with_values = {
        name
        for path, node in code().nodes()
        if isinstance(node, ast.Call) and name_of(node.func) == 'ValueError'
        for name in (path, f'{path}:{getattr(code().function_around(node), "name", "")}')
    }
    assert not NEVER_SHOWN.keys() - with_values


def test_what_is_logged_is_found() -> None:
    for source, said in (
        ("log.error('it broke')", 'it broke'),
        ("self.get_logger().warning(f'{a} broke: {b!r}')", '… broke: …'),
        ("def f():\n    why = 'one' if x else f'two {y}'\n    log.error(why)", 'two …'),
        ("def f(why):\n    log.error(why)\n\nf('given')", 'given'),
        ("def g():\n    yield 'made'\n\nfor a in (*g(),):\n    log.error(a)", 'made'),
        ("context.log(self._log.warning, f'later {a}')", 'later …'),
        ("WHY = 'a constant'\n\ndef f():\n    log.fatal(WHY)", 'a constant'),
    ):
        found = ['…'.join(one.parts) for one in Code({'node/x.py': source}).logged()]
        assert said in found, source


def test_what_has_no_entry_is_found_and_what_only_informs_is_distinguished() -> None:
    page = '| message | why |\n|---|---|\n| `the motor … broke: 5` | `it` wore out |\n'
    asked = [
        Sentence('a', ('the motor ', ' broke: ', '')),
        Sentence('b', ('it',)),
        Sentence('c', ('the motor ', ' broke')),
        Sentence('d', ('', ': ', '')),
    ]
    assert missing(asked, page) == ['b: it', 'c: the motor … broke']
    assert of_template('x', 'no {{ {a:g} s').parts == ('no { ', ' s')
    source = (
        'notify(Severity.INFO, Cause.CONNECTED)\n'
        'notify(Severity.INFO, Cause.LOST)\nnotify(Severity.ERROR, Cause.LOST)\n'
        'def f():\n    yield Severity.INFO, report(Cause.ASLEEP)\n    return Report(Cause.FAULT)\n'
    )
    assert only_informing(Code({'x.py': source})) == {Cause.CONNECTED, Cause.ASLEEP}
