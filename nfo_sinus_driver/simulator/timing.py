# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How long things take on a serial line, and waiting for exactly that long."""

from __future__ import annotations

import contextlib
import ctypes
from dataclasses import dataclass
import re

_CHAR_FORMAT = re.compile(r'([78])([NEO])([12])')
_PR_SET_TIMERSLACK = 29


@dataclass(frozen=True)
class Timing:
    """The speed of a line: bit/s, and data bits, parity and stop bits, such as ``8E1``."""

    baud: int = 19200
    char_format: str = '8E1'

    def __post_init__(self) -> None:
        if self.baud <= 0:
            raise ValueError(f'{self.baud} baud are not possible')
        if not _CHAR_FORMAT.fullmatch(self.char_format):
            raise ValueError(f'{self.char_format!r} is no format: such as 8E1, 8N2 or 7O1')

    @property
    def character(self) -> float:
        """The time of one character (s): start, data, parity and stop bits."""
        data, parity, stop = tuple(self.char_format)
        return (1 + int(data) + (parity != 'N') + int(stop)) / self.baud

    @property
    def t35(self) -> float:
        """The silence between frames (s): 3.5 characters, and 1.75 ms above 19200 baud."""
        return 0.00175 if self.baud > 19200 else 3.5 * self.character


def sharpen_timers() -> None:
    """Ask the kernel to wake this thread without slack; best effort, Linux only."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
