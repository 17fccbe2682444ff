# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus RTU frames: the same as pymodbus's, and nothing false is ever believed."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import assume, example, given, strategies as st
import pymodbus_opinion as opinion
import pytest
from support.addresses import packed, words_of

from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.link.modbus_pdu import Read, Request, Write
from nfo_sinus_driver.link.rtu import CRC_LENGTH, RtuReader, crc, encode


def contents(least: int, most: int) -> st.SearchStrategy[bytes]:
    """What so many registers may hold."""
    words = st.lists(st.integers(0, 0xFFFF), min_size=least, max_size=most)
    return words.map(lambda held: packed(*held))


UNIT = st.integers(1, 247)
REGISTER = st.integers(0, 0xFF00)
READS = st.builds(Read, UNIT, REGISTER, st.integers(1, 125))
WRITES = st.builds(Write, UNIT, REGISTER, contents(1, 123))
# what drives are asked: few units and registers, so that answers resemble each other
FEW = st.sampled_from([1, 2])
PARAMETERS = st.sampled_from([0x2A5, 0x258, 0x400])
CLOSE = st.one_of(
    st.builds(Read, FEW, PARAMETERS, st.integers(1, 2)),
    st.builds(Write, FEW, PARAMETERS, contents(1, 2)),
)


def answer_to(request: Request, held: bytes) -> bytes:
    """The answer of a unit, as pymodbus encodes it; what the registers hold for a read."""
    if isinstance(request, Read):
        return opinion.read_answer(request.unit, words_of(held))
    return opinion.write_answer(request.unit, request.register, words_of(request.data))


def wanted(request: Request, held: bytes) -> bytes:
    """What the reader has to return for that answer."""
    return held if isinstance(request, Read) else b''


def contents_for(request: Request) -> st.SearchStrategy[bytes]:
    """Anything that can be the answer to a read."""
    count = request.count if isinstance(request, Read) else 1
    return contents(count, count)


@st.composite
def exchanges(draw: st.DrawFn, requests: st.SearchStrategy[Request]) -> tuple[Request, bytes]:
    """A request, and what is read."""
    request = draw(requests)
    return request, draw(contents_for(request))


@st.composite
def pieces(draw: st.DrawFn, data: bytes) -> list[bytes]:
    """The same bytes in any pieces."""
    cuts = sorted(draw(st.lists(st.integers(0, len(data)), max_size=4)))
    return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


def feed(reader: RtuReader, data: list[bytes]) -> bytes | None:
    """Feed pieces until something is found."""
    for piece in data:
        found = reader.feed(piece)
        if found is not None:
            return found
    return None


def spoil(frame: bytes, bit: int) -> bytes:
    """The frame with one bit wrong."""
    damaged = bytearray(frame)
    damaged[bit // 8 % len(frame)] ^= 1 << bit % 8
    return bytes(damaged)


# --- check sum ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('data', 'check'),
    [
        # the example of MODBUS over Serial Line V1.02, then frames that every tutorial has
        ('02 07', '41 12'),
        ('01 03 00 00 00 0A', 'C5 CD'),
        ('01 04 02 FF FF', 'B8 80'),
        ('11 03 00 6B 00 03', '76 87'),
        ('11 06 00 01 00 03', '9A 9B'),
        ('11 10 00 01 00 02 04 00 0A 01 02', 'C6 F0'),
        ('31 32 33 34 35 36 37 38 39', '37 4B'),
        ('', 'FF FF'),
    ],
)
def test_golden_check_sums(data: str, check: str) -> None:
    assert crc(bytes.fromhex(data)) == bytes.fromhex(check)


@given(st.binary(max_size=300))
def test_check_sum_is_pymodbus_s(data: bytes) -> None:
    assert crc(data) == opinion.crc(data) == crc(bytearray(data))


@pytest.mark.parametrize(
    ('request_', 'frame'),
    [
        (Read(17, 0x6B, 3), '11 03 00 6B 00 03 76 87'),
        (Write(17, 1, packed(3)), '11 06 00 01 00 03 9A 9B'),
        (Write(17, 1, packed(10, 0x0102)), '11 10 00 01 00 02 04 00 0A 01 02 C6 F0'),
    ],
)
def test_golden_frames(request_: Request, frame: str) -> None:
    assert encode(request_) == bytes.fromhex(frame)


# --- agreement with pymodbus ----------------------------------------------------------------------


