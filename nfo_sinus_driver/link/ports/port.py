# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The port of a serial line, by its name."""

from __future__ import annotations

import re
from typing import Protocol

from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.link.ports.serial_port import SerialPort
from nfo_sinus_driver.link.ports.trace import Trace
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


class TracedPort:
    """A port whose bytes are traced; all else is as without."""

    def __init__(self, port: Port, trace: Trace) -> None:
        self._port = port
        self._trace = trace

    @property
    def place(self) -> str:
        """Where it is."""
        return self._port.place

    def open(self) -> None:
        """Open it."""
        self._port.open()

    def close(self) -> None:
        """Close it."""
        self._trace.flush()
        self._port.close()

    def write(self, data: bytes) -> None:
        """Hand all bytes over."""
        self._trace.sent(data)
        self._port.write(data)

    def read(self, until: float) -> bytes:
        """Return what has come."""
        data = self._port.read(until)
        self._trace.came(data)
        return data


def port_of(name: str, settings: LineSettings, trace: str = '') -> Port:
    """Return the port of a device path or of a URL of pyserial; it is not open yet."""
    port = _port_of(name, settings)
    return TracedPort(port, Trace(trace)) if trace else port


def _port_of(name: str, settings: LineSettings) -> Port:
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
