# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``check --turn`` over CANopen and on the line of a MOVITRAC."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import os
from pathlib import Path
import signal
import threading
import time
from typing import Any, NamedTuple

from cli_bench import PATIENCE, QUICK, Bench, Done, MakeBench, wait_until
import pytest
from test_check_turn import BEGIN, ENDINGS, NO_MORE, Answers, act, found, shares, with_all
from test_through_plc_cli import behind_plc

from nfo_sinus_driver.simulator.movitrac31.control_unit import MovitracControlUnit
from nfo_sinus_driver.simulator.plc import PlcSetting

SETS_TIMEOUT = '(--drive-timeout)'


class Line(NamedTuple):
    """
    A line with a drive, and how the command gets to it.

    :ivar ramps: how long it takes to its nominal frequency and back, by name.
    :ivar setpoint: where a set-point goes.
    """

    bench: Mapping[str, Any]
    arguments: tuple[str, ...]
    ramps: tuple[str, str]
    setpoint: str


_CAN = {'protocol': 'canopen', 'baud': 125_000}
_CAN_ARGUMENTS = '--baud-rate', '125000', '--yes'
_G2_RAMPS = 'control.accel', 'control.retard'
LINES = {
    'canopen': Line(_CAN, _CAN_ARGUMENTS, _G2_RAMPS, 'status.frq_set'),
    'ds402': Line(
        _CAN, (*_CAN_ARGUMENTS, '--control-method', 'ds402'), _G2_RAMPS,
        'fieldbus.vl_target_velocity',
    ),
    'movitrac': Line(
        {'model': 'movitrac31', 'protocol': 'movitrac', 'serial_numbers': []}, (),
        ('ramp.t11_up', 'ramp.t11_down'), 'fieldbus.remote_setpoint',
    ),
}
#: What is tried to leave the motor turning, over the first version's line, too.
ALL = {'rtu': Line({}, (), _G2_RAMPS, 'status.frq_set'), **LINES}
each_line = pytest.mark.parametrize('line', shares(LINES, 'movitrac'))
each_of_all = pytest.mark.parametrize('line', shares(ALL, 'canopen'))


class Trial:
    """One run of the command on one line, with a report."""

    def __init__(self, make_bench: MakeBench, folder: Path, line: Line, **options: Any) -> None:
        ramps = dict(zip(line.ramps, QUICK.values(), strict=True))
        settings = {**ramps, **options.pop('settings', {})}
        self.bench: Bench = make_bench(**{**line.bench, **options}, settings=settings)
        self.has_stop_key = 'model' not in line.bench
        self._path = folder / 'report.json'
        self._arguments = line.arguments

    def turn(self, *answers: tuple[str, str | Callable[[], str] | None]) -> Done:
        """Let the motor turn; answer what is asked."""
        return self.bench.on_terminal(
            'check', '--turn', '--no-questions', '--report', self._path, *self._arguments,
            answers=[BEGIN, *answers],
        )  # fmt: skip

    @property
    def moments(self) -> dict[str, Any]:
        return found(self._path)

    def without_key(self, answers: Answers) -> Answers:
        """Leave out what is asked of the STOP key, where there is none, and the beginning."""
        kept = answers[1:]
        if self.has_stop_key:
            return kept
        return [one for one in kept if one[0] not in ('Press STOP', 'STOP at the keypad now')]

    @property
    def stands(self) -> bool:
        """The motor stands, and nothing drives it; a bus that keeps control is no matter."""
        state = self.bench.state()
        return not state['driven'] and not state['turning']


