# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The decoders under fuzz, each with its judge.

A case is so many frames through one decoder, decided by one source of random numbers alone. It
returns if all was right, and raises otherwise: an AssertionError that says what was wrong, or
whatever the decoder let out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from random import Random
import re
import struct
from typing import Any

from support.addresses import packed
from support.plans import followed

from fuzz import judges
from fuzz.judges import Asked, Meaning, Objects, Refusal
from fuzz.mutations import Mutator
from nfo_sinus_driver.link.interface import NoAnswer, Refused
from nfo_sinus_driver.link.modbus import ascii, link, pdu, rtu, tcp
from nfo_sinus_driver.link.modbus.pdu import AnswerReader
from nfo_sinus_driver.link.pairs import classic, movitrac

#: Most bytes that a reader of a whole connection keeps, beside those just handed over.
_MOST_KEPT = 600
#: How many frames come in answer to one request, or without one.
_FEW, _MANY = 4, 25
#: How many questions an identification may take: objects, and the serial number.
_MOST_QUESTIONS = 12

Case = Callable[[Random, int], None]


# --- real requests and answers --------------------------------------------------------------------


def _asked(random: Random) -> Asked:
    """Return a request as the driver makes them, of every kind."""
    unit = random.choice((1, 1, 2, 17, 247))
    function = random.choice((3, 3, 3, 6, 6, 16, 17, 23, 43))
    place = random.choice((0x0002, 0x000E, 0x00E8, 0x0228, 0xC000, random.getrandbits(16)))
    if function in (judges.WRITE_ONE, judges.WRITE_SEVERAL, judges.WRITE_AND_READ):
        size = 1 if function == judges.WRITE_ONE else 2 + random.getrandbits(1)
        words = [random.choice((0, 1, 0x101, random.getrandbits(16))) for _ in range(size)]
        return Asked(unit, function, place, random.choice((1, 2, 4)), packed(*words))
    if function == judges.IDENTIFY:
        return Asked(unit, function, random.choice((0, 0, 2, 4)), random.choice((1, 2, 4)))
    return Asked(unit, function, place, random.choice((1, 1, 2, 4, 16)))


def _request(asked: Asked) -> pdu.Request[Any]:
    """Return the driver's own object for a request."""
    unit, function, place, count, data = asked
    if function == judges.READ:
        return pdu.Read(unit, place, count)
    if function in (judges.WRITE_ONE, judges.WRITE_SEVERAL):
        return pdu.Write(unit, place, data)
    if function == judges.WRITE_AND_READ:
        return pdu.WriteAndRead(unit, place, data, place ^ 2, count)
    if function == judges.REPORT_ID:
        return link.ReportSlaveId(unit)
    return link.ReadDevice(unit, count, place)


