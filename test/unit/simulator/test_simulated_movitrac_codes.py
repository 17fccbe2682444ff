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

"""What a MOVITRAC 31.. does not carry out, and the return code that says why [M4 §2.1.2]."""

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from movitrac_drive_bench import ACK
from movitrac_drive_bench import ADDRESS
from movitrac_drive_bench import CONTROL_MODE
from movitrac_drive_bench import F_MAX
from movitrac_drive_bench import FACTORY_SETTING
from movitrac_drive_bench import HEAT_SINK
from movitrac_drive_bench import INPUT_48
from movitrac_drive_bench import LOCK
from movitrac_drive_bench import REMOTE_CONTROL
from movitrac_drive_bench import SETPOINT
from movitrac_drive_bench import STATUS
from movitrac_drive_bench import T11_UP
from movitrac_drive_bench import T13_STOP
from movitrac_drive_bench import MovitracBench
from movitrac_drive_bench import bcd
from movitrac_drive_bench import enquiry
from movitrac_drive_bench import long_data
from movitrac_drive_bench import long_select
from movitrac_drive_bench import nack
from movitrac_drive_bench import select
from movitrac_drive_bench import summed
import pytest

N2_OFFSET = 98
GEAR_RATIO, FRS_COUNTER, LIMIT_SWITCH_CW = 263, 254, 1001
USER_MENU, SAVE_TO_EEPROM = 270, 236

#: Whatever fits in a frame: any bytes, and decimal digits, whole numbers above all.
VALUES = st.one_of(
    st.binary(min_size=4, max_size=4),
    st.binary(min_size=8, max_size=8),
    st.integers(0, 5000).map(lambda number: bcd(number / 20)),
    st.integers(0, 50).map(bcd),
)


@pytest.fixture
def bench():
    return MovitracBench()


@pytest.mark.parametrize('index', [3, 7, 14, 286 + 1000, 1005, 0xFFFF])
def test_an_illegal_index(bench, index):
    assert bench.say(enquiry(index)) == nack(0x10)
    assert bench.say(select(index, bytes(4))) == nack(0x10)


@pytest.mark.parametrize('index', [0, HEAT_SINK, 157, STATUS, 400])
def test_read_access_only(bench, index):
    assert bench.say(select(index, bytes(4))) == nack(0x12)


@pytest.mark.parametrize(
    ('index', 'value', 'code'),
    [
        (T11_UP, 2010.0, 0x15),
        (T13_STOP, 10.0, 0x15),
        (F_MAX, 4.95, 0x16),
        (T11_UP, 3.72, 0x1D),
        (T11_UP, 20.25, 0x1D),
        (T11_UP, 102.0, 0x1D),
        (SETPOINT, 400.05, 0x15),
        (SETPOINT, 10.01, 0x1D),
        (ADDRESS, 64.0, 0x15),
        (ADDRESS, 1.5, 0x1D),
        (CONTROL_MODE, 4.0, 0x15),
        (CONTROL_MODE, 1.5, 0x1D),
    ],
)
def test_a_value_that_cannot_be(bench, index, value, code):
    bench.write(CONTROL_MODE, REMOTE_CONTROL)
    before = bench.ask(index)
    assert bench.write(index, value) == nack(code)
    assert bench.ask(index) == before


@pytest.mark.parametrize('value', [0.0, 9.95, 10.0, 10.5, 100.0, 105.0, 1000.0, 1010.0, 2000.0])
def test_the_steps_of_a_ramp(bench, value):
    assert bench.write(T11_UP, value) == ACK
    assert bench.read(T11_UP) == value


@pytest.mark.parametrize('data', ['0000000A', 'F0000370', '80000370'])
def test_what_is_no_decimal_number(bench, data):
    code = 0x15 if data.startswith('8') else 0x1D
    assert bench.say(select(T11_UP, bytes.fromhex(data))) == nack(code)


