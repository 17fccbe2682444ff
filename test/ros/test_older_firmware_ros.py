# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive of the v5.0 dialect of Classic takes settings under bus control alone [C100]."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from bench import PATIENCE, Bench, Client, wait_until
from connections import CONNECTIONS
from parameter_bench import refused, set_one
import pytest

from nfo_sinus_driver.demo.bench import own_domain
from nfo_sinus_driver.simulator.control import Client as Simulated

_STOP = 1
_QUICK = ('--set', 'control.accel=0.3', '--set', 'control.retard=0.3', '--boot-time', '0.5')


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with own_domain() as domain, Bench(domain, tmp_path, CONNECTIONS['classic_v5']) as bench:
        yield bench


def _untouched(drive: Simulated) -> None:
    """Control was given back, nothing turned, and the drive has nothing to complain of."""
    state = drive.wait_for(lambda state: state['mode'] == _STOP, timeout=PATIENCE)
    assert not (state['driven'] or state['turning'] or state['scmd'] or state['setpoint'])
    assert (state['fault'], state['sio_err'], state['mode_ext_writes']) == (0, 0, 0)


def test_settings_are_written_and_control_is_given_back(bench: Bench) -> None:
    drive = bench.simulator(*_QUICK)
    bench.driver('-p', 'drive_timeout:=14.0', '-p', 'freque.f_fix2:=21.5')
    client: Client = bench.client().connected()
    assert drive.state()['parameters']['serial.sio_tot'] == 0.0, 'it was not enabled'
    wait_until(lambda: client.parameter('freque.f_fix2') == 21.5, 'what was given to the node')
    _untouched(drive)
    assert set_one(client, 'freque.f_fix1', 12.5).successful
    assert drive.state()['parameters']['freque.f_fix1'] == 12.5
    assert client.set_parameters(drive_timeout=15.0).successful
    assert drive.state()['parameters']['serial.sio_tot'] == 15.0
    assert drive.state()['parameters']['serial.auto_stop'] is True
    _untouched(drive)
    writes = sum(drive.state()['command_writes'].values())
    assert set_one(client, 'freque.f_fix1', 12.5).successful
    assert sum(drive.state()['command_writes'].values()) == writes, 'it has it already'


def test_settings_are_written_while_the_motor_turns_by_the_bus(bench: Bench) -> None:
    drive = bench.simulator(*_QUICK)
    bench.driver()
    client: Client = bench.client().connected()
    with client.run_at(10.0):
        assert set_one(client, 'freque.f_fix1', 12.5).successful
        assert drive.state()['driven']
        assert client.newest('status').enabled
    assert drive.state()['parameters']['freque.f_fix1'] == 12.5


def test_another_holder_of_control_keeps_it(bench: Bench) -> None:
    drive = bench.simulator(*_QUICK, '--no-run-input')
    bench.driver()
    client: Client = bench.client().connected()
    drive.inject('keypad', 'ext')
    refused(set_one(client, 'freque.f_fix1', 12.5), 'freque.f_fix1', 'press STOP at the drive')
    drive.inject('run', True)
    drive.wait_for(lambda state: state['driven'], timeout=PATIENCE)
    refused(set_one(client, 'freque.f_fix1', 12.5), 'freque.f_fix1', 'the motor runs')
    state = drive.state()
    assert state['driven']
    assert (state['source'], state['fault']) == ('ext', 0)
    assert not state['writes']
