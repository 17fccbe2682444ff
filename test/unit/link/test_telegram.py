# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The block of registers of a PLC as one telegram: freshness, life counters, gaps, refusals."""

from __future__ import annotations

from dataclasses import dataclass, field
import itertools
import struct
from typing import Any

from hypothesis import given, strategies as st
import pytest
from registers import registers_by

from nfo_sinus_driver.link import Address, Interrupted, LinkError, NoAnswer, NoData, NoPath, Refused
from nfo_sinus_driver.link.modbus.pdu import Read, Write, WriteAndRead
from nfo_sinus_driver.link.plc import telegram

START = 100
STATUS = Address('telegram1', 0, telegram.STATUS, 4, block=START)
ACTUAL = Address('telegram1', 0, telegram.ACTUAL, 2, block=START)
BEGIN = Address('telegram1', 0, telegram.BEGIN, 4, block=START)
NEXT = Address('telegram1', 0, telegram.NEXT, 4, block=START)
CLEAR = Address('telegram1', 0, telegram.CLEAR, 2, block=START)
SETPOINT = Address('telegram1', 0, telegram.SETPOINT, 2, block=START)
READY, RUN = 0x0408, 0x0409


@dataclass
class Plc:
    """
    The registers, and the clock.

    :ivar written: what was written: when, STW1, set-point and life counter.
    :ivar asked: the functions, in order.
    :ivar takes: how long an answer takes, s.
    :ivar loses: how many answers are lost from now on.
    :ivar refuses: functions that it refuses.
    """

    reported: list[int] = field(default_factory=lambda: [0x0207, 0x8000, 5, 3, 1])
    now: float = 1000.0
    takes: float = 0.002
    loses: int = 0
    refuses: tuple[int, ...] = ()
    code: int = Refused.ILLEGAL_FUNCTION
    still: bool = False
    written: list[tuple[float, int, int, int]] = field(default_factory=list)
    asked: list[int] = field(default_factory=list)

    def ask(self, request: Any) -> tuple[bytes, float]:
        self.asked.append(request.function)
        if request.function in self.refuses:
            raise Refused(self.code)
        if isinstance(request, (Write, WriteAndRead)):
            assert request.register == START + 8
            self.written.append((self.now, *struct.unpack('>3H', request.data)))
        self.now += self.takes
        self.reported[2] = (self.reported[2] + (not self.still)) % 0x10000
        if self.loses:
            self.loses -= 1
            raise NoAnswer('lost')
        if isinstance(request, Write):
            return b'', self.now
        first = request.register if isinstance(request, Read) else request.source
        assert (first, request.count) == (START, 5)
        return struct.pack('>5H', *self.reported), self.now


@pytest.fixture
def plc() -> Plc:
    return Plc()


@pytest.fixture
def block(plc: Plc) -> telegram.Block:
    return telegram.Block(registers_by(plc.ask), lambda: plc.now, 7, START)


def command(word: int, setpoint: int = 0) -> bytes:
    return struct.pack('>HH', word, setpoint)


def run(block: telegram.Block) -> None:
    block.write(BEGIN, command(READY))
    block.write(NEXT, command(RUN))


def test_before_the_first_command_it_is_only_read(plc: Plc, block: telegram.Block) -> None:
    assert block.read(STATUS).data == command(0x0207, 3)
    assert block.read(ACTUAL).data == b'\x80\0'
    assert block.read(ACTUAL).data == b'\x80\0'
    # the actual value after a status is of the same telegram; it is asked for after that
    assert plc.asked == [3, 3] and not plc.written


def test_the_actual_value_of_a_status_is_not_asked_for_again(
    plc: Plc, block: telegram.Block
) -> None:
    block.read(STATUS)
    reply = block.read(ACTUAL)
    assert plc.asked == [3] and reply.requests == 0
    block.read(STATUS)
    plc.now += 1.0
    assert block.read(ACTUAL).requests == 1, 'it is too old'
    assert plc.asked == [3, 3, 3]


def test_a_status_from_before_a_word_is_dated_so(plc: Plc, block: telegram.Block) -> None:
    run(block)
    written_at, plc.still = plc.now, True
    for moves in (0, 1, 2):
        plc.reported[2] += bool(moves)
        plc.now += 0.02
        assert (block.read(STATUS).arrived > written_at) == (moves == 2)
    # a set-point is no word
    block.write(SETPOINT, b'\x20\0')
    plc.reported[2] += 1
    plc.now += 0.02
    assert block.read(STATUS).arrived == plc.now


