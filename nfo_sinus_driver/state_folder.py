# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Files that outlive the program, each with one writer; and what is put back in a drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
import contextlib
import fcntl
import hashlib
import json
import math
import os
from pathlib import Path
import re
import stat
import threading
from typing import Any, TypeVar

_T = TypeVar('_T')
#: What is found and what is set, by the key of a setting; both are what JSON has.
_Borrowed = Mapping[str, tuple[Any, Any]]

_FOLDER = 'nfo_sinus_driver'
#: No such file is longer, bytes.
_LONGEST = 65536
#: A link is never followed, and nothing that is no file keeps the program waiting.
_OPEN = os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
_CREATE = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC


def in_background(work: Callable[[], None]) -> None:
    """Run what may wait for a disk on a thread of its own, which keeps no process from ending."""
    threading.Thread(target=work, name='state', daemon=True).start()


class StateFolder:
    """
    Files in ``$XDG_STATE_HOME/nfo_sinus_driver``, or ``~/.local/state/nfo_sinus_driver``.

    A file is locked by the program that has written or read it, as long as that lives: what a
    program that runs has changed, no other one puts back. Futures fail with an ``OSError``.

    :ivar line: names the line, where a drive is known by its address alone.
    :param run: runs what touches the disk.
    """

    def __init__(
        self, line: str, run: Callable[[Callable[[], None]], None] = in_background
    ) -> None:
        self.line = line
        self._run = run
        #: One access after the other.
        self._turn = threading.Lock()
        #: The files that this program has locked, by drive.
        self._locked: dict[str, int] = {}

    def read(self, drive: str) -> Future[_Borrowed]:
        """Return what is remembered of a drive; nothing where another program commands it."""
        return self._do(lambda: self._read(drive))

    def write(self, drive: str, borrowed: _Borrowed) -> Future[None]:
        """Remember this of a drive from now on, and nothing else; on the disk once it is done."""
        return self._do(lambda: self._write(drive, borrowed))

    def _do(self, work: Callable[[], _T]) -> Future[_T]:
        future: Future[_T] = Future()

        def do() -> None:
            try:
                with self._turn:
                    result = work()
            except BaseException as error:
                future.set_exception(error)
            else:
                future.set_result(result)

        self._run(do)
        return future

    def _read(self, drive: str) -> _Borrowed:
        path = _path(drive)
        descriptor = self._take(drive, path)
        if descriptor is None or not _is(path, descriptor):
            return {}
        return _parsed(os.pread(descriptor, _LONGEST, 0), drive, path)

    def _write(self, drive: str, borrowed: _Borrowed) -> None:
        path = _path(drive)
        taken = self._take(drive, path) is not None
        if not borrowed:
            if taken:
                path.unlink(missing_ok=True)
                self._hold(drive, None)
            return
        if not taken and os.path.lexists(path):
            raise OSError(f'{path} belongs to another program that runs')
        content = json.dumps({'drive': drive, 'borrowed': borrowed}).encode()
        self._hold(drive, _replace(path, content))
        _sync(path.parent)

    def _take(self, drive: str, path: Path) -> int | None:
        """Return the file of a drive, locked; ``None``: none is there, or it is another's."""
        if drive not in self._locked:
            descriptor = _open(path)
            if descriptor is None:
                return None
            self._hold(drive, descriptor)
        return self._locked[drive]

    def _hold(self, drive: str, descriptor: int | None) -> None:
        """Keep a file locked from now on in place of the one before; ``None``: no file."""
        before = self._locked.pop(drive, None)
        if before is not None:
            os.close(before)
        if descriptor is not None:
            self._locked[drive] = descriptor


def state_path() -> Path:
    """Return the folder for what this package keeps (OSError: there is no place for it)."""
    get = os.environ.get
    for state in (get('XDG_STATE_HOME', ''), f'{get("HOME", "")}/.local/state'):
        if os.path.isabs(state) and state != '/.local/state':
            return Path(state, _FOLDER)
    raise OSError('neither XDG_STATE_HOME nor HOME is the path of a folder')


