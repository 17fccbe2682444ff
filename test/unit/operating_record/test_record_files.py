# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The file of an operating record: one writer, whole or not at all, a damaged one put aside."""

from __future__ import annotations

import os
from pathlib import Path
import signal
import stat
import subprocess
import sys

import pytest

from nfo_sinus_driver.operating_record.figures import Record, decoded
from nfo_sinus_driver.operating_record.files import DamagedRecord, RecordFile, records

DRIVE = 'sinus_g2 NFO1001'
#: A program that keeps a record, again and again, until it is killed.
KEEPER = f"""
from nfo_sinus_driver.operating_record.figures import Record
from nfo_sinus_driver.operating_record.files import RecordFile
file = RecordFile({DRIVE!r})
record = file.load() or Record.begun({DRIVE!r}, 'NFO1001', 1.0)
file.save(record.encoded())
print('kept', flush=True)
while True:
    record.total.starts += 1
    record.total.stops['STOP' * (record.total.starts % 50 + 1)] = record.total.starts
    file.save(record.encoded())
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder, which is not there yet."""
    monkeypatch.setenv('XDG_STATE_HOME', str(tmp_path))
    return tmp_path / 'nfo_sinus_driver' / 'operating_record'


def record(starts: int = 0) -> Record:
    made = Record.begun(DRIVE, 'NFO1001', 1.0)
    made.total.starts = starts
    return made


def the_file(place: Path) -> Path:
    (path,) = place.glob('*.json')
    return path


def keep(starts: int) -> None:
    file = RecordFile(DRIVE)
    file.load()
    file.save(record(starts).encoded())
    file.close()


def test_what_is_kept_is_read_again(place: Path) -> None:
    file = RecordFile(DRIVE)
    assert file.load() is None
    assert list(records()) == []
    file.save(record(1).encoded())
    file.save(record(2).encoded())
    file.close()
    assert RecordFile(DRIVE).load() == record(2)
    assert list(records()) == [record(2)]
    assert the_file(place).name.startswith('sinus_g2_NFO1001-')
    assert stat.S_IMODE(the_file(place).stat().st_mode) == 0o600
    assert [path.name for path in place.iterdir()] == [the_file(place).name]


def test_a_second_program_neither_reads_nor_writes_it(place: Path) -> None:
    first, second = RecordFile(DRIVE), RecordFile(DRIVE)
    first.load()
    for _ in range(2):
        with pytest.raises(OSError, match='belongs to another program'):
            second.load()
        with pytest.raises(OSError, match='is not taken'):
            second.save(record(9).encoded())
        first.save(record(1).encoded())
    assert list(records()) == [record(1)]
    first.close()
    assert second.load() == record(1)


@pytest.mark.parametrize('content', ['{', '\x00' * 50, '{"drive": "another"}', 'another'])
def test_a_damaged_file_is_put_aside_and_a_new_one_begins(place: Path, content: str) -> None:
    keep(5)
    if content == 'another':
        content = Record.begun('another', '', 0.0).encoded().decode()
    the_file(place).write_text(content)
    file = RecordFile(DRIVE)
    with pytest.raises(DamagedRecord, match='is damaged'):
        file.load()
    (aside,) = place.glob('*.damaged-*')
    assert aside.read_text() == content
    file.save(record(1).encoded())
    file.close()
    assert RecordFile(DRIVE).load() == record(1)


@pytest.mark.parametrize('moment', range(12))
def test_a_kill_at_any_moment_leaves_a_whole_record(place: Path, moment: int) -> None:
    keep(7)
    with subprocess.Popen(
        [sys.executable, '-c', KEEPER], stdout=subprocess.PIPE, text=True
    ) as keeper:
        assert keeper.stdout is not None and keeper.stdout.readline() == 'kept\n'
        for _ in range(20 * moment):
            # meanwhile a reader sees whole records alone
            assert decoded(the_file(place).read_bytes()).total.starts >= 7
        os.kill(keeper.pid, signal.SIGKILL)
    found = RecordFile(DRIVE).load()
    assert found is not None and found.total.starts >= 7


@pytest.mark.parametrize('fails', ['fsync', 'write', 'open'])
def test_a_disk_that_takes_nothing_leaves_what_was_there(
    place: Path, monkeypatch: pytest.MonkeyPatch, fails: str
) -> None:
    file = RecordFile(DRIVE)
    file.load()
    file.save(record(3).encoded())

    def full(*_: object) -> int:
        raise OSError(28, 'No space left on device')

    with monkeypatch.context() as patch:
        patch.setattr(os, fails, full)
        with pytest.raises(OSError, match='No space left'):
            file.save(record(4).encoded())
    assert list(records()) == [record(3)]
    assert [path.name for path in place.iterdir()] == [the_file(place).name]
    file.save(record(5).encoded())
    assert list(records()) == [record(5)]


def test_a_disk_that_takes_a_part_at_a_time(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = os.write
    monkeypatch.setattr(os, 'write', lambda descriptor, data: write(descriptor, data[:7]))
    keep(3)
    assert list(records()) == [record(3)]


def test_a_file_that_is_no_record_is_told_with_the_others(place: Path) -> None:
    keep(1)
    (place / 'zz.json').write_text('nothing')
    first, second = records()
    assert first == record(1)
    assert isinstance(second, str) and 'zz.json cannot be read' in second
