# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``info``, ``list``, ``get``, ``scan``, ``monitor``: what they print, and that they only read."""

from __future__ import annotations

import argparse
from collections.abc import Callable
import contextlib
import io
import json
from pathlib import Path
import signal
import sys

from cli_bench import BACKGROUND, PATIENCE, Bench, Done
import pytest
import yaml

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.cli import scan
from nfo_sinus_driver.cli.console import CliError
from nfo_sinus_driver.cli.main import main, parse

Nfo = Callable[..., Done]
G2 = load_family('sinus_g2')
REACHED = [p for p in G2.settings if {*p.addresses} >= {'modbus', 'classic'}]


def test_info(nfo: Nfo, bench: Bench) -> None:
    done = nfo('info')
    assert done.status == 0 and done.err == ''
    words = dict(line.split(maxsplit=1) for line in done.out.splitlines())
    assert words['vendor'] == 'NFO Drives AB'
    assert words['product'] == 'NFO Sinus 1.50/400'
    assert words['firmware'] == '4.38 / 4018'
    assert words['motor'] == '1.5 kW, 400 V, 50 Hz, 1440 rpm, 3.4 A'
    assert 'NFO1001' in done.out
    assert json.loads(nfo('info', '--address', 2, '--json').out)['serial number'] == 'NFO1002'
    assert bench.writes() == []


def test_what_goes_over_the_line_is_traced_where_that_is_wanted(nfo: Nfo, tmp_path: Path) -> None:
    trace = tmp_path / 'line.jsonl'
    assert nfo('info', '--trace', trace).status == 0
    frames = [json.loads(line) for line in trace.read_text().splitlines()]
    assert [frame['direction'] for frame in frames[:4]] == ['request', 'answer'] * 2
    done = nfo('info', '--trace', tmp_path / 'no' / 'line')
    assert done.status == 2 and 'No such file' in done.err


def test_list_shows_every_setting(nfo: Nfo, bench: Bench) -> None:
    done = nfo('list')
    assert done.status == 0 and done.err == ''
    lines = [line for line in done.out.splitlines() if line.startswith('  ')]
    assert [line.split()[0] for line in lines] == [parameter.key for parameter in REACHED]
    assert '\nControl\n' in done.out
    table = json.loads(nfo('list', '--json').out)
    assert table['motor.p_nom'] == {'value': 1.5, 'unit': 'kW'}
    assert table['control.auto_start'] == {'value': False, 'unit': ''}
    assert len(table) == len(REACHED)
    assert bench.writes() == []


@pytest.mark.parametrize('encoding', ['latin-1', 'ascii'])
@pytest.mark.parametrize(
    'arguments', ['info', 'list', 'list --json', 'get motor.r_stat', 'dump -', 'errors', 'run -h']
)
def test_what_a_locale_cannot_write_ends_no_verb(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, arguments: str, encoding: str
) -> None:
    written = io.BytesIO()
    for name in ('stdout', 'stderr'):
        monkeypatch.setattr(sys, name, io.TextIOWrapper(written, encoding))
    with contextlib.suppress(SystemExit):
        assert main([*bench.options, *arguments.split()]) == 0
    sys.stdout.flush()
    assert written.getvalue()


@pytest.mark.parametrize('name', ['PI Reg', 'pi_reg'])
def test_list_shows_one_group(nfo: Nfo, name: str) -> None:
    keys = [parameter.key for parameter in REACHED if parameter.group == 'PI Reg']
    assert list(json.loads(nfo('list', '--group', name, '--json').out)) == keys


def test_list_shows_measured_values(nfo: Nfo, bench: Bench) -> None:
    done = nfo('list', '--group', 'status')
    assert done.status == 0
    assert 'status.dc_link' in done.out and '565 V' in done.out
    assert bench.writes() == []


def test_no_such_group(nfo: Nfo) -> None:
    done = nfo('list', '--group', 'moter')
    assert done.status == 1
    assert "no group 'moter'" in done.err and 'Motor' in done.err


def test_get(nfo: Nfo, bench: Bench) -> None:
    bench.set('control.accel', 7.5)
    done = nfo('get', 'control.accel', 'control.mode', 'status.dc_link')
    assert done.status == 0
    assert [line.split() for line in done.out.splitlines()] == [
        ['control.accel', '7.5', 's'],
        ['control.mode', 'Freque'],
        ['status.dc_link', '565', 'V'],
    ]
    assert json.loads(nfo('get', 'control.accel', '--json').out) == {
        'control.accel': {'value': 7.5, 'unit': 's'}
    }
    assert bench.writes() == []


