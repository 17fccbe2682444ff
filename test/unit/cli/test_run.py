# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``run``: the motor follows, and every way out stops it; judged by the simulated drive itself."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import fcntl
import json
import os
from pathlib import Path
import pty
import re
import select
import signal
import subprocess
import time
from types import SimpleNamespace
from typing import Any

from cli_bench import (
    COMMAND,
    PATIENCE,
    QUICK,
    ROOT,
    Bench,
    Done,
    MakeBench,
    signals_until_it_ends,
    wait_until,
)
import pytest

from nfo_sinus_driver.cli.control_session import ControlSession
from nfo_sinus_driver.drive import Cause, DriveError, Report
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.state_folder import StateFolder

Nfo = Callable[..., Done]
RUN = (0x02, 0x98)
OPTIMAL = {'model': 'sinus_optimal', 'serial_numbers': []}
#: Every protocol, model and control method.
CONNECTIONS: dict[str, tuple[dict[str, Any], tuple[object, ...]]] = {
    'modbus_rtu': ({}, ()),
    'modbus_ascii': ({'protocol': 'modbus_ascii'}, ()),
    'modbus_tcp': ({'protocol': 'modbus_tcp'}, ()),
    'classic': ({'protocol': 'classic'}, ()),
    'drive_control': ({}, ('--method', 'drive_control')),
    'classic_drive_control': ({'protocol': 'classic'}, ('--method', 'drive_control')),
    'optimal': (OPTIMAL, ()),
}


@pytest.fixture
def bench(make_bench: MakeBench) -> Bench:
    """A line with drives that have short ramps."""
    return make_bench(settings=QUICK)


def read_until(stream: Any, text: str) -> str:
    """Read lines until one says this."""
    said = ''
    for line in stream:
        said += line
        if text in line:
            return said
    raise AssertionError(said)


def nothing_commanded(bench: Bench) -> bool:
    """Nothing was written to the drive."""
    return bench.writes() == [] and not bench.state()['command_writes']


# --- the run -------------------------------------------------------------------------------------


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_it_runs_for_a_while_and_stops(make_bench: MakeBench, connection: str) -> None:
    options, arguments = CONNECTIONS[connection]
    bench = make_bench(settings=QUICK, **options)
    process = bench.begin('run', 10, '--for', 2, *arguments)
    wait_until(lambda: bench.state()['frequency'] == pytest.approx(10, abs=0.2))
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    assert bench.stopped
    assert 'stopping: it ramps down' in err and 'control released' in err
    assert 'set  10.0 Hz' in out and '10.0 Hz' in out


def test_what_was_before_control_was_taken_is_not_shown(bench: Bench) -> None:
    done = bench.run('run', 10, '--for', 0.5, '--json')
    assert done.status == 0
    assert json.loads(done.out.splitlines()[0])['enabled'] is True


def test_an_optimal_by_its_control_word(make_bench: MakeBench) -> None:
    bench = make_bench(settings=QUICK, **OPTIMAL)
    method = ('--method', 'drive_control')
    done = bench.run('run', 10, *method)
    assert done.status == 2 and 'it must be terminal' in done.err
    process = bench.begin('run', *method, '--reference', 'terminal', '--for', 1)
    wait_until(lambda: bench.state()['frequency'] > 20)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    assert not bench.state()['driven']


@pytest.mark.parametrize('typed', [('-10',), ('--', '-10')])
def test_backwards(bench: Bench, typed: tuple[str, ...]) -> None:
    process = bench.begin('run', '--for', 1, *typed)
    wait_until(lambda: bench.state()['frequency'] < -9)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 0 and bench.stopped


def test_a_reference_of_its_own(bench: Bench) -> None:
    with bench.begun('run', '--reference', 'fix2_reverse') as process:
        wait_until(lambda: bench.state()['frequency'] == pytest.approx(-15, abs=0.2))
        # not Ctrl-C: the motor turns at the reference before the tool knows that it is enabled
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 130
    assert bench.stopped


