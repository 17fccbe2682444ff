# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A program on a terminal of a given size, and what stands on its screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import contextlib
import fcntl
import os
import pty
import signal
import struct
import subprocess
import termios
import threading
import time

import pytest

#: Machines are shared and slow, s.
_PATIENCE = 90.0


class Terminal(contextlib.ExitStack):
    """Runs a command on a pseudo-terminal of its own; in a ``with`` block."""

    def __init__(
        self,
        command: Sequence[str],
        columns: int = 80,
        rows: int = 24,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__()
        pyte = pytest.importorskip('pyte', reason='pyte is not installed')
        self._screen = pyte.Screen(columns, rows)
        self._stream = pyte.ByteStream(self._screen)
        self._lock = threading.Lock()
        self._end, other = pty.openpty()
        fcntl.ioctl(other, termios.TIOCSWINSZ, struct.pack('4H', rows, columns, 0, 0))
        self._process = subprocess.Popen(
            list(command),
            stdin=other,
            stdout=other,
            stderr=other,
            start_new_session=True,
            # the keys that send signals send them to it
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
            env={
                **(os.environ if environment is None else environment),
                # pyte knows all of it; of others not how they scroll by several lines
                'TERM': 'linux',
                'LC_ALL': 'C.UTF-8',
                'PYTHONUTF8': '1',
            },
        )
        #: How the program found its terminal, and has to leave it.
        self.before = termios.tcgetattr(other)
        self._other = other
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.callback(self._close)

    @property
    def text(self) -> str:
        """What stands on the screen."""
        with self._lock:
            return '\n'.join(line.rstrip() for line in self._screen.display).replace('\xa0', ' ')

    @property
    def settings(self) -> list[object]:
        """How the terminal is set now."""
        return termios.tcgetattr(self._other)

    def press(self, keys: str) -> None:
        """Type something."""
        os.write(self._end, keys.encode())

    def resize(self, columns: int, rows: int) -> None:
        """Make the window of another size; it is drawn anew."""
        with self._lock:
            self._screen.reset()
            self._screen.resize(rows, columns)
        fcntl.ioctl(self._other, termios.TIOCSWINSZ, struct.pack('4H', rows, columns, 0, 0))

    def signal(self, number: int) -> None:
        """Send the program a signal."""
        self._process.send_signal(number)

    def wait_for(self, *texts: str, gone: Sequence[str] = ()) -> str:
        """Wait until all these texts stand on the screen, and none of the others; return it."""
        deadline = time.monotonic() + _PATIENCE
        while True:
            seen = self.text
            if all(text in seen for text in texts) and not any(text in seen for text in gone):
                return seen
            assert time.monotonic() < deadline, f'{texts} without {gone} not seen in:\n{seen}'
            assert self._reader.is_alive(), f'it has ended:\n{seen}'
            time.sleep(0.02)

    def wait(self) -> int:
        """Wait for the end; return the exit status."""
        return self._process.wait(_PATIENCE)

    def _read(self) -> None:
        while True:
            try:
                data = os.read(self._end, 65536)
            except OSError:
                return
            if not data:
                return
            with self._lock:
                self._stream.feed(data)

    def _close(self) -> None:
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        os.close(self._other)
        self._reader.join(_PATIENCE)
        os.close(self._end)
