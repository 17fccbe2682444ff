# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The rules of the house: who may import whom, who opens ports, how long a file may be."""

from __future__ import annotations

import ast
from collections.abc import Iterator
import functools
from pathlib import Path
import re
import subprocess
import sys

import pytest

from nfo_sinus_driver.catalog import families
from nfo_sinus_driver.catalog import load_family

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = 'nfo_sinus_driver'

#: Which rooms each room may import, itself apart.
MAY_IMPORT = {
    '': set(),
    'catalog': set(),
    # what a profile is made of; the catalog finds it by its name
    'families': {'catalog'},
    'link': set(),
    'bus': {'link'},
    'launch_arguments': set(),
    'signals': set(),
    'version': set(),
    # what it shows comes to it
    'view': set(),
    'drive': {'bus', 'catalog', 'link'},
    # of drive/ only events.py, which has no code
    'wording': {'catalog', 'drive'},
    # its folder of a family, the words of that one, and no profile: a mistake in that must not hide
    'simulator': {'catalog', 'families', 'version'},
    'node': {'bus', 'catalog', 'drive', 'link', 'signals', 'version', 'view', 'wording'},
    'demo': {'node', 'version'},
    'cli': {'bus', 'catalog', 'drive', 'link', 'signals', 'version', 'view', 'wording'},
}
#: Rooms that may import ROS, and anything else.
WITH_ROS = {'demo', 'node'}
#: What the others may import beside the standard library.
MAY_USE = {
    'cli': {'tqdm', 'yaml'},
    'link': {'serial'},
    'simulator': {'pymodbus'},
    'view': {'rich', 'textual'},
}
#: What opens by number, and nothing but /dev/null.
OPENS_NO_PORT = frozenset({'node/nonblocking_stdio.py'})
#: Rooms that are about families and name them.
NAMES_FAMILIES = {'families', 'simulator'}
#: Rooms in which serial ports are opened.
OPENS_PORTS = {'link', 'simulator'}
PORT_MODULES = {'serial', 'termios', 'pty', 'tty', 'fcntl'}
PORT_CALLS = {'open', 'openpty', 'posix_openpt', 'ptsname'}

#: What names a family in a file that is to know none: in an import, an identifier, a text.
FAMILY = re.compile(
    '|'.join([*families(), r'sinus_', r'simulator\.sinus\b', r'(?<![a-z0-9])g2', 'optimal']),
    re.IGNORECASE,
)
MOST_LINES = 600
#: Files that have been allowed to be longer, and how long: to be split, never to grow.
LONGER: dict[str, int] = {}

