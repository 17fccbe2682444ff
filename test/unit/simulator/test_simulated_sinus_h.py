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

"""The simulated Sinus H by the tables of its manual, typed in here by hand [M3]."""

from hypothesis import given
from hypothesis import strategies as st
import pytest

from nfo_sinus_driver.simulator.family import simulated_drive

S1, S2, S3, S4 = 'S1', 'S2', 'S3', 'S4'
BY_PLC = 0x0400
RAMP = 0x0070
# bits 3 to 0: OperationEnable is 1111, OperationDisable 0111, SwitchON x111, SwitchOFF x110
ENABLE, DISABLE, OFF, QUICK, COAST = 0xF, 0x7, 0x6, 0xB, 0xD
#: The patterns of bits 6 and 2 to 0 of ZSW1 [M3 §7.2.2].
PATTERN = {S1: 0x40, S2: 0x01, S3: 0x03, S4: 0x07}
#: Words that lead from power-on to each state.
WAY = {S1: (), S2: (OFF,), S3: (OFF, DISABLE), S4: (OFF, DISABLE, ENABLE)}


def table(state, bits):
    """What the table of [M3 §6] says of four bits of STW1 in a state."""
    quick, coast = not bits & 0x4, not bits & 0x2
    neither = not quick and not coast
    if state == S1:
        return S2 if neither and not bits & 1 else S1
    if state == S2:
        if quick or coast:
            return S1
        return S3 if bits & 1 else S2
    if state == S3:
        if neither and not bits & 1:
            return S2
        return S4 if bits == 0xF else S3
    if quick or coast:
        return S1
    return S3 if bits == 0x7 else S4


class Bench:
    """One drive behind a fieldbus; time passes when told, telegrams come every 20 ms or not."""

    def __init__(self, settings=None, **options):
        self.drive = simulated_drive('sinus_h', settings=settings, boot_time=0.0, **options)
        self.server = self.drive.servers['telegram1']
        self.unit = self.drive.control_unit
        self.word, self.setpoint = 0, 0
        self.zsw1 = self.actual = 0

    def send(self, word, setpoint=None):
        """Exchange one telegram."""
        self.word = word
        if setpoint is not None:
            self.setpoint = setpoint
        self.zsw1, self.actual = self.server.exchange(word, self.setpoint)

    def bits(self, low, setpoint=None):
        self.send(BY_PLC | RAMP | low, setpoint)

    def wait(self, seconds, telegrams=True):
        for _ in range(round(seconds / 0.02)):
            self.drive.advance(0.02)
            if telegrams:
                self.send(self.word)

    def go(self, state, setpoint=2000):
        for low in WAY[state]:
            self.bits(low, setpoint)
        assert self.state == state

    @property
    def state(self):
        return self.drive.control_unit.report()['state']

    @property
    def motor(self):
        return self.drive.motor


@pytest.fixture
def bench():
    return Bench()


# --- the states ---


@pytest.mark.parametrize('bits', range(16))
@pytest.mark.parametrize('state', [S1, S2, S3, S4])
def test_every_word_leads_where_the_table_says(bench, state, bits):
    bench.go(state)
    bench.bits(bits)
    assert bench.state == table(state, bits)
    assert bench.zsw1 & 0x47 == PATTERN[bench.state]


@pytest.mark.parametrize('bits', range(16))
@pytest.mark.parametrize('state', [S1, S2, S3, S4])
def test_without_bit_10_no_word_counts(bench, state, bits):
    bench.go(state)
    bench.send(RAMP | bits)
    assert bench.state == state


@pytest.mark.parametrize('word', [0x0000, 0x0001, 0x000F])
def test_a_word_of_zero_does_not_stop_the_motor(bench, word):
    bench.go(S4)
    bench.wait(4.0)
    bench.send(word)
    bench.wait(3.0)
    assert bench.actual == pytest.approx(2000, abs=1)
    assert bench.state == S4


def test_switching_off_in_operation_is_no_exit(bench):
    bench.go(S4)
    bench.bits(OFF)
    bench.wait(1.0)
    assert bench.state == S4
    assert bench.motor.driven


