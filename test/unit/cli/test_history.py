# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``history``: what drives have done, for a person and for a script, without a line."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

from nfo_sinus_driver.cli.main import main
from nfo_sinus_driver.operating_record.figures import MJ_OF_KWH, NS_OF_HOUR, Record
from nfo_sinus_driver.operating_record.files import RecordFile, folder


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv('XDG_STATE_HOME', str(tmp_path))
    monkeypatch.setenv('TZ', 'UTC')
    return folder()


def keep(record: Record) -> None:
    file = RecordFile(record.drive)
    file.load()
    file.save(record.encoded())
    file.close()


def two_drives() -> None:
    record = Record.begun('sinus_g2 NFO1001', 'NFO1001', 1_700_000_000.0)
    total = record.total
    total.powered, total.running, total.starts = 1234 * NS_OF_HOUR, 617 * NS_OF_HOUR, 12
    total.stops['FAULT'] = 2
    total.add_fault(5, 'Overload', 1_700_003_600.0)
    total.see('torque', 97.25)
    total.add_energy(int(12.5 * MJ_OF_KWH))
    record.counters['total_energy'] = 4000.0
    record.begin_shift(1_700_007_200.0)
    record.total.starts += 1
    record.shift.starts += 1
    keep(record)
    keep(Record.begun('sinus_optimal /dev/ttyUSB0 2', '', 1_700_000_000.0))


def rows(text: str) -> dict[tuple[str, ...], dict[str, str]]:
    found = csv.DictReader(io.StringIO(text))
    return {
        (row['drive'], row['period'], row['figure'], row['detail']): row for row in found
    }


def test_a_person_reads_total_and_shift(capsys: pytest.CaptureFixture[str]) -> None:
    two_drives()
    assert main(['history']) == 0
    told, said = capsys.readouterr()
    assert said == ''
    lines = [' '.join(line.split()) for line in told.splitlines()]
    for line in (
        'sinus_g2 NFO1001',
        'powered time 1,234.00 h 0.00 h',
        'starts 13 1',
        'stops FAULT 2 -',
        'energy by the counter of the drive 12.50 kWh 0.00 kWh',
        'highest torque 97.2 % -',
        'highest motor temperature - -',
        'sinus_optimal /dev/ttyUSB0 2 (by its place, for no serial number can be read)',
    ):
        assert line in lines, told
    assert any(line.startswith('faults 5 Overload 1 - last 2023-11-14 ') for line in lines), told


def test_a_script_reads_csv(capsys: pytest.CaptureFixture[str]) -> None:
    two_drives()
    assert main(['history', '--csv']) == 0
    found = rows(capsys.readouterr().out)
    g2 = 'sinus_g2 NFO1001'
    powered = found[g2, 'total', 'powered_time', '']
    assert (powered['value'], powered['unit'], powered['serial_number']) == ('1234', 'h', 'NFO1001')
    assert powered['since'].startswith('2023-11-1')
    fault = found[g2, 'total', 'faults', '5 Overload']
    assert (fault['value'], fault['last'][:7]) == ('1', '2023-11')
    assert found[g2, 'shift', 'starts', '']['value'] == '1'
    assert found[g2, 'total', 'highest_motor_temperature', '']['value'] == ''
    assert ('sinus_optimal /dev/ttyUSB0 2', 'shift', 'energy', '') in found


def test_without_a_record_it_says_where_it_looked(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['history']) == 1
    said = capsys.readouterr().err
    assert str(place) in said and 'XDG_STATE_HOME' in said


def test_one_that_is_damaged_is_told_beside_the_others(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    two_drives()
    (place / 'broken.json').write_text('{')
    assert main(['history']) == 1
    told, said = capsys.readouterr()
    assert 'sinus_g2 NFO1001' in told and 'broken.json cannot be read' in said


def test_without_a_place_for_a_folder_it_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv('XDG_STATE_HOME', '')
    monkeypatch.setenv('HOME', '')
    assert main(['history', '--csv']) == 1
    assert 'neither XDG_STATE_HOME nor HOME' in capsys.readouterr().err
