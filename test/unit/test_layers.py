# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the contracts of import-linter in pyproject.toml cannot say of the house."""

from __future__ import annotations

import ast
from collections.abc import Iterator
import functools
import graphlib
from pathlib import Path
import re
import subprocess
import sys

from support.places import MSG_DEFS, ROOT

from nfo_sinus_driver.catalog import families, load_family

PACKAGE = 'nfo_sinus_driver'

#: Rooms that may import ROS, and anything else.
WITH_ROS = {'demo', 'node'}
#: What the others may import beside the standard library.
MAY_USE = {
    'catalog': {'yaml'},
    'cli': {'argcomplete', 'tqdm', 'yaml'},
    'link': {'serial'},
    'simulator': {'pymodbus'},
    'view': {'rich', 'textual'},
}
#: What opens by number, and nothing but /dev/null; what opens and locks files.
OPENS_NO_PORT = frozenset({'node/nonblocking_stdio.py', 'state_folder.py'})
#: Rooms that are about families and name them.
NAMES_FAMILIES = {'families', 'simulator'}
#: Rooms in which serial ports are opened.
OPENS_PORTS = {'link', 'simulator'}
PORT_MODULES = {'serial', 'termios', 'pty', 'tty', 'fcntl'}
PORT_CALLS = {'open', 'openpty', 'posix_openpt', 'ptsname'}
#: Rooms in which the clock is passed in; only what waits for the operating system asks for it.
WITHOUT_TIME = {'bus', 'drive', 'link'}
ASKS_FOR_TIME = frozenset(
    f'link/{name}.py' for name in ('serial_port', 'can', 'tcp_connection', 'url_port')
)

#: What names a family in a file that is to know none: in an import, an identifier, a text.
FAMILY = re.compile(
    '|'.join([*families(), r'sinus_', r'simulator\.sinus\b', r'(?<![a-z0-9])g2', 'optimal']),
    re.IGNORECASE,
)

