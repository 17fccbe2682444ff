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

"""Every code of MODE and SCMD [M0 tables 17 and 18], and of the Optimal's MODE and SMODE [M1]."""

from optimal_bench import INPUT_FREQUENCY
from optimal_bench import MODE
from optimal_bench import SMODE
from optimal_bench import STATOR_FREQUENCY
from optimal_bench import OptimalBench
import pytest

from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.families.sinus_optimal import words as words_optimal
from nfo_sinus_driver.simulator.memory import Reason


@pytest.fixture
def optimal():
    return OptimalBench()


# ---- the G2 ----


def test_mode_0_inhibit_is_read_while_it_tunes_and_is_not_written(bench):
    with bench.refuses(Reason.VALUE):
        bench.mode(0)
    bench.mode(3)
    bench.scmd(0x201)
    assert bench.read('fieldbus.mode') == 0
    for code in (1, 2, 3):
        with bench.refuses(Reason.STATE):
            bench.mode(code)


def test_mode_1_stop_releases_a_running_motor(bench):
    bench.run(20, 5)
    bench.mode(1)
    assert (bench.running, bench.inv_st, bench.read('fieldbus.mode')) == (False, 24, 1)
    assert bench.drive.motor.turning


def test_mode_2_ext_starts_the_motor_if_run_is_active(bench):
    bench.mode(2)
    assert (bench.running, bench.inv_st, bench.read('fieldbus.mode')) == (True, 35, 2)


def test_mode_3_bus_stops_a_running_motor_and_stands_by(bench):
    bench.mode(2)
    bench.drive.advance(5)
    bench.mode(3)
    bench.drive.advance(6)
    assert (bench.running, bench.inv_st, bench.read('fieldbus.mode')) == (False, 37, 3)


def test_scmd_000_stop(bench):
    bench.run(20, 5)
    bench.scmd(0x000)
    assert bench.state == 'SHUTDOWN'
    bench.drive.advance(6)
    assert (bench.running, bench.inv_st) == (False, 37)


#: The run commands, and what each follows (Hz) with a set-point of 12.5 Hz on the bus.
RUNS = {
    Scmd.ANALOG_F: 30,
    Scmd.ANALOG_R: -30,
    Scmd.FIX_1_F: 10,
    Scmd.FIX_1_R: -10,
    Scmd.FIX_2_F: 15,
    Scmd.FIX_2_R: -15,
    Scmd.FIX_3_F: 20,
    Scmd.FIX_3_R: -20,
    Scmd.FIX_4_F: 25,
    Scmd.FIX_4_R: -25,
    Scmd.FIX_5_F: 30,
    Scmd.FIX_5_R: -30,
    Scmd.FIX_6_F: 40,
    Scmd.FIX_6_R: -40,
    Scmd.FIX_7_F: 50,
    Scmd.FIX_7_R: -50,
    Scmd.OP_MODE: 25,
    Scmd.TERMINAL: 25,
    Scmd.FIELDBUS: 12.5,
}
#: The tuning procedures, and what InvSt says at the end.
TUNES = {Scmd.FULL_TUNING: 45, Scmd.BASIC_TUNING: 45, Scmd.RS_MEASURE: 46, Scmd.PAR_CALC: 47}


def named(code):
    return f'{int(code):03X}_{code.name.lower()}'


@pytest.mark.parametrize('code', RUNS, ids=named)
def test_scmd_runs(bench, code):
    bench.mode(3)
    bench.write('status.frq_set', 12.5)
    bench.scmd(code)
    assert bench.running
    bench.drive.advance(6)
    assert bench.read('status.frq_act') == RUNS[code]
    assert bench.inv_st == 38
    status = bench.read('fieldbus.drive_status')
    assert bool(status & 1 << 14) is (RUNS[code] < 0)
    assert bool(status & 1 << 8) is (code is Scmd.FIELDBUS)
    assert status & 1 << 9
    bench.scmd(0)
    assert bench.state == 'SHUTDOWN'


@pytest.mark.parametrize('code', TUNES, ids=named)
def test_scmd_tunes(bench, code):
    bench.mode(3)
    bench.scmd(code)
    assert (bench.inv_st, bench.read('fieldbus.mode')) == (28, 0)
    bench.drive.advance(5)
    assert (bench.inv_st, bench.read('fieldbus.mode')) == (TUNES[code], 3)


def test_scmd_800_erases_the_error_log(bench):
    bench.drive.trip(5)
    bench.read('fieldbus.inv_st_with_ack')
    assert len(bench.drive.faults.log) == 1
    bench.mode(3)
    bench.scmd(0x800)
    assert bench.drive.faults.log == []


def test_scmd_900_resets_the_kwh_counter_and_not_the_total(bench):
    assert bench.read('status.e_out') > 0
    total = bench.read('status.sigma_e_out')
    bench.mode(3)
    bench.scmd(0x900)
    assert bench.read('status.e_out') == 0
    assert bench.read('status.sigma_e_out') == total


def test_no_code_of_the_g2_is_left_out():
    assert {*RUNS, *TUNES, 0x000, 0x800, 0x900} == set(Scmd)
    assert set(Mode) == {0, 1, 2, 3}


# ---- the Optimal ----


def test_optimal_mode_1_manual_leaves_a_running_motor_to_the_keypad(optimal):
    optimal.run(20, 5)
    optimal.write(MODE, 1)
    assert (optimal.running, optimal.read(MODE)) == (True, 1)
    optimal.drive.control_unit.press('stop')
    optimal.wait(6)
    assert (optimal.running, optimal.text) == (False, 'Stop')


def test_optimal_mode_2_auto_starts_the_motor_if_run_is_active(optimal):
    optimal.write(MODE, 2)
    assert (optimal.running, optimal.read(MODE), optimal.text) == (True, 2, 'Ext Acc')


def test_optimal_mode_3_bus_stops_a_running_motor_and_stands_by(optimal):
    optimal.write(MODE, 2)
    optimal.wait(6)
    optimal.write(MODE, 3)
    optimal.wait(6)
    assert (optimal.running, optimal.read(MODE), optimal.text) == (False, 3, 'Bus Stby')


def test_optimal_smode_000_stop(optimal):
    optimal.run(20, 5)
    optimal.write(SMODE, 0x000)
    assert optimal.text == 'Bus Ret'
    optimal.wait(6)
    assert (optimal.running, optimal.text) == (False, 'Bus Stby')


@pytest.mark.parametrize(
    ('code', 'followed'), [(0x081, 250), (0x101, 125)], ids=['081_terminal', '101_fieldbus']
)
def test_optimal_smode_runs(optimal, code, followed):
    optimal.write(MODE, 3)
    optimal.write(INPUT_FREQUENCY, 125)
    optimal.write(SMODE, code)
    optimal.wait(6)
    assert (optimal.text, optimal.read(STATOR_FREQUENCY)) == ('Bus Run', followed)


def test_no_code_of_the_optimal_is_left_out():
    assert set(words_optimal.Mode) == {1, 2, 3}
    assert set(words_optimal.Smode) == {0x000, 0x081, 0x101}
