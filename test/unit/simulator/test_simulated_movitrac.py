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

"""A MOVITRAC 31.. that is commanded: by its terminals, by the line, by its keypad."""

from movitrac_drive_bench import ACK
from movitrac_drive_bench import CCW
from movitrac_drive_bench import CHANGE_DIRECTION
from movitrac_drive_bench import CONTROL_MODE
from movitrac_drive_bench import CONTROLLER_INHIBIT
from movitrac_drive_bench import CW
from movitrac_drive_bench import ENABLE
from movitrac_drive_bench import ENABLED
from movitrac_drive_bench import F_MIN
from movitrac_drive_bench import FIELDBUS
from movitrac_drive_bench import FREQUENCY
from movitrac_drive_bench import INHIBIT
from movitrac_drive_bench import INPUT_47
from movitrac_drive_bench import MANUAL_OPERATION
from movitrac_drive_bench import NO_ENABLE
from movitrac_drive_bench import NORMAL_STOP
from movitrac_drive_bench import RAPID_STOP
from movitrac_drive_bench import REMOTE_CONTROL
from movitrac_drive_bench import REMOTE_SETPOINT
from movitrac_drive_bench import SECOND_RAMP
from movitrac_drive_bench import SECOND_SET
from movitrac_drive_bench import SETPOINT
from movitrac_drive_bench import SPEED
from movitrac_drive_bench import STANDARD
from movitrac_drive_bench import TERMINALS
from movitrac_drive_bench import MovitracBench
import pytest

OFFSET_MANUAL = 197


@pytest.fixture
def bench():
    return MovitracBench()


# ---- the line ----


def test_it_stands_until_a_direction_is_given(bench):
    assert bench.number == NO_ENABLE
    bench.run(25.0, bits=ENABLE)
    assert not bench.running
    assert bench.number == NO_ENABLE
    bench.bits(CW | ENABLE)
    assert bench.running
    assert bench.number == ENABLED


@pytest.mark.parametrize(('direction', 'clockwise'), [(CW, True), (CCW, False)])
def test_it_runs_either_way_and_shows_sizes(bench, direction, clockwise):
    bench.run(30.0, bits=direction | ENABLE)
    assert bench.read(FREQUENCY) == 30.0
    assert bench.read(SPEED) == pytest.approx(890, abs=10)
    assert bench.clockwise is clockwise
    assert (bench.drive.motor.rotor > 0) is clockwise


def test_the_ramp_up_is_for_50_hz(bench):
    bench.set(t11_up=2.0)
    bench.run(50.0, seconds=1.0)
    assert bench.read(FREQUENCY) == pytest.approx(25.0, abs=0.2)


def test_a_normal_stop_takes_the_ramp_down(bench):
    bench.set(t11_down=2.0)
    bench.run(50.0)
    bench.bits(ENABLE)
    bench.wait(1.0)
    assert bench.number == NORMAL_STOP
    assert bench.read(FREQUENCY) == pytest.approx(25.0, abs=0.2)
    bench.wait(1.5)
    assert bench.number == NO_ENABLE
    assert not bench.running


def test_both_directions_are_a_normal_stop(bench):
    bench.run(25.0)
    bench.bits(CW | CCW | ENABLE)
    assert bench.number == NORMAL_STOP
    bench.until(lambda: bench.number == NO_ENABLE)


def test_a_lost_enable_is_a_rapid_stop(bench):
    bench.set(t11_down=20.0, t13_stop=0.8)
    bench.run(25.0)
    bench.terminal(43, False)
    assert bench.number == RAPID_STOP
    bench.wait(0.2)
    assert bench.read(FREQUENCY) == pytest.approx(12.5, abs=0.5)
    bench.until(lambda: bench.number == NO_ENABLE)
    assert not bench.running


def test_an_enable_that_comes_back_starts_the_motor_by_the_bits_that_are_there(bench):
    bench.run(25.0)
    bench.terminal(43, False)
    bench.until(lambda: not bench.running)
    bench.terminal(43, True)
    assert bench.running


