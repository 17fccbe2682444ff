# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One transaction after the other on a line in virtual time."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib

from hypothesis import example, given, settings as hypothesis_settings, strategies as st
from link_bench import ONE, SETTINGS, TIMEOUT, TWO, UNIT, A, B, Bench, C, D
import pymodbus_opinion as opinion
import pytest
from support.addresses import packed
from virtual_wire import Fate, run_late

from nfo_sinus_driver.link.interface import (
    BAUD_RATES,
    Address,
    DamagedAnswer,
    LineSettings,
    LinkError,
    NeverSilent,
    NoAnswer,
    NotReady,
    PortError,
    Refused,
)

# --- plain transactions ---------------------------------------------------------------------------


@pytest.mark.parametrize('lump', [False, True])
def test_read_and_write(lump: bool) -> None:
    bench = Bench([Fate(lump=lump)] * 4)
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.read(C).data == bench.answer_of(1)
    assert bench.write(A, 5).data == b''
    assert bench.write(C, 5, 6).data == b''
    assert [request[1:] for request in bench.slave.requests] == [
        (3, 0x400, 1),
        (3, 0x3EC, 2),
        (6, 0x400, 1),
        (16, 0x3EC, 2),
    ]
    bench.wire.check_gaps()


def test_reply_says_when_its_last_byte_came() -> None:
    bench = Bench([Fate(0.5)])
    assert bench.read(A).arrived == bench.wire.seen[-1][0] == bench.wire.now


@pytest.mark.parametrize('baud', BAUD_RATES)
@pytest.mark.parametrize('what', ['answer', 'refuse', 'drop', 'damage', 'double'])
def test_silence_between_frames(baud: int, what: str) -> None:
    line = LineSettings(baud_rate=baud, response_timeout=TIMEOUT)
    bench = Bench([Fate(what=what)] * 3, line)
    for _ in range(3):
        for act in (lambda: bench.read(A), lambda: bench.write(B, 1)):
            with contextlib.suppress(LinkError):
                act()
    assert len(bench.wire.sent) >= 5
    bench.wire.check_gaps()
    # and not much longer than needed: nothing is done but waiting for t3.5
    assert line.frame_gap == pytest.approx(max(0.00175, 3.5 * 11 / baud), rel=0.15)


def test_no_time_is_lost_between_frames() -> None:
    bench = Bench()
    for _ in range(3):
        bench.read(A)
    frames = zip(bench.wire.sent, bench.wire.sent[1:], strict=False)
    took = 15 * SETTINGS.char_time + SETTINGS.frame_gap
    assert [after[0] - before[0] for before, after in frames] == pytest.approx([took] * 2)


def test_first_frame_keeps_the_silence_too() -> None:
    bench = Bench()
    opened = bench.wire.now
    bench.read(A)
    assert bench.wire.sent[0][0] - opened >= SETTINGS.frame_gap


@pytest.mark.parametrize('action', ['read', 'write'])
@pytest.mark.parametrize('baud', [1200, 19200, 57600])
def test_time_out_counts_from_the_end_of_the_request(action: str, baud: int) -> None:
    line = LineSettings(baud_rate=baud, response_timeout=TIMEOUT)
    bench = Bench([Fate(what='drop')], line)
    error = bench.expect(
        NoAnswer, lambda: bench.read(A) if action == 'read' else bench.write(C, 1, 2)
    )
    assert error.maybe_done
    ((start, frame),) = bench.wire.sent
    end = start + len(frame) * line.char_time
    assert bench.wire.now - end == pytest.approx(TIMEOUT)


def test_answer_just_in_time_is_taken_whole() -> None:
    # the first byte counts: a long answer at 1200 bit/s takes longer than the time-out itself
    line = LineSettings(baud_rate=1200, response_timeout=0.02)
    bench = Bench([Fate(0.5)], line)
    assert bench.read(C).data == bench.answer_of(0)


