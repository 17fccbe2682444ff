# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive that is otherwise than a reading says is found out by the number of that reading."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import re

import pytest

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.cli.check import readings
from nfo_sinus_driver.cli.check.readings import look, table
from nfo_sinus_driver.cli.check.sight import ClassicSight, ModbusSight
from nfo_sinus_driver.cli.check.verdict import Verdict
from nfo_sinus_driver.cli.check.wire import NAK, Answer, TcpWire
from nfo_sinus_driver.simulator.classic import Wrong
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.sinus_g2.servers import ClassicServer

_PAGE = Path(__file__).resolve().parents[3] / 'docs' / 'readings.md'
G2, OPTIMAL = 'sinus_g2', 'sinus_optimal'
#: What answers in place of the drive, by the request; ``None``: the drive.
Turn = Callable[[bytes], bytes | None]
#: The same of Classic, by the number of the parameter and the drive's own frame.
ClassicTurn = Callable[[int, bytes], Answer | None]


class Direct:
    """A simulated drive, asked without a line; what it answers may be turned round."""

    has_sum = True

    def __init__(self, model: str, turn: Turn = lambda pdu: None, spoiled: bytes = b'') -> None:
        self.drive = simulated_drive(model)
        self._turn = turn
        self._spoiled = spoiled

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        if spoiled:
            return Answer(b'', self._spoiled, 0.001)
        turned = self._turn(pdu)
        answer = self.drive.servers['modbus'].answer(pdu) if turned is None else turned
        return Answer(answer, answer, 0.001)


class DirectClassic:
    """A simulated G2, asked over Classic without a line."""

    has_sum = True

    def __init__(self, turn: ClassicTurn = lambda number, frame: None) -> None:
        server = simulated_drive(G2).servers['classic']
        assert isinstance(server, ClassicServer)
        self._server = server
        self._turn = turn

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        assert not spoiled
        number = int.from_bytes(pdu, 'big')
        try:
            word = self._server.enquiry(number).to_bytes(2, 'big')
        except Wrong:
            word = NAK
        body = b'E' + pdu.hex().upper().encode() + b'=' + word.hex().upper().encode() + b'\x03'
        frame = b'!\x15' if word == NAK else b'!\x02' + body + b'?'
        return self._turn(number, frame) or Answer(word, frame, 0.001)


def classic_verdicts(wire: DirectClassic) -> dict[int, Verdict]:
    sight = ClassicSight(wire, load_family(G2))
    return {seen.reading.number: seen.verdict for seen in look(sight, 'classic')}


def verdicts(wire: Direct, model: str) -> dict[int, Verdict]:
    sight = ModbusSight(wire, load_family(model))
    return {seen.reading.number: seen.verdict for seen in look(sight, 'modbus_rtu')}


def reads(register: int, *words: int) -> Turn:
    """Let a register have other words, by function 03."""

    def turn(pdu: bytes) -> bytes | None:
        if pdu[:3] != bytes((3, *register.to_bytes(2, 'big'))):
            return None
        return bytes((3, 2 * len(words))) + b''.join(word.to_bytes(2, 'big') for word in words)

    return turn


def refuses(function: int, register: int | None = None) -> Turn:
    """Let a function, or one register by it, be refused."""
    head = bytes((function,)) + (b'' if register is None else register.to_bytes(2, 'big'))
    code = 1 if register is None else 2
    return lambda pdu: bytes((function | 0x80, code)) if pdu.startswith(head) else None


def answers(request: str, response: str) -> Turn:
    wanted = bytes.fromhex(request)
    return lambda pdu: bytes.fromhex(response) if pdu == wanted else None


TURNED = [
    (4, G2, reads(0xC080, 0x1234, 0x0500)),
    (16, G2, reads(0x26A, 0, 0)),
    (23, G2, reads(0x454, 200)),
    (23, G2, reads(0x454, 0xFF00)),
    (24, G2, refuses(3, 0x258)),
    (24, G2, reads(0x258, 0x0040, 0x8000)),
    (45, G2, answers('2B0E0100', '2B0E01820000010204' + b'4.38'.hex())),
    (47, G2, refuses(3, 0x2A5)),
    (47, OPTIMAL, refuses(3, 0x2A5)),
    (50, OPTIMAL, reads(0x258, 1 << 3)),
    (50, OPTIMAL, reads(0x2A5, 5)),
    (51, G2, reads(0x294, 4)),
    (51, OPTIMAL, reads(0x294, 0)),
    (52, OPTIMAL, reads(0x298, 3)),
    (53, OPTIMAL, refuses(3, 0x518)),
    (57, G2, answers('0402A50001', '04020018')),
    (57, G2, refuses(17)),
    (57, OPTIMAL, refuses(4)),
    (58, OPTIMAL, refuses(3, 0x2AC)),
    (59, OPTIMAL, reads(0x2A5, 64)),
    (87, G2, reads(0xFFF0, 0)),
    (87, OPTIMAL, answers('03FFF00001', '8303')),
    (89, G2, refuses(3, 0x264)),
    (94, G2, answers('11', '1105414243')),
    (95, G2, reads(0x258, 1 << 7, 0)),
    (95, G2, reads(0x2A5, 5)),
]


CLASSIC_TURNED: list[tuple[int, ClassicTurn]] = [
    (4, lambda number, frame: Answer(b'\5\0', frame, 0.1) if number == 0x240 else None),
    (25, lambda number, frame: Answer(NAK, frame, 0.1) if number == 0xE2 else None),
    # whole, but for its sum
    (44, lambda number, frame: Answer(b'', frame, 0.1) if number == 0xE9 else None),
    (86, lambda number, frame: Answer(b'\0\0', frame.lower(), 0.1)),
]


