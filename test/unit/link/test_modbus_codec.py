# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Frames of Modbus RTU and ASCII: the same as pymodbus's, and nothing false is ever believed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

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
from support.addresses import packed, words_of

from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.link.modbus import ascii, pdu, rtu
from nfo_sinus_driver.link.modbus.ascii import INTER_BYTE_TIMEOUT, AsciiReader
from nfo_sinus_driver.link.modbus.link import (
    BASIC,
    REGULAR,
    SPECIFIC,
    DeviceObjects,
    ReadDevice,
    ReportSlaveId,
)
from nfo_sinus_driver.link.modbus.pdu import AnswerReader, Read, Request, Write, WriteAndRead
from nfo_sinus_driver.link.modbus.rtu import RtuReader

# --- what may be asked and answered ---------------------------------------------------------------


def contents(least: int, most: int) -> st.SearchStrategy[bytes]:
    """What so many registers may hold; some of it looks like the ends of a frame."""
    word = st.one_of(st.sampled_from([0, 1, 0x0D0A, 0x3A3A]), st.integers(0, 0xFFFF))
    return st.lists(word, min_size=least, max_size=most).map(lambda words: packed(*words))


UNIT = st.integers(1, 247)
REGISTER = st.integers(0, 0xFF00)
CODES = st.sampled_from([BASIC, REGULAR, SPECIFIC])
REQUESTS = st.one_of(
    st.builds(Read, UNIT, REGISTER, st.integers(1, 125)),
    st.builds(Write, UNIT, REGISTER, contents(1, 123)),
    st.builds(WriteAndRead, UNIT, REGISTER, contents(1, 121), REGISTER, st.integers(1, 125)),
    st.builds(ReadDevice, UNIT, CODES, st.integers(0, 255)),
    st.builds(ReportSlaveId, UNIT),
)
# what drives are asked: few units and registers, so that answers resemble each other
FEW = st.sampled_from([1, 2])
PARAMETERS = st.sampled_from([0x2A5, 0x258, 0x3A3A])
CLOSE = st.one_of(
    st.builds(Read, FEW, PARAMETERS, st.integers(1, 2)),
    st.builds(Write, FEW, PARAMETERS, contents(1, 2)),
    st.builds(WriteAndRead, FEW, PARAMETERS, contents(1, 1), PARAMETERS, st.integers(1, 2)),
    st.builds(ReadDevice, FEW, CODES, st.sampled_from([0, 5])),
    st.builds(ReportSlaveId, FEW),
)
CONTENT = st.binary(max_size=20)


def asked(request: Request[Any]) -> bytes:
    """The message of a request, as pymodbus encodes it."""
    if isinstance(request, Read):
        frame = opinion.read_request(request.unit, request.register, request.count)
    elif isinstance(request, Write):
        frame = opinion.write_request(request.unit, request.register, words_of(request.data))
    elif isinstance(request, WriteAndRead):
        frame = write_and_read_request(request)
    elif isinstance(request, ReadDevice):
        frame = device_request(request.unit, request.code, request.first)
    else:
        frame = slave_request(request.unit)
    return frame[:-2]


@st.composite
def answers(draw: st.DrawFn, request: Request[Any]) -> tuple[bytes, object]:
    """The message of a right answer, as pymodbus encodes it, and what the reader makes of it."""
    unit = request.unit
    if isinstance(request, Write):
        return opinion.write_answer(unit, request.register, words_of(request.data))[:-2], b''
    if isinstance(request, (Read, WriteAndRead)):
        held = draw(contents(request.count, request.count))
        answer = opinion.read_answer if isinstance(request, Read) else write_and_read_answer
        return answer(unit, words_of(held))[:-2], held
    if isinstance(request, ReportSlaveId):
        if draw(st.booleans()):
            report = draw(st.binary(max_size=251))
            return g2_answer(unit, report)[:-2], report
        identifier, running = draw(st.binary(max_size=250)), draw(st.booleans())
        report = identifier + (b'\xff' if running else b'\x00')
        return slave_answer(unit, identifier, running)[:-2], report
    assert isinstance(request, ReadDevice)
    if request.code == SPECIFIC:
        objects = {request.first: draw(st.binary(max_size=244))}
    else:
        # in their order, and so few that all fit
        numbers = draw(st.lists(st.integers(0, 255), unique=True, max_size=8).map(sorted))
        objects = {number: draw(CONTENT) for number in numbers}
    return device_answer(unit, request.code, objects)[:-2], DeviceObjects(tuple(objects.items()))


