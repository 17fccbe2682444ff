# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Who a unit is: the same frames as pymodbus's, among whatever else comes over a line."""

from __future__ import annotations

from typing import Any

from hypothesis import assume, example, given, strategies as st
from identify_bench import (
    device_answer,
    device_request,
    g2_answer,
    slave_answer,
    slave_request,
    spoil,
    write_and_read_answer,
    write_and_read_request,
)
import pymodbus_opinion as opinion
import pytest
from support.addresses import packed

from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.link.modbus_link import (
    BASIC,
    REGULAR,
    SPECIFIC,
    DeviceObjects,
    ReadDevice,
    ReportSlaveId,
)
from nfo_sinus_driver.link.modbus_pdu import Request, WriteAndRead
from nfo_sinus_driver.link.rtu import CRC_LENGTH, RtuReader, encode

# --- what may be asked and answered ---------------------------------------------------------------

UNIT = st.integers(1, 247)
WORD = st.integers(0, 0xFFFF)
REGISTER = st.integers(0, 0xFF00)
CODES = st.sampled_from([BASIC, REGULAR, SPECIFIC])
DEVICES = st.builds(ReadDevice, UNIT, CODES, st.integers(0, 255))
SLAVES = st.builds(ReportSlaveId, UNIT)
WRITES_AND_READS = st.builds(
    WriteAndRead,
    UNIT,
    REGISTER,
    st.lists(WORD, min_size=1, max_size=121).map(lambda words: packed(*words)),
    REGISTER,
    st.integers(1, 125),
)
REQUESTS = st.one_of(DEVICES, SLAVES, WRITES_AND_READS)
# requests whose answers resemble each other
FEW = st.sampled_from([1, 2])
CLOSE = st.one_of(
    st.builds(ReadDevice, FEW, CODES, st.sampled_from([0, 5])),
    st.builds(ReportSlaveId, FEW),
    st.builds(
        WriteAndRead, FEW, st.just(0x294), st.just(packed(3)), st.just(0x2A5), st.integers(1, 2)
    ),
)
CONTENT = st.binary(max_size=20)


@st.composite
def answers(draw: st.DrawFn, request: Request[Any]) -> tuple[bytes, object]:
    """A right answer to a request, and what the reader has to make of it."""
    unit = request.unit
    if isinstance(request, WriteAndRead):
        words = draw(st.lists(WORD, min_size=request.count, max_size=request.count).map(tuple))
        return write_and_read_answer(unit, words), packed(*words)
    if isinstance(request, ReportSlaveId):
        if draw(st.booleans()):
            report = draw(st.binary(max_size=251))
            return g2_answer(unit, report), report
        identifier, running = draw(st.binary(max_size=250)), draw(st.booleans())
        report = identifier + (b'\xff' if running else b'\x00')
        return slave_answer(unit, identifier, running), report
    assert isinstance(request, ReadDevice)
    if request.code == SPECIFIC:
        objects = {request.first: draw(st.binary(max_size=244))}
    else:
        # in their order, and so few that all fit
        numbers = draw(st.lists(st.integers(0, 255), unique=True, max_size=8).map(sorted))
        objects = {number: draw(CONTENT) for number in numbers}
    return device_answer(unit, request.code, objects), DeviceObjects(tuple(objects.items()))


@st.composite
def pieces(draw: st.DrawFn, data: bytes) -> list[bytes]:
    """The same bytes in any pieces."""
    cuts = sorted(draw(st.lists(st.integers(0, len(data)), max_size=4)))
    return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


def outcome(reader: RtuReader[Any], data: list[bytes]) -> object:
    """What comes of bytes: an answer, a refusal, or nothing; anything else raises."""
    for piece in data:
        try:
            answer = reader.feed(piece)
        except Refused as refusal:
            return f'refused {refusal.code}'
        if answer is not None:
            return answer
    return None


# --- agreement with pymodbus ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ('request_', 'frame'),
    [
        (ReadDevice(1, BASIC), '01 2B 0E 01 00 70 77'),
        (ReadDevice(1), '01 2B 0E 02 00 70 87'),
        (ReportSlaveId(1), '01 11 C0 2C'),
        # the standard's example of function 23
        (
            WriteAndRead(17, 14, packed(255, 255, 255), 3, 6),
            '11 17 0003 0006 000E 0003 06 00FF 00FF 00FF',
        ),
    ],
)
def test_golden_requests(request_: Request[Any], frame: str) -> None:
    whole = bytes.fromhex(frame)
    if isinstance(request_, WriteAndRead):
        whole += opinion.crc(whole)
    assert encode(request_) == whole


