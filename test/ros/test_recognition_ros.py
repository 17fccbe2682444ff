# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive to which the stop of another make is a run command is not started, whatever ends."""

from __future__ import annotations

from pathlib import Path
import signal

from bench import Bench, Process, _executable, holds_for, wait_until
from connections import needs
import forks
from lifecycle_msgs.msg import Transition
import pytest
from std_srvs.srv import SetBool
from support.described import SHIPPED
from support.recognition import other_make

from nfo_sinus_driver.simulator.control import Client as Simulated

pytestmark = needs('own')

DELTA = str(SHIPPED['delta_vfd_el'])


def simulated(bench: Bench, family: str) -> tuple[Process, Simulated]:
    """Start a simulated drive on the line of the bench."""
    given = {'family': family, 'link': bench.port, 'control': bench.line['control']}
    command = [word for name, value in given.items() for word in (f'--{name}', str(value))]
    command += ['--trace', str(bench.trace)]
    log = bench.folder / f'simulator of {Path(family).stem}.log'
    process = Process([_executable('simulator'), *command], bench._environment, log, forks.start)
    bench.callback(process.end)
    wait_until(lambda: 'serving' in process.text, 'the simulator')
    return process, bench.enter_context(Simulated(bench.line['control']))


@pytest.fixture
def other(tmp_path: Path) -> str:
    """The file of a drive whose register 2000h begins to run at the stop of a VFD-EL."""
    return other_make(tmp_path)


def test_a_drive_of_another_make_is_left_alone(bench: Bench, other: str) -> None:
    _, drive = simulated(bench, other)
    driver = bench.driver('-p', f'family:={DELTA}', through=('env',))
    client = bench.client()
    wait_until(lambda: 'is this another model?' in driver.text, 'it is refused')
    for answer in (
        client.call('stop'), client.call('quick_stop'), client.call('enable', SetBool, data=False),
    ):
        assert not answer.success and 'it is not known what is at address 1' in answer.message
    assert not client.change_state(Transition.TRANSITION_ACTIVATE)
    driver.signal(signal.SIGTERM)
    # it has run no motor
    assert driver.wait() == 0, driver.text
    assert 'ending without a stop, for this driver has run no motor here' in driver.text
    assert not drive.state()['driven'] and not drive.state()['run_command']


def test_what_is_there_after_a_loss_is_left_alone(bench: Bench, other: str) -> None:
    first, drive = simulated(bench, DELTA)
    driver = bench.driver('-p', f'family:={DELTA}', through=('env',))
    client = bench.client().connected()
    with client.run_at(20.0):
        assert drive.state()['driven']
        first.end()
        wait_until(lambda: 'lost: ' in driver.text, 'the loss')
    # a port that is back there within 3 s is no exchange of drives
    holds_for(3.5, lambda: driver.running, 'the driver waits')
    _, drive = simulated(bench, other)
    wait_until(lambda: 'is this another model?' in driver.text, 'it is refused')
    assert not client.call('stop').success
    holds_for(2.0, lambda: not drive.state()['run_command'], 'nothing is written')
    driver.signal(signal.SIGTERM)
    # the motor that it has run may run on, elsewhere
    assert driver.wait() == 1, driver.text
    assert 'ending WITHOUT a confirmed stop' in driver.text
    assert not drive.state()['run_command']
