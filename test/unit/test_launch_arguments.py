# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The arguments of the launch files are looked at before anything is started."""

from __future__ import annotations

from pathlib import Path

import pytest

from nfo_sinus_driver.launch_arguments import number, parameter_file, require_packages


@pytest.fixture
def config(tmp_path: Path) -> Path:
    folder = tmp_path / 'config'
    folder.mkdir()
    for name in ('conveyor.yaml', 'single.yaml'):
        (folder / name).touch()
    return folder


def test_a_number_is_taken() -> None:
    assert number('exit_timeout', '15') == 15.0
    assert number('baud_rate', '19200', whole=True) == 19200


@pytest.mark.parametrize(
    ('name', 'given', 'whole'),
    [
        ('exit_timeout', 'soon', False),
        ('exit_timeout', '-1', False),
        ('exit_timeout', 'inf', False),
        ('exit_timeout', 'nan', False),
        ('baud_rate', 'fast', True),
        ('baud_rate', '19200.5', True),
    ],
)
def test_what_is_no_number_is_refused_by_name(name: str, given: str, whole: bool) -> None:
    with pytest.raises(ValueError, match=f'{name}:={given}: write a .*number, such as'):
        number(name, given, whole=whole)


def test_a_parameter_file_is_found_by_path(config: Path) -> None:
    path = config / 'single.yaml'
    assert parameter_file(str(path), config) == str(path)


def test_a_bare_name_is_one_of_the_package(
    config: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert parameter_file('conveyor.yaml', config) == str(config / 'conveyor.yaml')
    (tmp_path / 'conveyor.yaml').touch()
    assert parameter_file('conveyor.yaml', config) == 'conveyor.yaml', 'the nearer one counts'


def test_a_parameter_file_that_is_not_there_is_refused(config: Path) -> None:
    with pytest.raises(ValueError, match=r'params_file:=conveyer\.yaml: there is no') as no:
        parameter_file('conveyer.yaml', config)
    assert 'conveyor.yaml, single.yaml' in str(no.value)
    with pytest.raises(ValueError, match=r'looked in /nowhere/single\.yaml$'):
        parameter_file('/nowhere/single.yaml', config)


def test_packages_are_looked_up_before_anything_starts() -> None:
    def find(name: str) -> str:
        if name == 'there':
            return '/opt/there'
        raise LookupError(name)

    require_packages({'there': 'what is there'}, find)
    needed = {'there': 'what is there', 'controller_manager': 'ros2_control', 'robot_x': 'frames'}
    with pytest.raises(ValueError, match='packages are missing') as missing:
        require_packages(needed, find)
    assert str(missing.value) == (
        'packages are missing: controller_manager (ros2_control), robot_x (frames); '
        'sudo apt install ros-jazzy-controller-manager ros-jazzy-robot-x'
    )