def test_the_parameter_lock(bench):
    bench.write(CONTROL_MODE, REMOTE_CONTROL)
    assert bench.write(LOCK, 1) == ACK
    assert bench.write(T11_UP, 2.0) == nack(0x13)
    assert bench.write(CONTROL_MODE, 0) == nack(0x13)
    assert bench.write(SETPOINT, 10.0) == ACK
    assert bench.bits(0) == ACK
    assert bench.write(LOCK, 0) == ACK
    assert bench.write(T11_UP, 2.0) == ACK


def test_the_factory_setting(bench):
    bench.set(t11_up=2.0, control_mode=REMOTE_CONTROL, response_time=20)
    assert bench.write(FACTORY_SETTING, 1) == nack(0x1E)
    assert bench.read(FACTORY_SETTING) == 1
    assert bench.write(T11_UP, 3.0) == nack(0x14)
    assert bench.number == 0
    bench.wait(3.0)
    assert bench.read(FACTORY_SETTING) == 0
    assert bench.read(T11_UP) == 1.0
    assert bench.read(CONTROL_MODE) == 0
    assert bench.read(207) == 20, 'it still answers as before'
    assert bench.write(T11_UP, 3.0) == ACK


def test_power_off_ends_the_factory_setting_half_way(bench):
    bench.set(t11_up=2.0)
    bench.write(FACTORY_SETTING, 1)
    bench.drive.power_cycle(0.0)
    assert bench.read(FACTORY_SETTING) == 0
    bench.wait(5.0)
    assert bench.read(T11_UP) == 2.0


def test_no_factory_setting_while_the_output_stage_is_on(bench):
    bench.run(10.0)
    assert bench.write(FACTORY_SETTING, 1) == nack(0x1C)
    assert bench.running


def test_an_option_card_that_is_missing(bench):
    for index in (INPUT_48, 209, 263, 607, 700):
        assert bench.say(enquiry(index)) == nack(0x17)
        assert bench.say(select(index, bytes(4))) == nack(0x17)
    assert MovitracBench(option_card='fea').write(INPUT_48, 9) == ACK


def test_a_message_that_does_not_fit_the_parameter():
    bench = MovitracBench(option_card='fpi')
    assert bench.say(long_select(T11_UP, bytes(8))) == nack(0x34)
    assert bench.say(select(LIMIT_SWITCH_CW, bytes(4))) == nack(0x34)


def test_what_the_keypad_alone_may_switch_on(bench):
    assert bench.write(USER_MENU, 1) == ACK
    assert bench.write(USER_MENU, 0) == nack(0x19)


@pytest.mark.parametrize(
    ('first', 'then', 'code'),
    [
        ([], (170, 1), 0x22),
        ([], (172, 1), 0x23),
        ([(194, 1), (170, 1)], (194, 0), 0x26),
        ([(195, 1), (172, 1)], (195, 0), 0x27),
        ([(174, 1)], (267, 1), 0x2C),
        ([(269, 1)], (177, 1), 0x2D),
        ([(180, 1)], (194, 1), 0x2F),
        ([(195, 1)], (183, 1), 0x30),
    ],
)
def test_settings_that_do_not_go_together(bench, first, then, code):
    for index, value in first:
        assert bench.write(index, value) == ACK
    assert bench.write(*then) == nack(code)
    index, value = then
    assert bench.read(index) == 1 - value


def test_what_is_not_saved_is_said_and_lost(bench):
    bench.set(t11_up=2.0, t11_down=2.0, save_to_eeprom=1)
    assert bench.write(T11_UP, 3.0) == nack(0x28)
    assert bench.write(T11_UP, 4.0) == nack(0x28)
    assert bench.read(T11_UP) == 4.0
    bench.write(CONTROL_MODE, REMOTE_CONTROL)
    assert bench.write(SETPOINT, 10.0) == ACK, 'that is no setting'
    bench.drive.power_cycle(0.0)
    assert bench.read(T11_UP) == 2.0
    assert bench.read(26) == 2.0
    assert bench.read(CONTROL_MODE) == 0


def test_what_is_not_saved_counts_no_more_after_power_on(bench):
    bench.terminal(41, True)
    bench.set(save_to_eeprom=1)
    assert bench.write(F_MAX, 20.0) == nack(0x28)
    bench.wait(2.0)
    assert bench.read(0) == 10.0, 'half of it, by the analog input'
    bench.drive.power_cycle(0.0)
    bench.wait(2.0)
    assert bench.read(0) == 25.0