def test_another_direction_goes_through_zero(bench):
    bench.run(25.0)
    bench.bits(CCW | ENABLE)
    bench.wait(0.1)
    assert bench.number == CHANGE_DIRECTION
    assert bench.clockwise
    bench.until(lambda: bench.number == ENABLED)
    assert not bench.clockwise
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 25.0
    assert bench.drive.motor.rotor < 0


def test_the_controller_inhibit_lets_the_motor_coast(bench):
    bench.run(50.0)
    bench.bits(CW | ENABLE | INHIBIT)
    assert bench.number == CONTROLLER_INHIBIT
    assert not bench.running
    assert bench.drive.motor.turning
    assert bench.read(FREQUENCY) == 0
    bench.bits(CW | ENABLE)
    assert bench.number == ENABLED


def test_the_set_point_is_followed_while_it_runs(bench):
    bench.run(25.0)
    assert bench.write(SETPOINT, 10.05) == ACK
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 10.05


def test_the_set_point_is_held_within_f_min_and_f_max(bench):
    bench.run(400.0)
    assert bench.read(FREQUENCY) == 50.0
    bench.write(F_MIN, 5.0)
    bench.write(SETPOINT, 0.0)
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 5.0, 'set-point 0 is no stop'


def test_v_over_f(bench):
    bench.run(25.0)
    half = bench.read(1)
    bench.write(SETPOINT, 50.0)
    bench.wait(2.0)
    assert half == pytest.approx(200, abs=5)
    assert bench.read(1) == pytest.approx(400, abs=5)


def test_the_second_ramp(bench):
    bench.set(t11_up=1.0)
    assert bench.write(27, 4.0) == ACK
    bench.run(50.0, bits=CW | ENABLE | SECOND_RAMP, seconds=1.0)
    assert bench.read(FREQUENCY) == pytest.approx(12.5, abs=0.2)


def test_the_second_set_counts_where_its_selection_is_enabled(bench):
    bench.write(84, 30.0)  # f_max 2
    bench.run(50.0, bits=CW | ENABLE | SECOND_SET)
    assert bench.read(FREQUENCY) == 50.0
    assert bench.write(116, 1) == ACK
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 30.0
    assert bench.ask(284)[3] & 0x08


def test_v_over_f_pattern_3_has_limits_of_its_own(bench):
    assert bench.write(88, 0) == ACK
    assert bench.write(85, 8.0) == bench.write(86, 100) == bench.write(87, 90.0) == ACK
    bench.run(400.0, seconds=3.0)
    assert bench.read(FREQUENCY) == 90.0
    assert bench.read(1) == pytest.approx(360, abs=5), 'it is 400 V at 100 Hz'
    bench.write(SETPOINT, 0)
    bench.wait(3.0)
    assert bench.read(FREQUENCY) == 8.0


def test_magnetization_before_and_after(bench):
    for index in (277, 278):
        assert bench.write(index, 300) == ACK
    bench.run(25.0, seconds=0.2)
    assert bench.number == 2
    assert bench.read(FREQUENCY) == 0
    bench.wait(0.2)
    assert bench.number == ENABLED
    bench.bits(ENABLE)
    bench.until(lambda: bench.number == 3)
    bench.wait(0.35)
    assert bench.number == NO_ENABLE


def test_dc_braking_and_dc_holding_current(bench):
    assert bench.write(180, 1) == bench.write(181, 0.5) == bench.write(182, 20) == ACK
    bench.run(25.0)
    bench.bits(ENABLE)
    assert bench.number == 6
    bench.wait(1.0)
    assert bench.number == 7
    assert bench.running
    assert not bench.drive.motor.turning
    bench.terminal(43, False)
    assert not bench.running


def test_dc_heating_current(bench):
    assert bench.write(186, 1) == ACK
    bench.terminal(43, False)
    assert bench.number == 5
    assert bench.running
    bench.terminal(43, True)
    assert bench.number == NO_ENABLE


# ---- who commands ----


def test_the_terminals_command_in_standard_mode(bench):
    bench.terminal(41, True)
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 25.0, 'half of f_max, by the analog input'
    bench.terminal(47, True)
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 5.0, 'the fixed set-point n11'
    bench.terminal(41, False)
    bench.terminal(42, True)
    bench.until(lambda: not bench.clockwise)
    bench.terminal(43, False)
    bench.until(lambda: not bench.running)


