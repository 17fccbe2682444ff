# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus on a serial line: an answer to a read names nothing, its length is in the request."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from dataclasses import replace

from hypothesis import example, given, settings as hypothesis_settings, strategies as st
from identify_bench import write_and_read_request
from line_bench import UNIT, Ascii, ModbusDrives, Rtu, SameWords, of_modbus, same
import pymodbus_opinion as opinion
import pytest
from support.addresses import packed
from support.plans import followed
from test_line import DELAYS, STEPS, babble
from virtual_wire import DROP, REFUSE, Fate

from nfo_sinus_driver.link.interface import (
    BAUD_RATES,
    Address,
    DamagedAnswer,
    InProgress,
    LineSettings,
    LinkError,
    NoAnswer,
    NotReady,
    Refused,
)
from nfo_sinus_driver.link.late_replies import SUSPECT_FOR
from nfo_sinus_driver.link.modbus.pdu import WriteAndRead
from nfo_sinus_driver.link.request_link import Echo

Way = type[Rtu]
A, B, C, D, ONE, TWO = Rtu.A, Rtu.B, Rtu.C, Rtu.D, Rtu.ONE, Rtu.TWO
TIMEOUT = Rtu.settings.response_timeout


# --- frames ---------------------------------------------------------------------------------------


def test_the_function_follows_from_what_is_wanted() -> None:
    bench = Rtu()
    bench.read(A)
    bench.write(A)
    bench.write(C, packed(5, 6))
    assert bench.functions == [3, 6, 16]


def test_what_goes_over_a_line_of_ascii() -> None:
    bench = Ascii()
    bench.read(A)
    bench.write(C, packed(5, 0xABCD))
    assert [frame for _, frame in bench.wire.sent] == [
        b':010304000001F7\r\n',
        b':011003EC0002040005ABCD7D\r\n',
    ]
    bench.wire.check_gaps()


@pytest.mark.parametrize('baud', BAUD_RATES)
def test_silence_between_frames_is_that_of_the_standard(baud: int) -> None:
    bench = Rtu(settings=replace(Rtu.settings, baud_rate=baud))
    for _ in range(3):
        bench.read(A)
        bench.write(B)
    bench.wire.check_gaps()
    assert bench.wire.gap == pytest.approx(max(0.00175, 3.5 * 11 / baud), rel=0.15)


def answering(bench: Rtu, frame: bytes, cuts: list[int] | None = None, pause: float = 0.0) -> Rtu:
    """Have every request answered with a frame that pauses at some places."""
    cuts = cuts or []

    def far_end(request: bytes, end: float) -> None:
        for start, stop in zip([0, *cuts], [*cuts, len(frame)], strict=True):
            end = bench.wire.arrive(end, frame[start:stop]) + pause

    bench.wire.far_end = far_end
    return bench


@pytest.mark.parametrize('values', [[77], [1, 2]])
@of_modbus
def test_an_answer_without_its_first_byte_is_said_to_be_that(way: Way, values: list[int]) -> None:
    bench = way()
    answering(bench, bench.wire.pack(opinion.read_answer(UNIT, values))[1:])
    error = bench.expect(DamagedAnswer, lambda: bench.read(A if len(values) == 1 else C))
    assert 'adapter switches from sending to receiving too late' in str(error)


def test_pauses_that_an_adapter_makes_are_learned() -> None:
    bench = Rtu(settings=LineSettings(response_timeout=0.2))
    frame = opinion.read_answer(UNIT, [1, 2])
    answering(bench, frame, [3, 6], 0.06)
    for _ in range(3):
        assert bench.read(C).data == packed(1, 2)
        bench.wire.now += 1
    # a long answer in many pieces takes longer than the first byte of an answer may
    answering(bench, frame, [*range(1, 9)], 0.06)
    assert bench.read(C).data == packed(1, 2)
    assert bench.wire.now - bench.wire.sent[-1][0] > 0.4


# --- pauses of ASCII ------------------------------------------------------------------------------

FRAME = opinion.ascii_frame(b'\x01\x03\x02\x00\x4d')


@pytest.mark.parametrize('cuts', [[1], [2], [5], [13], [14], [1, 7, 14]])
def test_frame_may_pause_as_long_as_it_may_take_to_begin(cuts: list[int]) -> None:
    assert answering(Ascii(), FRAME, cuts, 0.95 * TIMEOUT).read(A).data == packed(77)