def test_get_names_what_is_not_there(nfo: Nfo) -> None:
    done = nfo('get', 'accel', 'control.retard', 'fieldbus.inv_st_with_ack')
    assert done.status == 1 and done.out == ''
    assert 'accel (did you mean control.accel?)' in done.err
    # reading it would acknowledge a fault
    assert 'fieldbus.inv_st_with_ack' in done.err
    assert 'control.retard' not in done.err.split('did you mean')[0]


def test_errors(nfo: Nfo, bench: Bench) -> None:
    assert nfo('errors').out == 'the error log is empty\n'
    for code in (5, 12):
        bench.simulator.inject('fault', code, address=1)
    done = nfo('errors')
    assert done.status == 0 and done.err == ''
    assert [line.split(maxsplit=3)[:3] for line in done.out.splitlines()] == [
        ['1234.5', 'h', '12'],
        ['1234.5', 'h', '5'],
    ]
    newest, _ = done.out.splitlines()
    assert 'Cur High  0.0 operating hours ago' in newest
    # it may be of a year ago, if the drive was off since
    assert newest.endswith(' or before')
    (newest,) = json.loads(nfo('errors', '--count', 1, '--json').out)
    assert newest.pop('time').endswith(' or before')
    assert newest == {'code': 12, 'text': 'Cur High', 'operating_time': 1234.5, 'age': 0.0}
    assert bench.writes() == []


def test_errors_of_a_model_without_a_log(nfo: Nfo) -> None:
    done = nfo('errors', '--model', 'sinus_optimal')
    assert done.status == 1 and done.out == ''
    assert 'not documented' in done.err


def test_options_stand_before_and_behind_the_verb(nfo: Nfo, bench: Bench) -> None:
    bench.set('control.accel', 7.5, address=2)
    assert '7.5' in nfo('--address', 2, 'get', 'control.accel').out
    assert '7.5' in nfo('get', 'control.accel', '--address', 2).out
    assert '7.5' in nfo('--address', 1, 'get', 'control.accel', '--address', 2).out
    assert '7.5' not in nfo('get', 'control.accel').out


def test_no_drive_answers(nfo: Nfo) -> None:
    done = nfo('info', '--address', 9, '--response-timeout', 0.1, '--retries', 0)
    assert done.status == 1 and done.out == ''
    assert 'no response from address 9' in done.err


def test_there_is_no_such_port(nfo: Nfo) -> None:
    done = nfo('info', '--port', '/dev/no-such-port')
    assert done.status == 1
    assert '/dev/no-such-port does not exist' in done.err


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        (['scream'], 'there is no verb scream'),
        ([], 'VERB'),
        (['get'], 'NAME'),
        (['info', '--address', '256'], 'allowed are 0 to 255'),
        (['info', '--address', '0'], 'address 0: Modbus has 1 to 247'),
        (['info', '--protocol', 'classic', '--address', '95'], 'Classic has 0 to 94'),
        (['scan', '--protocol', 'classic', '--addresses', '90-95'], 'Classic has 0 to 94'),
        (['info', '--protocol', 'movitrac', '--address', '64'], 'Movitrac has 0 to 63'),
        (['info', '--baud-rate', '300'], 'invalid choice'),
        (['info', '--char-format', '8X1'], '8E1'),
        (['info', '--port', '192.0.2.1:4001'], 'socket://192.0.2.1:4001'),
        (['set', 'control.accel'], 'NAME=VALUE'),
        (['set', 'control.accel=1', 'control.accel=2'], 'given twice'),
        (['diff'], 'one file, or two, or --against'),
        (['diff', 'a', '--against', '2'], 'one file, or two, or --against'),
        (['diff', '--against', '1'], 'the same drive'),
        (['scan', '--addresses', '5-3'], 'list of addresses'),
        (['scan', '--addresses', '1,5-3'], 'list of addresses'),
        (['scan', '--addresses', '1-'], '1-'),
        (['monitor', '--count', '0'], '1 or more'),
        (['family', 'check'], 'one file or more'),
        (['family', 'list', 'a'], 'takes none'),
        (['info', '--model', 'movitrac31'], 'no movitrac31 is on a line of modbus_rtu'),
        (['info', '--model', 'sinus_h'], 'set protocol to modbus_tcp'),
        (['get', 'control.accel', '--control-method', 'ds402'], 'set protocol to canopen'),
        (['scan', '--address', '1-32'], 'scan and monitor take --addresses 1-32'),
        (['load', 'a', '--put-back', '--keep'], 'not allowed with'),
    ],
)
def test_what_makes_no_sense_is_a_matter_of_usage(
    nfo: Nfo, arguments: list[str], text: str
) -> None:
    done = nfo(*arguments)
    assert done.status == 2 and done.out == ''
    assert text in done.err


