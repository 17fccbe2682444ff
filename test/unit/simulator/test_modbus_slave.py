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

"""Requests and answers, byte by byte, against the standard and against pymodbus's client side."""

import itertools

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from support.examples import examples

from nfo_sinus_driver.simulator import pymodbus_compat
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Receiver
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.modbus_frames import ModbusRtu
from nfo_sinus_driver.simulator.protocol import Request

RTU = ModbusRtu()


@pytest.mark.parametrize(
    ('request_', 'answer'),
    [
        # read MODE
        ('03 0294 0001', '03 02 0001'),
        # Accel, low word first: 5000 ms
        ('03 027E 0002', '03 04 1388 0000'),
        # write MODE = Bus, one register
        ('06 0294 0003', '06 0294 0003'),
        # write Accel = 70 s: 00011170h
        ('10 027E 0002 04 1170 0001', '10 027E 0002'),
        # 01: functions that it does not have
        ('04 0294 0001', '84 01'),
        ('83', '83 01'),
        ('', '80 01'),
        # 02: nobody there, a part, too much, not that way
        ('03 0000 0001', '83 02'),
        ('03 027E 0001', '83 02'),
        ('03 027F 0001', '83 02'),
        ('03 0294 0002', '83 02'),
        ('03 02A4 0002', '83 02'),
        ('03 0298 0001', '83 02'),
        ('06 027E 0001', '86 02'),
        ('06 02A5 0001', '86 02'),
        ('10 027E 0001 02 1388', '90 02'),
        # 03: counts and lengths that the standard forbids, and values the drive does not take
        ('03 0294 0000', '83 03'),
        ('03 0294 007E', '83 03'),
        ('03 0294', '83 03'),
        ('06 0294', '86 03'),
        ('10 0294 0001 02', '90 03'),
        ('10 0294 0000 00', '90 03'),
        ('10 0294 0001 04 0003 0003', '90 03'),
        ('10 0294 0002 02 0003', '90 03'),
        ('10 0294 0001 02 0003 FF', '90 03'),
        ('06 0294 0003 FF', '86 03'),
        ('06 0294 0000', '86 03'),
        ('10 027E 0002 04 0000 0000', '90 03'),
        # 04: not now
        ('06 0298 0101', '86 04'),
    ],
)
def test_answer(request_, answer):
    pdu = server(simulated_drive()).answer(bytes.fromhex(request_))
    assert pdu == bytes.fromhex(answer)


@given(st.binary(max_size=40))
@settings(max_examples=examples(500))
def test_any_pdu_is_answered(pdu):
    answer = server(simulated_drive()).answer(pdu)
    assert 2 <= len(answer) <= 253
    assert answer[0] & 0x7F == (pdu[0] & 0x7F if pdu else 0)


@given(
    st.sampled_from([3, 6, 16]),
    st.integers(0x200, 0x430),
    st.integers(0, 3),
    st.lists(st.integers(0, 0xFFFF), max_size=3),
)
@settings(max_examples=examples(500))
def test_requests_that_are_nearly_right_are_answered(function, register, count, words):
    data = bytes([function]) + register.to_bytes(2, 'big')
    if function == 6:
        data += (words or [0])[0].to_bytes(2, 'big')
    else:
        data += count.to_bytes(2, 'big')
    if function == 16:
        data += bytes([2 * len(words)]) + b''.join(word.to_bytes(2, 'big') for word in words)
    answer = server(simulated_drive()).answer(data)
    assert answer[0] == function or (answer[0] == function | 0x80 and 1 <= answer[1] <= 4)


def test_the_crc_of_the_standards_example():
    assert pymodbus_compat.crc(bytes.fromhex('0207')) == bytes.fromhex('4112')
    assert pymodbus_compat.crc(bytes.fromhex('010302940001')) == bytes.fromhex('C45E')


@given(st.integers(0, 255), st.binary(min_size=1, max_size=100))
def test_wrap_and_unwrap(address, pdu):
    assert RTU.unwrap(RTU.wrap(address, pdu)) == Request(address, pdu)