def readable_name(drive: str) -> str:
    """Return the name of a file for a drive, which no other drive has."""
    digest = hashlib.sha256(drive.encode()).hexdigest()[:16]
    readable = re.sub('[^A-Za-z0-9]+', '_', drive)[:60].strip('_')
    return f'{readable}-{digest}'


class OwnFile:
    """
    A file that belongs to one program as long as that has it; used by one thread at a time.

    :raises OSError: by each method; the file is what it was then.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._descriptor: int | None = None

    def take(self) -> bytes:
        """Return its content, of a new one nothing (OSError: another program has it, too)."""
        if self._descriptor is None:
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            with contextlib.suppress(FileExistsError):
                os.close(os.open(self.path, _CREATE, 0o600))
            self._descriptor = _open(self.path)
        if self._descriptor is None:
            raise OSError(f'{self.path} belongs to another program that runs')
        size = os.fstat(self._descriptor).st_size
        return os.pread(self._descriptor, size, 0)

    def replace(self, data: bytes) -> None:
        """Replace its content, as a whole; on the disk once it is done."""
        if self._descriptor is None:
            raise OSError(f'{self.path} is not taken')
        before, self._descriptor = self._descriptor, _replace(self.path, data)
        os.close(before)
        _sync(self.path.parent)

    def put_aside(self, path: Path) -> None:
        """Give what is there another name, and begin with an empty file."""
        self.path.rename(path)
        self.close()
        self.take()

    def close(self) -> None:
        """Leave it to other programs."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _path(drive: str) -> Path:
    """Return the file of a drive (OSError: there is no folder for it)."""
    return state_path() / f'{readable_name(drive)}.json'


def _open(path: Path) -> int | None:
    """Open a file, and lock it; ``None``: none is there, or it is another program's."""
    try:
        descriptor = os.open(path, _OPEN)
    except FileNotFoundError:
        return None
    is_file = stat.S_ISREG(os.fstat(descriptor).st_mode)
    # another program may just have replaced or removed it
    if not (is_file and _lock(descriptor) and _is(path, descriptor)):
        os.close(descriptor)
        return None
    return descriptor


def _replace(path: Path, content: bytes) -> int:
    """Write a file, all of it or nothing; return it open and locked."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    new = path.with_name(f'{path.name}.{os.urandom(8).hex()}')
    descriptor = os.open(new, _CREATE, 0o600)
    try:
        _lock(descriptor)
        _write_all(descriptor, content)
        os.fsync(descriptor)
        new.rename(path)
    except BaseException:
        os.close(descriptor)
        with contextlib.suppress(OSError):
            new.unlink()
        raise
    return descriptor


def _write_all(descriptor: int, content: bytes) -> None:
    """Write all of it: a disk that is nearly full takes a part without an error."""
    while content:
        content = content[os.write(descriptor, content):]


def _lock(descriptor: int) -> bool:
    """Lock a file until it is closed or this process ends; false if another one has it."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _is(path: Path, descriptor: int) -> bool:
    """Return whether an open file is the one that has a name now."""
    try:
        return os.path.samestat(os.stat(path, follow_symlinks=False), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _parsed(data: bytes, drive: str, path: Path) -> _Borrowed:
    """Return what stands in a file, each value checked (OSError: it is damaged)."""
    try:
        content = json.loads(data)
        if content['drive'] != drive:
            raise ValueError(content['drive'])
        borrowed = {
            str(key): (_value(found), _value(ours))
            for key, (found, ours) in content['borrowed'].items()
        }
    except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as error:
        raise OSError(f'{path} is damaged: {error!r}') from error
    return borrowed


def _value(value: object) -> object:
    is_finite = not isinstance(value, float) or math.isfinite(value)
    if not isinstance(value, (bool, int, float, str)) or not is_finite:
        raise ValueError(value)
    return value


def _sync(folder: Path) -> None:
    """Have the names in a folder outlive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