# --- scan -----------------------------------------------------------------------------------------


def test_scan_finds_who_answers(nfo: Nfo, bench: Bench) -> None:
    done = nfo('scan', '--addresses', '2-3,1', '--retries', 1)
    assert done.status == 0, done.err
    rows = [line.split() for line in done.out.splitlines()]
    assert rows[0][0] == 'address'
    assert [row[0] for row in rows[1:]] == ['1', '2']
    assert ' '.join(rows[1]) == '1 19200 8E1 NFO Sinus 1.50/400 4.38 / 4018 NFO1001'
    assert bench.writes() == []


def test_an_address_where_each_request_is_answered_twice_is_named(
    nfo: Nfo, bench: Bench, tmp_path: Path
) -> None:
    once = nfo('dump', tmp_path / 'once.yaml')
    assert once.status == 0, once.err
    bench.simulator.inject('noise-rate', 'double', 1)
    done = nfo('scan', '--addresses', '1')
    assert done.status == 0, done.err
    assert 'unit 1 answers each request twice: two drives at one address' in done.err
    twice = nfo('dump', tmp_path / 'twice.yaml')
    assert twice.status == 0, twice.err
    assert 'unit 1 answers each request twice' in twice.err
    saved = [(tmp_path / f'{name}.yaml').read_text() for name in ('once', 'twice')]
    assert settings_of(saved[0]) == settings_of(saved[1])


def settings_of(text: str) -> list[str]:
    """The lines that are no comments."""
    return [line for line in text.splitlines() if not line.startswith('#')]


@pytest.mark.parametrize(
    ('protocol', 'first', 'last'),
    [('modbus_rtu', 1, 247), ('classic', 1, 94), ('movitrac', 0, 63)],
)
def test_scan_asks_every_address_that_a_drive_may_have(
    protocol: str, first: int, last: int
) -> None:
    options = parse(['scan', '--protocol', protocol])
    assert options.addresses == tuple(range(first, last + 1))


def test_scan_tries_all_settings_and_finds_no_drive_twice(nfo: Nfo) -> None:
    done = nfo('scan', '--addresses', '1-2', '--all-settings', '--json', '--retries', 1)
    assert done.status == 0, done.err
    found = json.loads(done.out)
    # a pseudo-terminal has no baud rate, so that the first setting finds them
    assert [(drive['address'], drive['line']) for drive in found] == [
        (1, '19200 8E1'),
        (2, '19200 8E1'),
    ]


def test_scan_finds_no_drive(nfo: Nfo) -> None:
    done = nfo('scan', '--addresses', '3-4', '--all-settings', '--response-timeout', 0.02)
    assert done.status == 1 and done.out == ''
    assert 'no response' in done.err


@pytest.mark.parametrize(
    ('fault', 'retries', 'requests', 'found'),
    [
        ('drop', (), 1, False),
        ('drop', ('--retries', 1), 2, True),
        # a drive is there, whatever was said
        ('damage', (), 2, True),
    ],
)
def test_scan_asks_again(
    nfo: Nfo, bench: Bench, fault: str, retries: tuple[object, ...], requests: int, found: bool
) -> None:
    bench.simulator.inject(fault, 1, address=1)
    done = nfo('scan', '--addresses', '1', *retries)
    assert (done.status == 0) is found, done.err
    assert bench.requests()[:3].count(bench.requests()[0]) == requests
    assert bench.writes() == []