def test_the_set_point_stays_fresh(bench: Bench) -> None:
    # the driver gives one up after 2.5 s, and so does a drive of its own accord
    arguments = ('--for', 12, '--drive-timeout', 6)
    with bench.running(*arguments) as process:
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    assert 'no set-point' not in err and 'time-out' not in err
    # both stay so
    assert 'serial.sio_tot' in err and 'serial.auto_stop' in err and '(--drive-timeout)' in err
    lines = [line for line in out.splitlines() if 'Bus Run' in line]
    # on a busy machine the last line may be an old one, but later than both
    assert '10.0 Hz' in lines[-1] and re.search(' [0-5] s left', lines[-1])
    assert bench.value('serial.sio_tot') == 6.0 and bench.value('serial.auto_stop') is True
    assert bench.state()['fault'] == 0


@pytest.mark.parametrize(
    ('typed', 'why'),
    [((), 'AutoStop = OFF'), (('--drive-timeout', 0), 'SioTot is 0, and --drive-timeout 0 leav')],
)
def test_it_warns_once_of_a_drive_without_a_time_out(
    make_bench: MakeBench, typed: tuple[object, ...], why: str
) -> None:
    bench = make_bench(settings=QUICK)
    done = bench.run('run', 10, '--for', 0.3, *typed)
    assert done.status == 0
    assert done.err.count('the motor runs on') == 1
    assert why in done.err and '--drive-timeout' in done.err


def test_it_does_not_warn_of_a_drive_that_has_one(make_bench: MakeBench) -> None:
    settings = {**QUICK, 'serial.sio_tot': 5, 'serial.auto_stop': True}
    done = make_bench(settings=settings).run('run', 10, '--for', 0.3)
    assert done.status == 0 and 'time-out' not in done.err


def test_by_default_a_time_out_that_may_stop_the_motor_is_set_for_the_run(
    make_bench: MakeBench,
) -> None:
    bench = make_bench(settings={**QUICK, 'serial.auto_stop': True})
    with bench.running('--for', 1) as process:
        wait_until(lambda: bench.value('serial.sio_tot') == 2.0)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0 and 'time-out' not in err
    assert bench.value('serial.sio_tot') == 0.0


def test_what_a_run_that_was_killed_has_set_the_next_end_puts_back(make_bench: MakeBench) -> None:
    bench = make_bench(settings={**QUICK, 'serial.auto_stop': True})
    with bench.running('--for', 60) as process:
        wait_until(lambda: bench.value('serial.sio_tot') == 2.0)
        process.kill()
    wait_until(lambda: bench.state()['fault'])
    assert bench.run('ack').status == 0
    assert bench.value('serial.sio_tot') == 0.0


def test_a_command_leaves_alone_what_a_driver_that_runs_has_set(make_bench: MakeBench) -> None:
    settings = {**QUICK, 'serial.auto_stop': True, 'serial.sio_tot': 2.0}
    bench = make_bench(settings=settings)
    borrowed = {'serial.sio_tot': (0.0, 2.0)}
    driver = StateFolder('')
    driver.write('sinus_g2 NFO1001', borrowed).result(PATIENCE)
    assert bench.run('run', 10, '--for', 0.3).status == 0
    assert bench.value('serial.sio_tot') == 2.0
    assert driver.read('sinus_g2 NFO1001').result(PATIENCE) == borrowed


