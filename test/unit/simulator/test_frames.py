# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How a simulated line cuts bytes into frames, by every protocol, and which are none."""

import itertools

from classic_bench import select
from hypothesis import given, strategies as st
import movitrac_drive_bench as movitrac
import pytest

from nfo_sinus_driver.simulator import pymodbus_compat
from nfo_sinus_driver.simulator.classic import Classic
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Receiver
from nfo_sinus_driver.simulator.modbus_frames import ModbusAscii, ModbusRtu, ModbusTcp
from nfo_sinus_driver.simulator.movitrac import Movitrac

RTU, ASCII, TCP, CLASSIC, MOVITRAC = ModbusRtu(), ModbusAscii(), ModbusTcp(), Classic(), Movitrac()
READ = bytes.fromhex('0302940001')
STOP = bytes.fromhex('03020001')
READ_ASCII = b':01030294000165\r\n'
READ_TCP = bytes.fromhex('1234 0000 0006 01 03 0294 0001')
FRAMES = {
    RTU: RTU.wrap(1, READ), ASCII: READ_ASCII, TCP: READ_TCP, CLASSIC: select('E0019', 100),
    MOVITRAC: movitrac.select(25, movitrac.bcd(3.7)),
}  # fmt: skip
ids = [protocol.name for protocol in FRAMES]


def test_frames_of_the_standards_examples():
    assert pymodbus_compat.crc(bytes.fromhex('0207')) == bytes.fromhex('4112')
    assert pymodbus_compat.crc(bytes.fromhex('010302940001')) == bytes.fromhex('C45E')
    assert ASCII.wrap(2, b'\x07') == b':0207F7\r\n', 'the LRC of 02 07 is F7'
    for protocol, answer in (
        (RTU, RTU.wrap(1, STOP)),
        (ASCII, b':0103020001F9\r\n'),
        (TCP, bytes.fromhex('1234 0000 0005 01 03 02 0001')),
    ):
        request = protocol.unwrap(FRAMES[protocol])
        assert request.address == 1
        assert protocol.answer(simulated_drive(), request) == answer


def test_what_is_no_frame():
    for frame in (
        b'', b':\r\n', b':0165\r\n', READ_ASCII.replace(b'65', b'66'),
        READ_ASCII.replace(b'94', b'95'), READ_ASCII.replace(b'0294', b'029g'),
        READ_ASCII.replace(b'01030294000165', b'0103029400016'),
        b':0103029A00015F\r\n'.lower(), READ_ASCII[:-1], READ_ASCII[1:],
    ):
        assert ASCII.unwrap(frame) is None, frame
    for frame in (
        '', '1234 0000 0006 01', '1234 0001 0006 01 03 0294 0001', '1234 0000 0007 01 03 0294 0001'
    ):
        assert TCP.unwrap(bytes.fromhex(frame)) is None, frame


#: Frames, and from which byte on a wrong bit is noticed, and how many bits of a byte there are.
MADE = {
    RTU: (st.builds(RTU.wrap, st.integers(0, 255), st.binary(min_size=1, max_size=30)), 0, 8),
    ASCII: (st.builds(ASCII.wrap, st.integers(0, 255), st.binary(min_size=1, max_size=30)), 0, 7),
    # a wrong address is another address
    CLASSIC: (st.builds(select, st.just('E0019'), st.integers(0, 0xFFFF)), 3, 8),
    MOVITRAC: (movitrac.requests, 0, 8),
}


@pytest.mark.parametrize('protocol', MADE, ids=lambda protocol: protocol.name)
@given(st.data())
def test_a_flipped_bit_is_noticed(protocol, data):
    made, first, bits = MADE[protocol]
    frame = bytearray(data.draw(made))
    assert protocol.unwrap(bytes(frame)).whole
    place = data.draw(st.integers(first, len(frame) - 1))
    frame[place] ^= 1 << data.draw(st.integers(0, bits - 1))
    request = protocol.unwrap(bytes(frame))
    assert request is None or not request.whole


# ---- cutting bytes into frames ----

CHARACTER = 11 / 19200
T35 = 3.5 * CHARACTER
WRITE = RTU.wrap(1, bytes.fromhex('10027E00020413880000'))


def receiver(protocol=RTU, character=0.0):
    return Receiver(protocol, character, T35 + 0.002 if protocol is RTU else 1.0)


def arrived(protocol, *chunks, pause=0.001):
    receive = receiver(protocol)
    out = []
    for number, chunk in enumerate(chunks):
        out += receive.feed(chunk, pause * number)
    out += receive.take_frames(1000)
    return [frame.data for frame in out]


