# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What outlives this process: which settings of a drive were changed, to be put back at the end."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from typing import Protocol

from nfo_sinus_driver.catalog import Value

#: A setting that was changed for a while, by its key: what was found, and what was set.
Borrowed = Mapping[str, tuple[Value, Value]]


class Memory(Protocol):
    """
    Remembers what was changed in drives, also when this process was killed.

    A future, so that the line never waits for a disk; its exception is an ``OSError``.
    """

    @property
    def line(self) -> str:
        """The name of the line, where a drive is known by its address alone."""

    def read(self, drive: str) -> Future[Borrowed]:
        """Return what is remembered of a drive; nothing where another program commands it."""

    def write(self, drive: str, borrowed: Borrowed) -> Future[None]:
        """Remember this of a drive from now on, and nothing else."""


class ProcessMemory:
    """Remembers as long as this process lives: for programs that are never killed, and tests."""

    line = ''

    def __init__(self) -> None:
        self._borrowed: dict[str, Borrowed] = {}

    def read(self, drive: str) -> Future[Borrowed]:
        """Return what is remembered of a drive."""
        future: Future[Borrowed] = Future()
        future.set_result(self._borrowed.get(drive, {}))
        return future

    def write(self, drive: str, borrowed: Borrowed) -> Future[None]:
        """Remember this of a drive from now on."""
        self._borrowed[drive] = dict(borrowed)
        future: Future[None] = Future()
        future.set_result(None)
        return future
