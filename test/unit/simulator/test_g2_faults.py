# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Faults of a G2, their acknowledgement, a bus that falls silent, and tuning [M0 table 18]."""

import pytest

from nfo_sinus_driver.catalog import Kind, load_family
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.sinus.control_unit import SinusVariant
from nfo_sinus_driver.simulator.sinus_g2.state_machine import PROCEDURES, TRIES

MODEL = load_family('sinus_g2')
FAULTS = [code for code in range(48) if MODEL.status_code(code).kind is Kind.FAULT]
SERIAL = {14, 15}
KEEPS = {'run_command_in_fault': 'keeps'}


def acknowledge(bench):
    return bench.read('fieldbus.inv_st_with_ack')


def test_every_fault_stops_the_motor_shows_and_drops_or_keeps_the_run_command(make_bench):
    for code in FAULTS:
        for variant in ({}, KEEPS):
            bench = make_bench(**variant)
            bench.run(20, 2)
            bench.drive.trip(code)
            assert (bench.running, bench.state) == (False, 'FAULT_REACTION_ACTIVE'), code
            assert bench.read('fieldbus.drive_status') & 0x8008 == 0x8008
            bench.drive.advance(0.1)
            assert (bench.state, bench.inv_st) == ('FAULTED', code)
            assert bench.read('fieldbus.drive_status') & 0x8008 == 0x0008
            assert bench.read('fieldbus.mode') == (1 if code in SERIAL else 3)
            bench.drive.advance(10)
            assert (bench.inv_st, bench.drive.motor.turning) == (code, False)
            assert (acknowledge(bench), bench.drive.control_unit.ack_reads) == (code, 1)
            bench.drive.advance(1)
            assert bench.running is (variant is KEEPS and code not in SERIAL), code
            # Sio Fail goes by MODE = Stop alone
            expected = {14: 14, 15: 24}.get(code, 39 if bench.running else 37)
            assert bench.inv_st == expected, code
    for code in (0, 24, 27, 38, 45, 99):
        with pytest.raises(ValueError, match='no fault'):
            bench.drive.trip(code)


def test_what_is_commanded_in_a_fault_is_dropped_with_the_last_fault(make_bench):
    bench = make_bench()
    bench.mode(3)
    bench.drive.trip(5)
    bench.scmd(0x101)
    bench.drive.trip(3, cause_present=True)
    acknowledge(bench)
    assert (bench.drive.control_unit.scmd, bench.drive.faults.codes) == (0x101, [3])
    bench.drive.faults.end_causes()
    assert bench.inv_st == 3, 'it is still to be acknowledged'
    acknowledge(bench)
    bench.drive.advance(1)
    assert not bench.running
    assert [entry.code for entry in bench.drive.faults.log] == [3, 5]
    bench = make_bench()
    bench.drive.control_unit.press('start')
    bench.drive.advance(1)
    assert bench.running
    bench.drive.trip(5)
    bench.drive.advance(5)
    acknowledge(bench)
    bench.drive.advance(1)
    assert not bench.running, 'what the keypad has started, too'


def test_reading_sio_err_drops_what_was_commanded_in_a_serial_fault(make_bench):
    for variant, runs in [({}, False), (KEEPS, True)]:
        bench = make_bench(**variant)
        bench.drive.trip(14)
        bench.mode(3)
        bench.scmd(0x101)
        bench.drive.read_raw('fieldbus.sio_err')
        bench.drive.advance(1)
        assert bench.running == runs


def test_without_a_fault_the_acknowledging_read_is_counted_and_drops_nothing(bench):
    bench.run(20, 5)
    assert acknowledge(bench) == 38
    bench.drive.advance(1)
    assert (bench.running, bench.drive.control_unit.ack_reads) == (True, 1)
    bench.drive.trip(3)
    for _ in range(3):
        assert bench.read('fieldbus.inv_st') == 3, 'the other read acknowledges nothing'
    assert bench.drive.control_unit.ack_reads == 1


