# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Who a unit is, question by question: a drive that does not tell costs little."""

from __future__ import annotations

from typing import Any

from hypothesis import given, strategies as st
from identify_bench import G2, KNOWN, SERIAL
from line_bench import UNIT, Rtu
import pytest
from support.plans import followed
from virtual_wire import DROP, REFUSE, Fate

from nfo_sinus_driver.link.interface import (
    Ask,
    DamagedAnswer,
    Identification,
    LineSettings,
    LinkError,
    NoAnswer,
    NotReady,
    Operation,
    Refused,
    Reply,
)
from nfo_sinus_driver.link.modbus.link import (
    REGULAR,
    DeviceObjects,
    ReadDevice,
    ReportSlaveId,
    questions,
    revision,
    serial_number,
    text,
)
from nfo_sinus_driver.link.modbus.pdu import Request

TIMEOUT = Rtu.settings.response_timeout

# --- what the bytes say ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('data', 'clean'),
    [
        (b'NFO Drives AB', 'NFO Drives AB'),
        (b'  1.50/400 ', '1.50/400'),
        (b'', ''),
        (b'\x00\xff\n', ''),
        (b'Sinus\x00\x00', 'Sinus'),
        # no text of a drive writes a second line into the log, or colours it
        (b'a\nERROR \x1b[31mb', 'a ERROR [31mb'),
    ],
)
def test_text(data: bytes, clean: str) -> None:
    assert text(data) == clean


@given(st.binary(max_size=255))
def test_any_text_is_printable(data: bytes) -> None:
    for said in (text(data), revision(data), serial_number(data)):
        assert said.isascii() and said.isprintable()
        assert said == said.strip()


@pytest.mark.parametrize(
    ('data', 'clean'),
    [
        (b' 4.30 / 4018 ', '4.30 / 4018'),
        (b' 4.30   /   4018 ', '4.30 / 4018'),
        (b'4.30/4018', '4.30 / 4018'),
        (b'4.30', '4.30'),
        (b'/', ''),
        (b'', ''),
    ],
)
def test_revision(data: bytes, clean: str) -> None:
    assert revision(data) == clean


@pytest.mark.parametrize(
    ('report', 'serial'),
    [
        (SERIAL, '0123456789ABCDEF'),
        (b'ABC123          ', 'ABC123'),
        (b'ABC123\x00\x00\x00', 'ABC123'),
        # with the standard's run indicator behind it, before it, and an id before that
        (SERIAL + b'\xff', '0123456789ABCDEF'),
        (SERIAL + b'\x00', '0123456789ABCDEF'),
        (b'\xff' + SERIAL, '0123456789ABCDEF'),
        (b'\x11\xff' + SERIAL, '0123456789ABCDEF'),
        (b'B\x00' + SERIAL, '0123456789ABCDEF'),
        (b'\x11\xff', ''),
        (b' ' * 16, ''),
        (b'', ''),
    ],
)
def test_serial_number(report: bytes, serial: str) -> None:
    assert serial_number(report) == serial


# --- the questions --------------------------------------------------------------------------------


class Script:
    """Answers questions as a unit would, without a line."""

    def __init__(self, *replies: object) -> None:
        self._replies = list(replies)
        self.asked: list[Request[Any]] = []

    def __call__(self, request: Request[object]) -> tuple[object, float]:
        self.asked.append(request)
        reply = self._replies.pop(0)
        if isinstance(reply, Exception):
            raise reply
        return reply, float(len(self.asked))


def answered(question: Operation) -> Reply:
    assert isinstance(question, Ask)
    return question.question()


def test_two_questions_are_enough() -> None:
    script = Script(DeviceObjects(tuple(G2.items())), SERIAL)
    assert followed(questions(1, script)) == KNOWN
    assert script.asked == [ReadDevice(1, REGULAR, 0), ReportSlaveId(1)]


def test_reply_says_when_its_last_byte_came() -> None:
    plan = questions(1, Script(DeviceObjects(()), b''))
    first = answered(next(plan))
    assert [first.arrived, answered(plan.send(first)).arrived] == [1.0, 2.0]


def test_reading_goes_on_where_more_follows() -> None:
    script = Script(
        DeviceObjects(((0, b'NFO'), (1, b'')), 2),
        DeviceObjects(((2, b'4.30/4018'),), 4),
        DeviceObjects(((4, b'NFO Sinus'), (5, b'1.50/400'))),
        SERIAL,
    )
    found = followed(questions(1, script))
    assert (found.vendor, found.revision, found.model) == ('NFO', '4.30 / 4018', '1.50/400')
    assert script.asked[1:3] == [ReadDevice(1, REGULAR, 2), ReadDevice(1, REGULAR, 4)]


@pytest.mark.parametrize('following', [0, 1, 2, 7, 0x80, 255])
def test_only_what_is_ahead_and_known_is_read_on(following: int) -> None:
    script = Script(DeviceObjects((), 2), DeviceObjects((), following), b'')
    followed(questions(1, script))
    assert [type(question) for question in script.asked] == [ReadDevice, ReadDevice, ReportSlaveId]