@given(st.binary(min_size=4, max_size=30), st.data())
def test_a_flipped_bit_is_noticed(body, data):
    frame = bytearray(RTU.wrap(1, body))
    bit = data.draw(st.integers(0, 8 * len(frame) - 1))
    frame[bit // 8] ^= 1 << bit % 8
    assert RTU.unwrap(bytes(frame)) is None


def test_only_writes_are_obeyed_by_everybody():
    drive = simulated_drive(address=7)
    assert RTU.concerns(drive, Request(0, b'\x06'))
    assert RTU.concerns(drive, Request(0, b'\x10'))
    assert not RTU.concerns(drive, Request(0, b'\x03'))
    assert not RTU.concerns(drive, Request(1, b'\x06'))
    assert RTU.answer(drive, Request(0, bytes.fromhex('0602940003'))) == b''
    assert RTU.answer(drive, Request(7, bytes.fromhex('0602940003')))


# ---- cutting bytes into frames ----

CHARACTER = 11 / 19200
T35 = 3.5 * CHARACTER
READ = RTU.wrap(1, bytes.fromhex('0302940001'))
WRITE = RTU.wrap(1, bytes.fromhex('10027E00020413880000'))


def receiver(character=0.0):
    return Receiver(RTU, character, T35 + 0.002)


@pytest.mark.parametrize('frame', [READ, WRITE])
def test_a_frame_is_there_with_its_last_byte(frame):
    receive = receiver()
    for number, byte in enumerate(frame[:-1]):
        assert not list(receive.feed(bytes([byte]), 0.0001 * number))
    (arrived,) = receive.feed(frame[-1:], 0.002)
    assert arrived.data == frame
    assert arrived.first == 0


def test_a_paced_frame_is_there_when_the_line_has_carried_it():
    receive = receiver(CHARACTER)
    assert not list(receive.feed(READ, 10.0))
    assert receive.due == pytest.approx(10 + 8 * CHARACTER)
    assert not list(receive.take(10 + 7.9 * CHARACTER))
    (arrived,) = receive.take(10 + 8 * CHARACTER)
    assert arrived.data == READ
    assert (arrived.first, arrived.last) == (10.0, pytest.approx(10 + 8 * CHARACTER))


def test_frames_without_a_gap_are_two_frames():
    receive = receiver()
    first, second = receive.feed(READ + WRITE, 1.0)
    assert (first.data, second.data) == (READ, WRITE)


def test_paced_frames_without_a_gap_come_one_after_the_other():
    receive = receiver(CHARACTER)
    assert not list(receive.feed(READ + WRITE, 0.0))
    (first,) = receive.take(8 * CHARACTER)
    assert first.data == READ
    assert receive.due == pytest.approx((8 + len(WRITE)) * CHARACTER)
    (second,) = receive.take(1.0)
    assert second.data == WRITE
    assert second.first == pytest.approx(8 * CHARACTER)


@pytest.mark.parametrize(
    'rubbish', [b'\x00', b'\xff' * 7, READ[:5], READ[:-1] + b'\x00', bytes(300), b'\x01\x99abcdef']
)
@pytest.mark.parametrize('character', [0.0, CHARACTER])
def test_after_rubbish_silence_makes_a_fresh_start(rubbish, character):
    receive = receiver(character)
    assert not list(receive.feed(rubbish, 0.0))
    later = len(rubbish) * character + T35 + 0.003
    assert receive.due <= later
    arrived = list(receive.feed(READ, later))
    arrived += receive.take(later + 1)
    assert [one.data for one in arrived] == [rubbish, READ]
    assert receive.due is None


def test_an_unknown_function_ends_with_silence():
    receive = receiver()
    frame = RTU.wrap(1, b'\x41abc')
    assert not list(receive.feed(frame, 0.0))
    (arrived,) = receive.take(1.0)
    assert RTU.unwrap(arrived.data) == Request(1, b'\x41abc')


def test_endless_rubbish_is_not_collected():
    receive = receiver()
    out = sum(len(one.data) for n in range(100) for one in receive.feed(b'\xaa' * 100, n * 1e-4))
    assert out > 9000


@given(
    st.lists(st.tuples(st.binary(max_size=60), st.floats(0, 0.02)), max_size=20),
    st.sampled_from([0.0, CHARACTER]),
)
def test_no_byte_is_lost_or_made_up_and_time_goes_forward(chunks, character):
    receive = receiver(character)
    now = 0.0
    arrived = []
    for data, pause in chunks:
        arrived += receive.feed(data, now)
        now += pause
    arrived += receive.take(now + 100)
    assert b''.join(one.data for one in arrived) == b''.join(data for data, _ in chunks)
    for one, following in itertools.pairwise(arrived):
        assert one.first <= one.last
        assert one.last <= following.last