def test_unlisted_exits_can_be_there():
    for state, bits, target in ((S3, QUICK, S1), (S3, COAST, S1), (S4, OFF, S2)):
        bench = Bench(unlisted_exits='profidrive')
        bench.go(state)
        bench.bits(bits)
        assert bench.state == target


def test_one_telegram_is_one_transition(bench):
    bench.go(S2)
    bench.bits(ENABLE)
    assert bench.state == S3
    bench.bits(ENABLE)
    assert bench.state == S4


# --- what the motor does ---


def test_motor_runs_in_operation_alone_at_hundredths_of_a_hertz(bench):
    bench.go(S3)
    bench.wait(1.0)
    assert not bench.motor.driven
    bench.bits(ENABLE, 2345)
    bench.wait(6.0)
    assert bench.actual == pytest.approx(2345, abs=1)
    assert bench.zsw1 & 0x100, 'the set-point is reached'


@pytest.mark.parametrize(('bits', 'state'), [(DISABLE, S3), (QUICK, S1)])
@pytest.mark.parametrize('mode', ['Dec', 'Free-Run'])
def test_stop_goes_by_the_stop_mode(bits, state, mode):
    bench = Bench({'adv.stop_mode': mode})
    bench.go(S4)
    bench.wait(4.0)
    bench.bits(bits)
    assert bench.state == state
    bench.wait(0.1)
    assert bench.motor.driven == (mode == 'Dec')
    assert bench.motor.turning
    bench.wait(6.0)
    assert not bench.motor.driven
    assert bench.actual == 0


def test_coast_stop_releases_the_motor(bench):
    bench.go(S4)
    bench.wait(4.0)
    bench.bits(COAST)
    assert bench.state == S1
    assert not bench.motor.driven
    assert bench.motor.turning
    assert bench.actual == 0, 'what it shows is the output'


def test_coast_stop_counts_on_the_way_down(bench):
    bench.go(S4)
    bench.wait(4.0)
    bench.bits(DISABLE)
    bench.wait(0.2)
    assert bench.motor.driven
    bench.bits(COAST)
    bench.wait(0.02)
    assert not bench.motor.driven


def test_a_motor_that_brakes_is_caught_by_the_next_enable(bench):
    bench.go(S4)
    bench.wait(4.0)
    bench.bits(DISABLE)
    bench.wait(0.5)
    bench.bits(ENABLE)
    bench.wait(4.0)
    assert bench.actual == pytest.approx(2000, abs=1)


@pytest.mark.parametrize('missing', [0x10, 0x40])
def test_ramp_and_setpoint_have_to_be_enabled(bench, missing):
    bench.go(S4)
    bench.wait(4.0)
    bench.send(BY_PLC | RAMP & ~missing | ENABLE)
    bench.wait(5.0)
    assert bench.state == S4
    assert bench.actual == pytest.approx(0, abs=1)


def test_a_frozen_ramp_keeps_its_frequency(bench):
    bench.go(S4)
    bench.wait(1.0)
    bench.send(BY_PLC | RAMP & ~0x20 | ENABLE)
    held = bench.actual
    bench.wait(3.0)
    assert 0 < bench.actual == pytest.approx(held, abs=20)


def test_a_setpoint_has_no_sign(bench):
    bench.go(S4, -1000)
    bench.wait(10.0)
    assert bench.actual == pytest.approx(6000, abs=1), 'the maximum: 0xFC18 is 645.36 Hz'


# --- the status word ---


@pytest.mark.parametrize(('sent', 'told'), [(0x0002, 0x10), (0x0004, 0x20), (BY_PLC, 0x200)])
def test_echo_bits_are_those_of_the_word(bench, sent, told):
    bench.send(0x0000)
    assert not bench.zsw1 & 0x230
    bench.send(sent)
    assert bench.zsw1 & 0x230 == told


def test_bits_1_and_2_can_be_echoes_too():
    bench = Bench(echo_bits='word')
    bench.bits(ENABLE)
    assert bench.state == S1
    assert bench.zsw1 & 0x47 == 0x46


