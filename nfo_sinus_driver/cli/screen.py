# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is printed while a motor is commanded; nothing ever waits for a terminal or a reader."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from datetime import datetime
import math
import os
import shutil
import sys
import threading
from typing import TextIO

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog.status import PROCESS_VALUE, TORQUE
from nfo_sinus_driver.drive import Snapshot

_CLEAR_LINE = '\r\x1b[K'
#: How long the last words may take, s.
_LAST_WORDS = 2.0
#: So many lines may wait for a reader that does not read; then the oldest are dropped.
_MOST_WAITING = 1000


class Screen:
    """
    Prints by a thread of its own, in a ``with`` block; ``live``: the status stays in one line.

    After Ctrl-S in the terminal, or with a reader that does not read, only that thread waits.
    """

    def __init__(self, *, live: bool) -> None:
        self.live = live
        self._waiting: deque[tuple[bool, str]] = deque(maxlen=_MOST_WAITING)
        self._status: str | None = None
        self._status_stands = False
        self._work_there = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name='screen', daemon=True)
        #: The output has no reader any more.
        self.gone = False

    def __enter__(self) -> Screen:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing = True
        self._work_there.set()
        self._thread.join(_LAST_WORDS)

    def status(self, text: str) -> None:
        """Show what is so now; on a live line the newest replaces the others."""
        if self.live:
            self._status = text
            self._work_there.set()
        else:
            self.put(text)

    def put(self, text: str) -> None:
        """Print a line of output."""
        self._enter(False, text)

    def say(self, text: str) -> None:
        """Say something to the operator, on standard error."""
        self._enter(True, f'nfo-sinus: {text}')

    def _enter(self, to_error: bool, text: str) -> None:
        self._waiting.append((to_error, text))
        self._work_there.set()

    def _work(self) -> None:
        while not self._closing:
            self._work_there.wait()
            self._work_there.clear()
            self._print_all()
        self._print_all()
        if self._status_stands:
            self._print(sys.stdout, '\n')

    def _print_all(self) -> None:
        while self._waiting:
            to_error, text = self._waiting.popleft()
            stream = sys.stderr if to_error else sys.stdout
            terminal = stream is not None and stream.isatty()
            cleared = _CLEAR_LINE if self._status_stands and terminal else ''
            self._status_stands = self._status_stands and not cleared
            self._print(stream, f'{cleared}{text}\n')
        status, self._status = self._status, None
        if status is not None:
            width = shutil.get_terminal_size().columns - 1
            self._print(sys.stdout, f'{_CLEAR_LINE}{status[:width]}')
            self._status_stands = True

    def _print(self, stream: TextIO | None, text: str) -> None:
        try:
            _write(stream, text)
        except (OSError, ValueError):
            self.gone = self.gone or stream is sys.stdout


def _write(stream: TextIO | None, text: str) -> None:
    """Write past the buffer, for nothing could flush it at the end while a write waits."""
    if stream is None:
        return
    try:
        number = stream.fileno()
    except OSError:
        # it is none of the system's
        stream.write(text)
        return
    data = text.encode(stream.encoding or 'utf-8', 'replace')
    while data:
        data = data[os.write(number, data) :]


#: What is measured beside the status: its name, its unit and its decimals.
_VALUES = {
    Role.OUTPUT_CURRENT: ('output_current', 'A', 2),
    Role.OUTPUT_POWER: ('output_power', 'W', 0),
    Role.ACTUAL_TORQUE: ('torque', '%', 0),
}


def as_line(snapshot: Snapshot, values: Mapping[Role, float], more: str = '') -> str:
    """Return what a drive does, with what was measured and more, in one line."""
    when = f'{datetime.now().astimezone():%H:%M:%S}'
    cells = [when, more] if more else [when]
    if snapshot.status is None:
        return '  '.join((*cells, 'not connected'))
    cells.append(f'{f"{snapshot.status.code} {snapshot.text}":<11}')
    cells.append(f'set {_number(snapshot.setpoint, 1):>5} {snapshot.unit}')
    if snapshot.control_mode in (TORQUE.mode, PROCESS_VALUE.mode):
        cells.append(f'actual {_number(snapshot.actual, 1):>5} {snapshot.unit}')
    cells += [f'{_number(snapshot.frequency, 1):>5} Hz', f'{_number(snapshot.speed, 0):>5} rpm']
    cells += [
        f'{_number(values.get(role, math.nan), decimals):>4} {unit}'
        for role, (_, unit, decimals) in _VALUES.items()
    ]
    return '  '.join(cells)


def as_facts(snapshot: Snapshot, values: Mapping[Role, float]) -> dict[str, object]:
    """Return the same for a script; the names are those of the messages."""
    facts: dict[str, object] = {
        'time': datetime.now().astimezone().isoformat(),
        'connected': snapshot.connected,
        'enabled': snapshot.enabled,
    }
    if snapshot.status is not None:
        facts |= {
            'code': snapshot.status.code,
            'text': snapshot.text,
            'kind': snapshot.kind.value,
            'state': snapshot.status.state.name,
        }
        names = ('control_mode', 'unit', 'setpoint', 'actual', 'frequency', 'speed')
        facts |= {name: getattr(snapshot, name) for name in names}
        facts |= {name: values.get(role, math.nan) for role, (name, _, _) in _VALUES.items()}
    return facts


def _number(value: float, decimals: int) -> str:
    return '-' if math.isnan(value) else f'{value:.{decimals}f}'
