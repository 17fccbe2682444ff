# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Late, doubled and damaged answers over Classic, whatever the drive does."""

from __future__ import annotations

from classic_far_end import INV_ST, Fate
from classic_link_bench import MODE, TIMEOUT, A, B, Bench
from hypothesis import example, given, settings as hypothesis_settings, strategies as st
import pytest
from support.addresses import classic_id

from nfo_sinus_driver.link.interface import (
    Address,
    DamagedAnswer,
    LineSettings,
    LinkError,
    NoAnswer,
    NotReady,
    Refused,
)

# --- quarantine -----------------------------------------------------------------------------------


@pytest.mark.parametrize('late', [1.2, 2.0, 3.0])
def test_late_reply_is_not_taken_for_the_answer_to_the_same_question(late: float) -> None:
    bench = Bench(Fate(late))
    with pytest.raises(NoAnswer):
        bench.read(A)
    for _ in range(50):
        try:
            reply = bench.read(A).data
        except (NoAnswer, DamagedAnswer, NotReady):
            bench.wire.now += 0.1 * TIMEOUT
            continue
        assert bench.asked[-1] == 0x1E
        assert reply == bench.answer_of(len(bench.asked) - 1)
        return
    raise AssertionError('never answered')


@pytest.mark.parametrize('late', [1.05, 1.2, 2.0, 3.0])
def test_late_reply_is_not_taken_for_the_answer_to_another_question(late: float) -> None:
    bench = Bench(Fate(late))
    with pytest.raises(NoAnswer):
        bench.read(A)
    try:
        reply = bench.read(B).data
    except (NoAnswer, DamagedAnswer):
        return
    assert reply == bench.answer_of(1)
    # and what answered has cleared the line
    assert bench.read(A).data == bench.answer_of(2)
    assert bench.asked == [0x1E, 0xB6, 0x1E]


@pytest.mark.parametrize('late', [1.05, 1.2, 2.0, 3.0])
def test_late_ack_is_not_taken_for_the_answer_to_another_write(late: float) -> None:
    bench = Bench(Fate(late), Fate(what='drop'))
    with pytest.raises(NoAnswer):
        bench.write(A, 1)
    # the second is lost on the way: were the late ACK believed, it would count as done
    with pytest.raises((NoAnswer, DamagedAnswer)) as raised:
        bench.write(B, 2)
    assert raised.value.maybe_done


def test_a_write_in_doubt_goes_out_at_once_and_clears_the_line() -> None:
    bench = Bench(Fate(what='drop'))
    with pytest.raises(NoAnswer):
        bench.write(A, 1)
    start = bench.wire.now
    with pytest.raises(DamagedAnswer, match='an earlier request'):
        bench.write(A, 1)
    assert bench.wire.sent[1][0] == start
    assert bench.asked == [0x1E, 0x1E, INV_ST]
    bench.write(A, 1)
    assert len(bench.asked) == 4


def test_a_write_after_a_silent_read_is_believed() -> None:
    bench = Bench(Fate(what='drop'))
    with pytest.raises(NoAnswer):
        bench.read(A)
    bench.write(A, 1)
    assert bench.asked == [0x1E, 0x1E]


def test_late_nak_is_not_taken_for_the_answer_to_another_question() -> None:
    bench = Bench(Fate(1.2, 'refuse'))
    with pytest.raises(NoAnswer):
        bench.read(A)
    assert bench.read(B).data == bench.answer_of(1)
    bench = Bench(Fate(1.2, 'refuse'))
    with pytest.raises(NoAnswer):
        bench.read(A)
    with pytest.raises(DamagedAnswer):
        bench.write(B, 1)


def test_resync_reads_are_those_that_every_firmware_has() -> None:
    # to ask for what a drive does not have makes it stop
    bench = Bench(*[Fate(what='drop')] * 5)
    for _ in range(5):
        with pytest.raises(NoAnswer):
            bench.read(A)
    assert bench.asked == [0x1E, INV_ST, MODE, 0x30, 0x1E]
    assert bench.read(B).data == bench.answer_of(5)


def test_quarantine_of_one_unit_is_not_that_of_another() -> None:
    bench = Bench(Fate(what='drop'))
    with pytest.raises(NoAnswer):
        bench.read(A)
    assert bench.read(A, unit=2).data == bench.answer_of(1)
    assert bench.asked == [0x1E, 0x1E]


