# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``check --turn``: the motor turns slowly, and whatever ends it, it stands afterwards."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
import time
from typing import Any

from cli_bench import QUICK, Bench, MakeBench, wait_until
import pytest

from nfo_sinus_driver.simulator.sinus.serial_side import SerialSide

Answers = list[tuple[str, str | Callable[[], str]]]
BEGIN = ('Type TURN to begin', 'TURN\n')
NO_MORE = [('Press STOP', '\n'), ('Open the', '\n'), ('Switch the drive', '\n')]


def act(bench: Bench, *injection: object, then: str = '') -> Callable[[], str]:
    """Return what lets something happen, and answers then."""

    def do() -> str:
        bench.simulator.inject(*injection, address=1)
        return then

    return do


def with_all(bench: Bench) -> Answers:
    def press_stop() -> str:
        # a person takes longer than a set-point counts
        time.sleep(3.0)
        assert bench.state()['frequency'] > 4.0
        return act(bench, 'keypad', 'stop')()

    return [
        BEGIN,
        ('Press STOP', 'y\n'), ('STOP at the keypad now', press_stop),
        ('Open the', 'y\n'), (' now', act(bench, 'run', 'off')),
        ('then press Enter', act(bench, 'run', 'on', then='\n')),
        ('Switch the drive', 'y\n'), ('off now', act(bench, 'power-cycle', 4.0)),
    ]  # fmt: skip


def found(path: Path) -> dict[str, Any]:
    moments = json.loads(path.read_text())['moments']
    return {moment['name']: moment for moment in moments}


@pytest.mark.parametrize('options', [
    {'settings': QUICK},
    {'settings': QUICK, 'protocol': 'classic'},
    {'model': 'sinus_optimal', 'serial_numbers': []},
], ids=['rtu', 'classic', 'optimal'])
def test_all_of_it(make_bench: MakeBench, tmp_path: Path, options: dict[str, Any]) -> None:
    bench = make_bench(**options)
    path = tmp_path / 'report.json'
    done = bench.on_terminal(
        'check', '--turn', '--no-questions', '--report', path, answers=with_all(bench)
    )
    assert done.status == 0, done.out
    moments = found(path)
    names = ['control', 'forward', 'reverse', 'stopped', 'silence', 'acknowledged', 'keypad']
    names += ['after keypad', 'input', 'after input', 'power']
    assert list(moments) == [name for name in names if name in moments]
    # an Optimal has no time-out of its own
    left_out = {name for name, moment in moments.items() if moment['as_expected'] is None}
    assert left_out == ({'silence'} if 'model' in options else set()), done.out
    assert not [moment for moment in moments.values() if moment['as_expected'] is False], done.out
    assert bench.stopped


def test_enter_stops_the_motor_and_ends_it(make_bench: MakeBench, tmp_path: Path) -> None:
    bench = make_bench(settings={'control.accel': 30.0, 'control.retard': 1.0})
    path = tmp_path / 'report.json'

    def enter() -> str:
        wait_until(lambda: bench.state()['frequency'] > 0.2)
        return '\n'

    done = bench.on_terminal(
        'check', '--turn', '--no-questions', '--report', path,
        answers=[BEGIN, ('(--drive-timeout)', enter)],
    )  # fmt: skip
    moments = found(path)
    assert done.status == 0, done.out
    assert moments['end']['saw'] == 'by Enter' and 'reverse' not in moments, done.out
    assert bench.stopped


@pytest.mark.parametrize('word', ['', 'turn', 'y'])
def test_without_the_word_nothing_is_written(make_bench: MakeBench, word: str) -> None:
    bench = make_bench()
    done = bench.on_terminal(
        'check', '--turn', '--no-questions', answers=[(BEGIN[0], f'{word}\n')]
    )
    assert done.status == 0 and 'nothing was turned' in done.out, done.out
    assert bench.state()['writes'] == bench.state()['command_writes'] == {}


def test_without_a_terminal_it_does_not_begin(make_bench: MakeBench) -> None:
    done = make_bench().run('check', '--turn', text='TURN\n')
    assert done.status == 2 and 'needs a terminal' in done.err


def test_a_time_out_that_does_not_stop_the_motor_is_found_out(
    make_bench: MakeBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make_bench(settings=QUICK)
    # a drive that says ON, and does not keep it
    monkeypatch.setattr(SerialSide, 'timed_out', False)
    path = tmp_path / 'report.json'
    done = bench.on_terminal(
        'check', '--turn', '--no-questions', '--report', path, answers=[BEGIN, *NO_MORE]
    )
    moments = found(path)
    assert done.status == 1 and moments['silence']['as_expected'] is False, done.out
    assert 'silence: NOT AS EXPECTED' in done.out and 'C92' in done.out
    assert bench.stopped


def test_a_motor_that_turns_after_its_input_is_closed_again_is_found_out(
    make_bench: MakeBench, tmp_path: Path
) -> None:
    bench = make_bench(settings=QUICK)
    path = tmp_path / 'report.json'

    def closed() -> str:
        bench.simulator.inject('run', 'on', address=1)
        bench.run_by_bus(3.0)
        return '\n'

    answers: Answers = [
        BEGIN, NO_MORE[0], ('Open the', 'y\n'), (' now', act(bench, 'run', 'off')),
        ('then press Enter', closed), NO_MORE[2],
    ]  # fmt: skip
    done = bench.on_terminal(
        'check', '--turn', '--no-questions', '--report', path, answers=answers
    )
    assert done.status == 1 and found(path)['after input']['as_expected'] is False, done.out
    assert bench.stopped