def refusal(request: Request[Any], code: int) -> bytes:
    return opinion.exception(request.unit, request.function, code)[:-2]


def objects_in(message: bytes) -> list[tuple[int, bytes]] | None:
    """The objects in a message of function 43/14, if they fill it exactly."""
    objects, rest = [], message[8:]
    for _ in range(message[7]):
        if len(rest) < 2 or len(rest) < 2 + rest[1]:
            return None
        objects.append((rest[0], rest[2 : 2 + rest[1]]))
        rest = rest[2 + rest[1] :]
    return None if rest else objects


def meaning(request: Request[Any], message: bytes) -> object:
    """What a message says if it is exactly one answer or refusal; by hand."""
    unit, function = message[:2]
    if unit != request.unit or function & 0x7F != request.function:
        return None
    if function & 0x80:
        return f'refused {message[2]}' if len(message) == 3 else None
    if isinstance(request, Write):
        # the register, and the value or how many
        said = asked(request)[2:6]
        return b'' if message[2:] == said else None
    if isinstance(request, ReadDevice):
        if len(message) < 8 or message[2:4] != bytes((14, request.code)):
            return None
        objects = objects_in(message)
        if objects is None or message[5] not in (0, 255):
            return None
        if request.code == SPECIFIC and [number for number, _ in objects] != [request.first]:
            return None
        return DeviceObjects(tuple(objects), message[6] if message[5] else None)
    if len(message) < 3 or message[2] != len(message) - 3:
        return None
    body = message[3:]
    if isinstance(request, ReportSlaveId) or len(body) == 2 * request.count:
        return body
    return None


# --- two kinds of frames --------------------------------------------------------------------------


def in_rtu(request: Request[Any], stream: bytes) -> list[object]:
    """What the frames in some bytes say, by pymodbus's check sum."""
    return [
        meaning(request, stream[start : end - 2])
        for start in range(len(stream))
        if stream[start] == request.unit
        for end in range(start + 5, min(len(stream), start + 256) + 1)
        if opinion.crc(stream[start : end - 2]) == stream[end - 2 : end]
    ]


def in_ascii(request: Request[Any], stream: bytes) -> list[object]:
    """What the frames in some bytes say, each whole and with the right check sum; the first."""
    for tail in stream.split(b':')[1:]:
        body, end, _ = tail.partition(b'\r\n')
        try:
            data = bytes.fromhex(body.decode('ascii')) if end and b' ' not in body else b''
        except ValueError:
            continue
        if not body.isalnum() or sum(data) % 256 or len(data) < 3:
            continue
        if (said := meaning(request, data[:-1])) is not None:
            return [said]
    return []


class Framing(NamedTuple):
    """
    How messages go over a line.

    :ivar frame: the frame of a message, as pymodbus encodes it.
    :ivar found: what may come of some bytes.
    :ivar more: bytes of a frame besides those of ``factor`` times its message.
    """

    encode: Callable[[Request[Any]], bytes]
    reader: Callable[[Request[Any]], AnswerReader[Any]]
    frame: Callable[[bytes], bytes]
    found: Callable[[Request[Any], bytes], list[object]]
    factor: int
    more: int

    def everything(self, request: Request[Any], stream: bytes) -> list[object]:
        """What may come of the frames in some bytes, or nothing if there is none."""
        found = self.found(request, stream)
        return [said for said in found if said is not None] or [None]


RTU = Framing(rtu.encode, RtuReader, lambda data: data + opinion.crc(data), in_rtu, 1, 2)
ASCII = Framing(ascii.encode, AsciiReader, opinion.ascii_frame, in_ascii, 2, 5)
of_both = pytest.mark.parametrize('framing', [RTU, ASCII], ids=['rtu', 'ascii'])


