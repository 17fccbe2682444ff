# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive behind a PLC that is otherwise than a reading says is found out by its number."""

from __future__ import annotations

from collections.abc import Callable
import dataclasses
import json
from pathlib import Path
import time
from typing import Any

from cli_bench import MakeBench
import pytest
from test_through_plc_cli import behind_plc

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.cli.check import sight as sight_module
from nfo_sinus_driver.cli.check.readings import look, table
from nfo_sinus_driver.cli.check.sight import BlockSight
from nfo_sinus_driver.cli.check.verdict import Verdict
from nfo_sinus_driver.cli.check.wire import Answer
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.modbus import Requests
from nfo_sinus_driver.simulator.plc import Plc, PlcSetting

H, G2, OPTIMAL = 'sinus_h', 'sinus_g2', 'sinus_optimal'
PLAIN = PlcSetting()
LONGER = PlcSetting(layout=2, longer_telegram=True)
VENDOR = {'settings': {'com.opt_para_13': 'Vendor Specific Telegram'}}
#: What a block shows in place of its registers.
Turn = Callable[[list[int]], None]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sight_module, '_WATCHED', 0.5)


class Direct:
    """A simulated PLC, asked without a line; what it shows of its block may be turned round."""

    has_sum = False

    def __init__(
        self,
        model: str,
        turn: Turn = lambda words: None,
        setting: PlcSetting = PLAIN,
        **options: Any,
    ) -> None:
        self.drive = simulated_drive(model, **options)
        self.plc = Plc({1: self.drive}, setting)
        (unit,) = self.plc.units
        server = unit.servers['modbus']
        assert isinstance(server, Requests)
        self._server = server
        self._turn = turn
        self.asked: list[bytes] = []
        self._wait(1.0)

    def _wait(self, seconds: float) -> None:
        began = time.monotonic() - seconds
        self._now = getattr(self, '_now', began)
        self.plc.advance_to(self._now)
        self._now += seconds
        self.plc.advance_to(self._now)

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        time.sleep(0.01)
        self._wait(0.01)
        self.asked.append(pdu)
        answer = self._server.answer(pdu)
        if answer[0] == 3:
            words = [int.from_bytes(answer[at : at + 2], 'big') for at in range(2, len(answer), 2)]
            self._turn(words)
            answer = answer[:2] + b''.join(word.to_bytes(2, 'big') for word in words)
        return Answer(answer, answer, 0.001)


def verdicts(wire: Direct, model: str) -> dict[int, Verdict]:
    sight = BlockSight(wire, load_family(model, 'telegram1'), 0)
    return {one.reading.number: one.verdict for one in look(sight, 'telegram1_profidrive')}


def puts(offset: int, word: int) -> Turn:
    """Let a register have another word."""

    def turn(words: list[int]) -> None:
        if offset < len(words):
            words[offset] = word

    return turn


def slowly(words: list[int]) -> None:
    """Let the life counter move every 0.25 s alone."""
    words[2] = int(time.monotonic() / 0.25) % 0x10000


def faulted(words: list[int]) -> None:
    """Let there be a fault of which the alarm information says nothing."""
    words[0] |= 1 << 3


TURNED: list[tuple[int, str, Turn, PlcSetting, dict[str, Any]]] = [
    (55, OPTIMAL, puts(0, 0x0011), PLAIN, {}),
    (63, H, puts(0, 0x0242), PLAIN, {}),
    (64, H, faulted, LONGER, VENDOR),
    (104, H, puts(0, 0x0040), PLAIN, {}),
    (111, G2, puts(0, 0x0045), PLAIN, {}),
    (123, H, puts(5, 1 << 5), LONGER, VENDOR),
    (125, H, slowly, PLAIN, {}),
    (125, G2, slowly, PLAIN, {}),
    (125, OPTIMAL, slowly, PLAIN, {}),
]