def test_the_start_delay_runs_again_after_a_fault(make_bench):
    bench = make_bench(**KEEPS)
    bench.write('control.run_dly', 3)
    bench.run(20, 10)
    bench.drive.trip(5)
    bench.drive.advance(10)
    acknowledge(bench)
    assert bench.inv_st == 25
    bench.drive.advance(3.1)
    assert bench.running


WRITES = [
    ('fieldbus.scmd', 0), ('fieldbus.scmd', 0x101), ('status.frq_set', 0), ('control.accel', 5.0),
    ('fieldbus.mode', 1), ('fieldbus.mode', 3),
]


def test_what_is_refused_while_a_fault_is_active_is_an_option(make_bench):
    for refused, keys in (
        ('all', {key for key, _ in WRITES}), ('scmd', {'fieldbus.scmd'}), ('nothing', set()),
    ):
        bench = make_bench(refuses_in_fault=refused, **KEEPS)
        bench.run(20, 5)
        bench.drive.trip(5)
        for key, value in WRITES:
            if key in keys:
                with bench.refuses(Reason.STATE):
                    bench.write(key, value)
            else:
                bench.write(key, value)
        assert bench.inv_st == 5
        acknowledge(bench)
        bench.drive.advance(1)
        assert bench.running is (refused == 'all'), 'elsewhere MODE has taken the command back'


def test_a_variant_that_there_is_not():
    for name, _, _ in SinusVariant.options():
        with pytest.raises(ValueError, match=f'{name}: choose one of'):
            SinusVariant(**{name: 'sometimes'})


def test_sio_fail_is_acknowledged_by_mode_stop_alone(make_bench):
    bench = make_bench(refuses_in_fault='all')
    bench.run(20, 5)
    bench.drive.trip(14)
    for code in (2, 3):
        with bench.refuses(Reason.STATE):
            bench.mode(code)
    bench.mode(1)
    assert bench.inv_st == 24
    bench.mode(3)
    assert (bench.inv_st, bench.running) == (37, False)


def test_a_fault_is_acknowledged_by_the_rising_bit_of_drive_control(bench):
    bench.write('fieldbus.drive_control', 0x4006)
    for state in ('READY_TO_SWITCH_ON', 'FAULTED'):  # the second time there is no edge
        bench.drive.trip(5)
        bench.drive.advance(1)
        bench.write('fieldbus.drive_control', 0x4086)
        assert bench.state == state


def test_the_log_keeps_what_happened_when(bench):
    for code in [5] * 40 + [7]:
        bench.drive.trip(code)
        acknowledge(bench)
        bench.drive.advance(36)
    log = bench.drive.faults.log
    assert (len(log), log[0].code, log[1].code) == (32, 7, 5)
    assert log[0].op_time - log[1].op_time == pytest.approx(0.01)


def test_a_power_cycle_ends_a_fault_whose_cause_is_gone(bench):
    bench.drive.trip(5)
    bench.drive.trip(7, cause_present=True)
    for codes, inv_st in (([7], 7), ([], 24)):
        bench.drive.power_cycle(0.1)
        bench.drive.advance(1)
        assert (bench.drive.faults.codes, bench.inv_st) == (codes, inv_st)
        bench.drive.faults.end_causes()


def test_a_fault_under_the_terminals_runs_again_when_acknowledged(bench):
    bench.mode(2)
    bench.drive.advance(5)
    bench.drive.trip(5)
    bench.drive.advance(5)
    assert bench.read('fieldbus.mode') == 2
    acknowledge(bench)
    assert bench.running


# ---- SioTot and AutoStop ----


def watched(bench, *, auto_stop=True, sio_tot=2.0):
    bench.write('serial.sio_tot', sio_tot)
    bench.write('serial.auto_stop', auto_stop)
    bench.write('control.retard', 60.0)
    bench.run(20, 0.5)
    bench.drive.heard()
    return bench