@pytest.mark.parametrize('where', ['no home', 'a file'])
def test_without_a_folder_to_remember_in_it_runs_and_says_what_to_check(
    make_bench: MakeBench, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    bench = make_bench(settings={**QUICK, 'serial.auto_stop': True})
    monkeypatch.setenv('XDG_STATE_HOME', '' if where == 'no home' else __file__)
    monkeypatch.delenv('HOME', raising=False)
    done = bench.run('run', 10, '--for', 0.3)
    assert done.status == 0 and bench.value('serial.sio_tot') == 0.0
    assert done.err.count('is not remembered') == 1
    assert 'check serial.sio_tot' in done.err


def test_json(bench: Bench) -> None:
    done = bench.run('run', 10, '--for', 1, '--json', '--period', 0.1)
    assert done.status == 0
    *rows, end = [json.loads(line) for line in done.out.splitlines()]
    assert {row['enabled'] for row in rows} == {True, False}
    last = [row for row in rows if row['enabled']][-1]
    assert last['setpoint'] == 10.0 and last['unit'] == 'Hz' and last['kind'] == 'status'
    assert last['frequency'] == pytest.approx(10, abs=0.2)
    assert end['ended'] == '1 s are over' and end['stop_confirmed'] is True


def test_one_line_on_a_terminal(bench: Bench) -> None:
    done = bench.on_terminal('run', 10, '--for', 1, '--period', 0.1)
    assert done.status == 0
    assert done.err.count('\r\x1b[K') > 5
    lines = [line for line in done.out.splitlines() if 'Hz' in line and 'set' in line]
    assert len(lines) <= 1


# --- the ways out ---------------------------------------------------------------------------------

SIGNALS = {
    signal.SIGINT: 0,
    signal.SIGTERM: 130,
    signal.SIGHUP: 130,
    signal.SIGQUIT: 130,
    signal.SIGUSR1: 130,
}


@pytest.mark.parametrize('number', SIGNALS)
def test_a_signal_stops_the_motor(bench: Bench, number: signal.Signals) -> None:
    with bench.running() as process:
        process.send_signal(number)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == SIGNALS[number]
    assert bench.stopped
    name = 'Ctrl-C' if number is signal.SIGINT else number.name
    assert f'{name}: stopping the motor' in err
    assert 'ramps down' in err and 'control released' in err


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signals_without_end_stop_the_motor_and_the_status_is_its_own(
    bench: Bench, number: signal.Signals
) -> None:
    with bench.running() as process:
        _, err = signals_until_it_ends(process, number)
    assert process.returncode == SIGNALS[number], err
    # a second one leaves the motor to its ramp
    wait_until(lambda: not bench.state()['frequency'])
    assert 'ramps down' in err and 'Traceback' not in err


@pytest.mark.parametrize('connection', ['classic', 'optimal', 'drive_control'])
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_motor_over_every_connection(
    make_bench: MakeBench, connection: str, number: signal.Signals
) -> None:
    options, arguments = CONNECTIONS[connection]
    bench = make_bench(settings=QUICK, **options)
    with bench.running(*arguments) as process:
        process.send_signal(number)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == SIGNALS[number], err
    assert bench.stopped


def test_it_takes_no_signal_for_granted_when_it_was_suspended(bench: Bench) -> None:
    with bench.running() as process:
        process.send_signal(signal.SIGSTOP)
        suspended = time.monotonic()
        # longer than it ever waits for a signal
        wait_until(lambda: time.monotonic() > suspended + 0.2)
        process.send_signal(signal.SIGCONT)
        wait_until(lambda: bench.state()['frequency'] > 9)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    assert 'Ctrl-C: stopping the motor' in err
    assert bench.stopped


def test_ctrl_c_before_the_time_is_over(bench: Bench) -> None:
    with bench.running('--for', 1000) as process:
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 130
    assert bench.stopped


def test_ctrl_c_while_it_waits_for_the_start(make_bench: MakeBench) -> None:
    bench = make_bench(settings={**QUICK, 'control.run_dly': 600})
    with bench.begun('run', 10) as process:
        wait_until(lambda: bench.state()['inv_st'] == 25)
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 130
    state = bench.state()
    assert bench.stopped and state['inv_st'] != 25


def test_output_whose_reader_has_ended(bench: Bench) -> None:
    with bench.running('--period', 0.05) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert process.wait(PATIENCE) == 1
        assert 'ramps down' in process.stderr.read()
    assert bench.stopped


def test_output_that_is_not_read_keeps_nothing_waiting(bench: Bench) -> None:
    with bench.running('--period', 0.01, '--json') as process:
        assert process.stdout
        fcntl.fcntl(process.stdout, fcntl.F_SETPIPE_SZ, 4096)
        wait_until(lambda: is_full(process) and bench.state()['frequency'] > 5)
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 130
    assert bench.stopped


def is_full(process: subprocess.Popen[str]) -> bool:
    """Whether the pipe of the standard output takes no more."""
    with open(f'/proc/{process.pid}/fd/1', 'wb', buffering=0) as pipe:
        return not select.select([], [pipe], [], 0)[1]


class Terminal:
    """The command on a terminal of its own."""

    def __init__(self, bench: Bench, *arguments: object) -> None:
        self.pid, self.number = pty.fork()
        if not self.pid:
            os.chdir(ROOT)
            os.environ['TERM'] = 'xterm'
            command = [*COMMAND, *bench.options, *map(str, arguments)]
            os.execv(command[0], command)
        self.said = ''

    def type(self, keys: str) -> None:
        os.write(self.number, keys.encode())

    def read(self, text: str = '') -> None:
        """Read until it says this; or to its end."""
        while not text or text not in self.said:
            assert select.select([self.number], [], [], PATIENCE)[0], self.said
            try:
                data = os.read(self.number, 4096)
            except OSError:
                data = b''
            if not data:
                assert not text, self.said
                return
            self.said += data.decode(errors='replace')

    def end(self) -> int:
        """Wait for its end; return the exit status."""
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


def test_ctrl_c_on_a_terminal(bench: Bench) -> None:
    terminal = Terminal(bench, 'run', 10)
    terminal.read('38 Bus Run')
    terminal.type('\x03')
    terminal.read()
    assert terminal.end() == 0
    assert bench.stopped
    assert 'control released' in terminal.said


def test_ctrl_z_does_not_freeze_it(bench: Bench) -> None:
    terminal = Terminal(bench, 'run', 10)
    terminal.read('38 Bus Run')
    terminal.type('\x1a')
    terminal.read('Ctrl-Z ignored')
    state = Path(f'/proc/{terminal.pid}/stat').read_text(encoding='utf-8').split(')')[1].split()[0]
    assert state != 'T'
    assert bench.state()['driven']
    terminal.type('\x03')
    terminal.read()
    assert terminal.end() == 0 and bench.stopped


def test_a_terminal_that_is_closed(bench: Bench) -> None:
    terminal = Terminal(bench, 'run', 10)
    terminal.read('38 Bus Run')
    os.close(terminal.number)
    assert terminal.end() == 130
    assert bench.stopped


def test_a_terminal_that_stands_still(bench: Bench) -> None:
    # Ctrl-S; and a signal from elsewhere that ends it
    terminal = Terminal(bench, 'run', 10)
    terminal.read('38 Bus Run')
    terminal.type('\x13')
    os.kill(terminal.pid, signal.SIGTERM)
    wait_until(lambda: bench.stopped)
    assert terminal.end() == 130


def test_a_fault(bench: Bench) -> None:
    with bench.running() as process:
        bench.simulator.inject('fault', 5, address=1)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert 'stopped: fault 5 Overload' in err
    assert 'type nfo-sinus ack' in err and '~/' not in err
    assert not bench.state()['driven']
    # and nothing starts when it is acknowledged
    assert bench.run('ack').status == 0
    assert not bench.state()['driven']
    wait_until(lambda: bench.stopped)


@pytest.mark.parametrize(
    ('what', 'value', 'said'),
    [
        ('run', 'off', 'RUN input'),
        ('keypad', 'stop', 'STOP was pressed at the keypad'),
        ('power-cycle', 1, ''),
    ],
)
def test_what_else_stops_it(bench: Bench, what: str, value: object, said: str) -> None:
    with bench.running() as process:
        bench.simulator.inject(what, value, address=1)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1, err
    assert said in err and '~/' not in err
    assert not bench.state()['driven']


def test_a_fault_as_json(bench: Bench) -> None:
    with bench.running('--json') as process:
        bench.simulator.inject('fault', 5, address=1)
        out, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert 'fault 5 Overload' in json.loads(out.splitlines()[-1])['ended']


# --- the line is cut ------------------------------------------------------------------------------


def test_a_cut_line_is_not_called_a_stop(bench: Bench) -> None:
    with bench.running() as process:
        bench.simulator.inject('line-dead', 600)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert 'lost: ' in err and 'the stop is NOT confirmed' in err
    assert err.count('the port is opened again') == 1
    assert 'ending WITHOUT a confirmed stop, the motor may still run' in err
    assert 'emergency stop' in err


def test_a_line_that_comes_back_carries_the_stop(bench: Bench) -> None:
    with bench.running() as process:
        bench.simulator.inject('line-dead', 600)
        assert process.stderr is not None
        read_until(process.stderr, 'the stop is NOT confirmed')
        assert bench.state()['driven']
        bench.simulator.inject('heal')
        err = process.stderr.read()
        assert process.wait(PATIENCE) == 1
    # it may be on its ramp yet
    assert len(re.findall('the stop is confirmed now: (37 Bus Stby|40 Bus Ret)\n', err)) == 1
    assert 'the drive answers again' in err and 'status is not known' not in err
    assert bench.stopped


@pytest.mark.parametrize('until', ['CANNOT STOP', 'the stop is NOT confirmed'])
def test_a_fault_that_came_while_the_line_was_silent_has_its_name(
    bench: Bench, until: str
) -> None:
    with bench.running('--json', '--drive-timeout', 2) as process:
        bench.simulator.inject('line-dead', 600)
        assert process.stderr is not None and process.stdout is not None
        err = read_until(process.stderr, until)
        wait_until(lambda: not bench.state()['driven'])
        bench.simulator.inject('heal')
        err += process.stderr.read()
        end = json.loads(process.stdout.read().splitlines()[-1])
        assert process.wait(PATIENCE) == 1
    assert 'status is not known' not in err
    assert err.count('fault 14 Sio Fail: The serial line failed') == 1
    assert 'then type nfo-sinus ack' in err
    assert end['stop_confirmed'] and '14 Sio Fail' in end['stop']


def test_a_status_from_before_confirms_no_stop() -> None:
    lines: list[str] = []
    session: Any = SimpleNamespace(
        drive=lambda: None, on_mute=lambda call: None, last_tries=lambda seconds: None
    )
    signals: Any = None
    control = ControlSession(session, SimpleNamespace(say=lines.append), signals, ())
    refused: Future[Report] = Future()
    refused.set_exception(DriveError(Cause.TOO_LATE, timeout=15.0))
    before: Any = SimpleNamespace(at=time.monotonic() - 1.0)
    for status in (None, before):
        drive: Any = SimpleNamespace(
            stop=lambda: refused,
            stop_owed=False,
            stop_unconfirmed=False,
            stop_overdue=False,
            end_unconfirmed='ending WITHOUT a confirmed stop',
            state=SimpleNamespace(status=status),
        )
        control.drive = drive
        assert not control.stop()
        assert 'WITHOUT a confirmed stop' in lines[-1]


def test_a_second_ctrl_c_says_that_the_motor_may_run(bench: Bench) -> None:
    with bench.running() as process:
        bench.simulator.inject('line-dead', 600)
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        read_until(process.stderr, 'the stop is NOT confirmed')
        process.send_signal(signal.SIGINT)
        err = process.stderr.read()
        assert process.wait(PATIENCE) == 1
    assert 'ending WITHOUT a confirmed stop' in err


def test_a_drive_that_is_not_released_after_its_stop_is_no_failure(make_bench: MakeBench) -> None:
    bench = make_bench(settings={'control.accel': 0.2, 'control.retard': 2})
    with bench.running() as process:
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        read_until(process.stderr, 'ramps down')
        bench.refuse('fieldbus.mode', Reason.STATE)
        err = process.stderr.read()
        assert process.wait(PATIENCE) == 0, err
    assert 'control was not released: ' in err and 'WITHOUT a confirmed stop' not in err


# --- a long ramp ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('settings', 'said'),
    [
        ({}, 'left to its ramp'),
        ({'serial.sio_tot': 2, 'serial.auto_stop': True}, 'the motor coasts'),
    ],
)
def test_a_second_ctrl_c_ends_the_wait_for_a_ramp(
    make_bench: MakeBench, settings: dict[str, Any], said: str
) -> None:
    bench = make_bench(settings={'control.accel': 0.2, 'control.retard': 500, **settings})
    with bench.running() as process:
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        read_until(process.stderr, 'ramps down')
        assert bench.state()['driven']
        process.send_signal(signal.SIGINT)
        err = process.stderr.read()
        assert process.wait(PATIENCE) == 0
    assert said in err
    state = bench.state()
    # it stops by itself, and nothing stands that would run it
    assert state['scmd'] == 0 and state['state'] != 'OPERATION_ENABLED'


