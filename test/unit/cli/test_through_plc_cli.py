# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The command with drives behind a PLC: settings and the error log by its mailbox."""

from __future__ import annotations

from collections.abc import Callable
import dataclasses
import json
from pathlib import Path
from typing import Any

from cli_bench import PATIENCE, Bench, Done, MakeBench
import pytest
import yaml

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.cli import session
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link import PROTOCOLS
from nfo_sinus_driver.simulator.plc import PlcSetting

Nfo = Callable[..., Done]
QUICK = PlcSetting(layout=2, cycle=0.002, exchange=0.004, access_time=0.002)
OVER_MODBUS = {
    row.key for row in load_family('sinus_g2').settings if 'profibus' in row.addresses
}


def behind_plc(make_bench: MakeBench, plc: PlcSetting, **options: Any) -> Bench:
    bench = make_bench(protocol='telegram1', plc=plc, **options)
    options = [option.replace('telegram1', 'modbus_tcp') for option in bench.options]
    bench.options = (*options, '--control-method', 'telegram1')
    return bench


@pytest.fixture
def bench(make_bench: MakeBench, monkeypatch: pytest.MonkeyPatch) -> Bench:
    # this PLC has no other work
    monkeypatch.setattr(session, 'Bus', lambda link, most_requests: Bus(link))
    return behind_plc(make_bench, QUICK)


def test_settings_are_listed_read_set_dumped_and_loaded(
    nfo: Nfo, bench: Bench, tmp_path: Path
) -> None:
    done = nfo('list', '--json')
    assert done.status == 0, done.err
    listed = json.loads(done.out)
    assert listed.keys() == OVER_MODBUS
    assert listed['control.accel']['value'] == bench.value('control.accel')
    assert 'kW' in nfo('get', 'motor.p_nom').out
    done = nfo('set', 'control.accel=7.5', 'control.st_mode=Release')
    assert done.status == 0, done.err
    assert (bench.value('control.accel'), bench.value('control.st_mode')) == (7.5, 'Release')
    path = tmp_path / 'dump.yaml'
    done = nfo('dump', path)
    assert done.status == 0, done.err
    bench.set('control.accel', 1.0)
    done = nfo('load', path)
    assert done.status == 0 and 'one parameter' not in done.out, done.err
    assert bench.value('control.accel') == 7.5
    assert nfo('diff', path).status == 0


def test_by_the_file_of_a_scan_a_driver_reaches_what_the_scan_has_reached(
    nfo: Nfo, bench: Bench
) -> None:
    done = nfo('scan', '--addresses', '1-2', '--params', '-', '--retries', 1)
    assert done.status == 0, done.err
    written = yaml.safe_load(done.out)
    for address in (1, 2):
        given = written[f'/**/drive_{address}']['ros__parameters']
        assert given == {
            'address': address, 'model': 'sinus_g2', 'control_method': 'telegram1'
        }
        DriveSettings(**given).require_line(PROTOCOLS['modbus_tcp'])


def test_a_fault_is_named_and_the_error_log_is_shown(nfo: Nfo, bench: Bench) -> None:
    with bench.simulator.lock:
        bench.drive().trip(3)
    done = nfo('errors')
    assert done.status == 0 and 'Temp Hi' in done.out, done.err
    assert nfo('get', 'profidrive.fault_number').out.split()[-1] == '3'


def test_trips_of_a_sinus_h_are_shown_by_name(
    make_bench: MakeBench, nfo: Nfo, bench: Bench
) -> None:
    other = behind_plc(make_bench, QUICK, model='sinus_h')
    with other.simulator.lock:
        for code in (11, 12):
            other.drive().trip(code)
            other.drive().faults.acknowledge()
    done = nfo(*other.options, 'errors')
    assert [line.split()[2] for line in done.out.splitlines()] == ['Overvoltage', 'Overcurrent']
    done = nfo(*other.options, 'get', 'profidrive.telegram', 'profidrive.manufacturer')
    assert 'Standard telegram' in done.out and '849' in done.out
    assert 'no settings are known' in nfo(*other.options, 'list').err


def test_all_that_a_sinus_h_tells_is_shown_by_name(
    make_bench: MakeBench, nfo: Nfo, bench: Bench
) -> None:
    # the vendor's telegram [M3 §7.2], and every parameter of the module that is read [M3 §8]
    longer = dataclasses.replace(QUICK, longer_telegram=True)
    vendor = {'com.opt_para_13': 'Vendor Specific Telegram'}
    other = behind_plc(make_bench, longer, model='sinus_h', settings=vendor)
    with other.simulator.lock:
        other.drive().trip(11)
    numbers = (922, 944, 947, 953, 964, 965, 967, 968)
    model = load_family('sinus_h', 'telegram1')
    names = [key for key, row in model.items() if row.at('telegram1').index in numbers]
    assert len(names) == 12
    done = nfo(*other.options, 'get', '--json', 'telegram.alarm_info', 'telegram.torque', *names)
    assert done.status == 0, done.err
    shown = {name: read['value'] for name, read in json.loads(done.out).items()}
    assert shown.keys() == {'telegram.alarm_info', 'telegram.torque', *names}
    assert shown['telegram.alarm_info'] == 1
    assert (shown['profidrive.fault_number'], shown['profidrive.profile']) == (11, 0x0328)


def test_layout_1_says_what_it_lacks(make_bench: MakeBench, nfo: Nfo, bench: Bench) -> None:
    other = behind_plc(make_bench, PlcSetting())
    done = nfo(*other.options, 'get', 'control.accel')
    assert done.status == 1 and 'layout 1, which has no mailbox' in done.err
    assert nfo(*other.options, 'list').out == ''


def test_no_word_is_written_to_the_drive(nfo: Nfo, bench: Bench) -> None:
    nfo('set', 'control.accel=7.5')
    with bench.simulator.lock:
        assert bench.simulator.plc is not None
        assert bench.simulator.plc.channels[1].block.ros_life == 0


@pytest.mark.parametrize('layout', [1, 2])
def test_info_of_a_sinus_h_has_what_its_module_tells(make_bench: MakeBench, layout: int) -> None:
    # PNU 964 [M3 §8], by the mailbox alone
    bench = behind_plc(make_bench, PlcSetting(layout=layout), model='sinus_h', serial_numbers=[])
    done = bench.run('info')
    assert done.status == 0, done.err
    facts = dict(line.split(maxsplit=1) for line in done.out.splitlines())
    told = 'manufacturer 849, PROFINET module, version 1.2, of 25 December, 2015'
    assert facts['family'] == 'Sinus H' and facts['module'] == (told if layout == 2 else '-')


def test_an_end_whose_plc_is_gone_says_what_stops_the_motor(bench: Bench) -> None:
    with bench.running() as process:
        bench.simulator.inject('line-dead', 600)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert 'ending WITHOUT a stop that the PLC has confirmed: the program of this driver' in err
    assert 'may still run' not in err
