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

"""A MOVITRAC 31.. to which things happen in any order: what holds whatever it was."""

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from movitrac_drive_bench import ADDRESS
from movitrac_drive_bench import CONTROL_MODE
from movitrac_drive_bench import F_MAX
from movitrac_drive_bench import F_MIN
from movitrac_drive_bench import FREQUENCY
from movitrac_drive_bench import INPUT_42
from movitrac_drive_bench import INPUT_47
from movitrac_drive_bench import PC_TIMEOUT
from movitrac_drive_bench import SETPOINT
from movitrac_drive_bench import STATUS
from movitrac_drive_bench import T13_STOP
from movitrac_drive_bench import MovitracBench
import pytest

from nfo_sinus_driver.simulator.family import load

TERMINALS = (41, 42, 43, 47)
KEYS = ('manual', 'automatic', 'cw', 'ccw', 'stop', 'reset')
WRITES = {
    SETPOINT: (0, 5, 25, 400),
    CONTROL_MODE: (0, 1, 2, 2, 2, 3),
    PC_TIMEOUT: (0, 0.3, 5),
    INPUT_42: (0, 1, 9, 11, 12, 16),
    INPUT_47: (3, 5, 10, 11, 12),
    F_MIN: (0, 5),
    F_MAX: (20, 50),
    T13_STOP: (0, 0.5, 5),
    116: (0, 1),
    168: (0, 1),
    180: (0, 1),
    186: (0, 1),
    203: (0, 1),
    277: (0, 100),
}

SWITCHES = st.fixed_dictionaries(
    {option.name: st.sampled_from(option.choices) for option in load('movitrac31').options}
)
writes = st.sampled_from(sorted(WRITES)).flatmap(
    lambda index: st.tuples(st.just('write'), st.just(index), st.sampled_from(WRITES[index]))
)
EVENTS = st.lists(
    st.one_of(
        writes,
        st.tuples(st.just('bits'), st.sampled_from([0, 1, 2, 5, 6, 7, 0x40, 0x105, 0x1005, 0xD])),
        st.tuples(st.just('terminal'), st.sampled_from(TERMINALS), st.booleans()),
        st.tuples(st.just('key'), st.sampled_from(KEYS)),
        st.tuples(st.just('fault'), st.sampled_from([1, 6, 27, 45]), st.booleans()),
        st.tuples(st.just('cause gone')),
        st.tuples(st.just('power')),
    ),
    max_size=25,
)
PAUSES = st.sampled_from([0.0, 0.02, 0.4, 3.0])


def happen(bench, what, *values):
    if what == 'write':
        bench.write(*values)
    elif what == 'bits':
        bench.bits(*values)
    elif what == 'terminal':
        bench.terminal(*values)
    elif what == 'key':
        bench.unit.press(*values)
    elif what == 'fault':
        bench.drive.trip(100 + values[0], cause_present=values[1])
    elif what == 'cause gone':
        bench.drive.end_fault_causes()
    else:
        bench.drive.power_cycle(0.0)


@settings(deadline=None, max_examples=150)
@given(SWITCHES, st.lists(st.tuples(EVENTS, PAUSES), max_size=3))
def test_what_always_holds(switches, rounds):
    bench = MovitracBench(**switches)
    for events, pause in rounds:
        for event in events:
            happen(bench, *event)
            judge(bench, switches)
        bench.wait(pause)
        judge(bench, switches)


def judge(bench, switches):
    unit, motor = bench.unit, bench.drive.motor
    state = unit.report()
    ramps = switches['timeout_stop'] == 'ramps' and bench.drive.faults.codes == [145]
    if bench.drive.faults and not ramps:
        assert not motor.driven
    if state['inhibited']:
        assert not motor.driven
    if motor.driven:
        assert abs(motor.demand) <= 50.0
    shown = bench.ask(STATUS)
    assert bool(shown[0]) == bool(bench.drive.faults)
    assert 0 <= bench.read(FREQUENCY) <= 60.0
    assert bench.read(ADDRESS) == 0
    if state['phase'] == 'off':
        assert not motor.driven


@pytest.mark.parametrize('mode', [0, 1, 2, 3])
def test_a_lost_enable_always_ends_in_standstill(mode):
    bench = MovitracBench()
    bench.run(25.0)
    bench.write(CONTROL_MODE, mode)
    bench.terminal(41, mode != 2)
    bench.wait(0.5)
    bench.terminal(43, False)
    bench.wait(2.0)
    assert not bench.drive.motor.turning
