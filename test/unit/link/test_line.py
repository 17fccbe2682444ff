# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
One request after the other on a line in virtual time, by each protocol.

What differs is in ``test_modbus_line.py``, ``test_classic_line.py``, ``test_movitrac_line.py`` and
``test_canopen_link.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from dataclasses import replace
import heapq
import itertools
from typing import Any

import canopen_bench
from hypothesis import example, given, settings as hypothesis_settings, strategies as st
from line_bench import (
    UNIT,
    WAYS,
    Ascii,
    Bench,
    Classic,
    Movitrac,
    OldRtu,
    Rtu,
    of_each,
    of_named,
    same,
)
import pytest
from support.plans import followed
from virtual_wire import DROP, REFUSE, Fate, Wire, run_late

from nfo_sinus_driver.link.interface import (
    Address,
    DamagedAnswer,
    Identification,
    LineSettings,
    LinkError,
    NeverSilent,
    NoAnswer,
    NotReady,
    PortError,
    Refused,
)

Way = type[Bench]
#: The same on a bus whose messages are frames.
Canopen = canopen_bench.Bench
of_any = pytest.mark.parametrize('way', [*WAYS.values(), Canopen], ids=[*WAYS, 'canopen'])
#: Whose answers to a write do not say what was written.
of_unconfirmed = pytest.mark.parametrize(
    'way', [Classic, Movitrac, Canopen], ids=['classic', 'movitrac', 'canopen']
)
FAILED = (NoAnswer, DamagedAnswer)
LUMPS = pytest.mark.parametrize('lump', [False, True])
READ_AND_WRITE = pytest.mark.parametrize('action', ['read', 'write'])


def late(way: Way, more: float = 0.5, what: str = 'answer') -> Fate:
    """An answer that comes so many time-outs after it was given up."""
    return Fate(way.patience + more, what)


def act(bench: Bench, action: str, address: Address | None = None) -> Any:
    """Read or write a parameter."""
    return (bench.read if action == 'read' else bench.write)(address or bench.A)


# --- plain transactions ---------------------------------------------------------------------------


@LUMPS
@of_each
def test_read_and_write(way: Way, lump: bool) -> None:
    bench = way(*[Fate(lump=lump)] * 4)
    for address in (way.A, getattr(way, 'C', way.B), getattr(way, 'LONG', way.B)):
        value = (2 * way.VALUE)[: address.size]
        assert bench.read(address).data == bench.answer_of()
        assert bench.write(address, value).data == b''
        asked, written = bench.requests[-2:]
        assert asked[:4] == (UNIT, address.index, address.size, None)
        assert written[:4] == (UNIT, address.index, address.size, value)
    assert len(bench.asked) == 6


@of_any
def test_reply_says_when_its_last_byte_came(way: Way) -> None:
    bench = way(Fate(0.5), Fate(0.5))
    for action in ('read', 'write'):
        assert act(bench, action).arrived == bench.wire.now
        bench.wire.now += 1


@of_each
def test_no_time_is_lost_between_frames(way: Way) -> None:
    bench = way()
    bench.read(way.A)
    began = bench.wire.now
    for unit in range(1, 6):
        # no answer could be the one before
        bench.read(way.A, unit)
        bench.write(way.A, unit=unit)
    end = bench.wire.now
    frames = sum(len(frame) for _, frame in bench.wire.sent[1:])
    answers = sum(count for at, count in bench.wire.seen if at > began)
    gaps = 0 if way is Classic else 10 * bench.wire.gap
    assert end - began == pytest.approx((frames + answers) * bench.line.char_time + gaps)


@pytest.mark.parametrize('what', ['answer', 'refuse', 'drop', 'damage', 'double'])
@pytest.mark.parametrize('way', [Rtu, Ascii, Movitrac])
def test_silence_between_frames(way: Way, what: str) -> None:
    bench = way(*[Fate(what=what)] * 6)
    for action in ('read', 'write') * 3:
        with contextlib.suppress(LinkError):
            act(bench, action)
    assert len(bench.wire.sent) >= 5
    assert bench.wire.sent[0][0] - 1000.0 >= bench.wire.gap - 1e-9
    bench.wire.check_gaps()


