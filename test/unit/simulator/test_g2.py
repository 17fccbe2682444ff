# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a G2 alone does: what it refuses, drops and restarts by itself, and DriveControl [M0]."""

import pytest
from support.addresses import packed

from nfo_sinus_driver.catalog import Access, Kind, load_family
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.sinus_g2.state_machine import PROCEDURES, TRIES

MODEL = load_family('sinus_g2')
FAULTS = [code for code in range(48) if MODEL.status_code(code).kind is Kind.FAULT]
KEEPS = {'run_command_in_fault': 'keeps'}
STANDBY = 0x4006  # NetCtrl, quick stop and voltage
FORWARD = 0xC07F  # NetRef, NetCtrl, ramp generator, switched on, enabled


def acknowledge(bench):
    return bench.read('fieldbus.inv_st_with_ack')


def test_a_new_address_counts_from_the_next_power_on_or_at_once_with_auto_reset(bench):
    bench.write('serial.address', 9)
    assert bench.drive.address == 1
    bench.drive.power_cycle()
    bench.drive.advance(3)
    assert bench.drive.address == 9
    bench.write('serial.auto_reset', True)
    bench.write('serial.address', 7)
    assert bench.drive.address == 7


# ---- one drive by four protocols ----

READ_BY = {
    'modbus': lambda drive, place: packed(
        *server(drive).read(place.index, place.codec.size // 2)
    ),
    'classic': lambda drive, place: packed(*map(drive.servers['classic'].enquiry, place.numbers)),
    # in any size
    'canopen': lambda drive, place: place.number.encode(
        int.from_bytes(
            drive.servers['canopen'].read(place.index, place.sub_index or 0), 'little',
            signed=place.number.signed,
        )
    ),
    'profibus': lambda drive, place: place.number.encode(
        drive.servers['telegram1'].parameters.entries[place.index, place.sub_index or 0].read()
    ),
}  # fmt: skip


def test_all_protocols_read_the_same():
    for types in ('table', 'narrow', 'wide'):
        drive = simulated_drive('sinus_g2', canopen_types=types)
        for key, raw in (('fieldbus.mode', 3), ('status.frq_set', 123), ('fieldbus.scmd', 0x101)):
            drive.write_raw(key, raw)
        drive.advance(8)
        for parameter in drive.model.values():
            protocols = READ_BY.keys() & parameter.addresses.keys()
            if parameter.access is Access.WRITE or 'modbus' not in protocols:
                continue
            read = {by: READ_BY[by](drive, parameter.at(by)) for by in protocols}
            seen = {by: parameter.decode(raw, by) for by, raw in read.items()}
            first = seen['modbus']
            for by, value in seen.items():
                if parameter.kind is float:
                    step = float(max(parameter.factor('modbus'), parameter.factor(by)))
                    assert value == pytest.approx(first, abs=step + 1e-9), (parameter.key, by)
                else:
                    assert value == first, (parameter.key, by)


# ---- what it follows ----


def test_every_control_mode_follows_its_own_set_point(make_bench):
    for mode, key, setpoint, measured in (
        ('Speed', 'status.spd_set', -700, 'status.spd_act'),
        ('Torque', 'status.trq_set', 10, 'status.trq_act'),
        ('PI-Reg', 'status.reg_set', 60.0, 'status.reg_act'),
    ):
        bench = make_bench(settings={'control.mode': mode})
        bench.mode(3)
        bench.write(key, setpoint)
        bench.scmd(0x101)
        bench.drive.advance(15)
        assert bench.read(measured) == pytest.approx(setpoint, abs=0.5), mode


def test_the_status_word_says_whether_the_reference_comes_from_the_bus(bench):
    bench.mode(3)
    for code, bits in ((Scmd.FIELDBUS, 0x300), (Scmd.TERMINAL, 0x200), (Scmd.FIX_1_F, 0x200)):
        bench.scmd(code)
        assert bench.read('fieldbus.drive_status') & 0x300 == bits


# ---- faults ----


def test_what_is_commanded_in_a_fault_is_dropped_with_the_last_fault(make_bench):
    bench = make_bench()
    bench.mode(3)
    bench.drive.trip(5)
    bench.scmd(0x101)
    bench.drive.trip(3, cause_present=True)
    acknowledge(bench)
    assert (bench.drive.control_unit.scmd, bench.drive.faults.codes) == (0x101, [3])
    bench.drive.faults.end_causes()
    acknowledge(bench)
    bench.drive.advance(1)
    assert not bench.running
    assert [entry.code for entry in bench.drive.faults.log] == [3, 5]
    bench = make_bench()
    bench.drive.control_unit.press('start')
    bench.drive.trip(5)
    acknowledge(bench)
    bench.drive.advance(1)
    assert not bench.running, 'what the keypad has started, too'
    bench.mode(2)
    bench.drive.trip(5)
    acknowledge(bench)
    bench.drive.advance(1)
    assert bench.running, 'the terminals command all the time'
    for variant, runs in [({}, False), (KEEPS, True)]:
        bench = make_bench(**variant)
        bench.drive.trip(14)
        bench.mode(3)
        bench.scmd(0x101)
        bench.drive.read_raw('fieldbus.sio_err')
        bench.drive.advance(1)
        assert bench.running == runs, 'of a serial fault, by reading SioErr'


def test_02a4h_alone_acknowledges_and_without_a_fault_it_drops_nothing(bench):
    bench.run(20, 5)
    assert acknowledge(bench) == 38
    bench.drive.advance(1)
    assert (bench.running, bench.drive.control_unit.ack_reads) == (True, 1)
    bench.drive.trip(3)
    assert bench.read('fieldbus.inv_st') == bench.read('fieldbus.inv_st') == 3
    assert bench.drive.control_unit.ack_reads == 1


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
        assert bench.running is (refused == 'all'), 'elsewhere MODE has removed the command'


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


def test_the_time_of_a_silent_bus_counts_from_taking_control(bench):
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


def test_a_fault_with_tries_alone_ends_by_itself_and_the_motor_runs_again(make_bench):
    for code in TRIES:
        bench = restarting(make_bench(), code)
        bench.drive.trip(code, cause_present=True)
        bench.drive.advance(4)
        bench.drive.faults.end_causes()
        bench.drive.advance(1.9)
        assert (bench.inv_st, bench.running) == (code, False), 'it counts from there'
        bench.drive.advance(0.3)
        assert (bench.inv_st, bench.running) == (39, True), code
        assert bench.drive.control_unit.ack_reads == 0
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
    bench.drive.trip(5)
    bench.drive.advance(5)
    assert bench.running, 'it has run well for TrTime'


# ---- DriveControl; its states are in test_g2_state_machine.py ----


def under_control(bench, *words):
    bench.write('status.frq_set', 20)
    for word in words:
        bench.write('fieldbus.drive_control', word)


def test_a_control_word_needs_bit_0_low_after_a_fault_that_ended_by_itself(make_bench):
    for in_fault, state in ((FORWARD, 'SWITCH_ON_DISABLED'), (0xC07E, 'READY_TO_SWITCH_ON')):
        bench = make_bench()
        bench.write('error.overload_err_cnt', 1)
        bench.write('error.rst_dly', 2)
        under_control(bench, STANDBY, FORWARD)
        assert bench.running
        bench.drive.trip(5)
        # not refused: it is how it is reset
        bench.write('fieldbus.drive_control', in_fault)
        bench.drive.advance(10)
        assert (bench.running, bench.state) == (False, state)
        bench.write('fieldbus.drive_control', 0xD07F)  # bit 12: auto init
        assert bench.running


def test_the_bits_of_the_ramp_generator_and_the_run_input(make_bench):
    for bit, frequency in ((4, 0), (5, 10), (6, 0)):
        bench = make_bench()
        under_control(bench, STANDBY, FORWARD)
        bench.drive.advance(1)
        under_control(bench, FORWARD & ~(1 << bit))
        bench.drive.advance(5)
        assert bench.read('status.frq_act') == pytest.approx(frequency, abs=0.2), bit
        assert bench.running
    bench.drive.set_run_input(False)
    bench.drive.advance(5)
    assert not bench.running
    bench.drive.set_run_input(True)
    assert bench.running


def test_without_net_ctrl_a_word_does_nothing_and_the_mask_changes_bits_of_it(bench):
    under_control(bench, 0x000F)
    assert (bench.read('fieldbus.mode'), bench.running) == (1, False)
    under_control(bench, STANDBY)
    for mask, word in (((0xFFFF, 0x0001), STANDBY | 1), ((0xFFFE, 0x0000), STANDBY)):  # AND, OR
        server(bench.drive).write(0x250, mask)
        assert (bench.read('fieldbus.drive_control'), bench.read('fieldbus.mode')) == (word, 3)
    under_control(bench, 0)
    assert bench.read('fieldbus.mode') == 1


# ---- tuning; what each procedure finds is in test/unit/drive/starts/test_tuning.py ----


def settings(bench):
    return {key: bench.drive.peek(key) for key in bench.drive.settings}


def begin(bench, code=Scmd.FULL_TUNING):
    bench.mode(3)
    bench.scmd(code)


def test_a_procedure_takes_its_time_and_changes_what_it_finds_alone(make_bench):
    for code, shown in ((0x201, 45), (0x301, 45), (0x401, 46), (0x501, 47)):
        bench = make_bench()
        before = settings(bench)
        begin(bench, code)
        bench.drive.advance(PROCEDURES[code].seconds - 0.1)
        assert (bench.inv_st, bench.read('fieldbus.mode')) == (28, 0)
        assert settings(bench) == before
        bench.drive.advance(0.2)
        assert (bench.inv_st, bench.read('fieldbus.mode')) == (shown, 3), code
        after = settings(bench)
        assert {key for key in after if after[key] != before[key]} == set(PROCEDURES[code].finds)
        assert bench.drive.writes == {}, 'it is not the bus that wrote them'
    before = settings(bench)
    bench.drive.control_unit.fail_tuning(16)
    begin(bench)
    bench.drive.advance(10)
    assert bench.inv_st == 16 and settings(bench) == before
    with pytest.raises(ValueError, match=r'16, 17'):
        bench.drive.control_unit.fail_tuning(5)


def test_a_stop_alone_is_taken_meanwhile_or_is_refused(make_bench):
    for variant in ({}, {'stop_in_tuning': 'refused'}):
        bench = make_bench(**variant)
        before = settings(bench)
        begin(bench)
        for key, code in (('mode', 1), ('mode', 2), ('mode', 3), ('scmd', Scmd.FIELDBUS)):
            with bench.refuses(Reason.STATE):
                bench.write(f'fieldbus.{key}', code)
        if variant:
            with bench.refuses(Reason.STATE):
                bench.scmd(Scmd.STOP)
            bench.drive.advance(10)
            assert bench.inv_st == 45
        bench.scmd(Scmd.STOP)
        assert bench.inv_st == 37
        bench.drive.advance(10)
        assert (settings(bench) == before) is not bool(variant)


def test_what_else_ends_a_tuning(make_bench):
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


def test_a_tuning_needs_a_motor_that_stands_run_and_no_fault(make_bench):
    bench = make_bench()
    bench.run(20, 5)
    with bench.refuses(Reason.STATE):
        bench.scmd(Scmd.FULL_TUNING)
    bench = make_bench(run_input=False)
    begin(bench)
    assert bench.inv_st == 37
    bench.scmd(Scmd.PAR_CALC)
    assert bench.inv_st == 28, 'only the calculation begins'
    bench = make_bench()
    bench.drive.trip(5)
    begin(bench)
    acknowledge(bench)
    bench.drive.advance(1)
    assert bench.inv_st == 37
