# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The motor of a G2 by MODE and SCMD [M0 tables 17, 18], RUN, the keypad and DriveControl."""

import pytest

from nfo_sinus_driver.families.sinus_g2.words import Mode, Scmd
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.sinus_g2.state_machine import RUN_COMMANDS

POWER = 0x4006
READY_TO_RUN = 0xC077  # NetRef, NetCtrl, ramp generator, switched on
FORWARD = READY_TO_RUN | 1 << 3

# ---- MODE ----


def test_mode_inhibit_is_read_while_it_tunes_and_no_other_code_is_written(bench):
    for code in (0, 4, 5, 0x101, 0xFFFF):
        with bench.refuses(Reason.VALUE):
            bench.mode(code)
    bench.mode(3)
    bench.scmd(0x201)
    assert bench.read('fieldbus.mode') == 0
    for code in (1, 2, 3):
        with bench.refuses(Reason.STATE):
            bench.mode(code)
    assert set(Mode) == {0, 1, 2, 3}


def test_mode_stop_releases_the_motor(bench):
    bench.run(20, 5)
    bench.mode(1)
    assert (bench.running, bench.state, bench.inv_st) == (False, 'QUICK_STOP', 24)
    bench.drive.advance(0.1)
    assert bench.state == 'SWITCH_ON_DISABLED'
    assert bench.drive.motor.turning
    bench.drive.advance(10)
    assert not bench.drive.motor.turning


def test_mode_ext_starts_the_motor_when_run_is_active(make_bench):
    bench = make_bench(run_input=False)
    bench.mode(2)
    assert bench.drive.control_unit.mode_ext_writes == 1
    assert (bench.running, bench.inv_st, bench.read('fieldbus.mode')) == (False, 33, 2)
    bench.drive.set_run_input(True)
    assert (bench.running, bench.inv_st) == (True, 35)
    bench.drive.advance(6)
    assert (bench.inv_st, bench.read('status.frq_act')) == (34, 25.0)
    bench.drive.set_run_input(False)
    assert bench.inv_st == 36
    bench.drive.advance(6)
    assert (bench.inv_st, bench.drive.motor.turning) == (33, False)


def test_mode_bus_stops_a_running_motor_and_waits_for_a_command(bench):
    bench.mode(3)
    assert (bench.read('fieldbus.mode'), bench.inv_st, bench.running) == (3, 37, False)
    for starts in (lambda: bench.run(20), lambda: bench.mode(2)):
        starts()
        bench.drive.advance(6)
        bench.mode(3)
        assert bench.inv_st == 40
        bench.drive.advance(10)
        assert (bench.inv_st, bench.drive.motor.turning) == (37, False)
        assert bench.drive.control_unit.scmd == Scmd.STOP


# ---- SCMD ----


def test_scmd_needs_mode_bus_and_a_code_that_there_is(make_bench):
    bench = make_bench(run_input=False)
    for mode in (1, 2):
        bench.mode(mode)
        for code in Scmd:
            with bench.refuses(Reason.STATE):
                bench.scmd(code)
    bench.mode(3)
    for code in (1, 2, 0x102, 0x103, 0x700, 0xFFFF):
        with bench.refuses(Reason.VALUE):
            bench.scmd(code)
    with bench.refuses(Reason.ADDRESS):
        server(bench.drive).read(0x298, 1)


#: The run commands, and what each follows (Hz) with a set-point of 12.5 Hz on the bus.
RUNS = {
    Scmd.ANALOG_F: 30,
    Scmd.ANALOG_R: -30,
    **{Scmd[f'FIX_{n}_F']: hz for n, hz in enumerate((10, 15, 20, 25, 30, 40, 50), 1)},
    **{Scmd[f'FIX_{n}_R']: -hz for n, hz in enumerate((10, 15, 20, 25, 30, 40, 50), 1)},
    Scmd.OP_MODE: 25,
    Scmd.TERMINAL: 25,
    Scmd.FIELDBUS: 12.5,
}


