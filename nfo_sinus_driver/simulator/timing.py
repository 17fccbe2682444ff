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

"""How long things take on a serial line, and waiting for exactly that long."""

from __future__ import annotations

from collections.abc import Iterable
import contextlib
import ctypes
from dataclasses import dataclass
import re

#: The baud rates of the drive and the codes of SiBaud [M0 table 4].
BAUD_CODES = {1200: 16, 2400: 32, 4800: 64, 9600: 128, 19200: 256, 38400: 512, 57600: 768}
#: The character formats of the drive and the codes of SiProt [M0 table 4].
FORMAT_CODES = {'7E1': 0, '7O1': 1, '7N2': 2, '8E1': 4, '8O1': 5, '8N2': 6}
#: Those of the drive of [M2] [C5].
OLD_FORMAT_CODES = {'7E1': 0, '8N1': 1}
#: All there are.
FORMATS = tuple(dict.fromkeys((*FORMAT_CODES, *OLD_FORMAT_CODES)))

_PR_SET_TIMERSLACK = 29


@dataclass(frozen=True)
class Timing:
    """
    The line's speed.

    :param baud: bits a second.
    :param char_format: data bits, parity and stop bits, such as ``8E1``.
    :raises ValueError: the drive knows no such speed or format.
    """

    baud: int = 19200
    char_format: str = '8E1'

    def __post_init__(self) -> None:
        if self.baud not in BAUD_CODES:
            raise ValueError(f'{self.baud} baud: choose one of {_listed(BAUD_CODES)}')
        if self.char_format not in FORMATS:
            raise ValueError(f'{self.char_format!r}: choose one of {_listed(FORMATS)}')

    @property
    def character(self) -> float:
        """The time of one character (s): start, data, parity and stop bits."""
        parts = re.fullmatch(r'(\d)([NEO])(\d)', self.char_format)
        assert parts is not None
        bits = 1 + int(parts[1]) + (parts[2] != 'N') + int(parts[3])
        return bits / self.baud

    @property
    def t35(self) -> float:
        """The silence between frames (s): 3.5 characters, and 1.75 ms above 19200 baud."""
        return 0.00175 if self.baud > 19200 else 3.5 * self.character


def sharpen_timers() -> None:
    """Ask the kernel to wake this thread without slack; best effort, Linux only."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)


def _listed(choices: Iterable[object]) -> str:
    return ', '.join(str(choice) for choice in choices)
