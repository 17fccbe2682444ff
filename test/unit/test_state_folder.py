# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is to be put back in a drive, in a file that outlives the program."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import stat
import subprocess
import sys
import threading

import pytest

from nfo_sinus_driver.state_folder import StateFolder

DRIVE = 'sinus_g2 /dev/ttyUSB0 1'
BORROWED = {'serial.sio_tot': (0.0, 2.0), 'serial.auto_stop': (False, True), 'a.b': ('Ramp', 'No')}
#: What a program does that is killed, or goes on, while it has a drive.
KEEPER = f"""
from nfo_sinus_driver.state_folder import StateFolder
folder = StateFolder('')
folder.write({DRIVE!r}, {{'serial.sio_tot': (0.0, 2.0)}}).result()
print('written', flush=True)
input()
"""


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder, which is not there yet."""
    monkeypatch.setenv('XDG_STATE_HOME', str(tmp_path))
    return tmp_path / 'nfo_sinus_driver'


def at_once(work: Callable[[], None]) -> None:
    work()


def folder() -> StateFolder:
    """Return one whose program has its drives as long as it is used."""
    return StateFolder('', at_once)


def the_file(files: Path) -> Path:
    """Return the only file, with no other beside it."""
    (path,) = files.iterdir()
    return path


def test_what_is_put_back_is_forgotten_and_nothing_is_left(files: Path) -> None:
    kept = folder()
    assert kept.read(DRIVE).result() == {}
    kept.write(DRIVE, {}).result()
    assert not files.exists()
    kept.write(DRIVE, BORROWED).result()
    # only its owner reads it
    assert stat.S_IMODE(the_file(files).stat().st_mode) == 0o600
    assert stat.S_IMODE(files.stat().st_mode) == 0o700
    assert kept.read(DRIVE).result() == BORROWED
    kept.write(DRIVE, {'a.b': ('Ramp', 'No')}).result()
    kept.write('another', BORROWED).result()
    assert kept.read(DRIVE).result() == {'a.b': ('Ramp', 'No')}
    for drive in (DRIVE, 'another'):
        kept.write(drive, {}).result()
    assert list(files.iterdir()) == []


def test_what_a_program_has_is_its_own_until_it_is_killed(files: Path) -> None:
    with subprocess.Popen(
        [sys.executable, '-c', KEEPER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as keeper:
        assert keeper.stdout is not None
        assert keeper.stdout.readline() == 'written\n'
        before = the_file(files).read_bytes()
        beside = folder()
        assert beside.read(DRIVE).result() == {}
        with pytest.raises(OSError, match='belongs to another program'):
            beside.write(DRIVE, BORROWED).result()
        beside.write(DRIVE, {}).result()
        assert the_file(files).read_bytes() == before
        keeper.kill()
    assert folder().read(DRIVE).result() == {'serial.sio_tot': (0.0, 2.0)}


def test_numbers_and_switches_come_back_as_they_were(files: Path) -> None:
    kept = folder()
    kept.write(DRIVE, BORROWED).result()
    # the way through the file
    kept._hold(DRIVE, None)
    found = folder().read(DRIVE).result()
    assert found == BORROWED
    assert all(
        [type(value) for value in values] == [type(value) for value in BORROWED[key]]
        for key, values in found.items()
    )


@pytest.mark.parametrize(
    'content',
    [
        '', 'null', '[]', '{', '{"drive": "another", "borrowed": {}}', f'{{"drive": "{DRIVE}"}}',
        f'{{"drive": "{DRIVE}", "borrowed": {{"a.b": 1}}}}',
        f'{{"drive": "{DRIVE}", "borrowed": {{"a.b": [1, [2]]}}}}',
        f'{{"drive": "{DRIVE}", "borrowed": {{"a.b": [1, null]}}}}', '\x00' * 100,
        f'{{"drive": "{DRIVE}", "borrowed": {{"a.b": [NaN, 1]}}}}',
        f'{{"drive": "{DRIVE}", "borrowed": {{"a.b": [1, 1e999]}}}}',
        '9' * 5000, '[' * 65536, '\ufeff' * 9, '\udc80',
    ],
)
def test_a_damaged_file_is_said_and_replaced(files: Path, content: str) -> None:
    kept = folder()
    kept.write(DRIVE, BORROWED).result()
    kept._hold(DRIVE, None)
    the_file(files).write_text(content, encoding='utf-8', errors='surrogateescape')
    kept = folder()
    with pytest.raises(OSError, match='is damaged'):
        kept.read(DRIVE).result()
    kept.write(DRIVE, BORROWED).result()
    assert kept.read(DRIVE).result() == BORROWED


@pytest.mark.parametrize('what', ['link', 'dangling link', 'pipe', 'folder'])
def test_nothing_goes_through_what_is_no_file(files: Path, tmp_path: Path, what: str) -> None:
    kept = folder()
    kept.write(DRIVE, BORROWED).result()
    path = the_file(files)
    kept.write(DRIVE, {}).result()
    target = tmp_path / 'target'
    if what == 'pipe':
        os.mkfifo(path)
    elif what == 'folder':
        path.mkdir()
    else:
        path.symlink_to(target)
    if what == 'link':
        target.write_text('mine')
    for future in (folder().read(DRIVE), folder().write(DRIVE, BORROWED)):
        assert isinstance(future.exception(), OSError) or future.result() == {}
    if what == 'link':
        assert target.read_text() == 'mine'
    assert path.is_symlink() or not path.is_file()
    assert what == 'link' or not target.exists()


def test_a_disk_that_takes_nothing_leaves_what_was_there(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = folder()
    kept.write(DRIVE, BORROWED).result()
    before = the_file(files).read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(os, 'fsync', full)
    with pytest.raises(OSError, match='No space left'):
        kept.write(DRIVE, {'a.b': (1, 2)}).result()
    assert the_file(files).read_bytes() == before
    assert kept.read(DRIVE).result() == BORROWED


def test_without_a_folder_it_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv('XDG_STATE_HOME', 'not/absolute')
    monkeypatch.delenv('HOME', raising=False)
    for future in (folder().read(DRIVE), folder().write(DRIVE, BORROWED)):
        with pytest.raises(OSError, match='neither XDG_STATE_HOME nor HOME'):
            future.result()
    # in place of the folder there is a file
    (tmp_path / '.local').write_text('')
    monkeypatch.setenv('HOME', str(tmp_path))
    with pytest.raises(OSError, match=str(tmp_path)):
        folder().write(DRIVE, BORROWED).result()
    (tmp_path / '.local').unlink()
    folder().write(DRIVE, BORROWED).result()
    assert the_file(tmp_path / '.local' / 'state' / 'nfo_sinus_driver').is_file()


def test_no_caller_waits_for_the_disk(files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = threading.Event()
    sync = os.fsync

    def slow(descriptor: int) -> None:
        answers.wait(60.0)
        sync(descriptor)

    monkeypatch.setattr(os, 'fsync', slow)
    kept = StateFolder('')
    written, read = kept.write(DRIVE, BORROWED), kept.read(DRIVE)
    assert not written.done() and not read.done()
    answers.set()
    assert written.result(60.0) is None
    # in whatever order the two came to their turn
    assert read.result(60.0) in ({}, BORROWED)
