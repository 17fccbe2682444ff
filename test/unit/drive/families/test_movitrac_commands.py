# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What commands ask of a MOVITRAC 31; and its PC time-out strikes when the driver dies alone."""

from __future__ import annotations

import dataclasses
from typing import Any

from movitrac import DIRECTIONS, OVERCURRENT, REMOTE, STOPS, bits, make, succeeded, switched
import pytest
from support.rig import Rig

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.simulator.movitrac31.commands import CONTROL_MODE
from nfo_sinus_driver.simulator.movitrac31.parameters import Bit, Mode

KEY = 'serial.pc_timeout'
#: P600 to P609 of terminals that only an option card has, P760 and P880 likewise.
CARDS = {
    row.key for row in load_family('movitrac31').values()
    if row.at('movitrac').index in (153, 154, 155, 156, 321, 322, 323, 249, 212)
}


def asked_by_enable(rig: Rig) -> list[str]:
    """Enable and stop; return what was asked for or written by the enable."""
    before, done = len(rig.asked), []
    enable = rig.drive.enable()
    enable.add_done_callback(lambda _: done.append(len(rig.asked)))
    assert 'enabled' in rig.answer(enable)
    asked = [key for _, key, _ in rig.asked[before : done[0]]]
    assert succeeded(rig, rig.drive.stop())
    return asked


@pytest.mark.parametrize(('settings', 'most'), [({}, 39), (REMOTE, 32)], ids=['P841', 'mine'])
def test_an_enable_asks_little_of_a_drive_whose_settings_were_read(
    settings: dict[str, Any], most: int
) -> None:
    with Rig('movitrac', parameters=settings, telemetry_rate=0.0, poll_rate=0.1) as rig:
        rig.connect()
        rig.result(rig.drive.parameters.read())
        asked = asked_by_enable(rig)
        assert len(asked) <= most, asked
        assert not CARDS & set(asked)


def test_a_card_that_was_fitted_meanwhile_is_read_again() -> None:
    with make(parameters={'terminal.input_48': 'CW/Stop'}) as rig:
        rig.connect()
        rig.result(rig.drive.parameters.read())
        assert not CARDS & set(asked_by_enable(rig))
        unit = rig.far.control_unit
        unit.variant = dataclasses.replace(unit.variant, option_card='fio')
        unit.terminals.inputs += (48, 49, 50, 51, 52, 53, 54)
        # a card is fitted while the drive has no power
        rig.far.power_cycle(5.0)
        rig.pass_time(10.0)
        assert rig.drive.snapshot.connected
        unit.switch(48, True)
        assert 'terminal 48 (CW/Stop) is closed' in rig.answer(rig.drive.enable())


def test_one_refusal_is_not_believed_of_a_card() -> None:
    with make() as rig:
        rig.connect()
        assert set(asked_by_enable(rig)) >= CARDS
        assert set(asked_by_enable(rig)) >= CARDS
        assert not CARDS & set(asked_by_enable(rig))


def test_an_enable_is_refused_with_the_reason() -> None:
    wrong = {}
    for settings, terminal, closed, reason in (
        ({}, 41, True, 'terminal 41 (CW/Stop) is closed'),
        ({}, 42, True, 'terminal 42 (CCW/Stop) is closed'),
        ({}, 43, False, 'terminal 43 (Enable/Stop) is open'),
        ({'serial.manual_operation': True}, 0, False, 'P870'),
        ({'special.parameter_lock': True}, 0, False, 'P800'),
        ({'frequency.f_min_1': 5.0}, 0, False, 'set frequency.f_min_1 to 0'),
    ):
        with make(parameters=settings) as rig:
            rig.connect()
            if terminal:
                rig.far.control_unit.switch(terminal, closed)
            answer = rig.answer(rig.drive.enable())
            rig.send(20.0)
            rig.pass_time(1.0)
            found = (
                reason in answer, rig.drive.following, bool(bits(rig) & DIRECTIONS),
                round(rig.far.memory.number(CONTROL_MODE)),
                bool(rig.written('serial.control_mode')) and 'P800' not in reason,
            )
            if found != (True, False, False, Mode.STANDARD, False):
                wrong[reason] = answer, found
    assert not wrong