def test_frame_may_pause_for_a_second_at_most() -> None:
    for pause, whole in ((0.95, True), (1.1, False)):
        bench = Ascii(settings=LineSettings(char_format='7E1', response_timeout=2.0))
        in_time = answering(bench, FRAME, [7, 9], pause).wire.far_end
        # the time for the answer to begin is over with its first characters
        bench.wire.far_end = lambda frame, end, take=in_time: take(frame, end + 1.99)
        if whole:
            assert bench.read(A).data == packed(77)
        else:
            bench.expect(DamagedAnswer, lambda bench=bench: bench.read(A))


def test_frame_that_pauses_longer_is_given_up() -> None:
    bench = answering(Ascii(), FRAME, [7], 1.2 * TIMEOUT)
    assert '7 bytes' in str(bench.expect(DamagedAnswer, lambda: bench.read(A)))
    assert bench.wire.now - bench.wire.sent[0][0] < 1.5 * TIMEOUT


def test_lower_case_is_read() -> None:
    frame = opinion.ascii_frame(b'\x01\x03\x02\xab\xcd').lower()
    assert answering(Ascii(), frame).read(A).data == packed(0xABCD)


def test_noise_costs_no_second() -> None:
    bench = answering(Ascii(), b'\x00:x\xff')
    bench.expect(DamagedAnswer, lambda: bench.read(A))
    assert bench.wire.now - bench.wire.sent[0][0] < 2 * TIMEOUT


@pytest.mark.parametrize('babbling', [b':', b':0', b':010302', b'0'])
def test_frame_that_never_ends_is_given_up(babbling: bytes) -> None:
    bench = answering(Ascii(), babbling * 100, [*range(1, 100 * len(babbling))], 0.2)
    start = bench.wire.now
    bench.expect(DamagedAnswer, lambda: bench.read(A))
    assert bench.wire.now - start < TIMEOUT + 3.5


def test_frame_begun_again_is_found() -> None:
    assert answering(Ascii(), FRAME[:9] + FRAME, [9], 0.5 * TIMEOUT).read(A).data == packed(77)


def test_a_unit_identifies_itself() -> None:
    bench = Ascii()
    texts = {17: b'\x01\x11\x10' + b'0123456789ABCDEF'}
    objects = b'\x01\x2b\x0e\x02\x02\x00\x00\x02\x04\x09NFO Sinus\x05\x081.50/400'

    def far_end(request: bytes, end: float) -> None:
        bench.wire.arrive(end, opinion.ascii_frame(texts.get(request[1], objects)))

    bench.wire.far_end = far_end
    found = followed(bench.link.identify(UNIT))
    assert found.product == 'NFO Sinus'
    assert found.model == '1.50/400'
    assert found.serial == '0123456789ABCDEF'


# --- late -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(('first', 'resync', 'second'), [(A, TWO, B), (C, ONE, D)])
@of_modbus
def test_resync_read_has_another_shape(
    way: Way, first: Address, resync: Address, second: Address
) -> None:
    bench = way(Fate(1.5))
    bench.expect(NoAnswer, lambda: bench.read(first))
    assert bench.read(second).data == bench.answer_of()
    assert bench.read(second).data == bench.answer_of()
    assert bench.asked == [first.index, resync.index, second.index, second.index]


@of_modbus
def test_what_cannot_be_confused_needs_no_resync_read(way: Way) -> None:
    for act in (lambda bench: bench.read(C), lambda bench: bench.write(B)):
        bench = way(Fate(1.2))
        bench.expect(NoAnswer, lambda bench=bench: bench.read(A))
        act(bench)
        # and it has shown that nothing is left
        assert bench.read(B).data == bench.answer_of()
        assert len(bench.asked) == 3


@pytest.mark.parametrize('resync', [(), (ONE, TWO)])
def test_a_unit_of_which_nothing_is_known_is_identified(resync: tuple[Address, ...]) -> None:
    # its refusal says that the line can be believed, and nothing about the request behind it
    bench = Ascii(*[DROP] * 3, resync=resync)
    for _ in range(3):
        bench.expect(NoAnswer, lambda: bench.read(A))
    assert bench.asked == ([A.index, 17, 43] if not resync else [A.index, TWO.index, 17])
    if not resync:
        # and it is left alone for one time-out at most
        error = bench.expect(NotReady, lambda: bench.read(A))
        assert isinstance(error, NotReady)
        assert bench.wire.now < error.until <= bench.wire.now + TIMEOUT
        bench.wire.now = error.until
    assert bench.read(B if resync else A).data == bench.answer_of()


