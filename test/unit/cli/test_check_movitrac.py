# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A MOVITRAC that is otherwise than a reading says is found out by the number of that reading."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

from cli_bench import MakeBench
import pytest

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.cli.check.readings import look, table
from nfo_sinus_driver.cli.check.sight import MovitracSight
from nfo_sinus_driver.cli.check.verdict import Verdict
from nfo_sinus_driver.cli.check.wire import Answer
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.movitrac import Nack
from nfo_sinus_driver.simulator.movitrac31.family import Server

MODEL = 'movitrac31'
EXTERNAL_FAULT, PC_TIMEOUT = 127, 145
#: What answers in place of the drive, by the index; ``None``: the drive.
Turn = Callable[[int], bytes | None]


class Direct:
    """A simulated drive, asked without a line; what it answers may be turned round."""

    has_sum = True

    def __init__(
        self, turn: Turn = lambda index: None, spoiled: bytes = b'', **options: Any
    ) -> None:
        self.drive = simulated_drive(MODEL, **options)
        server = self.drive.servers['movitrac']
        assert isinstance(server, Server)
        self._server = server
        self._turn = turn
        self._spoiled = spoiled
        self.asked: list[int] = []

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        if spoiled:
            return Answer(b'', self._spoiled, 0.001)
        index = int.from_bytes(pdu, 'big')
        self.asked.append(index)
        answer = self._turn(index)
        if answer is None:
            try:
                answer = self._server.enquiry(index)
            except Nack as nack:
                answer = bytes((0xF3, nack.code))
        return Answer(answer, answer, 0.001)


def found(wire: Direct) -> list[tuple[int, str, Verdict]]:
    sight = MovitracSight(wire, load_family(MODEL))
    return [(one.reading.number, one.reading.shows, one.verdict) for one in look(sight, 'movitrac')]


def having(wire: Direct, verdict: Verdict) -> set[int]:
    return {number for number, _, came in found(wire) if came is verdict}


def reads(index: int, data: str) -> Turn:
    """Let an index have other bytes, or be refused."""
    return lambda asked: bytes.fromhex(data) if asked == index else None


TURNED: list[tuple[int, str, Turn, dict[str, Any]]] = [
    # behind the digits, and as the complement of ten
    (70, 'sign_in_bcd', reads(98, '0023700D'), {}),
    (70, 'sign_in_bcd', reads(4, '99998500'), {}),
    (71, 'fault_codes_by_100', reads(8, '00000027'), {}),
    (71, 'fault_codes_by_100', reads(10, '0000270F'), {}),
    (72, 'bytes_of_a_word', reads(284, '14990100'), {}),
    (72, 'half_bytes', reads(302, '0000000000003200'), {}),
    (72, 'half_bytes', reads(304, '080E030000000000'), {}),
    (73, 'bytes_of_the_cards', reads(237, '00000909'), {}),
    (73, 'bytes_of_the_cards', reads(13, '00080000'), {}),
    (74, 'second_voltage', reads(287, '00000100'), {}),
    (78, 'stop_setpoints', reads(299, '00010000'), {}),
    (79, 'process_data', reads(614, '00065535'), {'option_card': 'ffi'}),
    (80, 'manual_operation', reads(196, '00000001'), {}),
    (80, 'manual_operation', reads(197, 'F310'), {}),
    (81, 'missing_option', reads(600, 'F310'), {}),
    (81, 'missing_option', reads(600, 'F317'), {'option_card': 'ffi'}),
    (84, 'no_1000_added', reads(1205, '00000200'), {}),
    (85, 'indices_of_the_list', reads(308, 'F310'), {}),
    (105, 'status_numbers', reads(284, '001A9914'), {}),
    (106, 'no_fault_and_codes', reads(271, '00003100'), {}),
    (106, 'no_fault_and_codes', reads(9, '00002700'), {}),
    (119, 'whole_fault_codes', reads(8, '00002750'), {}),
]


def test_no_reading_is_contradicted_by_a_simulated_drive() -> None:
    wire = Direct()
    assert not having(wire, Verdict.CONTRADICTED)
    assert having(wire, Verdict.CONFIRMED) == {8, 72, 73, 74, 78, 80, 81, 84, 85, 106}


@pytest.mark.parametrize('sign', ['f', '8', '1'])
def test_a_number_below_0_shows_its_sign(sign: str) -> None:
    wire = Direct(negative_sign=sign)
    wire.drive.control_unit.ambient = -10.0
    assert 70 in having(wire, Verdict.CONFIRMED)