@pytest.mark.parametrize(('closed', 'left'), [(False, Mode.STANDARD), (True, Mode.REMOTE_SETPOINT)])
def test_an_enable_that_fails_half_way_leaves_p841_as_it_was_unless_the_motor_could_start(
    closed: bool, left: Mode
) -> None:
    with make() as rig:
        rig.connect()
        # left behind by another master, and ignored with P841 = Standard
        rig.far.memory.put('fieldbus.function_bits', Bit.ENABLE | Bit.CW)
        rig.far.memory.put('fieldbus.remote_setpoint', 2000)

        def meet(key: str, data: bytes | None) -> str | None:
            if key == CONTROL_MODE and data is not None and closed:
                rig.far.control_unit.switch(41, True)
            sets = key == 'fieldbus.remote_setpoint' and data is not None
            return 'refused' if sets else None

        rig.meet = meet
        assert not succeeded(rig, rig.drive.enable())
        rig.meet = lambda key, data: None
        rig.far.control_unit.switch(41, False)
        rig.pass_time(3.0)
        assert round(rig.far.memory.number(CONTROL_MODE)) == left
        assert not rig.turns
        assert rig.notes.said(Cause.STORED)


@pytest.mark.parametrize(('settings', 'most'), [
    ({'frequency.f_max_1': 30.0}, 30.0),
    ({'frequency.vf_pattern_1': 'V/f pattern 3', 'frequency.f_max_3': 35.0}, 35.0),
])
def test_a_set_point_beyond_fmax_is_shown_as_clamped(
    settings: dict[str, Any], most: float
) -> None:
    with make(parameters=settings, setpoint_max=60.0) as rig:
        rig.turn()
        for asked, given in ((50.0, most), (-50.0, -most), (25.0, 25.0)):
            rig.send(asked)
            rig.pass_time(2.0)
            snapshot = rig.drive.snapshot
            assert (snapshot.setpoint, snapshot.setpoint_clamped) == (given, asked != given)
            assert rig.far.motor.frequency == pytest.approx(given, abs=0.1)
        assert rig.notes.said(f'is limited to {most:g} (setpoint_max, or')


@pytest.mark.parametrize(
    ('card', 'settings', 'reason'),
    [
        ('fen', {'control.operating_mode': 'Positioning control'}, 'P770'),
        ('frs', {'control.synchronous_operation': True}, 'P760'),
        ('fea', {'serial.master_slave': True}, 'P880'),
    ],
)
def test_an_enable_is_refused_in_another_operating_mode(
    card: str, settings: dict[str, Any], reason: str
) -> None:
    with Rig('movitrac', options={'option_card': card}, parameters=settings) as rig:
        # a slave hears nothing on RS-485; what the simulated line does is tested elsewhere
        rig.far.control_unit.hears = lambda *line: True
        rig.connect()
        assert reason in rig.answer(rig.drive.enable())
        assert not rig.drive.following


@pytest.mark.parametrize(('enable_bit', 'at_once'), [
    ('anded', True), ('ored', False), ('either', False),
])
def test_a_rapid_stop_takes_the_enable_and_says_whether_the_drive_takes_its_stop_ramp(
    enable_bit: str, at_once: bool
) -> None:
    ramps = {'ramp.t11_down': 4.0, 'ramp.t13_stop': 0.5}
    with make(parameters=ramps, options={'enable_bit': enable_bit}) as rig:
        rig.turn(40.0)
        answer = rig.answer(rig.drive.rapid_stop())
        assert ('by its stop ramp' in answer, 'its ordinary ramp' in answer) == (
            at_once, not at_once
        )
        rig.pass_time(1.0)
        assert (rig.far.motor.frequency == 0) is at_once
        assert not rig.drive.following and not bits(rig) & (DIRECTIONS | Bit.ENABLE)
        rig.pass_time(4.0)
        rig.assert_only_enable_helps()


def test_the_last_five_faults_are_shown_newest_first() -> None:
    with make() as rig:
        rig.connect()
        for fault in (101, 107, 106, 145, 103, 101):
            rig.far.trip(fault)
            rig.far.control_unit.reset()
        log = rig.result(rig.drive.error_log())
        assert [entry.code for entry in log] == [101, 103, 145, 106, 107]
        assert [entry.text for entry in log[:2]] == ['Overcurrent', 'Brake chopper']


