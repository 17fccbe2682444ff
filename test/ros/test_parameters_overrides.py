# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a drive in a parameter file: the state it is brought into once, and no more."""

from __future__ import annotations

from typing import Any

from bench import A_WHILE, PATIENCE, Bench, Client, Process, holds_for, wait_until
from connections import needs
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from parameter_bench import COUNTED, Wire, register, says_once, set_one, values, written
import pytest

pytestmark = needs('parameters')

_CANNOT_START = 2
_DRIFT = 'differs from the parameter file'


def _given(bench: Bench, *lines: str) -> tuple[str, str]:
    """Write a parameter file for the drive; return the arguments for it."""
    path = bench.folder / 'drive.yaml'
    body = ''.join(f'    {line}\n' for line in lines)
    path.write_text(f'/**/nfo_sinus:\n  ros__parameters:\n{body}')
    return '--params-file', str(path)


def _diagnosis(client: Client) -> Any:
    """Return the newest diagnosis of the drive, with its values as a dictionary."""
    for array in reversed(client.messages['diagnostics']):
        for status in array.status:
            if status.name.endswith(': drive'):
                return status, {pair.key: pair.value for pair in status.values}
    return None, {_DRIFT: ''}


def _drifts(client: Client, text: str) -> None:
    """Wait until diagnostics say what differs, in all."""
    wait_until(lambda: _diagnosis(client)[1][_DRIFT] == text, f'diagnostics with {text!r}')


def _again(client: Client) -> None:
    """Clean up, configure and activate."""
    for transition in (
        Transition.TRANSITION_DEACTIVATE,
        Transition.TRANSITION_CLEANUP,
        Transition.TRANSITION_CONFIGURE,
        Transition.TRANSITION_ACTIVATE,
    ):
        assert client.change_state(transition)


def test_what_differs_is_written_once_and_drift_is_left_alone(bench: Bench) -> None:
    drive = bench.simulator()
    wire = Wire(bench)
    driver = bench.driver(
        *COUNTED,
        *_given(
            bench,
            # as people write it: groups, integers for doubles, ON
            'control:',
            '  accel: 6',
            '  auto_start: ON',
            'freque.f_fix1: 10.0',
            'freque.op_mode: Fix-1 F',
            'motor.u_nom: 230',
            'pi_reg: {setmin: -1, reg_amp: -1}',
        ),
    )
    client = bench.client().connected()
    expected = [
        written('control.accel', (6000, 0)),
        written('control.auto_start', (1,)),
        written('freque.op_mode', (0x000B,)),
        written('motor.u_nom', (230,)),
        written('pi_reg.setmin', (0x10000 - 10,)),
        written('pi_reg.reg_amp', (0xFFFF,)),
    ]
    assert sorted(wire.writes()) == sorted(expected), 'f_fix1 is right as it is'
    for text in (
        'control.accel: 5 -> 6 s, as the parameter file says',
        'control.auto_start: false -> true, as the parameter file says',
        'freque.op_mode: Terminal -> Fix-1 F, as the parameter file says',
        'motor.u_nom: 400 -> 230 V, as the parameter file says',
        'pi_reg.setmin: -150 -> -1, as the parameter file says',
    ):
        says_once(driver, text)
    assert 'f_fix1' not in driver.text
    assert client.parameter('control.accel') == 6.0
    _drifts(client, '')

    drive.inject('set', 'control.accel', 8.0)
    assert client.call('refresh_parameters').success
    wait_until(lambda: client.parameter('control.accel') == 8.0, 'the change shows')
    text = 'control.accel is 8 s in the drive, the parameter file has 6: not changed'
    says_once(driver, text)
    _drifts(client, 'control.accel: 6 -> 8 s')
    status, _ = _diagnosis(client)
    assert status.level == DiagnosticStatus.WARN
    assert '1 parameter' in status.message
    _again(client)
    assert client.parameter('control.accel') == 8.0
    holds_for(A_WHILE, lambda: drive.state()['parameters']['control.accel'] == 8.0, 'left so')
    _drifts(client, 'control.accel: 6 -> 8 s')
    registers = {register(name) for name in ('control.accel', 'motor.u_nom')}
    assert registers.isdisjoint(write.register for write in wire.writes())

    # an operator who sets it has another wish
    assert set_one(client, 'control.accel', 9.0).successful
    _drifts(client, '')


def test_apply_parameters_false_only_reports(bench: Bench) -> None:
    bench.simulator()
    driver = bench.driver(
        *COUNTED, *_given(bench, 'apply_parameters: false', 'control.accel: 6', 'motor.u_nom: 400')
    )
    client = bench.client().connected()
    _drifts(client, 'control.accel: 6 -> 5 s')
    text = 'control.accel is 5 s in the drive, the parameter file has 6: not changed'
    says_once(driver, text)
    assert 'motor.u_nom' not in driver.text
    assert client.parameter('control.accel') == 5.0
    _again(client)
    assert client.parameter('control.accel') == 5.0
    assert Wire(bench).writes() == []


