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

"""Classic messages, byte by byte: the manuals' example, and cutting what comes into messages."""

from classic_bench import bcc
from classic_bench import enquiry
from classic_bench import reply
from classic_bench import select
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from support.examples import examples

from nfo_sinus_driver.simulator import classic_frames
from nfo_sinus_driver.simulator.classic import Classic
from nfo_sinus_driver.simulator.classic_frames import LineError
from nfo_sinus_driver.simulator.classic_frames import Message
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Receiver

#: "A SELECT message to address 1 which gives parameter 25 the value of 100" ([M0 §6.1.3], [M2 §5]).
EXAMPLE = bytes.fromhex('04 21 02 45 30 30 31 39 3D 30 30 36 34 03 71')


def test_the_example_of_the_manuals():
    assert classic_frames.address(EXAMPLE) == 1
    assert classic_frames.parse(EXAMPLE) == Message(id=0x19, value=100)
    assert select('E0019', 100) == EXAMPLE


def test_an_enquiry():
    frame = bytes.fromhex('04 7E 45 30 30 45 39 05')
    assert frame == enquiry('E00E9', 94)
    assert classic_frames.address(frame) == 94
    assert classic_frames.parse(frame) == Message(id=0xE9)


def test_answers():
    # 21 02 E0019=0064 03 71
    assert classic_frames.reply(1, 0x19, 100, small_letters=False) == b'!\x02E0019=0064\x03q'
    assert classic_frames.reply(94, 0xAC, 0xABCD, small_letters=True) == b'~\x02E00ac=abcd\x03' + (
        bcc(b'E00ac=abcd\x03')
    )
    assert classic_frames.acknowledge(0, True) == b' \x06'
    assert classic_frames.acknowledge(1, False) == b'!\x15'


@pytest.mark.parametrize(
    ('frame', 'wrong'),
    [
        (EXAMPLE[:-1] + b'\x72', LineError.CHECK_SUM),
        (EXAMPLE.replace(b'0064', b'0065'), LineError.CHECK_SUM),
        (EXAMPLE.replace(b'=', b'-'), LineError.STRUCTURE),
        (EXAMPLE.replace(b'\x03', b'\x17'), LineError.STRUCTURE),
        (EXAMPLE.replace(b'0064', b'00G4'), LineError.STRUCTURE),
        (EXAMPLE[:-2], LineError.STRUCTURE),
        (b'\x04!E0019\x06', LineError.STRUCTURE),
        (b'\x04!E001\x05', LineError.STRUCTURE),
        (b'\x04!F0019\x05', LineError.PREFIX),
        (b'\x04!\x02F0019=0064\x03' + bcc(b'F0019=0064\x03'), LineError.PREFIX),
    ],
)
def test_what_is_wrong_with_it(frame, wrong):
    assert classic_frames.parse(frame).wrong is wrong


def test_small_letters_are_read_where_they_are_known():
    frame = b'\x04!E00e9\x05'
    assert classic_frames.parse(frame, small_letters=True).id == 0xE9
    assert classic_frames.parse(frame, small_letters=False).wrong is LineError.STRUCTURE


@pytest.mark.parametrize('frame', [b'', b'\x04', b'\x04\x1f', b'\x04\x80', b'!E0019\x05'])
def test_a_message_to_nobody(frame):
    assert classic_frames.address(frame) is None
    assert Classic.unwrap(frame) is None


def arrived(*chunks, pause=0.001):
    """What the receiver makes of bytes that come in chunks."""
    receive = Receiver(Classic(), 0.0, 1.0)
    out = []
    for number, chunk in enumerate(chunks):
        out += receive.feed(chunk, pause * number)
    out += receive.take(1000)
    return [one.data for one in out]


def check_sums():
    """A SELECT for every check sum there is, by the check sum."""
    found = {}
    for value in range(0x200):
        for id_ in ('E0019', 'E000A', 'E00AB'):
            frame = select(id_, value)
            found.setdefault(frame[-1], frame)
    return found


def test_a_check_sum_may_be_any_control_character():
    found = check_sums()
    assert set(range(0x10)) <= set(found)
    for frame in found.values():
        assert arrived(frame + frame) == [frame, frame]
        assert arrived(*(bytes([byte]) for byte in frame)) == [frame]


@pytest.mark.parametrize('rubbish', [b'\x00', b'abc', EXAMPLE[:-1], b'\x04', b'\x04!', b'\x04!E00'])
def test_an_eot_begins_anew(rubbish):
    # all but a SELECT that lacks nothing but its check sum: that one takes the EOT
    expected = [rubbish, enquiry('E00E9')]
    if rubbish == EXAMPLE[:-1]:
        expected = [rubbish + b'\x04', enquiry('E00E9')[1:]]
    assert arrived(rubbish + enquiry('E00E9')) == expected


def test_a_second_of_silence_ends_what_is_no_message():
    assert arrived(EXAMPLE[:7], enquiry('E00E9'), pause=1.1) == [EXAMPLE[:7], enquiry('E00E9')]
    assert arrived(EXAMPLE[:7], EXAMPLE[7:], pause=0.9) == [EXAMPLE]


@given(st.lists(st.binary(max_size=20), max_size=10))
def test_no_byte_is_lost_and_a_message_after_silence_is_found(chunks):
    receive = Receiver(Classic(), 0.0, 1.0)
    out = [one.data for n, chunk in enumerate(chunks) for one in receive.feed(chunk, 0.001 * n)]
    out += [one.data for one in receive.take(100)]
    assert b''.join(out) == b''.join(chunks)
    assert [one.data for one in receive.feed(EXAMPLE, 200)] == [EXAMPLE]


@given(st.binary(max_size=30), st.sampled_from([4.21, 4.38]))
@settings(max_examples=examples(500))
def test_whatever_comes_the_answer_is_one_of_the_three(data, sw_ver):
    drive = simulated_drive(settings={'fieldbus.sw_ver': sw_ver})
    protocol = Classic()
    frame = b'\x04 ' + data
    request = protocol.unwrap(frame)
    answer = protocol.answer(drive, request)
    assert answer in (b'', b' \x15', b'!\x15') or (len(answer) == 14 and answer[1] == 2)
    if not answer:
        assert drive.faults.sio_err


@given(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF), st.data())
def test_a_flipped_bit_is_noticed(id_, value, data):
    frame = bytearray(select(f'E{id_:04X}', value))
    # a letter's case apart (bit 5), which the BCC does notice
    bit = data.draw(st.integers(8 * 3, 8 * len(frame) - 1))
    frame[bit // 8] ^= 1 << bit % 8
    assert classic_frames.parse(bytes(frame)).wrong


def test_the_helpers_of_these_tests_agree_with_the_manual():
    assert reply('E0019', 100) == bytes.fromhex('21 02') + EXAMPLE[3:]
