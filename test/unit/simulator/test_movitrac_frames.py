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

"""Frames of the MOVITRAC's protocol: golden ones of [M4], how they are cut, and their sums."""

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from movitrac_drive_bench import ACK
from movitrac_drive_bench import MovitracBench
from movitrac_drive_bench import data
from movitrac_drive_bench import enquiry
from movitrac_drive_bench import long_data
from movitrac_drive_bench import long_select
from movitrac_drive_bench import nack
from movitrac_drive_bench import select
import pytest

from nfo_sinus_driver.simulator import movitrac_frames
from nfo_sinus_driver.simulator.movitrac import Movitrac
from nfo_sinus_driver.simulator.movitrac_frames import Message
from nfo_sinus_driver.simulator.movitrac_frames import ReturnCode

#: [M4 §2.4.3] and [M4 §2.4.4].
HEAT_SINK_TEMPERATURE = bytes.fromhex('B5 00 00 04 B9')
IS_25_5 = bytes.fromhex('C8 00 04 00 00 25 50 41')
T11_UP_TO_3_7 = bytes.fromhex('A9 00 00 19 00 00 03 70 35')
DONE = bytes.fromhex('D2 D2')

requests = st.one_of(
    st.builds(enquiry, st.integers(0, 0xFFFF), st.integers(0, 63)),
    st.builds(select, st.integers(0, 0xFFFF), st.binary(min_size=4, max_size=4)),
    st.builds(long_select, st.integers(0, 0xFFFF), st.binary(min_size=8, max_size=8)),
)


def test_the_examples_of_the_manual_are_answered_as_printed():
    bench = MovitracBench()
    assert bench.say(HEAT_SINK_TEMPERATURE) == IS_25_5
    assert bench.say(T11_UP_TO_3_7) == DONE == ACK
    assert bench.read(25) == 3.7


def test_the_frames_of_the_bench_are_those_of_the_manual():
    assert enquiry(4) == HEAT_SINK_TEMPERATURE
    assert data(4, bytes.fromhex('00002550')) == IS_25_5
    assert select(25, bytes.fromhex('00000370')) == T11_UP_TO_3_7


def test_what_a_master_says():
    parse = movitrac_frames.parse
    assert parse(enquiry(284, 12)) == Message(12, 284)
    assert parse(select(25, b'\x00\x00\x03\x70', 63)) == Message(63, 25, b'\x00\x00\x03\x70')
    assert parse(long_select(263, bytes(8), 1)) == Message(1, 263, bytes(8))


def test_what_a_drive_says():
    assert movitrac_frames.data(4, bytes.fromhex('00002550')) == IS_25_5
    halves = bytes.fromhex('00 00 00 01 08 06 0A 00')
    assert movitrac_frames.data(263, halves) == long_data(263, halves)
    assert movitrac_frames.acknowledge() == DONE
    assert movitrac_frames.refuse(ReturnCode.TOO_LARGE) == bytes.fromhex('F3 15 08') == nack(0x15)


@settings(deadline=None)
@given(requests, st.integers(0, 12), st.integers(1, 255))
def test_a_damaged_byte_is_noticed(frame, place, change):
    damaged = bytearray(frame)
    damaged[place % len(frame)] ^= change
    assert Movitrac.unwrap(bytes(damaged)) is None


@settings(deadline=None)
@given(requests, st.binary(max_size=20))
def test_a_frame_is_cut_where_it_ends(frame, rest):
    assert Movitrac.cut(frame + rest) == len(frame)
    assert not any(Movitrac.cut(frame[:count]) for count in range(1, len(frame)))
    assert Movitrac.unwrap(frame).body == frame


@settings(deadline=None)
@given(st.binary(min_size=1).filter(lambda noise: not set(noise) & {0xB5, 0xA9, 0xAD}), requests)
def test_noise_without_a_start_delimiter_is_no_part_of_a_frame(noise, frame):
    assert Movitrac.cut(noise) == len(noise)
    assert Movitrac.cut(noise + frame) == len(noise)
    assert Movitrac.unwrap(noise) is None


def test_a_wrong_sum_is_answered_by_silence():
    bench = MovitracBench()
    assert bench.say(T11_UP_TO_3_7[:-1] + b'\x36') == b''
    assert bench.read(25) == 1.0


@pytest.mark.parametrize('address', [1, 12, 63, 64, 255])
def test_another_address_is_answered_by_silence(address):
    bench = MovitracBench(address=2)
    assert bench.say(enquiry(4, address)) == b''
    assert bench.say(enquiry(4, 2)) == IS_25_5


def test_frames_of_a_drive_are_nothing_to_another():
    bench = MovitracBench()
    for answer in (IS_25_5, DONE, nack(0x10), long_data(263, bytes(8))):
        assert bench.say(answer) == b''
