# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Classic on a line: no gap, ENQUIRIES, broadcasts, and why a drive refuses (NAK)."""

from __future__ import annotations

import contextlib

import classic_far_end as far
from classic_far_end import BROADCAST, INV_ST, SIO_ERR
from hypothesis import given, strategies as st
from line_bench import Classic, same
import pytest
from support.addresses import classic_id, packed
from virtual_wire import DROP, REFUSE, Fate

from nfo_sinus_driver.link.interface import (
    BAUD_RATES,
    DamagedAnswer,
    LineSettings,
    Read,
    Refused,
)
from nfo_sinus_driver.link.pairs.classic import ClassicLink, Enquiry, encode

A, B, MODE = Classic.A, Classic.B, Classic.MODE
TIMEOUT = Classic.settings.response_timeout
CHAR = Classic.settings.char_time
#: OpTime, as the manual prints it: the low word first.
LONG = classic_id(0x27, 0x127)


# --- plain transactions ---------------------------------------------------------------------------


@pytest.mark.parametrize('char_format', ClassicLink.protocol.char_formats)
@pytest.mark.parametrize('baud', BAUD_RATES)
def test_every_rate_and_format_at_the_limit_of_the_wire(baud: int, char_format: str) -> None:
    line = LineSettings(baud, char_format, TIMEOUT)
    bench = Classic(settings=line)
    start = bench.wire.now
    for _ in range(20):
        bench.read(A)
    # 8 characters there, 14 back, and nothing between two transactions
    assert bench.wire.now - start == pytest.approx(20 * 22 * line.char_time)


def test_lower_case_answers_are_read() -> None:
    bench = Classic()
    bench.drive.lower = True
    bench.drive.values[B.index] = 0xABCD
    assert bench.read(B).data == packed(0xABCD)


@pytest.mark.parametrize('address', [0, 1, 17, 94])
def test_point_to_point_either_address_answers(address: int) -> None:
    bench = Classic()
    bench.drive.address = address
    assert bench.read(A, unit=0).data == bench.answer_of(0)
    assert bench.write(B, unit=0).data == b''
    assert {request.unit for request in bench.drive.requests} == {0}


def test_another_address_does_not_answer() -> None:
    bench = Classic()
    assert bench.read(A, unit=94).data == bench.answer_of(0)
    bench.drive.address = 2
    for act in (lambda: bench.read(A), lambda: bench.write(A)):
        bench.expect(DamagedAnswer, act)


@given(st.binary(min_size=2, max_size=2))
def test_any_word_there_and_back(data: bytes) -> None:
    bench = Classic()
    assert bench.write(A, data).data == b''
    assert bench.drive.requests[0].written == data
    bench.drive.values = {A.index: int.from_bytes(data, 'big')}
    assert bench.read(A).data == data


def test_two_words_are_read_one_by_one() -> None:
    bench = Classic()
    bench.drive.values = {0x27: 0xFFFF, 0x127: 3}
    low, high = bench.link.protocol.parts(LONG)
    assert [bench.read(part).data for part in (low, high)] == [packed(0xFFFF), packed(3)]
    assert bench.asked == [0x27, 0x127]
    with pytest.raises(AssertionError):
        bench.read(LONG)


@pytest.mark.parametrize('noise', [b'\x00', b'\x7f\x7f', b'\x02', b'!', b'!\x02E0', b'\x1b[0m'])
def test_noise_before_an_answer(noise: bytes) -> None:
    bench = Classic()
    bench.drive.before = noise
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.write(A).data == b''


@pytest.mark.parametrize('lump', [False, True])
@pytest.mark.parametrize('address', [A, Classic.INV_ST])
def test_doubled_reply(lump: bool, address: object) -> None:
    bench = Classic(Fate(what='double', lump=lump))
    assert isinstance(address, type(A))
    number = address.index
    resync = MODE.index if number == INV_ST else INV_ST
    bench.read(address)
    # in a lump it is seen at once, and the line is silent between; else when it comes too early
    assert bench.read(address).data == bench.answer_of()
    assert bench.asked == ([number, number] if lump else [number, number, resync, number])


# --- broadcast ------------------------------------------------------------------------------------


@pytest.mark.parametrize('echo', [False, True])
def test_broadcast_awaits_no_answer(echo: bool) -> None:
    bench = Classic()
    if echo:
        bench.drive.echo = same
    start = bench.wire.now
    assert bench.write(MODE, packed(1), unit=BROADCAST).data == b''
    assert bench.wire.sent[0][1].startswith(b'\x04\x7f\x02E0029=0001')
    assert bench.read(A).data == bench.answer_of(1)
    # the drives have had time to obey
    assert bench.wire.sent[1][0] - start > 15 * CHAR + 0.09
    assert len(bench.asked) == 2


def test_drives_that_answer_fast_need_little_time_for_a_broadcast() -> None:
    # one that took long lately needs it, but none needs longer than all drives may
    for delay in (0.0, 0.2, 0.95):
        bench = Classic(*[Fate()] * 300, Fate(delay))
        for number in range(301):
            bench.read(A if number % 2 else B)
        start = bench.wire.now
        bench.write(MODE, unit=BROADCAST)
        pause = bench.wire.now - start - 15 * CHAR
        assert min(2 * delay * TIMEOUT, 0.1) - 0.001 <= pause <= (0.101 if delay else 0.01)


def test_a_broadcast_cannot_be_read() -> None:
    bench = Classic()
    with pytest.raises(ValueError, match='broadcast'):
        bench.read(A, unit=BROADCAST)
    with pytest.raises(ValueError, match='0 to 95'):
        bench.write(A, unit=96)
    assert bench.wire.sent == []