def test_closing_ends_every_quarantine() -> None:
    bench = Bench(Fate(what='drop'))
    with pytest.raises(NoAnswer):
        bench.read(A)
    bench.link.close()
    bench.link.open()
    bench.read(A)
    assert bench.asked == [0x1E, 0x1E]


@pytest.mark.parametrize('lump', [False, True])
@pytest.mark.parametrize('address', [A, classic_id(INV_ST)])
def test_doubled_reply(lump: bool, address: Address) -> None:
    bench = Bench(Fate(what='double', lump=lump))
    number = address.index
    resync = MODE if number == INV_ST else INV_ST
    bench.read(address)
    # in a lump it is seen at once, else when it comes before it can
    assert bench.read(address).data == bench.answer_of(len(bench.asked) - 1)
    assert bench.asked == ([number, resync, number] if lump else [number, number, resync, number])


def test_the_same_question_on_a_line_without_speed() -> None:
    bench = Bench(settings=LineSettings(1200, '7E1', TIMEOUT))
    bench.drive.pace = 0.0
    for _ in range(5):
        assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)
        bench.write(A, 1)
        bench.write(B, 1)


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_reply_before_another_question(lump: bool) -> None:
    bench = Bench(Fate(what='double', lump=lump))
    bench.read(A)
    assert bench.read(B).data == bench.answer_of(1)
    assert bench.asked == [0x1E, 0xB6]


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_ack(lump: bool) -> None:
    bench = Bench(Fate(what='double', lump=lump), Fate(what='drop'))
    bench.write(A, 1)
    with pytest.raises((NoAnswer, DamagedAnswer)):
        bench.write(B, 1)


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_nak(lump: bool) -> None:
    bench = Bench(Fate(what='refuse twice', lump=lump))
    with pytest.raises(Refused):
        bench.read(A)
    assert bench.read(B).data == bench.answer_of(1)


@pytest.mark.parametrize('noise', [b'\x00', b'\x7f\x7f', b'\x02', b'!', b'!\x02E0', b'\x1b[0m'])
def test_noise_before_an_answer(noise: bytes) -> None:
    bench = Bench()
    bench.drive.before = noise
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.write(A, 1).data == b''


def test_damaged_answer() -> None:
    bench = Bench(Fate(what='damage'))
    with pytest.raises(DamagedAnswer, match='14 bytes'):
        bench.read(A)


def test_unrequested_bytes_put_reads_in_quarantine() -> None:
    bench = Bench()
    bench.read(A)
    bench.wire.now += 1
    bench.wire.arrive(bench.wire.now - 0.1, b'!')
    assert bench.read(A).data == bench.answer_of(2)
    assert bench.asked == [0x1E, INV_ST, 0x1E]


# --- whatever the drive does ----------------------------------------------------------------------

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
        st.sampled_from(['A', 'B', 'InvSt', 'write A', 'write B']),
        st.one_of(st.just(0.0), st.just(0.0), st.floats(0, 4)),
    ),
    max_size=25,
)
NAMES = {'A': A, 'B': B, 'InvSt': classic_id(INV_ST)}


@hypothesis_settings(max_examples=400)
@given(FATES, STEPS, st.booleans())
@example([Fate(1.2), Fate(what='drop')], [('write A', 0.0), ('write B', 0.0)], False)
@example([Fate(1.5), Fate(1.5), Fate(1.5)], [('A', 0.0), ('B', 0.0), ('B', 0.0)], False)
@example([Fate(what='refuse twice')], [('A', 0.0), ('B', 0.0)], False)
def test_every_answer_belongs_to_its_request(
    fates: list[Fate], steps: list[tuple[str, float]], echo: bool
) -> None:
    bench = Bench(*fates)
    bench.drive.echo = echo
    requests = bench.drive.requests
    for what, pause in steps:
        bench.wire.now += pause * TIMEOUT
        address = NAMES[what.split()[-1]]
        before = len(requests)
        try:
            if what.startswith('write'):
                assert bench.write(address, 7).data == b''
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
        assert len(requests) - before <= (3 if what.startswith('write') else 5)
        if what.startswith('write'):
            assert requests[before][1:3] == (address.index, 7)