LICENCE = re.compile(
    r'(#!.*\n)?(#|//|\(\*) Copyright 20\d\d The nfo_sinus_driver authors((?: \*\))?)\n'
    r'\2 SPDX-License-Identifier: Apache-2\.0\3\n'
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
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    texts = [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if id(node) not in docstrings
    ]
    return {name for text in texts for name in family_names().findall(text)}


def violations(path: str, source: str) -> Iterator[str]:
    """Yield what is wrong with a file of the package; ``path`` is its path below the package."""
    tree = ast.parse(source)
    room = room_of(path)
    for name in imports_of(tree, path):
        top = name.partition('.')[0]
        if top in PORT_MODULES and room not in OPENS_PORTS and path not in OPENS_NO_PORT:
            yield f'{room} opens ports with {top}'
        known = {PACKAGE, *sys.stdlib_module_names, *MAY_USE.get(room, ())}
        if room not in WITH_ROS and top not in known:
            yield f'{room} imports {name}'
    if room not in OPENS_PORTS and path not in OPENS_NO_PORT:
        yield from (f'{room} opens ports with {call}' for call in opens_ports(tree))
    if room in WITHOUT_TIME and path not in ASKS_FOR_TIME:
        yield from (f'{path} asks for the time: use the clock given' for _ in time_calls(tree))
    general = room == 'simulator' and path.count('/') == 1
    if general or room not in NAMES_FAMILIES:
        yield from (f'{room} names {name}' for name in sorted(named(tree)))
    if general:
        words = FAMILY.findall(source.replace(PACKAGE, ''))
        yield from (f'{room} knows {word}' for word in words)
    elif room == 'simulator':
        others = [name for name in families() if name != path.split('/')[1]]
        yield from (f'{path} imports {name}' for name in others if f'simulator.{name}' in source)


def time_calls(tree: ast.Module) -> Iterator[ast.Call]:
    """What a module calls of the module ``time``."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).startswith('time.'):
            yield node


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


def circle(sources: dict[str, str]) -> list[str]:
    """
    Files that import each other, directly or through others, for types alone or not; or nothing.

    :param sources: of all files of the package, by their paths below it.
    """
    files = {path.removesuffix('.py').removesuffix('/__init__'): path for path in sources}
    imports = {
        path: {file_of(name, files) for name in imports_of(ast.parse(source), path)} - {path}
        for path, source in sources.items()
    }
    try:
        graphlib.TopologicalSorter(imports).prepare()
    except graphlib.CycleError as error:
        return list(error.args[1])
    return []


def file_of(name: str, files: dict[str, str]) -> str:
    """The file that an import is answered by, if it is one of ours."""
    top, _, rest = name.partition('.')
    below = rest.replace('.', '/') if top == PACKAGE else ''
    # what is imported from a file is not one itself
    return files.get(below) or files.get(below.rpartition('/')[0], '')


def package_files() -> list[str]:
    """Every Python file of the package, by its path below it."""
    package = ROOT / PACKAGE
    return sorted(path.relative_to(package).as_posix() for path in package.rglob('*.py'))


def package_sources() -> dict[str, str]:
    """What stands in each of them."""
    return {path: (ROOT / PACKAGE / path).read_text(encoding='utf-8') for path in package_files()}


def own_files() -> list[Path]:
    """Every source file of the project; nothing that was built or installed."""
    folders = (PACKAGE, 'test', 'benchmark', 'config', 'examples', 'launch', 'docs')
    ends = ('*.py', '*.cpp', 'CMakeLists.txt', '*.msg', '*.srv', '*.action', '*.st')
    roots = [*(ROOT / folder for folder in folders), MSG_DEFS]
    found = [path for folder in roots for end in ends for path in folder.rglob(end)]
    return [*found, *ROOT.glob('*.py'), *ROOT.glob('tools/*'), *ROOT.glob('.ci/*')]


def test_every_file_keeps_the_rules_of_the_house() -> None:
    found = {path: list(violations(path, source)) for path, source in package_sources().items()}
    assert {path: rules for path, rules in found.items() if rules} == {}


def described_drives_in(source: str, path: str) -> list[str]:
    """What a file imports that is about drives which files describe."""
    about = re.compile(r'[._](declared|described)\b|DESCRIBED')
    return [name for name in imports_of(ast.parse(source), path) if about.search(name)]


def test_who_drives_knows_not_that_files_describe_drives() -> None:
    found = {
        path: described_drives_in(source, path)
        for path, source in package_sources().items()
        if room_of(path) in ('bus', 'drive', 'link', 'node')
    }
    assert {path: names for path, names in found.items() if names} == {}
    for name in ('catalog.declared.read', 'catalog.is_described', 'families._declared.profile'):
        room, _, what = name.rpartition('.')
        assert described_drives_in(f'from {PACKAGE}.{room} import {what}', 'drive/a.py')


def test_the_one_profile_of_described_drives_is_short() -> None:
    assert package_sources()['families/_declared/profile.py'].count('\n') <= 300


def test_no_object_writes_the_fields_of_another() -> None:
    found = {
        path: list(foreign_writes(ast.parse(source)))
        for path, source in package_sources().items()
        if room_of(path) in ('bus', 'drive')
    }
    assert {path: fields for path, fields in found.items() if fields} == {}
    # what changes one is found, and nothing else
    source = 'del self.a.b[0]; a.b[0] = 1; c.d.clear(); e.f, self.g = 1, a.get(h[0])'
    assert sorted(foreign_writes(ast.parse(source))) == ['a.b', 'c.d', 'e.f', 'self.a.b']


#: What sends a write, or what has an effect, of those who have a bus.
SENDS = frozenset(('write', 'write_and_read', 'read_then_write', 'watch'))
#: Who asks before whether the drive was recognised.
GATES = ['drive/broadcast.py', 'drive/parameter_access.py', 'drive/setpoint.py']


def sends(tree: ast.Module) -> bool:
    """Whether a module has a bus write something."""
    calls = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return any(
        isinstance(call, ast.Attribute)
        and call.attr in SENDS
        and ast.unparse(call.value).rpartition('.')[2].lstrip('_') == 'bus'
        for call in calls
    )


def test_all_that_is_written_to_a_drive_passes_one_gate() -> None:
    outside = ('bus', 'link', 'simulator')
    found = [
        path
        for path, source in package_sources().items()
        if room_of(path) not in outside and sends(ast.parse(source))
    ]
    assert found == GATES
    assert sends(ast.parse('await self._state.bus.write(1, a, b)'))
    assert not sends(ast.parse('await self._params.write(step); bus.read(1, a)'))


def test_no_files_import_each_other_in_a_circle() -> None:
    assert circle(package_sources()) == []
    # what imports for types alone is found, too
    for_types = 'if TYPE_CHECKING:\n    from nfo_sinus_driver.drive.a import A'
    assert circle({'drive/a.py': 'from . import b', 'drive/b.py': for_types})


def test_every_file_has_the_licence_header() -> None:
    found = {path: path.read_text(encoding='utf-8') for path in own_files() if path.is_file()}
    assert {path.suffix for path in found} >= {'.py', '.cpp', '.msg', '.srv', '.action', '.st', ''}
    assert [path for path, text in found.items() if not LICENCE.match(text)] == []


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
    try:
        importlib.import_module(module)
    except ImportError as error:
        # the one library that may be missing or old
        if error.name.split('.')[0] not in ('rich', 'textual'):
            raise
"""
    done = subprocess.run(
        [sys.executable, '-c', program], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_what_breaks_a_rule_is_found_and_nothing_else() -> None:
    for path, source, complaint in (
        ('drive/drive.py', 'from nfo_sinus_msgs import msg', 'drive imports nfo_sinus_msgs'),
        ('drive/drive.py', 'import serial', 'drive opens ports with serial'),
        ('bus.py', 'import os\nos.open("/dev/ttyUSB0", os.O_RDWR)', 'bus opens ports with os.open'),
        ('node/qos.py', 'from os import open as o', 'node opens ports with os.open'),
        ('drive/drive.py', 'import time\ntime.monotonic()', 'drive/drive.py asks for the time'),
        ('drive/drive.py', 'say(f"{it} in error.rst_dly: {text}")', 'drive names error.rst_dly'),
        ('drive/drive.py', 'key.startswith("serial.")', 'drive names serial.'),
        ('simulator/drive.py', 'class OptimalUnit: ...', 'simulator knows Optimal'),
        (
            'simulator/sinus_g2/family.py',
            'from nfo_sinus_driver.simulator.sinus_optimal import family',
            'simulator/sinus_g2/family.py imports sinus_optimal',
        ),
        ('catalog/family.py', 'import csv\nopen("table.csv")\nos.path.open', ''),
        ('drive/drive.py', '"""Such as motor.p_nom of a sinus_g2."""\nlog = "motor.log"', ''),
        ('simulator/sinus_g2/control_unit.py', "class G2:\n    key = 'fieldbus.mode'", ''),
    ):
        found = list(violations(path, source))
        assert found[0].startswith(complaint) if complaint else not found, source