def test_no_reading_is_contradicted_by_a_simulated_drive_on_classic() -> None:
    assert classic_verdicts(DirectClassic()) == dict.fromkeys((4, 25, 44, 86), Verdict.CONFIRMED)


@pytest.mark.parametrize(('number', 'turn'), CLASSIC_TURNED)
def test_a_drive_that_is_turned_round_on_classic_is_found_out(
    number: int, turn: ClassicTurn
) -> None:
    assert classic_verdicts(DirectClassic(turn))[number] is Verdict.CONTRADICTED


@pytest.mark.parametrize('model', [G2, OPTIMAL])
def test_no_reading_is_contradicted_by_a_simulated_drive(model: str) -> None:
    found = verdicts(Direct(model), model)
    assert Verdict.CONTRADICTED not in found.values(), found
    assert list(found.values()).count(Verdict.CONFIRMED) >= len(found) / 2


@pytest.mark.parametrize('model', [G2, OPTIMAL])
def test_what_a_fault_shows_is_confirmed_while_there_is_one(model: str) -> None:
    wire = Direct(model)
    wire.drive.trip(5)
    wire.drive.advance(1.0)
    assert verdicts(wire, model)[95 if model == G2 else 50] is Verdict.CONFIRMED


@pytest.mark.parametrize(('number', 'model', 'turn'), TURNED)
def test_a_drive_that_is_turned_round_is_found_out(number: int, model: str, turn: Turn) -> None:
    assert verdicts(Direct(model, turn), model)[number] is Verdict.CONTRADICTED


def test_a_drive_that_answers_a_wrong_sum_is_found_out() -> None:
    wire = Direct(G2, spoiled=bytes.fromhex('0183020FF1'))
    assert verdicts(wire, G2)[8] is Verdict.CONTRADICTED


def test_each_reading_that_is_read_has_its_function_and_its_turn() -> None:
    of_page = set(map(int, re.findall(r'^(\d+)\. ', _PAGE.read_text(), re.MULTILINE)))
    read = [reading for reading in table() if reading.part == 'read']
    assert {reading.shows for reading in read} == set(readings.looks())
    turned = {(number, model) for number, model, _ in TURNED}
    turned |= {(number, G2) for number, _ in CLASSIC_TURNED}
    every = {
        (one.number, model) for one in read for model in one.families & {G2, OPTIMAL}
        if any(one.fits(model, protocol) for protocol in ('modbus_rtu', 'classic'))
    }
    assert every == turned - {(87, G2), (87, OPTIMAL)}
    assert {reading.number for reading in table()} <= of_page


def test_nothing_is_read_that_has_an_effect() -> None:
    asked: list[bytes] = []
    for model in (G2, OPTIMAL):
        sight = ModbusSight(Direct(model, lambda pdu: asked.append(pdu)), load_family(model))
        list(sight.registers())
        list(look(sight, 'modbus_rtu'))
    assert {pdu[0] for pdu in asked} <= {3, 4, 8, 17, 43}
    # what acknowledges a fault
    assert not [pdu for pdu in asked if pdu[:3] == bytes.fromhex('0302A4')]


@pytest.mark.parametrize('model', [G2, OPTIMAL])
@pytest.mark.parametrize('answers_first', [0, 3, 10])
def test_a_drive_that_falls_silent_contradicts_nothing(model: str, answers_first: int) -> None:
    asked: list[bytes] = []

    def turn(pdu: bytes) -> bytes | None:
        asked.append(pdu)
        return b'' if len(asked) > answers_first else None

    found = verdicts(Direct(model, turn), model)
    assert Verdict.CONTRADICTED not in found.values()
    if not answers_first:
        assert set(found.values()) == {Verdict.NOT_SEEN}


def test_one_request_without_an_answer_confirms_nothing() -> None:
    of_entry_33 = bytes.fromhex('03C0800002')
    wire = Direct(G2, lambda pdu: b'' if pdu == of_entry_33 else None)
    assert verdicts(wire, G2)[4] is Verdict.NOT_SEEN


class LateGateway:
    """A gateway that answers each request with the next one, and says itself what it lacks."""

    def __init__(self) -> None:
        self._drive = simulated_drive(G2)
        self._kept = b''

    def open(self) -> None:
        """Nothing to do."""

    def connected(self, until: float) -> bool:
        return True

    def write(self, data: bytes) -> None:
        answer = self._drive.servers['modbus'].answer(data[7:])
        if data[7:] == bytes.fromhex('03FFF00001'):
            answer = bytes.fromhex('830B')
        frame = data[:4] + (len(answer) + 1).to_bytes(2, 'big') + data[6:7] + answer
        # the end of each comes with the next one
        self._kept += frame

    def read(self, until: float) -> bytes:
        piece, self._kept = self._kept[:9], self._kept[9:]
        return piece

    def close(self, *, discard: bool = False) -> None:
        """Nothing to do."""


def test_a_gateway_that_answers_late_or_itself_is_no_drive() -> None:
    connection = LateGateway()
    # an answer to a request of before, and a half
    connection.write(bytes.fromhex('00630000000601 0302940001'))
    wire = TcpWire(connection, 1, 0.5)
    found = {
        seen.reading.number: seen.verdict
        for seen in look(ModbusSight(wire, load_family(G2)), 'modbus_tcp')
    }
    assert Verdict.CONTRADICTED not in found.values()
    assert found[47] is Verdict.CONFIRMED and found[87] is Verdict.NOT_SEEN