# --- refusals -------------------------------------------------------------------------------------


def refused(bench: Classic, code: int, *words: str) -> Refused:
    with pytest.raises(Refused) as raised:
        bench.write(A)
    assert raised.value.code == code
    for word in words:
        assert word in str(raised.value)
    return raised.value


def test_enquiry_refused() -> None:
    bench = Classic(REFUSE)
    with pytest.raises(Refused, match='no parameter E001E') as raised:
        bench.read(A)
    assert raised.value.code == Refused.ILLEGAL_ADDRESS
    assert bench.asked == [A.index]


def refusal_bench(inv_st: int, sio_err: int = 0) -> Classic:
    """A drive that refuses what is written, and gives this as its reason."""
    bench = Classic(REFUSE)
    bench.drive.values = {INV_ST: inv_st, SIO_ERR: sio_err}
    return bench


def test_refused_without_a_fault() -> None:
    bench = refusal_bench(37)
    error = refused(bench, Refused.ILLEGAL_VALUE, 'does not accept this value', 'InvSt 37')
    assert not error.maybe_done
    assert bench.asked == [A.index, INV_ST]


@pytest.mark.parametrize('code', [1, 12, 15, 23])
def test_refused_because_a_fault_stands(code: int) -> None:
    bench = refusal_bench(code, 1 << 10)
    refused(bench, Refused.DEVICE_FAILURE, 'a fault is active', f'InvSt {code}')
    assert bench.asked == [A.index, INV_ST]


def test_a_serial_fault_that_may_have_stood_before_is_not_acknowledged() -> None:
    bench = refusal_bench(14, 1 << 10)
    refused(bench, Refused.DEVICE_FAILURE, 'Sio Fail')
    assert SIO_ERR not in bench.asked
    assert far.INV_ST_ACK not in bench.asked


def own_fault_bench(before: int, pause: float, sio_err: int) -> Classic:
    """A drive that refuses, with a serial fault; what it said before, and how long ago."""
    bench = refusal_bench(14, sio_err)
    bench.drive.values[INV_ST] = before
    bench.drive.heal(Fate(), REFUSE)
    bench.read(Classic.INV_ST)
    bench.wire.now += pause
    bench.drive.values[INV_ST] = 14
    return bench


@pytest.mark.parametrize(
    ('flags', 'code', 'words'),
    [
        (1 << 10, Refused.ILLEGAL_VALUE, ['out of range']),
        (1 << 6, Refused.DEVICE_FAILURE, ['not permitted in the current mode']),
        (1 << 7, Refused.ILLEGAL_ADDRESS, ['unknown parameter']),
        (1 << 9, Refused.ILLEGAL_ADDRESS, ['cannot be written']),
        (1 << 2, Refused.DEVICE_FAILURE, ['wrong check sum']),
        (1 << 1 | 1 << 14, Refused.DEVICE_FAILURE, ['wrong parity', 'overrun']),
        (0, Refused.DEVICE_FAILURE, ['does not say why']),
        (1 << 13, Refused.DEVICE_FAILURE, ['flag 13']),
    ],
)
def test_a_serial_fault_by_this_very_write_is_read_and_cleared(
    flags: int, code: int, words: list[str]
) -> None:
    bench = own_fault_bench(38, 0.5, flags)
    refused(bench, code, *words, 'Sio Fail')
    assert bench.asked == [INV_ST, A.index, INV_ST, SIO_ERR]


@pytest.mark.parametrize(('before', 'pause'), [(14, 0.1), (38, 1.5)])
def test_a_serial_fault_that_is_old_or_may_be_is_left(before: int, pause: float) -> None:
    bench = own_fault_bench(before, pause, 1 << 10)
    refused(bench, Refused.DEVICE_FAILURE, 'Sio Fail')
    assert SIO_ERR not in bench.asked


def test_what_was_known_of_a_drive_ends_with_the_connection() -> None:
    bench = own_fault_bench(38, 0.1, 1 << 10)
    bench.link.close()
    bench.link.open()
    refused(bench, Refused.DEVICE_FAILURE, 'Sio Fail')
    assert SIO_ERR not in bench.asked


def test_a_reason_that_is_not_known() -> None:
    bench = Classic(REFUSE, DROP)
    refused(bench, Refused.DEVICE_FAILURE, 'why is not known')


def test_the_flags_are_read_once_beside_another_master() -> None:
    bench = own_fault_bench(38, 0.5, 1 << 10)
    heard = far.reply(1, B.index, 5)
    bench.wire.now = bench.wire.arrive(bench.wire.now, encode(Enquiry(1, B.index)) + heard) + 0.05
    bench.drive.heal(REFUSE, Fate(), Fate(what='damage'))
    refused(bench, Refused.DEVICE_FAILURE, 'why is not known')
    # reading has cleared them: once more they would tell nothing, and clear what came since
    assert bench.link.remarks.foreign_frames == 1
    assert bench.asked.count(SIO_ERR) == 1


@pytest.mark.parametrize('once', [True, False])
def test_what_acknowledges_is_sent_once_behind_an_answer_that_comes_twice(once: bool) -> None:
    bench = Classic(Fate(what='double', again=0.05))
    bench.drive.values[A.index] = 5
    bench.read(A)
    with pytest.raises(DamagedAnswer) if once else contextlib.nullcontext():
        Read(A, once).carry_out(bench.link, 1)
    assert bench.asked.count(A.index) == (2 if once else 3)