def test_sigterm_does_not_wait_for_a_long_ramp(make_bench: MakeBench) -> None:
    bench = make_bench(settings={'control.accel': 0.2, 'control.retard': 500})
    with bench.running() as process:
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert 'left to its ramp' in err
    assert bench.state()['driven'] and bench.state()['state'] == 'SHUTDOWN'


# --- refused, and nothing is written --------------------------------------------------------------


@pytest.mark.parametrize(
    ('settings', 'setpoint', 'said'),
    [
        ({}, 150.1, 'Freque -150 to 150 Hz'),
        ({}, -151, 'set-point -151 Hz is out of range'),
        # rpm, as it seems
        ({}, 145, 'beyond what is nominal for this motor, 50 Hz: check the unit'),
        ({'control.mode': 'Speed'}, -1500, '-1500 rpm is beyond what is nominal for this motor'),
        ({'control.mode': 'Torque'}, 101, 'if it is meant so, give --setpoint-max 101'),
        ({'control.mode': 'Speed'}, 9001, 'Speed -9000 to 9000 rpm'),
        ({'control.mode': 'Torque'}, 201, 'Torque -200 to 200 %'),
    ],
)
def test_out_of_range(
    make_bench: MakeBench, settings: dict[str, Any], setpoint: float, said: str
) -> None:
    bench = make_bench(settings=settings)
    done = bench.run('run', setpoint)
    assert done.status == 1 and said in done.err
    assert nothing_commanded(bench)


