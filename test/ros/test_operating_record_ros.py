# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The operating record: a run, a stop, a fault, a restart and a shift, on the topic and on disk."""

from __future__ import annotations

import contextlib
import csv
import io
import os
from pathlib import Path
import subprocess
import sys
import time

from bench import Bench, Client, wait_until
from nfo_sinus_msgs.msg import OperatingFigures, OperatingRecord
from rclpy.qos import DurabilityPolicy

from nfo_sinus_driver.node.ros.qos import LATCHED

_TOPIC = '/nfo_sinus/operating_record'
_COMMAND = 'from nfo_sinus_driver.commands import nfo_sinus; exit(nfo_sinus())'


def listening(bench: Bench) -> Client:
    client = bench.client().connected()
    client.listen('operating_record', OperatingRecord, _TOPIC, LATCHED)
    return client


def stops(figures: OperatingFigures) -> dict[str, int]:
    return {stop.name: stop.count for stop in figures.stops}


def faults(figures: OperatingFigures) -> dict[int, int]:
    return {fault.code: fault.count for fault in figures.faults}


def history(bench: Bench, *options: str) -> str:
    """Return what the command says of the state folder of the driver."""
    environment = {**os.environ, 'XDG_STATE_HOME': str(bench.folder / 'state')}
    done = subprocess.run(
        [sys.executable, '-c', _COMMAND, 'history', *options],
        env=environment, capture_output=True, text=True, check=True,
    )
    return done.stdout


def kept(bench: Bench) -> Path:
    (path,) = (bench.folder / 'state').rglob('operating_record/*.json')
    return path


def test_what_a_drive_has_done_outlives_the_driver(bench: Bench) -> None:
    simulator = bench.simulator(*bench.drives.ramps(1))
    driver = bench.driver()
    client = listening(bench)
    first = client.wait_for('operating_record', lambda m: True, 'a record')
    assert first.stored and first.total.starts == 0
    with client.run_at(20.0):
        time.sleep(1.0)
    assert client.call('stop').success
    client.wait_for('operating_record', lambda m: stops(m.total) == {'STOP': 1}, 'the stop')
    with client.run_at(20.0):
        time.sleep(0.5)
        simulator.inject('fault', bench.drives.overload.code)
        wait_until(lambda: not simulator.state()['driven'], 'it has stopped')
    wanted = {'STOP': 1, 'FAULT': 1}
    record = client.wait_for('operating_record', lambda m: stops(m.total) == wanted, 'the fault')
    assert record.total.starts == 2
    assert faults(record.total) == {bench.drives.overload.code: 1}
    assert abs(record.total.faults[0].last.sec - time.time()) < 600
    assert 0 < record.total.running_time < record.total.powered_time < 1.0
    assert record.total.since == first.total.since

    # the driver restarts while the fault is active, and counts it no more
    driver.end()
    assert 'Traceback' not in driver.text
    simulator_serial = record.serial_number
    driver = bench.driver()
    client = listening(bench)
    again = client.wait_for('operating_record', lambda m: m.total.since.sec > 0, 'a record')
    assert (again.serial_number, again.total.since) == (simulator_serial, record.total.since)
    assert stops(again.total) == wanted and again.total.starts == 2
    assert faults(again.total) == {bench.drives.overload.code: 1}
    assert again.total.powered_time >= record.total.powered_time
    answer = client.call('begin_shift')
    assert answer.success and 'starts: 2, stops: 2, faults: 1' in answer.message
    shift = client.wait_for('operating_record', lambda m: m.shift.starts == 0, 'a new shift')
    assert stops(shift.shift) == {} and shift.total.starts == 2
    assert shift.shift.since.sec >= shift.total.since.sec
    assert client.call('fault_ack').success
    with client.run_at(10.0):
        time.sleep(0.5)
    driver.end()
    assert '/nfo_sinus/begin_shift called by' in driver.text

    told = list(csv.DictReader(io.StringIO(history(bench, '--csv'))))
    found = {(row['period'], row['figure'], row['detail']): row['value'] for row in told}
    assert (found['total', 'starts', ''], found['shift', 'starts', '']) == ('3', '1')
    assert found['total', 'stops', 'STOP'] == found['total', 'stops', 'FAULT'] == '1'
    assert sum(int(value) for key, value in found.items() if key[:2] == ('shift', 'stops')) == 1
    code = str(bench.drives.overload.code)
    assert any(key[:2] == ('total', 'faults') and key[2].startswith(code) for key in found)
    text = history(bench)
    assert told[0]['drive'] in text and 'starts' in text


