# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive that a file of another package describes, through ROS: found, run, faulted, killed."""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import signal
import subprocess
import termios

from bench import PATIENCE, Bench, holds_for
from connections import needs
from nfo_sinus_msgs.msg import DriveStatus
import pytest
from rcl_interfaces.srv import DescribeParameters
from support.described import SHIPPED

pytestmark = needs('own')

#: The package that has the file, and the name of the family.
PACKAGE, NAME = 'their_robot', 'their_drive'
#: The parameter file with which the launch file starts a driver.
SINGLE = Path(__file__).resolve().parents[2] / 'config' / 'single.yaml'


def _installed(prefix: Path) -> Path:
    """Install a package that offers a file; return the file."""
    index = prefix / 'share' / 'ament_index' / 'resource_index'
    for kind, text in (('packages', ''), ('nfo_sinus_driver.families', f'{NAME}.vfd.yaml\n')):
        (index / kind).mkdir(parents=True)
        (index / kind / PACKAGE).write_text(text)
    file = prefix / 'share' / PACKAGE / f'{NAME}.vfd.yaml'
    file.parent.mkdir(parents=True)
    shutil.copy(SHIPPED['delta_vfd_el'], file)
    return file


@pytest.fixture
def file(bench: Bench, tmp_path: Path) -> Path:
    """The file, installed where the processes of the bench look."""
    file = _installed(tmp_path / 'prefix')
    before = os.environ.get('AMENT_PREFIX_PATH', '')
    bench._environment['AMENT_PREFIX_PATH'] = f'{tmp_path / "prefix"}{os.pathsep}{before}'
    return file


@pytest.mark.parametrize('family', [NAME, f'package://{PACKAGE}/{NAME}.vfd.yaml'])
def test_a_run(bench: Bench, file: Path, family: str) -> None:
    drive = bench.simulator('--family', str(file), '--set', 'ramp.accel=0.5')
    driver = bench.driver('-p', f'family:={family}', '-p', 'drive_timeout:=2.0', through=('env',))
    client = bench.client().connected()
    status = client.newest('status')
    assert status.control_method == DriveStatus.CUSTOM
    assert client.parameter('ramp.accel') == 0.5
    described = client.call('describe_parameters', DescribeParameters, names=['ramp.accel'])
    assert described.descriptors[0].description == '01.09 [s]'
    assert client.set_parameters(**{'ramp.decel': 0.5}).successful
    assert drive.state()['parameters']['ramp.decel'] == 0.5
    with client.run_at(20.0):
        drive.wait_for(lambda state: abs(state['frequency'] - 20) < 0.5)
    with client.setpoints(-15.0):
        client.wait_for('status', lambda status: abs(status.actual + 15) < 0.5, 'reverse')
        assert client.newest('status').reverse
        drive.inject('fault', 1)
        fault = client.wait_for('inv_st', lambda status: status.code == 1, 'the fault')
        assert (fault.text, fault.remedy[:11]) == ('oc', 'Check motor')
        client.wait_for('status', lambda status: not status.enabled, 'it is not enabled any more')
        assert client.call('fault_ack').success
        holds_for(1.0, lambda: not drive.state()['driven'], 'nothing turns by itself')
    with client.run_at(10.0):
        driver.signal(signal.SIGKILL)
        # its own time-out stops it
        drive.wait_for(lambda state: not state['driven'], PATIENCE)
    assert 'Traceback' not in bench.log


@pytest.mark.parametrize('shipped', [(), ('--params-file', str(SINGLE))], ids=['bare', 'file'])
def test_line_and_address_are_those_of_the_file_where_none_is_given(
    bench: Bench, shipped: tuple[str, ...]
) -> None:
    bench.simulator('--family', 'yaskawa_v1000')
    given = {'port': bench.port, 'family': 'yaskawa_v1000', 'nfo_sinus_bus:char_format': '8N2'}
    words = [word for name, value in given.items() for word in ('-p', f'{name}:={value}')]
    bench.bare_driver(*shipped, *words, through=('env',))
    drive = bench.client().connected()
    assert drive.parameter('address') == 31
    with open(bench.port, 'rb', buffering=0) as port:
        _, _, control, _, speed, *_ = termios.tcgetattr(port)
    assert speed == termios.B9600
    assert control & termios.CSTOPB and not control & termios.PARENB


def test_a_family_that_is_none_is_refused_with_what_to_do(bench: Bench, tmp_path: Path) -> None:
    for family, said in (
        ('nowhere', "there is no family 'nowhere': choose one of abb_acs355"),
        ('package://nowhere/a.vfd.yaml', 'there is no package nowhere'),
        (str(tmp_path / 'a.vfd.yaml'), 'there is no such file'),
    ):
        assert bench.driver('-p', f'family:={family}', through=('env',)).wait() == 2
        assert said in bench.log
    bad = tmp_path / 'bad.vfd.yaml'
    bad.write_text(SHIPPED['siemens_v20'].read_text().replace('bit: 2', 'bit: 3'))
    assert bench.driver('-p', f'family:={bad}', through=('env',)).wait() == 2
    assert 'line 39: fault and running mean the same bits' in bench.log, bench.log


def test_the_command_families_lists_it(bench: Bench, file: Path) -> None:
    from bench import _executable

    done = subprocess.run(
        [_executable('families')], env=bench._environment, capture_output=True, text=True,
        check=True,
    )
    (line,) = [line for line in done.stdout.splitlines() if line.startswith(NAME)]
    assert 'Delta VFD-EL' in line and f'package {PACKAGE}' in line and str(file) in line