@each_line
def test_all_of_it_over(make_bench: MakeBench, tmp_path: Path, line: Line) -> None:
    # an enable that stands at the line alone is none
    movitrac = {} if line.arguments else {'enable_bit': 'anded'}
    trial = Trial(make_bench, tmp_path, line, **movitrac)
    done = trial.turn(*trial.without_key(with_all(trial.bench)))
    moments = trial.moments
    assert not [moment for moment in moments.values() if moment['as_expected'] is False], done.out
    # what is left out says why
    left_out = {name for name, moment in moments.items() if moment['as_expected'] is None}
    if trial.has_stop_key:
        assert left_out == {'silence'}, done.out
        assert 'heartbeat' in moments['silence']['saw'] and 'falls silent' not in done.out
        assert {'keypad', 'after keypad'} <= {*moments}
    else:
        # it has its time-out, too, when its power is back
        assert left_out <= {'keypad', 'power'}, done.out
        assert 'no manual' in moments['keypad']['saw'] and 'STOP at' not in done.out
        assert {'silence', 'acknowledged'} <= {*moments}
    assert {'forward', 'reverse', 'stopped', 'input', 'after input', 'power'} <= {*moments}
    assert moments['reverse']['saw'].startswith('-') and done.status == 0
    wait_until(lambda: trial.stands)


def test_behind_a_plc_it_is_refused(make_bench: MakeBench) -> None:
    bench = behind_plc(make_bench, PlcSetting())
    done = bench.on_terminal('check', '--turn')
    assert done.status == 2 and 'the PLC commands the drive' in done.out, done.out
    assert bench.state()['command_writes'] == {}


_BY_HAND = 'Press STOP', 'STOP at the keypad now'
#: By hand Enter leaves a step out.
_ENDS = [
    *((name, (SETS_TIMEOUT,), typed) for name in LINES for typed in ENDINGS),
    *(('movitrac', ('the line is silent',), typed) for typed in ENDINGS),
    *((name, _BY_HAND, typed) for name in ('canopen', 'ds402') for typed in ('ctrl-c', 'hangup')),
]


# before every commit each line, each ending and each question
@pytest.mark.parametrize(('name', 'asked', 'ends'), [
    pytest.param(*ends, marks=[pytest.mark.slow] * (number % 6 > 0 and ends is not _ENDS[-1]))
    for number, ends in enumerate(_ENDS)
])
def test_whatever_ends_it_the_motor_stands_over(
    make_bench: MakeBench, tmp_path: Path, name: str, asked: tuple[str, ...], ends: str
) -> None:
    trial, typed = Trial(make_bench, tmp_path, LINES[name]), ENDINGS[ends]

    def end() -> str:
        wait_until(lambda: trial.bench.state()['turning'])
        assert typed is not None
        return typed

    yes: Answers = [(text, 'y\n') for text in asked[:-1]]
    done = trial.turn(*yes, (asked[-1], None if typed is None else end))
    assert done.status == {'\x03': 130, None: 130}.get(typed, 0), done.out
    wait_until(lambda: trial.stands)
    assert [*trial.moments][-1] == 'end'
    time.sleep(1.0)
    assert trial.stands


# --- what leaves the motor turning ----------------------------------------------------------------


@each_of_all
def test_enter_before_the_motor_turns_lets_it_not_begin(
    make_bench: MakeBench, tmp_path: Path, line: Line
) -> None:
    trial = Trial(make_bench, tmp_path, line)
    given: list[int] = []
    drive = trial.bench.drive()
    write_raw = drive.write_raw

    def write(key: str, raw: int) -> None:
        if key == line.setpoint:
            given.append(raw)
        write_raw(key, raw)

    drive.write_raw = write  # type: ignore[method-assign]
    done = trial.turn((SETS_TIMEOUT, '\n'))
    assert done.status == 0 and given and not any(given), (given, done.out)
    assert trial.stands


@each_of_all
def test_a_motor_that_another_master_drives_too_fast_is_stopped(
    make_bench: MakeBench, tmp_path: Path, line: Line
) -> None:
    trial = Trial(make_bench, tmp_path, line)
    memory, over = trial.bench.drive().memory, threading.Event()
    fast = 600.0 if 'velocity' in line.setpoint else 20.0

    def drive_it() -> None:
        while not over.wait(0.002):
            with trial.bench.simulator.lock:
                # one that lets it stop
                if memory.raw(line.setpoint):
                    memory.set(line.setpoint, fast)

    other = threading.Thread(target=drive_it)
    other.start()
    try:
        done = trial.turn()
    finally:
        over.set()
        other.join()
    assert done.status == 1 and 'at most: it is stopped' in done.out, done.out
    assert [*trial.moments] == ['control', 'end']
    wait_until(lambda: trial.stands)