def test_each_run_command_follows_its_own_set_point(make_bench):
    found = {}
    for code in RUNS:
        bench = make_bench()
        bench.write('status.frq_set', 12.5)
        bench.mode(3)
        bench.scmd(code)
        bench.drive.advance(6)
        status = bench.read('fieldbus.drive_status')
        assert (bench.inv_st, bool(status & 1 << 9)) == (38, True), code
        assert bool(status & 1 << 14) is (RUNS[code] < 0), code
        assert bool(status & 1 << 8) is (code is Scmd.FIELDBUS), code
        found[code] = bench.read('status.frq_act')
        bench.scmd(0)
        assert bench.state == 'SHUTDOWN', code
    assert found == RUNS
    assert set(RUN_COMMANDS) == set(RUNS)
    # the procedures are in test_g2_faults.py
    assert {*RUNS, 0x201, 0x301, 0x401, 0x501, 0x000, 0x800, 0x900} == set(Scmd)


def test_commands_that_erase(bench):
    bench.drive.trip(5)
    bench.read('fieldbus.inv_st_with_ack')
    assert len(bench.drive.faults.log) == 1 and bench.read('status.e_out') > 0
    total = bench.read('status.sigma_e_out')
    bench.mode(3)
    bench.scmd(0x800)
    bench.scmd(0x900)
    assert bench.drive.faults.log == []
    assert (bench.read('status.e_out'), bench.read('status.sigma_e_out')) == (0, total)


# ---- running by the bus ----


def test_a_run_as_the_status_shows_it(bench):
    bench.write('status.frq_set', 40)
    bench.run(30, 1.5)
    assert bench.read('status.frq_act') == pytest.approx(15, abs=0.2)
    assert bench.inv_st == 39
    bench.drive.advance(2)
    assert (bench.inv_st, bench.read('status.frq_act')) == (38, 30.0)
    assert bench.read('fieldbus.drive_status') & 1 << 10
    for key, low, high in (
        ('status.spd_act', 860, 900),
        ('status.u_rms', 230, 250),
        ('status.i_rms', 1.5, 3.4),
        ('status.p_out', 0, 1500),
        ('status.dc_link', 550, 580),
    ):
        assert low < bench.read(key) < high, key
    bench.write('status.frq_set', -20)
    assert bench.inv_st == 40
    bench.drive.advance(10)
    assert bench.read('status.frq_act') == -20.0
    assert bench.read('status.spd_act') < -550
    bench.write('status.frq_set', 0)
    bench.drive.advance(10)
    assert (bench.running, bench.inv_st) == (True, 38), 'at zero it runs'
    bench.write('status.frq_set', 50)
    bench.drive.advance(2)
    bench.scmd(0)
    bench.drive.advance(1)
    assert (bench.state, bench.inv_st) == ('SHUTDOWN', 40)
    assert bench.read('fieldbus.drive_status') & 1 << 15
    bench.drive.advance(4)
    assert (bench.state, bench.inv_st) == ('READY_TO_SWITCH_ON', 37)


def test_st_mode_release_coasts(bench):
    bench.write('control.st_mode', 'Release')
    bench.run(30, 6)
    bench.scmd(0)
    assert not bench.running
    bench.drive.advance(0.1)
    assert (bench.inv_st, bench.read('status.spd_act')) == (37, 0)
    assert bench.drive.motor.turning


def test_every_control_mode_follows_its_own_set_point(make_bench):
    for mode, key, setpoint, measured in (
        ('Freque', 'status.frq_set', -33.3, 'status.frq_act'),
        ('Speed', 'status.spd_set', 700, 'status.spd_act'),
        ('Speed', 'status.spd_set', -700, 'status.spd_act'),
        ('Torque', 'status.trq_set', 10, 'status.trq_act'),
        ('PI-Reg', 'status.reg_set', 60.0, 'status.reg_act'),
    ):
        bench = make_bench()
        bench.write('control.mode', mode)
        bench.mode(3)
        bench.write(key, setpoint)
        bench.scmd(0x101)
        bench.drive.advance(15)
        assert bench.read(measured) == pytest.approx(setpoint, abs=0.5), mode
        bench.scmd(0)
        bench.drive.advance(15)
        assert (bench.drive.motor.turning, bench.inv_st) == (False, 37), mode