def test_every_transaction_carries_all_of_it(plc: Plc, block: telegram.Block) -> None:
    run(block)
    block.write(SETPOINT, b'\x20\0')
    reply = block.write_and_read(SETPOINT, b'\xe0\0', STATUS)
    block.read(STATUS)
    assert reply.data == command(0x0207, 3)
    words = [written[1:3] for written in plc.written]
    assert words == [(READY, 0), (RUN, 0), (RUN, 0x2000), (RUN, 0xE000), (RUN, 0xE000)]
    # the block was looked at before anything was written to it
    assert plc.asked == [3, 23, 23, 23, 23, 23]


def test_our_count_moves_with_each(plc: Plc, block: telegram.Block) -> None:
    block._count = 0xFFF8
    run(block)
    for _ in range(20):
        block.read(STATUS)
    counts = [written[3] for written in plc.written]
    assert all(count != other for count, other in itertools.pairwise(counts))


def test_a_stop_is_one_telegram(plc: Plc, block: telegram.Block) -> None:
    run(block)
    block.write(SETPOINT, b'\x20\0')
    asked = len(plc.asked)
    block.write(CLEAR, b'\0\x81')
    assert plc.written[-1][1:3] == (READY, 0)
    assert len(plc.asked) == asked + 1


def test_data_are_as_old_as_the_count_of_the_plc(plc: Plc, block: telegram.Block) -> None:
    first = block.read(STATUS).arrived
    plc.still = True
    second = block.read(STATUS).arrived
    plc.now += 3.0
    assert block.read(STATUS).arrived == second == first
    plc.still = False
    block.read(STATUS)
    assert block.read(STATUS).arrived == plc.now > first + 3


def test_nothing_is_said_of_data_that_are_not_valid(plc: Plc, block: telegram.Block) -> None:
    run(block)
    plc.reported[3] = 2
    with pytest.raises(NoData, match='bit 0 of register 103 of unit 7 is 0'):
        block.read(STATUS)
    # a stop gets through all the same, and so does a set-point
    block.write(CLEAR, b'\0\x01')
    assert plc.written[-1][1] == READY
    assert block.write_and_read(SETPOINT, b'\0\0', STATUS).data == b''


def test_not_released_is_reported(plc: Plc, block: telegram.Block) -> None:
    plc.reported[3] = 1
    assert block.read(STATUS).data == command(0x0207, 1)


@pytest.mark.parametrize('version', [0, 3, 0xFFFF])
def test_nothing_is_written_to_another_layout(
    plc: Plc, block: telegram.Block, version: int
) -> None:
    plc.reported[4] = version
    for action in (
        lambda: block.read(STATUS),
        lambda: block.write(BEGIN, command(READY)),
        lambda: block.write_and_read(BEGIN, command(READY), STATUS),
    ):
        with pytest.raises(NoPath, match=f'register 104 of unit 7 is {version} and not 1'):
            action()
    assert not plc.written


def test_no_such_registers(plc: Plc, block: telegram.Block) -> None:
    plc.refuses, plc.code = (3, 23), Refused.ILLEGAL_ADDRESS
    with pytest.raises(NoPath, match='has no registers 100 to 110'):
        block.read(STATUS)


def test_where_function_23_is_refused(plc: Plc, block: telegram.Block) -> None:
    plc.refuses = (23,)
    run(block)
    block.read(STATUS)
    assert plc.asked == [3, 23, 16, 3, 16, 3, 16, 3]
    assert [written[1] for written in plc.written] == [READY, RUN, RUN]


def test_a_run_word_that_is_refused_is_not_written_again(
    plc: Plc, block: telegram.Block
) -> None:
    block.write(BEGIN, command(READY))
    plc.refuses, plc.code = (23,), Refused.DEVICE_FAILURE
    with pytest.raises(Refused):
        block.write(NEXT, command(RUN))
    plc.refuses = ()
    block.read(STATUS)
    assert plc.written[-1][1] == READY


