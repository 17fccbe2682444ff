# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Transfers with the nodes of a bus in virtual time, whatever they do."""

from __future__ import annotations

import itertools

from canopen_bench import (
    DROP,
    FRAME_TIME,
    GOOD,
    MANDATORY,
    TEXT,
    TIMEOUT,
    UNIT,
    A,
    B,
    Bench,
    Fate,
    at,
)
import pytest
from support.plans import followed

from nfo_sinus_driver.link.canopen.can import Frame
from nfo_sinus_driver.link.canopen.link import CanopenLink
from nfo_sinus_driver.link.interface import (
    DamagedAnswer,
    Identification,
    LineSettings,
    NoAnswer,
    Refused,
)

# --- plain transfers ------------------------------------------------------------------------------


def test_read_and_write() -> None:
    bench = Bench()
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.write(A, b'\x34\x12').data == b''
    assert bench.bus.servers[UNIT].objects[A.index, 0] == b'\x34\x12'
    assert bench.read(TEXT).data == bench.answer_of(2)
    assert bench.write(TEXT, b'a longer text').data == b''
    assert bench.bus.servers[UNIT].objects[TEXT.index, 0] == b'a longer text'
    assert [unit for unit, _ in bench.bus.sent] == [UNIT] * len(bench.bus.sent)
    assert bench.bus.sent[0] == (UNIT, bytes.fromhex('4013200000000000'))


def test_a_value_is_as_long_as_the_node_says() -> None:
    # [C102]
    bench = Bench()
    assert len(bench.read(at(A.index, size=4)).data) == 2
    assert bench.link.protocol.parts(TEXT) == (TEXT,)


def test_a_refusal_says_why() -> None:
    bench = Bench()
    with pytest.raises(Refused, match=r'no such object .SDO abort 06020000h.') as refused:
        bench.read(at(0x3000))
    assert refused.value.code == Refused.ILLEGAL_ADDRESS
    with pytest.raises(Refused, match='no such sub-index'):
        bench.write(at(A.index, 7))
    # a refusal is an answer: nothing is in doubt
    assert bench.asked == [0x3000, A.index]


def test_identity_of_a_node() -> None:
    bench = Bench()
    bench.bus.servers[UNIT].objects |= {(0x1018, 2): bytes(4), (0x1018, 4): bytes(4)}
    found = followed(bench.link.identify(UNIT), bench.link, UNIT)
    assert bench.asked == [0x1018, 0x1018, 0x1018, 0x1008, 0x100A]
    number = [str(int.from_bytes(bench.answer_of(each), 'little')) for each in range(3)]
    assert found == Identification(
        vendor=number[0],
        product_code=number[1],
        serial=number[2],
        product=bench.answer_of(3).decode(),
    )


def test_a_write_that_fails_behind_a_read_may_be_done() -> None:
    bench = Bench(Fate(), Fate(what='refuse'))
    with pytest.raises(Refused) as raised:
        bench.link.read_then_write(UNIT, A, B, b'\1\2')
    assert raised.value.maybe_done


# --- silence --------------------------------------------------------------------------------------


def test_silence() -> None:
    bench = Bench(DROP, DROP)
    start = bench.bus.now
    with pytest.raises(NoAnswer, match=r'^unit 5 did not answer$'):
        bench.read(A)
    assert bench.bus.now - start == pytest.approx(TIMEOUT)
    with pytest.raises(NoAnswer) as raised:
        bench.write(A)
    assert raised.value.maybe_done


def test_silence_says_what_the_adapter_knows() -> None:
    bench = Bench(DROP)
    bench.bus.trouble = 'frames do not leave'
    with pytest.raises(NoAnswer, match='unit 5 did not answer: frames do not leave'):
        bench.read(A)


@pytest.mark.parametrize('exchange', [1, 2, 3])
def test_a_transfer_that_breaks_off_is_ended_at_the_node(exchange: int) -> None:
    bench = Bench(*[Fate()] * exchange, DROP)
    with pytest.raises(NoAnswer):
        bench.read(TEXT)
    assert bench.bus.servers[UNIT].ended == [0x05040000]
    assert bench.read(B).data == bench.answer_of(1)


def test_foreign_frames_make_no_request_longer() -> None:
    bench = Bench(DROP)
    start = bench.bus.now
    for number in range(2000):
        at_time = start + number * TIMEOUT / 1000
        bench.bus.arrive(at_time, Frame(0x181, bytes(8)))
        bench.bus.arrive(at_time, Frame(0x586, bytes.fromhex('4B13200011220000')))
    with pytest.raises(NoAnswer):
        bench.read(A)
    assert bench.bus.now - start == pytest.approx(TIMEOUT, rel=0.01)


def test_answers_to_others_are_not_silence() -> None:
    bench = Bench(DROP)
    for number in range(3):
        at_time = bench.bus.now + 0.01 * (number + 1)
        bench.bus.arrive(at_time, Frame(0x585, bytes.fromhex('4B14200011220000')))
    with pytest.raises(DamagedAnswer, match='3 answers came, but none to this request'):
        bench.read(A)