def test_a_silent_bus_stops_the_motor_with_auto_stop_and_a_time(make_bench):
    bench = watched(make_bench())
    for _ in range(10):
        bench.drive.advance(1.5)
        bench.drive.heard()
    bench.drive.silence(5)  # it hears nothing either
    bench.drive.advance(1.9)
    assert bench.running
    bench.drive.advance(0.2)
    assert (bench.running, bench.inv_st, bench.read('fieldbus.mode')) == (False, 14, 1)
    bench.drive.advance(15)
    assert not bench.drive.motor.turning
    for settings in ({'auto_stop': False}, {'sio_tot': 0}):
        bench = watched(make_bench(), **settings)
        bench.drive.advance(60)
        assert (bench.inv_st, bench.read('status.frq_act')) == (38, 20), settings


def test_the_time_counts_from_taking_control(bench):
    bench.write('serial.sio_tot', 1.0)
    bench.write('serial.auto_stop', True)
    bench.mode(2)
    bench.drive.advance(10)
    assert bench.running
    bench.mode(3)
    bench.drive.advance(0.9)
    assert bench.inv_st == 40
    bench.drive.advance(0.2)
    assert bench.inv_st == 14


# ---- RstDly, TrTime and ErrCnt: the drive goes on by itself ----


def restarting(bench, code=5, tries=1):
    bench.write(TRIES[code], tries)
    bench.write('error.rst_dly', 2)
    bench.write('error.tr_time', 10)
    bench.run(20, 2)
    return bench


def test_a_fault_with_tries_ends_by_itself_and_the_motor_runs_again(make_bench):
    for code in TRIES:
        bench = restarting(make_bench(), code)
        bench.drive.trip(code, cause_present=True)
        bench.drive.advance(4)
        assert bench.inv_st == code
        bench.drive.faults.end_causes()
        bench.drive.advance(1.9)
        assert (bench.inv_st, bench.running) == (code, False), 'it counts from there'
        bench.drive.advance(0.3)
        assert (bench.inv_st, bench.running) == (39, True), code
        assert bench.drive.control_unit.ack_reads == 0
        assert [entry.code for entry in bench.drive.faults.log] == [code]


def test_no_other_fault_ends_by_itself(make_bench):
    for code in (*sorted(set(FAULTS) - set(TRIES)), 5):
        bench = restarting(make_bench(), tries=int(code != 5))
        bench.drive.trip(code)
        bench.drive.advance(4)
        assert bench.inv_st == code


def test_the_tries_are_used_up_unless_it_runs_well_for_a_while(bench):
    restarting(bench, tries=2)
    for _ in range(2):
        bench.drive.trip(5)
        bench.drive.advance(5)
        assert bench.running
    bench.drive.trip(5)
    bench.drive.advance(100)
    assert bench.inv_st == 5, 'it has used its tries up'
    acknowledge(bench)
    bench.scmd(0x101)
    bench.drive.advance(11)
    assert bench.running
    bench.drive.trip(5)
    bench.drive.advance(5)
    assert bench.running, 'it has run well for TrTime'


def test_a_control_word_needs_bit_0_low_after_a_fault_that_ended_by_itself(make_bench):
    for in_fault, state in ((0xC07F, 'SWITCH_ON_DISABLED'), (0xC07E, 'READY_TO_SWITCH_ON')):
        bench = make_bench()
        bench.write('error.overload_err_cnt', 1)
        bench.write('error.rst_dly', 2)
        bench.write('fieldbus.drive_control', 0x4006)
        bench.write('fieldbus.drive_control', 0xC07F)
        assert bench.running
        bench.drive.trip(5)
        bench.write('fieldbus.drive_control', in_fault)  # not refused: it is how it is reset
        bench.drive.advance(10)
        assert (bench.running, bench.state) == (False, state)
        bench.write('fieldbus.drive_control', 0xD07F)  # bit 12: auto init
        assert bench.running