@st.composite
def pieces(draw: st.DrawFn, data: bytes) -> list[bytes]:
    """The same bytes in any pieces."""
    cuts = sorted(draw(st.lists(st.integers(0, len(data)), max_size=4)))
    return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


def outcome(reader: AnswerReader[Any], data: list[bytes]) -> object:
    """What comes of bytes: an answer, a refusal, or nothing; anything else raises."""
    for piece in data:
        assert reader.bytes_needed >= 1
        assert 0 < reader.inter_byte_timeout <= INTER_BYTE_TIMEOUT
        try:
            answer = reader.feed(piece)
        except Refused as refused:
            assert f'exception {refused.code}' in str(refused) and not refused.maybe_done
            return f'refused {refused.code}'
        if answer is not None:
            return answer
    return None


# --- frames of RTU worked by hand -----------------------------------------------------------------


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
    assert rtu.crc(bytes.fromhex(data)) == bytes.fromhex(check)


@pytest.mark.parametrize(
    ('request_', 'frame'),
    [
        (Read(17, 0x6B, 3), '11 03 00 6B 00 03 76 87'),
        (Write(17, 1, packed(3)), '11 06 00 01 00 03 9A 9B'),
        (Write(17, 1, packed(10, 0x0102)), '11 10 00 01 00 02 04 00 0A 01 02 C6 F0'),
        (ReadDevice(1, BASIC), '01 2B 0E 01 00 70 77'),
        (ReadDevice(1), '01 2B 0E 02 00 70 87'),
        (ReportSlaveId(1), '01 11 C0 2C'),
    ],
)
def test_golden_frames(request_: Request[Any], frame: str) -> None:
    assert rtu.encode(request_) == bytes.fromhex(frame)


# --- frames of ASCII worked by hand ---------------------------------------------------------------


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
def test_golden_check_sums_of_ascii(message: str, check: int) -> None:
    assert ascii.lrc(bytes.fromhex(message)) == check


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
def test_golden_frames_of_ascii(request_: Request[Any], frame: bytes) -> None:
    assert ascii.encode(request_) == frame
    assert ascii.length(len(pdu.encode(request_))) == len(frame)


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
def test_golden_answers_of_ascii(request_: Request[Any], frame: bytes, held: bytes) -> None:
    assert AsciiReader(request_).feed(frame) == held


def test_golden_refusal_of_ascii() -> None:
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
def test_what_is_no_frame_of_ascii(frame: bytes) -> None:
    reader = AsciiReader(Read(1, 0x2A5, 1))
    assert reader.feed(frame) is None
    # and the next good one is found
    assert reader.feed(b':0103020025D5\r\n') == packed(37)
    assert reader.passed_over == frame


# --- agreement with pymodbus ----------------------------------------------------------------------


@given(st.binary(min_size=3, max_size=250))
def test_check_sums_are_pymodbus_s(message: bytes) -> None:
    assert rtu.crc(message) == opinion.crc(message) == rtu.crc(bytearray(message))
    frame = b':%b%02X\r\n' % (message.hex().upper().encode(), ascii.lrc(message))
    assert opinion.ascii_frame(message) == frame


@of_both
@given(REQUESTS)
def test_request_is_pymodbus_s(framing: Framing, request: Request[Any]) -> None:
    assert framing.encode(request) == framing.frame(asked(request))


@of_both
@given(st.data(), REQUESTS, st.booleans())
def test_answer_of_pymodbus_in_any_pieces(
    framing: Framing, data: st.DataObject, request: Request[Any], lower: bool
) -> None:
    message, wanted = data.draw(answers(request))
    assert len(message) <= request.answer_length <= 254
    assert message.startswith(request.answer_head)
    frame = framing.frame(message)
    frame = frame.lower() if lower and framing is ASCII else frame
    reader = framing.reader(request)
    assert outcome(reader, data.draw(pieces(frame))) == wanted == meaning(request, message)
    assert reader.received == 0
    assert reader.passed_over == b''


@of_both
@given(st.data(), REQUESTS, st.integers(0, 255))
def test_refusal_of_pymodbus_in_any_pieces(
    framing: Framing, data: st.DataObject, request: Request[Any], code: int
) -> None:
    reader = framing.reader(request)
    frame = framing.frame(refusal(request, code))
    assert outcome(reader, data.draw(pieces(frame))) == f'refused {code}'
    assert reader.received == 0


