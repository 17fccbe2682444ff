# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Where families are found: by name, by path, in ROS packages, as entry points."""

from __future__ import annotations

import importlib.metadata
import os
from pathlib import Path
import shutil
import subprocess

import pytest
from support.described import SHIPPED

from nfo_sinus_driver import families
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.catalog.finding import GROUP, every, find
from nfo_sinus_driver.drive import DriveSettings

DELTA = SHIPPED['delta_vfd_el']


@pytest.fixture
def prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A prefix in which the package `robot` offers a file."""
    prefix = tmp_path / 'install'
    index = prefix / 'share' / 'ament_index' / 'resource_index'
    for kind, text in (('packages', ''), (GROUP, 'config/theirs.vfd.yaml\n\n')):
        (index / kind).mkdir(parents=True)
        (index / kind / 'robot').write_text(text)
    (prefix / 'share' / 'robot' / 'config').mkdir(parents=True)
    shutil.copy(DELTA, prefix / 'share' / 'robot' / 'config' / 'theirs.vfd.yaml')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere{os.pathsep}{prefix}')
    return prefix


def test_by_name(prefix: Path) -> None:
    assert find('sinus_g2') == 'sinus_g2'
    assert find('delta_vfd_el') == str(DELTA)
    theirs = prefix / 'share' / 'robot' / 'config' / 'theirs.vfd.yaml'
    assert find('theirs') == find('package://robot/config/theirs.vfd.yaml') == str(theirs)
    found = {family.name: family for family in every()}
    assert found['theirs'].of == 'package robot' and found['theirs'].title == 'Delta VFD-EL'
    assert {family.of for family in found.values()} == {'shipped', 'package robot'}


def test_of_two_with_one_name_that_counts_which_is_shipped_and_both_are_named_once(
    prefix: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert find('theirs') and find('delta_vfd_el') and not caplog.messages
    theirs = prefix / 'share' / 'robot' / 'config' / 'delta_vfd_el.vfd.yaml'
    shutil.copy(DELTA, theirs)
    index = prefix / 'share' / 'ament_index' / 'resource_index' / GROUP
    (index / 'robot').write_text('config/delta_vfd_el.vfd.yaml')
    assert find('delta_vfd_el') == find('delta_vfd_el') == str(DELTA)
    (said,) = caplog.messages
    assert said.startswith(
        f'two packages have a family delta_vfd_el: {DELTA} is taken, not {theirs}; '
    )


def test_of_two_workspaces_with_one_package_the_first_hides_the_other_without_a_word(
    prefix: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    overlay = tmp_path / 'overlay'
    shutil.copytree(prefix, overlay)
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{overlay}{os.pathsep}{prefix}')
    file = 'share/robot/config/theirs.vfd.yaml'
    assert find('theirs') == str(overlay / file) and not caplog.messages
    # as the file of another package it is not meant so
    index = prefix / 'share' / 'ament_index' / 'resource_index' / GROUP
    (index / 'robot').rename(index / 'other')
    (prefix / 'share' / 'robot').rename(prefix / 'share' / 'other')
    assert find('theirs') == str(overlay / file)
    hidden = prefix / file.replace('robot', 'other')
    assert f'{overlay / file} is taken, not {hidden}' in caplog.text


def test_a_package_that_cannot_be_read_hides_no_other_family(
    prefix: Path, caplog: pytest.LogCaptureFixture
) -> None:
    index = prefix / 'share' / 'ament_index' / 'resource_index' / GROUP
    (index / 'broken').mkdir()
    assert find('theirs') and find('delta_vfd_el') == str(DELTA)
    (said,) = caplog.messages
    assert str(index / 'broken') in said


@pytest.mark.parametrize(
    ('line', 'name', 'said'),
    [
        ('config/kx.yaml', 'kx.yaml', 'ends with .vfd.yaml'),
        ('config/gone.vfd.yaml', 'gone', 'there is no such file'),
        ('\udcff.yaml', '\ufffd.yaml', 'ends with .vfd.yaml'),
    ],
)
def test_a_bad_line_of_a_package_spoils_no_other_family(
    prefix: Path, line: str, name: str, said: str
) -> None:
    index = prefix / 'share' / 'ament_index' / 'resource_index' / GROUP / 'robot'
    text = f'{line}\nconfig/theirs.vfd.yaml\n'
    index.write_bytes(text.encode(errors='surrogateescape'))
    found = {family.name: family for family in every()}
    assert found[name].title.startswith('cannot be used: ') and said in found[name].title
    assert found['theirs'].title == 'Delta VFD-EL' and find('theirs')
    with pytest.raises(ValueError, match=said):
        find(name)


def test_by_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copy(DELTA, tmp_path / 'mine.vfd.yaml')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('HOME', str(tmp_path))
    mine = str(tmp_path / 'mine.vfd.yaml')
    for text in ('mine.vfd.yaml', './mine.vfd.yaml', '~/mine.vfd.yaml', mine):
        assert find(text) == mine


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('theirs', "no family 'theirs': choose one of abb_acs355"),
        ('./mine.vfd.yaml', 'no such file'),
        ('./mine.yaml', r'ends with \.vfd\.yaml'),
        ('package://robot/a.vfd.yaml', 'no package robot: build it'),
        ('', 'no family'),
    ],
)
def test_what_is_not_found_is_refused_with_what_to_do(
    text: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    with pytest.raises(ValueError, match=said):
        find(text)


@pytest.mark.parametrize('name', ['mine.yaml', './mine.yaml', '{}/mine.yml', 'mine', './my.vfd'])
def test_of_a_file_whose_name_ends_otherwise_is_said_how_it_is_renamed(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given = name.format(tmp_path)
    shutil.copy(DELTA, given)
    with pytest.raises(ValueError, match='rename it: mv ') as refused:
        find(given)
    # and what it says is enough
    _, _, command = str(refused.value).partition('rename it: ')
    subprocess.run(command, shell=True, check=True)
    assert find(command.split()[-1])


def test_a_family_with_code_is_an_entry_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made_up = Path(__file__).parents[1] / 'drive' / 'made_up' / 'acme'
    shutil.copytree(made_up, tmp_path / 'their_robot' / 'acme')
    (tmp_path / 'their_robot' / '__init__.py').write_text('')
    point = importlib.metadata.EntryPoint('acme', 'their_robot.acme', GROUP)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(families, '__path__', [*families.__path__])
    monkeypatch.setattr(
        importlib.metadata, 'entry_points', lambda group: [point] if group == GROUP else []
    )
    assert find('acme') == 'acme'
    found = {family.name: family for family in every()}
    assert found['acme'].of == 'entry point' and found['acme'].title == 'Acme'
    assert load_family('acme').profile.title == 'Acme'


def test_a_drive_has_the_family_that_is_given(tmp_path: Path) -> None:
    settings = DriveSettings(family='siemens_v20')
    assert settings.model == str(SHIPPED['siemens_v20']) and settings.method == 'custom'
    with pytest.raises(ValueError, match='omit one of them'):
        DriveSettings(family='siemens_v20', model='sinus_optimal')
    bad = tmp_path / 'bad.vfd.yaml'
    bad.write_text('vfd: 1\n')
    with pytest.raises(ValueError, match=r'cannot be used: .*bad.vfd.yaml, line 1: .*needs'):
        DriveSettings(family=str(bad))
    with pytest.raises(ValueError, match='choose one of'):
        DriveSettings(family='siemens_v20', control_method='mode_scmd')