@given(REQUESTS)
def test_request_is_pymodbus_s(request: Request[Any]) -> None:
    frame = encode(request)
    decoded = opinion._decoded(frame)
    assert (decoded.slave_id if opinion.OLD else decoded.dev_id) == request.unit
    assert decoded.function_code == request.function
    if isinstance(request, ReadDevice):
        assert frame == device_request(request.unit, request.code, request.first)
        assert (decoded.read_code, decoded.object_id) == (request.code, request.first)
    elif isinstance(request, ReportSlaveId):
        assert frame == slave_request(request.unit)
    else:
        assert isinstance(request, WriteAndRead)
        assert frame == write_and_read_request(request)
        assert (decoded.read_address, decoded.read_count) == (request.source, request.count)
        assert decoded.write_address == request.register
        assert decoded.write_count == len(request.data) // 2
        assert packed(*decoded.write_registers) == request.data


@given(st.data(), REQUESTS)
def test_answer_of_pymodbus_in_any_pieces(data: st.DataObject, request: Request[Any]) -> None:
    frame, wanted = data.draw(answers(request))
    assert len(frame) - CRC_LENGTH <= request.answer_length <= 254
    assert frame.startswith(request.answer_head)
    reader = RtuReader(request)
    assert outcome(reader, data.draw(pieces(frame))) == wanted
    assert reader.received == 0


@given(st.data(), REQUESTS)
def test_what_has_begun_is_waited_for_as_long_as_it_may_be(
    data: st.DataObject, request: Request[Any]
) -> None:
    frame, _ = data.draw(answers(request))
    reader = RtuReader(request)
    come = data.draw(st.integers(0, len(frame) - 1))
    assert reader.feed(frame[:come]) is None
    longest = request.answer_length + CRC_LENGTH
    assert 1 <= reader.bytes_needed <= longest - come
    if come:
        assert reader.bytes_needed >= len(frame) - come
    if isinstance(request, ReportSlaveId) and come > 2:
        # as soon as the answer says how long it is, that is known
        assert reader.bytes_needed == len(frame) - come


@given(st.data(), REQUESTS, st.integers(0, 255))
def test_refusal_of_pymodbus_in_any_pieces(
    data: st.DataObject, request: Request[Any], code: int
) -> None:
    frame = opinion.exception(request.unit, request.function, code)
    reader = RtuReader(request)
    assert outcome(reader, data.draw(pieces(frame))) == f'refused {code}'
    assert reader.received == 0


@given(st.lists(st.binary(min_size=60, max_size=200), min_size=5, max_size=7))
def test_what_pymodbus_puts_into_several_answers(contents: list[bytes]) -> None:
    objects = dict(enumerate(contents))
    first = 0
    got: dict[int, bytes] = {}
    while True:
        # pymodbus's server goes on with the objects from the one asked for
        rest = {number: content for number, content in objects.items() if number >= first}
        answer = RtuReader(ReadDevice(1, REGULAR, first)).feed(device_answer(1, REGULAR, rest))
        assert isinstance(answer, DeviceObjects)
        got.update(answer.objects)
        if answer.next_object is None:
            break
        assert answer.next_object > first
        first = answer.next_object
    assert got == objects


# --- what else comes over a line ------------------------------------------------------------------


def contents(frame: bytes) -> list[tuple[int, bytes]] | None:
    """The objects in a frame of function 43/14, if they fill it exactly."""
    objects, rest = [], frame[8:-2]
    for _ in range(frame[7]):
        if len(rest) < 2 or len(rest) < 2 + rest[1]:
            return None
        objects.append((rest[0], rest[2 : 2 + rest[1]]))
        rest = rest[2 + rest[1] :]
    return None if rest else objects


