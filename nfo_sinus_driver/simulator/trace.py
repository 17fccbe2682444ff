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

"""A record of every frame on the line, with its time, for tests and for people."""

from __future__ import annotations

import json
from typing import TextIO


class Trace:
    """
    Writes one JSON object a line and flushes it, so that it can be read while it grows.

    ``first`` and ``last`` are the times of the frame's first and last byte at the simulator (s,
    steady clock, the same in every process), ``direction`` is ``request`` or ``answer``, ``hex``
    the bytes, ``gap`` the silence since the last byte before it (s, ``null`` for the first), and
    ``note`` says what was wrong with it, if anything: ``rubbish``, ``lost``, ``damaged`` ….

    A request's first byte is stamped when it was read and an answer's just before it is written,
    so a gap after an answer is never shown shorter than the master kept it.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._end: float | None = None

    def record(
        self, direction: str, data: bytes, first: float, last: float, note: str = ''
    ) -> None:
        """Write one frame down."""
        gap = None if self._end is None else first - self._end
        self._end = last if self._end is None else max(self._end, last)
        frame = {
            'first': first,
            'last': last,
            'direction': direction,
            'hex': data.hex(),
            'gap': gap,
            'note': note,
        }
        self._stream.write(json.dumps(frame) + '\n')
        self._stream.flush()
