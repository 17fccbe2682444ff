# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Late, doubled and damaged answers of MOVITRACs, whatever the drives do."""

from __future__ import annotations

from collections.abc import Iterator

from hypothesis import example, given, settings as hypothesis_settings, strategies as st
from movitrac_bench import CHAR, LONG, RESYNC, TIMEOUT, VALUE, A, B, Bench
from movitrac_far_end import Fate
import pytest

from nfo_sinus_driver.link.interface import DamagedAnswer, LinkError, NoAnswer, NotReady, Refused

#: A drive that is not known yet is waited for two time-outs.
LATE = [2.2, 3.0, 4.0]
DROP = Fate(what='drop')


# --- late -----------------------------------------------------------------------------------------


@pytest.mark.parametrize('late', LATE)
def test_late_value_is_not_taken_for_the_answer_to_the_same_question(late: float) -> None:
    bench = Bench(Fate(late))
    with pytest.raises(NoAnswer):
        bench.read(A)
    for _ in range(50):
        try:
            reply = bench.read(A).data
        except (NoAnswer, DamagedAnswer, NotReady):
            bench.wire.now += 0.1 * TIMEOUT
            continue
        assert bench.asked[-1] == A.index
        assert reply == bench.answer_of(len(bench.asked) - 1)
        return
    raise AssertionError('never answered')


@pytest.mark.parametrize('late', LATE)
def test_late_ack_is_not_taken_for_the_answer_to_another_write(late: float) -> None:
    bench = Bench(Fate(late), DROP)
    with pytest.raises(NoAnswer):
        bench.write(A)
    # the second is lost on the way: were the late ACK believed, it would count as done
    with pytest.raises((NoAnswer, DamagedAnswer)) as raised:
        bench.write(B)
    assert raised.value.maybe_done


def test_a_write_in_doubt_goes_out_at_once_and_clears_the_line() -> None:
    bench = Bench(DROP)
    with pytest.raises(NoAnswer):
        bench.write(A)
    start = bench.wire.now
    with pytest.raises(DamagedAnswer, match='an earlier request') as raised:
        bench.write(A)
    assert raised.value.maybe_done
    assert bench.wire.sent[1][0] == start
    assert bench.asked == [A.index, A.index, RESYNC]
    bench.write(A)
    assert len(bench.asked) == 4


def test_a_write_after_a_silent_read_is_believed() -> None:
    bench = Bench(DROP)
    with pytest.raises(NoAnswer):
        bench.read(A)
    bench.write(A)
    assert bench.asked == [A.index, A.index]


def test_late_nack_is_not_taken_for_the_answer_to_another_question() -> None:
    for act in (lambda bench: bench.read(B), lambda bench: bench.write(B)):
        bench = Bench(Fate(2.2, 'refuse'))
        with pytest.raises(NoAnswer):
            bench.read(A)
        try:
            act(bench)
        except DamagedAnswer as error:
            assert error.maybe_done


def test_four_questions_are_enough_for_one_to_be_certain() -> None:
    bench = Bench(*[DROP] * 9)
    for _ in range(9):
        try:
            bench.read(A)
        except NoAnswer:
            continue
    assert len(bench.asked) == 9, 'the line was left unused'
    assert bench.asked[:4] == [A.index, 206, 207, A.index]
    assert bench.read(B).data == bench.answer_of(len(bench.asked) - 1)


def test_a_resync_read_that_fails_has_done_nothing() -> None:
    bench = Bench(DROP, DROP)
    with pytest.raises(NoAnswer) as first:
        bench.read(A)
    with pytest.raises(NoAnswer) as second:
        bench.read(A)
    assert first.value.maybe_done and not second.value.maybe_done
    bench.drive.heal(Fate(), DROP)
    with pytest.raises(NoAnswer) as third:
        bench.read(A)
    assert third.value.responded, 'it is there: it answered the question before'


def test_closing_ends_every_quarantine() -> None:
    bench = Bench(DROP)
    with pytest.raises(NoAnswer):
        bench.read(A)
    bench.link.close()
    bench.link.open()
    bench.read(A)
    assert bench.asked == [A.index, A.index]


