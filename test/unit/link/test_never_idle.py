# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A line that is never left unused in quarantine, and a write that nothing holds back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import functools
import heapq

from classic_far_end import FarEnd, Fate as ClassicFate
from classic_link_bench import Bench as ClassicBench
from hypothesis import example, given, settings as hypothesis_settings, strategies as st
from link_bench import SETTINGS, TIMEOUT, TWO, UNIT, A, B, Bench, C, D
import pymodbus_opinion as opinion
import pytest
from support.addresses import classic_id, packed, register
from test_read_then_write import AsciiBench
from test_rtu_link import FATES, STEPS, lumps_or_doubles
from virtual_wire import Fate, Slave, Wire

from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, NotReady, Refused
from nfo_sinus_driver.link.interface import Address, LineSettings

LOST = Fate(what='drop')
NAMES = {'A': A, 'B': B, 'C': C, 'D': D}


class G2(Slave):
    """Says who it is, as a G2 does [M0 §6.2.4]."""

    def identified(self, frame: bytes) -> bytes:
        if frame[1] == 17:
            message = frame[:2] + b'\x10' + b'0123456789ABCDEF'
        else:
            message = frame[:4] + bytes((0x82, 0, 0, 1, frame[4], 0))
        return message + opinion.crc(message)


class Old(Slave):
    """Does not even refuse what it does not know."""

    def identified(self, frame: bytes) -> bytes:
        return b''


UNITS = {'G2': G2, 'Optimal': Slave, 'old': Old}


def modbus_bench(
    unit: str, fates: Iterator[Fate] | None = None, make: type[Bench] = Bench
) -> Bench:
    bench = make()
    bench.slave = UNITS[unit](bench.wire, fates)
    return bench


# --- questions that are never in quarantine all together ------------------------------------------


@pytest.mark.parametrize('unit', ['G2', 'Optimal'])
@pytest.mark.parametrize('make', [Bench, AsciiBench])
def test_however_many_answers_are_lost_something_is_asked_at_once(
    make: type[Bench], unit: str
) -> None:
    bench = modbus_bench(unit, iter([LOST] * 30), make)
    for _ in range(30):
        before = bench.wire.now
        bench.expect(NoAnswer, lambda: bench.read(A))
        assert bench.wire.sent[-1][0] - before <= bench.wire.gap + 1e-9
    # what was read last, then two questions of other kinds, and none is asked in quarantine
    assert [function for _, function, _, _ in bench.slave.requests[:6]] == [3, 3, 17, 43, 3, 3]
    assert bench.asked[:2] == [A.index, TWO.index]
    assert bench.read(B).data == bench.answer_of(len(bench.asked) - 1)


def test_a_unit_of_which_nothing_is_known_is_identified() -> None:
    bench = Bench([LOST], resync=())
    bench.expect(NoAnswer, lambda: bench.read(A))
    assert bench.read(B).data == bench.answer_of(2)
    assert [function for _, function, _, _ in bench.slave.requests] == [3, 17, 3]


def test_a_unit_of_which_nothing_is_known_is_left_alone_for_one_time_out_at_most() -> None:
    bench = Bench([LOST] * 3, resync=())
    for _ in range(3):
        bench.expect(NoAnswer, lambda: bench.read(A))
    error = bench.expect(NotReady, lambda: bench.read(A))
    assert isinstance(error, NotReady)
    assert bench.wire.now < error.until <= bench.wire.now + TIMEOUT
    bench.wire.now = error.until
    assert bench.read(A).data == bench.answer_of(3)


def test_what_cannot_be_confused_needs_no_resync_read() -> None:
    bench = Bench([Fate(1.5)])
    bench.expect(NoAnswer, lambda: bench.read(A))
    assert bench.read(C).data == bench.answer_of(1)
    # and it has shown that nothing is left
    assert bench.read(B).data == bench.answer_of(2)
    assert len(bench.asked) == 3