def test_cutting():
    rubbish = b'GET / HTTP/1.1\r\n'
    classic = FRAMES[CLASSIC]
    for protocol, pause, chunks, frames in (
        (RTU, 0.0001, [bytes([byte]) for byte in WRITE], [WRITE]),
        (ASCII, 0.9, [bytes([byte]) for byte in READ_ASCII], [READ_ASCII]),
        (TCP, 0.001, [bytes([byte]) for byte in READ_TCP], [READ_TCP]),
        *((framing, 0.001, [frame + frame], [frame, frame]) for framing, frame in FRAMES.items()),
        (ASCII, 0.001, [b'xx\r\n' + READ_ASCII], [b'xx\r\n', READ_ASCII]),
        (ASCII, 0.001, [b':0103' + READ_ASCII], [b':0103', READ_ASCII]),
        (ASCII, 1.1, [READ_ASCII[:6], READ_ASCII], [READ_ASCII[:6], READ_ASCII]),
        (ASCII, 1.1, [READ_ASCII[:6], READ_ASCII[6:]], [READ_ASCII[:6], READ_ASCII[6:]]),
        (ASCII, 0.001, [bytes(5)], [bytes(5)]),
        (TCP, 0.001, [rubbish, READ_TCP], [rubbish, READ_TCP]),
        (TCP, 0.001, [READ_TCP[:5] + b'\xff\x01'], [READ_TCP[:5] + b'\xff\x01']),
        (RTU, 0.001, [RTU.wrap(1, b'\x41abc')], [RTU.wrap(1, b'\x41abc')]),
        # an EOT begins anew, and so does a second of silence
        (CLASSIC, 0.001, [b'\x04!E00' + classic], [b'\x04!E00', classic]),
        (CLASSIC, 1.1, [classic[:7], classic], [classic[:7], classic]),
        (CLASSIC, 0.9, [classic[:7], classic[7:]], [classic]),
        # a SELECT that lacks nothing but its check sum takes the EOT
        (CLASSIC, 0.001, [classic[:-1] + classic], [classic[:-1] + b'\x04', classic[1:]]),
    ):
        assert arrived(protocol, *chunks, pause=pause) == frames, chunks


def test_the_check_sum_of_classic_may_be_any_control_character():
    found = {}
    for value in range(0x200):
        for id_ in ('E0019', 'E000A', 'E00AB'):
            frame = select(id_, value)
            found.setdefault(frame[-1], frame)
    assert set(range(0x10)) <= set(found)
    for frame in found.values():
        assert arrived(CLASSIC, frame + frame) == [frame, frame]
        assert arrived(CLASSIC, *(bytes([byte]) for byte in frame)) == [frame]


def test_a_paced_frame_is_there_when_the_line_has_carried_it():
    receive = receiver(character=CHARACTER)
    frame = FRAMES[RTU]
    assert not list(receive.feed(frame + WRITE, 10.0))
    assert receive.due == pytest.approx(10 + 8 * CHARACTER)
    assert not list(receive.take_frames(10 + 7.9 * CHARACTER))
    (first,) = receive.take_frames(10 + 8 * CHARACTER)
    assert (first.data, first.first) == (frame, 10.0)
    assert first.last == pytest.approx(10 + 8 * CHARACTER)
    assert receive.due == pytest.approx(10 + (8 + len(WRITE)) * CHARACTER)
    (second,) = receive.take_frames(11.0)
    assert (second.data, second.first) == (WRITE, pytest.approx(10 + 8 * CHARACTER))


def test_after_rubbish_silence_makes_a_fresh_start():
    frame = FRAMES[RTU]
    for rubbish in (
        b'\x00', b'\xff' * 7, frame[:5], frame[:-1] + b'\x00', bytes(300), b'\x01\x99abcdef'
    ):
        for character in (0.0, CHARACTER):
            receive = receiver(character=character)
            assert not list(receive.feed(rubbish, 0.0))
            later = len(rubbish) * character + T35 + 0.003
            assert receive.due <= later
            found = [*receive.feed(frame, later), *receive.take_frames(later + 1)]
            assert [taken.data for taken in found] == [rubbish, frame]
            assert receive.due is None
    receive = receiver()
    fed = [taken for n in range(100) for taken in receive.feed(b'\xaa' * 100, n * 1e-4)]
    out = sum(len(taken.data) for taken in fed)
    assert out > 9000, 'endless rubbish is not collected'


@pytest.mark.parametrize('protocol', FRAMES, ids=ids)
@given(
    st.lists(st.tuples(st.binary(max_size=60), st.floats(0, 0.02)), max_size=20), st.booleans()
)
def test_no_byte_is_lost_or_made_up_and_a_frame_after_silence_is_found(protocol, chunks, paced):
    receive = receiver(protocol, CHARACTER if paced and protocol is RTU else 0.0)
    now, found = 0.0, []
    for data, pause in chunks:
        found += receive.feed(data, now)
        now += pause
    found += receive.take_frames(now + 100)
    assert b''.join(frame.data for frame in found) == b''.join(data for data, _ in chunks)
    for frame in found:
        protocol.unwrap(frame.data)
        assert frame.first <= frame.last
    for frame, following in itertools.pairwise(found):
        assert frame.last <= following.last
    out = [*receive.feed(FRAMES[protocol], now + 200), *receive.take_frames(now + 300)]
    assert [frame.data for frame in out] == [FRAMES[protocol]]