@of_modbus
def test_a_refused_resync_read_is_an_answer(way: Way) -> None:
    bench = way(DROP, REFUSE, resync=())
    bench.expect(NoAnswer, lambda: bench.read(A))
    assert bench.read(B).data == bench.answer_of()
    assert bench.asked == [A.index, 17, B.index]


@of_modbus
def test_refusal_is_not_taken_for_that_of_another_request(way: Way) -> None:
    # the first write is refused late, within the time of the second
    bench = way(Fate(1.5, 'refuse'))
    bench.expect(NoAnswer, lambda: bench.write(A))
    assert bench.write(B).data == b''
    # that of another function can be distinguished
    bench = way(DROP, REFUSE)
    bench.expect(NoAnswer, lambda: bench.read(A))
    error = bench.expect(Refused, lambda: bench.write(A))
    assert isinstance(error, Refused) and error.code == bench.drive.code(1)
    # and one that may be an earlier one is asked for again
    bench = way(Fate(1.5, 'refuse'), REFUSE, Fate(), REFUSE)
    bench.expect(NoAnswer, lambda: bench.read(A))
    bench.expect(DamagedAnswer, lambda: bench.read(C))
    error = bench.expect(Refused, lambda: bench.read(C))
    assert isinstance(error, Refused) and error.code == bench.drive.code(len(bench.asked) - 1)


def test_several_late_refusals_at_once() -> None:
    # an adapter hands over in one lump what two earlier writes were refused with
    bench = Rtu(DROP, DROP)
    bench.expect(NoAnswer, lambda: bench.write(A))
    bench.expect(NoAnswer, lambda: bench.write(B))
    lump = opinion.exception(UNIT, 6, 3) * 2 + opinion.write_answer(UNIT, D.index, [7])
    bench.wire.far_end = lambda request, end: bench.wire.arrive(end, lump, lump=True) and None
    assert bench.write(D._replace(size=2)).data == b''


def test_refusals_that_cannot_be_distinguished_keep_no_reads_out() -> None:
    # a drive comes back from a power cycle and refuses what is written to it again and again
    bench = Rtu(DROP, *[REFUSE] * 3)
    bench.expect(NoAnswer, lambda: bench.write(B))
    for _ in range(3):
        bench.expect(DamagedAnswer, lambda: bench.write(B))
    assert bench.read(A).data == bench.answer_of()
    # and now that an answer has come, the next refusal is believed
    bench.drive.heal(REFUSE)
    bench.expect(Refused, lambda: bench.write(B))


@of_modbus
def test_the_answer_to_a_read_before_a_write_stays_in_quarantine(way: Way) -> None:
    bench = way(Fate(1.5), DROP)
    bench.expect((NoAnswer, DamagedAnswer), lambda: bench.read_then_write(A, B))
    assert bench.read(B).data == bench.answer_of()
    assert bench.asked == [A.index, B.index, TWO.index, B.index]


# --- function 23 ----------------------------------------------------------------------------------


def write_and_read(bench: Rtu) -> bytes:
    data: bytes = bench.link.write_and_read(UNIT, A, packed(7), B).data
    return data


def test_write_and_read_is_one_transaction() -> None:
    bench = Rtu(Fate(), REFUSE)
    assert write_and_read(bench) == bench.answer_of()
    request = WriteAndRead(UNIT, A.index, packed(7), B.index, 1)
    assert bench.wire.sent[0][1] == write_and_read_request(request)
    error = bench.expect(Refused, lambda: write_and_read(bench))
    assert isinstance(error, Refused) and error.code == bench.drive.code(1)
    assert bench.functions == [23, 23]


def test_what_a_unit_refuses_to_do_in_one_transaction_is_only_written() -> None:
    bench = Rtu(REFUSE)
    # a stop goes between, and so does what is newer
    with pytest.raises(InProgress):
        write_and_read(bench)
    assert bench.functions == [23]
    assert write_and_read(bench) == write_and_read(bench) == b''
    assert bench.functions == [23, 6, 6]


def test_a_unit_that_is_busy_has_the_function() -> None:
    bench = Rtu(REFUSE)
    bench.drive.code = lambda number: Refused.BUSY
    bench.expect(Refused, lambda: write_and_read(bench))
    assert write_and_read(bench) == bench.answer_of()
    assert bench.functions == [23, 23]