def test_what_is_written_again_while_it_saves_is_saved(bench):
    bench.set(save_to_eeprom=1)
    assert bench.write(T11_UP, 3.0) == nack(0x28)
    assert bench.write(SAVE_TO_EEPROM, 0) == ACK
    bench.set(t11_up=5.0)
    bench.drive.power_cycle(0.0)
    assert bench.read(T11_UP) == 5.0


def test_eight_bytes_are_half_bytes():
    bench = MovitracBench(option_card='fpi')
    halves = bytes.fromhex('00 00 00 01 08 06 0A 00')
    assert bench.say(long_select(LIMIT_SWITCH_CW, halves)) == ACK
    assert bench.say(enquiry(LIMIT_SWITCH_CW)) == long_data(LIMIT_SWITCH_CW, halves)
    assert bench.drive.peek('ipos.limit_switch_cw') == 100000
    minus_one = bytes([0xF] * 8)
    assert bench.say(long_select(LIMIT_SWITCH_CW, minus_one)) == ACK
    assert bench.drive.peek('ipos.limit_switch_cw') == -1
    assert bench.say(long_select(LIMIT_SWITCH_CW, bytes([0x10] * 8))) == nack(0x1D)


@pytest.mark.parametrize('nibble', ['F', '8', '1'])
def test_a_negative_number_has_its_sign_in_the_first_half_byte(nibble):
    bench = MovitracBench(negative_nibble=nibble)
    data = bytes.fromhex(f'{nibble}0023000')
    assert bench.say(select(N2_OFFSET, data)) == ACK
    assert bench.ask(N2_OFFSET) == data
    assert bench.drive.peek('setpoint.n2_offset') == -230.0
    assert bench.write(N2_OFFSET, 230.0) == ACK
    assert bench.ask(N2_OFFSET) == bcd(230.0)
    assert bench.say(select(N2_OFFSET, bytes.fromhex(f'{nibble}0051000'))) == nack(0x16)
    bench.unit.ambient = -15.0
    assert bench.ask(HEAT_SINK) == bytes.fromhex(f'{nibble}0001500')


def test_another_address_counts_at_once(bench):
    assert bench.write(ADDRESS, 7) == ACK
    assert bench.say(enquiry(HEAT_SINK, 0)) == b''
    assert bench.say(enquiry(HEAT_SINK, 7)) != b''


def ends_of(parameter):
    """The least and the greatest value, or code."""
    if parameter.labels:
        return min(parameter.labels), max(parameter.labels)
    return float(parameter.minimum), float(parameter.maximum)


def test_every_setting_has_both_its_ends():
    # but those that end the conversation, and those that stand against each other
    aside = {LOCK, SAVE_TO_EEPROM, USER_MENU, ADDRESS, 170, 172, 194, 195}
    settings = [
        parameter
        for parameter in MovitracBench().drive.model.settings
        if not parameter.option and parameter.at('movitrac').index not in aside
    ]
    assert len(settings) > 140
    for parameter in settings:
        bench, index = MovitracBench(), parameter.at('movitrac').index
        for end in ends_of(parameter):
            assert bench.write(index, end) == ACK, (parameter.key, end)
            assert bench.read(index) == end
        assert bench.write(index, ends_of(parameter)[1] + 1) == nack(0x15), parameter.key


@settings(deadline=None)
@given(st.data())
def test_whatever_is_written_is_answered(data):
    bench = MovitracBench(interface='rs232', option_card='fpi')
    known = sorted(one.at('movitrac').index for one in bench.drive.model.values())
    index = data.draw(st.sampled_from(known) | st.integers(0, 0xFFFF))
    value = data.draw(VALUES)
    frame = select(index, value) if len(value) == 4 else long_select(index, value)
    answer = bench.say(frame)
    assert answer == ACK or (answer[0] == 0xF3 and answer == summed(answer[:-1]))
    answer = bench.say(enquiry(index))
    assert answer[0] in {0xC8, 0xAC, 0xF3}
    assert answer == summed(answer[:-1])
