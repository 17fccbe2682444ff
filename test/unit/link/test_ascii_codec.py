# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus ASCII frames: the same as pymodbus's, and nothing false is ever believed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hypothesis import given, strategies as st
import pymodbus_opinion as opinion
import pytest
from support.addresses import packed

from nfo_sinus_driver.link import modbus_pdu
from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.link.modbus_ascii import INTER_BYTE_TIMEOUT, AsciiReader, encode, length, lrc
from nfo_sinus_driver.link.modbus_link import REGULAR, ReadDevice, ReportSlaveId
from nfo_sinus_driver.link.modbus_pdu import Read, Request, Write, WriteAndRead

# few units and registers, so that answers resemble each other
UNIT = st.sampled_from([1, 2, 247])
WORD = st.one_of(st.sampled_from([0, 1, 0x0D0A, 0x3A3A]), st.integers(0, 0xFFFF))
PARAMETER = st.sampled_from([0x2A5, 0x258, 0x400, 0x3A3A])
CONTENTS = st.lists(WORD, min_size=1, max_size=3).map(lambda words: packed(*words))
READS = st.builds(Read, UNIT, PARAMETER, st.integers(1, 3))
WRITES = st.builds(Write, UNIT, PARAMETER, CONTENTS)
REQUESTS = st.one_of(
    READS,
    WRITES,
    st.builds(WriteAndRead, UNIT, PARAMETER, CONTENTS, PARAMETER, st.integers(1, 3)),
    st.builds(ReadDevice, UNIT),
    st.builds(ReportSlaveId, UNIT),
)


@st.composite
def answers(draw: st.DrawFn, request: Request[Any]) -> tuple[bytes, object]:
    """The message of a right answer, and what the reader has to make of it."""
    if isinstance(request, Write):
        return request.answer_head, b''
    if isinstance(request, ReadDevice):
        text = draw(st.binary(max_size=9))
        head = request.answer_head + bytes((2, 0xFF, 1, 1, 0, len(text)))
        message = head + text
        return message, request.decode(message)
    if isinstance(request, ReportSlaveId):
        report = draw(st.binary(max_size=16))
        return request.answer_head + bytes((len(report),)) + report, report
    held = draw(st.binary(min_size=2 * request.count, max_size=2 * request.count))
    return request.answer_head + held, held


@st.composite
def pieces(draw: st.DrawFn, data: bytes) -> list[bytes]:
    """The same bytes in any pieces."""
    cuts = sorted(draw(st.lists(st.integers(0, len(data)), max_size=4)))
    return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


def outcome(reader: AsciiReader[Any], data: list[bytes]) -> object:
    """What comes of bytes: an answer, a refusal, or nothing; anything else raises."""
    for piece in data:
        assert reader.bytes_needed >= 1
        assert 0 < reader.inter_byte_timeout <= INTER_BYTE_TIMEOUT
        try:
            answer = reader.feed(piece)
        except Refused as refusal:
            return f'refused {refusal.code}'
        if answer is not None:
            return answer
    return None


def meaning(request: Request[Any], message: bytes) -> object:
    """What a message says, by hand."""
    head = bytes((request.unit, request.function | 0x80))
    if message[:2] == head:
        return f'refused {message[2]}' if len(message) == 3 else None
    if not message.startswith(request.answer_head) or request.measure(message) != len(message):
        return None
    return request.decode(message)


def everything(request: Request[Any], stream: bytes) -> list[object]:
    """What may come of the frames in the bytes, each whole and with the right check sum."""
    possible = []
    for tail in stream.split(b':')[1:]:
        body, end, _ = tail.partition(b'\r\n')
        try:
            data = bytes.fromhex(body.decode('ascii')) if end and b' ' not in body else b''
        except ValueError:
            continue
        if not body.isalnum() or sum(data) % 256:
            continue
        if len(data) > 2:
            possible.append(meaning(request, data[:-1]))
    return [what for what in possible if what is not None] or [None]


# --- frames worked by hand ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('message', 'check'),
    [
        # 11h + 03h + 6Bh + 03h = 82h, and 82h + 7Eh = 100h: the standard's example request
        ('11 03 00 6B 00 03', 0x7E),
        # 01h + 03h + 02h + A5h + 01h = ACh
        ('01 03 02 A5 00 01', 0x54),
        # FFh + 01h = 100h
        ('FF 01', 0x00),
        ('', 0x00),
        ('01', 0xFF),
    ],
)
def test_golden_check_sums(message: str, check: int) -> None:
    assert lrc(bytes.fromhex(message)) == check