def meaning(request: Request[Any], frame: bytes) -> object:
    """What these bytes say if they are exactly one answer or refusal, by pymodbus's check sum."""
    if not 5 <= len(frame) <= 256 or opinion.crc(frame[:-2]) != frame[-2:]:
        return None
    unit, function = frame[:2]
    if unit != request.unit or function & 0x7F != request.function:
        return None
    if function & 0x80:
        return f'refused {frame[2]}' if len(frame) == 5 else None
    if isinstance(request, ReadDevice):
        if len(frame) < 10 or frame[2:4] != bytes((14, request.code)) or frame[5] not in (0, 255):
            return None
        objects = contents(frame)
        if objects is None:
            return None
        if request.code == SPECIFIC and [number for number, _ in objects] != [request.first]:
            return None
        return DeviceObjects(tuple(objects), frame[6] if frame[5] else None)
    if frame[2] != len(frame) - 5:
        return None
    if isinstance(request, ReportSlaveId):
        return frame[3:-2]
    assert isinstance(request, WriteAndRead)
    body = frame[3:-2]
    return body if len(body) == 2 * request.count else None


def everything(request: Request[Any], stream: bytes) -> list[object]:
    """What may come of the frames in the bytes, or nothing if there is none."""
    found = [
        said
        for start in range(len(stream))
        for end in range(start + 5, min(len(stream), start + 256) + 1)
        if stream[start] == request.unit
        and (said := meaning(request, stream[start:end])) is not None
    ]
    return found or [None]


@given(st.data(), CLOSE, st.integers(0, 8 * 256))
def test_damaged_answer_is_none(data: st.DataObject, request: Request[Any], bit: int) -> None:
    frame, _ = data.draw(answers(request))
    damaged = spoil(frame, bit)
    assume(everything(request, damaged) == [None])
    reader = RtuReader(request)
    assert outcome(reader, data.draw(pieces(damaged))) is None
    assert reader.received == len(damaged)


@given(st.data(), CLOSE, st.binary(max_size=20))
def test_noise_before_a_good_answer(
    data: st.DataObject, request: Request[Any], noise: bytes
) -> None:
    frame, wanted = data.draw(answers(request))
    assume(everything(request, noise + frame) == [wanted])
    assert outcome(RtuReader(request), data.draw(pieces(noise + frame))) == wanted


@st.composite
def traffic(draw: st.DrawFn, request: Request[Any]) -> bytes:
    """Noise, answers whole, cut and damaged, to this request and to others, in any order."""
    stream = b''
    for _ in range(draw(st.integers(0, 4))):
        other = draw(st.one_of(st.just(request), CLOSE))
        part = draw(answers(other))[0]
        what = draw(st.sampled_from(['whole', 'cut', 'spoilt', 'noise', 'head', 'no', 'question']))
        if what == 'cut':
            part = part[draw(st.integers(0, len(part))) :][: draw(st.integers(0, len(part)))]
        elif what == 'spoilt':
            part = spoil(part, draw(st.integers(0, 8 * len(part))))
        elif what == 'noise':
            part = draw(st.binary(max_size=12))
        elif what == 'head':
            part = request.answer_head
        elif what == 'no':
            part = opinion.exception(other.unit, other.function, draw(st.integers(0, 255)))
        elif what == 'question':
            part = encode(other)
        stream += part
    return stream


@given(st.data(), CLOSE)
def test_nothing_is_believed_but_a_whole_frame(
    data: st.DataObject, request: Request[Any]
) -> None:
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
        assert reader.bytes_needed >= 1


@given(st.data(), CLOSE, st.binary(max_size=300))
@example(None, ReadDevice(1), bytes((1, 43, 14, 2, 0x82, 0, 0, 255)) + b'\xff' * 300)
def test_any_bytes_at_all(
    data: st.DataObject | None, request: Request[Any], stream: bytes
) -> None:
    reader = RtuReader(request)
    got = outcome(reader, data.draw(pieces(stream)) if data else [stream])
    assert got in everything(request, stream)
    assert reader.bytes_needed >= 1


@pytest.mark.parametrize('more', [1, 0x7F, 0xFE])
def test_more_follows_is_yes_or_no(more: int) -> None:
    body = bytes((1, 43, 14, 2, 0x82, more, 0, 1, 0, 1)) + b'A'
    assert RtuReader(ReadDevice(1)).feed(body + opinion.crc(body)) is None


def test_another_object_is_no_answer_to_one_by_its_number() -> None:
    reader = RtuReader(ReadDevice(1, SPECIFIC, 5))
    assert reader.feed(device_answer(1, SPECIFIC, {4: b'NFO Sinus'})) is None
    assert reader.feed(device_answer(1, SPECIFIC, {4: b'NFO Sinus', 5: b'1.50/400'})) is None
    assert reader.feed(device_answer(1, SPECIFIC, {5: b'1.50/400'})) == DeviceObjects(
        ((5, b'1.50/400'),)
    )
