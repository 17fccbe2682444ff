# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What drives of other makers do otherwise, each said in a file, and driven."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from support.described import SHIPPED, DescribedRig
from support.oddities import ODD, PLAIN, described

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Cause, Severity, StopReason
from nfo_sinus_driver.drive.known.settings import AS_THE_DRIVE_CAN
from nfo_sinus_driver.simulator.memory import Refused

#: A drive without peculiarities; of each odd one, what is otherwise.


@pytest.mark.parametrize('protocol', ['modbus_rtu', 'modbus_tcp'])
@pytest.mark.parametrize('name', ODD)
def test_it_is_driven(tmp_path: Path, name: str, protocol: str) -> None:
    with DescribedRig(described(tmp_path, **ODD[name]), protocol) as rig:
        rig.connect(parameters=True)
        rig.enable()
        assert not rig.turns
        rig.follow(20.0)
        rig.follow(-15.0)
        if rig.file.coast:
            rig.answer(rig.drive.quick_stop())
            assert not rig.far.motor.driven
            rig.enable()
            rig.follow(20.0)
        assert 'stop' in rig.answer(rig.drive.stop())
        by_terminals = rig.file.run_by == 'terminals'
        rig.wait_until(lambda: not (rig.turns if by_terminals else rig.far.motor.driven), 10.0)
        rig.enable()
        rig.follow(20.0)
        rig.far.trip(next(iter(rig.file.faults), 100 if rig.file.flags else 198))
        rig.pass_time(1.0)
        assert not rig.drive.following
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
        rig.pass_time(2.0)
        assert not rig.turns and not rig.far.faults
        assert not rig.notes.said(Cause.DRIVER_ERROR), rig.notes.events


def test_a_fault_with_a_number_that_the_driver_needs_is_renumbered(tmp_path: Path) -> None:
    with DescribedRig(described(tmp_path)) as rig:
        rig.connect()
        rig.far.trip(1195)
        rig.pass_time(0.5)
        assert rig.drive.snapshot.text == 'odd' and rig.drive.snapshot.status.code == 1195


def test_a_fault_that_the_file_does_not_list_is_shown_by_its_number(tmp_path: Path) -> None:
    file = described(tmp_path, faults={'register': 21, 'codes': {1: {'text': 'hot'}}})
    with DescribedRig(file) as rig:
        rig.connect()
        rig.far.trip(77)
        rig.pass_time(0.5)
        shown = rig.drive.snapshot
        assert shown.text == 'Fault 77' and shown.status.faulted and shown.requires_ack
        assert shown.remedy == 'Look at its keypad which one it is, and remove its cause'


_HOT: dict[str, Any] = {'register': 21, 'codes': {3: {'text': 'hot'}}}


@pytest.mark.parametrize(
    ('faults', 'code', 'listed'),
    [
        (_HOT, 0, '3'), (_HOT, 0x10000, '3'), ({**_HOT, 'bits': [0, 3]}, 16, '3'),
        (ODD['faults as bits']['faults'], 99, '100, 101'),
    ],
)
def test_a_fault_that_the_status_cannot_show_is_not_simulated(
    tmp_path: Path, faults: dict[str, Any], code: int, listed: str
) -> None:
    with DescribedRig(described(tmp_path, faults=faults)) as rig:
        with pytest.raises(ValueError, match=listed):
            rig.far.trip(code)
        assert not rig.far.faults


def test_the_speed_follows_from_the_frequency_where_only_pole_pairs_are_known(
    tmp_path: Path,
) -> None:
    for name, motor in (('known', {'pole_pairs': 3}), ('unknown', {})):
        path = tmp_path / name
        path.mkdir()
        with DescribedRig(described(path, motor=motor)) as rig:
            rig.connect(parameters=True)
            rig.enable()
            rig.follow(20.0)
            speed = rig.drive.snapshot.speed
            assert speed == pytest.approx(400.0, rel=0.03) if motor else math.isnan(speed)
            assert not motor or rig.far.motor.plate.pole_pairs == 3


