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

"""Faults, their acknowledgement, and a bus that falls silent."""

import pytest

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.sinus.control_unit import CHOICES
from nfo_sinus_driver.simulator.sinus.control_unit import Variant
from nfo_sinus_driver.simulator.sinus_g2.self_restart import TRIES

MODEL = load_family('sinus_g2')
FAULTS = [code for code in range(48) if MODEL.status_code(code).kind is Kind.FAULT]
SERIAL = {14, 15}
KEEPS = {'run_command_in_fault': 'keeps'}


def acknowledge(bench):
    return bench.read('fieldbus.inv_st_with_ack')


@pytest.mark.parametrize('code', FAULTS)
def test_a_fault_stops_the_motor_and_shows(bench, code):
    bench.run(20, 5)
    bench.drive.trip(code)
    assert not bench.running
    assert bench.state == 'FAULT_REACTION_ACTIVE'
    assert bench.read('fieldbus.drive_status') & 0x8008 == 0x8008
    bench.drive.advance(0.1)
    assert bench.state == 'FAULTED'
    assert bench.read('fieldbus.drive_status') & 0x8008 == 0x0008
    assert bench.inv_st == code
    assert bench.read('fieldbus.mode') == (1 if code in SERIAL else 3)
    bench.drive.advance(100)
    assert bench.inv_st == code
    assert not bench.drive.motor.turning


@pytest.mark.parametrize('code', [code for code in FAULTS if code not in SERIAL])
def test_an_acknowledged_fault_drops_the_run_command(bench, code):
    bench.run(20, 5)
    bench.drive.trip(code)
    bench.drive.advance(20)
    assert acknowledge(bench) == code
    bench.drive.advance(1)
    assert not bench.running
    assert bench.inv_st == 37
    bench.scmd(0x101)
    assert bench.running


def test_a_run_command_that_is_given_in_a_fault_is_dropped_too(bench):
    bench.mode(3)
    bench.drive.trip(5)
    bench.scmd(0x101)
    bench.drive.advance(1)
    acknowledge(bench)
    bench.drive.advance(1)
    assert not bench.running


def test_the_run_command_is_dropped_with_the_last_fault(bench):
    bench.run(20, 5)
    bench.drive.trip(5)
    bench.drive.trip(3, cause_present=True)
    acknowledge(bench)
    assert bench.drive.control_unit.scmd == 0x101
    bench.drive.end_fault_causes()
    acknowledge(bench)
    assert not bench.running


def test_the_acknowledging_read_drops_nothing_without_a_fault(bench):
    bench.run(20, 5)
    acknowledge(bench)
    bench.drive.advance(1)
    assert bench.running


def test_a_run_of_the_keypad_is_dropped_too(bench):
    bench.drive.control_unit.press('start')
    bench.drive.advance(1)
    assert bench.running
    bench.drive.trip(5)
    bench.drive.advance(5)
    acknowledge(bench)
    bench.drive.advance(1)
    assert not bench.running


def test_reading_sio_err_drops_what_was_commanded_in_a_serial_fault(make_bench):
    for variant, runs in [({}, False), (KEEPS, True)]:
        bench = make_bench(**variant)
        bench.drive.trip(14)
        bench.mode(3)
        bench.scmd(0x101)
        bench.drive.read_raw('fieldbus.sio_err')
        bench.drive.advance(1)
        assert bench.running == runs


@pytest.mark.parametrize('code', [code for code in FAULTS if code not in SERIAL])
def test_an_acknowledged_fault_lets_the_standing_command_run_again(make_bench, code):
    bench = make_bench(**KEEPS)
    bench.run(20, 5)
    bench.drive.trip(code)
    bench.drive.advance(20)
    assert acknowledge(bench) == code
    assert bench.drive.control_unit.ack_reads == 1
    assert bench.running
    assert bench.inv_st == 39


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


def test_a_drive_that_refuses_every_write_while_a_fault_is_active(make_bench):
    bench = make_bench(refuses_in_fault='all')
    bench.run(20, 5)
    bench.drive.trip(5)
    for key, value in [
        ('fieldbus.scmd', 0),
        ('fieldbus.mode', 1),
        ('fieldbus.mode', 3),
        ('status.frq_set', 0),
        ('control.accel', 5.0),
    ]:
        with bench.refuses(Reason.STATE):
            bench.write(key, value)
    assert bench.read('status.frq_set') == 20


def test_a_drive_that_refuses_only_the_run_command_while_a_fault_is_active(make_bench):
    bench = make_bench(run_command_in_fault='keeps', refuses_in_fault='scmd')
    bench.run(20, 5)
    bench.drive.trip(5)
    for command in (0, 0x101):
        with bench.refuses(Reason.STATE):
            bench.scmd(command)
    bench.write('status.frq_set', 0)
    bench.write('control.accel', 5.0)
    bench.mode(1)
    assert bench.inv_st == 5
    acknowledge(bench)
    bench.drive.advance(1)
    assert not bench.running