@of_both
@given(st.data(), REQUESTS)
def test_what_has_begun_is_waited_for_as_long_as_it_may_be(
    framing: Framing, data: st.DataObject, request: Request[Any]
) -> None:
    frame = framing.frame(data.draw(answers(request))[0])
    reader = framing.reader(request)
    come = data.draw(st.integers(0, len(frame) - 1))
    assert reader.feed(frame[:come]) is None
    longest = framing.factor * request.answer_length + framing.more
    assert 1 <= reader.bytes_needed <= longest - come
    if come:
        assert reader.bytes_needed >= len(frame) - come
    if isinstance(request, ReportSlaveId) and come > 2 and framing is RTU:
        # as soon as the answer says how long it is, that is known
        assert reader.bytes_needed == len(frame) - come
    if framing is ASCII:
        # a frame that has begun may pause
        assert (reader.inter_byte_timeout == INTER_BYTE_TIMEOUT) == (come > 0)


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


@st.composite
def noise(draw: st.DrawFn) -> bytes:
    """What is no frame, though it may look like the beginning of one."""
    rubbish = draw(st.binary(max_size=12))
    return draw(st.sampled_from([rubbish, b':' + rubbish, rubbish + b':0103', rubbish + b'\r\n']))


@of_both
@given(st.data(), CLOSE, noise())
def test_good_answer_behind_noise_is_found(
    framing: Framing, data: st.DataObject, request: Request[Any], rubbish: bytes
) -> None:
    message, wanted = data.draw(answers(request))
    stream = rubbish + framing.frame(message)
    assume(framing.everything(request, stream) == [wanted])
    assert outcome(framing.reader(request), data.draw(pieces(stream))) == wanted


@of_both
@given(st.data(), CLOSE, st.integers(0, 8 * 600))
def test_damaged_answer_is_none(
    framing: Framing, data: st.DataObject, request: Request[Any], bit: int
) -> None:
    message, wanted = data.draw(answers(request))
    frame = framing.frame(message)
    damaged = spoil(frame, bit)
    # the case of a digit means nothing
    assume(framing.everything(request, damaged) == [None])
    reader = framing.reader(request)
    assert outcome(reader, data.draw(pieces(damaged))) is None
    assert reader.received == len(damaged)
    # and the next good one is found
    assume(framing.everything(request, damaged + frame) == [wanted])
    assert outcome(reader, [frame]) == wanted


@given(st.data(), CLOSE, st.booleans())
def test_a_wrong_or_lost_character_of_ascii_is_always_noticed(
    data: st.DataObject, request: Request[Any], lost: bool
) -> None:
    message, wanted = data.draw(answers(request))
    frame = opinion.ascii_frame(message)
    at = data.draw(st.integers(0, len(frame) - 1))
    same = (frame[at], frame[at] | 0x20)
    wrong = data.draw(st.integers(0, 255).filter(lambda byte: byte not in same))
    reader = AsciiReader(request)
    damaged = frame[:at] + (b'' if lost else bytes((wrong,))) + frame[at + 1 :]
    assert outcome(reader, data.draw(pieces(damaged))) is None
    assert outcome(reader, [frame]) == wanted


@given(st.data(), CLOSE, st.integers(1, 3))
def test_colon_begins_a_frame_again(
    data: st.DataObject, request: Request[Any], times: int
) -> None:
    message, wanted = data.draw(answers(request))
    frame = opinion.ascii_frame(message)
    cut = data.draw(st.integers(0, len(frame) - 1))
    assert outcome(AsciiReader(request), [frame[:cut] * times, frame]) == wanted


@of_both
@given(st.data(), CLOSE, CLOSE)
def test_answer_to_something_else_is_passed_over(
    framing: Framing, data: st.DataObject, request: Request[Any], other: Request[Any]
) -> None:
    alien, _ = data.draw(answers(other))
    message, wanted = data.draw(answers(request))
    reader = framing.reader(request)
    got = outcome(reader, data.draw(pieces(framing.frame(alien))))
    # a read answer does not say what was read: the link above has to know
    assert got == meaning(request, alien)
    stream = framing.frame(alien) + framing.frame(message)
    if got is None and framing.everything(request, stream) == [wanted]:
        assert outcome(reader, [framing.frame(message)]) == wanted


