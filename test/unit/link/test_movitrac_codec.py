# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The frames of the MOVITRAC's protocol: those that the manual prints, and all others."""

from __future__ import annotations

from hypothesis import given, strategies as st
import movitrac_far_end as far
import pytest

from nfo_sinus_driver.link.pairs.movitrac import (
    Ack,
    Answer,
    Data,
    Enquiry,
    Message,
    Nack,
    Reader,
    Request,
    Select,
    answers as may_answer,
    decode,
    encode,
)

#: 100 000 in half-bytes [M4 §3.3], [C106].
GEAR_RATIO = bytes.fromhex('000000010806 0a00')
GOLDEN = [
    # heat sink temperature, 25.5 degrees Celsius [M4 §2.4.3]
    (Enquiry(0, 4), 'B5 00 00 04 B9'),
    (Data(4, bytes.fromhex('00002550')), 'C8 00 04 00 00 25 50 41'),
    # T11 RAMP UP, 3.7 s [M4 §2.4.4]
    (Select(0, 25, bytes.fromhex('00000370')), 'A9 00 00 19 00 00 03 70 35'),
    (Ack(), 'D2 D2'),
    # the sums of these the manual does not print
    (Select(12, 263, GEAR_RATIO), 'AD 0C 01 07 00 00 00 01 08 06 0A 00 DA'),
    (Data(263, GEAR_RATIO), 'AC 01 07 00 00 00 01 08 06 0A 00 CD'),
    (Nack(0x13), 'F3 13 06'),
    (Enquiry(63, 0xFFFF), 'B5 3F FF FF F2'),
]

INDICES = st.integers(0, 0xFFFF)
VALUES = st.one_of(st.binary(min_size=4, max_size=4), st.binary(min_size=8, max_size=8))
UNITS = st.integers(0, 63)
ENQUIRIES = st.builds(Enquiry, UNITS, INDICES)
SELECTS = st.builds(Select, UNITS, INDICES, VALUES)
REQUESTS: st.SearchStrategy[Request] = st.one_of(ENQUIRIES, SELECTS)
VERDICTS: st.SearchStrategy[Answer] = st.one_of(
    st.just(Ack()), st.builds(Nack, st.integers(0, 255))
)
MESSAGES: st.SearchStrategy[Message] = st.one_of(
    REQUESTS, VERDICTS, st.builds(Data, INDICES, VALUES)
)
#: Bytes that begin no frame.
HARMLESS = st.sampled_from(sorted(set(range(256)) - set(b'\xb5\xc8\xac\xa9\xad\xd2\xf3')))


def answers(request: Request) -> st.SearchStrategy[Answer]:
    """Return all that a drive may answer."""
    nacks = st.builds(Nack, st.integers(0, 255))
    if isinstance(request, Select):
        return st.one_of(st.just(Ack()), nacks)
    return st.one_of(st.builds(Data, st.just(request.index), VALUES), nacks)


def found(request: Request, *pieces: bytes) -> list[Message]:
    """Return the answers to a request among what a reader finds."""
    reader = Reader()
    messages = [message for piece in pieces for message in reader.feed(piece)]
    return [message for message in messages if may_answer(message, request)]


@pytest.mark.parametrize(('message', 'frame'), GOLDEN)
def test_frames_of_the_manual(message: Message, frame: str) -> None:
    assert encode(message) == bytes.fromhex(frame)
    assert decode(bytes.fromhex(frame)) == message


@given(MESSAGES)
def test_every_frame_is_read_back(message: Message) -> None:
    frame = encode(message)
    assert decode(frame) == message
    assert far.sealed(frame[:-1]) == frame
    assert all(decode(frame[:end]) is None for end in range(len(frame)))


@given(MESSAGES, st.data())
def test_one_wrong_bit_is_noticed(message: Message, data: st.DataObject) -> None:
    frame = encode(message)
    bit = data.draw(st.integers(8, 8 * len(frame) - 1))
    damaged = int.from_bytes(frame, 'big') ^ 1 << (8 * len(frame) - 1 - bit)
    assert decode(damaged.to_bytes(len(frame), 'big')) is None