def test_a_drive_that_takes_every_write_in_spite_of_a_fault(make_bench):
    bench = make_bench(**KEEPS)
    bench.run(20, 5)
    bench.drive.trip(5)
    bench.write('status.frq_set', 0)
    bench.scmd(0)
    bench.mode(1)
    bench.mode(3)
    assert bench.inv_st == 5
    acknowledge(bench)
    bench.drive.advance(1)
    assert not bench.running


@pytest.mark.parametrize('name', CHOICES)
def test_a_variant_that_there_is_not(name):
    with pytest.raises(ValueError, match=f'{name}: choose one of'):
        Variant(**{name: 'sometimes'})


def test_a_fault_whose_cause_lasts_is_not_acknowledged(bench):
    bench.drive.trip(3, cause_present=True)
    assert acknowledge(bench) == 3
    assert bench.inv_st == 3
    bench.drive.end_fault_causes()
    assert bench.inv_st == 3
    assert acknowledge(bench) == 3
    assert bench.inv_st == 24
    assert bench.drive.control_unit.ack_reads == 2


def test_reading_without_ack_acknowledges_nothing(bench):
    bench.drive.trip(3)
    for _ in range(3):
        assert bench.read('fieldbus.inv_st') == 3
    assert bench.drive.control_unit.ack_reads == 0


def test_reading_with_ack_is_counted_even_without_a_fault(bench):
    assert acknowledge(bench) == 24
    assert bench.drive.control_unit.ack_reads == 1


def test_sio_fail_is_acknowledged_by_mode_stop_alone(make_bench):
    bench = make_bench(refuses_in_fault='all')
    bench.run(20, 5)
    bench.drive.trip(14)
    bench.drive.advance(20)
    assert acknowledge(bench) == 14
    assert bench.inv_st == 14
    for code in (2, 3):
        with bench.refuses(Reason.STATE):
            bench.mode(code)
    bench.mode(1)
    assert bench.inv_st == 24
    bench.mode(3)
    assert bench.inv_st == 37
    assert not bench.running


def test_bus_fail_clears_with_the_acknowledging_read(bench):
    bench.run(20, 5)
    bench.drive.trip(15)
    bench.drive.advance(20)
    assert acknowledge(bench) == 15
    assert bench.inv_st == 24
    bench.drive.advance(1)
    assert not bench.running


def test_the_first_of_several_faults_shows(bench):
    bench.drive.trip(3, cause_present=True)
    bench.drive.trip(5)
    assert bench.inv_st == 3
    acknowledge(bench)
    assert bench.drive.faults.codes == [3]
    bench.drive.end_fault_causes()
    acknowledge(bench)
    assert bench.inv_st == 24
    assert [entry.code for entry in bench.drive.faults.log] == [5, 3]


def test_a_fault_is_acknowledged_by_drive_control(bench):
    bench.write('fieldbus.drive_control', 0x4006)
    bench.drive.trip(5)
    bench.drive.advance(1)
    bench.write('fieldbus.drive_control', 0x4086)
    assert bench.state == 'READY_TO_SWITCH_ON'
    bench.drive.trip(5)
    bench.drive.advance(1)
    bench.write('fieldbus.drive_control', 0x4086)  # no edge
    assert bench.state == 'FAULTED'


def test_the_log_keeps_what_happened_when(bench):
    for code in [5] * 130 + [7]:
        bench.drive.trip(code)
        acknowledge(bench)
        bench.drive.advance(36)
    log = bench.drive.faults.log
    assert len(log) == 32
    assert log[0].code == 7
    assert log[1].code == 5
    assert log[0].op_time - log[1].op_time == pytest.approx(0.01)


@pytest.mark.parametrize('code', [0, 24, 27, 38, 45, 99])
def test_what_is_no_fault_cannot_be_injected(bench, code):
    with pytest.raises(ValueError, match='no fault'):
        bench.drive.trip(code)


def test_a_power_cycle_ends_a_fault_whose_cause_is_gone(bench):
    bench.drive.trip(5)
    bench.drive.trip(7, cause_present=True)
    bench.drive.power_cycle(0.1)
    bench.drive.advance(1)
    assert bench.drive.faults.codes == [7]
    assert bench.state == 'FAULTED'
    bench.drive.end_fault_causes()
    bench.drive.power_cycle(0.1)
    bench.drive.advance(1)
    assert bench.inv_st == 24


def test_a_fault_under_the_terminals_runs_again_when_acknowledged(bench):
    bench.mode(2)
    bench.drive.advance(5)
    bench.drive.trip(5)
    bench.drive.advance(5)
    assert bench.read('fieldbus.mode') == 2
    acknowledge(bench)
    assert bench.running


# ---- SioTot and AutoStop ----


def watched(bench, *, auto_stop, sio_tot=2.0):
    bench.write('serial.sio_tot', sio_tot)
    bench.write('serial.auto_stop', auto_stop)
    bench.write('control.retard', 60.0)
    bench.run(20, 0.5)
    bench.drive.heard()
    return bench