# --- other drives on the line ---------------------------------------------------------------------


def test_a_dead_drive_costs_its_neighbours_no_request() -> None:
    bench = Bench()
    for unit in (1, 2):
        bench.read(A, unit)
    bench.drive.heal(DROP, DROP)
    with pytest.raises(NoAnswer):
        bench.read(A, unit=1)
    with pytest.raises(NoAnswer):
        bench.write(A, unit=1)
    began = bench.wire.now
    assert bench.read(A, unit=2).data == bench.answer_of(len(bench.asked) - 1)
    bench.write(A, unit=2)
    assert bench.asked == [A.index] * 6
    # and hardly any time
    assert bench.wire.now - began < (5 + 8 + 9 + 2 + 4 + 3) * CHAR


@pytest.mark.parametrize('written', [False, True])
def test_late_answer_of_another_drive_is_not_taken(written: bool) -> None:
    bench = Bench()
    bench.drive.response_time = 0.03
    for unit in (1, 2):
        bench.read(A, unit)
    # it comes while the other one is asked for the same
    bench.drive.heal(Fate(1.1))
    act = bench.write if written else bench.read
    with pytest.raises(NoAnswer):
        act(A, unit=1)
    with pytest.raises(DamagedAnswer, match='two answers came, one of them is late') as raised:
        act(A, unit=2)
    assert raised.value.maybe_done
    for _ in range(2):
        bench.wire.now += 1
        assert bench.read(A, unit=2).data == bench.answer_of(len(bench.asked) - 1)
        bench.write(A, unit=2)


def test_late_answer_of_another_drive_to_another_question_does_not_matter() -> None:
    bench = Bench()
    bench.drive.response_time = 0.03
    for unit in (1, 2):
        bench.read(A, unit)
    bench.drive.heal(Fate(1.1))
    with pytest.raises(NoAnswer):
        bench.read(A, unit=1)
    assert bench.read(B, unit=2).data == bench.answer_of(len(bench.asked) - 1)


# --- twice ----------------------------------------------------------------------------------------


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_value(lump: bool) -> None:
    bench = Bench(Fate(what='double', lump=lump))
    bench.read(A)
    assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)
    assert bench.asked == [A.index, RESYNC, A.index]


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_value_is_not_taken_for_that_of_another_drive(lump: bool) -> None:
    bench = Bench(Fate(what='double', lump=lump), Fate())
    bench.read(A, unit=1)
    assert bench.read(A, unit=2).data == bench.answer_of(1)


def test_value_sent_again_before_it_can_be_the_answer() -> None:
    bench = Bench()
    bench.read(A)
    again = bytes.fromhex('C8 00 19') + bench.answer_of(0)
    again += bytes((sum(again) % 256,))
    bench.drive.response_time = 0.03
    # behind the gap, while the next request is on its way
    bench.wire.arrive(bench.wire.now + 2.5 * CHAR, again)
    bench.wire.now += 2.2 * CHAR
    with pytest.raises(DamagedAnswer, match='two answers came'):
        bench.read(A, unit=2)


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_ack(lump: bool) -> None:
    bench = Bench(Fate(what='double', lump=lump), DROP)
    bench.write(A)
    with pytest.raises((NoAnswer, DamagedAnswer)):
        bench.write(B)


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_nack(lump: bool) -> None:
    bench = Bench(Fate(what='refuse twice', lump=lump))
    with pytest.raises(Refused):
        bench.read(A)
    assert bench.read(B).data == bench.answer_of(1)


def test_the_same_question_on_a_line_without_speed() -> None:
    bench = Bench()
    bench.drive.pace = 0.0
    for number in range(5):
        assert bench.read(A).data == bench.answer_of(3 * number)
        bench.write(A)
        bench.write(B)
    assert bench.asked == [A.index, A.index, B.index] * 5