def test_a_fault_shows_its_code() -> None:
    wire = Direct()
    wire.drive.trip(EXTERNAL_FAULT)
    assert having(wire, Verdict.CONFIRMED) >= {71, 105, 106, 119}


def test_a_card_shows_process_data_and_half_bytes() -> None:
    wire = Direct(reads(613, '0000047F'), option_card='ffi')
    assert 79 in having(wire, Verdict.CONFIRMED)
    wire = Direct(reads(302, '00000000000F0F0F'), option_card='frs')
    assert ('half_bytes', Verdict.CONFIRMED) in [one[1:] for one in found(wire)]


def test_status_numbers_of_two_digits_are_told_by_the_fault_memory() -> None:
    # 27h could be 39 as well, 45h is no code
    for fault, verdict in ((EXTERNAL_FAULT, Verdict.CONTRADICTED), (PC_TIMEOUT, Verdict.CONFIRMED)):
        wire = Direct(status_numbers='bcd')
        wire.drive.trip(fault)
        assert 105 in having(wire, verdict)


@pytest.mark.parametrize(('number', 'shows', 'turn', 'options'), TURNED)
def test_a_drive_that_is_turned_round_is_found_out(
    number: int, shows: str, turn: Turn, options: dict[str, Any]
) -> None:
    assert (number, shows, Verdict.CONTRADICTED) in found(Direct(turn, **options))


def test_a_drive_with_another_sum_or_none_is_found_out() -> None:
    class Damaged(Direct):
        def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
            return super().ask(pdu, spoiled=spoiled)._replace(pdu=b'')

    came = found(Damaged())
    assert (85, 'sum_of_all_bytes', Verdict.CONTRADICTED) in came
    # what cannot be read tells nothing else
    assert [one for one in came if one[2] is Verdict.CONTRADICTED] == [
        (85, 'sum_of_all_bytes', Verdict.CONTRADICTED)
    ]
    assert 8 in having(Direct(spoiled=bytes.fromhex('F31003')), Verdict.CONTRADICTED)


def test_each_reading_has_its_turn() -> None:
    rows = {(one.number, one.shows) for one in table() if 'movitrac31' in one.families}
    turned = {(number, shows) for number, shows, _, _ in TURNED}
    assert rows == turned | {(85, 'sum_of_all_bytes')}


@pytest.mark.parametrize(('index', 'number'), [(271, 106), (287, 74), (13, 73), (284, 105)])
def test_what_a_drive_refuses_contradicts_nothing_of_it(index: int, number: int) -> None:
    came = found(Direct(reads(index, 'F311')))
    assert [verdict for one, _, verdict in came if one == number] == [Verdict.NOT_SEEN]


@pytest.mark.parametrize('answers_first', [0, 3, 10])
def test_a_drive_that_falls_silent_contradicts_nothing(answers_first: int) -> None:
    wire = Direct(lambda index: b'' if len(wire.asked) > answers_first else None)
    verdicts = {verdict for _, _, verdict in found(wire)}
    assert Verdict.CONTRADICTED not in verdicts
    if not answers_first:
        assert verdicts == {Verdict.NOT_SEEN}


@pytest.mark.parametrize(
    'options',
    [{}, {'echo': True}, {'option_card': 'fio'}],
    ids=['plain', 'echo', 'card'],
)
def test_a_drive_on_its_line_is_as_the_readings_say(
    make_bench: MakeBench, tmp_path: Path, options: dict[str, Any]
) -> None:
    bench = make_bench(model=MODEL, protocol='movitrac', serial_numbers=[], **options)
    path = tmp_path / 'report.json'
    done = bench.run('check', '--report', path)
    assert done.status == 0, done.out + done.err
    assert 'CONTRADICTED: none' in done.out and 'confirmed: C8, C72' in done.out
    assert bench.state()['writes'] == {}
    text = path.read_text()
    assert len(json.loads(text)['registers']) > 200
    assert 'address' not in text and bench.simulator.port not in text


def test_a_motor_that_the_line_runs_runs_on(make_bench: MakeBench) -> None:
    bench = make_bench(model=MODEL, protocol='movitrac', serial_numbers=[])
    with bench.simulator.lock:
        drive = bench.drive()
        for key, value in (
            ('serial.control_mode', 'Remote control'),
            ('fieldbus.remote_setpoint', 10.0),
        ):
            drive.memory.set(key, value)
        drive.write_raw('fieldbus.function_bits', 5)
    done = bench.run('check')
    assert done.status == 2 and 'Stop it first' in done.err
    assert bench.state()['turning'] and not bench.state()['faults']
