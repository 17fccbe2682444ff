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

"""Modbus ASCII and TCP, byte by byte, and what a gateway says in place of a drive."""

from hypothesis import given
from hypothesis import strategies as st
import pytest

from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Receiver
from nfo_sinus_driver.simulator.modbus_frames import ModbusAscii
from nfo_sinus_driver.simulator.modbus_frames import ModbusTcp
from nfo_sinus_driver.simulator.protocol import Request

ASCII = ModbusAscii()
TCP = ModbusTcp(0.25)
#: Read MODE of drive 1: 01 03 02 94 00 01, and the LRC that makes all of them 0.
READ = b':01030294000165\r\n'
READ_TCP = bytes.fromhex('1234 0000 0006 01 03 0294 0001')


def arrived(protocol, *chunks, pause=0.001):
    receive = Receiver(protocol, 0.0, 1.0)
    out = []
    for number, chunk in enumerate(chunks):
        out += receive.feed(chunk, pause * number)
    out += receive.take(1000)
    return [one.data for one in out]


# ---- ASCII ----


def test_ascii_frames():
    assert ASCII.unwrap(READ) == Request(1, bytes.fromhex('0302940001'))
    # the standard's example of an LRC: 02 07 has F7
    assert ASCII.wrap(2, b'\x07') == b':0207F7\r\n'
    assert ASCII.answer(simulated_drive(), ASCII.unwrap(READ)) == b':0103020001F9\r\n'
    assert ASCII.wrap(1, b'\x83\x02') == b':0183027A\r\n'


@pytest.mark.parametrize(
    'frame',
    [
        b'',
        b':\r\n',
        b':0165\r\n',
        READ.replace(b'65', b'66'),
        READ.replace(b'94', b'95'),
        READ.replace(b'0294', b'029g'),
        READ.replace(b'01030294000165', b'0103029400016'),
        b':0103029A00015F\r\n'.lower(),
        READ[:-1],
        READ[1:],
    ],
)
def test_damaged_ascii_frames(frame):
    assert ASCII.unwrap(frame) is None


@given(st.integers(0, 255), st.binary(min_size=1, max_size=100))
def test_ascii_wrap_and_unwrap(address, pdu):
    assert ASCII.unwrap(ASCII.wrap(address, pdu)) == Request(address, pdu)


@given(st.binary(min_size=1, max_size=30), st.data())
def test_a_flipped_bit_of_ascii_is_noticed(pdu, data):
    frame = bytearray(ASCII.wrap(1, pdu))
    frame[data.draw(st.integers(0, len(frame) - 1))] ^= 1 << data.draw(st.integers(0, 6))
    assert ASCII.unwrap(bytes(frame)) is None


def test_cutting_ascii():
    assert arrived(ASCII, READ + READ) == [READ, READ]
    assert arrived(ASCII, *(bytes([byte]) for byte in READ), pause=0.9) == [READ]
    assert arrived(ASCII, b'xx\r\n' + READ) == [b'xx\r\n', READ]
    assert arrived(ASCII, b':0103' + READ) == [b':0103', READ]
    assert arrived(ASCII, READ[:6], READ, pause=1.1) == [READ[:6], READ]
    assert arrived(ASCII, READ[:6], READ[6:], pause=1.1) == [READ[:6], READ[6:]]
    assert arrived(ASCII, b'\x00' * 5) == [b'\x00' * 5]


@given(st.lists(st.binary(max_size=20), max_size=10))
@pytest.mark.parametrize('protocol', [ASCII, TCP])
def test_no_byte_is_lost_and_a_frame_after_silence_is_found(protocol, chunks):
    receive = Receiver(protocol, 0.0, 1.0)
    out = [one.data for n, chunk in enumerate(chunks) for one in receive.feed(chunk, 0.001 * n)]
    out += [one.data for one in receive.take(100)]
    assert b''.join(out) == b''.join(chunks)
    for data in out:
        protocol.unwrap(data)
    frame = READ if protocol is ASCII else READ_TCP
    assert [one.data for one in receive.feed(frame, 200)] == [frame]


# ---- TCP ----


def test_tcp_frames():
    request = TCP.unwrap(READ_TCP)
    assert request.address == 1
    answer = TCP.answer(simulated_drive(), request)
    assert answer == bytes.fromhex('1234 0000 0005 01 03 02 0001')


@pytest.mark.parametrize(
    'frame',
    ['', '1234 0000 0006 01', '1234 0001 0006 01 03 0294 0001', '1234 0000 0007 01 03 0294 0001'],
)
def test_what_is_no_tcp_frame(frame):
    assert TCP.unwrap(bytes.fromhex(frame)) is None


def test_cutting_tcp():
    assert arrived(TCP, READ_TCP + READ_TCP) == [READ_TCP, READ_TCP]
    assert arrived(TCP, *(bytes([byte]) for byte in READ_TCP)) == [READ_TCP]
    rubbish = b'GET / HTTP/1.1\r\n'
    assert arrived(TCP, rubbish, READ_TCP) == [rubbish, READ_TCP]
    assert arrived(TCP, bytes.fromhex('1234 0000 00FF 01')) == [bytes.fromhex('1234 0000 00FF 01')]


def test_a_write_to_everybody():
    drive = simulated_drive(address=9)
    write = TCP.unwrap(bytes.fromhex('0001 0000 0006 00 06 0294 0003'))
    assert TCP.concerns(drive, write)
    assert TCP.answer(drive, write) == b''
    assert drive.control_unit.mode == 3
    read = TCP.unwrap(bytes.fromhex('0001 0000 0006 00 03 0294 0001'))
    assert not TCP.concerns(drive, read)
    assert TCP.instead(read, False) is None


def test_what_the_gateway_says():
    request = TCP.unwrap(READ_TCP)
    silent, absent = TCP.instead(request, True), TCP.instead(request, False)
    assert (silent.data, silent.delay) == (bytes.fromhex('1234 0000 0003 01 83 0B'), 0.25)
    assert (absent.data, absent.delay) == (bytes.fromhex('1234 0000 0003 01 83 0A'), 0.0)