def test_unrequested_bytes_put_reads_in_quarantine() -> None:
    bench = Bench()
    bench.read(A)
    bench.wire.now += 1
    bench.wire.arrive(bench.wire.now - 0.1, b'\xc8\x00')
    assert bench.read(A).data == bench.answer_of(2)
    assert bench.asked == [A.index, RESYNC, A.index]


# --- whatever happens -----------------------------------------------------------------------------

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
STEPS = st.lists(
    st.tuples(
        st.sampled_from(['A', 'B', 'long', 'address', 'write A', 'write B']),
        st.one_of(st.just(0.0), st.just(0.0), st.floats(0, 4)),
    ),
    max_size=25,
)
NAMES = {'A': A, 'B': B, 'long': LONG, 'address': A._replace(index=RESYNC)}


@hypothesis_settings(max_examples=400)
@given(FATES, STEPS, st.booleans(), st.sampled_from([0.0, 0.01, 0.2]))
@example([Fate(2.2), DROP], [('write A', 0.0), ('write B', 0.0)], False, 0.0)
@example([Fate(2.5), Fate(2.5), Fate(2.5)], [('A', 0.0), ('B', 0.0), ('B', 0.0)], False, 0.0)
@example([Fate(what='refuse twice')], [('A', 0.0), ('B', 0.0)], False, 0.0)
def test_every_answer_belongs_to_its_request(
    fates: list[Fate], steps: list[tuple[str, float]], echo: bool, response_time: float
) -> None:
    bench = Bench(*fates)
    bench.drive.echo = echo
    bench.drive.response_time = response_time
    requests = bench.drive.requests
    for what, pause in steps:
        bench.wire.now += pause * TIMEOUT
        address = NAMES[what.split()[-1]]
        before = len(requests)
        try:
            if what.startswith('write'):
                assert bench.write(address).data == b''
                # one transaction, and this very one was confirmed
                assert len(requests) == before + 1
                assert requests[before][3] in ('answer', 'double')
            else:
                reply = bench.read(address).data
                assert requests[-1][1] == address.index
                assert reply == bench.answer_of(len(requests) - 1)
        except Refused:
            refused = before if what.startswith('write') else len(requests) - 1
            assert requests[refused][1] == address.index
            assert requests[refused][3].startswith('refuse')
        except NotReady as refusal:
            assert not what.startswith('write')
            assert len(requests) == before
            assert refusal.until > bench.wire.now
        except (NoAnswer, DamagedAnswer) as error:
            assert isinstance(error, LinkError)
            assert error.maybe_done or requests[-1][1] != address.index
        assert len(requests) - before <= 2
        if what.startswith('write'):
            assert requests[before][1:3] == (address.index, VALUE)


@hypothesis_settings(max_examples=400)
@given(
    st.lists(st.builds(Fate, st.floats(0, 3)), max_size=5),
    st.lists(st.tuples(st.sampled_from([1, 2, 3]), st.sampled_from([A, B])), max_size=20),
    st.sampled_from([0.01, 0.2]),
)
@example([Fate(2.1)], [(1, A), (2, A), (1, A), (2, A)], 0.03)
def test_no_value_is_that_of_another_drive(
    late: list[Fate], steps: list[tuple[int, object]], response_time: float
) -> None:
    bench = Bench()
    bench.drive.response_time = response_time

    def one_at_a_time() -> Iterator[Fate]:
        # however late: of two that are, neither names the drive that it comes from
        there = 0.0
        for fate in late:
            while bench.wire.now < there:
                yield Fate()
            there = bench.wire.now + (fate.delay + 1) * TIMEOUT + response_time
            yield fate

    bench.drive.meet(one_at_a_time())
    for unit, address in steps:
        assert isinstance(address, type(A))
        try:
            reply = bench.read(address, unit).data
        except (NoAnswer, DamagedAnswer, NotReady):
            bench.wire.now += 0.1 * TIMEOUT
            continue
        assert bench.drive.requests[-1][:2] == (unit, address.index)
        assert reply == bench.answer_of(len(bench.asked) - 1)