def test_overload_shows_the_current_limit(bench):
    bench.run(40, 5)
    bench.drive.motor.load = 5.0
    bench.drive.advance(1)
    assert bench.inv_st == 27
    assert bench.read('fieldbus.drive_status') & 1 << 11


def test_hard_braking_shows_the_chopper_and_counts_it(bench):
    bench.drive.motor.load = 0.05
    bench.run(50, 8)
    before = bench.drive.counters.brake_time
    bench.write('control.retard', 0.4)
    bench.write('status.frq_set', 0)
    seen = set()
    for _ in range(100):
        bench.drive.advance(0.005)
        seen.add(bench.inv_st)
    assert 26 in seen
    assert 0 < bench.drive.counters.brake_time - before < 0.5


def test_start_delay_and_dc_braking_before_the_start(make_bench):
    bench = make_bench()
    bench.write('control.run_dly', 3)
    bench.run(20, 2.9)
    assert (bench.inv_st, bench.running) == (25, False)
    bench.drive.advance(0.2)
    assert (bench.inv_st, bench.running) == (39, True)
    bench.drive.set_run_input(False)
    bench.drive.set_run_input(True)
    assert bench.inv_st == 25
    bench = make_bench()
    bench.write('control.dc_brk', 2)
    bench.run(20, 1.9)
    assert (bench.running, bench.read('status.frq_act')) == (True, 0)
    bench.drive.advance(1)
    assert bench.read('status.frq_act') > 5
    bench = make_bench(shown_in_dc_brk='standby')
    bench.write('control.dc_brk', 2)
    bench.run(20, 1.9)
    shown = bench.inv_st, bench.read('fieldbus.drive_status') & 0x4004
    assert (bench.running, *shown) == (True, 37, 0)
    bench.drive.advance(1)
    shown = bench.inv_st, bench.read('fieldbus.drive_status') & 0x4004
    assert (bench.running, *shown) == (True, 39, 4)


# ---- the RUN input, the keypad, the mains ----


def test_run_lost_stops_and_run_back_starts_again_by_itself(make_bench):
    for st_mode in ('Brake', 'Release'):
        bench = make_bench(run_input=False)
        bench.write('control.st_mode', st_mode)
        bench.run(20, 1)
        assert (bench.inv_st, bench.running) == (37, False)
        bench.drive.set_run_input(True)
        bench.drive.advance(5)
        assert bench.read('status.frq_act') == 20
        bench.drive.set_run_input(False)
        assert bench.running is (st_mode == 'Brake')
        bench.drive.advance(10)
        assert (bench.inv_st, bench.drive.motor.turning) == (37, False)
        bench.drive.set_run_input(True)
        assert bench.running
        bench.drive.set_run_input(False)
        bench.scmd(0)
        bench.drive.advance(10)
        bench.drive.set_run_input(True)
        assert not bench.running, 'a stop meanwhile is a stop'


def test_the_keys(make_bench):
    bench = make_bench()
    bench.run(20, 5)
    bench.drive.control_unit.press('stop')
    assert (bench.running, bench.read('fieldbus.mode'), bench.inv_st) == (False, 1, 24)
    with bench.refuses(Reason.STATE):
        bench.scmd(0x101)
    bench.mode(3)
    bench.drive.advance(20)
    assert not bench.running
    bench.drive.control_unit.press('ext')
    assert (bench.running, bench.read('fieldbus.mode')) == (True, 2)
    bench = make_bench(run_input=False)
    bench.drive.control_unit.press('start')
    assert (bench.read('fieldbus.mode'), bench.inv_st) == (2, 31)
    bench.drive.advance(5)
    assert bench.inv_st == 30
    bench.drive.control_unit.press('stop')
    assert bench.inv_st == 24