@pytest.mark.parametrize(('model', 'confirmed'), [
    (H, {63, 104, 125}), (G2, {111, 125}), (OPTIMAL, {125}),
])
def test_no_reading_is_contradicted_by_a_simulated_drive(model: str, confirmed: set[int]) -> None:
    found = verdicts(Direct(model), model)
    assert Verdict.CONTRADICTED not in found.values()
    assert {number for number, one in found.items() if one is Verdict.CONFIRMED} == confirmed


@pytest.mark.parametrize(('number', 'model', 'turn', 'setting', 'options'), TURNED)
def test_a_drive_that_is_turned_round_is_found_out(
    number: int,
    model: str,
    turn: Turn,
    setting: PlcSetting,
    options: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sight_module, '_WATCHED', 1.2)
    found = verdicts(Direct(model, turn, setting, **options), model)
    assert found[number] is Verdict.CONTRADICTED


def test_echoes_of_a_control_word_are_seen_through_the_block() -> None:
    wire = Direct(OPTIMAL)
    wire.plc.channels[1].block.put(8, (0x0006, 0, 0))
    wire._wait(0.5)
    assert verdicts(wire, OPTIMAL)[55] is Verdict.CONFIRMED
    # bits 1 and 2 of ZSW1 are those of the word, whatever the state
    wire = Direct(H, echo_bits='word')
    wire.plc.channels[1].block.put(8, (0x0408, 0, 0))
    wire._wait(0.5)
    assert verdicts(wire, H)[63] is Verdict.CONTRADICTED


def test_a_longer_telegram_is_seen_and_a_fault_in_it() -> None:
    wire = Direct(H, setting=LONGER, **VENDOR)
    assert verdicts(wire, H)[123] is Verdict.CONFIRMED
    wire.drive.trip(1)
    wire._wait(0.5)
    found = verdicts(wire, H)
    assert found[64] is Verdict.CONFIRMED and found[63] is Verdict.NOT_SEEN


@pytest.mark.parametrize('model', [H, G2, OPTIMAL])
def test_a_plc_without_valid_data_contradicts_nothing(model: str) -> None:
    for turn in (puts(3, 0), puts(3, 1 << 1), puts(4, 7)):
        found = verdicts(Direct(model, turn), model)
        assert Verdict.CONTRADICTED not in found.values(), found
    # a program that stands shows old data as valid
    wire = Direct(model)
    wire.plc.stopped_until = float('inf')
    assert verdicts(wire, model)[125] is Verdict.NOT_SEEN


def test_a_drive_that_is_not_released_is_commanded_elsewhere() -> None:
    wire = Direct(H, puts(0, 0x0040), PlcSetting(released=False))
    assert verdicts(wire, H)[104] is Verdict.NOT_SEEN


def test_each_reading_has_its_turn_and_only_the_block_is_read() -> None:
    rows = [
        one for one in table()
        if one.part == 'read' and any(name.startswith('telegram1') for name in one.protocols)
    ]
    turned = {(number, model) for number, model, *_ in TURNED}
    assert turned == {
        (one.number, model) for one in rows for model in (H, G2, OPTIMAL)
        if one.fits(model, 'telegram1_profidrive')
    }
    wire = Direct(H)
    sight = BlockSight(wire, load_family(H, 'telegram1'), 0)
    list(sight.registers())
    list(look(sight, 'telegram1_profidrive'))
    assert {pdu[0] for pdu in wire.asked} == {3}


@pytest.mark.parametrize('model', [H, G2, OPTIMAL])
def test_a_drive_behind_a_plc_is_as_the_readings_say(
    make_bench: MakeBench, tmp_path: Path, model: str
) -> None:
    setting = dataclasses.replace(LONGER, longer_telegram=False)
    bench = behind_plc(make_bench, setting, model=model, serial_numbers=[])
    path = tmp_path / 'report.json'
    done = bench.run('check', '--report', path)
    assert done.status == 0, done.out + done.err
    assert 'CONTRADICTED: none' in done.out and 'C125' in done.out
    assert 'functions' not in done.out
    found = json.loads(path.read_text())
    assert found['protocol'] == 'telegram1_profidrive' and len(found['registers']) >= 2
    assert {request[7] for request in bench.requests()} == {3}
