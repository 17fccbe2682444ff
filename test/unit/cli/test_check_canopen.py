# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A node that is otherwise than a reading says is found out by the number of that reading."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

from cli_bench import MakeBench, wait_until
import pytest

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.cli.check.readings import look, table
from nfo_sinus_driver.cli.check.sight import CanopenSight
from nfo_sinus_driver.cli.check.verdict import Verdict
from nfo_sinus_driver.cli.check.wire import Answer, CanWire
from nfo_sinus_driver.link.canopen.can import Frame
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.sdo import Abort
from nfo_sinus_driver.simulator.sinus_g2.servers import CanopenServer

#: What answers in place of the drive, by the object; ``None``: the drive.
Turn = Callable[[int, int], bytes | None]


class Direct:
    """A simulated node, asked without a bus; what it answers may be turned round."""

    has_sum = False

    def __init__(self, turn: Turn = lambda index, sub: None, **options: Any) -> None:
        server = simulated_drive('sinus_g2', **options).servers['canopen']
        assert isinstance(server, CanopenServer)
        self._server = server
        self._turn = turn
        self.asked: list[bytes] = []

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        self.asked.append(pdu)
        index, sub = int.from_bytes(pdu[:2], 'big'), pdu[2]
        answer = self._turn(index, sub)
        if answer is None:
            try:
                answer = b'\x40' + self._server.read(index, sub)
            except Abort as abort:
                answer = b'\x80' + abort.code.to_bytes(4, 'big')
        return Answer(answer, answer, 0.001)


def verdicts(wire: Direct) -> dict[int, Verdict]:
    sight = CanopenSight(wire, load_family('sinus_g2'))
    return {one.reading.number: one.verdict for one in look(sight, 'canopen')}


def reads(index: int, answer: str) -> Turn:
    return lambda asked, sub: bytes.fromhex(answer) if asked == index else None


TURNED: list[tuple[int, Turn, dict[str, Any]]] = [
    (2, lambda index, sub: None, {'canopen_error_log': 'none'}),
    (102, reads(0x2026, '8006020000'), {}),
    (102, reads(0x2026, '40FF00'), {}),
    (121, reads(0x6041, '8006020000'), {}),
]


@pytest.mark.parametrize('options', [
    {}, {'canopen_error_log': '4F7D'}, {'canopen_sub_indices': 'from_zero'},
    {'canopen_types': 'narrow'}, {'canopen_types': 'wide'}, {'canopen_profile': 'bare'},
])
def test_no_reading_is_contradicted_by_a_simulated_node(options: dict[str, Any]) -> None:
    assert verdicts(Direct(**options)) == dict.fromkeys((2, 102, 121), Verdict.CONFIRMED)


@pytest.mark.parametrize(('number', 'turn', 'options'), TURNED)
def test_a_node_that_is_turned_round_is_found_out(
    number: int, turn: Turn, options: dict[str, Any]
) -> None:
    assert verdicts(Direct(turn, **options))[number] is Verdict.CONTRADICTED


def test_each_reading_has_its_turn() -> None:
    rows = {one.number for one in table() if one.part == 'read' and 'canopen' in one.protocols}
    assert rows == {number for number, _, _ in TURNED}


def test_a_silent_node_contradicts_nothing() -> None:
    assert set(verdicts(Direct(lambda index, sub: b'')).values()) == {Verdict.NOT_SEEN}


@pytest.mark.parametrize('options', [{}, {'canopen_sub_indices': 'from_zero'}])
def test_no_fault_is_acknowledged(options: dict[str, Any]) -> None:
    wire = Direct(**options)
    wire._server.drive.trip(5)
    sight = CanopenSight(wire, load_family('sinus_g2'))
    list(sight.registers())
    list(look(sight, 'canopen'))
    assert wire._server.drive.faults
    # the sub-index that acknowledges, wherever they begin
    assert not {pdu for pdu in wire.asked if pdu in (b'\x20\x26\x00', b'\x20\x26\x01')}


class Bus:
    """A port whose frames are given."""

    place = trouble = remark = ''

    def __init__(self, *came: Frame) -> None:
        self.sent: list[Frame] = []
        self._came = list(came)

    def open(self) -> None:
        """Nothing to do."""

    def close(self) -> None:
        """Nothing to do."""

    def send(self, frame: Frame) -> None:
        self.sent.append(frame)

    def receive(self, until: float) -> list[Frame]:
        return [self._came.pop(0)] if self._came else []


@pytest.mark.parametrize(('came', 'pdu'), [
    ('4B05200034120000', '403412'),
    ('4F05200034000000', '4034'),
    ('4305200078563412', '4078563412'),
    ('4205200078563412', '4078563412'),
    ('8005200000000206', '8006020000'),
    # in segments
    ('4105200009000000', ''),
])
def test_an_answer_is_what_names_the_object(came: str, pdu: str) -> None:
    other = Frame(0x581, bytes.fromhex('4B06200099990000')), Frame(0x582, bytes.fromhex(came))
    bus = Bus(*other, Frame(0x581, bytes.fromhex(came)))
    answer = CanWire(bus, 1, 0.05).ask(bytes.fromhex('200500'))
    assert answer.pdu == bytes.fromhex(pdu)
    assert bus.sent == [Frame(0x601, bytes.fromhex('4005200000000000'))]
    assert answer.refused_with == (0x06020000 if pdu.startswith('80') else None)


def test_a_node_on_its_bus_is_as_the_readings_say(make_bench: MakeBench, tmp_path: Path) -> None:
    bench = make_bench(protocol='canopen', baud=125_000)
    bench.options += ('--baud-rate', '125000')
    bench.simulator.inject('keypad', 'ext', address=1)
    wait_until(lambda: bench.state()['driven'])
    # it may stop a motor that terminals run
    done = bench.run('check')
    assert done.status == 2 and 'say so with --yes' in done.err
    assert bench.state()['driven'] and bench.requests() == []
    # it does, and is no motor at standstill yet
    done = bench.run('check', '--yes')
    assert done.status == 2 and 'the motor runs by the bus' in done.err
    wait_until(lambda: not bench.state()['driven'])
    path = tmp_path / 'report.json'
    done = bench.run('check', '--yes', '--report', path)
    assert done.status == 0, done.out + done.err
    assert 'CONTRADICTED: none' in done.out and 'confirmed: C2, C102, C121' in done.out
    assert bench.state()['writes'] == bench.state()['command_writes'] == {}
    text = path.read_text()
    assert len(json.loads(text)['registers']) > 100 and 'NFO1001' not in text