LICENCE = re.compile(
    r'(#!.*\n)?# Copyright 20\d\d The nfo_sinus_driver authors\n'
    + re.escape(
        """\
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""
    )
)


def room_of(path: str) -> str:
    """The room of a file, by its path below the package."""
    first = path.split('/', 1)[0].removesuffix('.py')
    return '' if first == '__init__' else first


def imports_of(tree: ast.Module, path: str) -> Iterator[str]:
    """Everything that a module imports, by full name; names from a package as its modules."""
    here = [PACKAGE, *path.split('/')[:-1]]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = here[: len(here) + 1 - node.level] if node.level else []
            module = '.'.join([*above, *([node.module] if node.module else [])])
            yield from (f'{module}.{alias.name}' for alias in node.names)
        elif isinstance(node, ast.Call) and node.args:
            name = node.func.attr if isinstance(node.func, ast.Attribute) else ''
            name = node.func.id if isinstance(node.func, ast.Name) else name
            what = node.args[0]
            if name in ('import_module', '__import__') and isinstance(what, ast.Constant):
                yield str(what.value)


def opens_ports(tree: ast.Module) -> Iterator[str]:
    """What a module calls to open a port by its descriptor."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in PORT_CALLS:
            if isinstance(node.value, ast.Name) and node.value.id == 'os':
                yield f'os.{node.attr}'
        elif isinstance(node, ast.ImportFrom) and node.module == 'os':
            yield from (f'os.{alias.name}' for alias in node.names if alias.name in PORT_CALLS)


@functools.cache
def family_names() -> re.Pattern[str]:
    """Find the names of families and of their parameters."""
    found = {*families(), *(key for name in families() for key in load_family(name))}
    groups = '|'.join(sorted({key.partition('.')[0] for key in found if '.' in key}))
    names = '|'.join(map(re.escape, sorted(found, key=len, reverse=True)))
    return re.compile(rf'(?<![\w.])(?:{names})(?!\w)|^(?:{groups})\.$')


def named(tree: ast.Module) -> set[str]:
    """The families and parameters that a module names, but for what it says in docstrings."""
    bodies = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    first = [node.body[0] for node in ast.walk(tree) if isinstance(node, bodies) and node.body]
    docstrings = {id(one.value) for one in first if isinstance(one, ast.Expr)}
    texts = [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if id(node) not in docstrings
    ]
    return {name for text in texts for name in family_names().findall(text)}


def violations(path: str, source: str) -> list[str]:
    """What is wrong with a file of the package; ``path`` is its path below the package."""
    tree = ast.parse(source)
    room = room_of(path)
    if room not in MAY_IMPORT:
        return [f'{room} is no room of the house']
    found = []
    for name in imports_of(tree, path):
        top, _, rest = name.partition('.')
        if top == PACKAGE:
            other = rest.split('.')[0]
            unseen = room == 'simulator' and 'profile' in rest.split('.')
            if unseen or (other != room and other not in MAY_IMPORT[room]):
                found.append(f'{room or "the package"} imports {name}')
            continue
        if top in PORT_MODULES and room not in OPENS_PORTS:
            found.append(f'{room} opens ports with {top}')
        known = top in sys.stdlib_module_names or top in MAY_USE.get(room, ())
        if room not in WITH_ROS and not known:
            found.append(f'{room} imports {name}')
    if room not in OPENS_PORTS and path not in OPENS_NO_PORT:
        found += [f'{room} opens ports with {call}' for call in opens_ports(tree)]
    general = room == 'simulator' and path.count('/') == 1
    if general or room not in NAMES_FAMILIES:
        found += [f'{room} names {name}' for name in sorted(named(tree))]
    if general:
        words = FAMILY.findall(source.replace(PACKAGE, ''))
        found += [f'{room} knows {word}' for word in words]
    elif room == 'simulator':
        others = [name for name in families() if name != path.split('/')[1]]
        found += [f'{path} imports {name}' for name in others if f'simulator.{name}' in source]
    lines = source.count('\n')
    if lines > LONGER.get(path, MOST_LINES):
        found.append(f'{lines} lines are too many')
    return found


#: What changes a list, a dict or a set.
CHANGES = frozenset(
    (
        *('add', 'append', 'appendleft', 'clear', 'discard', 'extend', 'insert', 'pop', 'popitem'),
        *('popleft', 'remove', 'setdefault', 'sort', 'update'),
    )
)


def foreign_writes(tree: ast.Module) -> Iterator[str]:
    """What a module changes of the fields of objects that are not its own."""
    for node in ast.walk(tree):
        field: ast.AST | None = None
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, (ast.Store, ast.Del)):
            field = node
        elif isinstance(node, ast.Subscript) and isinstance(node.ctx, (ast.Store, ast.Del)):
            field = node.value
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            field = node.func.value if node.func.attr in CHANGES else None
        if not isinstance(field, ast.Attribute):
            continue
        own = isinstance(field.value, ast.Name) and field.value.id in ('self', 'cls')
        # why an error came is one that was made here
        if not own and field.attr != '__cause__':
            yield ast.unparse(field)


def circles(sources: dict[str, str]) -> set[frozenset[str]]:
    """
    Groups of files that import each other, directly or through others, for types alone or not.

    :param sources: of all files of the package, by their paths below it.
    """
    files = {path.removesuffix('.py').removesuffix('/__init__'): path for path in sources}
    imports = {
        path: {file_of(name, files) for name in imports_of(ast.parse(source), path)} - {path}
        for path, source in sources.items()
    }
    reached = {path: reachable(path, imports) for path in imports}
    return {
        frozenset(other for other in others if path in reached.get(other, ()))
        for path, others in reached.items()
        if path in others
    }


def file_of(name: str, files: dict[str, str]) -> str:
    """The file that an import is answered by, if it is one of ours."""
    top, _, rest = name.partition('.')
    below = rest.replace('.', '/') if top == PACKAGE else ''
    # what is imported from a file is not one itself
    return files.get(below) or files.get(below.rpartition('/')[0], '')


def reachable(start: str, imports: dict[str, set[str]]) -> set[str]:
    """All that is imported from a file on."""
    found: set[str] = set()
    waiting = [start]
    while waiting:
        new = imports.get(waiting.pop(), set()) - found
        found |= new
        waiting += new
    return found


def package_files() -> list[str]:
    """Every Python file of the package, by its path below it."""
    package = ROOT / PACKAGE
    return sorted(path.relative_to(package).as_posix() for path in package.rglob('*.py'))


def package_sources() -> dict[str, str]:
    """What stands in each of them."""
    return {path: (ROOT / PACKAGE / path).read_text(encoding='utf-8') for path in package_files()}


def own_files() -> list[str]:
    """Every Python file of the project, by its path; nothing that was built or installed."""
    folders = (PACKAGE, 'test', 'benchmark', 'examples', 'launch', 'tools', 'docs', 'msg_defs')
    found = [path for folder in folders for path in (ROOT / folder).rglob('*.py')]
    return sorted(path.relative_to(ROOT).as_posix() for path in [*found, *ROOT.glob('*.py')])


def test_every_file_keeps_the_rules_of_the_house() -> None:
    found = {path: violations(path, source) for path, source in package_sources().items()}
    assert {path: rules for path, rules in found.items() if rules} == {}


def test_nobody_writes_the_fields_of_another_object() -> None:
    found = {
        path: list(foreign_writes(ast.parse(source)))
        for path, source in package_sources().items()
        if room_of(path) in ('bus', 'drive')
    }
    assert {path: fields for path, fields in found.items() if fields} == {}


@pytest.mark.parametrize(
    ('source', 'fields'),
    [
        ('self.a = cls.b = c = 1', []),
        ('self.a.b = 1', ['self.a.b']),
        ('for task.asleep in x: other.count += 1', ['task.asleep', 'other.count']),
        ('with x as self.a, y as b.c: pass', ['b.c']),
        ('error.__cause__ = error', []),
        ('self.a[0] = a[0] = a.append(1)', []),
        ('del self.a.b[0]; a.b[0] = 1', ['self.a.b', 'a.b']),
        ('self.a.clear(); self.a.b.append(1); a.b.get(1)', ['self.a.b']),
    ],
)
def test_written_fields_of_others_are_found(source: str, fields: list[str]) -> None:
    assert sorted(foreign_writes(ast.parse(source))) == sorted(fields)


def test_every_room_is_looked_at() -> None:
    rooms = {room_of(path) for path in package_files()}
    known = {'bus', 'catalog', 'cli', 'demo', 'drive', 'families', 'link', 'node', 'simulator'}
    assert known <= rooms <= set(MAY_IMPORT)


def test_no_files_import_each_other_in_a_circle() -> None:
    assert circles(package_sources()) == set()


@pytest.mark.parametrize('path', sorted(LONGER))
def test_longer_file_is_still_longer(path: str) -> None:
    # once it is short enough, its exception has to go
    lines = (ROOT / PACKAGE / path).read_text(encoding='utf-8').count('\n')
    assert lines > MOST_LINES, f'{path} has {lines} lines: take it out of LONGER'


def test_every_file_has_the_licence_header() -> None:
    without = [
        path
        for path in own_files()
        if not LICENCE.match((ROOT / path).read_text(encoding='utf-8'))
    ]
    assert without == []


def test_rooms_without_ros_load_without_ros() -> None:
    modules = [
        '.'.join([PACKAGE, *path.removesuffix('.py').removesuffix('/__init__').split('/')])
        for path in package_files()
        if room_of(path) not in {*WITH_ROS, ''}
    ]
    program = f"""
import importlib, sys

class NoRos:
    def find_spec(self, name, path=None, target=None):
        top = name.split('.')[0]
        if top.startswith(('rcl', 'ros', 'rosidl')) or top.endswith(('_msgs', '_srvs', '_msg')):
            raise ImportError(f'{{name}} is ROS')

sys.meta_path.insert(0, NoRos())
try:
    import rclpy
except ImportError:
    pass
else:
    sys.exit('ROS was not kept out')
for module in {modules!r}:
    importlib.import_module(module)
"""
    done = subprocess.run(
        [sys.executable, '-c', program], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


# --- the checker itself ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('path', 'source', 'complaint'),
    [
        ('bus.py', 'import rclpy', 'bus imports rclpy'),
        ('drive/drive.py', 'from std_msgs.msg import Float32', 'drive imports std_msgs'),
        ('drive/drive.py', 'from nfo_sinus_msgs import msg', 'drive imports nfo_sinus_msgs'),
        ('simulator/main.py', 'import rclpy.node', 'simulator imports rclpy.node'),
        ('simulator/main.py', 'from nfo_sinus_driver.link import rtu', 'simulator imports'),
        ('simulator/main.py', 'from nfo_sinus_driver import drive', 'simulator imports'),
        (
            'simulator/drive.py',
            'from nfo_sinus_driver.families.sinus_g2.profile import PROFILE',
            'simulator imports',
        ),
        ('simulator/main.py', 'from ..link import rtu', 'simulator imports'),
        ('simulator/main.py', 'def f():\n    import nfo_sinus_driver.bus', 'simulator imports'),
        ('simulator/main.py', 'import_module("nfo_sinus_driver.link")', 'simulator imports'),
        ('link/rtu.py', 'from nfo_sinus_driver.catalog import Fact', 'link imports'),
        ('catalog/family.py', 'from nfo_sinus_driver.families import sinus_g2', 'catalog imports'),
        ('node/main.py', 'from nfo_sinus_driver.families import sinus_g2', 'node imports'),
        ('link/rtu.py', 'import nfo_sinus_driver.drive as d', 'link imports'),
        ('link/rtu.py', 'from pymodbus import client', 'link imports pymodbus'),
        ('bus.py', 'from nfo_sinus_driver.drive import Drive', 'bus imports'),
        ('bus.py', 'from nfo_sinus_driver.catalog import Fact', 'bus imports'),
        ('drive/drive.py', 'from nfo_sinus_driver.node import main', 'drive imports'),
        ('drive/drive.py', 'from nfo_sinus_driver.simulator import drive', 'drive imports'),
        ('catalog/family.py', 'from nfo_sinus_driver.link import Address', 'catalog imports'),
        ('node/main.py', 'from nfo_sinus_driver.simulator import main', 'node imports'),
        ('node/main.py', 'from nfo_sinus_driver.demo import domain', 'node imports'),
        ('demo/bench.py', 'from nfo_sinus_driver.simulator import main', 'demo imports'),
        ('cli/main.py', 'import rclpy', 'cli imports rclpy'),
        ('cli/scan.py', 'from nfo_sinus_driver.simulator import drive', 'cli imports'),
        ('drive/drive.py', 'from nfo_sinus_driver.cli import main', 'drive imports'),
        ('__init__.py', 'from nfo_sinus_driver import bus', 'the package imports'),
        ('drive/drive.py', 'import numpy', 'drive imports numpy'),
        ('drive/drive.py', 'import serial', 'drive opens ports with serial'),
        ('node/qos.py', 'from serial.tools import list_ports', 'node opens ports with serial'),
        ('node/qos.py', 'import termios', 'node opens ports with termios'),
        ('bus.py', 'import pty', 'bus opens ports with pty'),
        ('bus.py', 'import os\nos.open("/dev/ttyUSB0", os.O_RDWR)', 'bus opens ports with os.open'),
        ('node/qos.py', 'from os import open as o', 'node opens ports with os.open'),
        ('drive/drive.py', 'from nfo_sinus_driver.families import sinus_g2', 'drive imports'),
        ('drive/drive.py', 'key = "motor.p_nom"', 'drive names motor.p_nom'),
        ('drive/drive.py', 'say(f"{it} in error.rst_dly: {text}")', 'drive names error.rst_dly'),
        ('drive/drive.py', 'key.startswith("serial.")', 'drive names serial.'),
        ('node/main.py', 'if model == "sinus_optimal": pass', 'node names sinus_optimal'),
        ('link/rtu.py', 'MODE = "fieldbus.mode"', 'link names fieldbus.mode'),
        ('drive/drive.py', '\n' * 601, '601 lines are too many'),
        ('simulator/drive.py', "model = 'sinus_g2'", 'simulator knows sinus_g2'),
        ('simulator/drive.py', 'class OptimalUnit: ...', 'simulator knows Optimal'),
        ('simulator/drive.py', 'def g2_only(): ...', 'simulator knows g2'),
        (
            'simulator/drive.py',
            'from nfo_sinus_driver.simulator.sinus import variant',
            'simulator knows simulator.sinus',
        ),
        (
            'simulator/sinus_g2/family.py',
            'from nfo_sinus_driver.simulator.sinus_optimal import family',
            'simulator/sinus_g2/family.py imports sinus_optimal',
        ),
        ('simulator/drive.py', "key == 'fieldbus.mode'", 'simulator names fieldbus.mode'),
        ('shed/tools.py', '', 'shed is no room of the house'),
    ],
)
def test_checker_sees(path: str, source: str, complaint: str) -> None:
    assert any(found.startswith(complaint) for found in violations(path, source))


@pytest.mark.parametrize(
    ('path', 'source'),
    [
        ('node/main.py', 'import rclpy\nfrom nfo_sinus_driver.drive import Drive'),
        ('link/serial_port.py', 'import os, termios, serial\nos.open("/dev/ttyUSB0", 0)'),
        ('simulator/ports.py', 'import os, pty\nos.openpty()'),
        ('simulator/modbus.py', 'from pymodbus import pdu\nfrom . import drive'),
        ('drive/drive.py', 'from nfo_sinus_driver.bus import Bus\nfrom .errors import DriveError'),
        ('catalog/family.py', 'import csv\nopen("table.csv")\nos.path.open'),
        ('drive/drive.py', '"""Such as motor.p_nom of a sinus_g2."""\nlog = "motor.log"'),
        ('families/sinus_g2/profile.py', 'MODE = "fieldbus.mode"'),
        ('drive/drive.py', '\n' * 600),
        ('simulator/drive.py', 'from nfo_sinus_driver.families import USUAL'),
        ('simulator/sinus_g2/control_unit.py', "class G2:\n    key = 'fieldbus.mode'"),
    ],
)
def test_checker_lets_pass(path: str, source: str) -> None:
    assert violations(path, source) == []


@pytest.mark.parametrize(
    ('sources', 'circle'),
    [
        (
            {
                'drive/a.py': 'from nfo_sinus_driver.drive import b',
                'drive/b.py': 'from nfo_sinus_driver.drive.c import C',
                'drive/c.py': 'if TYPE_CHECKING:\n    from nfo_sinus_driver.drive.a import A',
                'drive/d.py': 'from nfo_sinus_driver.drive import a',
            },
            {'drive/a.py', 'drive/b.py', 'drive/c.py'},
        ),
        (
            {
                'drive/__init__.py': 'from nfo_sinus_driver.drive.a import A',
                'drive/a.py': 'def f():\n    from nfo_sinus_driver.drive import A',
            },
            {'drive/__init__.py', 'drive/a.py'},
        ),
        (
            {'drive/a.py': 'from . import b', 'drive/b.py': 'from .a import A'},
            {'drive/a.py', 'drive/b.py'},
        ),
    ],
)
def test_checker_sees_a_circle(sources: dict[str, str], circle: set[str]) -> None:
    assert circles(sources) == {frozenset(circle)}


def test_checker_sees_no_circle_where_one_does_not_come_back() -> None:
    sources = {
        'drive/__init__.py': 'from nfo_sinus_driver.drive.a import A',
        'drive/a.py': 'import os\nfrom nfo_sinus_driver.drive.b import B',
        'drive/b.py': 'import nfo_sinus_driver.bus',
        'bus.py': 'from drive import a',
    }
    assert circles(sources) == set()


def test_checker_knows_the_licence() -> None:
    text = (ROOT / PACKAGE / '__init__.py').read_text(encoding='utf-8')
    assert LICENCE.match(text)
    assert LICENCE.match('#!/usr/bin/env python3\n' + text)
    assert not LICENCE.match('"""No licence."""\n' + text)
    assert not LICENCE.match(text.replace('Version 2.0', 'Version 1.0'))
    assert not LICENCE.match('')