def test_a_fault_is_shown_with_what_the_drive_has_kept_of_it() -> None:
    with make() as rig:
        rig.turn()
        rig.far.trip(OVERCURRENT)
        (entry,) = rig.result(rig.drive.error_log())
        kept = rig.far.control_unit._fault_memory.raw
        # what the two words mean is not certain [C77]
        status = f'inverter status {kept("status.fault_t0_inverter_status"):08X}h'
        terminals = f'terminals {kept("status.fault_t0_terminal_status"):08X}h'
        assert entry.readings[0].startswith('DC link ') and 'frequency 20 Hz' in entry.readings
        assert entry.readings[-2:] == (status, terminals)
        assert entry.full_text.startswith('Overcurrent (DC link ')


def test_a_fault_code_with_decimals_is_an_unknown_code() -> None:
    with make() as rig:
        rig.connect()
        memory = rig.far.control_unit._fault_memory
        raw = memory.raw
        memory.raw = lambda key: 45 if key == 'status.fault_t0' else raw(key)
        log = rig.result(rig.drive.error_log())
        assert [(entry.code, entry.text) for entry in log] == [(255, 'unknown code (raw 45)')]


# --- 8 bytes, and a sign --------------------------------------------------------------------------


def test_a_setting_of_8_bytes_is_read_and_written() -> None:
    key = 'control.frs_master_gear_ratio'
    with make(options={'option_card': 'frs'}) as rig:
        rig.connect(parameters=True)
        assert rig.drive.parameters.values[key] == 1
        rig.result(rig.drive.parameters.change({key: 100_000}))
        assert rig.far.memory.get(key) == rig.drive.parameters.values[key] == 100_000
        # the example of [M4 §3.3] in a LONG_SELECT [C106]
        sent = [frame['hex'].upper() for frame in rig.line.frames]
        assert [text for text in sent if text.startswith('AD')] == ['AD0101070000000108060A00CF']
        assert '0 is out of range' in rig.answer(rig.drive.parameters.change({key: 0}))


@pytest.mark.parametrize('sign', ['f', '8', '1'])
def test_a_negative_value_is_read_however_the_drive_shows_its_sign(sign: str) -> None:
    with make(options={'negative_sign': sign}) as rig:
        rig.connect()
        for ambient in (-15.0, 0.0, 25.0):
            rig.far.control_unit.ambient = ambient
            assert rig.result(rig.drive.measure('status.heat_sink_temperature')) == ambient
        rig.far.control_unit.ambient = -15.0
        rig.far.trip(OVERCURRENT)
        (entry,) = rig.result(rig.drive.error_log())
        assert 'heat sink -15 °C' in entry.readings


# --- the PC time-out ------------------------------------------------------------------------------


def be_gone(rig: Rig, seconds: float) -> None:
    """End the driver without a word, and let time pass for the drive."""
    rig.kill()
    rig.line.go_to(rig.clock.now + seconds)


@pytest.mark.parametrize(('found', 'end'), [(0.0, ['disconnect']), (5.0, ['exit', 'disconnect'])])
def test_a_clean_end_leaves_the_pc_time_out_as_it_was_found(found: float, end: list[str]) -> None:
    with make(parameters={KEY: found}, drive_timeout=1.5) as rig:
        rig.turn()
        assert rig.far.memory.number(KEY) == 1.5
        # set again and changed: what was found stays what it was
        rig.answer(rig.drive.set_drive_timeout(2.0))
        for name in end:
            assert succeeded(rig, STOPS[name](rig.drive)), name
        assert rig.far.memory.number(KEY) == found
        assert rig.notes.said(Cause.OWN_TIMEOUT_LEFT, Severity.WARNING) == bool(found)
        be_gone(rig, 20.0)
        assert bool(rig.far.faults) == bool(found)


def test_a_clean_end_turns_the_pc_time_out_off_when_the_motor_has_stopped() -> None:
    with make(drive_timeout=1.5) as rig:
        rig.turn()
        frequencies: list[float] = []

        def meet(key: str, data: bytes | None) -> None:
            if key == KEY and data is not None:
                frequencies.append(rig.far.motor.frequency)

        rig.meet = meet
        assert succeeded(rig, rig.drive.disconnect(5.0))
        assert frequencies == [0.0]


def test_a_clean_end_during_a_long_ramp_leaves_no_fault() -> None:
    with make(parameters={'ramp.t11_down': 60.0}, drive_timeout=1.5) as rig:
        rig.turn()
        assert succeeded(rig, rig.drive.disconnect(0.5))
        be_gone(rig, 1.0)
        assert rig.far.motor.frequency > 10
        be_gone(rig, 60.0)
        assert not rig.far.faults and not rig.far.motor.turning


