# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The MOVITRAC's protocol [M4 §2]: frames, what a drive does not carry out, and why."""

from hypothesis import given, settings, strategies as st
import movitrac_drive_bench as m
from movitrac_drive_bench import (
    ACK,
    MovitracBench,
    bcd,
    data,
    enquiry,
    long_data,
    long_select,
    nack,
    requests,
    select,
    summed,
)
import pytest
from support.examples import examples

from nfo_sinus_driver.simulator import movitrac as movitrac_frames
from nfo_sinus_driver.simulator.movitrac import Message, Movitrac, ReturnCode

#: [M4 §2.4.3] and [M4 §2.4.4].
HEAT_SINK_TEMPERATURE = bytes.fromhex('B5 00 00 04 B9')
IS_25_5 = bytes.fromhex('C8 00 04 00 00 25 50 41')
T11_UP_TO_3_7 = bytes.fromhex('A9 00 00 19 00 00 03 70 35')
DONE = bytes.fromhex('D2 D2')
N2_OFFSET, LIMIT_SWITCH_CW, USER_MENU = 98, 1001, 270


@pytest.fixture
def bench():
    return MovitracBench()


# ---- frames ----


def test_the_examples_of_the_manual_are_answered_as_printed(bench):
    assert bench.say(HEAT_SINK_TEMPERATURE) == IS_25_5
    assert bench.say(T11_UP_TO_3_7) == DONE == ACK
    assert bench.read(25) == 3.7
    assert (enquiry(4), data(4, bytes.fromhex('00002550'))) == (HEAT_SINK_TEMPERATURE, IS_25_5)
    assert select(25, bytes.fromhex('00000370')) == T11_UP_TO_3_7


def test_what_a_master_and_a_drive_say():
    parse = movitrac_frames.parse
    assert parse(enquiry(284, 12)) == Message(12, 284)
    assert parse(select(25, b'\x00\x00\x03\x70', 63)) == Message(63, 25, b'\x00\x00\x03\x70')
    assert parse(long_select(263, bytes(8), 1)) == Message(1, 263, bytes(8))
    assert movitrac_frames.data(4, bytes.fromhex('00002550')) == IS_25_5
    halves = bytes.fromhex('00 00 00 01 08 06 0A 00')
    assert movitrac_frames.data(263, halves) == long_data(263, halves)
    assert movitrac_frames.acknowledge() == DONE
    assert movitrac_frames.refuse(ReturnCode.TOO_LARGE) == bytes.fromhex('F3 15 08') == nack(0x15)


@given(requests, st.binary(max_size=20))
def test_a_frame_is_cut_where_it_ends(frame, rest):
    assert Movitrac.cut(frame + rest) == len(frame)
    assert not any(Movitrac.cut(frame[:count]) for count in range(1, len(frame)))
    assert Movitrac.unwrap(frame).body == frame


@given(st.lists(st.sampled_from(sorted({*range(256)} - {0xB5, 0xA9, 0xAD})), min_size=1), requests)
def test_noise_without_a_start_delimiter_is_no_part_of_a_frame(noise, frame):
    noise = bytes(noise)
    assert Movitrac.cut(noise) == Movitrac.cut(noise + frame) == len(noise)
    assert Movitrac.unwrap(noise) is None


def test_what_is_answered_by_silence():
    bench = MovitracBench(address=2)
    assert bench.say(select(25, bcd(3.7), 2)[:-1] + b'\x36') == b'', 'a wrong sum'
    assert bench.read(25) == 1.0
    for address in (1, 12, 63, 64, 255):
        assert bench.say(enquiry(4, address)) == b''
    assert bench.say(enquiry(4, 2)) == IS_25_5
    for answer in (IS_25_5, DONE, nack(0x10), long_data(263, bytes(8))):
        assert bench.say(answer) == b'', 'a frame of another drive'
    assert bench.write(m.ADDRESS, 7) == ACK, 'it counts at once'
    assert (bench.say(enquiry(4, 2)), bench.say(enquiry(4, 7))) == (b'', IS_25_5)
    bench = MovitracBench(interface='rs232', option_card='fea')
    for address in (0, 12, 255):
        assert bench.say(enquiry(4, address)) == IS_25_5, 'on RS-232 every address is answered'


# ---- return codes ----


def test_indices_that_there_are_not_that_are_read_only_or_of_a_missing_card(bench):
    for code, indices in (
        (0x10, (3, 7, 14, 286 + 1000, 1005, 0xFFFF)),
        (0x17, (m.INPUT_48, 209, 263, 607, 700)),
        (0x12, (0, m.HEAT_SINK, 157, m.STATUS, 400)),
    ):
        for index in indices:
            assert bench.say(select(index, bytes(4))) == nack(code), index
            if code != 0x12:
                assert bench.say(enquiry(index)) == nack(code), index
    assert MovitracBench(option_card='fea').write(m.INPUT_48, 9) == ACK
    bench = MovitracBench(option_card='fpi')
    assert bench.say(long_select(m.T11_UP, bytes(8))) == nack(0x34)
    assert bench.say(select(LIMIT_SWITCH_CW, bytes(4))) == nack(0x34)


