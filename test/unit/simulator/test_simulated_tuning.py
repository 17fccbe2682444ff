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


"""Tuning in the simulated drive: SCMD 201h to 501h [M0 table 18]."""

import pytest

from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.sinus_g2.tuning import PROCEDURES


def settings(bench):
    return {key: bench.drive.peek(key) for key in bench.drive.settings}


def begin(bench, code=Scmd.FULL_TUNING):
    bench.mode(3)
    bench.scmd(code)


@pytest.mark.parametrize(('code', 'shown'), [(0x201, 45), (0x301, 45), (0x401, 46), (0x501, 47)])
def test_each_takes_its_time_and_changes_its_parameters(bench, code, shown):
    before = settings(bench)
    begin(bench, code)
    assert bench.inv_st == 28
    assert bench.read('fieldbus.mode') == 0
    bench.drive.advance(PROCEDURES[code].seconds - 0.1)
    assert bench.inv_st == 28
    assert settings(bench) == before
    bench.drive.advance(0.2)
    assert bench.inv_st == shown
    assert bench.read('fieldbus.mode') == 3
    after = settings(bench)
    assert {key for key in after if after[key] != before[key]} == set(PROCEDURES[code].finds)
    # nobody wrote them over the bus
    assert bench.drive.writes == {}
    bench.scmd(0)
    assert bench.inv_st == 37


@pytest.mark.parametrize('code', [16, 17])
def test_a_failure_is_a_fault_and_changes_nothing(bench, code):
    before = settings(bench)
    bench.drive.control_unit.fail_tuning(code)
    begin(bench)
    bench.drive.advance(10)
    assert bench.inv_st == code
    assert bench.drive.faults.log[0].code == code
    assert settings(bench) == before
    bench.read('fieldbus.inv_st_with_ack')
    # the next one succeeds
    begin(bench)
    bench.drive.advance(10)
    assert bench.inv_st == 45


def test_it_fails_with_no_other_code(bench):
    with pytest.raises(ValueError, match=r'16, 17'):
        bench.drive.control_unit.fail_tuning(5)


def test_nothing_but_a_stop_is_taken_meanwhile(bench):
    begin(bench)
    for mode in (1, 2, 3):
        with bench.refuses(Reason.STATE):
            bench.mode(mode)
    with bench.refuses(Reason.STATE):
        bench.scmd(Scmd.FIELDBUS)
    assert bench.inv_st == 28
    before = settings(bench)
    bench.scmd(Scmd.STOP)
    assert bench.inv_st == 37
    bench.drive.advance(10)
    assert settings(bench) == before


def test_a_drive_that_refuses_a_stop_until_it_is_over(make_bench):
    bench = make_bench(stop_in_tuning='refused')
    begin(bench)
    with bench.refuses(Reason.STATE):
        bench.scmd(Scmd.STOP)
    assert bench.inv_st == 28
    bench.drive.advance(10)
    assert bench.inv_st == 45
    bench.scmd(Scmd.STOP)
    assert bench.inv_st == 37


def test_a_tuning_that_is_asked_for_in_a_fault_leads_to_nothing(bench):
    bench.mode(3)
    bench.drive.trip(5)
    bench.scmd(Scmd.FULL_TUNING)
    assert bench.read('fieldbus.mode') == 3
    bench.read('fieldbus.inv_st_with_ack')
    bench.drive.advance(1)
    assert bench.inv_st == 37


@pytest.mark.parametrize('what', ['run', 'keypad', 'fault', 'power'])
def test_what_else_ends_it(bench, what):
    before = settings(bench)
    begin(bench)
    drive = bench.drive
    {
        'run': lambda: drive.set_run_input(False),
        'keypad': lambda: drive.control_unit.press('stop'),
        'fault': lambda: drive.trip(5),
        'power': drive.power_cycle,
    }[what]()
    drive.advance(10)
    assert bench.inv_st != 28
    assert settings(bench) == before


def test_without_run_only_the_calculation_begins(bench):
    bench.drive.set_run_input(False)
    begin(bench)
    assert bench.inv_st == 37
    bench.scmd(Scmd.PAR_CALC)
    assert bench.inv_st == 28


def test_it_needs_bus_control_and_a_motor_that_stands(bench):
    with bench.refuses(Reason.STATE):
        bench.scmd(Scmd.FULL_TUNING)
    bench.run(20, 5)
    with bench.refuses(Reason.STATE):
        bench.scmd(Scmd.FULL_TUNING)
