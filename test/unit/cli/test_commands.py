# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``stop``, ``ack`` and ``errors --erase``, judged by the simulated drive itself."""

from __future__ import annotations

from collections.abc import Callable
import json
import re
import signal
from typing import Any
from unittest import mock

from cli_bench import PATIENCE, QUICK, Bench, Done, MakeBench, wait_until
import pytest

from nfo_sinus_driver.families.sinus_g2.words import ControlWord
from nfo_sinus_driver.families.sinus_optimal import words as words_optimal
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.motor import Motor

Nfo = Callable[..., Done]
OVERLOAD, SIO_FAIL = 5, 14
HASTY = ('--response-timeout', 0.1, '--retries', 0)
OPTIMAL = {'model': 'sinus_optimal', 'serial_numbers': []}
CONNECTIONS: dict[str, dict[str, Any]] = {
    'modbus_rtu': {},
    'modbus_ascii': {'protocol': 'modbus_ascii'},
    'modbus_tcp': {'protocol': 'modbus_tcp'},
    'classic': {'protocol': 'classic'},
    'optimal': OPTIMAL,
}
#: Those of a drive that has an error log.
CONNECTIONS_OF_THE_G2 = {
    name: options for name, options in CONNECTIONS.items() if name != 'optimal'
}


@pytest.fixture
def bench(make_bench: MakeBench) -> Bench:
    """A line with drives that have short ramps."""
    return make_bench(settings=QUICK)


# --- stop -----------------------------------------------------------------------------------------


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_stop(make_bench: MakeBench, connection: str) -> None:
    bench = make_bench(settings=QUICK, **CONNECTIONS[connection])
    bench.run_by_bus()
    done = bench.run('stop')
    assert done.status == 0, done.err
    assert 'stopping: it ramps down' in done.err
    assert 'control released' in done.out
    assert bench.stopped


#: What is written into the control word, step by step, until the motor runs.
_READY = (
    ControlWord.NET_CTRL
    | ControlWord.NET_REF
    | ControlWord.ENABLE_VOLTAGE
    | ControlWord.DISABLE_QUICK_STOP
    | ControlWord.ENABLE_RFG
    | ControlWord.UNLOCK_RFG
    | ControlWord.USE_REF_FOR_RFG
)
_ENABLED = words_optimal.ControlWord.BUS_CONTROL | words_optimal.ControlWord.ENABLE
STEPS = {
    'sinus_g2': (
        _READY,
        _READY | ControlWord.SWITCH_ON,
        _READY | ControlWord.SWITCH_ON | ControlWord.ENABLE_OP,
    ),
    'sinus_optimal': (
        words_optimal.ControlWord.BUS_CONTROL,
        _ENABLED,
        _ENABLED | words_optimal.ControlWord.SWITCH_ON,
    ),
}


@pytest.mark.parametrize('connection', ['modbus_rtu', 'classic', 'optimal'])
def test_stop_of_what_the_control_word_runs(make_bench: MakeBench, connection: str) -> None:
    bench = make_bench(settings=QUICK, **CONNECTIONS[connection])
    drive = bench.drive()
    with bench.simulator.lock:
        drive.memory.set(drive.control_unit.setpoint_key, 20.0)
    for word in STEPS[drive.model.name]:
        begun = bench.state()['time']
        with bench.simulator.lock:
            drive.write_raw('fieldbus.drive_control', int(word))
        # the drive takes its time for each step
        wait_until(lambda begun=begun: bench.state()['time'] > begun + 0.3)
    wait_until(lambda: bench.state()['driven'])
    done = bench.run('stop')
    assert done.status == 0, done.err
    assert not bench.state()['driven']


def test_stop_that_coasts(make_bench: MakeBench) -> None:
    bench = make_bench(settings={**QUICK, 'control.st_mode': 'Release'})
    bench.run_by_bus()
    done = bench.run('stop')
    assert done.status == 0
    assert not bench.state()['driven']
    assert 'stopp' in done.err


@pytest.mark.parametrize('connection', ['modbus_rtu', 'classic'])
def test_quick_stop(make_bench: MakeBench, connection: str) -> None:
    bench = make_bench(
        settings={'control.retard': 500, 'control.accel': 0.2}, **CONNECTIONS[connection]
    )
    bench.run_by_bus()
    done = bench.run('stop', '--quick')
    assert done.status == 0, done.err
    assert 'released: the motor coasts' in done.out
    state = bench.state()
    assert not state['driven'] and state['source'] == 'stop'


