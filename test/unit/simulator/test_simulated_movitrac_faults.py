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

"""Faults of a MOVITRAC 31..: the motor coasts, they are remembered, and reset by an edge."""

from movitrac_drive_bench import ACK
from movitrac_drive_bench import CONTROLLER_INHIBIT
from movitrac_drive_bench import CW
from movitrac_drive_bench import ENABLE
from movitrac_drive_bench import FAULT_T0
from movitrac_drive_bench import FAULT_T1
from movitrac_drive_bench import FREQUENCY
from movitrac_drive_bench import HEAT_SINK
from movitrac_drive_bench import INPUT_42
from movitrac_drive_bench import INPUT_47
from movitrac_drive_bench import NO_ENABLE
from movitrac_drive_bench import RAPID_STOP
from movitrac_drive_bench import RESET
from movitrac_drive_bench import STANDARD
from movitrac_drive_bench import MovitracBench
import pytest

OVERCURRENT, OVERHEATING, EXTERNAL, LINE = 1, 6, 27, 45
AUTO_RESET, RESTART_TIME, KEYPAD_RESET = 168, 167, 166
RESET_FUNCTION, EXTERNAL_FAULT_FUNCTION = 5, 12


@pytest.fixture
def bench():
    bench = MovitracBench()
    bench.run(25.0)
    return bench


def trip(bench, fault, **more):
    bench.drive.trip(100 + fault, **more)


def test_a_fault_lets_the_motor_coast(bench):
    trip(bench, OVERCURRENT)
    assert bench.fault == OVERCURRENT
    assert bench.number == CONTROLLER_INHIBIT
    assert not bench.running
    assert bench.drive.motor.turning
    bench.wait(10.0)
    assert bench.fault == OVERCURRENT


def test_the_rising_edge_of_the_bit_resets(bench):
    trip(bench, OVERCURRENT)
    bench.bits(0)
    assert bench.fault == OVERCURRENT
    bench.bits(RESET)
    assert bench.fault == 0
    assert bench.number == NO_ENABLE
    trip(bench, OVERCURRENT)
    bench.bits(RESET)
    assert bench.fault == OVERCURRENT, 'it was set before'
    bench.bits(0)
    bench.bits(RESET)
    assert bench.fault == 0


def test_run_bits_that_are_still_there_start_the_motor_with_the_reset(bench):
    trip(bench, OVERCURRENT)
    bench.bits(CW | ENABLE | RESET)
    assert bench.running


def test_no_reset_while_the_cause_lasts(bench):
    trip(bench, OVERHEATING, cause_present=True)
    bench.bits(RESET)
    assert bench.fault == OVERHEATING
    bench.bits(0)
    bench.drive.end_fault_causes()
    assert bench.fault == OVERHEATING
    bench.bits(RESET)
    assert bench.fault == 0


def test_the_bit_resets_nothing_in_another_control_mode(bench):
    bench.set(control_mode=STANDARD)
    trip(bench, OVERCURRENT)
    bench.bits(0)
    bench.bits(RESET)
    assert bench.fault == OVERCURRENT


def test_a_terminal_resets(bench):
    bench.set(input_47=RESET_FUNCTION)
    trip(bench, OVERCURRENT)
    bench.terminal(47, True)
    assert bench.fault == 0
    assert bench.running, 'the bits are still there'
    trip(bench, OVERCURRENT)
    bench.terminal(41, True)
    assert bench.fault == OVERCURRENT


def test_the_keypad_resets_where_it_may(bench):
    trip(bench, OVERCURRENT)
    assert bench.write(KEYPAD_RESET, 0) == ACK
    bench.unit.press('reset')
    assert bench.fault == OVERCURRENT
    assert bench.write(KEYPAD_RESET, 1) == ACK
    bench.unit.press('reset')
    assert bench.fault == 0


def test_auto_reset_starts_the_motor_again_after_a_while(bench):
    assert bench.write(AUTO_RESET, 1) == bench.write(RESTART_TIME, 3) == ACK
    trip(bench, OVERCURRENT)
    bench.wait(2.9)
    assert bench.fault == OVERCURRENT
    bench.wait(0.2)
    assert bench.fault == 0
    assert bench.running
    trip(bench, OVERCURRENT, cause_present=True)
    bench.wait(5.0)
    assert bench.fault == OVERCURRENT
    bench.drive.end_fault_causes()
    bench.wait(2.9)
    assert bench.fault == OVERCURRENT, 'it counts from when the cause has gone'
    bench.wait(0.2)
    assert bench.fault == 0


