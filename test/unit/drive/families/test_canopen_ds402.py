# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A G2 by the drive profile of its CANopen module: what is on the line, and what DS402 asks."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause

#: By hand: what a client writes, each a whole SDO message. 603Fh to 6042h are the objects of
#: [M0 table 11]; set-point 0 and 600 rpm, and the commands of CiA 402.
ZERO, RPM_600 = '2b42600000000000', '2b42600058020000'
SHUTDOWN, SWITCH_ON, ENABLE = '2b40600076000000', '2b40600077000000', '2b4060007f000000'
NO_VOLTAGE, FAULT_RESET = '2b40600000000000', '2b40600080000000'
TO_NOBODY = '2b22200001000000'
CONTROL_WORD, MODE = 'fieldbus.control_word', 'fieldbus.mode'
SHAPES = ['canopen, ds402', 'canopen, ds402 alone']
every_shape = pytest.mark.parametrize('connection', SHAPES)
OVERVOLTAGE, SIO_FAIL = 8, 14


def written(rig: Rig, begun: int = 0) -> list[str]:
    """Return the SDO messages that have written something since; the same again once."""
    found: list[str] = []
    for frame in rig.line.frames[begun:]:
        message = frame['hex'][4:]
        downloads = frame['direction'] == 'request' and message[:2] in ('2b', '2f', '23')
        if downloads and message[2:] != (found[-1][2:] if found else ''):
            found.append(message)
    return found


