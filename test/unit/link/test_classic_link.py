# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One Classic transaction after the other on a line in virtual time."""

from __future__ import annotations

from collections.abc import Iterator
import itertools
from typing import Any

import classic_far_end as far
from classic_far_end import Fate
from classic_link_bench import LONG, MODE, SETTINGS, TIMEOUT, UNIT, A, B, Bench
from hypothesis import given, strategies as st
import pytest
from support.addresses import classic_id, packed
from support.plans import followed
from virtual_wire import run_late

from nfo_sinus_driver.link import classic
from nfo_sinus_driver.link.classic import ClassicLink
from nfo_sinus_driver.link.interface import (
    BAUD_RATES,
    DamagedAnswer,
    Identification,
    LineSettings,
    NoAnswer,
    PortError,
)

# --- plain transactions ---------------------------------------------------------------------------


@pytest.mark.parametrize('lump', [False, True])
@pytest.mark.parametrize('unit', [0, 1, 94])
def test_read_and_write(lump: bool, unit: int) -> None:
    bench = Bench(*[Fate(lump=lump)] * 2, unit=unit)
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.write(A, 0xFF9C).data == b''
    assert bench.drive.requests == [(unit, 0x1E, None, 'answer'), (unit, 0x1E, 0xFF9C, 'answer')]


@pytest.mark.parametrize('char_format', ClassicLink.protocol.char_formats)
@pytest.mark.parametrize('baud', BAUD_RATES)
def test_every_rate_and_format_at_the_limit_of_the_wire(baud: int, char_format: str) -> None:
    line = LineSettings(baud, char_format, TIMEOUT)
    bench = Bench(settings=line)
    start = bench.wire.now
    for _ in range(10):
        bench.read(A)
        bench.read(A)
    # 8 characters there, 14 back, and nothing between two transactions
    assert bench.wire.now - start == pytest.approx(20 * 22 * line.char_time)


def test_the_same_question_to_one_drive_after_the_other_costs_nothing_more() -> None:
    bench = Bench()
    start = bench.wire.now
    for _ in range(10):
        bench.read(A, unit=1)
        bench.read(A, unit=2)
        bench.write(A, 1, unit=1)
        bench.write(A, 1, unit=2)
    assert bench.wire.now - start == pytest.approx(20 * (22 + 17) * SETTINGS.char_time)


def test_reply_says_when_its_last_byte_came() -> None:
    bench = Bench(Fate(0.5))
    assert bench.read(A).arrived == bench.wire.now == bench.wire.seen[-1][0]
    bench.wire.now += 1
    assert bench.write(A, 1).arrived == bench.wire.now == bench.wire.seen[-1][0]


def test_lower_case_answers_are_read() -> None:
    bench = Bench()
    bench.drive.lower = True
    bench.drive.values[0xB6] = 0xABCD
    assert bench.read(B).data == packed(0xABCD)


@pytest.mark.parametrize('address', [0, 1, 17, 94])
def test_point_to_point_either_address_answers(address: int) -> None:
    bench = Bench(unit=0)
    bench.drive.address = address
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.write(B, 1).data == b''
    assert {unit for unit, *_ in bench.drive.requests} == {0}


def test_another_address_does_not_answer() -> None:
    bench = Bench()
    bench.drive.address = 2
    for act in (lambda: bench.read(A), lambda: bench.write(A, 1)):
        with pytest.raises(DamagedAnswer):
            act()


def test_time_out_counts_from_the_end_of_the_request() -> None:
    bench = Bench(*[Fate(what='drop')] * 2)
    for address, chars in ((A, 8), (B, 8)):
        start = bench.wire.now
        with pytest.raises(NoAnswer):
            bench.read(address)
        assert bench.wire.now - start == pytest.approx(chars * SETTINGS.char_time + TIMEOUT)


def test_answer_just_in_time_is_taken_whole() -> None:
    bench = Bench(Fate(0.95))
    assert bench.read(A).data == bench.answer_of(0)


def test_babbling_line_is_no_reason_to_hang() -> None:
    bench = Bench()
    bench.wire.far_end = lambda frame, end: None
    for number in range(2000):
        bench.wire.arrive(bench.wire.now + number * 0.001, b'!')
    start = bench.wire.now
    for act in (lambda: bench.read(A), lambda: bench.write(A, 1)):
        with pytest.raises(DamagedAnswer):
            act()
    assert bench.wire.now - start < 8 * TIMEOUT


def test_lost_port_is_passed_on() -> None:
    for calls in range(4):
        bench = Bench(Fate(what='refuse'))
        real = bench.wire.read
        outcomes = itertools.chain([real] * calls, itertools.repeat(None))

        def read(until: float, outcomes: Iterator[Any] = outcomes) -> bytes:
            outcome = next(outcomes)
            if outcome is None:
                raise PortError('unplugged')
            data: bytes = outcome(until)
            return data

        bench.wire.read = read  # type: ignore[method-assign]
        with pytest.raises(PortError):
            bench.write(A, 1)


def test_there_is_nothing_to_ask() -> None:
    bench = Bench()
    assert followed(bench.link.identify(UNIT)) == Identification()
    assert bench.drive.requests == []


def test_write_and_read_takes_two_transactions() -> None:
    bench = Bench()
    reply = bench.link.write_and_read(UNIT, A, packed(7), B)
    assert reply.data == bench.answer_of(1)
    assert bench.drive.requests == [(1, 0x1E, 7, 'answer'), (1, 0xB6, None, 'answer')]