@each_of_all
def test_a_trip_is_no_stop_by_hand(make_bench: MakeBench, tmp_path: Path, line: Line) -> None:
    trial = Trial(make_bench, tmp_path, line)
    code = 5 if trial.has_stop_key else 127
    name = 'keypad' if trial.has_stop_key else 'input'
    asked = _BY_HAND if trial.has_stop_key else ('Open the', ' now')
    done = trial.turn(
        (asked[0], 'y\n'), (asked[1], act(trial.bench, 'fault', code)),
        *(() if trial.has_stop_key else [('then press Enter', '\n')]),
        *(NO_MORE[1:] if trial.has_stop_key else NO_MORE[2:]),
    )  # fmt: skip
    assert trial.moments[name]['as_expected'] is None, done.out
    wait_until(lambda: trial.stands)


@pytest.mark.parametrize('did', shares({'done': True, 'not done': False}, 'not done'))
def test_an_input_that_does_not_stop_the_motor_is_found_out(
    make_bench: MakeBench, tmp_path: Path, *, did: bool
) -> None:
    # the enable of the line will do
    trial = Trial(make_bench, tmp_path, LINES['movitrac'], enable_bit='either')

    at_the_question: list[float] = []

    def stopped() -> str:
        at_the_question.append(abs(trial.bench.state()['frequency']))
        return 'y\n' if did else '\n'

    done = trial.turn(
        ('Open the', 'y\n'), (' now', act(trial.bench, 'run', 'off', then='\n')),
        ('Had you done it', stopped),
        *([('then press Enter', act(trial.bench, 'run', 'on', then='\n'))] if did else []),
        NO_MORE[2],
    )  # fmt: skip
    assert trial.moments['input']['as_expected'] is (False if did else None), done.out
    assert done.status == int(did) and at_the_question[0] < 0.3
    wait_until(lambda: trial.stands)