@pytest.mark.parametrize(
    ('request_', 'frame'),
    [
        # the examples of the standard, sections 6.3, 6.6, 6.12 and 6.17, for unit 11h
        (Read(0x11, 0x6B, 3), b':1103006B00037E\r\n'),
        (Write(0x11, 1, packed(3)), b':110600010003E5\r\n'),
        (Write(0x11, 1, packed(0x000A, 0x0102)), b':11100001000204000A0102CB\r\n'),
        # 28h of unit and function, 1Ah of the registers, 06h and three times FFh: 345h
        (
            WriteAndRead(0x11, 14, packed(255, 255, 255), 3, 6),
            b':111700030006000E00030600FF00FF00FFBB\r\n',
        ),
        (ReportSlaveId(1), b':0111EE\r\n'),
        (ReadDevice(1, REGULAR), b':012B0E0200C4\r\n'),
        # a status word of the G2
        (Read(1, 0x2A5, 1), b':010302A5000154\r\n'),
    ],
)
def test_golden_frames(request_: Request[Any], frame: bytes) -> None:
    assert encode(request_) == frame
    assert length(len(modbus_pdu.encode(request_))) == len(frame)


@pytest.mark.parametrize(
    ('request_', 'frame', 'held'),
    [
        # 11h + 03h + 06h + 02h + 2Bh + 64h = ABh
        (Read(0x11, 0x6B, 3), b':110306022B0000006455\r\n', packed(0x22B, 0, 0x64)),
        (Read(1, 0x2A5, 1), b':0103020025D5\r\n', packed(37)),
        (Read(1, 0x2A5, 1), b':010302ABCD82\r\n', packed(0xABCD)),
        (Read(1, 0x2A5, 1), b':010302abcd82\r\n', packed(0xABCD)),
        (Write(0x11, 1, packed(3)), b':110600010003E5\r\n', b''),
        (Write(0x11, 1, packed(10, 258)), b':111000010002DC\r\n', b''),
    ],
)
def test_golden_answers(request_: Request[Any], frame: bytes, held: bytes) -> None:
    assert AsciiReader(request_).feed(frame) == held


def test_golden_refusal() -> None:
    # 01h + 83h + 02h = 86h
    with pytest.raises(Refused) as refusal:
        AsciiReader(Read(1, 0x2A5, 1)).feed(b':0183027A\r\n')
    assert refusal.value.code == Refused.ILLEGAL_ADDRESS


@pytest.mark.parametrize(
    'frame',
    [
        b':0103020025D6\r\n',
        b':0103020025D5\n',
        b':0103020025D5\r',
        b':0103020025D\r\n',
        b':0103020025 D5\r\n',
        b':01030200:25D5\r\n',
        b':010302002G5D5\r\n',
        b'0103020025D5\r\n',
        b':0203020025D4\r\n',
        b':0103040025D3\r\n',
        b':01030200250000D5\r\n',
        b':\r\n',
        b':00\r\n',
    ],
)
def test_what_is_no_frame(frame: bytes) -> None:
    reader = AsciiReader(Read(1, 0x2A5, 1))
    assert reader.feed(frame) is None
    # and the next good one is found
    assert reader.feed(b':0103020025D5\r\n') == packed(37)
    assert reader.passed_over == frame


# --- agreement with pymodbus ----------------------------------------------------------------------


@given(st.binary(min_size=3, max_size=250))
def test_check_sum_is_pymodbus_s(message: bytes) -> None:
    frame = opinion.ascii_frame(message)
    assert frame == b':%b%02X\r\n' % (message.hex().upper().encode(), lrc(message))


@given(REQUESTS)
def test_request_is_pymodbus_s(request: Request[Any]) -> None:
    assert encode(request) == opinion.ascii_frame(modbus_pdu.encode(request))


@given(st.data(), REQUESTS, st.booleans())
def test_encode_and_decode_is_the_identity(
    data: st.DataObject, request: Request[Any], lower: bool
) -> None:
    message, wanted = data.draw(answers(request))
    frame = opinion.ascii_frame(message)
    reader = AsciiReader(request)
    assert outcome(reader, data.draw(pieces(frame.lower() if lower else frame))) == wanted
    assert reader.received == 0
    assert reader.passed_over == b''


@given(st.data(), REQUESTS, st.integers(0, 255))
def test_refusal_of_pymodbus_in_any_pieces(
    data: st.DataObject, request: Request[Any], code: int
) -> None:
    frame = opinion.ascii_frame(bytes((request.unit, request.function | 0x80, code)))
    assert outcome(AsciiReader(request), data.draw(pieces(frame))) == f'refused {code}'


@given(st.data(), REQUESTS)
def test_what_has_begun_is_waited_for_as_long_as_it_may_be(
    data: st.DataObject, request: Request[Any]
) -> None:
    message, _ = data.draw(answers(request))
    frame = opinion.ascii_frame(message)
    reader = AsciiReader(request)
    come = data.draw(st.integers(0, len(frame) - 1))
    assert reader.feed(frame[:come]) is None
    longest = 2 * (request.answer_length + 1) + len(':\r\n')
    assert 1 <= reader.bytes_needed <= longest - come
    if come:
        assert reader.bytes_needed >= len(frame) - come
    # a frame that has begun may pause
    assert (reader.inter_byte_timeout == INTER_BYTE_TIMEOUT) == (come > 0)


# --- what else comes over a line ------------------------------------------------------------------


