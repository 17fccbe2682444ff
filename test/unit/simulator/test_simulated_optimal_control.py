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


"""The simulated Sinus Optimal under Drive Control, against its manual [M1]."""

from optimal_bench import AUTO
from optimal_bench import BRAKE
from optimal_bench import BUS
from optimal_bench import DISABLED
from optimal_bench import DRIVE_CONTROL
from optimal_bench import ENABLED
from optimal_bench import FAULT
from optimal_bench import FROM_BUS
from optimal_bench import INPUT_FREQUENCY
from optimal_bench import MANUAL
from optimal_bench import MODE
from optimal_bench import REACHED
from optimal_bench import READY
from optimal_bench import RUN_INPUT
from optimal_bench import SMODE
from optimal_bench import STATOR_FREQUENCY
from optimal_bench import STATUS
from optimal_bench import STOP
from optimal_bench import STOPPING
from optimal_bench import SWITCHED_ON
from optimal_bench import OptimalBench
import pytest

CONTROL = 0x4000
ENABLE = CONTROL | 0x0008
ON = ENABLE | 0x0001


@pytest.fixture
def optimal():
    return OptimalBench()


def test_the_example_of_the_manual(optimal):
    optimal.write(DRIVE_CONTROL, CONTROL)
    optimal.wait(0.1)
    assert optimal.bits == READY | FROM_BUS | BRAKE
    assert (optimal.read(MODE), optimal.text) == (BUS, 'Bus Stby')
    optimal.write(DRIVE_CONTROL, ENABLE)
    optimal.wait(0.1)
    assert optimal.bits == READY | FROM_BUS | ENABLED | BRAKE
    assert not optimal.running
    optimal.write(DRIVE_CONTROL, ON)
    optimal.wait(0.1)
    assert optimal.bits == READY | FROM_BUS | ENABLED | SWITCHED_ON | BRAKE
    assert optimal.text == 'Bus Acc'
    optimal.wait(5)
    assert optimal.bits == READY | FROM_BUS | ENABLED | SWITCHED_ON | REACHED | BRAKE
    assert optimal.text == 'Bus Run'
    optimal.write(DRIVE_CONTROL, ENABLE)
    assert optimal.bits == READY | FROM_BUS | SWITCHED_ON | BRAKE | STOPPING
    assert optimal.text == 'Bus Ret'
    optimal.wait(5)
    assert optimal.bits == READY | FROM_BUS | ENABLED | BRAKE
    assert not optimal.drive.motor.turning
    optimal.write(DRIVE_CONTROL, ON)
    optimal.wait(0.1)
    assert optimal.running


def test_the_setpoint_comes_from_the_terminals(optimal):
    optimal.write(INPUT_FREQUENCY, 400)
    optimal.switch_on(6)
    assert optimal.read(STATOR_FREQUENCY) == 250


@pytest.mark.parametrize(
    'words',
    [
        # all at once, and again
        (ON, ON, ON),
        # without one of them
        (0x0008, 0x0009),
        (CONTROL, CONTROL | 1),
        (0x0001, 0x0009),
        # the wrong order, as on a G2
        (CONTROL, CONTROL | 1, ON),
        (0x0008, ENABLE, ON),
        (CONTROL, ON),
    ],
)
def test_a_command_that_comes_too_early_does_nothing(optimal, words):
    for word in words:
        optimal.write(DRIVE_CONTROL, word)
        optimal.wait(1)
    assert not optimal.running
    assert optimal.read(DRIVE_CONTROL) == words[-1], 'it is read as it was written all the same'


def test_who_does_not_wait_for_the_answer_gets_nowhere(optimal):
    for word in (CONTROL, ENABLE, ON):
        optimal.write(DRIVE_CONTROL, word)
        optimal.wait(0.01)
    optimal.wait(1)
    assert not optimal.running
    assert optimal.bits & (FROM_BUS | ENABLED) == FROM_BUS


def test_control_by_mode_does_not_stand_in_for_the_answer(optimal):
    optimal.write(MODE, BUS)
    optimal.write(DRIVE_CONTROL, CONTROL)
    optimal.write(DRIVE_CONTROL, ENABLE)
    optimal.wait(1)
    assert optimal.bits & (FROM_BUS | ENABLED) == FROM_BUS


def test_what_came_too_early_can_be_given_again(optimal):
    optimal.write(DRIVE_CONTROL, ON)
    optimal.wait(1)
    optimal.switch_on()
    assert optimal.running


@pytest.mark.parametrize('word', [CONTROL, CONTROL | 1, 0x0009, 0])
def test_without_one_of_the_bits_the_motor_stops(optimal, word):
    optimal.switch_on(5)
    optimal.write(DRIVE_CONTROL, word)
    assert optimal.bits & STOPPING
    optimal.wait(6)
    assert not optimal.drive.motor.turning
    has_control = bool(word & CONTROL)
    assert bool(optimal.bits & FROM_BUS) is has_control
    assert optimal.read(MODE) == (BUS if has_control else MANUAL)