def test_scan_writes_a_parameter_file_for_the_driver(
    nfo: Nfo, bench: Bench, tmp_path: Path
) -> None:
    file = tmp_path / 'line.yaml'
    arguments = ('scan', '--addresses', '1-3', '--params', file, '--retries', 1)
    done = nfo(*arguments)
    assert done.status == 0, done.err
    assert f'--params-file {file}' in done.err
    written = yaml.safe_load(file.read_text())
    assert written == {
        '/**': {'ros__parameters': {'setpoint_timeout': 2.5}},
        '/**/nfo_sinus_bus': {
            'ros__parameters': {
                'port': bench.simulator.port,
                'protocol': 'modbus_rtu',
                'baud_rate': 19200,
                'char_format': '8E1',
                'response_timeout': 2.0,
                'drives': ['drive_1', 'drive_2'],
            }
        },
        '/**/drive_1': {
            'ros__parameters': {'address': 1, 'model': 'sinus_g2', 'drive_timeout': 2.0}
        },
        '/**/drive_2': {
            'ros__parameters': {'address': 2, 'model': 'sinus_g2', 'drive_timeout': 2.0}
        },
    }
    assert 'writes it to the drive (SioTot and AutoStop)' in file.read_text()
    assert '# NFO Sinus 1.50/400, firmware 4.38 / 4018, serial NFO1001\n' in file.read_text()
    # it may have been edited since
    file.write_text('mine')
    frames = len(bench.requests())
    again = nfo(*arguments)
    assert again.status == 1 and 'exists already' in again.err
    assert file.read_text() == 'mine' and len(bench.requests()) == frames
    assert nfo(*arguments, '--force').status == 0
    assert 'drive_2' in file.read_text()
    assert bench.writes() == []


def test_scan_names_a_folder_for_a_file_before_it_asks_any_drive(
    nfo: Nfo, bench: Bench, tmp_path: Path
) -> None:
    for more in ([], ['--force']):
        done = nfo('scan', '--addresses', '1', '--params', tmp_path, *more)
        assert done.status == 1
        such = tmp_path / 'line.yaml'
        assert f'{tmp_path} is a folder: name a file in it, such as {such}' in done.err
    done = nfo('scan', '--addresses', '1', '--params', tmp_path / 'none' / 'line.yaml')
    assert done.status == 1 and f'there is no folder {tmp_path}/none' in done.err
    assert bench.requests() == []


def test_scan_writes_the_file_to_the_standard_output_alone(nfo: Nfo) -> None:
    done = nfo('scan', '--addresses', '1', '--params', '-', '--retries', 1)
    assert done.status == 0, done.err
    assert list(yaml.safe_load(done.out)) == ['/**', '/**/nfo_sinus_bus', '/**/drive_1']
    assert 'NFO1001' in done.err


def test_scan_writes_no_file_of_drives_that_make_no_line(
    nfo: Nfo, bench: Bench, tmp_path: Path
) -> None:
    file = tmp_path / 'line.yaml'
    done = nfo('scan', '--addresses', '7', '--params', file, '--response-timeout', 0.02)
    assert done.status == 1 and not file.exists()
    found = {
        1: {'line': '19200 8E1', 'model': 'sinus_g2'},
        # one that answers, but not as this model does
        2: {'line': '9600 8E1', 'model': 'auto'},
    }
    options = argparse.Namespace(params=str(file), model='sinus_g2')
    with pytest.raises(CliError, match='several') as raised:
        scan._write_params(options, found, {1: (19200, '8E1'), 2: (9600, '8E1')})
    assert '2: 9600 8E1' in str(raised.value)
    assert '(nfo-sinus set serial.si_baud=...)' in str(raised.value)
    # it has none that is known
    options.model = 'sinus_optimal'
    with pytest.raises(CliError, match=r'set them alike \(at the keypad\)'):
        scan._write_params(options, found, {1: (19200, '8E1'), 2: (9600, '8E1')})
    assert not file.exists()


def test_scan_by_default_asks_all(nfo: Nfo, bench: Bench) -> None:
    done = nfo('scan', '--response-timeout', 0.01, '--json')
    asked = {request[0] for request in bench.requests()}
    # on a busy machine one may run into the late answer to another
    assert asked <= set(range(1, 248)) and len(asked) > 200
    # some may have been too slow for it
    assert {drive['address'] for drive in json.loads(done.out)} <= {1, 2}


# --- monitor --------------------------------------------------------------------------------------


