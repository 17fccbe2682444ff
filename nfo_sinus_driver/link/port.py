# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What carries the bytes of a serial line, and the silence on it before the next frame."""

from __future__ import annotations

import re
from typing import NamedTuple, Protocol

from nfo_sinus_driver.link.interface import Clock, LineSettings
from nfo_sinus_driver.link.serial_port import SerialPort

#: An address on a network without the kind of URL that says what is there.
_HOST_AND_PORT = re.compile(r'[^/]+:\d+')


class Port(Protocol):
    """What carries the bytes."""

    def open(self) -> None:
        """
        Open it.

        :raises PortError: it is absent, not permitted, in use, or unable to do the settings.
        """

    def close(self) -> None:
        """Close it; harmless when it is closed already."""

    def write(self, data: bytes) -> None:
        """Hand all bytes over (PortError: it is gone)."""

    def read(self, until: float) -> bytes:
        """
        Return what has come; wait for the first byte until a moment of the clock, s.

        :raises PortError: it is gone.
        """


def port_of(name: str, settings: LineSettings) -> Port:
    """Return the port of a device path or of a URL of pyserial; it is not open yet."""
    if not name:
        raise ValueError('port is empty: name a device, such as /dev/ttyUSB0')
    if '://' in name:
        # with it comes pyserial, 0.4 MB that a driver on a device does without
        from nfo_sinus_driver.link.url_port import UrlPort

        return UrlPort(name, settings)
    if _HOST_AND_PORT.fullmatch(name):
        raise ValueError(
            f'port {name!r} is no device: write socket://{name} for a serial device server, or '
            'set protocol to modbus_tcp for a gateway'
        )
    return SerialPort(name, settings)


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
