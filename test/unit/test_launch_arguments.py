# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the launch files share: their arguments are looked at before anything is started."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from nfo_sinus_driver.launch_arguments import (
    MOST_DRIVES,
    exit_timeout,
    fail_with_driver,
    log_level,
    number,
    parameter_file,
    require_packages,
    simulated_drives,
    switch,
    written,
)


@pytest.mark.parametrize('given', ['loud', '', 'rcl:=loud'])
def test_a_level_that_there_is_not_is_named_with_those_that_there_are(given: str) -> None:
    with pytest.raises(ValueError, match=f'^log_level:={given}: write debug, info, warn, error'):
        log_level(given)


@pytest.mark.parametrize('given', ['info', 'WARN', 'rcl:=debug'])
def test_a_level_of_ros_is_taken(given: str) -> None:
    assert log_level(given) == given


@pytest.mark.parametrize('given', ['3', '9.9', 'soon', '-1'])
def test_an_end_has_the_time_that_the_driver_needs(given: str) -> None:
    with pytest.raises(ValueError, match=f'^exit_timeout:={given}: write'):
        exit_timeout(given)
    assert exit_timeout('10') == 10.0


def test_a_number_is_taken_and_what_is_none_refused_by_name() -> None:
    assert number('exit_timeout', '15') == 15.0
    assert number('baud_rate', '19200', whole=True) == 19200
    for name, given, whole in (
        *(('exit_timeout', given, False) for given in ('soon', '-1', 'inf', 'nan')),
        *(('baud_rate', given, True) for given in ('fast', '19200.5')),
    ):
        with pytest.raises(ValueError, match=f'{name}:={given}: write a .*number$'):
            number(name, given, whole=whole)


def test_a_switch_is_taken_as_it_is_written_and_what_is_none_refused_by_name() -> None:
    assert switch('autostart', 'true') and switch('autostart', 'True')
    assert not switch('autostart', 'false')
    for given in ('1', 'on', 'fals'):
        with pytest.raises(ValueError, match=f'autostart:={given}: write true or false$'):
            switch('autostart', given)


def test_many_drives_have_names_and_addresses_of_their_own_and_one_the_default() -> None:
    assert simulated_drives('1') == {} and written({}) == []
    sections = simulated_drives('8')
    names = sections['/**/nfo_sinus_bus']['ros__parameters']['drives']
    assert names == [f'drive_{number}' for number in range(1, 9)]
    assert [sections[f'/**/{name}']['ros__parameters'] for name in names] == [
        {'address': number} for number in range(1, 9)
    ]
    (name,) = written(sections)
    assert yaml.safe_load(Path(name).read_text(encoding='utf-8')) == sections
    Path(name).unlink()
    for given in ('0', '-1', 'x', '1.5', str(MOST_DRIVES + 1)):
        with pytest.raises(ValueError, match=f'drives:={given}: write a whole number from 1 to'):
            simulated_drives(given)


def test_a_parameter_file_is_found_by_path_or_is_one_of_the_package(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    config = tmp_path / 'config'
    config.mkdir()
    for name in ('conveyor.yaml', 'single.yaml'):
        (config / name).touch()
    path = str(config / 'single.yaml')
    assert parameter_file(path, config) == path
    monkeypatch.chdir(tmp_path)
    assert parameter_file('conveyor.yaml', config) == str(config / 'conveyor.yaml')
    (tmp_path / 'conveyor.yaml').touch()
    assert parameter_file('conveyor.yaml', config) == 'conveyor.yaml', 'the nearer one counts'
    with pytest.raises(ValueError, match=r'params_file:=conveyer\.yaml: there is no') as no:
        parameter_file('conveyer.yaml', config)
    assert 'conveyor.yaml, single.yaml' in str(no.value)
    # in a folder of its own, too
    (config / 'wheels').mkdir()
    (config / 'wheels' / 'drives.yaml').touch()
    assert parameter_file('wheels/drives.yaml', config) == str(config / 'wheels' / 'drives.yaml')
    with pytest.raises(ValueError, match=r'which has conveyor\.yaml, .*, wheels/drives\.yaml$'):
        parameter_file('drives.yaml', config)
    with pytest.raises(ValueError, match=r'looked in /nowhere/single\.yaml$'):
        parameter_file('/nowhere/single.yaml', config)


def test_packages_are_looked_up_before_anything_starts() -> None:
    found = {'there': '/opt/there'}
    require_packages({'there': 'what is there'}, found.__getitem__)
    needed = {'there': 'what is there', 'controller_manager': 'ros2_control', 'robot_x': 'frames'}
    with pytest.raises(ValueError, match='packages are missing: controller_manager') as no:
        require_packages(needed, found.__getitem__)
    assert str(no.value).endswith('install ros-jazzy-controller-manager ros-jazzy-robot-x')


def test_launch_fails_where_the_driver_has() -> None:
    # launch ends with 1 where its handler was called; test/ros/test_launch_files.py does it
    handled: list[dict[str, str]] = []
    context = SimpleNamespace(asyncio_loop=SimpleNamespace(call_exception_handler=handled.append))
    for status in (0, 2, -9):
        fail_with_driver(SimpleNamespace(returncode=status), context)
    assert [event['message'].split(',')[0] for event in handled] == [
        'the driver has ended with status 2', 'the driver has ended with status -9'
    ]
