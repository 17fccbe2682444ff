# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""An empty workspace: from a clone of main as the README says, and from the branch of a release."""

from __future__ import annotations

import os
from pathlib import Path
import re
import subprocess
import sys

import pytest
from support.places import MSG_DEFS, ROOT

from nfo_sinus_driver.version import VERSION

packages = pytest.importorskip('catkin_pkg.packages', reason='catkin_pkg is not installed')
changelog = pytest.importorskip('catkin_pkg.changelog')
pytest.importorskip('colcon_core', reason='colcon is not installed')
if not (ROOT / '.git').exists():
    pytest.skip('this is not a clone of main', allow_module_level=True)

FORGE = 'git@forge.example:team/nfo_sinus.git'
BOTH = {'nfo_sinus_driver', 'nfo_sinus_msgs'}
#: Of the driver's own tests, those that look for the other package, and one that runs the driver.
WITHOUT_ROS = ('test/unit/catalog/test_family.py', 'test/unit/test_docs.py')
TESTS = (*WITHOUT_ROS, 'test/unit/cli/test_completion.py', 'test/ros/test_calls_logged.py')


def attempt(*command: object, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command where ROS is sourced and nothing of this clone is."""
    built = str(ROOT / 'install')
    environment = {
        name: ':'.join(part for part in value.split(':') if not part.startswith(built))
        for name, value in os.environ.items()
    }
    # set by tools/run for the processes of the tests
    environment.pop('PYTHONPATH', None)
    return subprocess.run(
        [*map(str, command)],
        cwd=folder, env=environment, check=False, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )


def run(*command: object, folder: Path) -> str:
    """Run such a command that succeeds, and return what it says."""
    done = attempt(*command, folder=folder)
    assert done.returncode == 0, done.stdout[-6000:]
    return done.stdout


def lines_of_the_readme() -> dict[str, str]:
    """The commands that make a workspace, by their first words."""
    page = (ROOT / 'README.md').read_text(encoding='utf-8')
    (chapter,) = re.findall(r'^## In your own workspace$(.*?)^##', page, re.MULTILINE | re.DOTALL)
    (block,) = re.findall(r'\n\n((?:    git clone .*\n)(?:    .*\n)+)', chapter)
    lines = [line.strip() for line in block.splitlines()]
    return {re.match(r'[a-z0-9]+( [a-z]+)?', line)[0]: line for line in lines}


@pytest.fixture(scope='module')
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with a clone of main, as the README says."""
    lines = lines_of_the_readme()
    folder = tmp_path_factory.mktemp('workspace')
    for line in (lines['git clone'].replace('<this repository>', str(ROOT)), lines['ln']):
        run('sh', '-c', line, folder=folder)
    return folder


@pytest.fixture(scope='module')
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A repository with the branch."""
    folder = tmp_path_factory.mktemp('source')
    run('git', 'clone', '--quiet', ROOT, '.', folder=folder)
    run('git', 'config', 'user.name', 'A test', folder=folder)
    run('git', 'config', 'user.email', 'test@example.org', folder=folder)
    run('git', 'remote', 'set-url', 'origin', FORGE, folder=folder)
    run(ROOT / 'tools' / 'release_branch', folder=folder)
    return folder


def test_every_tool_finds_both_packages(workspace: Path) -> None:
    assert lines_of_the_readme()['rosdep install'].startswith('rosdep install --from-paths src ')
    # what rosdep and bloom look with
    found = packages.find_packages(str(workspace / 'src'))
    assert {package.name for package in found.values()} == BOTH
    assert set(run('colcon', 'list', '--names-only', folder=workspace).split()) == BOTH


@pytest.mark.parametrize('options', [(), ('--symlink-install',)], ids=['plain', 'links'])
@pytest.mark.parametrize('place', ['src/nfo_sinus_driver', 'a folder/driver', 'elsewhere'])
def test_a_build_without_the_messages_fails_and_its_last_line_mends_it(
    tmp_path: Path, place: str, options: tuple[str, ...]
) -> None:
    workspace = tmp_path / 'workspace'
    (workspace / 'src').mkdir(parents=True)
    clone = tmp_path / 'clone' if place == 'elsewhere' else workspace / place
    run('git', 'clone', '--quiet', ROOT, clone, folder=tmp_path)
    if place == 'elsewhere':
        (workspace / 'src' / 'driver').symlink_to(clone)
    build = ('colcon', 'build', *options, '--packages-select', 'nfo_sinus_driver')
    done = attempt('sh', '-c', 'cd "$0" && exec "$@"', workspace, *build, folder=tmp_path)
    assert done.returncode != 0, done.stdout
    (log,) = workspace.glob('log/build_*/nfo_sinus_driver/stderr.log')
    said = log.read_text(encoding='utf-8').splitlines()
    assert 'nfo_sinus_msgs' in said[-2] and said[-1].startswith('ln -s ')
    assert said[-1] in done.stdout
    # from wherever it is pasted
    run('sh', '-c', said[-1], folder=tmp_path)
    assert set(run('colcon', 'list', '--names-only', folder=workspace).split()) == BOTH


@pytest.mark.parametrize('options', [(), ('--symlink-install',)], ids=['plain', 'links'])
def test_a_build_with_the_messages_installed_needs_no_link(
    tmp_path: Path, options: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    marker = tmp_path / 'installed/share/ament_index/resource_index/packages/nfo_sinus_msgs'
    marker.parent.mkdir(parents=True)
    marker.touch()
    (tmp_path / 'installed/share/nfo_sinus_msgs').mkdir()
    monkeypatch.setenv(
        'AMENT_PREFIX_PATH', f'{tmp_path / "installed"}:{os.environ["AMENT_PREFIX_PATH"]}'
    )
    run('git', 'clone', '--quiet', ROOT, 'src/nfo_sinus_driver', folder=tmp_path)
    run('colcon', 'build', *options, folder=tmp_path)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_plain_build_makes_both_packages_and_their_tests_pass(workspace: Path) -> None:
    lines = lines_of_the_readme()
    run('sh', '-c', lines['colcon build'], folder=workspace)
    in_workspace = f'{lines["source install"]} && exec "$@"'
    for package, tests in (('nfo_sinus_msgs', ()), ('nfo_sinus_driver', TESTS)):
        # colcon takes what comes after --pytest-args for that, up to the end
        chosen = ('--pytest-args', *tests) if tests else ()
        command = ('colcon', 'test', '--packages-select', package, *chosen)
        run('bash', '-c', in_workspace, 'bash', *command, folder=workspace)
        report = run(
            'colcon', 'test-result', '--verbose', '--test-result-base', f'build/{package}',
            folder=workspace,
        )
        assert ', 0 errors, 0 failures' in report and 'Summary: 0 tests' not in report
    launch = lines['ros2 launch'].removeprefix('ros2 launch nfo_sinus_driver ')
    share = workspace / 'install' / 'nfo_sinus_driver' / 'share' / 'nfo_sinus_driver'
    assert (share / 'launch' / launch).is_file()


def test_the_branch_of_a_release_has_the_packages_side_by_side(
    source: Path, tmp_path: Path
) -> None:
    run('git', 'clone', '--quiet', '--branch', 'jazzy', source, '.', folder=tmp_path)
    found = packages.find_packages(str(tmp_path)).values()
    assert {package.name for package in found} == BOTH
    address = 'https://forge.example/team/nfo_sinus'
    for package in found:
        urls = {url.type: url.url for url in package.urls}
        assert urls == {
            'website': address, 'repository': address, 'bugtracker': f'{address}/issues'
        }
    # all else that was built and tested, and nothing more
    for name, old in (('nfo_sinus_driver', '.'), ('nfo_sinus_msgs', 'msg_defs')):
        new, of_main = (
            re.sub(r'^.*\t(msg_defs/.*|package\.xml)\n', '', listed, flags=re.MULTILINE)
            for listed in (
                run('git', 'ls-tree', '-r', 'HEAD', '.', folder=tmp_path / name),
                run('git', 'ls-tree', '-r', 'HEAD', '.', folder=source / old),
            )
        )
        assert new == of_main
        manifest = (tmp_path / name / 'package.xml').read_text(encoding='utf-8')
        without = re.sub(rf'^.*{address}.*\n', '', manifest, flags=re.MULTILINE)
        assert without == (source / old / 'package.xml').read_text(encoding='utf-8')
    options = ('-p', 'timeout', '-p', 'hypothesispytest', '-p', 'no:cacheprovider')
    run(
        sys.executable, '-m', 'pytest', '-q', *options, *WITHOUT_ROS,
        folder=tmp_path / 'nfo_sinus_driver',
    )


@pytest.mark.parametrize('folder', [ROOT, MSG_DEFS], ids=['driver', 'messages'])
def test_the_changelog_has_the_form_that_the_tools_of_a_release_read(folder: Path) -> None:
    text = (folder / 'CHANGELOG.rst').read_text(encoding='utf-8')
    log = changelog.Changelog(folder.name)
    changelog.populate_changelog_from_rst(log, text)
    versions = {version: content for version, _, content in log.foreach_version()}
    assert VERSION in versions
    # one list for each
    lists = [entry for content in versions.values() for entry in content]
    assert len(lists) == len([content for content in versions.values() if content])
    bullets = sum(len(entry.bullets) for entry in lists)
    # what is forthcoming has no version yet
    released = text[text.index(f'\n{VERSION} (') :]
    assert bullets == len(re.findall(r'^\* ', released, re.MULTILINE))


@pytest.mark.parametrize(
    ('origin', 'address'),
    [
        ('https://name:secret@forge.example/team/driver.git', 'https://forge.example/team/driver'),
        ('http://forge.example:3000/team/driver/', 'http://forge.example:3000/team/driver'),
        ('ssh://git@forge.example:2222/team/driver.git', 'https://forge.example/team/driver'),
        ('/some/where', ''),
        ('../where', ''),
        # there is none
        (None, ''),
    ],
)
def test_the_address_of_a_forge_is_that_of_origin(
    source: Path, origin: str | None, address: str
) -> None:
    # whichever of these came before in this worker
    subprocess.run(('git', 'remote', 'remove', 'origin'), cwd=source, check=False)
    if origin:
        run('git', 'remote', 'add', 'origin', origin, folder=source)
    branch = f'branch-{abs(hash(origin))}'
    said = run(ROOT / 'tools' / 'release_branch', branch, folder=source)
    assert ('a release waits for the address of the repository' in said) is not bool(address)
    # one that takes no mail
    assert said.count('a release waits for an address of the maintainer') == 2
    manifest = run('git', 'show', f'{branch}:nfo_sinus_msgs/package.xml', folder=source)
    found = re.findall(r'<url type="repository">(.*)</url>', manifest)
    assert found == ([address] if address else [])
    assert 'secret' not in manifest


def test_an_address_that_package_xml_has_is_not_added_again(source: Path, tmp_path: Path) -> None:
    run('git', 'clone', '--quiet', source, '.', folder=tmp_path)
    run('git', 'config', 'user.name', 'A test', folder=tmp_path)
    run('git', 'config', 'user.email', 'test@example.org', folder=tmp_path)
    url = '<url type="repository">https://forge.example/own</url>'
    for name in ('package.xml', 'msg_defs/package.xml'):
        path = tmp_path / name
        text = path.read_text(encoding='utf-8').replace('  <author>', f'  {url}\n  <author>')
        text = re.sub('email=".*"', 'email="all@forge.org"', text)
        path.write_text(text, encoding='utf-8')
    run('git', 'commit', '--quiet', '--all', '--message', 'Addresses', folder=tmp_path)
    for origin in ('../nowhere', FORGE):
        run('git', 'remote', 'set-url', 'origin', origin, folder=tmp_path)
        said = run(ROOT / 'tools' / 'release_branch', f'branch-{len(origin)}', folder=tmp_path)
        assert 'waits' not in said
        manifest = run(
            'git', 'show', f'branch-{len(origin)}:nfo_sinus_msgs/package.xml', folder=tmp_path
        )
        assert re.findall('<url.*', manifest) == [url]


def test_history_goes_on_through_the_branch(source: Path) -> None:
    for new, old in (
        ('nfo_sinus_driver/setup.py', 'setup.py'),
        ('nfo_sinus_msgs/msg/DriveStatus.msg', 'msg_defs/msg/DriveStatus.msg'),
    ):
        blame = ('git', 'blame', '--line-porcelain')
        assert run(*blame, 'jazzy', '--', new, folder=source).replace(new, old) == run(
            *blame, 'HEAD', '--', old, folder=source
        )


def test_what_is_no_branch_makes_none(source: Path) -> None:
    tool = ROOT / 'tools' / 'release_branch'
    before = run('git', 'branch', folder=source)
    for word in ('--help', '-h'):
        assert 'tools/release_branch [BRANCH [COMMIT]]' in run(tool, word, folder=source)
    for word in ('--version', 'a b', ''):
        done = subprocess.run(
            [tool, word], cwd=source, check=False, capture_output=True, text=True
        )
        assert done.returncode == 1 and 'can be no branch' in done.stderr
    assert run('git', 'branch', folder=source) == before


def test_what_would_be_lost_is_refused(source: Path) -> None:
    tool = ROOT / 'tools' / 'release_branch'
    run('git', 'branch', 'other', folder=source)
    for branch, reason in (('jazzy', 'has it already'), ('other', 'name another one')):
        done = subprocess.run(
            [tool, branch], cwd=source, check=False, capture_output=True, text=True
        )
        assert done.returncode == 1 and reason in done.stderr, done.stderr
    # the next commit comes on top of the last one
    last = run('git', 'rev-parse', 'jazzy', folder=source)
    run('git', 'commit', '--quiet', '--allow-empty', '--message', 'A change', folder=source)
    run(tool, folder=source)
    assert run('git', 'rev-parse', 'jazzy^1', folder=source) == last
    assert run('git', 'rev-parse', 'jazzy^2', folder=source) == run(
        'git', 'rev-parse', 'HEAD', folder=source
    )