def test_quick_stop_of_an_optimal(make_bench: MakeBench) -> None:
    bench = make_bench(settings=QUICK, **OPTIMAL)
    bench.run_by_bus()
    done = bench.run('stop', '--quick')
    assert done.status == 0
    assert 'this drive has no quick stop' in done.err
    assert not bench.state()['driven']


def test_stop_of_a_motor_that_does_not_run(bench: Bench, nfo: Nfo) -> None:
    done = nfo('stop')
    assert done == Done(0, 'the motor does not run (24 Stop)\n', '')
    assert json.loads(nfo('stop', '--json').out)['confirmed'] is True
    assert bench.writes() == []


@pytest.mark.parametrize('key', ['start', 'ext'])
def test_stop_of_what_is_run_at_the_drive(bench: Bench, nfo: Nfo, key: str) -> None:
    bench.simulator.inject('keypad', key, address=1)
    wait_until(lambda: bench.state()['driven'])
    done = nfo('stop')
    assert done.status == 1 and done.out == ''
    assert 'keypad or terminals run the motor' in done.err
    assert 'the bus cannot stop it: press STOP at the keypad' in done.err
    assert bench.state()['driven'] and bench.writes() == []


def test_stop_waits_for_the_ramp(make_bench: MakeBench) -> None:
    bench = make_bench(settings={'control.accel': 0.2, 'control.retard': 5})
    bench.run_by_bus(20)
    done = bench.run('stop', '--json')
    assert done.status == 0
    assert not bench.state()['driven'] and bench.state()['source'] == 'stop'
    assert json.loads(done.out) == {
        'confirmed': True,
        'message': 'stopped (37 Bus Stby); control released',
    }


def test_stop_that_is_not_confirmed(bench: Bench) -> None:
    bench.run_by_bus()
    for key in ('fieldbus.scmd', 'fieldbus.mode'):
        bench.refuse(key, Reason.STATE)
    with bench.begun('stop') as process:
        assert process.stderr is not None
        said = process.stderr.readline()
        assert 'emergency stop' in said
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1 and out == ''
    assert 'the stop is NOT confirmed' in said + err
    assert 'ending WITHOUT a confirmed stop' in err
    assert bench.state()['driven']


def test_stop_of_a_motor_whose_speed_stays_is_no_success(bench: Bench) -> None:
    bench.run_by_bus()
    with mock.patch.object(Motor, 'frequency', property(lambda _: 20.0)):
        done = bench.run('stop', '--quick', '--json')
    assert done.status == 1 and json.loads(done.out)['confirmed'] is False
    assert 'the motor turns at 20 Hz and does not slow down' in done.err
    assert 'ending WITHOUT a confirmed stop' in done.err


def test_stop_of_a_drive_that_is_silent(bench: Bench) -> None:
    bench.run_by_bus()
    bench.simulator.inject('silence', 600, address=1)
    done = bench.run('stop', *HASTY)
    assert done.status == 1
    assert 'the stop is NOT confirmed: no response from address 1' in done.err
    assert 'emergency stop' in done.err
    assert json.loads(bench.run('stop', '--json', *HASTY).out)['confirmed'] is False


# --- ack ------------------------------------------------------------------------------------------


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_ack(make_bench: MakeBench, connection: str) -> None:
    bench = make_bench(**CONNECTIONS[connection])
    bench.simulator.inject('fault', OVERLOAD, address=1)
    code = bench.state()['inv_st']
    done = bench.run('ack')
    assert done.status == 0, done.err
    assert re.match(f'acknowledged {code} ', done.out)
    assert done.err == ''
    assert bench.state()['fault'] == 0


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_ack_under_a_run_command_that_stands_starts_nothing(
    make_bench: MakeBench, connection: str
) -> None:
    bench = make_bench(settings=QUICK, **CONNECTIONS[connection])
    bench.run_by_bus()
    bench.simulator.inject('fault', OVERLOAD, address=1)
    done = bench.run('ack')
    assert done.status == 0, done.err
    state = bench.state()
    assert not state['driven'] and state['source'] == 'stop' and state['fault'] == 0


def test_ack_of_a_serial_fault(make_bench: MakeBench) -> None:
    settings = {**QUICK, 'serial.sio_tot': 1, 'serial.auto_stop': True}
    bench = make_bench(settings=settings)
    bench.run_by_bus()
    wait_until(lambda: bench.state()['fault'] == SIO_FAIL)
    done = bench.run('ack')
    assert done.status == 0
    assert done.out.startswith('acknowledged 14 Sio Fail')
    assert bench.state()['source'] == 'stop' and bench.state()['fault'] == 0