@every_shape
def test_the_messages_of_a_run(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        begun = len(rig.line.frames)
        rig.enable()
        handed_over = ['2b22200003000000'] if connection == SHAPES[1] else []
        assert written(rig, begun) == [
            ZERO, *handed_over, SHUTDOWN, ZERO, SWITCH_ON, ENABLE
        ]
        begun = len(rig.line.frames)
        rig.send(20.0)
        rig.pass_time(1.0)
        assert written(rig, begun) == [RPM_600]
        assert rig.far.motor.frequency == pytest.approx(20.0, abs=0.1)
        shown = rig.drive.snapshot
        assert (shown.control_mode, shown.unit) == ('Speed', 'rpm')
        assert shown.actual == pytest.approx(600, abs=15)
        begun = len(rig.line.frames)
        rig.answer(rig.drive.stop())
        # again and again until it is confirmed
        assert written(rig, begun)[:2] == [SHUTDOWN, ZERO]
        assert set(written(rig, begun)) == {SHUTDOWN, ZERO}
        rig.enable()
        rig.pass_time(0.5)
        begun = len(rig.line.frames)
        rig.answer(rig.drive.quick_stop())
        assert written(rig, begun)[:2] == [NO_VOLTAGE, ZERO] and not rig.far.motor.driven


@every_shape
def test_a_fault_is_acknowledged_by_an_edge_without_voltage_and_its_error_code_is_said(
    connection: str,
) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.far.trip(OVERVOLTAGE)
        rig.pass_time(2.0)
        begun = len(rig.line.frames)
        answer = rig.answer(rig.drive.acknowledge())
        assert 'error code 3210h (voltage)' in answer
        reset = [NO_VOLTAGE, FAULT_RESET, NO_VOLTAGE]
        assert written(rig, begun)[: len(reset)] == reset
        rig.assert_only_enable_helps()


def test_a_refused_control_word_leaves_the_reading_that_acknowledges() -> None:
    with Rig('canopen, ds402') as rig:
        rig.turn()
        rig.far.trip(OVERVOLTAGE)
        rig.pass_time(1.0)
        rig.spoil('refused', CONTROL_WORD, 1000)
        rig.acknowledged += 1
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
        rig.pass_time(1.0)
        assert not rig.far.faults and not rig.turns


def test_a_serial_fault_is_acknowledged_by_mode_stop() -> None:
    with Rig('canopen, ds402') as rig:
        rig.turn()
        rig.far.trip(SIO_FAIL)
        rig.pass_time(1.0)
        begun = len(rig.line.frames)
        rig.acknowledged += 1
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
        assert written(rig, begun)[0] == TO_NOBODY and not rig.far.faults
        rig.assert_only_enable_helps()


@every_shape
def test_a_stop_down_a_long_ramp_is_confirmed_and_is_not_forced(connection: str) -> None:
    with Rig(connection, parameters={'control.retard': 8.0}) as rig:
        rig.turn(25.0)
        begun = len(rig.line.frames)
        assert 'stop' in rig.answer(rig.drive.stop(), 2.0)
        assert rig.far.motor.driven
        rig.pass_time(8.0)
        assert set(written(rig, begun)) == {SHUTDOWN, ZERO}
        assert not rig.far.motor.turning


@every_shape
def test_it_is_enabled_again_while_it_ramps_to_a_stop(connection: str) -> None:
    with Rig(connection, parameters={'control.retard': 8.0}) as rig:
        rig.turn(25.0)
        rig.send(None)
        rig.answer(rig.drive.stop(), 2.0)
        assert abs(rig.far.motor.frequency) > 10.0
        rig.enable()
        rig.pass_time(0.5)
        assert rig.drive.following
        rig.pass_time(8.0)
        assert rig.far.motor.frequency == pytest.approx(0.0, abs=0.1)
        rig.send(10.0)
        rig.wait_until(lambda: rig.far.motor.frequency > 9.5, 5.0)


@every_shape
def test_reverse_is_the_sign(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.enable()
        rig.send(-20.0)
        rig.wait_until(lambda: rig.far.motor.frequency < -19.5, 5.0)
        rig.pass_time(1.0)
        assert rig.drive.following and rig.drive.snapshot.actual == pytest.approx(-600, abs=15)


@every_shape
def test_torque_is_a_mode_of_operation_and_the_process_is_none(connection: str) -> None:
    with Rig(connection, parameters={'control.mode': 'Torque'}) as rig:
        rig.connect()
        rig.enable()
        rig.keep(lambda: rig.drive.set_setpoint(40.0))
        rig.pass_time(1.0)
        assert rig.drive.following and rig.drive.snapshot.unit == '%'
        # target torque of 400 per mille
        assert '2b71600090010000' in written(rig)
        assert rig.far.motor.torque == pytest.approx(0.4, abs=0.05)
    with Rig(connection, parameters={'control.mode': 'PI-Reg'}) as rig:
        rig.connect()
        answer = rig.answer(rig.drive.enable())
        assert 'its mode of operation (object 6061h) is 0' in answer
        assert not rig.turns and not rig.drive.following


@pytest.mark.parametrize(
    ('key', 'value', 'why'),
    [
        ('dimension_factor_numerator', 2, 'vl dimension factor (object 604Ch) is 2/1'),
        ('velocity_min_amount', 300, 'vl velocity min amount (object 6046h) is 300 rpm'),
    ],
)
def test_what_makes_a_set_point_mean_something_else_is_refused(
    key: str, value: int, why: str
) -> None:
    with Rig('canopen, ds402', parameters={f'fieldbus.vl_{key}': value}) as rig:
        rig.connect()
        begun = len(rig.line.frames)
        assert why in rig.answer(rig.drive.enable())
        assert written(rig, begun) == [] and not rig.drive.following


#: What the driver only reads, by the name that it has here: index and sub-index [M0 table 11], how
#: many bytes that has by CiA 402, and what 1 is there. Each is given another number.
READ_ONLY = {
    'error_code': (0x603F, 0, 2, 1),
    'vl_velocity_demand': (0x6043, 0, 2, 1),
    'vl_velocity_actual_value': (0x6044, 0, 2, 1),
    'vl_velocity_min_amount': (0x6046, 1, 4, 1),
    'vl_velocity_max_amount': (0x6046, 2, 4, 1),
    'vl_velocity_acceleration_delta_speed': (0x6048, 1, 4, 1),
    'vl_velocity_acceleration_delta_time': (0x6048, 2, 2, 1),
    'vl_velocity_deceleration_delta_speed': (0x6049, 1, 4, 1),
    'vl_velocity_deceleration_delta_time': (0x6049, 2, 2, 1),
    'vl_dimension_factor_numerator': (0x604C, 1, 4, 1),
    'vl_dimension_factor_denominator': (0x604C, 2, 4, 1),
    'motor_rated_current': (0x6075, 0, 4, 0.001),
    'torque_actual_value': (0x6077, 0, 2, 0.1),
    'motor_type': (0x6402, 0, 2, 1),
    'supported_drive_modes': (0x6502, 0, 4, 1),
}


def test_objects_of_the_profile_are_read_by_their_numbers() -> None:
    with Rig('canopen, ds402') as rig:
        rig.connect()
        entries = rig.far.servers['canopen']._entries

        def give(place: tuple[int, int], number: int, size: int) -> None:
            data = number.to_bytes(size, 'little')
            entries[place] = dataclasses.replace(entries[place], read=lambda: data)

        wanted: dict[str, Any] = {}
        for number, (name, (index, sub, size, unit)) in enumerate(READ_ONLY.items(), 101):
            give((index, sub), number, size)
            wanted[name] = pytest.approx(number * unit)
        for place in ((0x605B, 0), (0x605C, 0)):
            give(place, 0, 2)
        wanted |= dict.fromkeys(('shutdown_option_code', 'disable_operation_code'), 'Release')
        found = {name: rig.result(rig.drive.measure(f'fieldbus.{name}')) for name in wanted}
        assert found == wanted
        # and none is a setting
        for name in wanted:
            change = rig.drive.parameters.change({f'fieldbus.{name}': 1})
            assert 'is no parameter that can be changed here' in rig.answer(change), name


@every_shape
@pytest.mark.parametrize('coasts', [False, True])
def test_shutdown_ramps_or_coasts_as_st_mode_says(connection: str, coasts: bool) -> None:
    # 605Bh and 2021h, which is StMode, are one parameter
    ways = {False: 'Brake', True: 'Release'}
    with Rig(connection, parameters={'control.retard': 8.0}) as rig:
        rig.connect(parameters=True)
        for way in (ways[not coasts], ways[coasts]):
            rig.result(rig.drive.parameters.change({'control.st_mode': way}))
            shown = rig.result(rig.drive.measure('fieldbus.shutdown_option_code'))
            assert shown == way
        rig.turn(25.0)
        assert rig.answer(rig.drive.stop()).startswith('stop')
        assert rig.far.motor.driven is not coasts
        rig.pass_time(9.0)
        assert not rig.far.motor.driven


def test_a_module_without_mode_is_commanded_all_the_same() -> None:
    with Rig('canopen, ds402') as rig:
        del rig.far.servers['canopen']._entries[0x2022, 0]
        rig.turn()
        assert 'stop' in rig.answer(rig.drive.stop())
        rig.far.trip(OVERVOLTAGE)
        rig.pass_time(1.0)
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
        rig.assert_only_enable_helps()
        assert 'the bus keeps control' in rig.answer(rig.drive.disconnect(4.0))
        assert not rig.turns


@every_shape
def test_control_that_goes_ends_the_run(connection: str) -> None:
    for key in ('stop', 'ext'):
        with Rig(connection) as rig:
            rig.turn()
            rig.far.control_unit.press(key)
            rig.wait_until(lambda: not rig.drive.following, 2.0)
            rig.far.set_run_input(False)
            rig.wait_until(lambda: not rig.drive.stop_unconfirmed, 5.0)
            rig.far.set_run_input(True)
            if key == 'stop':
                rig.assert_only_enable_helps()


def test_a_stop_that_is_refused_ends_in_mode_stop() -> None:
    with Rig('canopen, ds402') as rig:
        rig.turn()
        rig.spoil('refused', CONTROL_WORD, 1000)
        rig.answer(rig.drive.stop())
        rig.wait_until(lambda: not rig.drive.stop_unconfirmed, 5.0)
        assert not rig.turns and rig.written(MODE)[-1] == 1


@pytest.mark.parametrize(
    ('index', 'name'), [(0x6041, 'StatusWord'), (0x6061, 'Modes of operation display')]
)
def test_without_an_object_that_it_needs_it_is_refused_and_names_the_others(
    index: int, name: str
) -> None:
    rig = Rig('canopen, ds402')
    del rig.far.servers['canopen']._entries[index, 0]
    answer = rig.answer(rig.drive.connect(retry=False))
    assert f'this drive has no {name}, which control_method ds402 needs' in answer
    assert '(mode_scmd, drive_control)' in answer
    rig.close()


def test_it_goes_by_canopen_alone() -> None:
    with pytest.raises(ValueError, match='set protocol to canopen'):
        Rig('rtu', control_method='ds402')


def test_tuning_is_by_scmd_alone() -> None:
    with Rig('canopen, ds402') as rig:
        rig.connect()
        answer = rig.answer(rig.drive.erase_error_log())
        assert 'mode_scmd' in answer
        assert not rig.notes.said(Cause.DRIVER_ERROR)


def test_a_status_has_a_frequency_that_is_as_new_as_its_word() -> None:
    # the word alone tells no stop
    with Rig('canopen, ds402', poll_rate=50.0) as rig:
        rig.turn()
        rig.asked.clear()
        rig.pass_time(1.0)
        asked = [key for _, key, _ in rig.asked]
        assert asked.count('status.frq_act') >= asked.count('fieldbus.status_word') - 1 > 10
