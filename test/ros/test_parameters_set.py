# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Setting parameters of a drive through ROS: what is taken for what, and all of it or nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from bench import Bench, Client
from connections import Connection, needs
from parameter_bench import (
    ANY_BUS,
    COUNTED,
    Value,
    Wire,
    refused,
    says_once,
    set_each,
    set_one,
    settings,
    values,
    written,
)
import pytest

from nfo_sinus_driver.demo.bench import own_domain

pytestmark = needs('parameters')

#: 6 s and 60 Hz, raw.
_ACCEL_6 = written('control.accel', (6000, 0))
_FIX_60 = written('freque.f_fix1', (600,))


class Rig:
    """One drive and its driver for all tests here."""

    def __init__(self, bench: Bench) -> None:
        self.names = settings(bench.connection)
        self.drive = bench.simulator()
        self.driver = bench.driver(*COUNTED)
        self.client: Client = bench.client().connected()
        self.wire = Wire(bench)

    def begin(self) -> None:
        """Have the drive and the driver as they were at first."""
        factory = {
            'control.accel': 5.0, 'control.retard': 5.0, 'freque.f_fix1': 10.0,
            'error.cur_low_mode': 'Disable', 'control.auto_start': False,
            'pi_reg.reg_amp': 1, 'control.run_dly': 0, 'motor.u_nom': 400,
            'poll_rate': 10.0, 'telemetry_rate': 0.0, 'drive_timeout': 0.0,
        }
        for result in set_each(self.client, *factory.items()):
            assert result.successful, result.reason
        self.wire.writes()

    def both(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return what ROS and the drive have."""
        shown = self.drive.state()['parameters']
        names = [*self.names, 'poll_rate', 'drive_timeout', 'autostart', 'address']
        return values(self.client, *names), {name: shown[name] for name in self.names}


@pytest.fixture(scope='module')
def the_rig(tmp_path_factory: pytest.TempPathFactory, connection: Connection) -> Iterator[Rig]:
    with own_domain() as domain, Bench(domain, tmp_path_factory.mktemp('set'), connection) as bench:
        yield Rig(bench)


@pytest.fixture
def rig(the_rig: Rig) -> Rig:
    the_rig.begin()
    return the_rig


# --- one ----------------------------------------------------------------------------------------


def test_an_unchanged_value_is_not_written(rig: Rig) -> None:
    assert set_one(rig.client, 'control.accel', 6.0).successful
    assert rig.wire.writes() == [_ACCEL_6]
    assert set_one(rig.client, 'control.accel', 6.0).successful
    assert set_one(rig.client, 'control.accel', 6).successful
    assert rig.wire.writes() == []


def test_what_every_parameter_has_is_taken_without_a_write(rig: Rig) -> None:
    has = values(rig.client, *rig.names)
    results = set_each(rig.client, *has.items())
    assert [result.reason for result in results if not result.successful] == []
    assert rig.wire.writes() == []


def test_a_change_is_logged_once_from_what_to_what(rig: Rig) -> None:
    assert set_one(rig.client, 'control.retard', 7.5).successful
    says_once(rig.driver, 'control.retard: 5 -> 7.5 s')
    assert 'changed at the drive: control.retard' not in rig.driver.text


@pytest.mark.parametrize(
    ('name', 'given', 'value', 'words'),
    [
        pytest.param('control.accel', 6, 6.0, (6000, 0), id='an integer for a double'),
        pytest.param('freque.f_fix1', 60, 60.0, (600,), id='another'),
        # what YAML makes of "control.auto_start: ON"
        pytest.param('control.auto_start', True, True, (1,), id='ON'),
        pytest.param('pi_reg.reg_amp', -1, -1, (0xFFFF,), id='one of two numbers'),
        pytest.param('pi_reg.reg_amp', -1.0, -1, (0xFFFF,), id='a point that changes nothing'),
        # what a message of Float32 makes of 12.3
        pytest.param(
            'freque.f_fix1', 12.300000190734863, 12.3, (123,), id='a number of single precision'
        ),
    ],
)
def test_what_is_meant_is_taken(
    rig: Rig, name: str, given: Value, value: Value, words: tuple[int, ...]
) -> None:
    result = set_one(rig.client, name, given)
    assert result.successful, result.reason
    assert rig.wire.writes() == [written(name, words)]
    shown = values(rig.client, name)[name]
    assert (shown, type(shown)) == (value, type(value))


_NOT_MEANT: tuple[tuple[str, Any, tuple[str, ...]], ...] = (
    ('control.accel', 'fast', ('a number',)),
    ('control.accel', True, ('a number',)),
    ('control.accel', [6.0], ('a number',)),
    ('control.run_dly', 3.5, ('a whole number',)),
    ('control.run_dly', '3', ('a whole number',)),
    ('control.auto_start', 'ON', ('true or false',)),
    ('control.auto_start', 1, ('true or false',)),
    ('control.st_mode', 1, ('one of', 'Release', 'Brake')),
    ('control.st_mode', 'brake', ('Release', 'Brake')),
    # YAML makes false of OFF, and no label of this one means that
    ('control.st_mode', False, ('one of', 'Release', 'Brake')),
    ('pi_reg.reg_amp', 0.5, ('one of -1, 1',)),
    ('pi_reg.reg_amp', True, ('one of -1, 1',)),
    ('control.accel', float('nan'), ('control.accel',)),
    ('control.accel', float('inf'), ('control.accel',)),
    ('control.accel', -(2**62), ('0.2', '500')),
    ('control.run_dly', 2**62, ('0', '3600')),
    # ros2 param delete
    ('control.accel', None, ()),
)


def test_what_cannot_be_meant_is_refused_and_nothing_moves(rig: Rig) -> None:
    before = rig.both()
    wrong = []
    for name, given, parts in _NOT_MEANT:
        result = set_one(rig.client, name, given)
        named = given is None or name in result.reason
        if result.successful or not named or any(part not in result.reason for part in parts):
            wrong.append((name, given, result.reason))
    assert wrong == []
    assert rig.wire.writes() == []
    assert rig.both() == before


@pytest.mark.parametrize(
    'name',
    ['control.acel', pytest.param(ANY_BUS, marks=needs('modbus')), 'status.frq_act', 'accel'],
)
def test_a_name_that_is_none_is_refused(rig: Rig, name: str) -> None:
    answer = set_one(rig.client, name, 1.0)
    refused(answer, f'{name}: there is no such parameter')
    assert 'configured' not in answer.reason, 'the node is configured already'
    assert rig.wire.writes() == []


def test_a_name_that_is_none_is_answered_with_the_one_most_like_it(rig: Rig) -> None:
    refused(set_one(rig.client, 'contrl.accel', 1.0), 'did you mean control.accel')


@pytest.mark.parametrize(
    ('name', 'value'),
    [('serial.sio_tot', 2.0), ('serial.address', 2), ('serial.auto_stop', True),
     ('serial.si_baud', '1200bps'),
     pytest.param('serial.bus_type', 'NFO', marks=needs('newer'))],
)
def test_communication_is_not_changed_without_permission(
    rig: Rig, name: str, value: Value
) -> None:
    before = rig.both()
    refused(set_one(rig.client, name, value), name, 'allow_communication_changes')
    assert rig.wire.writes() == []
    assert rig.both() == before
    present = before[0][name]
    assert set_one(rig.client, name, present).successful, 'it is what the drive has'
    assert rig.wire.writes() == []


def test_communication_is_changed_with_permission_that_can_be_taken_back(rig: Rig) -> None:
    client = rig.client
    assert set_one(client, 'allow_communication_changes', True).successful
    assert set_one(client, 'serial.sio_tot', 12.5).successful
    assert rig.wire.writes() == [written('serial.sio_tot', (125,))]
    assert set_one(client, 'serial.sio_tot', 0).successful
    assert rig.wire.writes() == [written('serial.sio_tot', (0,))]
    assert set_one(client, 'allow_communication_changes', False).successful
    refused(set_one(client, 'serial.sio_tot', 12.5), 'serial.sio_tot')
    assert rig.wire.writes() == []


@needs('later')
def test_a_change_of_the_line_says_how_to_follow(rig: Rig) -> None:
    client = rig.client
    assert set_one(client, 'allow_communication_changes', True).successful
    try:
        assert set_one(client, 'serial.si_baud', '9600bps').successful
        assert rig.wire.writes() == [written('serial.si_baud', (128,))]
        says_once(rig.driver, 'start this driver with the baud_rate (9600) that it has')
    finally:
        assert set_one(client, 'serial.si_baud', '57600 bps').successful
        assert set_one(client, 'allow_communication_changes', False).successful
        rig.wire.writes()


@needs('at_once')
@pytest.mark.parametrize(
    ('name', 'value', 'setting'),
    [('serial.address', 2, 'address (2)'), ('serial.si_baud', '4800bps', 'baud_rate (4800)')],
)
def test_a_change_of_the_line_that_loses_the_drive_says_how_to_follow(
    bench: Bench, name: str, value: Value, setting: str
) -> None:
    bench.simulator()
    bench.driver(*COUNTED, '-p', 'allow_communication_changes:=true')
    client = bench.client().connected()
    result = set_one(client, name, value)
    refused(result, name, 'is not known', 'at once: then start this driver with the', setting)
    client.wait_for('status', lambda status: not status.connected, 'it is lost')


# --- several ------------------------------------------------------------------------------------


def test_several_at_once_are_all_written(rig: Rig) -> None:
    result = rig.client.set_parameters(
        **{'control.accel': 6, 'freque.f_fix1': 60.0, 'poll_rate': 20, 'motor.u_nom': 230}
    )
    assert result.successful, result.reason
    assert sorted(rig.wire.writes()) == sorted(
        [_ACCEL_6, _FIX_60, written('motor.u_nom', (230,))]
    )
    assert values(rig.client, 'control.accel', 'freque.f_fix1', 'poll_rate', 'motor.u_nom') == {
        'control.accel': 6.0, 'freque.f_fix1': 60.0, 'poll_rate': 20.0, 'motor.u_nom': 230
    }


_CANNOT_BE: tuple[tuple[str, Value, tuple[str, ...]], ...] = (
    ('freque.f_fix1', 151.0, ('freque.f_fix1', '150')),
    ('freque.f_fix1', 12.34, ('freque.f_fix1', '12.3', '12.4')),
    ('error.cur_low_mode', 'Fault', ('error.cur_low_mode', 'Disable', 'Error')),
    ('serial.auto_stop', True, ('serial.auto_stop', 'allow_communication_changes')),
    ('control.acel', 6.0, ('control.acel',)),
    ('poll_rate', -1.0, ('poll_rate',)),
    ('poll_rate', 'fast', ()),
    ('drive_timeout', 0.5, ('drive_timeout', '1.5 s')),
    ('drive_timeout', 2.05, ('drive_timeout', '2 and 2.1')),
    ('address', 2, ('address', 'unconfigured')),
    ('autostart', False, ('autostart',)),
    ('expected_control_mode', 'Vector', ('expected_control_mode',)),
)


def test_several_with_one_that_cannot_be_are_none(rig: Rig) -> None:
    before = rig.both()
    good: dict[str, Value] = {'control.accel': 6.0, 'control.retard': 8.0}
    wrong = []
    for bad, value, parts in _CANNOT_BE:
        for wanted in ({**good, bad: value}, {bad: value, **good}):
            result = rig.client.set_parameters(**wanted)
            if result.successful or any(part not in result.reason for part in parts):
                wrong.append((wanted, result.reason))
    assert wrong == []
    assert rig.wire.writes() == []
    assert rig.both() == before


@needs('sio_tot')
def test_drive_timeout_goes_with_parameters_of_the_drive(rig: Rig) -> None:
    result = rig.client.set_parameters(**{'control.accel': 6.0, 'drive_timeout': 12.5})
    assert result.successful, result.reason
    assert rig.wire.writes() == [
        _ACCEL_6, written('serial.sio_tot', (125,)), written('serial.auto_stop', (1,))
    ]
    # 0 leaves the drive's own time-out as it is
    try:
        assert set_one(rig.client, 'drive_timeout', 0.0).successful
        assert rig.wire.writes() == []
        assert values(rig.client, 'serial.sio_tot', 'serial.auto_stop') == {
            'serial.sio_tot': 12.5, 'serial.auto_stop': True
        }
    finally:
        rig.drive.inject('set', 'serial.sio_tot', 0.0)
        rig.drive.inject('set', 'serial.auto_stop', False)
        assert rig.client.call('refresh_parameters').success


def test_bounds_that_move_each_other_come_in_any_order(rig: Rig) -> None:
    wanted = {'motor.i_limt': 4.0, 'motor.i_magn': 1.5}
    assert rig.client.set_parameters(**wanted).successful
    assert values(rig.client, *wanted) == wanted
    assert rig.client.set_parameters(**{'motor.i_magn': 1.8, 'motor.i_limt': 5.1}).successful