@pytest.mark.parametrize('seconds', [0.0, 4.0])
def test_a_pc_time_out_that_another_has_set_is_left_alone(seconds: float) -> None:
    with make(drive_timeout=1.5) as rig:
        rig.turn()
        rig.far.set_from_keypad(KEY, seconds)
        rig.pass_time(1.0)
        assert succeeded(rig, rig.drive.disconnect(1.0))
        assert len(rig.written(KEY)) == 1 and rig.far.memory.number(KEY) == seconds


def test_a_pc_time_out_that_cannot_be_ended_is_reported() -> None:
    with make(drive_timeout=1.5) as rig:
        rig.turn()
        rig.far.set_from_keypad('special.parameter_lock', True)
        # the motor stands all the same
        assert succeeded(rig, rig.drive.disconnect(1.0))
        assert rig.far.motor.frequency == 0
        assert rig.notes.said(Cause.OWN_TIMEOUT_LEFT, Severity.WARNING)


def test_a_drive_that_answers_late_is_followed_all_the_same() -> None:
    with make(
        parameters={'serial.response_time': 200.0}, drive_timeout=3.0,
        line={'response_timeout': 0.5},
    ) as rig:
        rig.turn()
        rig.pass_time(30.0)
        assert rig.drive.following and not rig.far.faults
        assert succeeded(rig, rig.drive.stop())


@pytest.mark.parametrize('number', [1, 2])
def test_a_setting_that_needs_another_is_refused_without_it_and_taken_with_it(number: int) -> None:
    hoist, needed = f'control.hoist_{number}', f'special.four_quadrant_{number}'
    with Rig('movitrac') as rig:
        change = rig.connect(parameters=True).drive.parameters.change
        assert hoist in rig.answer(change({hoist: True}))
        assert not rig.far.memory.raw(hoist)
        rig.result(change({needed: True}))
        rig.result(change({hoist: True}))
        assert rig.far.memory.raw(hoist) and rig.far.memory.raw(needed)
        assert 'hoist' in rig.answer(change({needed: False}))
        assert rig.far.memory.raw(needed)


@pytest.mark.parametrize('needs', ['output_off', 'inhibit'])
def test_a_setting_that_needs_a_released_motor_is_taken_after_what_its_refusal_says(
    needs: str
) -> None:
    with switched({'settings_need': needs}) as rig:
        rig.turn()
        change = rig.drive.parameters.change
        assert 'call ~/quick_stop, then change it' in rig.answer(change({'ramp.t11_up': 2.0}))
        assert rig.drive.following
        rig.result(rig.drive.quick_stop())
        rig.result(change({'ramp.t11_up': 2.0}))
        assert rig.far.memory.number('ramp.t11_up') == 2.0


@pytest.mark.parametrize('turned', [False, True])
@pytest.mark.parametrize(('before', 'after'), [
    ({}, {'control.hoist_1': True, 'special.four_quadrant_1': True}),
    ({'special.four_quadrant_1': True, 'control.hoist_1': True},
     {'control.hoist_1': False, 'special.four_quadrant_1': False}),
    ({'control.dc_braking_2': True},
     {'control.dc_braking_2': False, 'special.four_quadrant_2': True, 'control.hoist_2': True}),
    ({'motor.size_up_1': True}, {'motor.size_up_1': False, 'control.rapid_start_1': True}),
    ({'special.parameter_lock': True}, {'special.parameter_lock': False, 'ramp.t11_up': 2.0}),
])
def test_settings_that_depend_on_each_other_are_taken_in_any_order(
    before: dict[str, Any], after: dict[str, Any], turned: bool
) -> None:
    with Rig('movitrac', parameters=before) as rig:
        change = rig.connect(parameters=True).drive.parameters.change
        rig.result(change(dict(reversed(after.items())) if turned else after))
        assert {key: rig.far.memory.get(key) for key in after} == after


def test_settings_that_exclude_each_other_are_refused_together() -> None:
    both = {'special.four_quadrant_1': True, 'control.dc_braking_1': True}
    with Rig('movitrac') as rig:
        answer = rig.answer(rig.connect(parameters=True).drive.parameters.change(both))
        assert 'exclude each other' in answer
        assert not any(rig.far.memory.raw(key) for key in both)