def _answer(asked: Asked, random: Random) -> bytes:
    """Return the message of a right answer."""
    head = bytes(asked[:2])
    if asked.function in (judges.READ, judges.WRITE_AND_READ):
        return head + bytes((2 * asked.count,)) + random.randbytes(2 * asked.count)
    if asked.function == judges.WRITE_ONE:
        return head + struct.pack('>H', asked.place) + asked.data
    if asked.function == judges.WRITE_SEVERAL:
        return head + struct.pack('>HH', asked.place, len(asked.data) // 2)
    if asked.function == judges.REPORT_ID:
        report = random.choice((b'201540123       ', b'\x01\xff', random.randbytes(12), b''))
        return head + bytes((len(report),)) + report
    numbers = [asked.place] if asked.count == 4 else range(random.choice((1, 3, 7)))
    contents = (b'NFO Drives AB', b'Sinus G2', b'4.30 / 4018', b'', random.randbytes(5))
    objects = [(number, random.choice(contents)) for number in numbers]
    body = b''.join(bytes((number, len(text))) + text for number, text in objects)
    more = random.choice((0, 0xFF))
    return head + bytes((14, asked.count, 0x82, more, random.getrandbits(3), len(objects))) + body


def _refusal(asked: Asked, random: Random) -> bytes:
    code = random.choice((1, 2, 3, 4, 6, 10, 11, random.getrandbits(8)))
    return bytes((asked.unit, asked.function | 0x80, code))


def _words(asked: Asked) -> bytes:
    """Return the message of the request itself: it comes back as an echo."""
    request = _request(asked)
    return bytes(asked[:2]) + request.body


def _message(asked: Asked, random: Random) -> bytes:
    """Return a message that comes on a line: the answer, a refusal, an echo, or another's."""
    way = random.random()
    if way < 0.5:
        return _answer(asked, random)
    if way < 0.6:
        return _refusal(asked, random)
    if way < 0.7:
        return _words(asked)
    return _answer(_asked(random), random)


def _said(meant: Meaning | None) -> object:
    """Return what the driver makes of a meaning."""
    if isinstance(meant, Objects):
        return link.DeviceObjects(*meant)
    return meant


# --- the driver's decoders ------------------------------------------------------------------------


def _on_a_line(
    reader_of: Callable[[pdu.Request[Any]], AnswerReader[Any]],
    seal: Callable[[bytes], bytes],
    open_frame: Callable[[bytes], bytes | None],
) -> Case:
    """Return the case of a reader that looks for the answer to one request on a serial line."""

    def case(random: Random, frames: int) -> None:
        mutator = Mutator(random)
        while frames > 0:
            asked = _asked(random)
            stream, intact, came = _stream(asked, random, mutator, seal, min(_FEW, frames))
            frames -= came
            _judge_line(reader_of(_request(asked)), asked, stream, intact, mutator, open_frame)

    return case


def _stream(
    asked: Asked,
    random: Random,
    mutator: Mutator,
    seal: Callable[[bytes], bytes],
    most: int,
) -> tuple[bytes, list[tuple[int, int]], int]:
    """Return bytes, where intact right answers stand in them, and how many frames they were."""
    others = [seal(_answer(asked, random)), seal(_answer(_asked(random), random))]
    stream, intact = b'', []
    count = 1 + int(random.random() * most)
    for _ in range(count):
        way = random.random()
        if way < 0.1:
            stream += mutator.rubbish()
            continue
        message = _message(asked, random)
        if way < 0.85:
            stream += mutator.frame(message, others, seal)
            continue
        frame = seal(message)
        if not isinstance(judges.meaning(asked, message), Refusal | None):
            intact.append((len(stream), len(stream) + len(frame)))
        stream += frame
    return stream, intact, count


def _judge_line(
    reader: AnswerReader[Any],
    asked: Asked,
    stream: bytes,
    intact: list[tuple[int, int]],
    mutator: Mutator,
    open_frame: Callable[[bytes], bytes | None],
) -> None:
    """Feed a reader as a link does, and judge all that it says."""
    fed = b''
    taken = 0
    for piece in mutator.pieces(stream):
        fed += piece
        data = piece
        while True:
            refused = None
            try:
                answer = reader.feed(data)
            except Refused as error:
                answer, refused = None, error
            assert len(reader.other) + len(reader.frame) == len(fed), 'bytes were lost or doubled'
            assert reader.bytes_needed >= 1 and reader.inter_byte_timeout > 0
            if answer is None and refused is None:
                break
            begin = len(reader.passed_over)
            taken = begin + len(reader.frame)
            assert fed[begin:taken] == reader.frame, 'the frame is not among the bytes'
            message = open_frame(reader.frame)
            assert message is not None, f'taken from a damaged frame: {answer!r} {refused!r}'
            meant = judges.meaning(asked, message)
            if refused is None:
                assert meant is not None and not isinstance(meant, Refusal), f'no answer: {answer}'
                assert answer == _said(meant), f'{answer!r} instead of {meant!r}'
                return
            assert meant == Refusal(refused.code), f'{refused!r} instead of {meant!r}'
            data = b''
        for begin, end in intact:
            assert begin < taken or end > len(fed), f'the answer at {begin} was not found'


def _tcp(random: Random, frames: int) -> None:
    mutator = Mutator(random)
    while frames > 0:
        asked = _asked(random)
        number = random.getrandbits(16)

        def seal(message: bytes, number: int = number) -> bytes:
            return judges.seal_tcp(number, message)

        stream, _, came = _stream(asked, random, mutator, seal, min(_FEW, frames))
        frames -= came
        reader = tcp.FrameReader()
        found = []
        for piece in mutator.pieces(stream):
            found += reader.feed(piece)
            if reader.out_of_step:
                break
            assert reader.received <= _MOST_KEPT, 'the reader keeps more than a frame'
        right, out_of_step = judges.tcp_frames(stream)
        assert found == right and reader.out_of_step == out_of_step, f'{found} instead of {right}'
        for _, message in found:
            _understand(asked, message)


def _understand(asked: Asked, message: bytes) -> None:
    """Judge what is made of a whole message."""
    meant = judges.meaning(asked, message)
    try:
        answer = pdu.understand(_request(asked), message)
    except Refused as refused:
        assert meant == Refusal(refused.code), f'{refused!r} instead of {meant!r}'
    else:
        assert answer == _said(meant), f'{answer!r} instead of {meant!r}'


def _messages(random: Random, frames: int) -> None:
    """Judge messages without frames: nothing protects them here."""
    mutator = Mutator(random)
    for _ in range(frames):
        asked = _asked(random)
        message = _message(asked, random)
        others = [_answer(asked, random), _words(_asked(random))]
        _understand(asked, mutator.frame(message, others, bytes))


def _identify(random: Random, frames: int) -> None:
    """Judge a whole identification; every answer to it may be any."""
    mutator = Mutator(random)
    while frames > 0:
        unit = random.choice((1, 5))
        questions = 0

        def ask(request: pdu.Request[Any]) -> tuple[object, float]:
            nonlocal questions
            questions += 1
            assert questions <= _MOST_QUESTIONS, 'it never ends'
            asked = Asked(request.unit, request.function)
            if isinstance(request, link.ReadDevice):
                asked = asked._replace(place=request.first, count=request.code)
            message = _answer(asked, random)
            if random.random() < 0.6:
                message = mutator.frame(message, [message, mutator.rubbish()], bytes)
            answer = pdu.understand(request, message)
            if answer is None:
                raise NoAnswer
            return answer, 0.0

        for text in vars(followed(link.questions(unit, ask))).values():
            assert text.isprintable(), f'{text!r} would come into a log'
        frames -= questions


# --- Classic --------------------------------------------------------------------------------------


def classic_frame(random: Random) -> bytes:
    """Return a frame of Classic without its check sum, as :func:`judges.seal_classic` wants it."""
    address = bytes((0x20 + random.choice((0, 1, 1, 2, 37, 48, 95)),))
    number = random.choice((0x29, 0xAC, 0xE9, 0x2A, random.getrandbits(16)))
    way = random.random()
    digits = '04X' if random.random() < 0.7 else '04x'
    if way < 0.25:
        return address + random.choice((b'\x06', b'\x15'))
    if way < 0.4:
        return b'\x04' + address + f'E{number:{digits}}\x05'.encode()
    text = f'E{number:{digits}}={random.getrandbits(16):{digits}}\x03'.encode()
    return (b'\x04' if way < 0.55 else b'') + address + b'\x02' + text


def _classic(random: Random, frames: int) -> None:
    mutator = Mutator(random)
    while frames > 0:
        count = 1 + int(random.random() * min(_MANY, frames))
        frames -= count
        stream, intact = b'', []
        others = [judges.seal_classic(classic_frame(random)) for _ in range(2)]
        for _ in range(count):
            way = random.random()
            if way < 0.1:
                stream += bytes(byte & 0x7F for byte in mutator.rubbish())
            elif way < 0.7:
                stream += mutator.frame(classic_frame(random), others, judges.seal_classic)
            else:
                frame = judges.seal_classic(classic_frame(random))
                intact.append((len(stream), len(stream) + len(frame)))
                stream += frame
        reader = classic.Reader()
        found: list[classic.Message] = []
        for piece in mutator.pieces(stream):
            found += reader.feed(piece)
            assert len(reader.rest) <= _MOST_KEPT, 'the reader keeps more than a message'
        _judge_classic(stream, intact, found, random)


_EOT = 0x04
#: An ACK or NAK whose address may be the last digit of what broke off before it: taken for nothing.
_MAY_BE_REMAINS = re.compile(rb'[0-9A-Fa-f][\x06\x15]')
_KINDS: Mapping[str, Callable[[judges.Classic], classic.Message]] = {
    'enquiry': lambda read: classic.Enquiry(read.unit, read.number),
    'select': lambda read: classic.Select(read.unit, read.number, read.word),
    'value': lambda read: classic.Value(read.unit, read.number, read.word),
    'ack': lambda read: classic.Ack(read.unit),
    'nak': lambda read: classic.Nak(read.unit),
}


def _judge_classic(
    stream: bytes, intact: list[tuple[int, int]], found: Sequence[classic.Message], random: Random
) -> None:
    """Judge which messages were found in bytes, and whether they count as answers."""
    readable = sorted(judges.classic_messages(stream))
    spans: list[tuple[int, int]] = []
    end = 0
    for message in found:
        for read in readable:
            # behind an EOT that ends nothing an answer is a part of something else
            is_answer = stream[read.begin] != _EOT
            part = is_answer and read.begin > end and stream[read.begin - 1] == _EOT
            if read.begin >= end and not part and _KINDS[read.kind](read) == message:
                break
        else:
            raise AssertionError(f'{message} is not among the bytes, or was found twice')
        spans.append((read.begin, read.end))
        end = read.end
        _judge_answers(message, read, random)
    for begin, end in intact:
        before = stream[begin - 1 : begin]
        if before == bytes((_EOT,)) or (before and _MAY_BE_REMAINS.match(stream, begin)):
            continue
        overlapped = any(first < end and begin < last for first, last in spans)
        assert overlapped, f'the message at {begin} was not found'


def _judge_answers(message: classic.Message, read: judges.Classic, random: Random) -> None:
    unit = random.choice((0, 1, read.unit))
    number = random.choice((0x29, read.number))
    for request, kinds in (
        (classic.Enquiry(unit, number), ('value', 'nak')),
        (classic.Select(unit, number, 1), ('ack', 'nak')),
    ):
        right = unit in (0, read.unit) and read.kind in kinds
        right = right and (read.kind != 'value' or read.number == number)
        assert classic.answers(message, request) == right, f'{message} answers {request}?'


# --- the MOVITRAC's protocol ----------------------------------------------------------------------

#: Bytes of a glitch, behind which an ACK or NACK still counts.
_GLITCH = 2


def movitrac_frame(random: Random, index: int) -> bytes:
    """Return a frame without its sum, of any kind; most are about an index."""
    number = struct.pack('>H', index if random.random() < 0.8 else random.getrandbits(16))
    unit = bytes((random.choice((0, 1, 63, random.getrandbits(8))),))
    digits = bytes(random.choice((0, 1, 9, 0x25, 0xD2)) for _ in range(8))
    return random.choice(
        (
            b'\xb5' + unit + number,
            b'\xc8' + number + digits[:4],
            b'\xc8' + number + random.randbytes(4),
            b'\xac' + number + digits,
            b'\xa9' + unit + number + digits[:4],
            b'\xad' + unit + number + digits,
            b'\xd2',
            b'\xf3' + random.randbytes(1),
        )
    )


def _movitrac(random: Random, frames: int) -> None:
    mutator = Mutator(random)
    while frames > 0:
        index = random.choice((4, 25, 0xC8D2, 0xF3F3))
        request = random.choice(
            (movitrac.Enquiry(1, index), movitrac.Select(1, index, bytes(4)))
        )
        count = 1 + int(random.random() * min(_FEW, frames))
        frames -= count
        stream = b''
        others = [judges.seal_movitrac(movitrac_frame(random, index)) for _ in range(2)]
        for _ in range(count):
            way = random.random()
            frame = movitrac_frame(random, index)
            if way < 0.1:
                stream += mutator.rubbish()
            elif way < 0.6:
                stream += mutator.frame(frame, others, judges.seal_movitrac)
            else:
                stream += judges.seal_movitrac(frame)
        _judge_movitrac(request, stream, mutator)


def _judge_movitrac(request: movitrac.Request, stream: bytes, mutator: Mutator) -> None:
    """Feed a reader as the link does, and judge all that it says."""
    reader = movitrac.Reader()
    fed, taken = b'', 0
    wanted = 'value' if isinstance(request, movitrac.Enquiry) else 'ack'
    for piece in mutator.pieces(stream):
        fed += piece
        for answer in reader.feed(piece):
            if not movitrac.answers(answer, request):
                continue
            right = [
                frame for frame in judges.movitrac_frames(fed)
                if frame.begin >= taken and frame.kind in (wanted, 'nack')
                if answer == _MOVITRAC_ANSWERS[frame.kind](frame)
            ]
            assert right, f'{answer} from a damaged frame'
            if right[0].kind != 'value':
                right = [frame for frame in right if _is_behind_a_glitch(fed[: frame.begin])]
                before = fed[taken:].hex(' ')
                assert right, f'an ACK or NACK was believed behind remains: {before}'
            assert right[0].kind != 'value' or right[0].number == request.index, f'{answer}?'
            taken = right[0].end
        assert len(reader.rest) <= _MOST_KEPT, 'the reader keeps more than a frame'
        readable = list(judges.movitrac_frames(fed))
        for frame in readable:
            if (frame.kind, frame.number) != (wanted, request.index) or frame.begin < taken:
                continue
            # two frames that can be read in the same bytes: the first one counts
            overlapped = any(other.begin < frame.begin < other.end for other in readable)
            assert overlapped, f'the value at {frame.begin} was not found'


def _is_behind_a_glitch(before: bytes) -> bool:
    """Return whether an ACK or NACK counts: before it, whole frames and then next to nothing."""
    ends = [0, *(frame.end for frame in judges.movitrac_frames(before))]
    junk = [before[end:] for end in ends]
    return any(
        len(piece) <= _GLITCH and judges.MOVITRAC_STARTS.isdisjoint(piece) for piece in junk
    )


_MOVITRAC_ANSWERS: Mapping[str, Callable[[judges.Movitrac], movitrac.Message]] = {
    'value': lambda frame: movitrac.Data(frame.number, frame.value),
    'ack': lambda frame: movitrac.Ack(),
    'nack': lambda frame: movitrac.Nack(frame.number),
}


#: Every decoder of bytes that the driver has.
LINK_CASES: Mapping[str, Case] = {
    'rtu': _on_a_line(rtu.RtuReader, judges.seal_rtu, judges.rtu_message),
    'ascii': _on_a_line(ascii.AsciiReader, judges.seal_ascii, judges.ascii_message),
    'tcp': _tcp,
    'pdu': _messages,
    'identify': _identify,
    'classic': _classic,
    'movitrac': _movitrac,
}
