# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of the Classic protocol: the manual's own, and whatever bytes may come."""

from __future__ import annotations

import classic_far_end as far
from hypothesis import assume, example, given, strategies as st
import pytest

from nfo_sinus_driver.link.pairs.classic import (
    Ack,
    Enquiry,
    Message,
    Nak,
    Reader,
    Select,
    Value,
    encode,
)

#: [M0 §6.1.3]: "A SELECT message to address 1 which gives parameter 25 the value of 100".
WORKED_EXAMPLE = '04H 21H 02H 45H 30H 30H 31H 39H 3DH 30H 30H 36H 34H 03H 71H'

WORDS = st.integers(0, 0xFFFF)
UNITS = st.one_of(st.sampled_from([1, 16, 33, 65]), st.integers(0, 94))
ANSWERS = st.one_of(
    st.builds(Value, UNITS, WORDS, WORDS), st.builds(Ack, UNITS), st.builds(Nak, UNITS)
)
REQUESTS = st.one_of(
    st.builds(Enquiry, st.integers(0, 94), WORDS),
    st.builds(Select, st.integers(0, 95), WORDS, WORDS),
)
MESSAGES = st.one_of(ANSWERS, REQUESTS)


def read(*pieces: bytes) -> list[Message]:
    reader = Reader()
    return [message for piece in pieces for message in reader.feed(piece)]


def pieces(stream: bytes) -> st.SearchStrategy[list[bytes]]:
    """The same bytes, cut anywhere."""
    return st.lists(st.integers(0, len(stream)), max_size=6).map(
        lambda cuts: [
            stream[start:end]
            for start, end in zip([0, *sorted(cuts)], [*sorted(cuts), len(stream)], strict=True)
        ]
    )


def spoil(frame: bytes, bit: int) -> bytes:
    """Turn one of the bits over: an exclusive or misses two of them in the same column."""
    at = bit // 8 % len(frame)
    return frame[:at] + bytes((frame[at] ^ 1 << bit % 8,)) + frame[at + 1 :]


# --- what the manual prints -----------------------------------------------------------------------


def test_worked_example_of_the_manual() -> None:
    frame = bytes(int(char[:2], 16) for char in WORKED_EXAMPLE.split())
    assert encode(Select(1, 25, 100)) == frame
    assert read(frame) == [Select(1, 25, 100)]
    assert read(frame[1:]) == [Value(1, 25, 100)]


@pytest.mark.parametrize(
    ('message', 'frame'),
    [
        (Enquiry(0, 0xE9), b'\x04 E00E9\x05'),
        (Enquiry(94, 0xABCD), b'\x04~EABCD\x05'),
        (Select(95, 0x29, 1), b'\x04\x7f\x02E0029=0001\x03' + far.bcc(b'E0029=0001\x03')),
        (Ack(1), b'!\x06'),
        (Nak(17), b'1\x15'),
    ],
)
def test_golden_frames(message: Message, frame: bytes) -> None:
    assert encode(message) == frame
    assert read(frame) == [message]


@given(REQUESTS)
def test_a_drive_understands_a_request(request: Enquiry | Select) -> None:
    word = request.word if isinstance(request, Select) else None
    assert far.parsed(encode(request)) == (request.unit, request.number, word)


@given(st.integers(0, 94), WORDS, WORDS, st.booleans())
def test_both_cases_are_read(unit: int, number: int, word: int, lower: bool) -> None:
    assert read(far.reply(unit, number, word, lower=lower)) == [Value(unit, number, word)]


@pytest.mark.parametrize(
    'message',
    [Enquiry(96, 1), Enquiry(-1, 1), Enquiry(1, 0x10000), Select(1, 1, -1), Select(1, 1, 65536)],
)
def test_what_the_protocol_cannot_express(message: Message) -> None:
    with pytest.raises(ValueError, match=r'Classic has|does not fit'):
        encode(message)


@given(st.data(), st.lists(MESSAGES, max_size=5))
def test_encoding_and_reading_is_the_identity(data: st.DataObject, messages: list[Message]) -> None:
    stream = b''.join(encode(message) for message in messages)
    assert read(*data.draw(pieces(stream))) == messages


def test_every_control_character_may_be_the_check_sum() -> None:
    seen = set()
    for word in range(0x4000):
        frame = encode(Value(1, 0x19, word))
        assert read(frame) == [Value(1, 0x19, word)]
        seen.add(frame[-1])
    # eight digits and letters, E, = and ETX leave nothing else
    assert seen == {*range(0x10), *range(0x70, 0x80)}


# --- damage ---------------------------------------------------------------------------------------