def test_monitor(nfo: Nfo, bench: Bench) -> None:
    bench.simulator.inject('keypad', 'start', address=1)
    done = nfo('monitor', '--count', 3, '--period', 0.05)
    assert done.status == 0
    lines = done.out.splitlines()
    assert len(lines) == 3
    # on a busy machine its ramp may be over by then
    assert all(('31 ' in line or '30 ' in line) and ' Hz ' in line for line in lines)
    head, line = done.err.splitlines()
    names = ('used', 'cycle', 'min', 'median', 'p99', 'max')
    assert [head.index(name) for name in names] == sorted(head.index(name) for name in names)
    cells = line.split()
    assert cells[0] == 'line' and cells[2] == '%' and float(cells[3]) > 0.0
    least, median, p99, most = map(float, cells[4:8])
    assert 0.0 < least <= median <= p99 <= most
    assert int(cells[8]) > 20 and cells[9:] == ['0', '0', '0', '0']
    assert bench.writes() == []
    assert bench.drive().control_unit.ack_reads == 0
    assert bench.drive().motor.driven


def test_monitor_of_several_drives_shows_each_and_the_line(nfo: Nfo, bench: Bench) -> None:
    done = nfo('monitor', '--addresses', '1,2', '--count', 3, '--period', 0.05)
    assert done.status == 0
    assert [line.split()[1] for line in done.out.splitlines()] == ['1', '2'] * 3
    _, line, first, second = done.err.splitlines()
    assert (first.split()[:2], second.split()[:2]) == (['drive', '1'], ['drive', '2'])
    requests = [int(row.split()[-5]) for row in (line, first, second)]
    assert requests[0] == requests[1] + requests[2] and min(requests) > 20
    done = nfo('monitor', '--addresses', '1,2', '--count', 2, '--period', 0.05, '--json')
    rows = [json.loads(text) for text in done.out.splitlines()]
    assert [row['address'] for row in rows] == [1, 2] * 2
    assert rows[0]['statistics']['cycle_time'] is None
    assert rows[2]['statistics']['cycle_time'] > 0.0
    assert rows[2]['statistics']['round_trip_median'] > 0.0
    assert done.err == ''


def test_monitor_reports_which_of_several_drives_is_missing(nfo: Nfo, bench: Bench) -> None:
    bench.simulator.inject('silence', 60, address=2)
    done = nfo(
        'monitor', '--addresses', '1,2', '--count', 2, '--period', 0.01,
        '--json',
    )  # fmt: skip
    assert done.status == 1
    rows = [json.loads(text) for text in done.out.splitlines()]
    assert [(row['address'], row['connected']) for row in rows] == [(1, True), (2, False)] * 2
    assert rows[1]['statistics']['timeouts'] == 3
    assert rows[1]['statistics']['retries'] == 2
    assert rows[1]['statistics']['round_trip_min'] is None


def test_monitor_does_not_acknowledge(nfo: Nfo, bench: Bench) -> None:
    bench.simulator.inject('fault', 5, address=1)
    done = nfo('monitor', '--count', 1, '--json')
    facts = json.loads(done.out)
    assert facts['connected'] and facts['code'] == 5 and facts['kind'] == 'fault'
    assert facts['frequency'] == 0.0
    assert bench.writes() == []
    assert bench.drive().control_unit.status_code == 5


def test_monitor_reports_a_drive_that_goes_silent(nfo: Nfo, bench: Bench) -> None:
    bench.on_read('status.dc_link', lambda: bench.simulator.inject('silence', 60, address=1))
    done = nfo('monitor', '--count', 3, '--period', 0.01, '--json')
    assert done.status == 1
    assert [json.loads(line)['connected'] for line in done.out.splitlines()][-1] is False


@pytest.mark.parametrize('through', [(), BACKGROUND], ids=['foreground', 'background'])
def test_monitor_ends_with_ctrl_c(bench: Bench, through: tuple[str, ...]) -> None:
    process = bench.begin('monitor', '--period', 0.05, through=through)
    assert process.stdout is not None
    assert 'Hz' in process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    # a busy machine may lose answers, which is reported before
    *_, head, line = said.splitlines()
    assert 'median' in head and line.startswith('line '), said
    assert process.returncode == 0


# --- the port -------------------------------------------------------------------------------------


def test_a_busy_port_names_its_holder(nfo: Nfo, bench: Bench) -> None:
    holder = bench.begin('monitor', '--period', 0.05)
    assert holder.stdout is not None
    assert 'Hz' in holder.stdout.readline()
    try:
        for arguments in (['info'], ['scan'], ['diff', '--against', 2], ['set', 'control.accel=7']):
            done = nfo(*arguments)
            assert done.status == (2 if arguments[0] == 'diff' else 1)
            assert 'in use by' in done.err and f'(pid {holder.pid})' in done.err
            assert done.out == ''
    finally:
        holder.kill()
        holder.communicate()