def test_what_was_written_may_be_done_where_the_read_behind_it_is_refused() -> None:
    bench = Rtu(REFUSE, Fate(), REFUSE, trusted=True)
    bench.drive.code = lambda number: Refused.ILLEGAL_FUNCTION

    def exchange(data: bytes) -> object:
        return bench.link.transfer(UNIT, B.index, 1, A.index, data)

    assert bench.expect(Refused, lambda: exchange(packed(7, 8))).maybe_done
    assert bench.functions == [23, 16, 3]
    bench.drive.heal(REFUSE)
    bench.wire.now += 1
    assert not bench.expect(Refused, lambda: exchange(b'')).maybe_done


def test_a_write_and_read_whose_answer_would_be_in_doubt_is_a_write() -> None:
    bench = Rtu(Fate(), Fate(1.5))
    assert write_and_read(bench) == bench.answer_of()
    error = bench.expect(NoAnswer, lambda: write_and_read(bench))
    assert error.maybe_done
    before = bench.wire.now
    assert write_and_read(bench) == b''
    assert bench.wire.now < before + 0.1
    # what was late has come before the answer to that
    assert write_and_read(bench) == bench.answer_of()
    assert bench.functions == [23, 23, 6, 23]


def test_a_write_and_read_goes_out_at_once_on_a_line_that_is_never_silent() -> None:
    bench = Rtu()
    bench.wire.far_end = lambda frame, end: None
    babble(bench.wire, 0x55, bench.wire.gap / 2)
    before = bench.wire.now
    with contextlib.suppress(DamagedAnswer):
        write_and_read(bench)
    assert bench.wire.sent[0][0] < before + 0.1


# --- the echo by itself ---------------------------------------------------------------------------


def test_nothing_is_stripped_before_an_echo_came() -> None:
    echo = Echo()
    echo.sent(b'abc')
    assert echo.strip(b'abcd') == b'abcd'
    assert echo.bytes_needed == 0


@given(st.data(), st.binary(min_size=1, max_size=8), st.binary(max_size=20))
def test_echo_is_stripped_in_any_pieces(data: st.DataObject, frame: bytes, answer: bytes) -> None:
    echo = Echo()
    echo.present = True
    echo.sent(frame)
    stream = frame + answer
    cut = data.draw(st.integers(0, len(stream)))
    assert echo.strip(stream[:cut]) + echo.strip(stream[cut:]) == answer
    assert echo.bytes_needed == 0
    assert echo.before == b''


def test_what_comes_before_the_echo_is_kept_apart() -> None:
    echo = Echo()
    echo.present = True
    echo.sent(b'abc')
    assert echo.strip(b'xxab') == b''
    assert echo.strip(b'cyy') == b'yy'
    assert echo.before == b'xx'


# --- answers that come twice, or are the same -----------------------------------------------------


def numbers_of(bench: Rtu, address: Address, since: int) -> list[int]:
    """
    Which requests asked for a parameter since there had been so many.

    The same question asked twice may be answered with the first answer: it is about that.
    """
    numbers = range(max(0, since - 1), len(bench.asked))
    return [number for number in numbers if bench.asked[number] == address.index]


def answers(bench: Rtu, address: Address, since: int) -> list[bytes]:
    """What the drive said about a parameter."""
    return [bench.answer_of(number) for number in numbers_of(bench, address, since)]


@pytest.mark.parametrize('again', [0.05, 0.1, 0.2, 0.5, 0.9])
@pytest.mark.parametrize('lump', [False, True])
@pytest.mark.parametrize('echoes', [False, True])
@of_modbus
def test_second_answer_is_not_taken_for_the_next_one(
    way: Way, again: float, lump: bool, echoes: bool
) -> None:
    bench = way(Fate(what='double', again=again, lump=lump))
    if echoes:
        bench.drive.echo = same
    assert bench.read(A).data == bench.answer_of(0)
    for address in (B, A, B):
        before = len(bench.asked)
        with contextlib.suppress(DamagedAnswer):
            assert bench.read(address).data in answers(bench, address, before)


def silences(bench: Rtu) -> tuple[float, float]:
    """How long the line was silent before the last request, and after its answer until now."""
    sent, _ = bench.wire.sent[-1]
    heard = [at for at, _ in bench.wire.seen]
    return sent - max(at for at in heard if at < sent), bench.wire.now - max(heard)


