# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the contracts of import-linter and the rules of ruff in pyproject.toml cannot say."""

from __future__ import annotations

import ast
from collections.abc import Iterator
import functools
from pathlib import Path
import re

import pytest
from support.places import MSG_DEFS, ROOT

from nfo_sinus_driver.catalog import families, load_family

PACKAGE = ROOT / 'nfo_sinus_driver'
#: The source of every file of the package, by its path below it.
SOURCES = {
    path.relative_to(PACKAGE).as_posix(): path.read_text(encoding='utf-8')
    for path in sorted(PACKAGE.rglob('*.py'))
}
#: Where the clock is passed in; only what waits for the operating system asks for it.
WITHOUT_TIME = re.compile(r'(bus|drive)/|link/(?!canopen/can\.py|ports/)')
#: What is about families and names them: the files of a family.
OF_FAMILIES = re.compile(r'families/|simulator/\w+/')
#: What changes a list, a dict or a set.
CHANGES = {
    *('add', 'append', 'appendleft', 'clear', 'discard', 'extend', 'insert', 'pop', 'popitem'),
    *('popleft', 'remove', 'setdefault', 'sort', 'update'),
}
#: What has a bus write something, or what has an effect; and who may use it: they ask before
#: whether the drive was recognised.
SENDS = {'Ask', 'ReadThenWrite', 'Write', 'WriteAndRead', 'Written'}
GATES = ['drive/broadcast.py', 'drive/known/parameter_access.py', 'drive/motion/setpoint.py']

LICENCE = re.compile(
    r'(#!.*\n)?(#|//|\(\*) Copyright 20\d\d The nfo_sinus_driver authors((?: \*\))?)\n'
    r'\2 SPDX-License-Identifier: Apache-2\.0\3\n'
)


@functools.cache
def family_names() -> re.Pattern[str]:
    """Find the names of families and of their parameters."""
    found = {*families(), *(key for name in families() for key in load_family(name))}
    groups = '|'.join(sorted({key.partition('.')[0] for key in found if '.' in key}))
    names = '|'.join(map(re.escape, sorted(found, key=len, reverse=True)))
    return re.compile(rf'(?<![\w.])(?:{names})(?!\w)|^(?:{groups})\.$')


def violations(path: str, source: str) -> Iterator[str]:
    """Yield what is wrong with a file of the package; ``path`` is its path below the package."""
    folder = (PACKAGE / path).parent
    package = '.'.join(folder.relative_to(ROOT).parts)
    nodes = list(ast.walk(ast.parse(source)))
    docstrings = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.module == package:
            files = {file.stem for file in folder.iterdir()}
            own = [alias.name for alias in node.names if alias.name not in files]
            yield from (f'imports {name} of its own package, a circle' for name in own)
        elif isinstance(node, ast.Call) and WITHOUT_TIME.match(path):
            if ast.unparse(node.func).startswith('time.'):
                yield 'asks for the time: use the clock given'
        elif isinstance(node, ast.Constant) and not OF_FAMILIES.match(path):
            text = '' if id(node) in docstrings else str(node.value)
            yield from (f'names {name}' for name in family_names().findall(text))
    if re.fullmatch(r'simulator/\w+\.py', path):
        found = re.findall(r'(?i)(?<!nfo_)sinus_|(?<![a-z0-9])g2|optimal|movitrac31', source)
        yield from (f'knows {word}' for word in found)


def sends(path: str, source: str) -> bool:
    """Whether a module has a bus write something, or set up its watch."""
    found = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom)]
    names = {
        alias.name
        for node in found
        if (node.module or '').startswith('nfo_sinus_driver.link')
        for alias in node.names
    }
    sending = SENDS & names or 'bus.watch(' in source
    return bool(sending) and not path.startswith(('bus/', 'link/', 'simulator/'))


def foreign_writes(source: str) -> Iterator[str]:
    """What a module changes of the fields of objects that are not its own."""
    for node in ast.walk(ast.parse(source)):
        field: ast.AST | None = None
        if isinstance(node, (ast.Attribute, ast.Subscript)):
            if isinstance(node.ctx, (ast.Store, ast.Del)):
                field = node if isinstance(node, ast.Attribute) else node.value
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            field = node.func.value if node.func.attr in CHANGES else None
        if not isinstance(field, ast.Attribute):
            continue
        own = isinstance(field.value, ast.Name) and field.value.id in ('self', 'cls')
        # why an error came is one that was made here
        if not own and field.attr != '__cause__':
            yield ast.unparse(field)


def own_files() -> Iterator[Path]:
    """Every source file of the project; nothing that was built or installed."""
    folders = ('nfo_sinus_driver', 'test', 'benchmark', 'config', 'examples', 'launch', 'docs')
    for folder in (*(ROOT / name for name in folders), MSG_DEFS):
        for end in ('*.py', '*.cpp', 'CMakeLists.txt', '*.msg', '*.srv', '*.action', '*.st'):
            yield from folder.rglob(end)
    for pattern in ('*.py', 'tools/*', '.ci/*'):
        yield from (path for path in ROOT.glob(pattern) if path.is_file())


def test_every_file_keeps_the_rules_of_the_house() -> None:
    found = {path: list(violations(path, source)) for path, source in SOURCES.items()}
    assert {path: rules for path, rules in found.items() if rules} == {}


def test_no_object_writes_the_fields_of_another() -> None:
    found = {
        path: list(foreign_writes(source))
        for path, source in SOURCES.items()
        if path.startswith(('bus/', 'drive/'))
    }
    assert {path: fields for path, fields in found.items() if fields} == {}
    # what changes one is found, and nothing else
    source = 'del self.a.b[0]; a.b[0] = 1; c.d.clear(); e.f, self.g = 1, a.get(h[0])'
    assert sorted(foreign_writes(source)) == ['a.b', 'c.d', 'e.f', 'self.a.b']


def test_all_that_is_written_to_a_drive_passes_one_gate() -> None:
    assert [path for path, source in SOURCES.items() if sends(path, source)] == GATES


def test_every_file_has_the_licence_header() -> None:
    found = {path: path.read_text(encoding='utf-8') for path in own_files()}
    assert {path.suffix for path in found} >= {'.py', '.cpp', '.msg', '.srv', '.action', '.st', ''}
    assert [path for path, text in found.items() if not LICENCE.match(text)] == []


@pytest.mark.parametrize(
    ('path', 'source', 'complaint'),
    [
        ('drive/drive.py', 'import time\ntime.monotonic()', 'asks for the time'),
        ('drive/drive.py', 'say(f"{it} in error.rst_dly: {text}")', 'names error.rst_dly'),
        ('drive/drive.py', 'key.startswith("serial.")', 'names serial.'),
        ('drive/drive.py', 'from nfo_sinus_driver.drive import Drive', 'imports Drive of'),
        ('simulator/drive.py', 'class OptimalUnit: ...', 'knows Optimal'),
    ],
)
def test_what_breaks_a_rule_is_found(path: str, source: str, complaint: str) -> None:
    (found,) = violations(path, source)
    assert found.startswith(complaint)
