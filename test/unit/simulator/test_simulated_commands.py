# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""MODE, SCMD, set-points and what the motor makes of them, in virtual time."""

import pytest

from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.sinus_g2.state_machine import RUN_COMMANDS

# ---- MODE ----


@pytest.mark.parametrize('code', [0, 4, 5, 0x101, 0xFFFF])
def test_mode_takes_no_other_code(bench, code):
    with bench.refuses(Reason.VALUE):
        bench.mode(code)


def test_mode_bus_waits_for_a_command(bench):
    bench.mode(3)
    assert bench.read('fieldbus.mode') == 3
    assert bench.inv_st == 37
    bench.drive.advance(10)
    assert not bench.running


def test_mode_bus_stops_a_running_motor_and_forgets_the_command(bench):
    bench.run(20, 5)
    bench.mode(3)
    assert bench.inv_st == 40
    bench.drive.advance(10)
    assert not bench.drive.motor.turning
    assert bench.inv_st == 37
    assert bench.drive.control_unit.scmd == Scmd.STOP


def test_mode_stop_releases_the_motor(bench):
    bench.run(20, 5)
    bench.mode(1)
    assert not bench.running
    assert bench.state == 'QUICK_STOP'
    assert bench.inv_st == 24
    bench.drive.advance(0.1)
    assert bench.state == 'SWITCH_ON_DISABLED'
    assert bench.drive.motor.turning
    bench.drive.advance(10)
    assert not bench.drive.motor.turning


def test_mode_ext_starts_the_motor_when_run_is_active(bench):
    bench.mode(2)
    assert bench.drive.control_unit.mode_ext_writes == 1
    assert bench.read('fieldbus.mode') == 2
    assert bench.running
    assert bench.inv_st == 35
    bench.drive.advance(6)
    assert bench.inv_st == 34
    assert bench.read('status.frq_act') == 25.0
    bench.drive.set_run_input(False)
    assert bench.inv_st == 36
    bench.drive.advance(6)
    assert bench.inv_st == 33
    assert not bench.drive.motor.turning


def test_mode_ext_waits_for_run(make_bench):
    bench = make_bench(run_input=False)
    bench.mode(2)
    assert not bench.running
    assert bench.inv_st == 33
    bench.drive.set_run_input(True)
    assert bench.running


def test_mode_bus_takes_over_from_the_terminals(bench):
    bench.mode(2)
    bench.drive.advance(6)
    bench.mode(3)
    assert bench.inv_st == 40
    bench.drive.advance(6)
    assert (bench.inv_st, bench.running) == (37, False)


# ---- SCMD ----


@pytest.mark.parametrize('mode', [1, 2])
def test_scmd_needs_mode_bus(make_bench, mode):
    bench = make_bench(run_input=False)
    bench.mode(mode)
    for code in Scmd:
        with bench.refuses(Reason.STATE):
            bench.scmd(code)


@pytest.mark.parametrize('code', [1, 2, 0x102, 0x103, 0x700, 0xFFFF])
def test_scmd_takes_no_other_code(bench, code):
    bench.mode(3)
    with bench.refuses(Reason.VALUE):
        bench.scmd(code)


def test_scmd_cannot_be_read(bench):
    with bench.refuses(Reason.ADDRESS):
        server(bench.drive).read(0x298, 1)


def test_all_run_commands_are_known():
    assert len(RUN_COMMANDS) == 19


# ---- running by the bus ----


def test_a_ride(bench):
    bench.run(30)
    assert bench.inv_st == 39
    bench.drive.advance(1.5)
    assert bench.read('status.frq_act') == pytest.approx(15, abs=0.2)
    assert bench.inv_st == 39
    bench.drive.advance(2)
    assert bench.inv_st == 38
    assert bench.read('status.frq_act') == 30.0
    assert 860 < bench.read('status.spd_act') < 900
    assert bench.read('fieldbus.drive_status') & 1 << 10
    assert 230 < bench.read('status.u_rms') < 250
    assert 1.5 < bench.read('status.i_rms') < 3.4
    assert 0 < bench.read('status.p_out') < 1500
    assert 550 < bench.read('status.dc_link') < 580
    bench.write('status.frq_set', -20)
    assert bench.inv_st == 40
    bench.drive.advance(10)
    assert bench.read('status.frq_act') == -20.0
    assert bench.read('status.spd_act') < -550
    bench.scmd(0)
    assert bench.inv_st == 40
    assert bench.read('fieldbus.drive_status') & 1 << 15
    bench.drive.advance(1)
    assert bench.inv_st == 40
    bench.drive.advance(2)
    assert bench.inv_st == 37
    assert bench.state == 'READY_TO_SWITCH_ON'


def test_a_stop_during_the_ramp_up_shows_stopping(bench):
    bench.run(50, 2)
    bench.scmd(0)
    bench.drive.advance(0.5)
    assert bench.state == 'SHUTDOWN'
    assert bench.inv_st == 40
    assert bench.read('fieldbus.drive_status') & 1 << 15


def test_st_mode_release_coasts(bench):
    bench.write('control.st_mode', 'Release')
    bench.run(30, 6)
    bench.scmd(0)
    assert not bench.running
    assert bench.drive.motor.turning
    bench.drive.advance(0.1)
    assert bench.inv_st == 37
    assert bench.drive.motor.turning
    assert bench.read('status.spd_act') == 0
    bench.drive.advance(10)
    assert not bench.drive.motor.turning


def test_running_at_zero_is_running(bench):
    bench.run(0, 1)
    assert bench.running
    assert bench.inv_st == 38
    assert not bench.drive.motor.turning


def test_a_set_point_is_remembered_from_before(bench):
    bench.write('status.frq_set', 40)
    bench.mode(3)
    bench.scmd(0x101)
    bench.drive.advance(10)
    assert bench.read('status.frq_act') == 40


@pytest.mark.parametrize(
    ('mode', 'key', 'setpoint', 'measured', 'expected'),
    [
        ('Freque', 'status.frq_set', -33.3, 'status.frq_act', -33.3),
        ('Speed', 'status.spd_set', 700, 'status.spd_act', 700),
        ('Speed', 'status.spd_set', -700, 'status.spd_act', -700),
        ('Torque', 'status.trq_set', 10, 'status.trq_act', 10),
        ('PI-Reg', 'status.reg_set', 60.0, 'status.reg_act', 60.0),
    ],
)
def test_every_control_mode_follows_its_own_set_point(
    bench, mode, key, setpoint, measured, expected
):
    bench.write('control.mode', mode)
    bench.mode(3)
    bench.write(key, setpoint)
    bench.scmd(0x101)
    bench.drive.advance(15)
    assert bench.read(measured) == pytest.approx(expected, abs=0.5)
    bench.scmd(0)
    bench.drive.advance(15)
    assert not bench.drive.motor.turning
    assert bench.inv_st == 37


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


def test_start_delay(bench):
    bench.write('control.run_dly', 3)
    bench.run(20)
    assert bench.inv_st == 25
    bench.drive.advance(2.9)
    assert bench.inv_st == 25
    assert not bench.running
    bench.drive.advance(0.2)
    assert bench.inv_st == 39
    assert bench.running
    bench.drive.set_run_input(False)
    bench.drive.set_run_input(True)
    assert bench.inv_st == 25


def test_dc_braking_before_the_start_holds_the_motor(bench):
    bench.write('control.dc_brk', 2)
    bench.run(20, 1.9)
    assert bench.running
    assert bench.read('status.frq_act') == 0
    bench.drive.advance(1)
    assert bench.read('status.frq_act') > 5