def test_beyond_nominal_where_that_is_said(bench: Bench) -> None:
    done = bench.run('run', 61, '--for', 0.1, '--setpoint-max', 60)
    assert done.status == 1 and 'beyond --setpoint-max, 60 Hz' in done.err
    assert nothing_commanded(bench)
    with bench.begun('run', 60, '--setpoint-max', 60) as process:
        wait_until(lambda: bench.state()['frequency'] == pytest.approx(60, abs=0.2))
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0


def test_out_of_range_of_an_optimal(make_bench: MakeBench) -> None:
    bench = make_bench(**OPTIMAL)
    assert '-150 to 150 Hz' in bench.run('run', 200).err
    assert '-9000 to 9000 rpm' in bench.run('run', 10000, '--control-mode', 'Speed').err
    assert nothing_commanded(bench)


def test_another_control_mode(bench: Bench, nfo: Nfo) -> None:
    done = nfo('run', 10, '--control-mode', 'Speed')
    assert done.status == 1
    assert 'in control mode Freque, not Speed' in done.err
    assert nothing_commanded(bench)


def test_a_motor_that_runs_already(bench: Bench, nfo: Nfo) -> None:
    bench.simulator.inject('keypad', 'start', address=1)
    done = nfo('run', 10)
    assert done.status == 1 and 'by keypad or terminals' in done.err
    assert bench.state()['driven']
    bench.simulator.inject('keypad', 'stop', address=1)
    bench.run_by_bus(20)
    done = nfo('run', 10)
    assert done.status == 1 and 'nfo-sinus stop stops it' in done.err
    assert bench.state()['driven'] and bench.writes() == []


