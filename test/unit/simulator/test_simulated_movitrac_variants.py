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

"""What the manual of the MOVITRAC 31.. leaves open: each reading is a switch."""

from movitrac_drive_bench import ACK
from movitrac_drive_bench import CCW
from movitrac_drive_bench import CONTROL_MODE
from movitrac_drive_bench import CW
from movitrac_drive_bench import ENABLE
from movitrac_drive_bench import ENABLED
from movitrac_drive_bench import HEAT_SINK
from movitrac_drive_bench import INHIBIT
from movitrac_drive_bench import NO_ENABLE
from movitrac_drive_bench import NORMAL_STOP
from movitrac_drive_bench import RAPID_STOP
from movitrac_drive_bench import REMOTE_CONTROL
from movitrac_drive_bench import REMOTE_SETPOINT
from movitrac_drive_bench import RESET
from movitrac_drive_bench import SETPOINT
from movitrac_drive_bench import STANDARD
from movitrac_drive_bench import T11_UP
from movitrac_drive_bench import MovitracBench
from movitrac_drive_bench import enquiry
from movitrac_drive_bench import nack
import pytest

from nfo_sinus_driver.simulator.family import load


@pytest.mark.parametrize(
    ('numbers', 'stop', 'fault'), [('binary', 12, 45), ('bcd', 0x12, 0x45)]
)
def test_how_status_and_fault_stand_in_their_bytes(numbers, stop, fault):
    bench = MovitracBench(status_numbers=numbers)
    bench.run(25.0)
    bench.bits(ENABLE)
    assert bench.number == stop
    bench.drive.trip(145)
    assert bench.fault == fault
    assert bench.read(8) == 45, 'the fault memory is decimal in any case'


@pytest.mark.parametrize(
    ('enable_bit', 'runs_without_bit', 'runs_without_terminal'),
    [('ored', True, False), ('anded', False, False), ('either', True, True)],
)
def test_the_enable_bit_and_the_enable_terminal(
    enable_bit, runs_without_bit, runs_without_terminal
):
    bench = MovitracBench(enable_bit=enable_bit)
    bench.run(25.0)
    assert bench.running
    bench.bits(CW)
    assert bench.running
    bench.wait(3.0)
    assert bench.running is runs_without_bit
    bench.bits(CW | ENABLE)
    bench.wait(1.0)
    assert bench.running
    bench.terminal(43, False)
    bench.wait(3.0)
    assert bench.running is runs_without_terminal
    bench.bits(CW)
    bench.wait(3.0)
    assert not bench.running


def test_the_enable_bit_is_a_rapid_stop_where_it_counts():
    bench = MovitracBench(enable_bit='anded')
    bench.run(25.0)
    bench.bits(CW)
    assert bench.number == RAPID_STOP


def test_what_the_mode_has_no_use_for_is_ignored():
    bench = MovitracBench()
    assert bench.write(SETPOINT, 20.0) == ACK
    assert bench.bits(CW | ENABLE) == ACK
    assert bench.read(SETPOINT) == 0
    assert bench.word(281) == 0
    bench.write(CONTROL_MODE, REMOTE_CONTROL)
    assert not bench.running


def test_what_the_mode_has_no_use_for_is_refused():
    bench = MovitracBench(outside_remote_control='refused')
    assert bench.write(SETPOINT, 20.0) == nack(0x1B)
    assert bench.bits(CW | ENABLE) == nack(0x1B)
    bench.write(CONTROL_MODE, REMOTE_SETPOINT)
    assert bench.write(SETPOINT, 20.0) == ACK
    assert bench.bits(CW | ENABLE) == nack(0x1B)
    assert bench.word(281) == 0


def test_what_the_mode_has_no_use_for_is_taken_and_followed_later():
    bench = MovitracBench(outside_remote_control='taken')
    assert bench.write(SETPOINT, 20.0) == ACK
    assert bench.bits(CW | ENABLE) == ACK
    assert not bench.running
    assert bench.read(SETPOINT) == 20.0
    bench.write(CONTROL_MODE, REMOTE_CONTROL)
    assert bench.running