def test_a_number_that_means_none_is_no_value(tmp_path: Path) -> None:
    measured = {
        **PLAIN['measured'],
        'motor_temperature': {'register': 25, 'none': 0},
        'output_current': {'register': 26, 'factor': 0.1, 'none': 0x7FFF},
    }
    with DescribedRig(described(tmp_path, measured=measured), telemetry_rate=5.0) as rig:
        rig.connect()
        rig.pass_time(1.0)
        values = rig.notes.telemetry[-1].values
        assert math.isnan(values[Role.MOTOR_TEMPERATURE]) and values[Role.OUTPUT_CURRENT] == 0
        assert not rig.notes.said(Cause.IMPOSSIBLE_VALUE)


def test_exceptions_have_the_texts_of_the_file_and_what_is_busy_is_asked_again(
    tmp_path: Path,
) -> None:
    line = {'exceptions': {0x22: 'parameters are locked', 0x30: 'later'}, 'busy': [0x30]}
    with DescribedRig(described(tmp_path, line=line)) as rig:
        rig.connect(parameters=True)
        left = [0x22, 0x22, 0x30]

        def refuse(key: str) -> None:
            if key == 'ramp.accel' and left:
                raise Refused(left.pop(), 'as the test says')  # type: ignore[arg-type]

        rig.far.control_unit.validate = refuse  # type: ignore[method-assign]
        answer = rig.answer(rig.drive.parameters.change({'ramp.accel': 7.0}))
        assert 'parameters are locked (exception 34)' in answer
        left.clear()
        left.append(0x30)
        rig.result(rig.drive.parameters.change({'ramp.accel': 7.0}))
        assert rig.far.peek('ramp.accel') == 7.0 and not left


@pytest.mark.parametrize(('code', 'goes_on'), [(0x30, True), (0x22, False)])
def test_the_codes_of_the_file_count_for_set_points_too(
    tmp_path: Path, code: int, goes_on: bool
) -> None:
    line = {'exceptions': {0x22: 'parameters are locked', 0x30: 'later'}, 'busy': [0x30]}
    with DescribedRig(described(tmp_path, line=line)) as rig:
        rig.turn()
        left = [code] * 5

        def refuse(key: str) -> None:
            if key == 'line.setpoint' and left:
                raise Refused(left.pop(), 'as the test says')  # type: ignore[arg-type]

        rig.far.control_unit.validate = refuse  # type: ignore[method-assign]
        rig.send(10.0)
        rig.pass_time(1.0)
        assert rig.drive.following is goes_on
        if not goes_on:
            assert rig.notes.said('parameters are locked (exception 34)')


def test_what_makes_a_setting_take_effect_is_written_after_it(tmp_path: Path) -> None:
    after = [{'register': 50, 'value': 1}]
    with DescribedRig(described(tmp_path, after_write=after)) as rig:
        rig.connect(parameters=True)
        rig.result(rig.drive.parameters.change({'ramp.accel': 7.0}))
        written = [key for _, key, data in rig.asked if data is not None]
        assert written[-2:] == ['ramp.accel', 'line.r0032']


def test_a_drive_may_need_time_before_a_setting_is_made_to_take_effect(tmp_path: Path) -> None:
    after = [
        {'wait': 0.2}, {'register': 50, 'value': 1}, {'wait': 0.05}, {'register': 50, 'value': 0},
    ]
    with DescribedRig(described(tmp_path, after_write=after)) as rig:
        rig.connect(parameters=True)
        at: dict[str, list[float]] = {}

        def meet(key: str, data: bytes | None) -> None:
            if data is not None:
                at.setdefault(key, []).append(rig.clock.now)

        rig.meet = meet
        rig.result(rig.drive.parameters.change({'ramp.accel': 7.0}))
        enter = at['line.r0032']
        assert 0.2 <= enter[0] - at['ramp.accel'][-1] < 0.4
        assert 0.05 <= enter[1] - enter[0] < 0.2
        rig.enable()
        rig.follow(20.0)


def test_what_is_written_by_an_enable_takes_effect_too(tmp_path: Path) -> None:
    parameters = {
        **PLAIN['parameters'],
        'source.command': {'register': 51, 'choices': {0: 'Keypad', 1: 'Net'}, 'default': 'Keypad'},
        'serial.timeout': {'register': 52, 'factor': 0.1, 'unit': 's', 'default': 0},
    }
    requires = [{'parameter': 'source.command', 'value': 'Net', 'write': True}]
    file = described(
        tmp_path, after_write=[{'register': 50, 'value': 1}], parameters=parameters,
        control={**PLAIN['control'], 'requires': requires}, timeout={'parameter': 'serial.timeout'},
    )
    with DescribedRig(file, drive_timeout=2.0) as rig:
        rig.connect(parameters=True)
        rig.enable()
        written = [key for _, key, data in rig.asked if data is not None]
        for key in ('source.command', 'serial.timeout'):
            assert written[written.index(key) + 1] == 'line.r0032', written