def test_answer_with_a_pause_inside() -> None:
    # adapters hand bytes over in lumps
    bench = Bench()
    frame = opinion.read_answer(UNIT, [77])

    def far_end(request: bytes, end: float) -> None:
        bench.wire.arrive(end, frame[:3], lump=True)
        bench.wire.arrive(end + 0.02, frame[3:], lump=True)

    bench.wire.far_end = far_end
    assert bench.read(A).data == packed(77)


def test_pauses_that_an_adapter_makes_are_learned_and_reported() -> None:
    bench = Bench(settings=LineSettings(response_timeout=0.2))
    pieces = 3
    asked = 0

    def far_end(request: bytes, end: float) -> None:
        nonlocal asked
        asked += 1
        frame = opinion.read_answer(UNIT, [1, asked])
        for at in range(0, len(frame), pieces):
            bench.wire.arrive(end + 0.06 * at / pieces, frame[at : at + pieces], lump=True)

    bench.wire.far_end = far_end
    assert bench.read(C).data == packed(1, 1)
    assert not bench.link.remarks.texts, 'a busy machine makes one now and then'
    assert [bench.read(C).data for _ in range(2)] == [packed(1, 2), packed(1, 3)]
    (remark,) = bench.link.remarks.texts
    assert 'latency timer' in remark
    # a long answer in many pieces takes longer than the first byte of an answer may
    pieces = 1
    assert bench.read(C).data == packed(1, 4)
    assert bench.wire.now - bench.wire.sent[-1][0] > 0.4


def test_a_driver_that_did_not_run_within_answers_blames_no_adapter() -> None:
    bench = Bench(settings=LineSettings(response_timeout=0.2))
    run_late(bench.wire)
    for number in range(6):
        assert bench.read(A).data == bench.answer_of(number)
    assert not bench.link.remarks.texts and not bench.link._pause


@pytest.mark.parametrize('cut', [1, 3, 6])
def test_answer_that_stops_in_the_middle(cut: int) -> None:
    bench = Bench()

    def far_end(request: bytes, end: float) -> None:
        bench.wire.arrive(end, opinion.read_answer(UNIT, [77])[:cut])

    bench.wire.far_end = far_end
    error = bench.expect(DamagedAnswer, lambda: bench.read(A))
    assert error.maybe_done
    assert f'{cut} bytes' in str(error)
    assert bench.wire.now - bench.wire.sent[0][0] < 2 * TIMEOUT


@pytest.mark.parametrize('values', [[77], [1, 2]])
def test_an_answer_without_its_first_byte_is_said_to_be_that(values: list[int]) -> None:
    bench = Bench()

    def far_end(request: bytes, end: float) -> None:
        bench.wire.arrive(end, opinion.read_answer(UNIT, values)[1:])

    bench.wire.far_end = far_end
    error = bench.expect(DamagedAnswer, lambda: bench.read(A if len(values) == 1 else C))
    assert 'adapter switches from sending to receiving too late' in str(error)


def test_damaged_answer() -> None:
    bench = Bench([Fate(what='damage')])
    assert bench.expect(DamagedAnswer, lambda: bench.read(A)).maybe_done


def test_refusal() -> None:
    bench = Bench([Fate(what='refuse'), Fate(what='refuse')])
    for number, action in enumerate([lambda: bench.read(A), lambda: bench.write(A, 1)]):
        error = bench.expect(Refused, action)
        assert isinstance(error, Refused)
        assert error.code == bench.slave.code(number)
        assert not error.maybe_done
    # a refusal is an answer: there is nothing to doubt
    assert bench.read(A).data == bench.answer_of(2)
    assert len(bench.asked) == 3


def test_closing_ends_every_quarantine() -> None:
    bench = Bench([Fate(what='drop')])
    bench.expect(NoAnswer, lambda: bench.read(A))
    bench.link.close()
    assert not bench.wire.is_open
    bench.link.open()
    assert bench.read(A).data == bench.answer_of(1)
    assert bench.asked == [0x400, 0x400]