@given(READS)
def test_read_request_is_pymodbus_s(request: Read) -> None:
    frame = encode(request)
    assert frame == opinion.read_request(request.unit, request.register, request.count)
    assert opinion.decoded(frame) == (request.unit, 3, request.register, request.count, ())


@given(WRITES)
def test_write_request_is_pymodbus_s(request: Write) -> None:
    frame = encode(request)
    assert frame == opinion.write_request(request.unit, request.register, words_of(request.data))
    function = 6 if len(request.data) == 2 else 16
    count = len(request.data) // 2
    assert opinion.decoded(frame) == (
        request.unit,
        function,
        request.register,
        count,
        words_of(request.data),
    )


@given(st.data(), exchanges(st.one_of(READS, WRITES)))
def test_answer_of_pymodbus_in_any_pieces(
    data: st.DataObject, exchange: tuple[Request, bytes]
) -> None:
    request, held = exchange
    frame = answer_to(request, held)
    assert len(frame) == request.answer_length + CRC_LENGTH
    assert frame.startswith(request.answer_head)
    reader = RtuReader(request)
    assert feed(reader, data.draw(pieces(frame))) == wanted(request, held)
    assert reader.received == 0


@given(st.data(), st.one_of(READS, WRITES), st.integers(0, 255))
def test_exception_of_pymodbus_in_any_pieces(
    data: st.DataObject, request: Request, code: int
) -> None:
    frame = opinion.exception(request.unit, request.function, code)
    reader = RtuReader(request)
    with pytest.raises(Refused) as refusal:
        feed(reader, data.draw(pieces(frame)))
    assert refusal.value.code == code
    assert f'exception {code}' in str(refusal.value)
    assert not refusal.value.maybe_done
    assert reader.received == 0


# --- what else comes over a line ------------------------------------------------------------------


@given(st.data(), exchanges(CLOSE), st.binary(max_size=20))
def test_noise_before_a_good_answer(
    data: st.DataObject, exchange: tuple[Request, bytes], noise: bytes
) -> None:
    request, held = exchange
    frame = answer_to(request, held)
    assume(frames_in(request, noise + frame) == [frame])
    got = outcome(RtuReader(request), data.draw(pieces(noise + frame)))
    assert got == wanted(request, held)


@given(exchanges(CLOSE), st.integers(0, 8 * 256))
@example((Read(1, 0x2A5, 1), packed(37)), 0)
def test_damaged_answer_is_none(exchange: tuple[Request, bytes], bit: int) -> None:
    request, held = exchange
    reader = RtuReader(request)
    damaged = spoil(answer_to(request, held), bit)
    assume(not frames_in(request, damaged))
    assert outcome(reader, [damaged]) is None
    assert reader.received == len(damaged)


@given(st.data(), exchanges(CLOSE), st.integers(0, 8 * 256))
def test_damaged_answer_and_then_a_good_one(
    data: st.DataObject, exchange: tuple[Request, bytes], bit: int
) -> None:
    request, held = exchange
    damaged = spoil(answer_to(request, data.draw(contents_for(request))), bit)
    stream = damaged + answer_to(request, held)
    assume(frames_in(request, stream) == [answer_to(request, held)])
    assert outcome(RtuReader(request), data.draw(pieces(stream))) == wanted(request, held)


@given(st.data(), exchanges(CLOSE), CLOSE)
def test_answer_to_something_else_is_passed_over(
    data: st.DataObject, exchange: tuple[Request, bytes], other: Request
) -> None:
    request, held = exchange
    alien = answer_to(other, data.draw(contents_for(other)))
    same = alien.startswith(request.answer_head)
    reader = RtuReader(request)
    got = outcome(reader, data.draw(pieces(alien)))
    if same:
        # a read answer does not say what was read: the link above has to know
        assert got is not None
        return
    frame = answer_to(request, held)
    assume(frames_in(request, alien + frame) == [frame])
    assert got is None
    assert outcome(reader, [frame]) == wanted(request, held)


@given(st.data(), exchanges(CLOSE))
def test_exception_to_another_unit_is_passed_over(
    data: st.DataObject, exchange: tuple[Request, bytes]
) -> None:
    request, held = exchange
    function = {3: 6, 6: 16, 16: 3}[request.function]
    aliens = [
        opinion.exception(request.unit + 1, request.function, 2),
        opinion.exception(request.unit, function, 2),
    ]
    frame = answer_to(request, held)
    stream = b''.join([*aliens, frame])
    assume(frames_in(request, stream) == [frame])
    assert outcome(RtuReader(request), data.draw(pieces(stream))) == wanted(request, held)