def test_a_value_that_cannot_be(bench):
    bench.write(m.CONTROL_MODE, m.REMOTE_CONTROL)
    for index, value, code in (
        (m.T11_UP, 2010.0, 0x15),
        (m.T13_STOP, 10.0, 0x15),
        (m.F_MAX, 4.95, 0x16),
        (m.T11_UP, 3.72, 0x1D),
        (m.T11_UP, 20.25, 0x1D),
        (m.T11_UP, 102.0, 0x1D),
        (m.SETPOINT, 400.05, 0x15),
        (m.SETPOINT, 10.01, 0x1D),
        (m.ADDRESS, 64.0, 0x15),
        (m.ADDRESS, 1.5, 0x1D),
        (m.CONTROL_MODE, 4.0, 0x15),
        (m.CONTROL_MODE, 1.5, 0x1D),
    ):
        before = bench.ask(index)
        assert bench.write(index, value) == nack(code), (index, value)
        assert bench.ask(index) == before
    for digits, code in (('0000000A', 0x1D), ('F0000370', 0x1D), ('80000370', 0x15)):
        assert bench.say(select(m.T11_UP, bytes.fromhex(digits))) == nack(code)
    for value in (0.0, 9.95, 10.0, 10.5, 100.0, 105.0, 1000.0, 1010.0, 2000.0):
        assert bench.write(m.T11_UP, value) == ACK
        assert bench.read(m.T11_UP) == value


def test_the_parameter_lock_and_what_the_keypad_alone_may_switch_on(bench):
    bench.write(m.CONTROL_MODE, m.REMOTE_CONTROL)
    assert bench.write(m.LOCK, 1) == ACK
    assert bench.write(m.T11_UP, 2.0) == bench.write(m.CONTROL_MODE, 0) == nack(0x13)
    assert bench.write(m.SETPOINT, 10.0) == bench.bits(0) == ACK
    assert bench.write(m.LOCK, 0) == bench.write(m.T11_UP, 2.0) == ACK
    assert bench.write(USER_MENU, 1) == ACK
    assert bench.write(USER_MENU, 0) == nack(0x19)


def test_the_factory_setting():
    for ends_half_way in (False, True):
        bench = MovitracBench()
        bench.set(t11_up=2.0, control_mode=m.REMOTE_CONTROL, response_time=20)
        assert bench.write(m.FACTORY_SETTING, 1) == nack(0x1E)
        assert bench.read(m.FACTORY_SETTING) == 1
        assert bench.write(m.T11_UP, 3.0) == nack(0x14)
        assert bench.number == 0
        if ends_half_way:
            bench.drive.power_cycle(0.0)
            assert bench.read(m.FACTORY_SETTING) == 0
        bench.wait(3.0)
        assert bench.read(m.FACTORY_SETTING) == 0
        assert bench.read(m.T11_UP) == (2.0 if ends_half_way else 1.0)
        assert bench.read(m.CONTROL_MODE) == (m.REMOTE_CONTROL if ends_half_way else 0)
        assert bench.read(207) == 20, 'it still answers as before'
        assert bench.write(m.T11_UP, 3.0) == ACK
    bench.run(10.0)
    assert bench.write(m.FACTORY_SETTING, 1) == nack(0x1C)
    assert bench.running


def test_settings_that_do_not_go_together():
    for first, then, code in (
        ([], (170, 1), 0x22),
        ([], (172, 1), 0x23),
        ([(194, 1), (170, 1)], (194, 0), 0x26),
        ([(195, 1), (172, 1)], (195, 0), 0x27),
        ([(174, 1)], (267, 1), 0x2C),
        ([(269, 1)], (177, 1), 0x2D),
        ([(180, 1)], (194, 1), 0x2F),
        ([(195, 1)], (183, 1), 0x30),
    ):
        bench = MovitracBench()
        for index, value in first:
            assert bench.write(index, value) == ACK
        assert bench.write(*then) == nack(code), then
        assert bench.read(then[0]) == 1 - then[1]