@pytest.mark.parametrize('lump', [False, True])
@of_modbus
def test_after_a_second_answer_readings_come_between_two_silences(way: Way, lump: bool) -> None:
    bench = way(Fate(what='double', lump=lump), trusted=True)
    assert bench.read(A).data == bench.answer_of()
    assert bench.read(B).data == bench.answer_of()
    assert bench.asked == [A.index, B.index]
    assert min(silences(bench)) > bench.wire.gap + 0.0009


@of_modbus
def test_second_answer_is_said(way: Way) -> None:
    bench = way(Fate(what='double', again=0.2))
    bench.read(A)
    error = bench.expect(DamagedAnswer, lambda: bench.read(B))
    assert 'came twice' in str(error)
    # that is over now
    assert bench.read(B).data == bench.answer_of()
    assert bench.asked == [A.index, B.index, TWO.index, B.index]


def saying_the_same(way: Way, *fates: Fate, trusted: bool = False, resync: bool = True) -> Rtu:
    bench = way(*fates, resync=(ONE, TWO) if resync else (), trusted=trusted)
    bench.drive = SameWords(bench.wire)
    bench.drive.heal(*fates)
    return bench


def test_same_words_twice_are_believed_after_a_resync_read() -> None:
    for way in (Rtu, Ascii):
        bench = saying_the_same(way)
        for address in (A, B, C, D, A):
            assert bench.read(address).data == bytes(address.size)
        resynced = [A, B, TWO, C, ONE, D, A]
        assert bench.asked == [address.index for address in resynced]
        bench.wire.check_gaps()
        # where nothing is known that could be read: after an identification
        bench = saying_the_same(way, resync=False)
        for address in (A, B, A):
            bench.read(address)
        assert bench.functions == [3, 3, 17, 3]


def test_same_question_twice_is_believed_at_once() -> None:
    bench = saying_the_same(Rtu)
    for address in (A, A, C, A):
        bench.read(address)
    # but one more may come, and that would look like an answer to B
    bench.read(A)
    bench.read(B)
    asked = [A, A, C, A, A, TWO, B]
    assert bench.asked == [address.index for address in asked]
    # and a refusal behind it is believed
    bench = saying_the_same(Rtu, Fate(), Fate(), REFUSE)
    bench.read(A)
    bench.read(A)
    bench.expect(Refused, lambda: bench.read(C))


def test_same_words_after_a_while_are_believed_at_once() -> None:
    bench = saying_the_same(Rtu)
    bench.read(A)
    bench.wire.now += 1.1 * TIMEOUT
    bench.read(B)
    assert bench.asked == [A.index, B.index]


def test_same_answer_to_a_write_needs_no_resync_read() -> None:
    # it names what was written
    bench = Rtu()
    bench.write(A)
    bench.write(A)
    assert bench.asked == [A.index] * 2


@of_modbus
def test_nothing_waits_behind_an_answer_like_the_one_before_where_a_write_follows(
    way: Way,
) -> None:
    bench = saying_the_same(way)
    bench.read(A)
    bench.read_then_write(B, C._replace(size=2))
    assert bench.asked == [A.index, B.index, C.index]
    heard = [at for at, _ in bench.wire.seen if at < bench.wire.sent[-1][0]][-1]
    assert bench.wire.sent[-1][0] - heard <= max(0.003, bench.wire.gap + 1e-9)
    # where nothing answers the write, the right answer to the read may still come
    bench = saying_the_same(way, Fate(), Fate(), DROP)
    bench.read(A)
    bench.expect(NoAnswer, lambda: bench.read_then_write(B, C._replace(size=2)))
    bench.read(A)
    assert bench.asked == [A.index, B.index, C.index, TWO.index, A.index]


class SameRefusal(ModbusDrives):
    """Refuse everything with the same code, as drives of another family."""

    @staticmethod
    def code(number: int) -> int:
        return Refused.ILLEGAL_ADDRESS


def refusing(*fates: Fate) -> Rtu:
    bench = Rtu()
    bench.drive = SameRefusal(bench.wire)
    bench.drive.heal(*fates)
    return bench


def test_same_refusals_are_believed_even_where_resync_reads_are_refused() -> None:
    bench = refusing(*[REFUSE] * 9)
    for address in (A, B, C):
        bench.expect(Refused, lambda address=address: bench.read(address))


def test_second_refusal_is_not_taken_for_that_of_the_next_request() -> None:
    twice = Fate(what='refuse twice', again=0.2)
    for bench in (Rtu(twice), refusing(twice, Fate(), *[REFUSE] * 9)):
        bench.expect(Refused, lambda bench=bench: bench.read(A))
        bench.expect(DamagedAnswer, lambda bench=bench: bench.read(B))
    bench = Rtu(twice)
    bench.expect(Refused, lambda: bench.read(A))
    bench.expect(DamagedAnswer, lambda: bench.read(B))
    assert bench.read(B).data == bench.answer_of()


