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

"""Control by the words of the generic state machine."""

import pytest

from nfo_sinus_driver.simulator.modbus import server

POWER = 0x4006
READY_TO_RUN = 0xC077  # NetRef, NetCtrl, ramp generator, switched on


def test_drive_control_runs_in_both_directions(bench):
    bench.write('status.frq_set', 20)
    bench.write('fieldbus.drive_control', POWER)
    assert bench.read('fieldbus.mode') == 3
    assert bench.state == 'READY_TO_SWITCH_ON'
    bench.write('fieldbus.drive_control', READY_TO_RUN)
    assert bench.state == 'SWITCHED_ON'
    bench.write('fieldbus.drive_control', READY_TO_RUN | 1 << 3)
    bench.drive.advance(5)
    assert bench.read('status.frq_act') == 20
    bench.write('fieldbus.drive_control', READY_TO_RUN | 1 << 13)
    bench.drive.advance(10)
    assert bench.read('status.frq_act') == -20
    assert bench.read('fieldbus.drive_status') & 0x4300 == 0x4300
    bench.write('fieldbus.drive_control', READY_TO_RUN)
    assert bench.state == 'DISABLE'
    bench.drive.advance(10)
    assert bench.state == 'SWITCHED_ON'
    assert bench.read('fieldbus.drive_control') == READY_TO_RUN


def test_drive_control_needs_an_edge_of_switch_on(bench):
    bench.write('fieldbus.drive_control', READY_TO_RUN | 1 << 3)
    assert bench.state == 'SWITCH_ON_DISABLED'
    bench.write('fieldbus.drive_control', POWER)
    bench.write('fieldbus.drive_control', READY_TO_RUN | 1 << 3)
    assert bench.running


def test_drive_control_quick_stop_coasts(bench):
    bench.write('status.frq_set', 20)
    bench.write('fieldbus.drive_control', POWER)
    bench.write('fieldbus.drive_control', READY_TO_RUN | 1 << 3)
    bench.drive.advance(5)
    bench.write('fieldbus.drive_control', (READY_TO_RUN | 1 << 3) & ~4)
    assert bench.state == 'QUICK_STOP'
    assert not bench.running
    bench.drive.advance(0.1)
    assert bench.state == 'SWITCH_ON_DISABLED'


@pytest.mark.parametrize(('bit', 'frequency'), [(4, 0), (5, 10), (6, 0)])
def test_the_bits_of_the_ramp_generator(bench, bit, frequency):
    bench.write('status.frq_set', 20)
    bench.write('fieldbus.drive_control', POWER)
    bench.write('fieldbus.drive_control', READY_TO_RUN | 1 << 3)
    bench.drive.advance(1)
    bench.write('fieldbus.drive_control', (READY_TO_RUN | 1 << 3) & ~(1 << bit))
    bench.drive.advance(5)
    assert bench.read('status.frq_act') == pytest.approx(frequency, abs=0.2)
    assert bench.running


def test_the_write_mask(bench):
    bench.write('fieldbus.drive_control', POWER)
    server(bench.drive).write(0x250, [0xFFFF, 0x0001])  # AND, OR
    assert bench.read('fieldbus.drive_control') == POWER | 1
    server(bench.drive).write(0x250, [0xFFFE, 0x0000])
    assert bench.read('fieldbus.drive_control') == POWER


def test_drive_control_without_net_ctrl_is_nothing(bench):
    bench.write('fieldbus.drive_control', 0x000F)
    assert bench.read('fieldbus.mode') == 1
    assert not bench.running
    bench.write('fieldbus.drive_control', POWER)
    assert bench.read('fieldbus.mode') == 3
    bench.write('fieldbus.drive_control', 0)
    assert bench.read('fieldbus.mode') == 1


def test_drive_control_obeys_run(bench):
    bench.write('status.frq_set', 20)
    bench.write('fieldbus.drive_control', POWER)
    bench.write('fieldbus.drive_control', READY_TO_RUN | 1 << 3)
    bench.drive.set_run_input(False)
    bench.drive.advance(5)
    assert not bench.running
    bench.drive.set_run_input(True)
    assert bench.running
