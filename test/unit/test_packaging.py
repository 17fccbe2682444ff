# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the tools of ROS read of the packages.

package.xml names all that is imported, under keys that rosdep has for Ubuntu 24.04 and Jazzy.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
import re
import runpy
import sys
from xml.etree import ElementTree

import pytest
from support.places import MSG_DEFS, ROOT
import yaml

from nfo_sinus_driver.version import VERSION

#: The keys of libraries, by the module that is imported; a ROS package has one name for both.
KEYS = {
    'argcomplete': 'python3-argcomplete',
    'can': 'python3-can',
    'hypothesis': 'python3-hypothesis',
    'matplotlib': 'python3-matplotlib',
    'pymodbus': 'python3-pymodbus',
    'pytest': 'python3-pytest',
    'serial': 'python3-serial',
    'tqdm': 'python3-tqdm',
    'yaml': 'python3-yaml',
}
#: Of the keys of libraries and of ROS packages, those that rosdep has (rosdistro of 2026-08-22).
ON_NOBLE = {
    *KEYS.values(), 'python3-pytest-timeout',
    'action_msgs', 'ament_cmake', 'ament_xmllint', 'ament_cmake_pytest', 'ament_index_python',
    'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'launch', 'launch_ros',
    'lifecycle_msgs', 'rcl_interfaces', 'rclpy', 'ros2launch', 'rosbag2_py',
    'rosbag2_storage_mcap', 'rosgraph_msgs', 'rosidl_default_generators', 'rosidl_default_runtime',
    'rosidl_parser', 'sensor_msgs', 'std_msgs', 'std_srvs',
}
#: What is left out where it is not installed: apt has none of them, or none that is new enough.
#: The driver says so, a test is skipped.
OPTIONAL = {
    'examples/controller_stopper.py': {'controller_manager_msgs'},
    'nfo_sinus_driver/node/bags/by_rosbags.py': {'rosbags'},
    'test/ros/stand_ins/rosbag2_py.py': {'rosbags'},
}


BOTH = pytest.mark.parametrize('package', [ROOT, MSG_DEFS], ids=['driver', 'messages'])