def test_what_is_not_saved_is_said_and_lost(bench):
    bench.terminal(41, True)
    bench.set(t11_up=2.0, save_to_eeprom=1)
    for index, value in ((m.T11_UP, 3.0), (m.T11_UP, 4.0), (m.F_MAX, 20.0)):
        assert bench.write(index, value) == nack(0x28)
        assert bench.read(index) == value
    bench.wait(6.0)
    assert bench.read(0) == 10.0, 'half of it, by the analog input'
    bench.drive.power_cycle(0.0)
    bench.wait(6.0)
    assert (bench.read(m.T11_UP), bench.read(0)) == (2.0, 25.0)
    assert bench.write(m.T11_UP, 3.0) == nack(0x28)
    assert bench.write(m.SAVE_TO_EEPROM, 0) == ACK
    bench.set(t11_up=5.0)
    bench.drive.power_cycle(0.0)
    assert bench.read(m.T11_UP) == 5.0, 'what is written again while it saves is saved'


def test_a_setting_can_need_an_output_stage_that_is_off_or_the_inhibit():
    bench = MovitracBench(settings_need='output_off')
    bench.run(25.0)
    assert bench.write(m.T11_UP, 2.0) == m.nack(0x1C)
    assert bench.write(m.CONTROL_MODE, m.STANDARD) == m.nack(0x1C)
    assert bench.write(m.SETPOINT, 20.0) == ACK
    assert bench.bits(m.CW | m.ENABLE | m.INHIBIT) == ACK
    assert bench.write(m.T11_UP, 2.0) == ACK
    bench = MovitracBench(
        settings_need='inhibit', settings={'terminal.input_47': '/Controller inhibit'}
    )
    for closed, answer in ((True, m.nack(0x2B)), (False, ACK)):
        bench.terminal(47, closed)
        assert bench.write(m.CONTROL_MODE, m.REMOTE_CONTROL) == answer


def test_eight_bytes_are_half_bytes():
    bench = MovitracBench(option_card='fpi')
    for halves, value in (('00 00 00 01 08 06 0A 00', 100000), ('0F' * 8, -1)):
        assert bench.say(long_select(LIMIT_SWITCH_CW, bytes.fromhex(halves))) == ACK
        answer = long_data(LIMIT_SWITCH_CW, bytes.fromhex(halves))
        assert bench.say(enquiry(LIMIT_SWITCH_CW)) == answer
        assert bench.drive.peek('ipos.limit_switch_cw') == value
    assert bench.say(long_select(LIMIT_SWITCH_CW, bytes([0x10] * 8))) == nack(0x1D)


def test_the_example_of_the_manual_between_two_steps_is_taken():
    bench = MovitracBench()
    # P111 = -237.0 mV [M4 §3.1], of which the list has steps of 10 mV [M4 §4]
    value = bytes.fromhex('F0023700')
    assert bench.say(select(N2_OFFSET, value)) == ACK
    assert bench.ask(N2_OFFSET) == value
    assert bench.drive.peek('setpoint.n2_offset') == -237.0
    bench.drive.set_from_keypad('setpoint.n2_offset', 12.34)
    assert bench.ask(N2_OFFSET) == bcd(12.34)


def test_a_negative_number_has_its_sign_in_the_first_half_byte():
    bench = MovitracBench()
    value = bytes.fromhex('F0023000')
    assert bench.say(select(N2_OFFSET, value)) == ACK
    assert bench.ask(N2_OFFSET) == value
    assert bench.drive.peek('setpoint.n2_offset') == -230.0
    assert bench.write(N2_OFFSET, 230.0) == ACK
    assert bench.ask(N2_OFFSET) == bcd(230.0)
    too_low = bytes.fromhex('F0051000')
    assert bench.say(select(N2_OFFSET, too_low)) == nack(0x16)
    for choice, data_ in (('f', 'F0001500'), ('8', '80001500'), ('1', '10001500')):
        bench = MovitracBench(negative_sign=choice)
        for ambient, shown in ((-15.0, data_), (15.0, '00001500')):
            bench.unit.ambient = ambient
            assert bench.ask(m.HEAT_SINK) == bytes.fromhex(shown), choice


@settings(max_examples=examples(120))
@given(st.data())
def test_whatever_is_written_is_answered(data):
    bench = MovitracBench(interface='rs232', option_card='fpi')
    known = sorted(parameter.at('movitrac').index for parameter in bench.drive.model.values())
    index = data.draw(st.sampled_from(known) | st.integers(0, 0xFFFF))
    # whatever fits in a frame: any bytes, and decimal digits, whole numbers above all
    value = data.draw(
        st.one_of(
            st.binary(min_size=4, max_size=4),
            st.binary(min_size=8, max_size=8),
            st.integers(0, 5000).map(lambda number: bcd(number / 20)),
            st.integers(0, 50).map(bcd),
        )
    )
    answer = bench.say((select if len(value) == 4 else long_select)(index, value))
    assert answer == ACK or (answer[0] == 0xF3 and answer == summed(answer[:-1]))
    answer = bench.say(enquiry(index))
    assert answer[0] in {0xC8, 0xAC, 0xF3}
    assert answer == summed(answer[:-1])
