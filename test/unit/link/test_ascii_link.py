# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus ASCII, one transaction after the other, on a line in virtual time."""

from __future__ import annotations

from collections.abc import Iterator

from link_bench import TIMEOUT, UNIT, A, B, Bench, C
import pymodbus_opinion as opinion
import pytest
from support.addresses import packed
from support.plans import followed

# what holds for RTU holds for ASCII, unless it is about the silence between frames
from test_rtu_link import (
    test_babbling_line_is_no_reason_to_hang,  # noqa: F401
    test_closing_ends_every_quarantine,  # noqa: F401
    test_damaged_answer,  # noqa: F401
    test_doubled_answer_is_noticed,  # noqa: F401
    test_every_answer_belongs_to_its_request,  # noqa: F401
    test_late_answer_before_a_write_is_passed_over,  # noqa: F401
    test_late_answer_is_not_taken_for_the_next_one,  # noqa: F401
    test_late_answer_to_a_write_does_not_end_the_quarantine,  # noqa: F401
    test_line_that_begins_to_babble_is_no_reason_to_hang,  # noqa: F401
    test_lost_port_is_passed_on,  # noqa: F401
    test_quarantine_of_one_unit_is_not_that_of_another,  # noqa: F401
    test_read_and_write,  # noqa: F401
    test_refusal,  # noqa: F401
    test_refusal_is_not_taken_for_that_of_another_request,  # noqa: F401
    test_refusal_of_another_function_is_believed_in_quarantine,  # noqa: F401
    test_refused_resync_read_is_an_answer,  # noqa: F401
    test_reply_says_when_its_last_byte_came,  # noqa: F401
    test_resync_read_has_another_shape,  # noqa: F401
    test_write_goes_out_at_once_even_in_quarantine,  # noqa: F401
)
from virtual_wire import AsciiWire, Fate

from nfo_sinus_driver.link.interface import DamagedAnswer, LineSettings
from nfo_sinus_driver.link.modbus_ascii import AsciiLink


@pytest.fixture(autouse=True, scope='module')
def ascii_bench() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Bench, 'link_class', AsciiLink)
        patch.setattr(Bench, 'wire_class', AsciiWire)
        yield


def test_what_goes_over_the_line() -> None:
    bench = Bench()
    bench.read(A)
    bench.write(C, 5, 0xABCD)
    assert [frame for _, frame in bench.wire.sent] == [
        b':010304000001F7\r\n',
        b':011003EC0002040005ABCD7D\r\n',
    ]
    bench.wire.check_gaps()


def in_parts(bench: Bench, frame: bytes, cuts: list[int], pause: float) -> None:
    """Answer every request with a frame that pauses at some places."""

    def far_end(request: bytes, end: float) -> None:
        for start, stop in zip([0, *cuts], [*cuts, len(frame)], strict=True):
            end = bench.wire.arrive(end, frame[start:stop]) + pause

    bench.wire.far_end = far_end


@pytest.mark.parametrize('cuts', [[1], [2], [5], [13], [14], [1, 7, 14]])
def test_frame_may_pause_as_long_as_it_may_take_to_begin(cuts: list[int]) -> None:
    bench = Bench()
    in_parts(bench, opinion.ascii_frame(b'\x01\x03\x02\x00\x4d'), cuts, 0.95 * TIMEOUT)
    assert bench.read(A).data == packed(77)


def test_an_answer_without_its_first_character_is_said_to_be_that() -> None:
    bench = Bench()
    in_parts(bench, opinion.ascii_frame(b'\x01\x03\x02\x00\x4d')[1:], [], 0.0)
    error = bench.expect(DamagedAnswer, lambda: bench.read(A))
    assert 'adapter switches from sending to receiving too late' in str(error)


def test_frame_may_pause_for_a_second_at_most() -> None:
    for pause, whole in ((0.95, True), (1.1, False)):
        bench = Bench(settings=LineSettings(char_format='7E1', response_timeout=2.0))
        in_parts(bench, opinion.ascii_frame(b'\x01\x03\x02\x00\x4d'), [7, 9], pause)
        in_time = bench.wire.far_end
        # the time for the answer to begin is over with its first characters
        bench.wire.far_end = lambda frame, end, take=in_time: take(frame, end + 1.99)
        if whole:
            assert bench.read(A).data == packed(77)
        else:
            bench.expect(DamagedAnswer, lambda bench=bench: bench.read(A))


def test_frame_that_pauses_longer_is_given_up() -> None:
    bench = Bench()
    in_parts(bench, opinion.ascii_frame(b'\x01\x03\x02\x00\x4d'), [7], 1.2 * TIMEOUT)
    error = bench.expect(DamagedAnswer, lambda: bench.read(A))
    assert error.maybe_done
    assert '7 bytes' in str(error)
    assert bench.wire.now - bench.wire.sent[0][0] < 1.5 * TIMEOUT


def test_lower_case_is_read() -> None:
    bench = Bench()
    in_parts(bench, opinion.ascii_frame(b'\x01\x03\x02\xab\xcd').lower(), [], 0.0)
    assert bench.read(A).data == packed(0xABCD)


def test_noise_costs_no_second() -> None:
    bench = Bench()
    in_parts(bench, b'\x00:x\xff', [], 0.0)
    bench.expect(DamagedAnswer, lambda: bench.read(A))
    assert bench.wire.now - bench.wire.sent[0][0] < 2 * TIMEOUT


@pytest.mark.parametrize('babble', [b':', b':0', b':010302', b'0'])
def test_frame_that_never_ends_is_given_up(babble: bytes) -> None:
    bench = Bench()
    in_parts(bench, babble * 100, list(range(1, 100 * len(babble))), 0.2)
    start = bench.wire.now
    bench.expect(DamagedAnswer, lambda: bench.read(A))
    assert bench.wire.now - start < TIMEOUT + 3.5


def test_frame_begun_again_is_found() -> None:
    bench = Bench()
    frame = opinion.ascii_frame(b'\x01\x03\x02\x00\x4d')
    in_parts(bench, frame[:9] + frame, [9], 0.5 * TIMEOUT)
    assert bench.read(A).data == packed(77)


@pytest.mark.parametrize('baud', [1200, 57600])
def test_answer_takes_as_long_as_it_is(baud: int) -> None:
    line = LineSettings(baud_rate=baud, char_format='7E1', response_timeout=0.02)
    bench = Bench([Fate(0.5)] * 2, line)
    assert bench.read(C).data == bench.answer_of(0)
    assert bench.read(B).data == bench.answer_of(1)
    bench.wire.check_gaps()


def test_a_unit_identifies_itself() -> None:
    bench = Bench()
    texts = {17: b'\x01\x11\x10' + b'0123456789ABCDEF'}
    objects = b'\x01\x2b\x0e\x02\x02\x00\x00\x02\x04\x09NFO Sinus\x05\x081.50/400'

    def far_end(request: bytes, end: float) -> None:
        bench.wire.arrive(end, opinion.ascii_frame(texts.get(request[1], objects)))

    bench.wire.far_end = far_end
    found = followed(bench.link.identify(UNIT))
    assert found.product == 'NFO Sinus'
    assert found.model == '1.50/400'
    assert found.serial == '0123456789ABCDEF'