@given(REQUESTS)
def test_the_far_end_of_the_tests_reads_requests_alike(request: Request) -> None:
    value = request.value if isinstance(request, Select) else None
    assert far.parsed(encode(request)) == (request.unit, request.index, value)


@given(st.data(), REQUESTS, st.booleans())
def test_an_answer_is_found_in_any_pieces(
    data: st.DataObject, request: Request, echo: bool
) -> None:
    answer = data.draw(answers(request))
    glitch = bytes(data.draw(st.lists(HARMLESS, max_size=2)))
    stream = (encode(request) if echo else b'') + glitch + encode(answer)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=4)))
    pieces = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    assert found(request, *pieces) == [answer]


@given(st.data(), ENQUIRIES, st.binary(max_size=30), VALUES)
def test_a_value_is_found_behind_any_noise(
    data: st.DataObject, request: Enquiry, noise: bytes, value: bytes
) -> None:
    frame = encode(Data(request.index, value))
    stream = noise + frame
    # noise itself may happen to be an answer, but it is never one of another shape or sum
    answers = found(request, *[bytes((byte,)) for byte in stream])
    assert answers and all(encode(answer) in stream for answer in answers)


def test_a_value_is_found_behind_what_pretends_to_be_longer() -> None:
    value = Data(25, bytes(4))
    for start in (b'\xac', b'\xad\x01', b'\xc8\x00\x19', b'\xb5'):
        assert found(Enquiry(1, 25), start + encode(value)) == [value]


@given(SELECTS, VERDICTS, st.lists(HARMLESS, min_size=3, max_size=20))
def test_a_verdict_behind_remains_is_not_believed(
    request: Select, verdict: Answer, remains: list[int]
) -> None:
    assert found(request, bytes(remains) + encode(verdict)) == []


@pytest.mark.parametrize(
    'stream',
    [
        'C8 00 19 00 00 D2 D2',  # a value breaks off before its sum
        '19 00 00 D2 D2 D2 D2',
        'D2 D3 D2 D2',
        '00 FF 00 D2 D2',
        'AC D2 D2',
        'C9 00 19 D2 D2 00 00 8C',
    ],
)
def test_the_remains_of_a_value_are_no_verdict(stream: str) -> None:
    assert found(Select(1, 25, bytes(4)), bytes.fromhex(stream)) == []


def test_whole_frames_before_a_verdict_do_not_matter() -> None:
    request = Select(1, 25, bytes(4))
    late = encode(Data(4, bytes.fromhex('00002550')))
    assert found(request, late + encode(request) + b'\x00\xff' + encode(Ack())) == [Ack()]


@given(st.data(), MESSAGES, REQUESTS)
def test_what_answers_something_else_is_no_answer(
    data: st.DataObject, message: Message, request: Request
) -> None:
    if isinstance(message, (Enquiry, Select)):
        right = False
    elif isinstance(message, Nack):
        right = True
    elif isinstance(message, Ack):
        right = isinstance(request, Select)
    else:
        right = isinstance(request, Enquiry) and message.index == request.index
    assert found(request, encode(message)) == ([message] if right else [])


@pytest.mark.parametrize(
    ('message', 'problem'),
    [
        (Enquiry(64, 0), 'address 64: Movitrac has 0 to 63'),
        (Enquiry(-1, 0), 'address -1'),
        (Select(64, 0, bytes(4)), 'address 64'),
        (Enquiry(0, 0x10000), 'index 65536 does not fit'),
        (Select(0, 1, b'\x00\x00'), 'a value of 2 bytes: there are those of 4 and of 8'),
        (Data(1, bytes(5)), 'a value of 5 bytes'),
        (Nack(256), 'range'),
    ],
)
def test_what_the_protocol_cannot_express(message: Message, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        encode(message)


def test_a_request_to_an_address_that_no_drive_has_is_none() -> None:
    assert decode(far.sealed(bytes.fromhex('B5 40 00 04'))) is None
