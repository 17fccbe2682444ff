# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``set``, ``dump``, ``load`` and ``diff``: from drive to file to drive, whole, or not at all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import itertools
import json
import os
from pathlib import Path
import shlex
import signal
import subprocess
import sys
import threading

from cli_bench import PATIENCE, Bench, Done, signals_until_it_ends, wait_until
import pytest
from support.places import ROOT

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.cli import read, transfer
from nfo_sinus_driver.cli.parameter_file import parse_file
from nfo_sinus_driver.simulator.memory import Reason, Refused

Nfo = Callable[..., Done]
REACHED = [p for p in load_family('sinus_g2').settings if {*p.addresses} >= {'modbus', 'classic'}]

#: Other than the factory's, of every group.
OTHERS = {
    'motor.p_nom': 2.2,
    'motor.i_magn': 5.5,
    'motor.i_limt': 9.0,
    'control.mode': 'Speed',
    'control.accel': 7.5,
    'control.auto_start': True,
    'freque.f_fix1': 12.5,
    'speed.sp_max': 3000.0,
    'torque.tq_max': 150.0,
    'pi_reg.r_fix1': -12.5,
    'pi_reg.reg_amp': -1,
    'pi_reg.unit': 'm³/h',
    'output.f_out': 'Torque',
    'serial.sio_tot': 2.5,
    'error.ac_fail_mode': 'Alarm',
}
#: What is tried in this order, for the motor's come first and the others keep theirs.
SOME = {
    'motor.p_nom': 2.2,
    'control.accel': 7.5,
    'control.retard': 8.5,
    'freque.f_fix1': 11.0,
    'freque.f_fix2': 12.0,
}
BEFORE = {
    'motor.p_nom': 1.5,
    'control.accel': 5.0,
    'control.retard': 5.0,
    'freque.f_fix1': 10.0,
    'freque.f_fix2': 15.0,
}


def parameter_file(folder: Path, values: dict[str, object], header: str = '') -> Path:
    lines = [f'    {key}: {json.dumps(value)}' for key, value in values.items()]
    path = folder / 'some.yaml'
    path.write_text(
        '\n'.join((header, '/**:', '  ros__parameters:', *lines, '')), encoding='utf-8'
    )
    return path


def has(bench: Bench, values: dict[str, object], address: int = 1) -> bool:
    return all(bench.value(key, address) == value for key, value in values.items())


@pytest.fixture
def some(tmp_path: Path) -> Path:
    return parameter_file(tmp_path, SOME)


# --- set ------------------------------------------------------------------------------------------


def test_set(nfo: Nfo, bench: Bench) -> None:
    done = nfo('set', 'control.accel=7', 'control.mode=speed', 'control.auto_start=on')
    assert done.status == 0 and done.err == ''
    assert done.out.splitlines() == [
        'control.accel: 5 -> 7 s',
        'control.mode: Freque -> Speed',
        'control.auto_start: false -> true',
    ]
    assert has(bench, {'control.accel': 7.0, 'control.mode': 'Speed', 'control.auto_start': True})
    writes = len(bench.writes())
    done = nfo('set', 'control.accel=7.0', '--json')
    assert json.loads(done.out) == {'control.accel': {'value': 7.0, 'unit': 's'}}
    assert 'as it was' in nfo('set', 'control.accel=7.0').out
    assert len(bench.writes()) == writes == 3


@pytest.mark.parametrize(
    ('change', 'says'),
    [
        ('status.frq_act=5', 'status.frq_act is only read: nfo-sinus get shows it'),
        ('control.retard=900', 'out of range, 0.2 to 500 s'),
        ('control.retard=soon', "'soon' is not a number"),
        ('control.retard=5.00001', 'between two steps'),
        ('control.mode=Sped', 'Freque, PI-Reg, Torque, Speed'),
        ('control.auto_start=1', 'OFF, ON'),
        ('control.retart=5', 'did you mean control.retard'),
        ('fieldbus.mode=2', 'fieldbus.mode is no setting: the driver itself writes it'),
        ('serial.address=2', '--allow-communication-changes'),
    ],
)
def test_set_is_all_or_nothing(nfo: Nfo, bench: Bench, change: str, says: str) -> None:
    done = nfo('set', 'control.accel=7', change)
    assert done.status == 1 and done.out == ''
    assert says in done.err and 'nothing was written' in done.err
    nfo('get', 'control.accel')
    assert bench.writes() == []