def test_a_reset_bit_that_waits_for_the_mode_is_no_edge_before():
    bench = MovitracBench(outside_remote_control='taken')
    bench.drive.trip(101)
    bench.bits(RESET)
    assert bench.fault == 1


@pytest.mark.parametrize(
    ('stop_status', 'on_the_way', 'standing'),
    [
        ('no_enable', NORMAL_STOP, NO_ENABLE),
        ('normal_stop', NORMAL_STOP, NORMAL_STOP),
        ('enable', ENABLED, ENABLED),
    ],
)
def test_what_is_shown_with_an_enable_and_no_direction(stop_status, on_the_way, standing):
    bench = MovitracBench(stop_status=stop_status)
    bench.run(25.0)
    bench.bits(ENABLE)
    assert bench.number == on_the_way
    bench.until(lambda: not bench.running)
    assert bench.number == standing
    bench.terminal(43, False)
    assert bench.number == NO_ENABLE


@pytest.mark.parametrize(('after', 'kept'), [('cleared', False), ('kept', True)])
def test_bits_and_set_point_after_power_on(after, kept):
    bench = MovitracBench(bits_after_power_on=after)
    bench.run(25.0, bits=CCW | ENABLE)
    bench.drive.power_cycle(1.0)
    bench.wait(2.0)
    assert bench.word(281) == (CCW | ENABLE) * kept
    assert bench.read(SETPOINT) == 25.0 * kept
    assert bench.running is kept


@pytest.mark.parametrize(('in_fault', 'runs'), [('kept', True), ('cleared', False)])
def test_the_bits_after_a_fault(in_fault, runs):
    bench = MovitracBench(bits_in_fault=in_fault)
    bench.run(25.0)
    bench.drive.trip(101)
    assert bench.word(281) == (CW | ENABLE) * runs
    bench.unit.press('reset')
    assert bench.running is runs


def test_standard_mode_is_never_a_use_for_either():
    bench = MovitracBench(outside_remote_control='refused')
    bench.run(25.0)
    bench.write(CONTROL_MODE, STANDARD)
    assert bench.write(SETPOINT, 20.0) == nack(0x1B)


def test_a_setting_can_need_an_output_stage_that_is_off():
    bench = MovitracBench(settings_need='output_off')
    bench.run(25.0)
    assert bench.write(T11_UP, 2.0) == nack(0x1C)
    assert bench.write(CONTROL_MODE, STANDARD) == nack(0x1C)
    assert bench.write(SETPOINT, 20.0) == ACK
    assert bench.bits(CW | ENABLE | INHIBIT) == ACK
    assert bench.write(T11_UP, 2.0) == ACK


def test_a_setting_can_need_the_controller_inhibit():
    bench = MovitracBench(
        settings_need='inhibit', settings={'terminal.input_47': '/Controller inhibit'}
    )
    bench.terminal(47, True)
    assert bench.write(CONTROL_MODE, REMOTE_CONTROL) == nack(0x2B)
    bench.terminal(47, False)
    assert bench.write(CONTROL_MODE, REMOTE_CONTROL) == ACK


def test_on_rs_232_every_address_is_answered():
    bench = MovitracBench(interface='rs232', option_card='fea')
    for address in (0, 12, 255):
        assert bench.say(enquiry(HEAT_SINK, address)) == bench.say(enquiry(HEAT_SINK))
        assert bench.say(enquiry(HEAT_SINK)) != b''


@pytest.mark.parametrize('option', load('movitrac31').options, ids=lambda option: option.name)
def test_a_switch_has_no_other_positions(option):
    for choice in option.choices:
        MovitracBench(**{option.name: choice})
    with pytest.raises(ValueError, match=option.name):
        MovitracBench(**{option.name: 'sideways'})