def test_a_change_at_the_keypad_is_no_write_of_the_bus(bench):
    bench.drive.set_from_keypad('control.accel', 7)
    assert bench.read('control.accel') == 7
    assert not bench.drive.writes
    with pytest.raises(ValueError, match='out of range'):
        bench.drive.set_from_keypad('control.accel', 1000)
    with pytest.raises(ValueError, match='cannot be changed'):
        bench.drive.set_from_keypad('fieldbus.mode', 2)


def test_a_power_cycle(bench):
    bench.write('control.accel', 7.0)
    bench.run(20, 10)
    hours = bench.drive.counters.operating_time
    bench.drive.power_cycle()
    assert (bench.state, bench.running) == ('NOT_READY_TO_SWITCH_ON', False)
    assert bench.drive.motor.turning
    bench.drive.advance(1.9)
    assert not bench.drive.listening
    bench.drive.advance(0.2)
    assert bench.drive.listening
    assert (bench.read('fieldbus.mode'), bench.inv_st) == (1, 24)
    assert (bench.read('status.frq_set'), bench.read('control.accel')) == (20, 7.0)
    assert bench.drive.counters.operating_time >= hours
    bench.mode(3)
    bench.drive.advance(10)
    assert not bench.running
    bench.scmd(0x101)
    bench.drive.advance(10)
    assert bench.read('status.frq_act') == 20, 'the old set-point is still there'


def test_autostart_is_ext_after_power_on(make_bench):
    for run_input, inv_st in ((True, 35), (False, 33)):
        bench = make_bench(run_input=run_input, settings={'control.auto_start': True})
        bench.mode(1)
        bench.drive.power_cycle(0.5)
        bench.drive.advance(0.6)
        assert (bench.inv_st, bench.running) == (inv_st, run_input)


def test_a_new_address_counts_from_the_next_power_on_or_at_once_with_auto_reset(bench):
    bench.write('serial.address', 9)
    assert bench.drive.address == 1
    bench.drive.power_cycle()
    bench.drive.advance(3)
    assert bench.drive.address == 9
    bench.write('serial.auto_reset', True)
    bench.write('serial.address', 7)
    assert bench.drive.address == 7


# ---- DriveControl; its states are in test_g2_state_machine.py ----


def under_control(bench, *words):
    bench.write('status.frq_set', 20)
    for word in words:
        bench.write('fieldbus.drive_control', word)


def test_drive_control_runs_in_both_directions(bench):
    under_control(bench, FORWARD)
    assert bench.state == 'SWITCH_ON_DISABLED', 'bit 0 has to rise'
    under_control(bench, POWER)
    assert (bench.read('fieldbus.mode'), bench.state) == (3, 'READY_TO_SWITCH_ON')
    under_control(bench, READY_TO_RUN, FORWARD)
    bench.drive.advance(5)
    assert bench.read('status.frq_act') == 20
    under_control(bench, READY_TO_RUN | 1 << 13)
    bench.drive.advance(10)
    assert bench.read('status.frq_act') == -20
    assert bench.read('fieldbus.drive_status') & 0x4300 == 0x4300
    under_control(bench, READY_TO_RUN)
    assert bench.state == 'DISABLE'
    bench.drive.advance(10)
    assert bench.state == 'SWITCHED_ON'
    assert bench.read('fieldbus.drive_control') == READY_TO_RUN


def test_the_bits_of_the_ramp_generator_and_the_run_input(make_bench):
    for bit, frequency in ((4, 0), (5, 10), (6, 0)):
        bench = make_bench()
        under_control(bench, POWER, FORWARD)
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


def test_the_write_mask_and_net_ctrl(bench):
    under_control(bench, 0x000F)
    assert (bench.read('fieldbus.mode'), bench.running) == (1, False)
    under_control(bench, POWER)
    server(bench.drive).write(0x250, [0xFFFF, 0x0001])  # AND, OR
    assert bench.read('fieldbus.drive_control') == POWER | 1
    server(bench.drive).write(0x250, [0xFFFE, 0x0000])
    assert bench.read('fieldbus.drive_control') == POWER
    assert bench.read('fieldbus.mode') == 3
    under_control(bench, 0)
    assert bench.read('fieldbus.mode') == 1
