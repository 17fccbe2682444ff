# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus TCP frames: the same as pymodbus's, and nothing false is ever believed."""

from __future__ import annotations

from hypothesis import given, strategies as st
import pymodbus_opinion as opinion
import pytest
from support.addresses import packed

from nfo_sinus_driver.link.modbus import pdu
from nfo_sinus_driver.link.modbus.pdu import Read, Request, Write
from nfo_sinus_driver.link.modbus.tcp import FrameReader, encode

NUMBER = st.integers(0, 0xFFFF)
MESSAGE = st.binary(min_size=2, max_size=254)
FRAMES = st.lists(st.tuples(NUMBER, MESSAGE), max_size=4)


@st.composite
def pieces(draw: st.DrawFn, data: bytes) -> list[bytes]:
    """The same bytes in any pieces."""
    cuts = sorted(draw(st.lists(st.integers(0, len(data)), max_size=4)))
    return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


@pytest.mark.parametrize(
    ('request_', 'number', 'frame'),
    [
        # the example of the implementation guide's annex, and a status word of the G2
        (Read(0xFF, 4, 1), 0x1501, '15 01 00 00 00 06 FF 03 00 04 00 01'),
        (Read(1, 0x2A5, 1), 1, '00 01 00 00 00 06 01 03 02 A5 00 01'),
        (Write(17, 1, packed(3)), 0xFFFF, 'FF FF 00 00 00 06 11 06 00 01 00 03'),
    ],
)
def test_golden_frames(request_: Request[object], number: int, frame: str) -> None:
    assert encode(request_, number) == bytes.fromhex(frame)


@given(st.integers(0, 247), st.integers(0, 0xFFFF), st.integers(1, 125), NUMBER)
def test_request_is_pymodbus_s(unit: int, register: int, count: int, number: int) -> None:
    request = Read(unit, register, count)
    assert encode(request, number) == opinion.tcp_frame(pdu.encode(request), number)


@given(st.data(), FRAMES)
def test_frames_of_pymodbus_in_any_pieces(
    data: st.DataObject, frames: list[tuple[int, bytes]]
) -> None:
    stream = b''.join(opinion.tcp_frame(message, number) for number, message in frames)
    reader = FrameReader()
    got = [frame for piece in data.draw(pieces(stream)) for frame in reader.feed(piece)]
    assert got == frames
    assert reader.received == 0
    assert not reader.out_of_step


@given(st.data(), FRAMES, st.binary(max_size=40))
def test_any_bytes_at_all(
    data: st.DataObject, frames: list[tuple[int, bytes]], rubbish: bytes
) -> None:
    stream = b''.join(opinion.tcp_frame(message, number) for number, message in frames)
    stream += rubbish
    reader = FrameReader()
    got = [frame for piece in data.draw(pieces(stream)) for frame in reader.feed(piece)]
    # what was right before is right, and what came of the rest is nothing but what it says
    assert got[: len(frames)] == frames
    packed = b''.join(opinion.tcp_frame(message, number) for number, message in got)
    assert stream.startswith(packed)
    assert reader.received == len(stream) - len(packed)


@pytest.mark.parametrize(
    'header',
    ['0001 0001 0006', '0001 0000 0000', '0001 0000 0001', '0001 0000 00FF', '3A30 3130 3330'],
)
def test_another_device_is_there(header: str) -> None:
    reader = FrameReader()
    assert reader.feed(bytes.fromhex(header)) == []
    assert reader.out_of_step
    # nothing after it can be understood, however right it looks
    assert reader.feed(bytes.fromhex('0001 0000 0003 018302')) == []