def imported(path: Path) -> set[str]:
    """The modules that a file cannot do without, each by its first name."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add(str(node.module))
    return {name.split('.')[0] for name in found} - set(sys.stdlib_module_names)


def missing(folders: tuple[str, ...], depends: set[str]) -> Iterator[str]:
    """What files of the folders import and package.xml does not name."""
    paths = [path for folder in folders for path in sorted((ROOT / folder).rglob('*.py'))]
    own = {path.stem for path in paths} | {path.parent.name for path in paths}
    for path in paths:
        name = path.relative_to(ROOT).as_posix()
        needed = imported(path) - own - OPTIONAL.get(name, set()) - {'nfo_sinus_driver'}
        for module in sorted(needed):
            if KEYS.get(module, module) not in depends:
                yield f'{name}: {module}'


def depends(package: Path, *kinds: str) -> set[str]:
    """The keys of a package.xml, of these kinds."""
    root = ElementTree.parse(package).getroot()
    return {str(element.text) for kind in kinds for element in root.findall(kind)}


EXEC = depends(ROOT / 'package.xml', 'depend', 'exec_depend')
TEST = EXEC | depends(ROOT / 'package.xml', 'test_depend')


def test_all_that_the_package_imports_is_installed_with_it() -> None:
    assert list(missing(('nfo_sinus_driver', 'launch', 'examples'), EXEC)) == []


def test_the_extras_of_pip_have_what_the_commands_without_ros_import() -> None:
    setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
    (found,) = re.findall(r'extras_require=(\{.*?\n    \}),', setup, re.DOTALL)
    extras = {
        name: {re.split('[>=]', requirement)[0].lower() for requirement in needed}
        for name, needed in ast.literal_eval(found).items()
    }
    # where the name for pip is not that of the module
    for_pip = {'serial': 'pyserial', 'yaml': 'pyyaml'}
    for extra, rooms in (
        ('cli', ('bus', 'catalog', 'cli', 'drive', 'families', 'link', 'view')),
        ('simulator', ('catalog', 'families', 'simulator')),
    ):
        folders = [ROOT / 'nfo_sinus_driver' / room for room in rooms]
        files = [path for folder in folders for path in folder.rglob('*.py')]
        modules = {name for path in files for name in imported(path)}
        needed = modules - {'nfo_sinus_driver'}
        assert {for_pip.get(name, name) for name in needed} == extras[extra], extra


def test_all_that_tests_import_is_installed_for_them() -> None:
    assert list(missing(('test',), TEST)) == []


@BOTH
def test_every_key_exists_on_noble(package: Path) -> None:
    kinds = ('depend', 'buildtool_depend', 'exec_depend', 'test_depend')
    keys = depends(package / 'package.xml', *kinds)
    assert len(keys) > 5 and keys - ON_NOBLE - {'nfo_sinus_msgs'} == set()


def test_the_judge_sees_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / 'file.py'
    path.write_text('import os, scipy.signal\nfrom numpy import array\nfrom . import x\n')
    assert imported(path) == {'scipy', 'numpy'}


@BOTH
def test_a_package_says_who_maintains_it_where_it_is_and_under_which_license(package: Path) -> None:
    root = ElementTree.parse(package / 'package.xml').getroot()
    maintainers = [(element.text, element.get('email')) for element in root.findall('maintainer')]
    first = ElementTree.parse(ROOT / 'package.xml').getroot().find('maintainer')
    assert first is not None and maintainers == [(first.text, first.get('email'))]
    # an address that no one reads
    text = (package / 'package.xml').read_text(encoding='utf-8')
    assert not re.search(r'example\.(org|com|net)', text)
    assert root.findtext('author') == 'The nfo_sinus_driver authors'
    # of all pages that a reader could be sent to only those of the repository exist by then
    urls = {element.get('type'): str(element.text) for element in root.findall('url')}
    assert not urls or urls['website'] == urls['repository']
    address_known = urls and not str(first.get('email')).endswith('.example')
    security = (ROOT / 'SECURITY.md').read_text(encoding='utf-8')
    assert ('A release waits' in security) is not bool(address_known)
    (license,) = root.findall('license')
    given = (package / str(license.get('file'))).read_bytes()
    assert given == (ROOT / 'LICENSE').read_bytes()


@BOTH
def test_what_package_xml_says_is_in_the_order_of_rep_149(package: Path) -> None:
    root = ElementTree.parse(package / 'package.xml').getroot()
    order = ('name', 'version', 'description', 'maintainer', 'license', 'url', 'author')
    late = ('group_depend', 'member_of_group', 'export')
    places = [
        order.index(element.tag) if element.tag in order
        else len(order) + 1 + late.index(element.tag) if element.tag in late
        else len(order)
        for element in root
    ]
    assert places == sorted(places)


def test_the_check_of_xml_that_the_build_farm_runs_passes(
    capfd: pytest.CaptureFixture[str],
) -> None:
    check = pytest.importorskip('ament_xmllint.main', reason='ament_xmllint is not installed')
    found = check.main(argv=[str(ROOT / 'package.xml'), str(ROOT / 'config')])
    said = ''.join(capfd.readouterr())
    if 'failed to load' in said:
        pytest.skip('the schema of package.xml is on the network')
    assert not found, said


@BOTH
def test_a_changelog_has_the_version_and_one_list_for_each(package: Path) -> None:
    text = (package / 'CHANGELOG.rst').read_text(encoding='utf-8')
    titles = re.findall(r'^(.+)\n(-+)$', text, re.MULTILINE)
    assert [title for title, line in titles if len(title) != len(line)] == []
    forthcoming, newest, *_ = (title for title, _ in titles)
    assert forthcoming == 'Forthcoming'
    assert re.fullmatch(rf'{re.escape(VERSION)} \(20\d\d-\d\d-\d\d\)', newest)


def test_the_build_farm_documents_the_pages_and_no_modules() -> None:
    root = ElementTree.parse(ROOT / 'package.xml').getroot()
    configuration = (ROOT / str(root.findtext('export/rosdoc2'))).read_text(encoding='utf-8')
    kind, settings = yaml.safe_load_all(configuration)
    assert kind == {'type': 'rosdoc2 config', 'version': 1}
    assert settings['settings'] == {'never_run_sphinx_apidoc': True}
    ((sphinx,),) = (builder.values() for builder in settings['builders'])
    # an entry without these is refused
    assert sphinx.keys() == {'name', 'output_dir', 'user_doc_dir'}
    # rosdoc2 has an index of its own, pages beside docs/, and extensions that it knows
    conf = runpy.run_path(
        str(ROOT / sphinx['user_doc_dir'] / 'conf.py'), init_globals={'rosdoc2_settings': {}}
    )
    assert not {'extensions', 'html_extra_path', 'include_patterns', 'root_doc'} & conf.keys()


@pytest.mark.parametrize('distribution', ['jazzy', 'kilted'])
def test_the_wheels_of_each_distribution_are_pinned_apart(distribution: str) -> None:
    folder = ROOT / 'requirements'
    named = (folder / f'ros-{distribution}.txt').read_text(encoding='utf-8')
    pins = (folder / f'constraints-{distribution}.txt').read_text(encoding='utf-8')
    assert f'-c constraints-{distribution}.txt\n' in named and f'ros-{distribution}-rclpy' in named
    wheels = [line for line in f'{named}\n{pins}'.splitlines() if line.startswith('ros-')]
    assert len(wheels) > 80 and [line for line in wheels if '==' not in line] == []
    # what holds for both has none of either
    assert '\nros-' not in (folder / 'constraints.txt').read_text(encoding='utf-8')
