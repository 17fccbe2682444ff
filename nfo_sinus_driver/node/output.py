# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Keeps a terminal that stands still, or a full pipe, from stopping the process."""

from __future__ import annotations

import os
import threading

_CHUNK = 65536
_LAST_WORDS = 1.0


class Output:
    """
    Puts a pipe in front of standard output and error, and a thread behind it.

    ROS writes its log with the interpreter locked. After Ctrl-S in the terminal, or with a reader
    that does not read, one such line would stop every thread, and with them the stop of a motor.
    Now only what is written is lost, once the pipe is full.
    """

    def __init__(self) -> None:
        self._originals: list[tuple[int, int]] = []
        self._threads: list[threading.Thread] = []
        for descriptor in (1, 2):
            try:
                original = os.dup(descriptor)
            except OSError:
                # closed by whoever started us
                continue
            reading, writing = os.pipe()
            os.set_blocking(writing, False)
            os.dup2(writing, descriptor)
            os.close(writing)
            thread = threading.Thread(
                target=_pump, args=(reading, original), name='output', daemon=True
            )
            thread.start()
            self._originals.append((descriptor, original))
            self._threads.append(thread)

    def close(self) -> None:
        """Write what is waiting, unless that takes too long, and put things back."""
        for descriptor, original in self._originals:
            os.dup2(original, descriptor)
        for thread in self._threads:
            thread.join(_LAST_WORDS)


def _pump(reading: int, original: int) -> None:
    while data := os.read(reading, _CHUNK):
        try:
            while data:
                data = data[os.write(original, data) :]
        except OSError:
            # the reader is gone; what is still said goes nowhere
            continue