def test_a_silent_bus_stops_the_motor_with_auto_stop(bench):
    watched(bench, auto_stop=True)
    bench.drive.advance(1.9)
    assert bench.running
    bench.drive.advance(0.2)
    assert not bench.running
    assert bench.inv_st == 14
    assert bench.read('fieldbus.mode') == 1
    bench.drive.advance(15)
    assert not bench.drive.motor.turning


def test_every_valid_frame_keeps_it_going(bench):
    watched(bench, auto_stop=True)
    for _ in range(10):
        bench.drive.advance(1.5)
        bench.drive.heard()
    assert bench.running
    assert bench.inv_st == 38


@pytest.mark.parametrize('settings', [{'auto_stop': False}, {'auto_stop': True, 'sio_tot': 0}])
def test_without_auto_stop_or_time_the_motor_runs_on(bench, settings):
    watched(bench, **settings)
    bench.drive.advance(600)
    assert bench.running
    assert bench.inv_st == 38
    assert bench.read('status.frq_act') == 20


def test_a_drive_that_the_bus_does_not_control_does_not_mind(bench):
    bench.write('serial.sio_tot', 1.0)
    bench.write('serial.auto_stop', True)
    bench.drive.advance(10)
    assert bench.inv_st == 24
    bench.mode(2)
    bench.drive.advance(10)
    assert bench.running


def test_the_time_counts_from_taking_control(bench):
    bench.write('serial.sio_tot', 1.0)
    bench.write('serial.auto_stop', True)
    bench.drive.advance(10)
    bench.mode(3)
    bench.drive.advance(0.9)
    assert bench.inv_st == 37
    bench.drive.advance(0.2)
    assert bench.inv_st == 14


def test_a_silent_drive_hears_nothing_and_times_out(bench):
    watched(bench, auto_stop=True)
    bench.drive.silence(5)
    bench.drive.advance(2.1)
    assert bench.inv_st == 14


# ---- RstDly, TrTime and ErrCnt: the drive goes on by itself ----


def restarting(bench, code=5, tries=1, delay=2, trial=10):
    bench.write(TRIES[code], tries)
    bench.write('error.rst_dly', delay)
    bench.write('error.tr_time', trial)
    bench.run(20, 5)
    return bench


@pytest.mark.parametrize('code', TRIES)
def test_a_fault_with_tries_ends_by_itself_and_the_motor_runs_again(bench, code):
    restarting(bench, code)
    bench.drive.trip(code)
    bench.drive.advance(1.9)
    assert bench.inv_st == code
    assert not bench.running
    bench.drive.advance(0.3)
    assert bench.running
    assert bench.inv_st == 39
    assert bench.drive.control_unit.ack_reads == 0
    assert [entry.code for entry in bench.drive.faults.log] == [code]


def test_the_delay_counts_from_when_the_cause_is_gone(bench):
    restarting(bench)
    bench.drive.trip(5, cause_present=True)
    bench.drive.advance(100)
    assert bench.inv_st == 5
    bench.drive.end_fault_causes()
    bench.drive.advance(1.9)
    assert bench.inv_st == 5
    bench.drive.advance(0.3)
    assert bench.running


def test_without_tries_it_waits_to_be_acknowledged(bench):
    restarting(bench, tries=0)
    bench.drive.trip(5)
    bench.drive.advance(60)
    assert bench.inv_st == 5


@pytest.mark.parametrize('code', sorted(set(FAULTS) - set(TRIES)))
def test_a_fault_that_has_no_tries_never_ends_by_itself(bench, code):
    restarting(bench)
    bench.drive.trip(code)
    bench.drive.advance(60)
    assert bench.inv_st == code


def test_the_tries_are_used_up_unless_it_runs_well_for_a_while(bench):
    restarting(bench, tries=2, trial=10)
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


def test_it_restarts_nothing_when_the_command_was_taken_back_meanwhile(bench):
    bench.write('error.overload_err_cnt', 1)
    bench.write('error.rst_dly', 2)
    bench.write('fieldbus.drive_control', 0x4006)
    bench.write('fieldbus.drive_control', 0xC07F)
    assert bench.running
    bench.drive.trip(5)
    bench.write('fieldbus.drive_control', 0xC07E)  # not refused: it is how a fault is reset
    bench.drive.advance(10)
    assert (bench.running, bench.state) == (False, 'READY_TO_SWITCH_ON')


def test_a_control_word_needs_bit_0_low_after_a_fault_that_ended_by_itself(bench):
    bench.write('error.overload_err_cnt', 1)
    bench.write('fieldbus.drive_control', 0x4006)
    bench.write('fieldbus.drive_control', 0xC07F)
    bench.drive.trip(5)
    bench.drive.advance(10)
    assert (bench.running, bench.state) == (False, 'SWITCH_ON_DISABLED')
    bench.write('fieldbus.drive_control', 0xD07F)  # unless bit 12 is set
    assert bench.running