@of_both
@given(st.data(), CLOSE)
def test_exception_to_another_request_is_passed_over(
    framing: Framing, data: st.DataObject, request: Request[Any]
) -> None:
    functions = [3, 6, 16, 17, 23, 43]
    functions = [function for function in functions if function != request.function]
    other = data.draw(st.sampled_from(functions))
    aliens = (
        opinion.exception(request.unit + 1, request.function, 2),
        opinion.exception(request.unit, other, 2),
    )
    message, wanted = data.draw(answers(request))
    messages = (*(alien[:-2] for alien in aliens), message)
    stream = b''.join(map(framing.frame, messages))
    assume(framing.everything(request, stream) == [wanted])
    assert outcome(framing.reader(request), data.draw(pieces(stream))) == wanted


@of_both
@given(st.data(), CLOSE, st.binary(min_size=1, max_size=10), st.integers(1, 255))
def test_what_comes_behind(
    framing: Framing, data: st.DataObject, request: Request[Any], rest: bytes, code: int
) -> None:
    message, wanted = data.draw(answers(request))
    frame = framing.frame(message)
    reader = framing.reader(request)
    assert reader.feed(frame + rest) == wanted
    assert reader.received == len(rest)
    # and feeding goes on behind a refusal
    reader = framing.reader(request)
    with pytest.raises(Refused):
        reader.feed(framing.frame(refusal(request, code)) + frame)
    assert reader.feed(b'') == wanted


# --- any bytes at all -----------------------------------------------------------------------------


@st.composite
def traffic(draw: st.DrawFn, framing: Framing, request: Request[Any]) -> bytes:
    """Noise, answers whole, cut and damaged, to this request and to others, in any order."""
    other = draw(CLOSE)
    whole: list[Callable[[], bytes]] = [
        lambda: framing.frame(draw(answers(request))[0]),
        lambda: framing.frame(draw(answers(other))[0]),
        lambda: framing.frame(refusal(request, draw(st.integers(0, 255)))),
        lambda: framing.frame(refusal(other, draw(st.integers(0, 255)))),
        lambda: framing.encode(other),
    ]
    stream = b''
    for _ in range(draw(st.integers(0, 4))):
        part = draw(st.sampled_from(whole))()
        what = draw(st.sampled_from(['whole', 'whole', 'cut', 'spoilt', 'noise', 'head']))
        if what == 'cut':
            part = part[draw(st.integers(0, len(part))) :][: draw(st.integers(0, len(part)))]
        elif what == 'spoilt':
            at = draw(st.integers(0, len(part) - 1))
            part = part[:at] + draw(st.binary(max_size=2)) + part[at + 1 :]
        elif what == 'noise':
            part = draw(noise())
        elif what == 'head':
            part = framing.frame(request.answer_head)[: len(request.answer_head) * framing.factor]
        stream += part
    return stream


@of_both
@given(st.data(), CLOSE)
def test_nothing_is_believed_but_a_whole_frame(
    framing: Framing, data: st.DataObject, request: Request[Any]
) -> None:
    stream = data.draw(traffic(framing, request))
    reader = framing.reader(request)
    fed = b''
    for piece in data.draw(pieces(stream)):
        fed += piece
        got = outcome(reader, [piece])
        # as soon as a frame is whole it is found, and nothing else ever is
        assert got in framing.everything(request, fed)
        if got is not None:
            break
        assert reader.bytes_needed >= 1


@of_both
@given(st.data(), CLOSE, st.binary(max_size=300))
@example(None, ReadDevice(1), bytes((1, 43, 14, 2, 0x82, 0, 0, 255)) + b'\xff' * 300)
def test_any_bytes_at_all(
    framing: Framing, data: st.DataObject | None, request: Request[Any], stream: bytes
) -> None:
    reader = framing.reader(request)
    got = outcome(reader, data.draw(pieces(stream)) if data else [stream])
    assert got in framing.everything(request, stream)


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


# --- how long to wait for more of ASCII -----------------------------------------------------------


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
