# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Writes down what goes over a line, in the form of the simulator's trace.

One JSON object a line: ``first`` and ``last``, the times at which the first and the last byte were
handed over or came (s, steady clock), ``direction`` (``request`` or ``answer``), ``hex``, ``gap``
(the silence before, s; ``null`` at first) and ``note``. An answer is all that comes until the next
request is sent: what of it is a frame is judged by the protocol, and not here.

A trace must keep back no stop, nor fill a disk. So what is written waits for a thread of its own,
and no request for a disk; where that takes too long frames are left out, and the next one says so.
Of a file that has grown too long the older half is kept beside it, and where it cannot be written
the trace ends, with a warning.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable
import contextlib
import json
import logging
import os
import queue
import threading
import time
from typing import NamedTuple, TextIO

_log = logging.getLogger(__name__)

#: How long both halves become together, bytes.
MOST = 64_000_000
#: What is written of the answer before the next request at the latest, bytes: noise may not end.
_MOST_BYTES = 4096
#: How many frames wait for the disk at most.
_MOST_WAITING = 10_000
#: How long the end of the program waits for what has not been written, s.
_AT_END = 1.0


class _Frame(NamedTuple):
    """A frame; ``note`` says what is wrong with it, or before it."""

    direction: str
    data: bytes
    first: float
    last: float
    note: str


class Trace:
    """
    The trace of one line; a file with the older half has ``.1`` behind its name.

    :raises ValueError: the file cannot be written; the message says why.
    """

    def __init__(
        self, path: str, most: int = MOST, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._path = path
        self._most = most
        self._now = now
        #: What has come since the last request, and when its first and last byte did.
        self._came, self._first, self._last = b'', 0.0, 0.0
        self._waiting: queue.Queue[_Frame] = queue.Queue(_MOST_WAITING)
        #: Frames were left out since the last one.
        self._is_behind = False
        # of the thread alone: the file, its length, and when the newest frame ended
        self._file: TextIO | None = None
        self._length = 0
        self._end: float | None = None
        try:
            self._begin()
        except OSError as error:
            raise ValueError(
                f'trace {path}: {error.strerror}; name a file in a folder that can be written to'
            ) from None
        threading.Thread(target=self._work, name='trace', daemon=True).start()
        atexit.register(self.wait_written, _AT_END)

    def sent(self, data: bytes) -> None:
        """Note what is sent now."""
        self.flush()
        now = self._now()
        self._put('request', data, now, now)

    def came(self, data: bytes) -> None:
        """Note what has just come; nothing where nothing did."""
        if not data:
            return
        self._last = self._now()
        if not self._came:
            self._first = self._last
        self._came += data
        if len(self._came) > _MOST_BYTES:
            self.flush()

    def flush(self) -> None:
        """Have written what has come so far."""
        if self._came:
            came, self._came = self._came, b''
            self._put('answer', came, self._first, self._last)

    def wait_written(self, seconds: float) -> None:
        """Wait until all that was noted is written, so long at most, s; not for the bus worker."""
        until = time.monotonic() + seconds
        while self._waiting.unfinished_tasks and time.monotonic() < until:
            time.sleep(0.002)

    def _put(self, direction: str, data: bytes, first: float, last: float) -> None:
        note = 'frames before it are left out' if self._is_behind else ''
        try:
            self._waiting.put_nowait(_Frame(direction, data, first, last, note))
        except queue.Full:
            self._is_behind = True
        else:
            self._is_behind = False

    def _work(self) -> None:
        while True:
            frame = self._waiting.get()
            try:
                self._write(frame)
            except OSError as error:
                _log.warning('the trace %s ends: %s', self._path, error.strerror)
                with contextlib.suppress(OSError):
                    assert self._file is not None
                    self._file.close()
                self._file = None
            self._waiting.task_done()

    def _write(self, frame: _Frame) -> None:
        if self._file is None:
            return
        gap = None if self._end is None else frame.first - self._end
        self._end = frame.last
        text = json.dumps({
            'first': frame.first,
            'last': frame.last,
            'direction': frame.direction,
            'hex': frame.data.hex(),
            'gap': gap,
            'note': frame.note,
        }) + '\n'
        if self._length + len(text) > self._most / 2:
            self._file.close()
            os.replace(self._path, f'{self._path}.1')
            self._begin()
        self._file.write(text)
        self._file.flush()
        self._length += len(text)

    def _begin(self) -> None:
        self._file = open(self._path, 'w', encoding='ascii')  # noqa: SIM115
        self._length = 0
