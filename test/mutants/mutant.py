# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a broken copy is, where it is broken, and the tests that notice."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
import functools
import itertools
from pathlib import Path
import re

WAYS_OUT = 'test_every_end_stops_the_motor.py'
NO_RESTART = 'test_no_restart.py'
INTERFACE = 'test_interface.py'
TRACE = 'test_trace.py'
LINE = 'test_line.py'
MODBUS_LINE = 'test_modbus_line.py'

TUNING = 'test_tuning.py'
ANY_ORDER = 'test_any_order.py'
EVERY_STEP = 'test_every_step_of_a_stop.py'
LAW_2 = ('test_laws.py', '-k', 'rtu and test_2 and stop')
STOPPED_IS_TRUE = 'test_stopped_is_true.py'
STOP_CONFIRMED = ('test_stop_is_confirmed.py',)
RECOGNITION = 'test_recognition.py'
LEFTOVER = 'test_leftover_run_command.py'
CONTROL_TAKEN = ('test_control_is_taken.py',)
GUARDS = ('test_control_table.py', '-k', 'nothing_begins')
TUNING_BEGINS = (TUNING, '-k', 'any_moment')
TERMINALS_KEEP = ('test_drive_commands.py', '-k', 'terminals_keep')
NO_STOP_FORGOTTEN = ('test_no_stop_is_forgotten.py',)
NO_TURN = ('test_no_turn_at_acknowledge.py',)
G2_SCMD = (ANY_ORDER, '-k', 'G2ModeScmd')
G2_CONTROL = (ANY_ORDER, '-k', 'G2DriveControl')
OPTIMAL_SCMD = (ANY_ORDER, '-k', 'OptimalModeScmd')


@dataclass(frozen=True)
class Mutant:
    """
    One broken copy.

    :ivar law: the number of the law in docs/architecture.md that it breaks.
    :ivar where: the definition that is broken, such as ``Bus.step``, in whatever file; with its
        module in front, ``snapshot.NAN``, where several say the same; or a file that is no code.
    :ivar old: what stands there.
    :ivar tests: what has to fail, as arguments of pytest; a test file by its name.
    :ivar also: what else is broken, where one thing keeps the law without the other: where, what
        stands there, what in its place.
    """

    law: int
    what: str
    where: str
    old: str
    new: str
    tests: tuple[str, ...]
    also: tuple[tuple[str, str, str], ...] = ()

    def __str__(self) -> str:
        return f'law {self.law}: {self.what}'

    def changes(self, root: Path) -> Iterator[tuple[Path, str]]:
        """
        Yield the files that it changes in a project, and what they say then.

        :raises ValueError: what is broken stands there no more, or in several places.
        """
        edits: dict[Path, list[tuple[int, str, str]]] = {}
        for where, old, new in ((self.where, self.old, self.new), *self.also):
            file, begin, end = _found(root, where, old)
            places = re.finditer(re.escape(old), _text(file, begin, end))
            edits.setdefault(file, []).extend((begin + place.start(), old, new) for place in places)
        for file, changes in edits.items():
            text = file.read_text(encoding='utf-8')
            for at, old, new in sorted(changes, reverse=True):
                text = text[:at] + new + text[at + len(old) :]
            yield file, text

    def arguments(self, root: Path) -> list[str]:
        """
        Return its tests as arguments of pytest.

        :raises ValueError: there is no such test file, or several of that name.
        """
        return [_test_file(root, test) if test.endswith('.py') else test for test in self.tests]


def _test_file(root: Path, name: str) -> str:
    files = list((root / 'test').rglob(name))
    if len(files) != 1:
        raise ValueError(f'{len(files)} test files are named {name}')
    return str(files[0].relative_to(root))


def _found(root: Path, where: str, old: str) -> tuple[Path, int, int]:
    """Return the file of a definition, and where in its text that is."""
    if (root / where).is_file():
        return root / where, 0, len((root / where).read_text(encoding='utf-8'))
    found = [place for place in _index(root).get(where, ()) if old in _text(*place)]
    if len(found) != 1:
        raise ValueError(f'{len(found)} definitions {where} say: {old!r}')
    return found[0]


def _text(file: Path, begin: int, end: int) -> str:
    return file.read_text(encoding='utf-8')[begin:end]


@functools.cache
def _index(root: Path) -> dict[str, list[tuple[Path, int, int]]]:
    """Return where each definition of the driver is, by its name, with its module and without."""
    index: dict[str, list[tuple[Path, int, int]]] = {}
    for file in sorted((root / 'nfo_sinus_driver').rglob('*.py')):
        text = file.read_text(encoding='utf-8')
        begins = [0, *itertools.accumulate(map(len, text.splitlines(keepends=True)))]
        for name, first, last in _definitions(ast.parse(text), ''):
            place = file, begins[first - 1], begins[last]
            for known in (name, f'{file.stem}.{name}'):
                index.setdefault(known, []).append(place)
    return index


def _definitions(node: ast.AST, within: str) -> Iterator[tuple[str, int, int]]:
    """Yield the names of what is defined, and the first and the last line of each."""
    for child in ast.iter_child_nodes(node):
        names: list[str] = []
        first = getattr(child, 'lineno', 1)
        if isinstance(child, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            names = [child.name]
            first = min([first, *(decorator.lineno for decorator in child.decorator_list)])
        elif isinstance(child, (ast.Assign, ast.AnnAssign)):
            targets = child.targets if isinstance(child, ast.Assign) else [child.target]
            names = [target.id for target in targets if isinstance(target, ast.Name)]
        for name in names:
            yield f'{within}{name}', first, child.end_lineno or first
        if isinstance(child, ast.ClassDef):
            yield from _definitions(child, f'{within}{child.name}.')