@given(ANSWERS, st.integers(0, 8 * 14 - 1))
def test_a_damaged_answer_is_never_that_of_the_unit(message: Message, bit: int) -> None:
    for found in read(spoil(encode(message), bit)):
        # neither the address nor ACK has a check sum: there the parity is all
        assert found != message
        assert found.unit != message.unit or isinstance(found, (Ack, Nak))


@given(UNITS, WORDS, WORDS, st.integers(0, 8 * 14 - 1))
@example(1, 0, 0, 8 + 2)
def test_a_damaged_reply_has_no_value(unit: int, number: int, word: int, bit: int) -> None:
    for found in read(spoil(encode(Value(unit, number, word)), bit)):
        # without parity an STX may become an ACK, and an address that of another drive
        assert not isinstance(found, Value) or found == Value(found.unit, number, word)
        assert not isinstance(found, Value) or found.unit != unit


@given(UNITS, WORDS, WORDS, st.integers(0, 13))
@example(16, 0x0000, 0x0340, 12)
def test_a_reply_that_lacks_a_byte_is_nothing(unit: int, number: int, word: int, at: int) -> None:
    frame = encode(Value(unit, number, word))
    assert read(frame[:at] + frame[at + 1 :]) == []


def test_the_end_of_a_broken_reply_is_no_ack() -> None:
    # without its ETX this one ends in "0" and 06: the ACK of address 16
    for word in range(0, 0x10000, 16):
        frame = encode(Value(16, 0x19, word))
        if frame[-1] == 6:
            assert read(frame[:-2] + frame[-1:]) == []
            return
    raise AssertionError('there is such a frame')


@pytest.mark.parametrize(
    'change',
    [
        (b'E', b'F'),
        (b'=', b':'),
        (b'0064', b'0G64'),
        (b'\x03', b'\x04'),
        (b'0064', b' 064'),
        (b'0064', b'+064'),
        (b'0064', b'0_64'),
    ],
)
def test_a_good_check_sum_alone_is_not_enough(change: tuple[bytes, bytes]) -> None:
    body = b'E0019=0064\x03'.replace(*change)
    assert read(b'!\x02' + body + far.bcc(body)) == []


def test_a_request_is_no_answer() -> None:
    assert read(encode(Select(1, 0x1E, 100))) == [Select(1, 0x1E, 100)]
    assert read(b'\x04' + encode(Ack(1))) == []


# --- any bytes at all -----------------------------------------------------------------------------

NOISE = st.one_of(
    st.binary(max_size=40),
    st.lists(
        st.one_of(
            st.sampled_from([b'\x02', b'\x03', b'\x04', b'\x05', b'\x06', b'!', b'0', b'E0019']),
            MESSAGES.map(encode).flatmap(lambda frame: st.integers(0, 16).map(lambda n: frame[:n])),
            MESSAGES.map(encode).flatmap(lambda frame: st.integers(0, 16).map(lambda n: frame[n:])),
        ),
        max_size=5,
    ).map(b''.join),
)


@given(st.data(), NOISE)
def test_any_bytes_in_any_pieces(data: st.DataObject, stream: bytes) -> None:
    whole = read(stream)
    assert read(*data.draw(pieces(stream))) == whole
    upper = stream.upper()
    for message in whole:
        # nothing is found that is not there, character by character
        assert encode(message).upper() in upper


@given(NOISE, ANSWERS)
@example(b'0\x02E00', Value(16, 0x19, 100))
@example(b'!\x02E0019=0064\x03', Value(1, 0x19, 100))
@example(b'\x04!', Value(1, 0x19, 100))
@example(b'\x04', Ack(1))
def test_the_next_good_answer_is_found(noise: bytes, answer: Message) -> None:
    if isinstance(answer, Value):
        # an EOT makes it a request
        assume(not noise.endswith(b'\x04'))
        frame = encode(answer)
        # the very byte that completes a frame is not the first one of another
        assume(read(noise) == read(noise + frame[:1]))
        assert read(noise + frame)[-1:] == [answer]
    else:
        # an ACK is no more than two characters: straight behind a broken message it is not believed
        assert read(noise + b'\x00' + encode(answer))[-1:] == [answer]


@given(NOISE, ANSWERS, ANSWERS)
def test_after_a_whole_answer_the_next_one_is_found(
    noise: bytes, first: Message, second: Message
) -> None:
    assert read(noise + 20 * b'\x00' + encode(first) + encode(second))[-2:] == [first, second]


@given(NOISE)
def test_no_more_is_kept_than_a_message_has(stream: bytes) -> None:
    reader = Reader()
    for byte in stream:
        reader.feed(bytes((byte,)))
        assert len(reader.rest) < 15