def test_an_external_fault_lasts_as_long_as_its_terminal_is_open(bench):
    bench.terminal(47, True)
    bench.set(input_47=EXTERNAL_FAULT_FUNCTION)
    assert bench.running
    bench.terminal(47, False)
    assert bench.fault == EXTERNAL
    bench.bits(RESET)
    assert bench.fault == EXTERNAL
    bench.bits(0)
    bench.terminal(47, True)
    assert bench.fault == EXTERNAL
    bench.bits(RESET)
    assert bench.fault == 0


def test_it_remembers_five_faults_and_what_was_measured(bench):
    assert bench.read(FAULT_T0) == 0
    trip(bench, OVERCURRENT)
    assert bench.read(FAULT_T0) == OVERCURRENT
    assert bench.read(403) == 25.0, 'the frequency'
    assert bench.read(402) == bench.read(HEAT_SINK)
    assert bench.read(400) == pytest.approx(560, abs=20)
    assert bench.word(407) >> 24 == OVERCURRENT
    assert bench.word(408) & 0xFF == 0b0100
    bench.bits(RESET)
    for fault in (2, 3, 4, 5):
        trip(bench, fault)
        bench.bits(0)
        bench.bits(RESET)
    assert [bench.read(index) for index in range(8, 13)] == [5, 4, 3, 2, 1]
    assert bench.read(412) == 0
    assert bench.read(439) == 25.0
    trip(bench, 6)
    assert [bench.read(index) for index in range(8, 13)] == [6, 5, 4, 3, 2]
    bench.drive.power_cycle(0.0)
    assert bench.read(FAULT_T0) == 6, 'that is the memory'
    assert bench.fault == 0


def test_a_fault_that_is_active_is_remembered_once(bench):
    trip(bench, OVERCURRENT)
    trip(bench, OVERCURRENT)
    assert bench.read(FAULT_T1) == 0


# ---- PC time-out ----


def test_a_silent_line_is_fault_45(bench):
    bench.set(pc_timeout=1.0)
    bench.wait(0.9)
    assert bench.fault == 0
    bench.wait(0.9)
    assert bench.running, 'asking has kept it alive'
    bench.wait(0.2)
    assert not bench.running
    assert bench.fault == LINE
    bench.bits(0)
    bench.bits(RESET)
    assert bench.fault == 0, 'the line speaks again, so the cause is gone'


def test_the_time_out_can_be_reset_by_nobody_while_the_line_is_silent(bench):
    bench.set(pc_timeout=1.0)
    bench.wait(1.1)
    bench.unit.press('reset')
    assert bench.drive.faults.codes == [100 + LINE]


def test_no_time_out_where_the_line_has_no_say(bench):
    bench.set(control_mode=STANDARD, pc_timeout=0.1)
    bench.wait(5.0)
    assert bench.fault == 0
    bench.set(pc_timeout=0.0, control_mode=2)
    bench.wait(60.0)
    assert bench.fault == 0


def test_fault_45_can_ramp_the_motor_down():
    bench = MovitracBench(timeout_stop='ramps')
    bench.set(t13_stop=1.0)
    bench.run(25.0)
    bench.set(pc_timeout=1.0)
    bench.wait(1.1)
    assert bench.fault == LINE
    assert bench.number == RAPID_STOP
    assert bench.running
    assert 10.0 < bench.read(FREQUENCY) < 25.0
    bench.wait(0.9)
    assert not bench.running
    assert bench.number == CONTROLLER_INHIBIT
    assert bench.fault == LINE


def test_another_fault_lets_the_motor_coast_that_fault_45_ramps_down():
    bench = MovitracBench(timeout_stop='ramps')
    bench.set(t13_stop=5.0)
    bench.run(25.0)
    bench.set(pc_timeout=1.0)
    bench.wait(1.1)
    assert bench.running
    trip(bench, OVERCURRENT)
    assert not bench.running


def test_an_injected_external_fault_lasts_until_its_cause_is_gone(bench):
    trip(bench, EXTERNAL, cause_present=True)
    bench.bits(RESET)
    assert bench.fault == EXTERNAL
    bench.bits(0)
    bench.drive.end_fault_causes()
    bench.bits(RESET)
    assert bench.fault == 0


def test_a_reassigned_terminal_42_turns_nothing(bench):
    bench.bits(0)
    bench.until(lambda: not bench.running)
    bench.set(input_42=9)
    bench.terminal(42, True)
    assert not bench.running
    assert bench.write(INPUT_42, 0) == ACK
    assert bench.running


def test_a_terminal_without_a_function_is_no_reset(bench):
    trip(bench, OVERCURRENT)
    bench.terminal(47, True)
    assert bench.fault == OVERCURRENT
    assert bench.write(INPUT_47, RESET_FUNCTION) == ACK
    assert bench.fault == OVERCURRENT, 'an edge of the terminal it is that resets'