def one_thing_at_a_time(fates: list[Fate]) -> Iterator[Fate]:
    """Answer the request behind one that is answered twice: who counts would be misled."""
    twice = False
    for fate in fates:
        yield replace(fate, what='answer') if twice else fate
        twice = not twice and fate.what in ('double', 'refuse twice')


AGAIN = st.builds(
    Fate,
    DELAYS,
    st.sampled_from(['answer', 'answer', 'drop', 'refuse', 'double', 'refuse twice']),
    st.booleans(),
    st.floats(0.02, 0.9),
)


@of_modbus
@hypothesis_settings(max_examples=300)
@given(st.lists(AGAIN, max_size=25), STEPS, st.booleans())
@example([Fate(what='double', again=0.1)], [('read A', 0.0), ('read B', 0.0)], False)
@example(
    [Fate(), Fate(what='double', again=0.5), Fate(2.0), Fate(lump=True)],
    [('write A', 0.0), ('write A', 0.0), ('read A', 0.0), ('write A', 0.0), ('read A', 0.0)],
    False,
)
def test_an_answer_that_comes_again_belongs_to_its_request(
    way: Way, fates: list[Fate], steps: list[tuple[str, float]], echoes: bool
) -> None:
    bench = way(*one_thing_at_a_time(fates))
    if echoes:
        bench.drive.echo = same
    with contextlib.suppress(LinkError):
        # the first read tells whether there is an echo
        bench.read(D)
    for what, pause in steps:
        bench.wire.now += pause * TIMEOUT
        address = {'A': A, 'B': B, 'C': C}[what[-1]]
        before = len(bench.asked)
        try:
            if what.startswith('write'):
                bench.write(address, packed(*(7,) * (address.size // 2)))
            else:
                assert bench.read(address).data in answers(bench, address, before)
        except Refused as refusal:
            numbers = numbers_of(bench, address, before)
            assert refusal.code in [bench.drive.code(number) for number in numbers]
        except LinkError:
            pass
    bench.wire.check_gaps()


# --- a line that has given no cause for doubt yet -------------------------------------------------


def test_same_words_cost_no_request_and_hardly_any_time() -> None:
    bench = saying_the_same(Rtu, trusted=True)
    bench.read(A)
    took = []
    for address in (B, A):
        began = bench.wire.now
        bench.read(address)
        took.append(bench.wire.now - began)
    assert bench.asked == [A.index, B.index, A.index]
    # the right one may come behind it: a frame more
    assert took[0] < took[1] + 0.0025


@pytest.mark.parametrize('again', [0.05, 0.1, 0.15])
def test_answer_sent_twice_is_not_taken_for_the_next(again: float) -> None:
    # the unit takes as long as it does, and the second copy comes within that
    bench = Rtu(Fate(0.2), Fate(0.2, 'double', again=again), Fate(0.2), trusted=True)
    bench.read(D)
    first = bench.read(A).data
    assert 'came twice' in str(bench.expect(DamagedAnswer, lambda: bench.read(B)))
    # from now on nothing is believed that could be a repetition
    assert bench.read(B).data == bench.answer_of() != first


@pytest.mark.parametrize('lump', [False, True])
def test_line_with_an_answer_sent_twice_is_not_trusted_for_a_while(lump: bool) -> None:
    bench = Rtu(Fate(what='double', lump=lump), trusted=True)
    bench.read(A)
    bench.wire.now += 0.01
    bench.read(D)
    bench.drive = SameWords(bench.wire)
    bench.read(A)
    bench.read(B)
    assert min(silences(bench)) > bench.wire.gap + 0.0009, 'nothing confirmed it'
    bench.wire.now += SUSPECT_FOR + 1.0
    bench.read(A)
    bench.read(B)
    assert bench.asked[-2:] == [A.index, B.index]
    assert min(silences(bench)) < bench.wire.gap + 0.0001


def test_one_slow_answer_does_not_slow_the_others_for_ever() -> None:
    bench = Rtu(Fate(0.9), trusted=True)
    bench.read(D)
    slow = bench.link._late.longest(UNIT)
    for _ in range(60):
        bench.read(D)
    assert bench.link._late.longest(UNIT) < slow / 10