def test_opening_an_open_port_again_ends_none() -> None:
    """A stuck adapter may pass on what it has held back."""
    bench = Bench([Fate(1.5)])
    bench.expect(NoAnswer, lambda: bench.read(A))
    bench.link.open()
    assert bench.read(B).data == bench.answer_of(2)
    assert bench.asked == [A.index, TWO.index, B.index]


def test_lost_port_is_passed_on() -> None:
    bench = Bench()

    def gone(*_: object) -> bytes:
        raise PortError('gone')

    bench.wire.write = gone  # type: ignore[method-assign]
    bench.expect(PortError, lambda: bench.read(A))
    bench.wire.read = gone  # type: ignore[method-assign]
    bench.expect(PortError, lambda: bench.read(A))


# --- quarantine -----------------------------------------------------------------------------------


def test_late_answer_is_not_taken_for_the_next_one() -> None:
    bench = Bench([Fate(1.5)])
    bench.expect(NoAnswer, lambda: bench.read(A))
    # the answer to A, of the same shape as one to B, is still on its way
    assert bench.read(B).data == bench.answer_of(2)
    assert bench.asked == [0x400, 0x258, 0x264]
    assert bench.read(B).data == bench.answer_of(3)
    assert len(bench.asked) == 4


@pytest.mark.parametrize(('first', 'resync', 'second'), [(A, TWO, B), (C, ONE, D)])
def test_resync_read_has_another_shape(first: Address, resync: Address, second: Address) -> None:
    bench = Bench([Fate(what='drop')])
    bench.expect(NoAnswer, lambda: bench.read(first))
    assert bench.read(second).data == bench.answer_of(2)
    assert bench.asked[1] == resync.index


def test_write_goes_out_at_once_even_in_quarantine() -> None:
    bench = Bench([Fate(what='drop'), Fate(what='drop')])
    bench.expect(NoAnswer, lambda: bench.read(A))
    bench.expect(NoAnswer, lambda: bench.read(A))
    before = bench.wire.now
    assert bench.write(A, 0).data == b''
    assert bench.wire.sent[-1][0] - before <= SETTINGS.frame_gap + 1e-9
    assert bench.asked[2:] == [0x400]


def test_late_answer_before_a_write_is_passed_over() -> None:
    bench = Bench([Fate(1.2)])
    bench.expect(NoAnswer, lambda: bench.read(A))
    assert bench.write(B, 5).data == b''
    # units answer in order, so the quarantine is over
    assert bench.read(A).data == bench.answer_of(2)
    assert len(bench.asked) == 3


def test_late_answer_to_a_write_does_not_end_the_quarantine() -> None:
    # found by the property below: the first write's answer is taken for the second one's, and
    # the answer to the read between them is still to come
    bench = Bench([Fate(2.9), Fate(2.5)])
    bench.expect(NoAnswer, lambda: bench.write(B, 5))
    bench.expect(NoAnswer, lambda: bench.read(C))
    assert bench.write(B, 5).data == b''
    assert read_or_none(bench, A) in (None, bench.answer_of(len(bench.asked) - 1))


def test_late_answer_while_the_next_request_still_leaves() -> None:
    # the silence between frames counts from the end of the request, not from what came before it
    bench = Bench([Fate(0.97, lump=True)])
    bench.expect(NoAnswer, lambda: bench.write(A, 5))
    assert bench.write(A, 5).data == b''
    start, frame = bench.wire.sent[-1]
    assert bench.wire.now < start + len(frame) * SETTINGS.char_time
    bench.read(A)
    bench.wire.check_gaps()


def read_or_none(bench: Bench, address: Address) -> tuple[int, ...] | None:
    try:
        return bench.read(address).data
    except LinkError:
        return None