@READ_AND_WRITE
@of_each
def test_time_out_counts_from_the_end_of_the_request(way: Way, action: str) -> None:
    bench = way(DROP)
    error = bench.expect(NoAnswer, lambda: act(bench, action))
    assert error.maybe_done and str(error) == 'unit 1 did not answer'
    ((start, frame),) = bench.wire.sent
    end = start + len(frame) * bench.line.char_time
    assert bench.wire.now - end == pytest.approx(way.patience * bench.line.response_timeout)


@of_each
def test_answer_just_in_time_is_taken_whole(way: Way) -> None:
    # the first byte counts: a long answer at 1200 bit/s takes longer than the time-out itself
    bench = way(Fate(0.5), settings=replace(way.settings, baud_rate=1200, response_timeout=0.02))
    assert bench.read(way.A).data == bench.answer_of()


def in_pieces(bench: Bench, pause: float, length: int = 3) -> None:
    """Have an adapter hand over answers in pieces, so many seconds one after the other."""
    arrive = bench.wire.arrive

    def arrive_so(at: float, data: bytes, *, lump: bool = False) -> float:
        for number, start in enumerate(range(0, len(data), length)):
            arrive(at + pause * number, data[start : start + length], lump=True)
        return at + pause * (len(data) // length)

    bench.wire.arrive = arrive_so  # type: ignore[method-assign]


@of_each
def test_pauses_that_an_adapter_makes_are_reported(way: Way) -> None:
    bench = way(settings=replace(way.settings, response_timeout=0.2))
    address = getattr(way, 'C', way.A)
    bench.read(address)
    in_pieces(bench, 0.06, length=5)
    assert bench.read(address).data == bench.answer_of()
    assert not bench.link.remarks.texts, 'a busy machine makes one now and then'
    assert [bench.read(address).data for _ in range(2)] == [bench.answer_of(2), bench.answer_of(3)]
    (remark,) = bench.link.remarks.texts
    assert 'latency timer' in remark


@of_each
def test_a_driver_that_did_not_run_within_answers_blames_no_adapter(way: Way) -> None:
    bench = way(settings=replace(way.settings, response_timeout=0.2))
    run_late(bench.wire)
    for _ in range(6):
        assert bench.read(way.A).data == bench.answer_of()
    assert not bench.link.remarks.texts


@READ_AND_WRITE
@of_each
def test_damaged_answer(way: Way, action: str) -> None:
    bench = way(Fate(what='damage'))
    error = bench.expect(DamagedAnswer, lambda: act(bench, action))
    assert error.maybe_done and 'bytes came that are no answer' in str(error)


@pytest.mark.parametrize('cut', [1, 4])
@of_each
def test_answer_that_stops_in_the_middle(way: Way, cut: int) -> None:
    bench = way()
    arrive = bench.wire.arrive
    bench.wire.arrive = lambda at, data, lump=False: arrive(at, data[:cut])  # type: ignore
    error = bench.expect(DamagedAnswer, lambda: bench.read(way.A))
    assert error.maybe_done and f'{cut} bytes' in str(error)
    assert bench.wire.now - bench.wire.sent[0][0] < 3 * bench.line.response_timeout


@of_any
def test_a_refusal_is_an_answer(way: Way) -> None:
    bench = way(REFUSE)
    error = bench.expect(Refused, lambda: bench.read(way.A))
    assert not error.maybe_done
    # there is nothing to doubt
    assert bench.read(way.A).data == bench.answer_of()
    assert bench.asked == [way.A.index] * 2


@of_any
def test_closing_ends_every_quarantine(way: Way) -> None:
    bench = way(DROP)
    bench.expect(NoAnswer, lambda: bench.read(way.A))
    bench.link.close()
    assert not bench.wire.is_open
    bench.link.open()
    assert bench.read(way.A).data == bench.answer_of()
    assert bench.asked == [way.A.index] * 2


@of_each
def test_opening_an_open_port_again_ends_none(way: Way) -> None:
    """A stuck adapter may pass on what it has held back."""
    bench = way(late(way))
    bench.expect(NoAnswer, lambda: bench.read(way.A))
    bench.link.open()
    with contextlib.suppress(DamagedAnswer):
        assert bench.read(way.A).data == bench.answer_of()
    assert bench.asked[:2] == list(way.lost[:2])


@READ_AND_WRITE
@of_each
def test_lost_port_is_passed_on(way: Way, action: str) -> None:
    for calls in range(4):
        bench = way(REFUSE if way is Classic else DROP)
        read, left = bench.wire.read, itertools.count(calls, -1)

        def gone(until: float, read: Any = read, left: Iterator[int] = left) -> bytes:
            if next(left) <= 0:
                raise PortError('gone')
            data: bytes = read(until)
            return data

        bench.wire.read = gone  # type: ignore[method-assign]
        with contextlib.suppress(NoAnswer, Refused):
            bench.expect(PortError, lambda bench=bench: act(bench, action))


@of_named
def test_nothing_is_asked_for_an_identity(way: Way) -> None:
    bench = way()
    assert followed(bench.link.identify(UNIT)) == Identification()
    assert bench.asked == []


@of_unconfirmed
def test_write_and_read_is_two_transactions(way: Way) -> None:
    bench = way()
    reply = bench.link.write_and_read(way.units[0], way.A, way.VALUE, way.B)
    assert reply.data == bench.answer_of()
    assert [(request.place, request.written is None) for request in bench.requests] == [
        (way.A.index, False),
        (way.B.index, True),
    ]


# --- late -----------------------------------------------------------------------------------------


@pytest.mark.parametrize('more', [0.05, 0.2, 1.0, 2.0])
@pytest.mark.parametrize('what', ['answer', 'refuse'])
@pytest.mark.parametrize('second', 'AB')
@of_any
def test_a_late_answer_is_not_taken_for_that_to_the_next_question(
    way: Way, second: str, what: str, more: float
) -> None:
    bench = way(late(way, more, what))
    bench.expect(NoAnswer, lambda: bench.read(way.A))
    address = getattr(way, second)
    for _ in range(50):
        try:
            reply = bench.read(address).data
        except (NoAnswer, DamagedAnswer, NotReady):
            bench.wire.now += 0.1 * bench.line.response_timeout
            continue
        assert bench.asked[-1] == address.index and reply == bench.answer_of()
        # and what answered has cleared the line
        asked = len(bench.asked)
        assert bench.read(way.A).data == bench.answer_of()
        assert len(bench.asked) == asked + 1
        return
    raise AssertionError('never answered')


@pytest.mark.parametrize('more', [0.05, 0.2, 1.0, 2.0])
@pytest.mark.parametrize('what', ['answer', 'refuse'])
@pytest.mark.parametrize('second', 'AB')
@of_any
def test_a_late_answer_to_a_write_is_not_taken_for_that_to_another(
    way: Way, second: str, what: str, more: float
) -> None:
    bench = way(late(way, more, what), DROP)
    bench.expect(NoAnswer, lambda: bench.write(way.A))
    # the second is lost on the way: were the late answer believed, it would count as done
    address, value = getattr(way, second), way.VALUE[::-1]
    assert bench.expect(FAILED, lambda: bench.write(address, value)).maybe_done


@of_any
def test_a_write_goes_out_at_once_whatever_is_in_quarantine(way: Way) -> None:
    for lost in range(6):
        bench = way(*[DROP] * lost)
        for _ in range(lost):
            with contextlib.suppress(NotReady):
                bench.expect(NoAnswer, lambda bench=bench: bench.read(way.A))
        before, asked = bench.wire.now, len(bench.asked)
        # a read leaves no confirmation in doubt
        assert bench.write(way.A).data == b''
        assert bench.sent_at[asked] - before <= bench.wire.gap + 1e-9
        assert bench.asked[asked:] == [way.A.index]


@of_unconfirmed
def test_a_write_in_doubt_clears_the_line(way: Way) -> None:
    bench = way(DROP)
    bench.expect(NoAnswer, lambda: bench.write(way.A))
    start = bench.wire.now
    with pytest.raises(DamagedAnswer, match='an earlier request') as raised:
        bench.write(way.A)
    assert raised.value.maybe_done
    assert bench.sent_at[1] == start
    assert bench.asked == [way.A.index, way.A.index, way.lost[1]]
    bench.write(way.A)
    assert len(bench.asked) == 4


@pytest.mark.parametrize('what', ['drop', 'damage'])
@of_each
def test_a_stop_that_failed_is_given_again_before_anything_is_read(way: Way, what: str) -> None:
    bench = way(*[Fate(what=what)] * 2)
    for _ in range(2):
        before = bench.wire.now
        bench.expect(FAILED, lambda: bench.write(way.A))
        assert bench.sent_at[-1] - before <= bench.wire.gap + 1e-9
    assert bench.asked == [way.A.index] * 2


@of_any
def test_however_many_answers_are_lost_something_is_asked_at_once(way: Way) -> None:
    bench = way(*[DROP] * 30)
    if issubclass(way, Rtu):
        bench.link.use_resync_reads(UNIT, [Rtu.TWO, Rtu.ONE])
    for _ in range(30):
        before = bench.wire.now
        bench.expect(NoAnswer, lambda: bench.read(way.A))
        assert bench.sent_at[-1] - before <= bench.wire.gap + 1e-9
    assert bench.asked[: len(way.lost)] == list(way.lost)
    assert bench.read(way.B).data == bench.answer_of()


@of_any
def test_a_resync_read_that_fails_has_done_nothing(way: Way) -> None:
    bench = way(DROP, DROP)
    first, second = (bench.expect(NoAnswer, lambda: bench.read(way.A)) for _ in range(2))
    assert first.maybe_done and not second.maybe_done
    bench.drive.heal(Fate(), DROP)
    third = bench.expect(NoAnswer, lambda: bench.read(way.A))
    assert third.responded, 'it is there: it answered the question before'
    assert third.maybe_done


@of_any
def test_a_stop_goes_between_a_resync_read_and_its_request(way: Way) -> None:
    bench = way(DROP)
    bench.expect(NoAnswer, lambda: bench.read(way.A))
    bench.link.end_listening_if(lambda: len(bench.asked) > 1)
    with pytest.raises(NotReady):
        bench.read(way.A)
    assert bench.asked == list(way.lost[:2])


@of_any
def test_quarantine_of_one_unit_is_not_that_of_another(way: Way) -> None:
    bench = way()
    for unit in way.units:
        bench.read(way.A, unit)
    bench.drive.heal(DROP, DROP)
    bench.expect(NoAnswer, lambda: bench.read(way.A))
    bench.expect(NoAnswer, lambda: bench.write(way.A))
    assert bench.read(way.A, way.units[1]).data == bench.answer_of()
    bench.write(way.A, unit=way.units[1])
    assert bench.asked == [way.A.index] * 6


# --- twice, and unrequested -----------------------------------------------------------------------


@LUMPS
@pytest.mark.parametrize('what', ['double', 'refuse twice'])
@pytest.mark.parametrize('second', 'AB')
@of_each
def test_an_answer_sent_twice_is_taken_once(way: Way, second: str, what: str, lump: bool) -> None:
    bench = way(Fate(what=what, lump=lump))
    with contextlib.suppress(Refused):
        assert bench.read(way.A).data == bench.answer_of()
    for _ in range(2):
        assert bench.read(getattr(way, second)).data == bench.answer_of()


@LUMPS
@of_named
def test_a_confirmation_sent_twice_is_taken_once(way: Way, lump: bool) -> None:
    bench = way(Fate(what='double', lump=lump), DROP)
    bench.write(way.A)
    bench.expect(FAILED, lambda: bench.write(way.B))


@LUMPS
@of_each
def test_an_answer_sent_twice_is_not_taken_for_that_of_another_drive(way: Way, lump: bool) -> None:
    bench = way(Fate(what='double', lump=lump))
    bench.read(way.A, unit=1)
    # on Classic it may break into the next request: there is no gap before that
    with contextlib.suppress(DamagedAnswer):
        assert bench.read(way.A, unit=2).data == bench.answer_of()


@of_each
def test_the_same_question_on_a_line_without_speed(way: Way) -> None:
    bench = way()
    bench.drive.pace = 0.0
    for _ in range(5):
        assert bench.read(way.A).data == bench.answer_of()
        bench.write(way.A)
        bench.write(way.B)


@of_each
def test_unrequested_bytes_put_reads_in_quarantine(way: Way) -> None:
    bench = way()
    bench.read(way.A)
    bench.wire.now += 1
    bench.wire.arrive(bench.wire.now - 0.1, b'\x01\x03\x02')
    assert bench.read(way.A).data == bench.answer_of()
    assert bench.asked == [way.A.index, way.lost[1], way.A.index]
    # before the first request there is nothing to doubt
    bench = way()
    bench.wire.arrive(bench.wire.now, b'\x01\x03\x02')
    assert bench.read(way.A).data == bench.answer_of(0)


# --- a line that is never silent ------------------------------------------------------------------


def babble(wire: Wire, byte: int, period: float) -> None:
    for number in range(int(3 / period)):
        wire.arrive(wire.now + number * period, bytes((byte,)))


@pytest.mark.parametrize(('baud', 'byte'), [(9600, 0x01), (57600, 0x55), (9600, 0xFF)])
@READ_AND_WRITE
@of_each
def test_a_line_that_is_never_silent(way: Way, action: str, baud: int, byte: int) -> None:
    bench = way(settings=replace(way.settings, baud_rate=baud))
    bench.read(way.B)
    babble(bench.wire, byte, min(bench.wire.gap, bench.line.char_time) / 2)
    before = bench.wire.now
    if action == 'read' and way is not Classic:
        error = bench.expect(NeverSilent, lambda: bench.read(way.A))
        assert not error.maybe_done and 'never silent' in str(error)
        error = bench.expect(NeverSilent, lambda: bench.read_then_write(way.B, way.A))
        assert not error.maybe_done
        assert len(bench.asked) == 1
    else:
        # Classic wants no gap; a write is sent into the noise rather than not at all
        bench.wire.far_end = lambda frame, end: None
        error = bench.expect(DamagedAnswer, lambda: act(bench, action))
        assert error.maybe_done and len(bench.wire.sent) == 2
        longest = 0.0 if way is Classic else max(0.02, 17 * bench.line.char_time)
        assert bench.wire.sent[1][0] - before <= 3 * bench.wire.gap + longest
    assert bench.wire.now - before < 8 * bench.line.response_timeout


@of_each
def test_a_line_that_begins_to_babble_is_no_reason_to_hang(way: Way) -> None:
    bench = way()
    bench.wire.far_end = lambda frame, end: babble(bench.wire, 0x55, bench.line.char_time)
    start = bench.wire.now
    bench.expect(DamagedAnswer, lambda: bench.read(way.A))
    assert bench.wire.now - start < 4 * bench.line.response_timeout


# --- a line that echoes ---------------------------------------------------------------------------


@LUMPS
@of_each
def test_reads_and_writes_with_an_echo(way: Way, lump: bool) -> None:
    bench = way(*[Fate(lump=lump)] * 8)
    bench.drive.echo = same
    for _ in range(2):
        for address in (way.A, getattr(way, 'LONG', way.B)):
            assert bench.read(address).data == bench.answer_of()
            assert bench.write(address, (2 * way.VALUE)[: address.size]).data == b''
    # nothing had to be resynchronised
    assert len(bench.asked) == 8


@of_each
def test_silence_behind_an_echo_is_silence(way: Way) -> None:
    # even where the echo is noticed by it
    bench = way(*[DROP] * 2)
    bench.drive.echo = same
    for action in ('read', 'write'):
        bench.expect(NoAnswer, lambda action=action: act(bench, action))
    # and where it came behind noise
    bench = way(Fate(), DROP)
    bench.drive.response_time = 0.01
    bench.drive.echo = lambda frame: b'\x00\xff' + frame
    assert bench.read(way.A).data == bench.answer_of()
    bench.expect(FAILED, lambda: bench.write(way.A))


@pytest.mark.parametrize(('what', 'error'), [('refuse', Refused), ('damage', DamagedAnswer)])
@of_each
def test_what_comes_behind_an_echo(way: Way, what: str, error: type[LinkError]) -> None:
    bench = way(Fate(), Fate(what=what))
    bench.drive.echo = same
    bench.read(way.A)
    bench.expect(error, lambda: bench.read(way.A))
    bench.drive.heal(Fate(what=what))
    bench.expect(error, lambda: bench.write(way.A))


@of_each
def test_what_comes_before_an_echo_is_no_answer(way: Way) -> None:
    other = way()
    other.read(way.B)
    request = other.wire.unpack(other.wire.sent[0][1])
    bench = way()
    bench.drive.echo = same
    bench.read(way.A)
    answer = bench.drive.answer(bench.drive.parsed(request), request, 0)
    bench.drive.heal(DROP)
    bench.drive.echo = lambda frame: bench.wire.pack(answer) + frame
    bench.expect(FAILED, lambda: bench.read(way.B))


@pytest.mark.parametrize('what', ['cut', 'spoilt', 'nothing'])
@of_each
def test_damaged_echo(way: Way, what: str) -> None:
    bench = way()
    bench.drive.echo = same
    bench.read(way.A)
    bench.drive.echo = {
        'cut': lambda frame: frame[1:],
        'spoilt': lambda frame: frame[:3] + b'\x7f' + frame[4:],
        'nothing': lambda frame: b'',
    }[what]
    # what came may be the echo or the answer: it is not believed
    bench.expect(FAILED, lambda: bench.write(way.A))
    if what != 'nothing':
        bench.drive.echo = same
    # the next read tells whether there is an echo at all
    for _ in range(2):
        bench.wire.now += 1
        assert bench.read(way.A).data == bench.answer_of()
    assert bench.write(way.B).data == b''


@of_each
def test_an_adapter_that_echoes_no_more(way: Way) -> None:
    bench = way()
    bench.drive.echo = same
    bench.read(way.A)
    bench.drive.echo = lambda frame: b''
    with contextlib.suppress(DamagedAnswer):
        assert bench.read(way.A).data == bench.answer_of()
    for _ in range(3):
        bench.wire.now += 1
        assert bench.read(way.A).data == bench.answer_of()


@of_each
def test_a_late_answer_behind_an_echo(way: Way) -> None:
    bench = way(Fate(), late(way))
    bench.drive.echo = same
    bench.read(way.B)
    bench.expect(NoAnswer, lambda: bench.read(way.A))
    with contextlib.suppress(DamagedAnswer):
        assert bench.read(way.A).data == bench.answer_of()
    assert bench.asked[2] == way.lost[1]


@of_each
def test_closing_forgets_the_echo(way: Way) -> None:
    bench = way()
    bench.drive.echo = same
    bench.read(way.A)
    bench.link.close()
    bench.link.open()
    bench.drive.echo = lambda frame: b''
    before = bench.wire.now
    assert bench.write(way.A).data == b''
    assert bench.wire.now - before < bench.line.response_timeout


# --- a read that does something, and a write as the very next frame ------------------------------


@pytest.mark.parametrize(
    'fate',
    [
        Fate(),
        DROP,
        Fate(what='damage'),
        Fate(1.5),
        Fate(what='double'),
        Fate(what='double', lump=True),
        Fate(what='double', again=0.1),
        REFUSE,
        Fate(what='refuse twice', again=0.1),
    ],
    ids=str,
)
@of_any
def test_a_write_is_the_very_next_frame(way: Way, fate: Fate) -> None:
    if way.names_it and fate.what == 'refuse twice':
        # a second one behind the gap would refuse the write, for it names nothing
        fate = replace(fate, again=0.0)
    bench = way(fate)
    assert bench.read_then_write(way.B, way.A).data == b''
    assert [(request.place, request.written is None) for request in bench.requests] == [
        (way.B.index, True),
        (way.A.index, False),
    ]
    if fate.what.startswith('refuse'):
        heard = [at for at, _ in bench.wire.seen if at <= bench.sent_at[-1]][-1]
        assert bench.sent_at[-1] - heard <= max(0.003, bench.wire.gap + 1e-9)
    # and what is read then belongs to its question
    assert bench.read(way.B).data == bench.answer_of()


@of_any
def test_no_resync_read_goes_before_it(way: Way) -> None:
    bench = way(*[DROP] * 3)
    for _ in range(3):
        bench.expect(NoAnswer, lambda: bench.read(way.B))
    began = bench.wire.now
    bench.read_then_write(way.B, way.A)
    assert bench.asked[3:] == [way.B.index, way.A.index]
    assert bench.sent_at[3] - began <= bench.wire.gap + 1e-9


@pytest.mark.parametrize(
    ('fate', 'error'),
    [(DROP, NoAnswer), (Fate(what='damage'), DamagedAnswer), (REFUSE, Refused)],
)
@of_each
def test_its_error_is_that_of_the_write_and_the_read_may_have_been_done(
    way: Way, fate: Fate, error: type[LinkError]
) -> None:
    bench = way(Fate(), fate)
    assert bench.expect(error, lambda: bench.read_then_write(way.B, way.A)).maybe_done
    assert not Refused.maybe_done
    assert bench.asked[:2] == [way.B.index, way.A.index]


@of_each
def test_a_lost_port_ends_it(way: Way) -> None:
    bench = way()

    def gone(until: float) -> bytes:
        if bench.asked:
            raise PortError('gone')
        bench.wire.now = max(until, bench.wire.now)
        return b''

    bench.wire.read = gone  # type: ignore[method-assign]
    bench.expect(PortError, lambda: bench.read_then_write(way.B, way.A))
    assert bench.asked == [way.B.index]


# --- whatever the drives do -----------------------------------------------------------------------

WHAT = ['answer', 'answer', 'answer', 'drop', 'refuse', 'damage', 'double', 'refuse twice']
DELAYS = st.one_of(st.just(0.0), st.floats(0, 3))
FATES = st.lists(st.builds(Fate, DELAYS, st.sampled_from(WHAT), st.booleans()), max_size=25)
#: Something to do, and how long to wait before it, in time-outs.
STEPS = st.lists(
    st.tuples(
        st.sampled_from(['read A', 'read B', 'read C', 'write A', 'write B', 'write C']),
        st.one_of(st.just(0.0), st.just(0.0), st.floats(0, 4)),
    ),
    max_size=25,
)


def parameters(way: Way) -> dict[str, Address]:
    """Return two parameters whose answers look the same, and one of another length or kind."""
    third = {Classic: Classic.INV_ST, Movitrac: Movitrac.LONG, Canopen: canopen_bench.TEXT}
    return {'A': way.A, 'B': way.B, 'C': third.get(way, Rtu.C)}


@pytest.mark.parametrize('way', [*WAYS.values(), OldRtu, Canopen], ids=[*WAYS, 'old', 'canopen'])
@hypothesis_settings(max_examples=400)
@given(FATES, STEPS, st.booleans(), st.sampled_from([0.0, 0.01, 0.2]))
@example([Fate(1.2), DROP], [('write A', 0.0), ('write B', 0.0)], False, 0.0)
@example([Fate(2.2), DROP], [('write A', 0.0), ('write B', 0.0)], False, 0.0)
@example([Fate(1.5)] * 3, [('read A', 0.0)] + [('read B', 0.0)] * 3, False, 0.0)
@example([Fate(1.5, 'refuse'), DROP], [('read A', 0.0)] + [('read B', 0.0)] * 2, False, 0.0)
@example([Fate(what='refuse twice')], [('read A', 0.0), ('read B', 0.0)], False, 0.0)
@example(
    [Fate(2.9), Fate(2.5)],
    [('write B', 0.0), ('read C', 0.0), ('write B', 0.0), ('read A', 0.0)],
    False,
    0.0,
)
@example(
    [Fate(0.97, lump=True)], [('write A', 0.0), ('write A', 0.0), ('read A', 0.0)], False, 0.0
)
@example(
    # three answers repeated at once: the line has no gap for longer than a write waits
    [Fate(3.0, 'double'), Fate(what='double'), Fate(what='double')],
    [('write A', 0.0), ('read C', 0.0), ('write A', 0.0), ('write A', 0.0)],
    False,
    0.0,
)
def test_every_answer_belongs_to_its_request(
    way: Way, fates: list[Fate], steps: list[tuple[str, float]], echo: bool, response_time: float
) -> None:
    bench = way(*way.distinct(fates))
    if way.patience > 1:
        bench.drive.response_time = response_time
    if echo and way in (Classic, Movitrac):
        bench.drive.echo = same
    timeout = bench.line.response_timeout
    for what, pause in steps:
        bench.wire.now += pause * timeout
        address = parameters(way)[what[-1]]
        value = (2 * way.VALUE)[: address.size]
        is_write = what.startswith('write')
        before = len(bench.requests)
        try:
            if is_write:
                assert bench.write(address, value).data == b''
                # one transaction, and this very one was confirmed
                assert len(bench.requests) == before + 1
                assert not way.names_it or bench.requests[-1].fate in ('answer', 'double')
            else:
                reply = bench.read(address).data
                assert bench.requests[-1].place == address.index
                assert reply == bench.answer_of()
        except Refused as refusal:
            refused = before if is_write else len(bench.requests) - 1
            assert bench.requests[refused].place == address.index
            assert bench.is_refusal_of(refusal, refused)
        except NotReady as refusal:
            assert not is_write
            assert len(bench.requests) == before
            assert bench.wire.now < refusal.until <= bench.wire.now + timeout + 1e-9
        except (NoAnswer, DamagedAnswer) as error:
            resynced = len(bench.requests) == before or bench.requests[-1].place != address.index
            assert error.maybe_done or resynced
        assert len(bench.requests) - before <= way.most[not is_write]
        if is_write:
            assert bench.requests[before].place == address.index
            assert bench.requests[before].written is not None
    if way not in (Classic, Canopen):
        bench.wire.check_gaps()


@pytest.mark.parametrize('way', WAYS.values(), ids=WAYS)
@hypothesis_settings(max_examples=200)
@given(
    st.lists(st.builds(Fate, st.floats(0, 3), st.sampled_from(['answer', 'drop'])), max_size=25),
    st.lists(st.sampled_from('ABC'), max_size=25),
)
def test_no_request_waits_where_answers_are_only_lost_or_late(
    way: Way, fates: list[Fate], names: list[str]
) -> None:
    bench = way(*fates)
    for name in names:
        before, sent = bench.wire.now, len(bench.wire.sent)
        with contextlib.suppress(NoAnswer, DamagedAnswer):
            reply = bench.read(parameters(way)[name]).data
            assert reply == bench.answer_of()
        # a late answer may have to end first
        first = bench.wire.sent[sent][0]
        assert first - before <= 2 * bench.wire.gap + 17 * bench.line.char_time


# --- bursts ---------------------------------------------------------------------------------------


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


@pytest.mark.parametrize('noise', [False, True])
@pytest.mark.parametrize('rate', [19200, 57600])
@pytest.mark.parametrize('way', [Rtu, Ascii, Classic])
@hypothesis_settings(max_examples=60)
@given(
    burst=st.floats(0.05, 1.0),
    begin=st.floats(0.0, 0.05),
    names=st.sampled_from(['AB', 'AC', 'CB']),
)
def test_after_a_burst_the_line_is_used_and_the_status_known_at_once(
    way: Way, rate: int, noise: bool, burst: float, begin: float, names: str
) -> None:
    bench = way(settings=LineSettings(rate, way.settings.char_format, 0.2))
    end = bench.wire.now + begin + burst
    lose(bench.wire, end - burst, end, noise=noise)
    done = 0
    while done < 2 or bench.wire.now < end:
        try:
            bench.read(parameters(way)[names[done % 2]])
            done = done + 1 if bench.wire.now >= end else 0
        except NotReady as error:
            bench.wire.now = error.until
        except LinkError:
            pass
    first = next(at for at, _ in bench.wire.sent if at >= end)
    assert first - end <= 0.25
    assert bench.wire.now - first <= 0.2
