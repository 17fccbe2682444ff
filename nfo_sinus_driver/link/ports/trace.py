# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Writes down what goes over a line, in the form of the simulator's trace.

One JSON object a line: ``first`` and ``last``, the times at which the first and the last byte were
handed over or came (s, steady clock), ``direction`` (``request`` or ``answer``), ``hex``, ``gap``
(the silence before, s; ``null`` at first) and ``note``. An answer is all that comes until the next
request is sent: what of it is a frame is judged by the protocol, and not here.

A trace must not stop a motor, nor fill a disk: of a file that has grown too long the older half is
kept beside it, and where it cannot be written the trace ends, with a warning.
"""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import json
import logging
import os
import time
from typing import TextIO

_log = logging.getLogger(__name__)

#: How long a file becomes, bytes: some hours of one drive on a fast line.
MOST = 16_000_000
#: What is written of the answer before the next request at the latest, bytes: noise may not end.
_MOST_BYTES = 4096


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
        self._file: TextIO | None = None
        self._length = 0
        #: What has come since the last request, and when its first and last byte did.
        self._came, self._first, self._last = b'', 0.0, 0.0
        #: When the newest frame ended.
        self._end: float | None = None
        try:
            self._begin()
        except OSError as error:
            raise ValueError(
                f'trace {path}: {error.strerror}; name a file in a folder that can be written to'
            ) from None

    def sent(self, data: bytes) -> None:
        """Note what is sent now."""
        self.flush()
        now = self._now()
        self._write('request', data, now, now)

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
        """Write down what has come so far."""
        if self._came:
            came, self._came = self._came, b''
            self._write('answer', came, self._first, self._last)

    def _write(self, direction: str, data: bytes, first: float, last: float) -> None:
        if self._file is None:
            return
        gap = None if self._end is None else first - self._end
        self._end = last
        frame = {
            'first': first,
            'last': last,
            'direction': direction,
            'hex': data.hex(),
            'gap': gap,
            'note': '',
        }
        text = json.dumps(frame) + '\n'
        try:
            if self._length + len(text) > self._most / 2:
                self._file.close()
                os.replace(self._path, f'{self._path}.1')
                self._begin()
            self._file.write(text)
            self._file.flush()
        except OSError as error:
            _log.warning('the trace %s ends: %s', self._path, error.strerror)
            with contextlib.suppress(OSError):
                self._file.close()
            self._file = None
            return
        self._length += len(text)

    def _begin(self) -> None:
        self._file = open(self._path, 'w', encoding='ascii')  # noqa: SIM115
        self._length = 0