# --- late -----------------------------------------------------------------------------------------


def test_another_object_is_read_at_once() -> None:
    bench = Bench(DROP)
    with pytest.raises(NoAnswer):
        bench.read(A)
    assert bench.read(B).data == bench.answer_of(1)
    assert bench.read(A).data == bench.answer_of(2)
    assert bench.asked == [A.index, B.index, A.index]


def test_a_node_without_the_objects_that_each_has_serves_as_well() -> None:
    bench = Bench(DROP)
    for place in MANDATORY:
        del bench.bus.servers[UNIT].objects[place]
    with pytest.raises(NoAnswer):
        bench.read(A)
    assert bench.read(A).data == bench.answer_of(2)
    assert bench.asked == [A.index, 0x1000, A.index]


def test_an_answer_sent_twice_is_taken_once() -> None:
    bench = Bench(Fate(), Fate(what='double'))
    bench.read(A)
    first = bench.read(A).data
    with pytest.raises(DamagedAnswer, match='came twice'):
        bench.read(A)
    assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1) != first
    bench = Bench(Fate(), Fate(what='double'))
    bench.write(A)
    bench.write(A)
    with pytest.raises(DamagedAnswer, match='came twice') as raised:
        bench.write(A, b'\3\4')
    assert raised.value.maybe_done


def test_same_values_cost_no_request_and_no_time() -> None:
    bench = Bench()
    bench.bus.value = lambda index, number: b'\4'  # type: ignore[method-assign]
    start = bench.bus.now
    for _ in range(10):
        assert bench.read(A).data == b'\4'
    assert bench.bus.now - start == pytest.approx(10 * 2 * FRAME_TIME)


# --- who is there ---------------------------------------------------------------------------------

START = Frame(0, b'\x01\x05')
HEARTBEAT = Frame(0x77F, b'\x05')


def starts(bench: Bench) -> list[Frame]:
    return [frame for _, frame in bench.bus.other if frame.identifier == 0]


def test_reading_changes_nothing() -> None:
    bench = Bench()
    for _ in range(3):
        bench.read(A)
        bench.bus.now += 1
    assert bench.bus.other == []


def test_a_node_is_made_operational_before_the_first_write() -> None:
    bench = Bench()
    bench.write(A)
    assert bench.bus.other[0][1] == START
    bench.write(A)
    bench.write(A, unit=6)
    assert starts(bench) == [START, Frame(0, b'\x01\x06')]
    bench.link.close()
    bench.link.open()
    bench.write(A)
    assert len(starts(bench)) == 3


def test_a_node_that_was_silent_is_made_operational_again_by_the_next_write() -> None:
    bench = Bench(GOOD, DROP)
    bench.write(A)
    with pytest.raises(NoAnswer):
        bench.read(B)
    assert len(starts(bench)) == 1
    bench.write(A)
    bench.write(A)
    assert starts(bench) == [START, START]


@pytest.mark.parametrize('reads', [0, 1])
def test_a_node_that_started_anew_is_made_operational_again(reads: int) -> None:
    bench = Bench()
    bench.write(A)
    bench.bus.now += 1
    # another one produces a heartbeat, and others restart
    for identifier, data in ((0x705, b'\x05'), (0x706, b'\0'), (0x700, b'\0')):
        bench.bus.arrive(bench.bus.now, Frame(identifier, data))
    bench.write(A)
    assert len(starts(bench)) == 1
    bench.bus.arrive(bench.bus.now + (0.0005 if reads else 0.0), Frame(0x705, b'\0'))
    for _ in range(reads):
        # what was asked of it is lost: nothing has to wait for that
        with pytest.raises(NoAnswer, match='unit 5 has restarted'):
            bench.read(A)
    bench.write(A)
    assert starts(bench) == [START, START]
    assert bench.link.supervision.take_restarted() == {5, 6}
    assert not bench.link.supervision.take_restarted()


def test_a_client_that_writes_sends_ten_heartbeats_a_second() -> None:
    bench = Bench()
    bench.write(A)
    until = bench.bus.now + 2
    while bench.bus.now < until:
        bench.read(A)
        bench.bus.now += 0.01
    beats = [when for when, frame in bench.bus.other if frame == HEARTBEAT]
    pauses = [after - before for before, after in itertools.pairwise(beats)]
    assert min(pauses) >= 0.1 and max(pauses) < 0.12
    assert len(beats) >= 18


# --- ports ----------------------------------------------------------------------------------------


@pytest.mark.parametrize('port', ['', '192.0.2.1:4001', 'nonsense://x'])
def test_what_is_no_port(port: str) -> None:
    with pytest.raises(ValueError, match='port'):
        CanopenLink.on_port(port, LineSettings(125_000, '8N1'))


@pytest.mark.parametrize('port', ['pcan:PCAN_USBBUS1', 'kvaser:0', 'ixxat:0', 'vector:0'])
def test_an_adapter_by_the_library_of_its_maker_is_refused_with_what_to_write(port: str) -> None:
    with pytest.raises(ValueError, match='write such as can0'):
        CanopenLink.on_port(port, LineSettings(125_000, '8N1'))