def test_a_late_subscriber_gets_it_and_it_is_published_at_a_stop(bench: Bench) -> None:
    bench.simulator()
    bench.driver()
    client = listening(bench)
    client.wait_for('operating_record', lambda m: m.stored, 'a record')
    late = bench.client('/nfo_sinus')
    late.listen('operating_record', OperatingRecord, _TOPIC, LATCHED)
    late.wait_for('operating_record', lambda m: m.stored, 'the same record')
    (info,) = client.node.get_publishers_info_by_topic(_TOPIC)
    assert info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_a_damaged_file_is_put_aside_and_the_motor_runs(bench: Bench) -> None:
    bench.simulator()
    driver = bench.driver()
    listening(bench).wait_for('operating_record', lambda m: m.stored, 'a record')
    driver.end()
    kept(bench).write_text('{"half')
    driver = bench.driver()
    client = listening(bench)
    client.wait_for('operating_record', lambda m: m.stored, 'a new record')
    assert 'a new operating record begins' in driver.text
    with client.run_at(10.0):
        pass
    assert [path.read_text() for path in kept(bench).parent.glob('*.damaged-*')] == ['{"half']


def test_a_folder_that_cannot_be_written_is_one_warning(bench: Bench) -> None:
    (bench.folder / 'state').mkdir(exist_ok=True)
    (bench.folder / 'state' / 'nfo_sinus_driver').write_text('no folder')
    bench.simulator()
    driver = bench.driver('-p', 'drive_timeout:=0.0')
    client = listening(bench)
    wait_until(lambda: 'is kept in memory alone' in driver.text, 'the warning')
    with client.run_at(10.0):
        time.sleep(0.5)
    assert client.call('stop').success
    record = client.wait_for('operating_record', lambda m: stops(m.total), 'the stop')
    assert not record.stored and record.total.starts == 1
    assert client.call('begin_shift').success
    assert driver.text.count('is kept in memory alone') == 1


def test_two_drivers_never_write_one_file(bench: Bench, tmp_path: Path) -> None:
    bench.simulator()
    driver = bench.driver()
    client = listening(bench)
    client.wait_for('operating_record', lambda m: m.stored, 'a record')
    driver.end()
    with contextlib.ExitStack() as stack:
        # another program has the file
        holder = stack.enter_context(
            subprocess.Popen(
                [
                    sys.executable, '-c',
                    'import sys, json; from pathlib import Path;'
                    'from nfo_sinus_driver.operating_record.files import RecordFile;'
                    'p = Path(sys.argv[1]);'
                    'f = RecordFile(json.loads(p.read_text())["drive"]); f.load();'
                    'print("has it", flush=True); input()',
                    str(kept(bench)),
                ],
                env={**os.environ, 'XDG_STATE_HOME': str(bench.folder / 'state')},
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            )
        )
        assert holder.stdout is not None and holder.stdout.readline() == 'has it\n'
        before = kept(bench).read_bytes()
        driver = bench.driver()
        wait_until(lambda: 'belongs to another program that runs' in driver.text, 'the warning')
        client = listening(bench)
        record = client.wait_for('operating_record', lambda m: not m.stored, 'one in memory')
        assert not record.stored
        driver.end()
        assert kept(bench).read_bytes() == before
        holder.kill()


def test_what_is_due_is_a_warning_in_diagnostics_and_once_in_the_log(bench: Bench) -> None:
    bench.simulator()
    driver = bench.driver(
        '-p', "maintenance:=['contactor=starts:1', 'fan=powered_time:80000']"
    )
    client = listening(bench)
    with client.run_at(10.0):
        pass
    due = 'maintenance is due: contactor 1 of 1 starts'
    wait_until(lambda: due in driver.text, 'the log')

    def diagnosed() -> str:
        for message in reversed(client.messages['diagnostics']):
            for status in message.status:
                if status.name == 'nfo_sinus: drive' and 'maintenance is due' in status.message:
                    return {pair.key: pair.value for pair in status.values}['maintenance']
        return ''

    wait_until(diagnosed, 'diagnostics')
    assert diagnosed() == 'contactor 1 of 1 starts, fan 0 of 80,000 h powered'
    time.sleep(2.5)
    assert driver.text.count(due) == 1
    refused = client.set_parameters(maintenance=['fan'])
    assert not refused.successful and 'NAME=FIGURE:LIMIT' in refused.reason
    assert client.set_parameters(maintenance=['contactor=starts:5']).successful
    wait_until(
        lambda: 'maintenance is due' not in client.messages['diagnostics'][-1].status[-1].message,
        'no more',
    )
