# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Transfers of SDOs: the frames that CiA 301 prescribes, and a server that keeps to it."""

from __future__ import annotations

from canopen_far_end import Server, messages
from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.link.canopen.sdo import (
    ABORT_CODES,
    LONGEST_VALUE,
    TIMED_OUT,
    Download,
    Transfer,
    Upload,
    kind,
)
from nfo_sinus_driver.link.interface import DamagedAnswer, Refused

UNIT = 5
INDICES = st.integers(0, 0xFFFF)
SUB_INDICES = st.integers(0, 0xFF)
VALUES = st.binary(max_size=60)
MESSAGES = st.binary(min_size=8, max_size=8)


def carry_out(transfer: Transfer, server: Server) -> int:
    """Let a server answer until all is said; return how many messages that took."""
    count = 0
    while transfer.request is not None:
        answer = server.answer(transfer.request)
        assert answer is not None
        assert transfer.take_message(answer), 'this is the answer'
        count += 1
        assert count < 300, 'it never ends'
    return count


def follows(transfer: Transfer, *lines: str) -> None:
    """Play a transfer by the book: what is sent, and what is answered."""
    written = list(messages(*lines))
    for sent, answer in zip(written[::2], written[1::2], strict=True):
        assert transfer.request == sent
        assert transfer.take_message(answer)
    assert transfer.request is None


# --- by the book ----------------------------------------------------------------------------------


def test_reading_in_one_exchange() -> None:
    # the device type of an I/O module
    upload = Upload(UNIT, 0x1000, 0)
    follows(upload, '40 00 10 00 00 00 00 00', '43 00 10 00 91 01 0F 00')
    assert upload.value == bytes.fromhex('91010F00')


@pytest.mark.parametrize(
    ('command', 'size'), [('4F', 1), ('4B', 2), ('47', 3), ('43', 4), ('42', 4)]
)
def test_a_short_value_is_as_long_as_the_answer_says(command: str, size: int) -> None:
    upload = Upload(UNIT, 0x2013, 0)
    follows(upload, '40 13 20 00 00 00 00 00', f'{command} 13 20 00 11 22 33 44')
    assert upload.value == bytes.fromhex('11223344')[:size]


def test_writing_in_one_exchange() -> None:
    # the heartbeat, one second
    value = bytes.fromhex('E803')
    follows(Download(UNIT, 0x1017, 0, value), '2B 17 10 00 E8 03 00 00', '60 17 10 00 00 00 00 00')


def test_reading_in_segments() -> None:
    upload = Upload(UNIT, 0x1008, 0)
    follows(
        upload,
        '40 08 10 00 00 00 00 00',
        '41 08 10 00 0A 00 00 00',
        '60 00 00 00 00 00 00 00',
        '00 4E 46 4F 20 53 69 6E',
        '70 00 00 00 00 00 00 00',
        '19 75 73 21 00 00 00 00',
    )
    assert upload.value == b'NFO Sinus!'


def test_writing_in_segments() -> None:
    follows(
        Download(UNIT, 0x2100, 3, b'NFO Sinus!'),
        '21 00 21 03 0A 00 00 00',
        '60 00 21 03 00 00 00 00',
        '00 4E 46 4F 20 53 69 6E',
        '20 00 00 00 00 00 00 00',
        '19 75 73 21 00 00 00 00',
        '30 00 00 00 00 00 00 00',
    )


def test_what_makes_a_server_forget_a_transfer() -> None:
    assert Upload(UNIT, 0x1008, 2).abort() == bytes.fromhex('80 08 10 02 00 00 04 05')
    assert TIMED_OUT == 0x05040000


# --- a server -------------------------------------------------------------------------------------