def test_unknown_objects_are_passed_over() -> None:
    script = Script(DeviceObjects(((0, b'NFO'), (7, b'x'), (0x80, b'y'))), b'')
    assert followed(questions(1, script)) == Identification(vendor='NFO')


@pytest.mark.parametrize('error', [Refused(1), Refused(2), Refused(3), NoAnswer(), DamagedAnswer()])
def test_a_question_without_answer_is_not_asked_again(error: LinkError) -> None:
    script = Script(error, SERIAL)
    assert followed(questions(1, script)) == Identification(serial='0123456789ABCDEF')
    script = Script(DeviceObjects(((0, b'NFO'),)), error)
    assert followed(questions(1, script)) == Identification(vendor='NFO')
    script = Script(DeviceObjects(((0, b'NFO'),), 1), error, error)
    assert followed(questions(1, script)) == Identification(vendor='NFO')
    script = Script(error, error)
    assert followed(questions(1, script)) == Identification()


def test_a_question_that_could_not_be_sent_is_asked_later() -> None:
    script = Script(NotReady(1.0), DeviceObjects(((0, b'NFO'),)), NotReady(2.0), SERIAL)
    plan, reply = questions(1, script), None
    for _ in range(2):
        question = plan.send(reply)
        with pytest.raises(NotReady):
            answered(question)
        reply = answered(question)
    with pytest.raises(StopIteration) as end:
        plan.send(reply)
    assert end.value.value == Identification(vendor='NFO', serial='0123456789ABCDEF')


# --- on a line in virtual time --------------------------------------------------------------------


def identified(bench: Rtu) -> Identification:
    return followed(bench.link.identify(UNIT))


def check_read(bench: Rtu, functions: list[int]) -> None:
    """What is read next is right, and nothing had to be asked before."""
    assert bench.read(Rtu.A).data == bench.answer_of()
    assert bench.functions == [*functions, 3]


@pytest.mark.parametrize('baud', [1200, 19200, 57600])
def test_a_g2_identifies_itself(baud: int) -> None:
    bench = Rtu(settings=LineSettings(baud, response_timeout=TIMEOUT), trusted=True)
    plan = bench.link.identify(UNIT)
    assert bench.functions == [], 'nothing is sent before the first question'
    assert followed(plan) == KNOWN
    bench.wire.check_gaps()
    check_read(bench, [43, 17])


@pytest.mark.parametrize('fate', [DROP, REFUSE])
def test_a_drive_that_does_not_say_it_costs_little(fate: Fate) -> None:
    bench = Rtu(fate, fate, trusted=True)
    before = bench.wire.now
    assert identified(bench) == Identification()
    took = bench.wire.now - before
    assert took < TIMEOUT / 2 if fate is REFUSE else 2 * TIMEOUT < took < 2.5 * TIMEOUT
    check_read(bench, [43, 17])
    # and the quarantine is over
    bench.drive.heal(fate, fate)
    assert identified(bench) == Identification()
    assert bench.functions == [43, 17, 3, 43, 17]


@pytest.mark.parametrize('fate', [Fate(1.2), Fate(1.2, 'refuse'), Fate(what='damage')])
@pytest.mark.parametrize('function', [43, 17])
def test_an_answer_that_fails_leaves_it_empty(function: int, fate: Fate) -> None:
    bench = Rtu(*([fate] if function == 43 else [Fate(), fate]), trusted=True)
    found = identified(bench)
    assert found.vendor == ('' if function == 43 else KNOWN.vendor)
    assert found.serial == ('' if function == 17 else KNOWN.serial)
    check_read(bench, [43, 17])


@pytest.mark.parametrize('cut', [2, 5, 8, 9, 30, 80])
def test_answer_that_stops_in_the_middle(cut: int) -> None:
    bench = Rtu(trusted=True)
    answer = bench.drive.answer
    bench.drive.answer = lambda asked, frame, number: answer(asked, frame, number)[
        : cut if frame[1] == 43 else None
    ]
    before = bench.wire.now
    assert identified(bench) == Identification(serial=KNOWN.serial)
    assert bench.wire.now - before < 3 * TIMEOUT


def test_answer_in_lumps_of_an_adapter() -> None:
    bench = Rtu(trusted=True)
    arrive = bench.wire.arrive

    def in_lumps(at: float, data: bytes, *, lump: bool = False) -> float:
        for number, start in enumerate(range(0, len(data), 31), start=1):
            arrive(at + 0.025 * number, data[start : start + 31], lump=True)
        return at

    bench.wire.arrive = in_lumps  # type: ignore[method-assign]
    assert identified(bench) == KNOWN


def test_doubled_answer_is_noticed() -> None:
    bench = Rtu(Fate(what='double'), trusted=True)
    assert identified(bench) == KNOWN
    check_read(bench, [43, 17])


def test_a_unit_whose_reads_are_in_doubt_can_say_who_it_is() -> None:
    bench = Rtu(DROP, DROP, trusted=True)
    for address in (Rtu.A, Rtu.C):
        bench.expect(NoAnswer, lambda address=address: bench.read(address))
    assert identified(bench) == KNOWN
    assert bench.functions == [3, 3, 43, 17]
