# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""CAN frames as lines of text, in whatever pieces they come."""

from __future__ import annotations

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.link.canopen.can import Frame
from nfo_sinus_driver.link.canopen.lawicel import BIT_RATES, Output, Reader, bit_rate, encode
from nfo_sinus_driver.link.protocols import CANOPEN

FRAMES = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8), st.just(False))
#: What else an adapter says.
OTHERS = st.sampled_from(
    [b'\r', b'z\r', b'Z\r', b'\a', b'F00\r', b'V1013\r', b'r1000\r', b'T000001002AABB\r']
)


def heard(*pieces: bytes) -> Output:
    """Return all that a reader hears."""
    reader = Reader()
    each = [reader.feed(piece) for piece in pieces]
    frames = [frame for output in each for frame in output.frames]
    done = sum(output.done for output in each)
    return Output(frames, done, sum(output.refused for output in each))


def pieces_of(data: st.DataObject, stream: bytes) -> list[bytes]:
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    return [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]


@pytest.mark.parametrize(
    ('frame', 'line'),
    [
        # the examples of the CANUSB's manual
        (Frame(0x100, b''), b't1000\r'),
        (Frame(0x7FF, b'\x11'), b't7FF111\r'),
        (Frame(0x601, bytes.fromhex('4000100000000000')), b't60184000100000000000\r'),
    ],
)
def test_frames_as_lines(frame: Frame, line: bytes) -> None:
    assert encode(frame) == line
    assert heard(line) == Output([frame], 0, 0)
    assert heard(line.lower()) == Output([frame], 0, 0)


@given(st.data(), st.lists(st.one_of(FRAMES, OTHERS), max_size=8), st.booleans())
def test_every_frame_is_found_in_any_pieces(
    data: st.DataObject, said: list[Frame | bytes], stamps: bool
) -> None:
    stream = b''
    for what in said:
        line = encode(what) if isinstance(what, Frame) else what
        if isinstance(what, Frame) and stamps:
            line = line[:-1] + b'12fe\r'
        stream += line
    found = heard(*pieces_of(data, stream))
    assert found.frames == [what for what in said if isinstance(what, Frame)]
    assert found.done == sum(what in (b'\r', b'z\r', b'Z\r') for what in said)
    assert found.refused == said.count(b'\a')


def test_a_remote_frame_asks_for_a_length() -> None:
    assert encode(Frame(0x705, b'\0', remote=True)) == b'r7051\r'


@given(st.data(), st.binary(max_size=80), FRAMES)
def test_a_frame_is_found_behind_any_noise(
    data: st.DataObject, noise: bytes, frame: Frame
) -> None:
    stream = noise + b'\r' + encode(frame)
    assert heard(*pieces_of(data, stream)).frames[-1] == frame
    assert heard(*pieces_of(data, stream)) == heard(stream)


@given(FRAMES)
def test_what_lacks_a_digit_or_has_one_more_is_no_frame(frame: Frame) -> None:
    line = encode(frame)[:-1]
    for wrong in (line[:-1], line[1:], line + b'0', b't' + line, b' ' + line):
        assert heard(wrong + b'\r').frames == []


@given(st.lists(st.binary(max_size=50), max_size=20))
def test_whatever_comes_little_is_kept(pieces: list[bytes]) -> None:
    reader = Reader()
    for piece in pieces:
        reader.feed(piece)
        assert reader.pending <= 26


@given(st.integers(0, 0xFFF), st.integers(0, 15))
def test_what_no_can_bus_has_is_no_frame(identifier: int, size: int) -> None:
    line = f't{identifier:03X}{size:X}{bytes(size).hex()}\r'
    possible = identifier <= 0x7FF and size <= 8
    assert heard(line.encode()).frames == [Frame(identifier, bytes(size))] * possible


def test_lines_that_lost_the_end_between_them_are_no_frame() -> None:
    line = encode(Frame(0x581, bytes(8)))
    assert heard(line[:-1] + line).frames == []
    assert heard(line[:-1], line).frames == []
    assert heard(line[:-1] + b'\a' + line).frames == [Frame(0x581, bytes(8))]


@pytest.mark.parametrize('frame', [Frame(0x800, b''), Frame(-1, b''), Frame(1, bytes(9))])
def test_what_is_no_standard_frame(frame: Frame) -> None:
    with pytest.raises(ValueError, match='no standard frame'):
        encode(frame)


def test_bit_rates() -> None:
    assert [bit_rate(rate) for rate in (10_000, 125_000, 1_000_000)] == [b'S0\r', b'S4\r', b'S8\r']
    assert sorted(BIT_RATES.values()) == list(range(9))
    assert tuple(BIT_RATES) == CANOPEN.baud_rates
    with pytest.raises(ValueError, match='bit rate 9600: there are 10000, 20000'):
        bit_rate(9600)