def test_a_time_out_of_a_movitrac_that_stops_nothing_is_found_out(
    make_bench: MakeBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trial = Trial(make_bench, tmp_path, LINES['movitrac'])
    monkeypatch.setattr(MovitracControlUnit, '_watches', False)
    done = trial.turn(*NO_MORE[1:])
    assert done.status == 1 and trial.moments['silence']['as_expected'] is False, done.out
    wait_until(lambda: trial.stands)


@pytest.mark.parametrize('name', shares({'canopen': 'canopen', 'ds402': 'ds402'}, 'ds402'))
def test_stopped_is_a_motor_that_stands(
    make_bench: MakeBench, tmp_path: Path, name: str
) -> None:
    # 5 Hz take 4 s
    line = LINES[name]
    trial = Trial(make_bench, tmp_path, line, settings={line.ramps[1]: 40.0})
    seen: list[float] = []

    def asked() -> str:
        seen.append(abs(trial.bench.state()['frequency']))
        return '\x03'

    # nothing turns it between the stop and the first question
    done = trial.turn(('Press STOP', asked))
    assert done.status == 130 and trial.moments['stopped']['as_expected'], done.out
    assert seen[0] < 0.3
    wait_until(lambda: trial.stands)


def test_a_motor_that_turns_the_wrong_way_is_found_out(
    make_bench: MakeBench, tmp_path: Path
) -> None:
    trial = Trial(make_bench, tmp_path, ALL['rtu'])
    drive = trial.bench.drive()
    read_raw = drive.read_raw

    def read(key: str) -> int:
        raw = read_raw(key)
        return -raw if key == 'status.frq_act' else raw

    drive.read_raw = read  # type: ignore[method-assign]
    done = trial.turn(*NO_MORE)
    assert done.status == 1 and trial.moments['forward']['as_expected'] is False, done.out
    wait_until(lambda: trial.stands)


@each_of_all
def test_a_line_that_dies_while_it_turns_leaves_no_motor_turning(
    make_bench: MakeBench, tmp_path: Path, line: Line
) -> None:
    trial = Trial(make_bench, tmp_path, line)

    def pull() -> str:
        wait_until(lambda: trial.bench.state()['frequency'] > 4.0)
        trial.bench.simulator.inject('line-dead', 30.0)
        return ''

    done = trial.turn((SETS_TIMEOUT, pull))
    assert done.status == 1 and 'NOT confirmed' in done.out, done.out
    # by its own time-out
    assert trial.stands


@each_of_all
def test_a_command_that_is_killed_leaves_no_motor_turning(
    make_bench: MakeBench, tmp_path: Path, line: Line
) -> None:
    trial = Trial(make_bench, tmp_path, line)
    children = Path(f'/proc/{os.getpid()}/task/{threading.get_native_id()}/children')
    before = children.read_text().split()

    def kill() -> str:
        wait_until(lambda: trial.bench.state()['frequency'] > 4.0)
        (process,) = {*children.read_text().split()} - {*before}
        os.kill(int(process), signal.SIGKILL)
        return ''

    assert trial.turn((SETS_TIMEOUT, kill)).status == -signal.SIGKILL
    wait_until(lambda: trial.stands)


def test_a_motor_that_turns_after_its_input_is_closed_is_stopped_before_the_next_question(
    make_bench: MakeBench, tmp_path: Path
) -> None:
    trial = Trial(make_bench, tmp_path, ALL['rtu'])
    bench, turning = trial.bench, []

    def closed() -> str:
        bench.simulator.inject('run', 'on', address=1)
        bench.command_by_bus(3.0)
        # it may be stopped before it turns that fast
        wait_until(lambda: bench.state()['turning'])
        return '\n'

    def asked() -> str:
        turning.append(bench.state()['turning'])
        return '\n'

    done = trial.turn(
        NO_MORE[0], ('Open the', 'y\n'), (' now', act(bench, 'run', 'off')),
        ('then press Enter', closed), (NO_MORE[2][0], asked),
    )  # fmt: skip
    assert done.status == 1 and trial.moments['after input']['as_expected'] is False, done.out
    assert turning == [False]


def test_enter_counts_while_the_drive_is_read(make_bench: MakeBench, tmp_path: Path) -> None:
    trial = Trial(make_bench, tmp_path, ALL['rtu'])
    bench, silent = trial.bench, threading.Event()

    def fall_silent() -> None:
        # what is read at the speed
        if not silent.is_set() and bench.drive().peek('status.frq_act') == 5.0:
            bench.drive().silence(5.0)
            silent.set()

    bench.on_read('fieldbus.mode', fall_silent)
    done = trial.turn((SETS_TIMEOUT, lambda: '\n' if silent.wait(PATIENCE) else 'never'))
    # not only once it answers
    assert [*trial.moments] == ['control', 'end'], done.out
    assert trial.moments['end']['saw'] == 'by Enter', done.out
    wait_until(lambda: trial.stands)


def test_a_drive_that_does_not_tell_what_5_hz_are_is_refused(
    make_bench: MakeBench, tmp_path: Path
) -> None:
    trial = Trial(make_bench, tmp_path, ALL['rtu'], settings={'control.mode': 'Speed'})
    read_raw = trial.bench.drive().read_raw

    def read(key: str) -> int:
        return 0 if key == 'motor.f_nom' else read_raw(key)

    trial.bench.drive().read_raw = read  # type: ignore[method-assign]
    done = trial.turn()
    assert done.status == 1 and 'how many rpm are 5 Hz' in done.out, done.out
    assert trial.bench.state()['command_writes'] == {}