# ---- tuning ----


def settings(bench):
    return {key: bench.drive.peek(key) for key in bench.drive.settings}


def begin(bench, code=Scmd.FULL_TUNING):
    bench.mode(3)
    bench.scmd(code)


def test_each_procedure_takes_its_time_and_changes_its_parameters(make_bench):
    for code, shown in ((0x201, 45), (0x301, 45), (0x401, 46), (0x501, 47)):
        bench = make_bench()
        before = settings(bench)
        begin(bench, code)
        assert (bench.inv_st, bench.read('fieldbus.mode')) == (28, 0)
        bench.drive.advance(PROCEDURES[code].seconds - 0.1)
        assert bench.inv_st == 28 and settings(bench) == before
        bench.drive.advance(0.2)
        assert (bench.inv_st, bench.read('fieldbus.mode')) == (shown, 3), code
        after = settings(bench)
        assert {key for key in after if after[key] != before[key]} == set(PROCEDURES[code].finds)
        assert bench.drive.writes == {}, 'it is not the bus that wrote them'
        bench.scmd(0)
        assert bench.inv_st == 37


def test_a_tuning_that_fails_is_a_fault_and_changes_nothing(bench):
    before = settings(bench)
    for code in (16, 17):
        bench.drive.control_unit.fail_tuning(code)
        begin(bench)
        bench.drive.advance(10)
        assert (bench.inv_st, bench.drive.faults.log[0].code) == (code, code)
        assert settings(bench) == before
        acknowledge(bench)
    begin(bench)
    bench.drive.advance(10)
    assert bench.inv_st == 45, 'the next one succeeds'
    with pytest.raises(ValueError, match=r'16, 17'):
        bench.drive.control_unit.fail_tuning(5)


def test_a_stop_alone_is_taken_meanwhile_or_is_refused(make_bench):
    for variant in ({}, {'stop_in_tuning': 'refused'}):
        bench = make_bench(**variant)
        before = settings(bench)
        begin(bench)
        with bench.refuses(Reason.STATE):
            bench.scmd(Scmd.FIELDBUS)
        if variant:
            with bench.refuses(Reason.STATE):
                bench.scmd(Scmd.STOP)
            bench.drive.advance(10)
            assert bench.inv_st == 45
        bench.scmd(Scmd.STOP)
        assert bench.inv_st == 37
        bench.drive.advance(10)
        assert (settings(bench) == before) is not bool(variant)


def test_what_else_ends_it(make_bench):
    for what in (
        lambda drive: drive.set_run_input(False),
        lambda drive: drive.control_unit.press('stop'),
        lambda drive: drive.trip(5),
        lambda drive: drive.power_cycle(),
    ):
        bench = make_bench()
        before = settings(bench)
        begin(bench)
        what(bench.drive)
        bench.drive.advance(10)
        assert bench.inv_st != 28
        assert settings(bench) == before


def test_it_needs_bus_control_a_motor_that_stands_run_and_no_fault(make_bench):
    bench = make_bench()
    with bench.refuses(Reason.STATE):
        bench.scmd(Scmd.FULL_TUNING)
    bench.run(20, 5)
    with bench.refuses(Reason.STATE):
        bench.scmd(Scmd.FULL_TUNING)
    bench = make_bench(run_input=False)
    begin(bench)
    assert bench.inv_st == 37
    bench.scmd(Scmd.PAR_CALC)
    assert bench.inv_st == 28, 'only the calculation begins'
    bench = make_bench()
    bench.mode(3)
    bench.drive.trip(5)
    bench.scmd(Scmd.FULL_TUNING)
    assert bench.read('fieldbus.mode') == 3
    acknowledge(bench)
    bench.drive.advance(1)
    assert bench.inv_st == 37