def test_a_fault_that_stands(bench: Bench, nfo: Nfo) -> None:
    bench.simulator.inject('fault', 5, address=1)
    done = nfo('run', 10)
    assert done.status == 1
    assert 'fault 5 Overload is active' in done.err and 'type nfo-sinus ack' in done.err
    assert nothing_commanded(bench)


def test_no_run_input(make_bench: MakeBench) -> None:
    bench = make_bench(run_input=False)
    done = bench.run('run', 10)
    assert done.status == 1
    assert 'RUN input (DIN1) is not active' in done.err
    assert bench.state()['source'] == 'stop'


@pytest.mark.parametrize(
    ('typed', 'said'),
    [
        ((), 'which set-point?'),
        (('nan',), 'is no set-point'),
        (('inf',), 'is no set-point'),
        (('fast',), 'invalid'),
        ((10, '--reference', 'terminal'), 'leave the set-point out'),
        ((10, '--for', 0), 'more than 0 s'),
        ((10, '--drive-timeout', 0.5), 'at least 1.5 s'),
        (('--method', 'drive_control', '--reference', 'fix1'), 'must be fieldbus or terminal'),
    ],
)
def test_what_makes_no_sense(
    bench: Bench, nfo: Nfo, typed: tuple[object, ...], said: str
) -> None:
    done = nfo('run', *typed)
    assert done.status == 2 and said in done.err
    assert not bench.state()['command_writes']


