# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``check``: what it asks a drive, what it tells, and what stays with the owner of the drive."""

from __future__ import annotations

import io
import json
from pathlib import Path
import re
import sys

from cli_bench import MakeBench
import pytest
from support.described import SHIPPED

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.cli.check.sight import ModbusSight
from nfo_sinus_driver.cli.check.verb import Check, _questions
from nfo_sinus_driver.cli.check.verdict import Verdict
from nfo_sinus_driver.cli.check.wire import Answer
from nfo_sinus_driver.simulator.family import simulated_drive


@pytest.mark.parametrize(
    'options',
    [
        {},
        {'protocol': 'modbus_ascii'},
        {'echo': True},
        {'protocol': 'modbus_tcp'},
        {'protocol': 'classic'},
        {'protocol': 'classic', 'echo': True},
        {'model': 'sinus_optimal', 'serial_numbers': []},
        {'model': str(SHIPPED['yaskawa_v1000']), 'serial_numbers': []},
    ],
    ids=[
        'rtu', 'ascii', 'echo', 'tcp', 'classic', 'classic, echo', 'optimal', 'described',
    ],
)
def test_a_drive_is_as_the_readings_say(make_bench: MakeBench, options: dict[str, object]) -> None:
    model = str(options.get('model', 'sinus_g2'))
    bench = make_bench(**options)
    more: tuple[object, ...] = ()
    if model.endswith('.yaml'):
        bench.options = tuple(given for given in bench.options if given not in ('--model', model))
        # the line is not that of its factory
        more = '--family', model, '--address', 1, '--baud-rate', 19200, '--char-format', '8E1'
    done = bench.run('check', *more)
    assert done.status == 0, done.out + done.err
    assert 'CONTRADICTED: none' in done.out
    protocol = options.get('protocol')
    assert ('C44' if protocol == 'classic' else 'C87') in done.out
    has_sum = protocol not in ('modbus_tcp', 'classic')
    assert (re.search(r'confirmed: .*\bC8\b', done.out) is not None) is has_sum
    assert bench.state()['writes'] == bench.state()['command_writes'] == {}


def test_a_file_to_send_has_nothing_that_tells_whose_drive_it_is(
    make_bench: MakeBench, tmp_path: Path
) -> None:
    bench = make_bench()
    path = tmp_path / 'report.json'
    assert bench.run('check', '--report', path).status == 0
    text = path.read_text()
    found = json.loads(text)
    assert found['model'] == 'sinus_g2' and len(found['registers']) > 100
    assert {one['verdict'] for one in found['readings']} == {'confirmed', 'not seen'}
    serial = 'NFO1001'
    encoded = serial.encode()
    own = (serial, encoded.hex(), encoded.hex(' '), encoded[:6].hex(' ', 2), str(tmp_path))
    assert all(each.lower() not in text.lower() for each in own)
    assert bench.simulator.port not in text and 'serial.address' not in text
    # another one does not replace it
    again = bench.run('check', '--report', path)
    assert again.status == 2 and 'exists: name another file' in again.err
    assert path.read_text() == text


def test_a_drive_that_is_otherwise_ends_with_1(make_bench: MakeBench) -> None:
    bench = make_bench()
    server = bench.drive().servers['modbus']
    read = server.read
    server.read = lambda register, count: (4,) if register == 0x294 else read(register, count)
    done = bench.run('check')
    assert done.status == 1
    assert 'CONTRADICTED:\n  C51 MODE is 0 to 3: 0294h: 0004h' in done.out


@pytest.mark.parametrize('model', ['sinus_g2', 'sinus_optimal'])
def test_a_motor_that_the_bus_runs_runs_on(make_bench: MakeBench, model: str) -> None:
    bench = make_bench(model=model, serial_numbers=[])
    bench.run_by_bus()
    done = bench.run('check')
    assert done.status == 2 and 'Stop it first' in done.err
    assert bench.state()['turning'] and not bench.state()['faults']


def test_a_file_of_ones_own_is_not_named(make_bench: MakeBench, tmp_path: Path) -> None:
    mine = tmp_path / 'acme_hall_3.vfd.yaml'
    mine.write_text(SHIPPED['yaskawa_v1000'].read_text())
    bench = make_bench(model=str(mine), serial_numbers=[])
    bench.options = bench.options[:4]
    line = ('--address', 1, '--baud-rate', 19200, '--char-format', '8E1')
    done = bench.run('check', '--family', mine, *line, '--json')
    assert done.status == 0 and 'acme' not in done.out, done.out


@pytest.mark.parametrize('port', ['[::1]:1', '127.0.0.1', 'socket://127.0.0.1:1', 'nowhere:x'])
def test_a_port_that_is_none_is_a_sentence(make_bench: MakeBench, port: str) -> None:
    done = make_bench().run('check', '--protocol', 'modbus_tcp', '--port', port)
    assert done.status == 2 and 'Traceback' not in done.err and done.err.startswith('nfo-sinus')


def test_without_an_answer_it_ends_with_2(make_bench: MakeBench) -> None:
    bench = make_bench()
    done = bench.run('check', '--address', 9)
    assert done.status == 2 and 'no response from address 9: check' in done.err
    done = bench.run('check', '--protocol', 'movitrac')
    assert done.status == 2 and 'no sinus_g2 is on a line of movitrac' in done.err


class _Direct:
    has_sum = True

    def __init__(self) -> None:
        self.drive = simulated_drive('sinus_g2')

    def ask(self, pdu: bytes, *, spoiled: bool = False) -> Answer:
        answer = self.drive.servers['modbus'].answer(pdu)
        return Answer(answer, answer, 0.001)


@pytest.mark.parametrize(('typed', 'verdict'), [
    ('1.5\n', Verdict.CONFIRMED),
    ('1,5\n', Verdict.CONFIRMED),
    ('a lot\n1.5\n', Verdict.CONFIRMED),
    ('15\n', Verdict.CONTRADICTED),
    ('\n', Verdict.NOT_SEEN),
    ('', Verdict.NOT_SEEN),
])
def test_a_question_is_answered_by_what_the_keypad_shows(
    typed: str,
    verdict: Verdict,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    model = load_family('sinus_g2')
    registers = list(ModbusSight(_Direct(), model).registers())
    # the second question is left out
    monkeypatch.setattr(sys, 'stdin', io.StringIO(f'{typed}\n'))
    seen = list(_questions(model, registers, 'modbus_rtu', asks=True))
    assert seen[0].reading.number == 15 and seen[0].verdict is verdict
    asked = capsys.readouterr().err
    assert 'reads 1.5 kW (05DCh 0000h). What does the keypad show, in kW?' in asked


def test_it_is_a_verb_that_writes_nothing() -> None:
    assert 'nothing is written' in str(Check.__doc__)