@pytest.mark.parametrize('poll_rate', [10.0, 50.0])
@pytest.mark.parametrize('lasts', [0.15, 0.3, 0.5, 0.9])
def test_a_take_over_by_the_keypad_is_noticed_however_short_it_is(
    tmp_path: Path, lasts: float, poll_rate: float
) -> None:
    file = described(tmp_path, **ODD['a parameter tells who has control'])
    ramps = {'ramp.accel': 1.0, 'ramp.decel': 1.0}
    with DescribedRig(file, parameters=ramps, poll_rate=poll_rate) as rig:
        rig.connect()
        for wait in (0.1, 0.4, 0.7):
            rig.enable()
            rig.follow(20.0)
            rig.pass_time(wait)
            rig.far.set_from_keypad('source.command', 'Keypad')
            rig.pass_time(lasts)
            rig.far.set_from_keypad('source.command', 'Bus')
            rig.pass_time(4.0)
            assert not rig.drive.following and not rig.turns
            assert rig.drive.snapshot.stop_reason is StopReason.CONTROL_TAKEN


def test_one_reading_that_another_has_control_is_read_again_and_stops_no_motor(
    tmp_path: Path,
) -> None:
    file = described(tmp_path, **ODD['a parameter tells who has control'])
    with DescribedRig(file) as rig:
        rig.connect()
        rig.enable()
        rig.follow(20.0)
        read: list[str] = []

        def misread(key: str, data: bytes | None) -> None:
            read.append(key)
            is_first = key == 'source.command' and read.count(key) == 1
            rig.far.memory.set('source.command', 'Keypad' if is_first else 'Bus')

        rig.meet = misread
        rig.pass_time(1.5)
        first = read.index('source.command')
        assert read[first + 1] == 'source.command'
        assert rig.drive.following and rig.turns
        assert not rig.notes.said(Cause.STOPPED_BECAUSE)


def test_a_change_at_the_keypad_is_said_and_one_of_the_driver_is_not(tmp_path: Path) -> None:
    parameters = {
        **PLAIN['parameters'],
        'source.command': {'register': 51, 'choices': {0: 'Keypad', 1: 'Net'}, 'default': 'Keypad'},
    }
    requires = [{'parameter': 'source.command', 'value': 'Net', 'write': True}]
    control = {**PLAIN['control'], 'requires': requires}
    with DescribedRig(described(tmp_path, parameters=parameters, control=control)) as rig:
        rig.connect(parameters=True)
        rig.enable()
        rig.pass_time(12.0)
        assert rig.drive.parameters.values['source.command'] == 'Net'
        assert not rig.notes.said(Cause.CHANGED_AT_DRIVE), rig.notes.events
        for value in ('Keypad', 'Net'):
            rig.far.set_from_keypad('source.command', value)
            rig.pass_time(12.0)
            assert rig.notes.said(f'Keypad -> {value}' if value == 'Net' else 'Net -> Keypad')


def test_what_the_file_calls_a_setting_of_the_line_is_protected(tmp_path: Path) -> None:
    parameters = {
        'line_a.address': {'register': 51, 'role': 'bus_address', 'default': 1},
        'line_a.timeout': {'register': 52, 'factor': 0.1, 'unit': 's'},
        'other.speed': {'register': 53, 'role': 'baud_rate'},
        'other.timeout': {'register': 54, 'factor': 0.1, 'unit': 's'},
    }
    file = described(tmp_path, parameters=parameters, simulated={})
    with DescribedRig(file) as rig:
        rig.connect(parameters=True)
        protected = {
            key for key in parameters
            if 'not changed unless' in rig.answer(rig.drive.parameters.change({key: 3}))
        }
        assert protected == {'line_a.address', 'line_a.timeout', 'other.speed'}