def test_it_says_operation_although_the_keypad_commands():
    bench = Bench({'drv.cmd_source': 'Keypad'})
    bench.go(S4)
    bench.wait(2.0)
    assert bench.zsw1 & 0x47 == 0x07
    assert bench.actual == 0
    assert not bench.motor.driven


def test_it_follows_the_reference_that_the_keypad_chooses():
    bench = Bench({'drv.freq_ref_src': 'Keypad-1', 'drv.frequency': 12.5})
    bench.go(S4)
    bench.wait(4.0)
    assert bench.actual == pytest.approx(1250, abs=1)


def test_the_other_telegram_is_no_exchange():
    assert Bench().server.online
    assert not Bench({'com.opt_para_13': 'Vendor Specific Telegram'}).server.online


# --- faults ---


def test_fault_coasts_and_wants_one_edge_of_bit_7(bench):
    bench.go(S4)
    bench.wait(4.0)
    bench.drive.trip(11)
    bench.wait(0.1)
    assert (bench.state, bench.zsw1 & 0x48) == (S1, 0x48)
    assert not bench.motor.driven
    bench.bits(OFF)
    assert bench.state == S1, 'a fault inhibits it'
    bench.bits(OFF | 0x80)
    assert not bench.zsw1 & 0x08
    bench.wait(1.0)
    bench.drive.trip(12)
    bench.wait(0.1)
    assert bench.zsw1 & 0x08, 'the bit that still stands is no edge'


def test_acknowledging_needs_control_by_the_plc(bench):
    bench.drive.trip(11)
    bench.send(0x0080)
    assert bench.zsw1 & 0x08


def test_after_a_fault_nothing_starts_by_itself(bench):
    bench.go(S4)
    bench.drive.trip(11)
    bench.bits(ENABLE)
    bench.bits(ENABLE | 0x80)
    bench.wait(2.0)
    assert bench.state == S1
    assert not bench.motor.driven


def test_a_fault_whose_cause_lasts_stays(bench):
    bench.drive.trip(15, cause_present=True)
    bench.bits(OFF | 0x80)
    assert bench.zsw1 & 0x08
    bench.drive.end_fault_causes()
    bench.bits(OFF)
    bench.bits(OFF | 0x80)
    assert not bench.zsw1 & 0x08


# --- keypad, power, lost command ---


def test_stop_at_the_keypad(bench):
    bench.go(S4)
    bench.wait(4.0)
    bench.unit.press('stop')
    bench.wait(5.0)
    assert bench.state == S1
    assert not bench.motor.driven


def test_stop_at_the_keypad_can_be_ignored():
    bench = Bench(keypad_stop='ignored')
    bench.go(S4)
    bench.unit.press('stop')
    assert bench.state == S4


def test_the_keypad_runs_it_when_it_commands():
    bench = Bench({'drv.cmd_source': 'Keypad', 'drv.freq_ref_src': 'Keypad-1', 'drv.frequency': 10})
    bench.unit.press('start')
    bench.wait(3.0)
    assert bench.actual == pytest.approx(1000, abs=1)
    bench.unit.press('stop')
    bench.wait(5.0)
    assert not bench.motor.driven


def test_after_a_power_cycle_it_begins_in_s1(bench):
    bench.go(S4)
    bench.wait(2.0)
    bench.drive.power_cycle(0.0)
    bench.wait(2.0)
    assert bench.state == S1
    assert not bench.motor.driven


def lost(mode, setpoint=2000, **settings):
    bench = Bench({'prt.lost_cmd_mode': mode, **settings})
    bench.go(S4, setpoint)
    bench.wait(5.0)
    bench.wait(0.9, telegrams=False)
    assert bench.motor.driven
    assert bench.motor.frequency == pytest.approx(setpoint / 100, abs=0.1)
    return bench


def test_lost_command_none_runs_on():
    bench = lost('None')
    bench.wait(30.0, telegrams=False)
    assert bench.motor.frequency == pytest.approx(20.0, abs=0.1)