@needs('local')
def test_a_turning_motor_keeps_what_needs_a_standstill(bench: Bench) -> None:
    # it runs by its terminals from power-up on
    drive = bench.simulator('--set', 'control.auto_start=ON')
    drive.wait_for(lambda state: state['turning'], PATIENCE)
    wire = Wire(bench)
    driver = bench.driver(*COUNTED, *_given(bench, 'control.accel: 6', 'motor.u_nom: 230'))
    client = bench.client().connected()
    text = 'not applied from the parameter file: motor.u_nom: only while the motor is stopped'
    if bench.connection.dialect == '5.0':
        # it takes nothing at all while its terminals have control [C100]
        assert wire.writes() == []
        says_once(driver, 'not applied from the parameter file: control.accel: ')
        both = {'motor.u_nom: 230 -> 400 V', 'control.accel: 6 -> 5 s'}
        wait_until(lambda: set(_diagnosis(client)[1][_DRIFT].split(', ')) == both, 'what differs')
    else:
        assert wire.writes() == [written('control.accel', (6000, 0))]
        _drifts(client, 'motor.u_nom: 230 -> 400 V')
    says_once(driver, text)
    assert client.parameter('motor.u_nom') == 400
    assert drive.state()['driven'], 'and it runs on'


def test_a_drive_that_comes_later_is_brought_into_the_state_then(bench: Bench) -> None:
    driver = bench.driver(*COUNTED, '-p', 'control.accel:=6', '-p', 'control.acel:=7.0')
    wait_until(lambda: bench.connection.absent[0] in driver.text, 'no drive answers yet')
    bench.simulator()
    client = bench.client().connected()
    assert Wire(bench).writes() == [written('control.accel', (6000, 0))]
    assert client.parameter('control.accel') == 6.0
    says_once(driver, 'control.acel was given')
    wait_until(lambda: 'did you mean control.accel' in driver.text, 'the log says why')


@pytest.mark.parametrize('allowed', [False, True])
def test_communication_settings_need_permission_in_a_file_too(bench: Bench, allowed: bool) -> None:
    bench.simulator()
    wire = Wire(bench)
    driver = bench.driver(
        *COUNTED,
        *_given(
            bench,
            f'allow_communication_changes: {str(allowed).lower()}',
            'serial: {sio_tot: 12.5, address: 1}',
            'control.accel: 6',
        ),
    )
    client = bench.client().connected()
    accel, sio_tot = written('control.accel', (6000, 0)), written('serial.sio_tot', (125,))
    assert sorted(wire.writes()) == sorted([accel, sio_tot] if allowed else [accel])
    assert values(client, 'serial.sio_tot', 'control.accel') == {
        'serial.sio_tot': 12.5 if allowed else 0.0, 'control.accel': 6.0
    }
    if not allowed:
        text = 'not applied from the parameter file: serial.sio_tot: communication settings'
        says_once(driver, text)
        wait_until(lambda: 'allow_communication_changes is true' in driver.text, 'the log says why')
    assert driver.text.count('not applied') == (not allowed)


def _cannot_start(driver: Process, *parts: str) -> None:
    assert driver.wait() == _CANNOT_START, driver.text
    lines = [line for line in driver.text.splitlines() if 'cannot start' in line]
    assert len(lines) == 1, driver.text
    missing = [part for part in parts if part not in lines[0]]
    assert not missing, lines


@pytest.mark.parametrize(
    ('line', 'parts'),
    [
        ('control.accel: fast', ('control.accel', 'fast', 'a number')),
        ('control.accel: 0.1', ('control.accel', '0.1', '0.2 to 500 s')),
        ('freque.f_fix1: 12.34', ('freque.f_fix1', '12.3', '12.4')),
        ('control.run_dly: 2.5', ('control.run_dly', '2.5', 'a whole number')),
        ('control.st_mode: Coast', ('control.st_mode', 'Coast', 'Release', 'Brake')),
        ('control.auto_start: 3', ('control.auto_start', '3', 'true or false')),
        ('serial.si_baud: 115200bps', ('serial.si_baud', '115200bps', '57600 bps')),
    ],
)
def test_what_the_drive_cannot_have_ends_the_start(
    bench: Bench, line: str, parts: tuple[str, ...]
) -> None:
    drive = bench.simulator()
    _cannot_start(bench.driver(*_given(bench, line, 'control.retard: 6')), 'nfo_sinus', *parts)
    assert not drive.state()['writes']