@given(INDICES, SUB_INDICES, VALUES, st.booleans(), st.booleans(), st.integers(1, 7))
def test_every_value_is_read(
    index: int, sub_index: int, value: bytes, says_size: bool, expedites: bool, cut: int
) -> None:
    server = Server({(index, sub_index): value}, says_size, expedites, cut)
    upload = Upload(UNIT, index, sub_index)
    count = carry_out(upload, server)
    assert upload.value == value
    assert count <= 1 + max(1, -(-len(value) // cut))
    assert count == 1 or not expedites or not 0 < len(value) <= 4 or not says_size


@given(INDICES, SUB_INDICES, st.binary(min_size=1, max_size=60))
def test_every_value_is_written(index: int, sub_index: int, value: bytes) -> None:
    server = Server({(index, sub_index): b''})
    count = carry_out(Download(UNIT, index, sub_index, value), server)
    assert server.objects == {(index, sub_index): value}
    assert count == (1 if len(value) <= 4 else 1 + -(-len(value) // 7))


@given(st.binary(min_size=5, max_size=60), st.data())
def test_a_transfer_can_be_ended_at_any_time(value: bytes, data: st.DataObject) -> None:
    server = Server({(1, 0): value, (2, 0): b'\1'})
    transfer = data.draw(
        st.sampled_from([Upload(UNIT, 1, 0), Download(UNIT, 1, 0, value)])
    )
    assert not transfer.has_begun
    for _ in range(data.draw(st.integers(1, max(1, len(value) // 7)))):
        assert transfer.request is not None
        answer = server.answer(transfer.request)
        assert answer is not None and transfer.take_message(answer)
    assert transfer.has_begun
    assert server.answer(transfer.abort()) is None
    assert server.ended == [TIMED_OUT]
    carry_out(Upload(UNIT, 2, 0), server)


# --- refusals -------------------------------------------------------------------------------------


def test_every_code_of_the_standard_is_known() -> None:
    # CiA 301, table 22
    assert len(ABORT_CODES) == 31
    kinds = {
        0x06020000: Refused.ILLEGAL_ADDRESS,
        0x06090011: Refused.ILLEGAL_ADDRESS,
        0x06010002: Refused.ILLEGAL_ADDRESS,
        0x06090030: Refused.ILLEGAL_VALUE,
        0x06090031: Refused.ILLEGAL_VALUE,
        0x06070010: Refused.ILLEGAL_VALUE,
        0x05040001: Refused.ILLEGAL_FUNCTION,
        0x08000022: Refused.DEVICE_FAILURE,
    }
    assert {code: ABORT_CODES[code][0] for code in kinds} == kinds


@given(st.one_of(st.sampled_from(sorted(ABORT_CODES)), st.integers(0, 0xFFFFFFFF)))
def test_an_abort_is_a_refusal_with_its_code(code: int) -> None:
    for transfer in (Upload(UNIT, 1, 2), Download(UNIT, 1, 2, bytes(2))):
        server = Server({}, refuses={(1, 2): code})
        assert transfer.request is not None
        answer = server.answer(transfer.request)
        assert answer is not None
        with pytest.raises(Refused, match=f'SDO abort {code:08X}h') as refused:
            transfer.take_message(answer)
        assert transfer.request is None
        if code in ABORT_CODES:
            assert ABORT_CODES[code][1] in str(refused.value)


def test_an_abort_between_segments() -> None:
    upload = Upload(UNIT, 0x1008, 0)
    assert upload.take_message(bytes.fromhex('41 08 10 00 0A 00 00 00'))
    with pytest.raises(Refused, match='out of memory'):
        upload.take_message(bytes.fromhex('80 08 10 00 05 00 04 05'))
    assert upload.request is None


# --- what is no answer ----------------------------------------------------------------------------


@given(INDICES, SUB_INDICES, MESSAGES)
def test_what_is_about_another_object_changes_nothing(
    index: int, sub_index: int, message: bytes
) -> None:
    for transfer in (Upload(UNIT, index, sub_index), Download(UNIT, index, sub_index, b'\1')):
        request = transfer.request
        found = kind(message)
        if found is not None and found in transfer.kinds:
            continue
        assert not transfer.take_message(message)
        assert transfer.request == request


@pytest.mark.parametrize(
    'message',
    [
        '60 00 10 00 00 00 00 00',  # something was written
        '43 01 10 00 11 22 33 44',  # another index
        '43 00 10 01 11 22 33 44',  # another sub-index
        '80 00 10 01 00 00 02 06',
        '00 11 22 33 44 55 66 77',  # a segment
        'C6 00 10 00 11 22 33 44',  # a block
        '43 00 10 00 11 22 33',  # too short
        '',
    ],
)
def test_what_does_not_answer_a_read(message: str) -> None:
    upload = Upload(UNIT, 0x1000, 0)
    assert not upload.take_message(bytes.fromhex(message))
    assert upload.request is not None and upload.value == b''


def test_a_segment_sent_twice_is_taken_once() -> None:
    upload = Upload(UNIT, 0x1008, 0)
    first = bytes.fromhex('00 4E 46 4F 20 53 69 6E')
    assert upload.take_message(bytes.fromhex('41 08 10 00 0A 00 00 00'))
    assert upload.take_message(first)
    assert not upload.take_message(first)
    assert upload.take_message(bytes.fromhex('19 75 73 21 00 00 00 00'))
    assert upload.value == b'NFO Sinus!'


def test_what_comes_when_all_is_said_is_no_answer() -> None:
    upload = Upload(UNIT, 0x1000, 0)
    answer = bytes.fromhex('43 00 10 00 91 01 0F 00')
    assert upload.take_message(answer)
    assert not upload.take_message(answer)


@pytest.mark.parametrize(
    ('answers', 'begun'),
    [
        # longer than it said, shorter, longer than anything, and one that never ends
        (['41 08 10 00 03 00 00 00', '01 11 22 33 44 55 66 77'], True),
        (['41 08 10 00 09 00 00 00', '01 11 22 33 44 55 66 77'], False),
        (['41 08 10 00 00 00 01 00'], True),
        (['40 08 10 00 00 00 00 00', '0E 00 00 00 00 00 00 00'], True),
    ],
)
def test_an_answer_that_makes_no_sense(answers: list[str], begun: bool) -> None:
    upload = Upload(UNIT, 0x1008, 0)
    *good, bad = messages(*answers)
    for answer in good:
        assert upload.take_message(answer)
    with pytest.raises(DamagedAnswer, match='unit 5'):
        upload.take_message(bad)
    # the server may still wait for the next request
    assert upload.has_begun == begun


@given(st.lists(MESSAGES, max_size=40))
def test_whatever_comes_it_ends_or_waits(stream: list[bytes]) -> None:
    for transfer in (Upload(UNIT, 0x1008, 0), Download(UNIT, 0x1008, 0, bytes(20))):
        for message in stream:
            before = transfer.request
            try:
                taken = transfer.take_message(message)
            except (Refused, DamagedAnswer):
                break
            assert taken or transfer.request == before
            assert transfer.request is None or len(transfer.request) == 8
        if isinstance(transfer, Upload):
            assert len(transfer.value) <= LONGEST_VALUE


@pytest.mark.parametrize('size', [0, LONGEST_VALUE + 1])
def test_a_value_that_cannot_be_written(size: int) -> None:
    with pytest.raises(ValueError, match=f'{size} bytes'):
        Download(UNIT, 1, 0, bytes(size))
