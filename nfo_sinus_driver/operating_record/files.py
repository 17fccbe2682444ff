# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The files of operating records: one for each drive, with one writer, replaced as a whole."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import time

from nfo_sinus_driver.operating_record.figures import Record, decoded
from nfo_sinus_driver.state_folder import OwnFile, readable_name, state_path

_END = '.json'


class DamagedRecord(OSError):
    """A file that is no record was put aside; the message says where."""


def folder() -> Path:
    """Return the folder of the files (OSError: there is no place for it)."""
    return state_path() / 'operating_record'


class RecordFile:
    """
    The file of one drive; used by one thread at a time.

    Another program can have it, even in another ROS domain: then nothing is read or written.
    """

    def __init__(self, drive: str) -> None:
        self._file = OwnFile(folder() / f'{readable_name(drive)}{_END}')
        self._drive = drive

    def load(self) -> Record | None:
        """
        Take the file, and return what is in it; ``None``: it is new.

        :raises DamagedRecord: it was damaged; it is new now.
        :raises OSError: it cannot be read, or another program has it.
        """
        data = self._file.take()
        if not data:
            return None
        try:
            record = decoded(data)
            if record.drive != self._drive:
                raise ValueError(f'it is of {record.drive}')
        except ValueError as error:
            path = self._file.path
            aside = path.with_name(f'{path.name}.damaged-{time.strftime("%Y-%m-%d_%H-%M-%S")}')
            self._file.put_aside(aside)
            raise DamagedRecord(f'{path} is damaged ({error}), and is {aside.name} now') from error
        return record

    def save(self, data: bytes) -> None:
        """Replace the content of a file that was taken (OSError: it stays as it was)."""
        self._file.replace(data)

    def close(self) -> None:
        """Leave the file to other programs."""
        self._file.close()


def records() -> Iterator[Record | str]:
    """Yield all that are kept, by the names of the files; of one that is none, why (OSError)."""
    for path in sorted(folder().glob(f'*{_END}')):
        try:
            data = path.read_bytes()
            if data:
                yield decoded(data)
        except (OSError, ValueError) as error:
            yield f'{path} cannot be read: {error}'