def test_the_stop_mode_says_whether_a_stop_coasts(tmp_path: Path) -> None:
    parameters = {
        **PLAIN['parameters'],
        'stop.mode': {'register': 51, 'choices': {0: 'Ramp', 1: 'Coast'}, 'default': 'Coast'},
    }
    control = {**PLAIN['control'], 'stop_mode': {'parameter': 'stop.mode', 'coasts': 'Coast'}}
    file = described(tmp_path, parameters=parameters, control=control)
    with DescribedRig(file, parameters={'ramp.decel': 5.0}) as rig:
        rig.connect()
        rig.enable()
        rig.follow(20.0)
        assert rig.answer(rig.drive.stop()).startswith(('stopping: it coasts', 'stopped ('))
        assert not rig.far.motor.driven and rig.far.motor.turning
        rig.pass_time(30.0)
        rig.far.set_from_keypad('stop.mode', 'Ramp')
        rig.enable()
        rig.follow(20.0)
        assert rig.answer(rig.drive.stop()).startswith('stopping: it ramps down')


def test_its_own_time_out_is_set_and_stops_it_when_the_driver_is_gone(tmp_path: Path) -> None:
    parameters = {
        **PLAIN['parameters'],
        'serial.timeout': {'register': 52, 'factor': 0.1, 'unit': 's'},
        'serial.action': {'register': 53, 'choices': {0: 'Nothing', 1: 'Warn', 2: 'Stop'}},
    }
    timeout = {
        'parameter': 'serial.timeout', 'action': {'parameter': 'serial.action', 'stops': 'Stop'},
    }
    file = described(tmp_path, parameters=parameters, timeout=timeout)
    with DescribedRig(file, drive_timeout=2.0) as rig:
        rig.connect()
        rig.enable()
        assert (rig.far.peek('serial.timeout'), rig.far.peek('serial.action')) == (2.0, 'Stop')
        rig.follow(20.0)
        rig.kill()
        rig.line.go_to(rig.clock.now + 10.0)
        assert not rig.far.motor.turning
        rig.begin()
        rig.connect()


#: A time-out that stops the motor only if three other settings are so.
WITH_CONDITIONS: dict[str, Any] = {
    'parameters': {
        **PLAIN['parameters'],
        'serial.timeout': {'register': 52, 'factor': 0.1, 'unit': 's', 'default': 6},
        'serial.action': {
            'register': 53, 'name': 'C1', 'choices': {0: 'Warn', 1: 'Ramp', 2: 'Coast'},
        },
        'serial.detection': {'register': 54, 'name': 'C2', 'choices': {0: 'OFF', 1: 'ON'}},
        'serial.watches': {'register': 55, 'name': 'C3', 'maximum': 9},
    },
    'timeout': {
        'parameter': 'serial.timeout',
        'action': {'parameter': 'serial.action', 'stops': ['Ramp', 'Coast']},
        'requires': [
            {'parameter': 'serial.detection', 'value': 'ON'},
            {'parameter': 'serial.watches', 'values': [2, 3]},
        ],
    },
}
ALL_MET = {'serial.action': 'Coast', 'serial.detection': True, 'serial.watches': 3}


def runs_on_after_a_kill(rig: DescribedRig) -> bool:
    """Return whether the motor of a driver that is killed turns after its drive's time-out."""
    rig.follow(20.0)
    rig.kill()
    rig.line.go_to(rig.clock.now + 10.0)
    return rig.turns