def test_refusal_is_not_taken_for_that_of_another_request() -> None:
    # the first write is refused late, within the time of the second
    bench = Bench([Fate(1.5, 'refuse'), Fate()])
    bench.expect(NoAnswer, lambda: bench.write(A, 5))
    assert bench.write(B, 5).data == b''


def test_several_late_refusals_at_once() -> None:
    # an adapter hands over in one lump what two earlier writes were refused with
    bench = Bench([Fate(what='drop'), Fate(what='drop')])
    bench.expect(NoAnswer, lambda: bench.write(A, 5))
    bench.expect(NoAnswer, lambda: bench.write(B, 5))
    lump = opinion.exception(UNIT, 6, 3) * 2 + opinion.write_answer(UNIT, D.index, [5])

    def far_end(request: bytes, end: float) -> None:
        bench.wire.arrive(end, lump, lump=True)

    bench.wire.far_end = far_end
    assert bench.write(D, 5).data == b''


def test_refusal_of_another_function_is_believed_in_quarantine() -> None:
    bench = Bench([Fate(what='drop'), Fate(what='refuse')])
    bench.expect(NoAnswer, lambda: bench.read(A))
    error = bench.expect(Refused, lambda: bench.write(A, 5))
    assert isinstance(error, Refused)
    assert error.code == bench.slave.code(1)


def test_refusals_that_cannot_be_distinguished_keep_no_reads_out() -> None:
    # a drive comes back from a power cycle and refuses what is written to it again and again
    bench = Bench([Fate(what='drop'), *[Fate(what='refuse')] * 3])
    bench.expect(NoAnswer, lambda: bench.write(B, 0))
    for _ in range(3):
        bench.expect(DamagedAnswer, lambda: bench.write(B, 0))
    assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)
    # and now that an answer has come, the next refusal is believed
    bench.slave.heal(Fate(what='refuse'))
    bench.expect(Refused, lambda: bench.write(B, 0))


def test_refused_resync_read_is_an_answer() -> None:
    # it says that the line can be believed, and nothing about the request behind it
    bench = Bench([Fate(what='drop'), Fate(what='refuse'), Fate()], resync=())
    bench.expect(NoAnswer, lambda: bench.read(A))
    assert bench.read(B).data == bench.answer_of(2)
    assert len(bench.asked) == 3


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_answer_is_noticed(lump: bool) -> None:
    bench = Bench([Fate(what='double', lump=lump)])
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.read(B).data == bench.answer_of(2)
    assert bench.asked == [0x400, 0x258, 0x264]


def test_unrequested_bytes_put_reads_in_quarantine() -> None:
    bench = Bench()
    bench.read(A)
    bench.wire.arrive(bench.wire.now, opinion.read_answer(UNIT, [99]))
    assert bench.read(B).data == bench.answer_of(2)
    assert bench.asked == [0x400, 0x258, 0x264]
    bench.wire.check_gaps()


def test_bytes_before_the_first_request_are_nothing() -> None:
    bench = Bench()
    bench.wire.arrive(bench.wire.now, b'\xff\x00')
    assert bench.read(A).data == bench.answer_of(0)
    bench.wire.check_gaps()


def test_quarantine_of_one_unit_is_not_that_of_another() -> None:
    bench = Bench([Fate(1.5)])
    bench.link.use_resync_reads(2, (ONE, TWO))
    bench.expect(NoAnswer, lambda: bench.read(A))
    assert bench.read(B, unit=2).data == bench.answer_of(1)
    assert [request[0] for request in bench.slave.requests] == [1, 2]


# --- a line that never ends -----------------------------------------------------------------------


def babble(bench: Bench, byte: int, period: float) -> None:
    for number in range(int(10 / period)):
        bench.wire.arrive(bench.wire.now + number * period, bytes((byte,)))