def test_set_puts_back_what_went_before_a_refusal(nfo: Nfo, bench: Bench) -> None:
    bench.refuse('control.retard')
    done = nfo('set', 'control.accel=7', 'control.retard=8')
    assert done.status == 1 and done.out == ''
    assert 'control.retard: the drive does not accept 8 s' in done.err
    assert 'put back: control.accel' in done.err
    assert has(bench, {'control.accel': 5.0, 'control.retard': 5.0})


def test_set_while_the_motor_runs(nfo: Nfo, bench: Bench) -> None:
    bench.simulator.inject('keypad', 'start', address=1)
    done = nfo('set', 'control.accel=7', 'motor.p_nom=2.2')
    assert done.status == 1
    assert 'only while the motor is stopped' in done.err
    assert nfo('set', 'control.accel=7').status == 0
    assert bench.drive().motor.driven


def test_communication_settings(nfo: Nfo, bench: Bench) -> None:
    done = nfo('set', 'serial.address=3', '--allow-communication-changes')
    assert done.status == 0
    assert done.out == 'serial.address: 1 -> 3\n'
    assert 'from its next power-up on' in done.err
    # the same value changes nothing, and needs no leave
    assert nfo('set', 'serial.address=3').status == 0


# --- dump, load, diff -----------------------------------------------------------------------------


def test_dump_reset_load_diff(nfo: Nfo, bench: Bench, tmp_path: Path) -> None:
    for key, value in OTHERS.items():
        bench.set(key, value)
    path = tmp_path / 'cell.yaml'
    done = nfo('dump', path)
    assert done.status == 0 and done.out == ''
    assert f'{len(REACHED)} parameters' in done.err and str(path) in done.err
    file = parse_file(path.read_text(encoding='utf-8'), 'cell')
    assert set(file.values) == {parameter.key for parameter in REACHED}
    assert OTHERS.items() <= file.values.items()
    assert file.header['model'] == 'sinus_g2'
    assert file.header['product'] == 'NFO Sinus 1.50/400'
    assert file.header['firmware'] == '4.38 / 4018'
    assert file.header['serial number'] == 'NFO1001'
    assert file.header['address'] == '1'
    assert file.header['date'][:2] == '20' and file.header['written by'].startswith('nfo-sinus')
    assert nfo('diff', path) == Done(0, '', '')

    bench.simulator.inject('factory-reset', address=1)
    assert not any(bench.value(key) == value for key, value in OTHERS.items())
    differing = json.loads(nfo('diff', path, '--json').out)
    assert set(differing) == set(OTHERS)
    assert bench.writes() == []

    done = nfo('load', path, '--dry-run', '--allow-communication-changes')
    assert done.status == 0 and bench.writes() == []
    assert 'motor.p_nom: 1.5 -> 2.2 kW' in done.out.splitlines()
    assert len(done.out.splitlines()) == len(OTHERS)

    again = nfo('load', path, '--allow-communication-changes')
    assert again.status == 0 and again.out == done.out
    assert f'{len(OTHERS)} parameters written' in again.err
    assert has(bench, OTHERS)
    # one of them was tried twice, for it is bounded by another
    assert sum(bench.drive().writes.values()) == len(OTHERS)
    assert nfo('diff', path) == Done(0, '', '')
    done = nfo('load', path)
    assert done.status == 0 and 'nothing to write' in done.err