@pytest.mark.parametrize(
    ('unmet', 'said', 'sets'),
    [
        ({}, '', {}),
        ({'serial.action': 'Warn'}, 'C1 = Warn', {'serial.action': 'Ramp'}),
        ({'serial.detection': False}, 'C2 = OFF', {'serial.detection': True}),
        ({'serial.watches': 7}, 'C3 = 7', {'serial.watches': 2}),
        (
            {'serial.action': 'Warn', 'serial.detection': False, 'serial.watches': 0},
            'C1 = Warn, C2 = OFF, C3 = 0',
            {'serial.action': 'Ramp', 'serial.detection': True, 'serial.watches': 2},
        ),
    ],
)
def test_a_time_out_stops_the_motor_only_if_all_that_it_depends_on_is_so(
    tmp_path: Path, unmet: dict[str, Any], said: str, sets: dict[str, Any]
) -> None:
    file = described(tmp_path, **WITH_CONDITIONS)
    found = {'serial.timeout': 6.0, **ALL_MET, **unmet}
    # by default it is the owner's choice, and what follows of it is said
    with DescribedRig(file, parameters=found, drive_timeout=AS_THE_DRIVE_CAN) as rig:
        rig.connect()
        warned = rig.notes.said(Cause.OWN_TIMEOUT_STOPS_NOTHING, Severity.WARNING)
        assert warned == bool(unmet) and (not warned or rig.notes.said(f'({said})'))
        rig.enable()
        assert rig.notes.said(Cause.OWN_TIMEOUT_SET) == (not unmet)
        assert runs_on_after_a_kill(rig) == bool(unmet)
        assert {key: rig.far.peek(key) for key in ALL_MET} == {**ALL_MET, **unmet}
    # asked for, it is set; a choice of the owner by which it stops is left
    with DescribedRig(file, parameters=found, drive_timeout=2.0) as rig:
        rig.connect()
        rig.enable()
        assert rig.notes.said(Cause.OWN_TIMEOUT_SET)
        assert {key: rig.far.peek(key) for key in ALL_MET} == {**ALL_MET, **sets}
        assert not runs_on_after_a_kill(rig)
        rig.begin()
        rig.connect()
        # put back, for nothing in this file gives control back
        rig.answer(rig.drive.disconnect(4.0))
        assert {key: rig.far.peek(key) for key in found} == found


def test_a_condition_that_cannot_be_read_is_not_met(tmp_path: Path) -> None:
    file = described(tmp_path, **WITH_CONDITIONS)
    found = {'serial.timeout': 6.0, **ALL_MET}
    with DescribedRig(file, parameters=found, drive_timeout=AS_THE_DRIVE_CAN) as rig:
        rig.spoil('refused', 'serial.detection', 1000, written=False)
        rig.connect()
        assert rig.notes.said('(C2 = ?)')
        rig.enable()
        assert not rig.notes.said(Cause.OWN_TIMEOUT_SET)
        rig.reset(drive_timeout=2.0)
        rig.kill()
        rig.begin()
        rig.connect()
        assert 'serial.detection' in rig.answer(rig.drive.enable())
        assert not rig.drive.following


@pytest.mark.parametrize('drive_timeout', [AS_THE_DRIVE_CAN, 2.0])
def test_a_condition_that_changes_meanwhile_is_noticed_by_the_next_enable(
    tmp_path: Path, drive_timeout: float
) -> None:
    file = described(tmp_path, **WITH_CONDITIONS)
    found = {'serial.timeout': 6.0, **ALL_MET}
    with DescribedRig(file, parameters=found, drive_timeout=drive_timeout) as rig:
        rig.connect(parameters=True)
        rig.enable()
        rig.answer(rig.drive.stop())
        assert not rig.notes.said(Cause.OWN_TIMEOUT_STOPS_NOTHING)
        rig.far.set_from_keypad('serial.detection', False)
        rig.pass_time(15.0)
        rig.enable()
        left = drive_timeout == AS_THE_DRIVE_CAN
        assert rig.notes.said(Cause.OWN_TIMEOUT_STOPS_NOTHING, Severity.WARNING) == left
        assert rig.far.peek('serial.detection') is not left
        assert runs_on_after_a_kill(rig) == left


#: What a shipped drive is set to, and whether the motor runs on after a kill.
@pytest.mark.parametrize(
    ('name', 'found', 'stops'),
    [
        ('schneider_atv12', {'serial.fault': 'Ignore'}, False),
        ('schneider_atv12', {'serial.fault': 'Speed kept'}, False),
        ('schneider_atv12', {}, True),
        ('schneider_atv12', {'serial.fault': 'Fast stop'}, True),
        ('yaskawa_v1000', {'serial.fault': 'Continue'}, False),
        ('yaskawa_v1000', {'serial.fault': 'Coast', 'serial.detection': 'Disabled'}, False),
        ('yaskawa_v1000', {'serial.fault': 'Coast'}, True),
        ('yaskawa_v1000', {'serial.fault': 'Fast stop'}, True),
        ('delta_ms300', {'serial.fault': 'Coast'}, True),
        ('delta_vfd_el', {'serial.fault': 'Coast'}, True),
        ('danfoss_fc101', {'serial.fault': 'Stop and trip'}, True),
        ('danfoss_fc101', {'serial.fault': 'Freeze output'}, False),
    ],
)
def test_a_shipped_drive_that_does_not_stop_by_itself_is_not_told_to(
    name: str, found: dict[str, Any], stops: bool
) -> None:
    settings = {'serial.timeout': 6.0, **found}
    for timeout in (AS_THE_DRIVE_CAN, 2.0):
        with DescribedRig(SHIPPED[name], parameters=settings, drive_timeout=timeout) as rig:
            rig.connect()
            rig.enable()
            sure = stops or timeout > 0
            assert rig.notes.said(Cause.OWN_TIMEOUT_SET) == sure
            if stops and found:
                assert rig.far.peek('serial.fault') == found['serial.fault']
            assert runs_on_after_a_kill(rig) != sure