def test_lost_command_free_run_coasts_and_is_a_fault():
    bench = lost('Free-Run')
    bench.wait(0.2, telegrams=False)
    assert not bench.motor.driven
    assert bench.drive.faults.codes == [35]


def test_lost_command_dec_brakes_and_is_a_fault():
    bench = lost('Dec')
    bench.wait(0.5, telegrams=False)
    assert bench.motor.driven
    assert bench.motor.trend < 0
    bench.wait(3.0, telegrams=False)
    assert not bench.motor.driven
    assert bench.drive.faults.codes == [35]


@pytest.mark.parametrize('mode', ['Hold Input', 'Hold Output'])
def test_lost_command_hold_runs_on_and_warns(mode):
    bench = lost(mode)
    bench.wait(5.0, telegrams=False)
    assert bench.motor.frequency == pytest.approx(20.0, abs=0.1)
    assert bench.unit.status_word & 0x80
    bench.bits(ENABLE, 1000)
    assert not bench.zsw1 & 0x80
    bench.wait(3.0)
    assert bench.actual == pytest.approx(1000, abs=1)


def test_lost_preset_has_a_frequency_of_its_own():
    bench = lost('Lost Preset', **{'prt.lost_preset_f': 7.5})
    bench.wait(5.0, telegrams=False)
    assert bench.motor.frequency == pytest.approx(7.5, abs=0.1)


def test_lost_command_has_its_time():
    bench = lost('Free-Run', **{'prt.lost_cmd_time': 3.0})
    bench.wait(1.9, telegrams=False)
    assert bench.motor.driven
    bench.wait(0.4, telegrams=False)
    assert not bench.motor.driven


# --- in any order ---

STEPS = st.lists(
    st.tuples(
        st.sampled_from(
            ['word', 'word', 'word', 'fault', 'stop', 'power', 'silence', 'gone', 'start']
        ),
        st.integers(0, 15),
        st.sampled_from([0x0400, 0x0480, 0x0470, 0x0470, 0x0470, 0x04F0, 0x0070]),
        st.integers(-0x8000, 0x7FFF),
        st.sampled_from([0.0, 0.02, 0.1, 1.0, 3.0]),
    ),
    max_size=25,
)
OPTIONS = st.fixed_dictionaries(
    {
        'unlisted_exits': st.sampled_from(['none', 'profidrive']),
        'echo_bits': st.sampled_from(['state', 'word']),
    }
)
LOST = st.sampled_from(['None', 'Free-Run', 'Dec', 'Hold Input', 'Hold Output', 'Lost Preset'])


@given(STEPS, OPTIONS, LOST)
def test_in_any_order_it_runs_forward_in_operation_alone(steps, options, mode):
    bench = Bench({'prt.lost_cmd_mode': mode}, **options)
    driven = False
    for what, low, high, setpoint, seconds in steps:
        if what == 'fault':
            bench.drive.trip(11, cause_present=bool(low & 1))
        elif what == 'gone':
            bench.drive.end_fault_causes()
        elif what in ('stop', 'start'):
            bench.unit.press(what)
        elif what == 'power':
            bench.drive.power_cycle(0.0)
        elif what == 'word':
            before = bench.state
            faulted = bool(bench.drive.faults)
            bench.send(high | low, setpoint)
            expected = table(before, low) if high & BY_PLC else before
            if options['unlisted_exits'] == 'none' and not faulted:
                assert bench.state == expected
        bench.wait(seconds, telegrams=what != 'silence')
        motor = bench.motor
        assert -0.01 <= motor.frequency <= 62.0
        if motor.driven and not driven:
            assert bench.state == S4, 'nothing else starts it'
        if bench.drive.faults:
            assert not motor.driven
            assert bench.state == S1
        shown = bench.unit.status_word & 0x47
        if options['echo_bits'] == 'state':
            assert shown == PATTERN[bench.state]
        assert bool(shown & 0x40) == (bench.state == S1)
        driven = motor.driven