def test_cloning(nfo: Nfo, bench: Bench, tmp_path: Path) -> None:
    for key, value in OTHERS.items():
        bench.set(key, value)
    path = tmp_path / 'cell.yaml'
    assert nfo('dump', path).status == 0
    assert nfo('diff', '--against', 2).status == 1
    done = nfo('load', path, '--address', 2)
    assert done.status == 0
    assert 'cloning from serial number NFO1001 to NFO1002' in done.err
    assert 'serial.address: 2, not 1' in done.err and 'serial.sio_tot: 0, not 2.5' in done.err
    assert json.loads(nfo('diff', '--against', 2, '--json').out) == {
        'serial.sio_tot': {'left': 2.5, 'right': 0.0}
    }
    assert nfo('set', 'serial.sio_tot=2.5', '--address', 2).status == 1
    bench.set('serial.sio_tot', 2.5, address=2)
    # their addresses differ, as they must
    assert nfo('diff', '--against', 2) == Done(0, '', '')
    assert nfo('diff', path, '--address', 2) == Done(0, '', '')
    assert bench.value('serial.address', 2) == 2


def test_from_g2_to_optimal(nfo: Nfo, bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / 'g2.yaml'
    assert nfo('dump', path).status == 0
    done = nfo('load', path, '--model', 'sinus_optimal', '--port', '/dev/no-such-port')
    assert done.status == 1 and done.out == ''
    missing = {p.key for p in REACHED} - {p.key for p in load_family('sinus_optimal').settings}
    assert missing
    assert {line.split()[0] for line in done.err.splitlines()[1:]} == missing
    assert 'nothing was written' in done.err
    # the port was not even opened
    assert 'no-such-port' not in done.err


def test_the_standard_streams(bench: Bench) -> None:
    dumped = bench.run('dump')
    assert dumped.status == 0
    values = {**parse_file(dumped.out, 'x').values, **SOME}
    text = json.dumps({'/**': {'ros__parameters': values}})
    done = bench.run('load', '-', text=text)
    assert done.status == 0 and has(bench, SOME)
    assert bench.run('diff', '-', text=text) == Done(0, '', '')
    done = bench.run('diff', '-', text=dumped.out)
    assert done.status == 1 and 'control.accel' in done.out


def test_the_file_of_a_dump_is_whole_or_not_there(nfo: Nfo, bench: Bench, tmp_path: Path) -> None:
    done = nfo('dump', tmp_path / 'no' / 'folder.yaml')
    assert done.status == 1 and 'cannot be written' in done.err
    path = tmp_path / 'cell.yaml'
    bench.on_read('control.dc_brk', lambda: bench.simulator.inject('silence', 60, address=1))
    done = nfo('dump', path, '--retries', 0)
    assert done.status == 1
    assert os.listdir(tmp_path) == ['trace']


def test_notes_on_another_drive(nfo: Nfo, bench: Bench, tmp_path: Path) -> None:
    header = '# model: sinus_optimal\n# product: NFO Sinus 4.0/400\n# firmware: 4.20 / 4000'
    done = nfo('load', parameter_file(tmp_path, SOME, header))
    assert done.status == 0
    assert 'is of a sinus_optimal, this is a sinus_g2' in done.err
    assert 'is of a NFO Sinus 4.0/400, this is a NFO Sinus 1.50/400' in done.err
    assert 'saved with firmware 4.20 / 4000, this one has 4.38 / 4018' in done.err


def test_load_refuses_all_that_the_drive_cannot_have(
    nfo: Nfo, bench: Bench, tmp_path: Path
) -> None:
    wrong = {'control.accel': 900, 'control.mode': 'Sped', 'motor.f_nom': 'x', 'control.run_dly': 3}
    done = nfo('load', parameter_file(tmp_path, wrong))
    assert done.status == 1 and done.out == ''
    assert 'nothing was written' in done.err
    assert [line.split(':')[0] for line in done.err.splitlines()[1:]] == [
        '  control.accel',
        '  control.mode',
        '  motor.f_nom',
    ]
    done = nfo('load', parameter_file(tmp_path, {**SOME, 'control.axel': 1, 'moter.p_nom': 1}))
    assert done.status == 1
    assert 'control.axel (did you mean' in done.err and 'moter.p_nom (did you mean' in done.err
    assert bench.value('control.accel') == 5.0
    nfo('info')
    assert bench.writes() == []


def test_load_refuses_what_an_older_firmware_does_not_have(
    make_bench: Callable[..., Bench], tmp_path: Path
) -> None:
    bench = make_bench(settings={'fieldbus.sw_ver': 4.20})
    path = parameter_file(tmp_path, {**SOME, 'error.short_c_err_cnt': 3})
    done = bench.run('load', path)
    assert done.status == 1
    assert 'the drive at address 1 has no parameter of this name' in done.err
    assert 'error.short_c_err_cnt' in done.err
    assert bench.writes() == []


def test_load_while_the_motor_runs(nfo: Nfo, bench: Bench, some: Path, tmp_path: Path) -> None:
    bench.simulator.inject('keypad', 'start', address=1)
    done = nfo('load', some)
    assert done.status == 1
    assert 'the motor runs' in done.err and 'motor.p_nom' in done.err
    assert bench.writes() == []
    path = parameter_file(tmp_path, {'control.accel': 7.5})
    assert nfo('load', path).status == 0
    assert bench.drive().motor.driven and bench.value('control.accel') == 7.5


def test_values_that_bound_each_other_go_in_any_order(
    nfo: Nfo, bench: Bench, tmp_path: Path
) -> None:
    path = parameter_file(tmp_path, {'control.accel': 7.5, 'control.retard': 8.5})
    drive, tried = bench.drive(), []
    write_raw = drive.write_raw

    def write(key: str, raw: int) -> None:
        tried.append(key)
        if key == 'control.accel' and drive.peek('control.retard') == 5.0:
            raise Refused(Reason.VALUE, 'not before the other')
        write_raw(key, raw)

    drive.write_raw = write  # type: ignore[method-assign]
    assert nfo('load', path).status == 0
    assert tried == ['control.accel', 'control.retard', 'control.accel']
    assert has(bench, {'control.accel': 7.5, 'control.retard': 8.5})


# --- half-way -------------------------------------------------------------------------------------


def test_half_way_it_says_what_was_written(nfo: Nfo, bench: Bench, some: Path) -> None:
    bench.refuse('control.retard', Reason.STATE)
    done = nfo('load', some)
    assert done.status == 1
    lines = [line.removeprefix('nfo-sinus: ') for line in done.err.splitlines()]
    assert lines[1:9] == [
        'written:',
        '  motor.p_nom: 1.5 -> 2.2 kW',
        '  control.accel: 5 -> 7.5 s',
        'tried without success:',
        '  control.retard',
        'not written:',
        '  freque.f_fix1',
        '  freque.f_fix2',
    ]
    assert lines[0].startswith('control.retard: the drive cannot do this')
    assert lines[-1] == 'not loaded: 2 of 5 were written'
    assert has(bench, {**BEFORE, 'motor.p_nom': 2.2, 'control.accel': 7.5})
    # and how to put it back can be typed as it stands
    command = next(line for line in lines if line.startswith('  nfo-sinus'))
    assert nfo(*shlex.split(command)[1:]).status == 0
    assert has(bench, BEFORE)


def test_half_way_it_puts_back(nfo: Nfo, bench: Bench, some: Path) -> None:
    bench.refuse('control.retard')
    done = nfo('load', some, '--put-back')
    assert done.status == 1
    assert 'the drive is as it was' in done.err.splitlines()[-1]
    assert 'motor.p_nom: 1.5 -> 2.2 kW' in done.err
    assert has(bench, BEFORE)
    # it was refused to the last, so the others were all tried before
    assert bench.drive().writes['freque.f_fix2'] == 2


@pytest.mark.parametrize(('answer', 'as_it_was'), [('\n', True), ('n\n', False), ('\x04', False)])
def test_half_way_it_asks_on_a_terminal(
    bench: Bench, some: Path, answer: str, as_it_was: bool
) -> None:
    bench.refuse('control.retard', Reason.STATE)
    done = bench.on_terminal('load', some, ask='[Y/n] ', answer=answer)
    assert done.status == 1
    assert has(bench, BEFORE if as_it_was else {'control.accel': 7.5, 'control.retard': 5.0})
    assert ('to put it back:' in done.out) is not as_it_was


def test_keep_asks_nothing(bench: Bench, some: Path) -> None:
    bench.refuse('control.retard', Reason.STATE)
    done = bench.on_terminal('load', some, '--keep')
    assert done.status == 1 and '[Y/n]' not in done.out
    assert bench.value('control.accel') == 7.5


def test_a_drive_that_goes_silent_half_way(nfo: Nfo, bench: Bench, some: Path) -> None:
    bench.on_write(
        'control.retard', lambda: bench.simulator.inject('silence', 120, address=1)
    )
    done = nfo('load', some, '--put-back', '--retries', 0)
    assert done.status == 1
    assert 'written:\n  motor.p_nom: 1.5 -> 2.2 kW\n  control.accel: 5 -> 7.5 s\n' in done.err
    assert 'not written:\n  freque.f_fix1\n  freque.f_fix2\n' in done.err
    last = done.err[done.err.index('NOT all put back') :]
    assert 'motor.p_nom: 2.2 kW, was 1.5 kW' in last
    assert 'control.accel: 7.5 s, was 5 s' in last
    assert 'control.retard, of which nothing is known' in last


def test_a_fault_half_way(nfo: Nfo, bench: Bench, some: Path) -> None:
    bench.on_write('control.retard', lambda: bench.simulator.inject('fault', 5, address=1))
    done = nfo('load', some, '--put-back')
    assert done.status == 1
    # a drive with a fault takes nothing, the old values neither
    assert 'NOT all put back' in done.err and 'fault' in done.err
    assert 'motor.p_nom: 2.2 kW, was 1.5 kW' in done.err


@pytest.fixture
def interrupt(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """What sends one signal, the first time it is asked to, and waits until it was noted."""
    noted: list[Callable[[], bool]] = []
    original = transfer.signals_noted
    sent: list[int] = []

    @contextlib.contextmanager
    def noting(**how: bool) -> Iterator[Callable[[], bool]]:
        with original(**how) as came:
            noted.append(came)
            yield came

    def send(number: int) -> None:
        if not sent:
            sent.append(number)
            os.kill(os.getpid(), number)
            # the main thread may be late to note it: without this more would be written
            wait_until(noted[-1])

    for module in (transfer, read):
        monkeypatch.setattr(module, 'signals_noted', noting)
    return send


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_interrupted_half_way(
    nfo: Nfo, bench: Bench, some: Path, interrupt: Callable[[int], None], number: int
) -> None:
    bench.on_write('control.accel', lambda: interrupt(number))
    done = nfo('load', some, '--put-back')
    assert done.status == 1
    # what was on its way when the signal came was finished, and then put back
    assert 'interrupted\n' in done.err
    assert 'written:\n  motor.p_nom: 1.5 -> 2.2 kW\n' in done.err
    assert 'freque.f_fix2' in done.err.split('not written:')[1]
    assert has(bench, BEFORE)
    assert bench.drive().writes['freque.f_fix2'] == 0


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_what_interrupts_a_set_leaves_all_or_none_and_it_is_said(
    nfo: Nfo, bench: Bench, interrupt: Callable[[int], None], number: int
) -> None:
    bench.on_write('control.accel', lambda: interrupt(number))
    done = nfo('set', 'control.accel=7.5', 'control.retard=8')
    assert done.status == 0, done.err
    assert done.out == 'control.accel: 5 -> 7.5 s\ncontrol.retard: 5 -> 8 s\n'
    assert has(bench, {'control.accel': 7.5, 'control.retard': 8})


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('verb', ['set', 'load'])
def test_what_is_written_is_said_and_is_the_status_whatever_signals_come(
    bench: Bench, some: Path, verb: str, number: int
) -> None:
    begun = threading.Event()
    bench.on_write('control.accel', begun.set)
    last = 'freque.f_fix2'
    changes = [some] if verb == 'load' else [f'{key}={value}' for key, value in SOME.items()]
    back = ['--put-back'] if verb == 'load' else []
    with bench.begun(verb, *changes, *back) as process:
        wait_until(lambda: begun.is_set() or process.poll() is not None)
        out, err = signals_until_it_ends(process, number)
    written = has(bench, SOME)
    assert process.returncode == (0 if written else 1), (out, err)
    assert written or has(bench, BEFORE)
    assert last in out + err and 'Traceback' not in err


def test_a_second_ctrl_c_keeps_nothing_from_being_put_back(
    nfo: Nfo, bench: Bench, some: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.refuse('freque.f_fix2')
    tell = transfer.remark

    def impatient(text: str) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        tell(text)

    monkeypatch.setattr(transfer, 'remark', impatient)
    done = nfo('load', some, '--put-back')
    assert (done.status, 'all that was written is put back' in done.err) == (1, True)
    assert has(bench, BEFORE)


def test_a_second_ctrl_c_while_it_is_put_back_leaves_no_half(
    nfo: Nfo, bench: Bench, some: Path, interrupt: Callable[[int], None]
) -> None:
    bench.refuse('freque.f_fix2')
    writes = itertools.count()

    def write() -> None:
        if next(writes):
            interrupt(signal.SIGINT)

    bench.on_write('control.accel', write)
    done = nfo('load', some, '--put-back')
    assert (done.status, 'all that was written is put back' in done.err) == (1, True), done.err
    assert has(bench, BEFORE)


def test_what_was_written_is_put_back_though_nobody_can_be_told(
    bench: Bench, some: Path
) -> None:
    bench.refuse('freque.f_fix2')
    full = ('sh', '-c', 'exec "$@" 2>/dev/full', 'sh')
    process = bench.begin('load', some, '--put-back', through=full)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert has(bench, BEFORE)


_UNBUFFERED = 'PYTHONUNBUFFERED'


@pytest.mark.parametrize('stream', ['stdout', 'stderr'])
def test_output_that_cannot_be_written_at_the_end_leaves_the_exit_status(stream: str) -> None:
    program = (
        'import sys\n'
        'from nfo_sinus_driver.cli import main\n'
        f'main.main = lambda: sys.{stream}.write("half a line") and 3\n'
        'sys.exit(main.command())'
    )
    with open('/dev/full', 'w', encoding='utf-8') as full:
        lost = {'stdout': full} if stream == 'stdout' else {'stderr': full}
        command = [sys.executable, '-c', program]
        # without buffers nothing is left at the end
        variables = {name: value for name, value in os.environ.items() if name != _UNBUFFERED}
        done = subprocess.run(command, cwd=ROOT, env=variables, check=False, **lost)
    assert done.returncode == 3


def test_what_was_set_is_said_though_the_output_is_lost(bench: Bench) -> None:
    full = ('sh', '-c', 'exec "$@" >/dev/full', 'sh')
    process = bench.begin('set', 'control.accel=7.5', 'control.retard=8', through=full)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert err == (
        'nfo-sinus: the output cannot be written: No space left on device; written are:\n'
        '  control.accel: 5 -> 7.5 s\n  control.retard: 5 -> 8 s\n'
    )


def test_interrupted_at_the_very_end_it_is_done(
    nfo: Nfo, bench: Bench, some: Path, interrupt: Callable[[int], None]
) -> None:
    bench.on_write('freque.f_fix2', lambda: interrupt(signal.SIGINT))
    assert nfo('load', some).status == 0
    assert has(bench, SOME)


# --- diff -----------------------------------------------------------------------------------------


def test_diff_of_two_files(nfo: Nfo, bench: Bench, tmp_path: Path) -> None:
    first = parameter_file(tmp_path, {'control.accel': 5, 'control.auto_start': True, 'motor.x': 1})
    first = first.rename(tmp_path / 'one.yaml')
    other = parameter_file(tmp_path, {'control.accel': 5.0, 'control.auto_start': 1})
    done = nfo('diff', first, other, '--port', '/dev/no-such-port')
    assert done.status == 1
    assert [line.split() for line in done.out.splitlines()] == [
        [str(first), str(other)],
        ['control.auto_start', 'true', '1'],
        ['motor.x', '1', 'absent'],
    ]
    assert nfo('diff', first, first) == Done(0, '', '')


def test_diff_of_drive_and_file(nfo: Nfo, bench: Bench, some: Path) -> None:
    done = nfo('diff', some)
    assert done.status == 1
    rows = [line.split() for line in done.out.splitlines()]
    assert rows[0] == [str(some), 'address', '1']
    assert ['control.accel', '7.5', 's', '5', 's'] in rows
    assert len(rows) == 1 + len(SOME)
    assert f'says nothing of {len(REACHED) - len(SOME)} parameters' in done.err


def test_diff_that_fails_is_trouble(nfo: Nfo, tmp_path: Path) -> None:
    assert nfo('diff', tmp_path / 'none.yaml').status == 2
    assert nfo('diff', '--against', 9, '--response-timeout', 0.2, '--retries', 0).status == 2


# --- another family -------------------------------------------------------------------------------


def test_settings_of_a_movitrac_go_to_a_file_and_back(
    make_bench: Callable[..., Bench], tmp_path: Path
) -> None:
    # what the maker's own program for a PC is for [M4 §2.2.1]
    bench = make_bench(model='movitrac31', protocol='movitrac', serial_numbers=[])
    wanted = {'ramp.t11_up': 3.7, 'motor.pwm_frequency_1': '8 kHz', 'control.dc_braking_1': True}
    done = bench.run('set', *(f'{key}={value}' for key, value in wanted.items()))
    assert done.status == 0, done.err
    assert has(bench, wanted)
    path = tmp_path / 'all.yaml'
    assert bench.run('dump', path).status == 0
    others = {'ramp.t11_up': 9.0, 'motor.pwm_frequency_1': '4 kHz', 'control.dc_braking_1': False}
    for key, value in others.items():
        bench.set(key, value)
    done = bench.run('diff', path)
    assert done.status == 1 and all(key in done.out for key in wanted)
    done = bench.run('load', path)
    assert done.status == 0, done.err
    assert has(bench, wanted)


def test_a_label_that_yaml_takes_for_a_switch_and_a_whole_number_with_a_point(
    make_bench: Callable[..., Bench], tmp_path: Path
) -> None:
    bench = make_bench(model='movitrac31', protocol='movitrac', serial_numbers=[])
    protection = 'monitoring.motor_protection_1'
    bench.set(protection, 'Warning')
    path = parameter_file(tmp_path, {})
    text = f'/**:\n  ros__parameters:\n    {protection}: OFF\n    frequency.f_base_1: 60.0\n'
    path.write_text(text, encoding='utf-8')
    done = bench.run('load', path)
    assert done.status == 0, done.err
    assert has(bench, {protection: 'OFF', 'frequency.f_base_1': 60})
    assert bench.run('diff', path).status == 0
    done = bench.run('set', 'frequency.f_base_1=87.0')
    assert has(bench, {'frequency.f_base_1': 87}), done.err
    for wrong in ('55', 'fast'):
        done = bench.run('set', f'frequency.f_base_1={wrong}')
        assert done.status == 1 and 'is none of 50, 60, 87, 104, 120' in done.err