def test_no_drive_answers(nfo: Nfo) -> None:
    done = nfo('run', 10, '--address', 9, '--response-timeout', 0.1, '--retries', 0)
    assert done.status == 1 and 'no response from address 9' in done.err


def test_a_busy_port_names_its_holder(nfo: Nfo, bench: Bench) -> None:
    with bench.running() as process:
        for arguments in (['run', 10], ['stop'], ['ack']):
            done = nfo(*arguments)
            assert done.status == 1 and f'(pid {process.pid})' in done.err
        assert bench.state()['driven']
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE)


def test_a_drive_whose_stop_takes_its_time_is_enabled_when_it_is_confirmed(
    make_bench: MakeBench,
) -> None:
    """A MOVITRAC keeps its control mode: connecting makes sure that nothing of before turns it."""
    settings = {'serial.control_mode': 'Remote control', 'serial.response_time': 100}
    bench = make_bench(
        model='movitrac31', protocol='movitrac', serial_numbers=[], settings=settings
    )
    done = bench.run('run', 10, '--for', 4)
    assert done.status == 0, done.err
    assert '10.0 Hz' in done.out
    assert not bench.state()['driven']


def test_the_last_tries_of_a_stop_open_a_mute_port_once_more() -> None:
    tries: list[float] = []
    lines: list[str] = []
    session: Any = SimpleNamespace(
        drive=lambda: None, on_mute=lambda call: None, last_tries=tries.append
    )
    screen: Any = SimpleNamespace(say=lines.append)
    drive: Any = SimpleNamespace(
        stop_unconfirmed=False, stop_overdue=True, state=SimpleNamespace(status=None),
        end_unconfirmed='ending WITHOUT a confirmed stop',
    )
    signals: Any = None
    control = ControlSession(session, screen, signals, ())
    control.drive = drive
    assert not control.confirmed_late(0.0)
    # long enough for what starts after it
    assert len(tries) == 1 and tries[0] >= 8.0
    assert 'WITHOUT a confirmed stop' in lines[0]