def test_what_goes_on_needs_a_beginning(plc: Plc, block: telegram.Block) -> None:
    for address, data in ((NEXT, command(RUN)), (SETPOINT, b'\1\0'), (CLEAR, b'\0\1')):
        with pytest.raises(Refused, match='no control word of this driver'):
            block.write(address, data)
    assert not plc.written


def test_after_a_gap_a_run_word_is_forgotten(plc: Plc, block: telegram.Block) -> None:
    run(block)
    plc.now += 1.01
    with pytest.raises(Interrupted, match=r'was not reached for 1\.0 s, and stops the drive'):
        block.read(STATUS)
    written = len(plc.written)
    block.read(STATUS)
    with pytest.raises(Refused):
        block.write(SETPOINT, b'\1\0')
    with pytest.raises(Refused):
        block.write(NEXT, command(RUN))
    # our count stands still, so that the PLC stops the drive even if it has not yet
    assert len(plc.written) == written
    block.write(BEGIN, command(READY))
    assert plc.written[-1][1:3] == (READY, 0)


def test_a_gap_harms_no_word_that_stands_still(plc: Plc, block: telegram.Block) -> None:
    run(block)
    block.write(CLEAR, b'\0\1')
    plc.now += 60.0
    block.read(STATUS)
    assert plc.written[-1][1] == READY


def test_a_stop_goes_out_after_a_gap(plc: Plc, block: telegram.Block) -> None:
    run(block)
    plc.now += 60.0
    block.write(BEGIN, command(READY))
    assert plc.written[-1][1] == READY


def test_an_answer_that_took_too_long_is_a_gap(plc: Plc, block: telegram.Block) -> None:
    run(block)
    plc.now += 0.7
    plc.takes = 0.4
    with pytest.raises(Interrupted) as error:
        block.read(STATUS)
    assert error.value.maybe_done
    plc.takes = 0.002
    block.read(STATUS)
    assert plc.asked[-1] == 3


@pytest.mark.parametrize('takes', [0.05, 0.2, 0.4])
def test_a_slow_plc_is_no_gap(plc: Plc, block: telegram.Block, takes: float) -> None:
    plc.takes = takes
    run(block)
    for _ in range(100):
        block.read(STATUS)
    assert plc.written[-1][1] == RUN


def test_a_new_connection_forgets_every_word(plc: Plc, block: telegram.Block) -> None:
    run(block)
    block.forget()
    block.read(STATUS)
    assert plc.asked[-1] == 3
    block.write(BEGIN, command(READY))
    block.forget()
    block.read(STATUS)
    assert plc.asked[-1] == 3


STEP = st.one_of(
    st.tuples(st.just('read'), st.just(0)),
    st.tuples(st.sampled_from(('begin', 'next', 'clear', 'setpoint')), st.integers(0, 0xFFFF)),
    st.tuples(st.just('wait'), st.integers(0, 3000)),
    st.tuples(st.just('lose'), st.integers(0, 4)),
    st.tuples(st.just('slow'), st.integers(1, 1500)),
    st.tuples(st.just('connect'), st.just(0)),
)


@given(st.lists(STEP, max_size=40))
def test_no_run_word_ever_follows_a_gap(steps: list[tuple[str, int]]) -> None:
    """Judged by what the PLC gets: after a gap of a second nothing runs without a beginning."""
    plc = Plc()
    block = telegram.Block(registers_by(plc.ask), lambda: plc.now, 7, START)
    for what, value in steps:
        try:
            if what == 'read':
                block.read(STATUS)
            elif what == 'begin':
                block.write(BEGIN, command(value & ~1))
            elif what == 'next':
                block.write(NEXT, command(value | 1))
            elif what == 'clear':
                block.write(CLEAR, (value | 1).to_bytes(2, 'big'))
            elif what == 'setpoint':
                block.write(SETPOINT, value.to_bytes(2, 'big'))
            elif what == 'wait':
                plc.now += value / 1000
            elif what == 'lose':
                plc.loses = value
            elif what == 'slow':
                plc.takes = value / 1000
            else:
                block.forget()
        except LinkError:
            pass
    last, life, stopped = -1e9, -1, True
    for at, word, setpoint, count in plc.written:
        assert count != life
        life = count
        if at - last > telegram.PLC_TIME + 1e-6:
            stopped = True
        assert not (stopped and word & 1)
        assert not (stopped and setpoint and word & 1)
        if not word & 1:
            stopped = False
        last = at
