# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The port of a serial line, by its name."""

from __future__ import annotations

import re
from typing import Protocol

from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.link.ports.serial_port import SerialPort
from nfo_sinus_driver.link.ports.url_port import UrlPort

#: A network address without the scheme of a URL.
_HOST_AND_PORT = re.compile(r'[^/]+:\d+')


class Port(Protocol):
    """A port that carries bytes."""

    @property
    def place(self) -> str:
        """Where it is; see :attr:`~..interface.Link.place`."""

    def open(self) -> None:
        """
        Open it; where it is open, close it before, and discard what has not left.

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
        return UrlPort(name, settings)
    if _HOST_AND_PORT.fullmatch(name):
        raise ValueError(
            f'port {name!r} is no device: write socket://{name} for a serial device server, or '
            'set protocol to modbus_tcp for a gateway'
        )
    return SerialPort(name, settings)