@pytest.mark.parametrize('byte', [0x00, 0x01, 0x55, 0xFF])
@pytest.mark.parametrize('action', ['read', 'write'])
def test_babbling_line_is_no_reason_to_hang(byte: int, action: str) -> None:
    bench = Bench()
    bench.wire.far_end = lambda frame, end: None
    babble(bench, byte, SETTINGS.frame_gap / 2)
    start = bench.wire.now
    if action == 'read':
        error = bench.expect(NeverSilent, lambda: bench.read(A))
        assert 'never silent' in str(error)
    else:
        bench.expect(DamagedAnswer, lambda: bench.write(A, 1))
    # rather than not at all a write is sent into it
    assert len(bench.wire.sent) == (action == 'write')
    assert bench.wire.now - start < 3 * TIMEOUT


def test_line_that_begins_to_babble_is_no_reason_to_hang() -> None:
    bench = Bench()
    bench.wire.far_end = lambda frame, end: babble(bench, 0x55, SETTINGS.char_time)
    start = bench.wire.now
    bench.expect(DamagedAnswer, lambda: bench.read(A))
    assert bench.wire.now - start < 3 * TIMEOUT
    bench.expect(NeverSilent, lambda: bench.read(A))
    assert bench.wire.now - start < 6 * TIMEOUT


# --- whatever the slave does ----------------------------------------------------------------------

WHAT = ['answer', 'answer', 'answer', 'drop', 'refuse', 'damage', 'double', 'refuse twice']
FATES = st.lists(
    st.builds(
        Fate,
        st.one_of(st.just(0.0), st.floats(0, 3)),
        st.sampled_from(WHAT),
        st.booleans(),
    ),
    max_size=25,
)
#: Something to do, and how long to wait before it, in time-outs.
STEPS = st.lists(
    st.tuples(
        st.sampled_from(['A', 'B', 'C', 'D', 'write A', 'write B', 'write C']),
        st.one_of(st.just(0.0), st.just(0.0), st.floats(0, 4)),
    ),
    max_size=25,
)
NAMES = {'A': A, 'B': B, 'C': C, 'D': D}


def lumps_or_doubles(fates: list[Fate]) -> Iterator[Fate]:
    """Double no answer that comes in a lump late: nothing distinguishes it from the right one."""
    for fate in fates:
        twice = fate.what in ('double', 'refuse twice')
        yield Fate(fate.delay, fate.what, fate.lump and not twice)


@hypothesis_settings(max_examples=400)
@given(FATES, STEPS)
@example([Fate(2.9), Fate(2.5)], [('write B', 0.0), ('C', 0.0), ('write B', 0.0), ('A', 0.0)])
@example([Fate(0.97, lump=True)], [('write A', 0.0), ('write A', 0.0), ('A', 0.0)])
@example([Fate(1.5), Fate(1.5), Fate(1.5)], [('A', 0.0), ('B', 0.0), ('B', 0.0), ('B', 0.0)])
@example([Fate(1.5, 'refuse'), Fate(what='drop')], [('A', 0.0), ('B', 0.0), ('B', 0.0)])
def test_every_answer_belongs_to_its_request(
    fates: list[Fate], steps: list[tuple[str, float]]
) -> None:
    bench = Bench(list(lumps_or_doubles(fates)))
    sent = bench.wire.sent
    for what, pause in steps:
        bench.wire.now += pause * TIMEOUT
        address = NAMES[what[-1]]
        before = len(sent)
        is_write = what.startswith('write')
        try:
            if is_write:
                assert bench.write(address, *(7,) * (address.size // 2)).data == b''
            else:
                reply = bench.read(address).data
                assert bench.asked[-1] == address.index
                assert reply == bench.answer_of(len(sent) - 1)
        except Refused as refusal:
            assert bench.asked[-1] == address.index
            assert refusal.code == bench.slave.code(len(sent) - 1)
        except NotReady as refusal:
            assert not is_write
            assert len(sent) == before
            assert refusal.until > bench.wire.now
        except (NoAnswer, DamagedAnswer):
            pass
        assert len(sent) - before <= (1 if is_write else 2)
        if is_write:
            assert len(sent) == before + 1
    bench.wire.check_gaps()