def test_the_set_point_alone_comes_from_the_line_in_remote_set_point(bench):
    bench.terminal(41, True)
    bench.write(CONTROL_MODE, REMOTE_SETPOINT)
    bench.write(SETPOINT, 12.0)
    bench.wait(3.0)
    assert bench.read(FREQUENCY) == 12.0
    bench.bits(CCW)
    bench.wait(2.0)
    assert bench.clockwise
    assert bench.running


def test_a_direction_terminal_turns_the_motor_in_remote_control(bench):
    bench.terminal(41, True)
    bench.take(10.0)
    bench.wait(1.0)
    assert bench.read(FREQUENCY) == 10.0
    bench.bits(CCW | ENABLE)
    assert bench.number == NORMAL_STOP, 'with the terminal it is both'


def test_another_control_mode_can_start_the_motor(bench):
    bench.write(CONTROL_MODE, FIELDBUS)
    bench.terminal(41, True)
    assert not bench.running
    bench.write(CONTROL_MODE, STANDARD)
    assert bench.running


def test_a_terminal_can_inhibit(bench):
    assert bench.write(INPUT_47, 11) == ACK
    bench.run(25.0)
    assert bench.number == CONTROLLER_INHIBIT, 'it is open'
    bench.terminal(47, True)
    assert bench.number == ENABLED


def test_the_keypad_takes_over_and_gives_back(bench):
    bench.run(25.0)
    bench.unit.press('manual')
    assert bench.read(MANUAL_OPERATION) == 1
    assert bench.number == NORMAL_STOP, 'no key has chosen a direction'
    bench.until(lambda: not bench.running)
    bench.unit.press('ccw')
    bench.wait(2.0)
    assert bench.word(OFFSET_MANUAL) == 1
    assert bench.drive.motor.rotor < 0
    bench.unit.press('stop')
    bench.until(lambda: not bench.running)
    bench.unit.press('automatic')
    assert bench.running, 'the bits are still there'


def test_a_direction_key_of_automatic_operation_does_nothing(bench):
    bench.unit.press('cw')
    assert not bench.running
    bench.unit.press('manual')
    assert not bench.running, 'nor later'


def test_the_terminals_are_shown(bench):
    outputs = 0x0100 | 0x0200
    assert bench.word(TERMINALS) & 0xFF == 0b0100
    for number in (41, 42, 47):
        bench.terminal(number, True)
    assert bench.word(TERMINALS) & 0xFF == 0b1111
    bench.terminal(42, False)
    assert bench.running
    assert bench.word(TERMINALS) & outputs == outputs, 'brake released, ready'


def test_more_terminals_with_an_option_card():
    bench = MovitracBench(option_card='fio')
    assert bench.write(323, 1) == ACK  # terminal 54: enable
    bench.terminal(43, False)
    bench.terminal(54, True)
    assert bench.word(TERMINALS) & 0x40000
    bench.run(10.0)
    assert bench.running
    with pytest.raises(ValueError, match='no binary input 54'):
        MovitracBench().terminal(54, True)


# ---- power ----


def test_nobody_commands_after_power_on(bench):
    bench.run(25.0)
    bench.drive.power_cycle(0.0)
    bench.wait(1.0)
    assert bench.read(CONTROL_MODE) == REMOTE_CONTROL
    assert bench.word(281) == 0
    assert bench.read(SETPOINT) == 0
    assert not bench.running


def test_the_keypad_has_chosen_no_direction_after_power_on(bench):
    bench.unit.press('manual')
    bench.unit.press('cw')
    assert bench.running
    bench.drive.power_cycle(0.0)
    assert bench.read(MANUAL_OPERATION) == 1
    assert not bench.running


def test_the_terminals_start_the_motor_at_power_on(bench):
    bench.terminal(41, True)
    bench.drive.power_cycle(0.0)
    assert bench.running


def test_the_enable_is_the_run_input(bench):
    bench.drive.set_run_input(False)
    bench.run(25.0)
    assert not bench.running
    bench.drive.set_run_input(True)
    assert bench.running
    assert not MovitracBench(run_input=False).drive.control_unit.run_input