def test_a_refusal_that_may_be_an_earlier_one_is_asked_for_again() -> None:
    bench = Bench([Fate(1.5, 'refuse'), Fate(what='refuse'), Fate(), Fate(what='refuse')])
    bench.expect(NoAnswer, lambda: bench.read(A))
    bench.expect(DamagedAnswer, lambda: bench.read(C))
    error = bench.expect(Refused, lambda: bench.read(C))
    assert isinstance(error, Refused)
    assert error.code == bench.slave.code(len(bench.asked) - 1)


@hypothesis_settings(max_examples=300)
@given(FATES, STEPS, st.sampled_from(sorted(UNITS)))
@example(
    # three answers repeated at once: the line has no gap for longer than a write waits
    [Fate(3.0, 'double'), Fate(what='double'), Fate(what='double')],
    [('write A', 0.0), ('C', 0.0), ('write A', 0.0), ('write A', 0.0)],
    'G2',
)
def test_whatever_is_lost_late_doubled_or_damaged_the_line_is_used(
    fates: list[Fate], steps: list[tuple[str, float]], unit: str
) -> None:
    bench = modbus_bench(unit, lumps_or_doubles(fates))
    for what, _ in steps:
        address = NAMES[what[-1]]
        before = len(bench.asked)
        try:
            if what.startswith('write'):
                bench.write(address, *(7,) * (address.size // 2))
            else:
                reply = bench.read(address).data
                assert bench.asked[-1] == address.index
                assert reply == bench.answer_of(len(bench.asked) - 1)
        except Refused as refusal:
            assert bench.asked[-1] == address.index
            assert refusal.code == bench.slave.code(len(bench.asked) - 1)
        except NotReady as refusal:
            assert not what.startswith('write')
            assert len(bench.asked) == before
            assert bench.wire.now < refusal.until <= bench.wire.now + TIMEOUT + 1e-9
            bench.wire.now = refusal.until
        except LinkError:
            pass
        if what.startswith('write'):
            assert len(bench.asked) == before + 1
    bench.wire.check_gaps()


@hypothesis_settings(max_examples=300)
@given(
    st.lists(st.builds(Fate, st.floats(0, 3), st.sampled_from(['answer', 'drop'])), max_size=25),
    st.lists(st.sampled_from(sorted(NAMES)), max_size=25),
)
def test_no_request_waits_where_answers_are_only_lost_or_late(
    fates: list[Fate], names: list[str]
) -> None:
    bench = modbus_bench('G2', iter(fates))
    for name in names:
        before = bench.wire.now, len(bench.wire.sent)
        try:
            reply = bench.read(NAMES[name]).data
        except (NoAnswer, DamagedAnswer):
            pass
        else:
            assert reply == bench.answer_of(len(bench.asked) - 1)
        first = bench.wire.sent[before[1]][0]
        # a late answer may have to end first
        assert first - before[0] <= 2 * bench.wire.gap + 9 * SETTINGS.char_time


# --- bursts ---------------------------------------------------------------------------------------

RATES = (19200, 57600)
BURSTS = st.floats(0.05, 1.0)


def lose(wire: Wire, begin: float, end: float, *, noise: bool) -> None:
    """Lose every frame that touches a stretch of time; have rubbish come instead, or nothing."""
    far_end = wire.far_end

    def take(frame: bytes, sent: float) -> None:
        if sent < begin or wire.now > end:
            far_end(frame, sent)
        wire._arrivals = [
            (at, order, data)
            for at, order, data in wire._arrivals
            if data == b'\xa5' or not begin <= at <= end
        ]
        heapq.heapify(wire._arrivals)

    if noise:
        for number in range(int((end - begin) / 0.001)):
            wire._put(begin + 0.001 * number, b'\xa5')
    wire.far_end = take


def check_status(wire: Wire, end: float, reads: list[Callable[[], object]]) -> None:
    """Read again and again; after the burst the first request and the first status come soon."""
    done = 0
    while done < len(reads) or wire.now < end:
        try:
            reads[done % len(reads)]()
            done = done + 1 if wire.now >= end else 0
        except NotReady as error:
            wire.now = error.until
        except LinkError:
            pass
    first = next(at for at, _ in wire.sent if at >= end)
    assert first - end <= 0.25
    assert wire.now - first <= 0.2


@pytest.mark.parametrize('noise', [False, True])
@pytest.mark.parametrize('rate', RATES)
@pytest.mark.parametrize('make', [Bench, AsciiBench])
@hypothesis_settings(max_examples=60)
@given(
    burst=BURSTS, begin=st.floats(0.0, 0.05), reads=st.sampled_from([(A, B), (A, C), (C, D)])
)
def test_after_a_burst_the_line_is_used_and_the_status_known_at_once(
    make: type[Bench],
    rate: int,
    noise: bool,
    burst: float,
    begin: float,
    reads: tuple[Address, Address],
) -> None:
    for unit in ('G2', 'Optimal'):
        bench = make(settings=LineSettings(rate, '8E1' if make is Bench else '7E1', 0.2))
        bench.slave = UNITS[unit](bench.wire)
        at = bench.wire.now + begin
        lose(bench.wire, at, at + burst, noise=noise)
        status = [functools.partial(bench.read, address) for address in reads]
        check_status(bench.wire, at + burst, status)


@pytest.mark.parametrize('noise', [False, True])
@pytest.mark.parametrize('rate', RATES)
@hypothesis_settings(max_examples=60)
@given(burst=BURSTS, begin=st.floats(0.0, 0.05))
def test_classic_after_a_burst_the_line_is_used_and_the_status_known_at_once(
    rate: int, noise: bool, burst: float, begin: float
) -> None:
    bench = ClassicBench(settings=LineSettings(rate, '7E1', 0.2))
    at = bench.wire.now + begin
    lose(bench.wire, at, at + burst, noise=noise)
    status = [functools.partial(bench.read, register(number)) for number in (0xE9, 0x29)]
    check_status(bench.wire, at + burst, status)


# --- writes ---------------------------------------------------------------------------------------


def babble(wire: Wire, byte: int, period: float) -> None:
    for number in range(int(1 / period)):
        wire.arrive(wire.now + number * period, bytes((byte,)))


@pytest.mark.parametrize('rate', [9600, 19200, 57600])
@pytest.mark.parametrize('make', [Bench, AsciiBench])
def test_a_stop_is_sent_into_noise_that_does_not_end(make: type[Bench], rate: int) -> None:
    settings = LineSettings(rate, '8E1' if make is Bench else '7E1', 0.2)
    bench = make(settings=settings)
    bench.read(A)
    babble(bench.wire, 0x55, bench.wire.gap / 2)
    before = bench.wire.now
    with contextlib.suppress(DamagedAnswer):
        bench.write(A, 0)
    assert bench.asked[1:] == [A.index]
    longest = (9 if make is Bench else 17) * settings.char_time
    assert bench.wire.sent[-1][0] - before <= 2 * bench.wire.gap + max(0.02, longest)


def test_what_was_not_sent_was_not_done() -> None:
    bench = Bench()
    babble(bench.wire, 0x55, SETTINGS.frame_gap / 2)
    with pytest.raises(DamagedAnswer, match='never silent') as raised:
        bench.read(A)
    assert not raised.value.maybe_done
    with pytest.raises(DamagedAnswer, match='never silent') as raised:
        bench.link.read_then_write(UNIT, A, B, packed(0))
    assert not raised.value.maybe_done
    assert bench.wire.sent == []


def test_a_write_and_read_whose_answer_would_be_in_doubt_is_a_write() -> None:
    bench = Bench()

    def answer(frame: bytes, end: float) -> None:
        message = bytes((UNIT, 23, 2, 0, 5))
        reply = frame if frame[1] == 6 else message + opinion.crc(message)
        bench.wire.arrive(end, reply)

    bench.wire.far_end = answer
    assert bench.write_and_read(A, packed(6), B).data == packed(5)
    bench.wire.far_end = lambda frame, end: None
    bench.expect(NoAnswer, lambda: bench.write_and_read(A, packed(7), B))
    bench.wire.far_end = answer
    before = bench.wire.now
    assert bench.write_and_read(A, packed(8), B).data == b''
    assert bench.wire.now < before + 0.1
    # what was late has come before the answer to that
    assert bench.write_and_read(A, packed(9), B).data == packed(5)
    assert [frame[1] for _, frame in bench.wire.sent] == [23, 23, 6, 23]


def test_a_write_and_read_goes_out_at_once_on_a_line_that_is_never_silent() -> None:
    bench = Bench()
    bench.wire.far_end = lambda frame, end: None
    babble(bench.wire, 0x55, SETTINGS.frame_gap / 2)
    before = bench.wire.now
    with contextlib.suppress(DamagedAnswer):
        bench.link.write_and_read(UNIT, A, packed(7), B)
    assert bench.wire.sent
    assert bench.wire.sent[0][0] < before + 0.1


@pytest.mark.parametrize('lost', range(6))
def test_a_write_goes_out_at_once_whatever_is_in_quarantine(lost: int) -> None:
    bench = Bench([LOST] * lost)
    for _ in range(lost):
        bench.expect(NoAnswer, lambda: bench.read(A))
    before = bench.wire.now
    assert bench.write(A, 0).data == b''
    assert bench.wire.sent[-1][0] - before <= bench.wire.gap + 1e-9
    assert len(bench.asked) == lost + 1


# --- Classic --------------------------------------------------------------------------------------


def test_classic_however_many_answers_are_lost_something_is_asked_at_once() -> None:
    bench = ClassicBench(*[ClassicFate(what='drop')] * 30)
    for _ in range(30):
        before = bench.wire.now
        with pytest.raises(NoAnswer):
            bench.read(register(0xE9))
        assert bench.wire.sent[-1][0] == before
    assert bench.asked[:5] == [0xE9, 0x29, 0x30, 0x0F, 0xE9]


@pytest.mark.parametrize('what', ['drop', 'damage'])
def test_classic_a_stop_that_failed_is_given_again_before_anything_is_read(what: str) -> None:
    bench = ClassicBench(*[ClassicFate(what=what)] * 2)
    for _ in range(2):
        before = bench.wire.now
        with pytest.raises((NoAnswer, DamagedAnswer)):
            bench.write(register(0x2A), 0)
        assert bench.wire.sent[-1][0] == before
    assert bench.asked == [0x2A, 0x2A]


def test_classic_a_stop_is_sent_into_noise_that_does_not_end() -> None:
    bench = ClassicBench()
    babble(bench.wire, 0x7F, 0.001)
    before = bench.wire.now
    with pytest.raises(DamagedAnswer) as raised:
        bench.write(register(0x2A), 0)
    assert raised.value.maybe_done
    assert [at for at, _ in bench.wire.sent] == [before]


@hypothesis_settings(max_examples=200)
@given(
    st.lists(
        st.builds(ClassicFate, st.floats(0, 3), st.sampled_from(['answer', 'drop', 'damage'])),
        max_size=25,
    ),
    st.lists(st.sampled_from([0xE9, 0x29, 0x1E, 0xB6]), max_size=25),
)
def test_classic_no_request_waits_longer_than_a_time_out(
    fates: list[ClassicFate], numbers: list[int]
) -> None:
    bench = ClassicBench(*fates)
    for number in numbers:
        try:
            reply = bench.read(classic_id(number)).data
        except NotReady as refusal:
            assert bench.wire.now < refusal.until <= bench.wire.now + TIMEOUT + 1e-9
            bench.wire.now = refusal.until
        except LinkError:
            pass
        else:
            index = len(bench.asked) - 1
            assert reply == packed(FarEnd.word(number, index))