def test_a_drive_that_ignores_commands_in_local_is_not_taken_for_enabled(tmp_path: Path) -> None:
    for what in ('ignores', 'refuses'):
        status = ODD['the status tells who has control']['status']
        with DescribedRig(
            described(tmp_path, status=status), options={'in_local': what}
        ) as rig:
            rig.connect()
            unit = rig.far.control_unit
            unit.local = True  # type: ignore[attr-defined]
            answer = rig.answer(rig.drive.enable())
            assert not rig.drive.following and not rig.turns, answer
            unit.local = False  # type: ignore[attr-defined]
            rig.pass_time(0.5)
            rig.enable()
            rig.follow(20.0)
            unit.local = True  # type: ignore[attr-defined]
            rig.far.control_unit.settle()
            rig.pass_time(1.0)
            assert not rig.drive.following


@pytest.mark.parametrize(('drives', 'poll_rate'), [(1, 50.0), (1, 5.0), (1, 0.5), (4, 20.0)])
def test_a_run_command_that_survives_starts_no_motor_when_the_power_is_back(
    tmp_path: Path, drives: int, poll_rate: float
) -> None:
    # the ramp is so short that no poll finds the motor slower than before
    file = described(tmp_path, keeps_run=True)
    for number, off in enumerate((0.4, 0.45, 0.5, 0.7, 0.95, 2.0)):
        with DescribedRig(file, drives=drives, poll_rate=poll_rate) as rig:
            rig.turn()
            rig.pass_time(0.037 * number)
            rig.far.power_cycle(off)
            # a drive that is lost is tried twice a second
            rig.pass_time(off + (0.4 if off < 1 else 1.0))
            assert not rig.drive.following, off
            assert not rig.turns, off
            stopped = Cause.MAY_HAVE_RESTARTED if off < 1 else Cause.LOST
            assert rig.notes.said(stopped), rig.notes.events
            assert all(drive.following for address, drive in rig.drives.items() if address > 1)
    with DescribedRig(file, poll_rate=poll_rate) as rig:
        rig.turn()
        rig.far.power_cycle(0.5)
        rig.pass_time(1.5)
        rig.assert_only_enable_helps()


@pytest.mark.parametrize(('drives', 'poll_rate'), [(1, 50.0), (1, 0.5), (4, 20.0)])
def test_a_lost_answer_stops_no_motor_whose_run_command_survives(
    tmp_path: Path, drives: int, poll_rate: float
) -> None:
    file = described(tmp_path, keeps_run=True)
    for what in ('drop', 'unheard', 'damage'):
        with DescribedRig(file, drives=drives, poll_rate=poll_rate) as rig:
            rig.turn()
            for key in ('line.status', 'measured.actual_frequency', 'line.setpoint'):
                rig.spoil(what, key, written=key == 'line.setpoint')
                rig.send(20.0 if rig.drive.snapshot.setpoint < 20 else 19.5)
                rig.pass_time(1.1)
            assert rig.drive.following and rig.turns, (poll_rate, what, rig.notes.events)


def test_a_driver_that_stood_still_stops_a_motor_whose_run_command_survives(
    tmp_path: Path,
) -> None:
    with DescribedRig(described(tmp_path, keeps_run=True)) as rig:
        rig.turn()
        rig.clock.now += 1.5
        rig.pass_time(0.3)
        assert rig.notes.said(Cause.MAY_HAVE_RESTARTED), rig.notes.events
        assert not rig.drive.following
