# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The silence that has to be on a line before the next frame."""

from __future__ import annotations

from typing import NamedTuple

from nfo_sinus_driver.link.interface import Clock
from nfo_sinus_driver.link.port import Port

#: What is wrong where there is none.
NEVER_SILENT = 'the line is never silent: noise, or another master on it'


class Heard(NamedTuple):
    """
    What came while silence was waited for.

    :ivar data: all bytes; nobody asked for them.
    :ivar line_end: when the last byte was on the line.
    :ivar silent: silence came, too.
    """

    data: bytes
    line_end: float
    silent: bool


def await_silence(
    port: Port, now: Clock, line_end: float, gap: float, wait: float
) -> Heard:
    """
    Wait for silence on a line; all times are in seconds.

    :param now: the clock of the port.
    :param line_end: when the last byte was on the line, as far as is known.
    :param gap: how long the silence has to last.
    :param wait: how much longer than that it is waited for.
    """
    give_up = max(line_end + gap, now()) + wait
    came = b''
    while True:
        data = port.read(line_end + gap)
        moment = now()
        if data:
            came += data
            line_end = max(line_end, moment)
            if moment > give_up:
                return Heard(came, line_end, silent=False)
        elif moment >= line_end + gap:
            return Heard(came, line_end, silent=True)