@given(exchanges(CLOSE), st.binary(min_size=1, max_size=10))
def test_bytes_behind_the_answer_are_counted(
    exchange: tuple[Request, bytes], rest: bytes
) -> None:
    request, held = exchange
    reader = RtuReader(request)
    assert reader.feed(answer_to(request, held) + rest) == wanted(request, held)
    assert reader.received == len(rest)


@given(exchanges(CLOSE), st.integers(1, 255))
def test_feeding_goes_on_after_a_refusal(exchange: tuple[Request, bytes], code: int) -> None:
    request, held = exchange
    reader = RtuReader(request)
    stream = opinion.exception(request.unit, request.function, code) + answer_to(request, held)
    with pytest.raises(Refused):
        reader.feed(stream)
    assert reader.feed(b'') == wanted(request, held)


# --- any bytes at all -----------------------------------------------------------------------------

Outcome = bytes | str | None


def outcome(reader: RtuReader, data: list[bytes]) -> Outcome:
    """What comes of bytes: contents, a refusal, or nothing; anything else raises."""
    try:
        return feed(reader, data)
    except Refused as refusal:
        return f'refused {refusal.code}'


def frames_in(request: Request, stream: bytes) -> list[bytes]:
    """Every piece of the bytes that is a frame to believe, by pymodbus's check sum."""
    heads = [
        (request.answer_head, request.answer_length + CRC_LENGTH),
        (bytes((request.unit, request.function | 0x80)), 5),
    ]
    return [
        stream[start : start + length]
        for start in range(len(stream))
        for head, length in heads
        if len(stream) >= start + length
        and stream[start:].startswith(head)
        and opinion.crc(stream[start : start + length - 2])
        == stream[start + length - 2 : start + length]
    ]


def everything(request: Request, stream: bytes) -> set[Outcome]:
    """What may come of the frames in the bytes, or nothing if there is none."""
    possible: set[Outcome] = set()
    for frame in frames_in(request, stream):
        if frame[1] & 0x80:
            possible.add(f'refused {frame[2]}')
        elif isinstance(request, Read):
            possible.add(frame[3:-2])
        else:
            possible.add(b'')
    return possible or {None}


@st.composite
def traffic(draw: st.DrawFn, request: Request) -> bytes:
    """Noise, answers whole, cut and damaged, to this request and to others, in any order."""
    other = draw(CLOSE)
    whole: list[Callable[[], bytes]] = [
        lambda: answer_to(request, draw(contents_for(request))),
        lambda: answer_to(other, draw(contents_for(other))),
        lambda: opinion.exception(request.unit, request.function, draw(st.integers(0, 255))),
        lambda: opinion.exception(other.unit, other.function, draw(st.integers(0, 255))),
        lambda: encode(other),
    ]
    stream = b''
    for _ in range(draw(st.integers(0, 4))):
        part = draw(st.sampled_from(whole))()
        what = draw(st.sampled_from(['whole', 'cut', 'spoilt', 'noise', 'head']))
        if what == 'cut':
            part = part[draw(st.integers(0, len(part))) :][: draw(st.integers(0, len(part)))]
        elif what == 'spoilt':
            part = spoil(part, draw(st.integers(0, 8 * len(part))))
        elif what == 'noise':
            part = draw(st.binary(max_size=12))
        elif what == 'head':
            part = request.answer_head
        stream += part
    return stream


@given(st.data(), CLOSE)
def test_nothing_is_believed_but_a_whole_frame(data: st.DataObject, request: Request) -> None:
    stream = data.draw(traffic(request))
    reader = RtuReader(request)
    fed = b''
    for piece in data.draw(pieces(stream)):
        fed += piece
        got = outcome(reader, [piece])
        # as soon as a frame is whole it is found, and nothing else ever is
        assert got in everything(request, fed)
        if got is not None:
            break


@given(st.data(), CLOSE, st.binary(max_size=64))
def test_any_bytes_at_all(data: st.DataObject, request: Request, stream: bytes) -> None:
    got = outcome(RtuReader(request), data.draw(pieces(stream)))
    assert got in everything(request, stream)