def test_output_without_a_reader(bench: Bench) -> None:
    process = bench.begin('monitor', '--period', 0.05)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.wait(60) == 1
    assert process.stderr.read() == ''
    process.stderr.close()


@pytest.mark.parametrize(
    'verb',
    [
        ('info',), ('list', '--json'), ('get', 'control.accel'), ('dump',), ('errors',),
        ('scan', '--addresses', '1', '--json'), ('scan', '--addresses', '1', '--params', '-'),
        ('monitor', '--count', '1'), ('family', 'list'), ('completion',),
    ],
)
@pytest.mark.parametrize(
    ('how', 'why'), [('>/dev/full', 'No space left on device'), ('>&-', 'it is closed')]
)
def test_output_that_cannot_be_written(
    bench: Bench, verb: tuple[str, ...], how: str, why: str
) -> None:
    process = bench.begin(*verb, through=('sh', '-c', f'exec "$@" {how}', 'sh'))
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out) == (1, '')
    assert f'nfo-sinus: the output cannot be written: {why}\n' in err
    assert 'Error' not in err


# --- another family -------------------------------------------------------------------------------


def test_an_optimal(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(model='sinus_optimal', serial_numbers=[])
    optimal = ('--model', 'sinus_optimal')
    facts = json.loads(bench.run('info', '--json', *optimal).out)
    assert facts['model'] == 'sinus_optimal' and facts['state'] == 'ready to switch on'
    assert bench.run('list', '--group', 'status', *optimal).status == 0
    done = bench.run('monitor', '--count', 1, '--json', *optimal)
    assert json.loads(done.out)['frequency'] == 0.0 and json.loads(done.out)['torque'] is None
    for verb in ('list', 'dump'):
        done = bench.run(verb, *optimal)
        assert done.status == 1 and done.out == ''
        assert 'of a sinus_optimal no settings are known' in done.err
    done = bench.run('info', '--model', 'sinus_g2')
    assert done.status == 1
    assert 'not as a sinus_g2 does' in done.err and '--model' in done.err
    done = bench.run('scan', '--addresses', '1', '--model', 'sinus_g2')
    assert done.status == 0 and 'no sinus_g2?' in done.out
    assert bench.writes() == []


def test_part_numbers_of_a_movitrac_are_those_of_its_display(
    make_bench: Callable[..., Bench],
) -> None:
    # P810 and P812 [M4 §4]
    bench = make_bench(
        model='movitrac31', protocol='movitrac', serial_numbers=[], option_card='ffi'
    )
    with bench.simulator.lock:
        bench.drive().memory.put('special.eprom_fieldbus', 0x21123A11)
    shown = bench.run('get', 'special.software_system', 'special.eprom_fieldbus').out
    assert [line.split(None, 1)[1].strip() for line in shown.splitlines()] == [
        '554841105 (821 123 4.11)', '554842641 (821 123 X.11)'
    ]
    assert '554841105 (821 123 4.11)' in bench.run('list', '--group', 'special').out


def test_a_movitrac_says_who_it_is_what_it_shows_and_what_its_faults_were(
    make_bench: Callable[..., Bench],
) -> None:
    # index 271 and 306; P050, P071, index 284 and 298; P060 and index 400 on [M4 §4]
    bench = make_bench(
        model='movitrac31', protocol='movitrac', serial_numbers=[], option_card='ffi'
    )
    with bench.simulator.lock:
        bench.drive().memory.put('status.fieldbus_type', 200)
        bench.drive().trip(101)
        word = int(bench.drive().peek('fieldbus.inverter_status'))
    shown = bench.run('info').out
    assert 'MOVITRAC 31C015-503-4-00' in shown and '821 123 4.11' in shown
    names = 'option_x20', 'fieldbus_type', 'stop_setpoint_1_n2', 'output_stage'
    done = bench.run('get', *(f'status.{name}' for name in names), 'fieldbus.inverter_status')
    shown = [line.split(None, 1)[1] for line in done.out.splitlines()]
    bits = ', '.join(str(bit) for bit in range(32) if word >> bit & 1)
    shown_word = f'{word} ({word:08X}h: bits {bits})'
    assert shown == ['FF. (Fieldbus)', 'INTERBUS-S', '0', '31C015-503-4-00', shown_word]
    done = bench.run('errors')
    assert done.status == 0 and 'Overcurrent (DC link ' in done.out