def test_a_start_command_counts_when_the_motor_has_stopped(optimal):
    optimal.switch_on(5)
    optimal.write(DRIVE_CONTROL, ENABLE)
    optimal.write(DRIVE_CONTROL, ON)
    optimal.wait(10)
    assert not optimal.running
    optimal.write(DRIVE_CONTROL, ENABLE)
    optimal.write(DRIVE_CONTROL, ON)
    optimal.wait(1)
    assert optimal.running


def test_it_obeys_run(optimal):
    optimal.switch_on(5)
    optimal.drive.set_run_input(False)
    assert optimal.bits & (DISABLED | STOPPING) == DISABLED | STOPPING
    optimal.wait(6)
    assert not optimal.running
    optimal.drive.set_run_input(True)
    assert optimal.running, 'the run command stood'


@pytest.mark.parametrize(('word', 'echo'), [(2, 1 << 4), (4, 1 << 5), (6, 3 << 4), (0, 0)])
def test_bits_1_and_2_come_back_as_4_and_5(optimal, word, echo):
    optimal.write(DRIVE_CONTROL, word)
    assert optimal.bits & (3 << 4) == echo


def test_the_bits_that_are_not_used_do_nothing(optimal):
    optimal.write(DRIVE_CONTROL, 0xBF70)
    optimal.wait(1)
    assert optimal.bits == READY | BRAKE


def test_a_fault_is_acknowledged_when_bit_7_rises(optimal):
    optimal.write(DRIVE_CONTROL, 0x80)
    optimal.drive.trip(5)
    optimal.write(DRIVE_CONTROL, 0x80)
    assert optimal.bits & FAULT, 'it did not rise'
    optimal.write(DRIVE_CONTROL, 0)
    assert optimal.bits & FAULT
    optimal.write(DRIVE_CONTROL, 0x80)
    assert not optimal.bits & FAULT
    assert optimal.read(STATUS) == 24


def test_an_enable_command_is_not_taken_in_a_fault(optimal):
    optimal.write(DRIVE_CONTROL, CONTROL)
    optimal.wait(0.1)
    optimal.drive.trip(5)
    optimal.write(DRIVE_CONTROL, ENABLE | 0x80)
    optimal.wait(1)
    assert optimal.bits & (FAULT | ENABLED) == 0


def test_the_run_command_stands_through_a_fault(optimal):
    optimal.switch_on(5)
    optimal.drive.trip(5)
    assert optimal.bits & (ENABLED | SWITCHED_ON) == 0
    optimal.wait(10)
    optimal.write(DRIVE_CONTROL, ON | 0x80)
    assert optimal.running


def test_a_variant_drops_the_run_command_by_a_fault():
    optimal = OptimalBench(run_command_in_fault='drops')
    optimal.switch_on(5)
    optimal.drive.trip(5)
    optimal.wait(10)
    optimal.write(DRIVE_CONTROL, ON | 0x80)
    optimal.wait(1)
    assert not optimal.running
    assert optimal.bits & ENABLED
    optimal.write(DRIVE_CONTROL, ENABLE)
    optimal.write(DRIVE_CONTROL, ON)
    optimal.wait(0.1)
    assert optimal.running
    optimal.drive.trip(5)
    optimal.wait(10)
    optimal.read(STATUS)
    optimal.wait(1)
    assert not optimal.running


def test_what_else_is_chosen_leaves_the_run_command_as_is_usual():
    optimal = OptimalBench(refuses_in_fault='scmd')
    optimal.switch_on(5)
    optimal.drive.trip(5)
    optimal.wait(10)
    optimal.write(DRIVE_CONTROL, ON | 0x80)
    assert optimal.running


@pytest.mark.parametrize('mode', [MANUAL, AUTO])
def test_who_takes_control_away_ends_the_commands(optimal, mode):
    optimal.write(DRIVE_CONTROL, CONTROL)
    optimal.wait(0.1)
    optimal.write(MODE, mode)
    optimal.write(DRIVE_CONTROL, ENABLE)
    optimal.wait(1)
    assert optimal.read(MODE) == mode
    assert not optimal.bits & (FROM_BUS | ENABLED)


def test_stop_on_the_keypad(optimal):
    optimal.switch_on(5)
    optimal.drive.control_unit.press('stop')
    assert optimal.bits & STOPPING
    optimal.wait(10)
    assert (optimal.text, optimal.read(MODE)) == ('Stop', MANUAL)
    optimal.write(DRIVE_CONTROL, ON)
    optimal.wait(1)
    assert not optimal.running, 'the word that stood has no effect any more'


def test_mixed_methods_do_not_stop_each_other(optimal):
    optimal.switch_on(5)
    optimal.write(SMODE, STOP)
    optimal.wait(10)
    assert optimal.running
    optimal.write(SMODE, RUN_INPUT)
    optimal.write(DRIVE_CONTROL, 0)
    optimal.write(MODE, BUS)
    optimal.write(SMODE, RUN_INPUT)
    optimal.write(DRIVE_CONTROL, CONTROL)
    optimal.wait(1)
    optimal.write(DRIVE_CONTROL, 0)
    optimal.wait(10)
    assert optimal.running


def test_power_cycle_forgets_the_control_word(optimal):
    optimal.switch_on(5)
    optimal.drive.power_cycle(0)
    optimal.wait(1)
    assert (optimal.read(DRIVE_CONTROL), optimal.running) == (0, False)
    optimal.switch_on()
