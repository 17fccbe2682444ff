# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``check --turn``: the motor turns slowly, and whatever ends it, it stands afterwards."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import json
from pathlib import Path
import threading
import time
from typing import Any

from cli_bench import QUICK, Bench, MakeBench, wait_until
import pytest

from nfo_sinus_driver.simulator.sinus.serial_side import SerialSide

Answers = list[tuple[str, str | Callable[[], str] | None]]
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
        ('Switch the drive', 'y\n'),
        ('display is dark', act(bench, 'power-cycle', 6.0, then='\n')),
        ('display is up', lambda: time.sleep(6.5) or '\n'),
    ]  # fmt: skip


def found(path: Path) -> dict[str, Any]:
    moments = json.loads(path.read_text())['moments']
    return {moment['name']: moment for moment in moments}


def shares(cells: Mapping[str, Any], *always: str) -> list[Any]:
    """Return the cells of a product, of which these run before every commit: each takes long."""
    return [
        pytest.param(cell, id=name, marks=[pytest.mark.slow] * (name not in always))
        for name, cell in cells.items()
    ]


@pytest.mark.parametrize('options', shares({
    'rtu': {'settings': QUICK},
    'classic': {'settings': QUICK, 'protocol': 'classic'},
    'optimal': {'model': 'sinus_optimal', 'serial_numbers': []},
}, 'rtu'))
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
    assert list(moments) == [name for name in names if name in moments], done.out
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

    def run_on() -> None:
        # another master that does not give up
        until = time.monotonic() + 6.0
        while time.monotonic() < until:
            with bench.simulator.lock:
                bench.drive().write_raw('fieldbus.mode', 3)
                bench.drive().memory.set(bench.drive().control_unit.setpoint_key, 3.0)
                bench.drive().write_raw('fieldbus.scmd', 0x101)
            time.sleep(0.02)

    other = threading.Thread(target=run_on)

    def closed() -> str:
        bench.simulator.inject('run', 'on', address=1)
        other.start()
        return '\n'

    answers: Answers = [
        BEGIN, NO_MORE[0], ('Open the', 'y\n'), (' now', act(bench, 'run', 'off')),
        ('then press Enter', closed), NO_MORE[2],
    ]  # fmt: skip
    done = bench.on_terminal(
        'check', '--turn', '--no-questions', '--report', path, answers=answers
    )
    other.join()
    assert done.status == 1 and found(path)['after input']['as_expected'] is False, done.out


ENDINGS = {
    'enter': '\n', 'ctrl-c': '\x03', 'ctrl-d': 'abc\x04', 'no letter': b'\xff\n'.decode('latin-1'),
    'hangup': None,
}
_MOMENTS = '(--drive-timeout)', 'the line is silent'


@pytest.mark.parametrize('end', shares(
    {f'{name}-{moment}': (moment, typed) for moment in _MOMENTS for name, typed in ENDINGS.items()},
    *(f'{name}-{_MOMENTS[0]}' for name in ENDINGS), f'ctrl-c-{_MOMENTS[1]}',
))
def test_whatever_ends_it_the_motor_stands_for_good(
    make_bench: MakeBench, tmp_path: Path, end: tuple[str, str | None]
) -> None:
    moment, typed = end
    bench = make_bench(settings=QUICK)
    path = tmp_path / 'report.json'
    done = bench.on_terminal(
        'check', '--turn', '--no-questions', '--report', path, answers=[BEGIN, (moment, typed)]
    )
    assert done.status == {'\x03': 130, None: 130}.get(typed, 0), done.out
    wait_until(lambda: bench.stopped)
    assert 'Press STOP' not in done.out
    assert [*found(path)][-1] == 'end'
    time.sleep(1.0)
    assert bench.stopped


def test_enter_while_the_motor_stops_ends_it(make_bench: MakeBench, tmp_path: Path) -> None:
    bench = make_bench(settings={'control.accel': 0.2, 'control.retard': 30.0})
    path = tmp_path / 'report.json'

    def on_the_ramp() -> str:
        wait_until(lambda: bench.state()['frequency'] < -4.5)
        wait_until(lambda: -4.0 < bench.state()['frequency'] < -0.1)
        return '\n'

    done = bench.on_terminal(
        'check', '--turn', '--no-questions', '--report', path,
        answers=[BEGIN, ('(--drive-timeout)', on_the_ramp)],
    )  # fmt: skip
    moments = found(path)
    assert list(moments)[-2:] == ['reverse', 'end'] and done.status == 0, done.out
    assert not bench.state()['driven']


@pytest.mark.parametrize('settings', shares({
    'by speed': {'control.mode': 'Speed'}, '40 Hz': {'motor.f_nom': 40.0},
    'slow ramp': {'control.accel': 120.0},
}, 'by speed'))
def test_what_is_set_at_the_drive_contradicts_nothing(
    make_bench: MakeBench, tmp_path: Path, settings: dict[str, Any]
) -> None:
    bench = make_bench(settings={**QUICK, **settings})
    most = 0.0
    path = tmp_path / 'report.json'

    def look() -> str:
        nonlocal most
        for _ in range(40):
            most = max(most, abs(bench.state()['frequency']))
            time.sleep(0.05)
        return ''

    done = bench.on_terminal(
        'check', '--turn', '--no-questions', '--report', path,
        answers=[BEGIN, ('(--drive-timeout)', look), *NO_MORE],
    )  # fmt: skip
    assert done.status == 0 and 'CONTRADICTED: none' in done.out, done.out
    assert 'NOT AS EXPECTED' not in done.out and most < 5.5
    assert bench.stopped


def test_a_report_that_cannot_be_written_is_refused_before_anything_turns(
    make_bench: MakeBench, tmp_path: Path
) -> None:
    done = make_bench().run('check', '--report', tmp_path / 'nowhere' / 'report.json')
    assert done.status == 2 and 'no folder that can be written to' in done.err