@given(st.binary(min_size=2, max_size=2))
def test_any_word_there_and_back(data: bytes) -> None:
    bench = Bench()
    word = int.from_bytes(data, 'big')
    assert bench.link.write(UNIT, A, data).data == b''
    assert bench.drive.requests[0][1:3] == (A.index, word)
    bench.drive.values = {A.index: lambda: word}
    assert bench.read(A).data == data


# --- broadcast ------------------------------------------------------------------------------------


def test_broadcast_awaits_no_answer() -> None:
    bench = Bench()
    start = bench.wire.now
    assert bench.write(classic_id(MODE), 1, unit=95).data == b''
    assert bench.wire.sent[0][1].startswith(b'\x04\x7f\x02E0029=0001')
    assert bench.read(A).data == bench.answer_of(1)
    # the drives have had time to obey
    assert bench.wire.sent[1][0] - start > 15 * SETTINGS.char_time + 0.09


def test_drives_that_answer_fast_need_little_time_for_a_broadcast() -> None:
    bench = Bench()
    for number in range(300):
        bench.read(A if number % 2 else B)
    start = bench.wire.now
    bench.write(classic_id(MODE), 1, unit=95)
    bench.read(A)
    assert bench.wire.sent[-1][0] - start < 15 * SETTINGS.char_time + 0.01
    # one that took long lately needs it, but none needs longer than all drives may
    for delay in (0.2, 0.95):
        bench = Bench(*[Fate()] * 300, Fate(delay))
        for number in range(301):
            bench.read(A if number % 2 else B)
        start = bench.wire.now
        bench.write(classic_id(MODE), 1, unit=95)
        pause = bench.wire.now - start - 15 * SETTINGS.char_time
        assert min(2 * delay * TIMEOUT, 0.1) - 0.001 <= pause <= 0.101


def test_a_broadcast_cannot_be_read() -> None:
    bench = Bench()
    with pytest.raises(ValueError, match='broadcast'):
        bench.read(A, unit=95)
    with pytest.raises(ValueError, match='0 to 95'):
        bench.write(A, 1, unit=96)
    assert bench.wire.sent == []


# --- values of two words --------------------------------------------------------------------------


def test_two_words_are_read_one_by_one() -> None:
    bench = Bench()
    bench.drive.values = {0x27: 0xFFFF, 0x127: 3}
    low, high = bench.link.protocol.parts(LONG)
    assert [bench.read(part).data for part in (low, high)] == [packed(0xFFFF), packed(3)]
    assert bench.asked == [0x27, 0x127]
    with pytest.raises(AssertionError):
        bench.read(LONG)


# --- echo -----------------------------------------------------------------------------------------


@pytest.mark.parametrize('lump', [False, True])
def test_echo_of_our_own_requests_is_stripped(lump: bool) -> None:
    bench = Bench(*[Fate(lump=lump)] * 4)
    bench.drive.echo = True
    assert bench.read(A).data == bench.answer_of(0)
    bench.write(A, 0x1234)
    # the echo of a SELECT has the form of a REPLY behind its EOT
    assert bench.read(A).data == bench.answer_of(2)
    bench.write(classic_id(MODE), 1, unit=95)
    assert bench.read(B).data == bench.answer_of(4)
    assert len(bench.asked) == 5


def test_silence_behind_an_echo_is_silence() -> None:
    bench = Bench(Fate(), Fate(what='drop'), Fate(what='drop'))
    bench.drive.echo = True
    bench.read(A)
    for act in (lambda: bench.read(B), lambda: bench.write(A, 1)):
        with pytest.raises(NoAnswer):
            act()


def test_what_comes_before_the_echo_is_no_answer() -> None:
    bench = Bench()
    bench.drive.echo = True
    bench.read(A)
    take = bench.drive.take

    def stale_first(frame: bytes, end: float) -> None:
        bench.wire.arrive(bench.wire.now - 1, far.reply(1, 0xB6, 0xDEAD), lump=True)
        take(frame, end)

    bench.wire.far_end = stale_first
    assert bench.read(B).data == bench.answer_of(1)


def test_an_adapter_that_echoes_no_more() -> None:
    bench = Bench()
    bench.drive.echo = True
    bench.read(A)
    bench.drive.echo = False
    with pytest.raises(DamagedAnswer):
        bench.read(B)
    assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)


def test_a_driver_that_did_not_run_within_answers_blames_no_adapter() -> None:
    bench = Bench(settings=LineSettings(9600, '7E1', response_timeout=0.2))
    run_late(bench.wire)
    for number in range(6):
        assert bench.read(A).data == bench.answer_of(number)
    assert not bench.link.remarks.texts


def test_answer_whose_pieces_an_adapter_holds_back() -> None:
    bench = Bench(settings=LineSettings(9600, '7E1', response_timeout=0.2))
    frame = classic.encode(classic.Value(UNIT, A.index, 77))

    def far_end(request: bytes, end: float) -> None:
        for number, at in enumerate(range(0, len(frame), 3)):
            bench.wire.arrive(end + 0.06 * number, frame[at : at + 3], lump=True)

    bench.wire.far_end = far_end
    assert bench.read(A).data == packed(77)
    assert not bench.link.remarks.texts, 'a busy machine makes one now and then'
    bench.read(A)
    bench.read(A)
    (remark,) = bench.link.remarks.texts
    assert 'latency timer' in remark
