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

"""The RUN input, the keypad and the mains of a simulated drive."""

import pytest

from nfo_sinus_driver.simulator.memory import Reason


@pytest.mark.parametrize('st_mode', ['Brake', 'Release'])
def test_run_lost_stops_and_run_back_starts_again_by_itself(bench, st_mode):
    bench.write('control.st_mode', st_mode)
    bench.run(20, 5)
    bench.drive.set_run_input(False)
    assert bench.running is (st_mode == 'Brake')
    bench.drive.advance(10)
    assert not bench.drive.motor.turning
    assert bench.inv_st == 37
    bench.drive.set_run_input(True)
    assert bench.running
    bench.drive.advance(5)
    assert bench.read('status.frq_act') == 20


def test_a_run_command_without_run_waits_for_it(make_bench):
    bench = make_bench(run_input=False)
    bench.run(20, 1)
    assert bench.inv_st == 37
    assert not bench.running
    bench.drive.set_run_input(True)
    assert bench.running


def test_a_stop_while_run_is_lost_is_a_stop(bench):
    bench.run(20, 5)
    bench.drive.set_run_input(False)
    bench.scmd(0)
    bench.drive.advance(10)
    bench.drive.set_run_input(True)
    bench.drive.advance(1)
    assert not bench.running


def test_the_stop_key_releases_the_motor_and_takes_the_control_away(bench):
    bench.run(20, 5)
    bench.drive.control_unit.press('stop')
    assert not bench.running
    assert bench.read('fieldbus.mode') == 1
    assert bench.inv_st == 24
    with bench.refuses(Reason.STATE):
        bench.scmd(0x101)
    bench.mode(3)
    bench.drive.advance(20)
    assert not bench.running


def test_the_ext_key_starts_from_the_terminals(bench):
    bench.drive.control_unit.press('ext')
    assert bench.read('fieldbus.mode') == 2
    assert bench.running


def test_running_from_the_keypad(make_bench):
    bench = make_bench(run_input=False)
    bench.drive.control_unit.press('start')
    assert bench.read('fieldbus.mode') == 2
    assert bench.inv_st == 31
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
    assert not bench.drive.listening
    assert bench.state == 'NOT_READY_TO_SWITCH_ON'
    assert not bench.running
    assert bench.drive.motor.turning
    bench.drive.advance(1.9)
    assert not bench.drive.listening
    bench.drive.advance(0.2)
    assert bench.drive.listening
    assert bench.read('fieldbus.mode') == 1
    assert bench.inv_st == 24
    assert bench.read('status.frq_set') == 20
    assert bench.read('control.accel') == 7.0
    assert bench.drive.counters.operating_time >= hours
    bench.mode(3)
    bench.drive.advance(10)
    assert not bench.running
    bench.scmd(0x101)  # the old set-point is still there
    bench.drive.advance(10)
    assert bench.read('status.frq_act') == 20


@pytest.mark.parametrize(('run_input', 'inv_st'), [(True, 35), (False, 33)])
def test_autostart_is_ext_after_power_on(make_bench, run_input, inv_st):
    bench = make_bench(run_input=run_input, settings={'control.auto_start': True})
    bench.mode(1)
    bench.drive.power_cycle(0.5)
    bench.drive.advance(0.6)
    assert bench.inv_st == inv_st
    assert bench.running is run_input


def test_a_new_address_counts_from_the_next_power_on(bench):
    bench.write('serial.address', 9)
    assert bench.drive.address == 1
    bench.drive.power_cycle()
    bench.drive.advance(3)
    assert bench.drive.address == 9


def test_a_new_address_counts_at_once_with_auto_reset(bench):
    bench.write('serial.auto_reset', True)
    bench.write('serial.address', 9)
    assert bench.drive.address == 9


def test_silence_leaves_the_motor_alone(bench):
    bench.run(20, 5)
    bench.drive.silence(3)
    bench.drive.advance(2.9)
    assert not bench.drive.listening
    assert bench.running
    bench.drive.advance(0.2)
    assert bench.drive.listening