def test_ack_of_a_fault_that_still_stands(bench: Bench, nfo: Nfo) -> None:
    bench.simulator.inject('fault', OVERLOAD, address=1, standing=True)
    done = nfo('ack')
    assert done.status == 1 and done.out == ''
    assert '5 Overload is still active' in done.err and 'Reduce the load' in done.err
    facts = json.loads(nfo('ack', '--json').out)
    assert facts['acknowledged'] is False and facts['code_now'] == OVERLOAD
    bench.simulator.inject('ack-cause-gone', address=1)
    facts = json.loads(nfo('ack', '--json').out)
    assert facts['acknowledged'] is True
    assert facts['code'] == OVERLOAD and facts['text'] == 'Overload' and facts['code_now'] == 24


def test_ack_of_nothing(bench: Bench, nfo: Nfo) -> None:
    assert nfo('ack') == Done(0, 'nothing to acknowledge (24 Stop)\n', '')
    bench.run_by_bus()
    done = nfo('ack')
    assert done.status == 0 and 'nothing to acknowledge' in done.out
    assert bench.state()['driven'] and bench.writes() == []


# --- errors --erase -------------------------------------------------------------------------------


@pytest.mark.parametrize('by', ['bus', 'keypad'])
def test_a_motor_that_runs_keeps_its_error_log(bench: Bench, nfo: Nfo, by: str) -> None:
    if by == 'bus':
        bench.run_by_bus()
    else:
        bench.simulator.inject('keypad', 'start', address=1)
    done = nfo('errors', '--erase', '--yes')
    assert done.status == 1
    assert 'the motor runs' in done.err and 'stop it first' in done.err
    assert bench.state()['driven'] and bench.writes() == []


@pytest.mark.parametrize('connection', CONNECTIONS_OF_THE_G2)
def test_erase(make_bench: MakeBench, connection: str) -> None:
    bench = make_bench(**CONNECTIONS[connection])
    for code in (5, 12):
        bench.simulator.inject('fault', code, address=1)
    assert bench.run('ack').status == 0
    done = bench.run('errors', '--erase', '--yes')
    assert done.status == 0, done.err
    first, second, last = done.out.splitlines()
    assert 'Cur High' in first and 'Overload' in second
    assert last == 'erased: 2 entries'
    assert bench.state()['error_log'] == []
    assert bench.state()['source'] == 'stop'
    assert bench.run('errors', '--erase', '--yes').out == 'the error log is empty already\n'


def test_erase_as_json(bench: Bench, nfo: Nfo) -> None:
    bench.simulator.inject('fault', 5, address=1)
    assert nfo('ack').status == 0
    (erased,) = json.loads(nfo('errors', '--erase', '--yes', '--json').out)['erased']
    assert erased['code'] == 5
    assert json.loads(nfo('errors', '--erase', '--yes', '--json').out) == {'erased': []}


@pytest.mark.parametrize(('answer', 'erased'), [('y\n', True), ('n\n', False)])
def test_erase_asks_on_a_terminal(bench: Bench, answer: str, erased: bool) -> None:
    bench.simulator.inject('fault', 5, address=1)
    assert bench.run('ack').status == 0
    before = bench.state()['error_log']
    done = bench.on_terminal('errors', '--erase', ask='[y/N] ', answer=answer)
    assert 'Erase the error log (1 entry) of address 1?' in done.out
    assert done.status == (0 if erased else 1)
    assert bench.state()['error_log'] == ([] if erased else before)


def test_erase_does_not_begin_unasked(bench: Bench) -> None:
    bench.simulator.inject('fault', 5, address=1)
    done = bench.run('errors', '--erase')
    assert done.status == 2 and '--yes' in done.err
    assert len(bench.state()['error_log']) == 1


def test_erase_while_a_fault_stands(bench: Bench, nfo: Nfo) -> None:
    bench.simulator.inject('fault', 5, address=1)
    done = nfo('errors', '--erase', '--yes')
    assert done.status == 1
    assert 'fault 5 Overload is active' in done.err and 'type nfo-sinus ack' in done.err
    assert len(bench.state()['error_log']) == 1


def test_erase_of_an_optimal(make_bench: MakeBench) -> None:
    done = make_bench(**OPTIMAL).run('errors', '--erase', '--yes')
    assert done.status == 1 and 'not documented' in done.err