@st.composite
def noise(draw: st.DrawFn) -> bytes:
    """What is no frame, though it may look like the beginning of one."""
    rubbish = draw(st.binary(max_size=12))
    return draw(st.sampled_from([rubbish, b':' + rubbish, rubbish + b':0103', rubbish + b'\r\n']))


@given(st.data(), REQUESTS, noise())
def test_good_frame_behind_noise_is_found(
    data: st.DataObject, request: Request[Any], rubbish: bytes
) -> None:
    message, wanted = data.draw(answers(request))
    stream = rubbish + opinion.ascii_frame(message)
    assert outcome(AsciiReader(request), data.draw(pieces(stream))) == wanted


@given(st.data(), REQUESTS)
def test_one_wrong_character_is_always_noticed(
    data: st.DataObject, request: Request[Any]
) -> None:
    message, wanted = data.draw(answers(request))
    frame = opinion.ascii_frame(message)
    at = data.draw(st.integers(0, len(frame) - 1))
    same = (frame[at], frame[at] | 0x20)
    wrong = data.draw(st.integers(0, 255).filter(lambda byte: byte not in same))
    damaged = frame[:at] + bytes((wrong,)) + frame[at + 1 :]
    reader = AsciiReader(request)
    assert outcome(reader, data.draw(pieces(damaged))) is None
    # and the next good frame is found
    assert outcome(reader, [frame]) == wanted


@given(st.data(), REQUESTS)
def test_lost_character_is_always_noticed(data: st.DataObject, request: Request[Any]) -> None:
    message, wanted = data.draw(answers(request))
    frame = opinion.ascii_frame(message)
    at = data.draw(st.integers(0, len(frame) - 1))
    reader = AsciiReader(request)
    assert outcome(reader, data.draw(pieces(frame[:at] + frame[at + 1 :]))) is None
    assert outcome(reader, [frame]) == wanted


@given(st.data(), READS, st.integers(1, 3))
def test_colon_begins_a_frame_again(data: st.DataObject, request: Read, times: int) -> None:
    message, wanted = data.draw(answers(request))
    frame = opinion.ascii_frame(message)
    cut = data.draw(st.integers(0, len(frame) - 1))
    assert outcome(AsciiReader(request), [frame[:cut] * times, frame]) == wanted


@st.composite
def traffic(draw: st.DrawFn, request: Request[Any]) -> bytes:
    """Noise, answers whole, cut and damaged, to this request and to others, in any order."""
    other = draw(REQUESTS)
    whole: list[Callable[[], bytes]] = [
        lambda: opinion.ascii_frame(draw(answers(request))[0]),
        lambda: opinion.ascii_frame(draw(answers(other))[0]),
        lambda: opinion.ascii_frame(bytes((request.unit, request.function | 0x80, 2))),
        lambda: encode(other),
    ]
    stream = b''
    for _ in range(draw(st.integers(0, 4))):
        part = draw(st.sampled_from(whole))()
        what = draw(st.sampled_from(['whole', 'whole', 'cut', 'spoilt', 'noise']))
        if what == 'cut':
            part = part[draw(st.integers(0, len(part))) :][: draw(st.integers(0, len(part)))]
        elif what == 'spoilt':
            at = draw(st.integers(0, len(part) - 1))
            part = part[:at] + draw(st.binary(max_size=2)) + part[at + 1 :]
        elif what == 'noise':
            part = draw(noise())
        stream += part
    return stream


@given(st.data(), REQUESTS)
def test_nothing_is_believed_but_a_whole_frame(data: st.DataObject, request: Request[Any]) -> None:
    stream = data.draw(traffic(request))
    reader = AsciiReader(request)
    fed = b''
    for piece in data.draw(pieces(stream)):
        fed += piece
        got = outcome(reader, [piece])
        # as soon as a frame is whole it is found, and nothing else ever is
        assert got == everything(request, fed)[0]
        if got is not None:
            break


@given(st.data(), REQUESTS, st.binary(max_size=64))
def test_any_bytes_at_all(data: st.DataObject, request: Request[Any], stream: bytes) -> None:
    got = outcome(AsciiReader(request), data.draw(pieces(stream)))
    assert got == everything(request, stream)[0]


# --- how long to wait for more --------------------------------------------------------------------


@pytest.mark.parametrize(
    ('come', 'may_pause'),
    [
        (b'', False),
        (b':', True),
        (b':01', True),
        (b':0103020025D5\r', True),
        (b':0183', True),
        (b'xyz:01030', True),
        (b':02', False),
        (b':0106', False),
        (b':010302002500000000', False),
        (b':01x', False),
        (b'0103', False),
        (b':0103020025D6\r\n', False),
    ],
)
def test_only_an_answer_that_has_begun_may_pause(come: bytes, may_pause: bool) -> None:
    reader = AsciiReader(Read(1, 0x2A5, 1))
    assert reader.feed(come) is None
    assert (reader.inter_byte_timeout == INTER_BYTE_TIMEOUT) == may_pause
