# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Ports that pyserial reaches by URL, such as a serial device server on the network."""

from __future__ import annotations

import time
from typing import Any
from urllib.parse import urlsplit

import serial

from nfo_sinus_driver.link.interface import LineSettings, PortError
from nfo_sinus_driver.link.ports.tcp_connection import CLOSED_HINT, discard_unsent, watch_over

_READ_SIZE = 512
_CONNECT_HINT = f'is the device server switched on and its address right? If so, {CLOSED_HINT}'
#: The kinds of URL that lead to a device server.
_SERVERS = ('socket', 'rfc2217')
_REMEDY = (
    'write socket://host:port for a TCP connection that passes bytes on, or rfc2217://host:port'
)


class UrlPort:
    """A ``socket://host:port`` or ``rfc2217://host:port``, or another URL that pyserial knows."""

    def __init__(self, url: str, settings: LineSettings) -> None:
        _check(url)
        self._url = url
        #: Other kinds of URL lead to any device.
        self.place = url if _kind(url) in _SERVERS else ''
        self._settings = settings
        self._serial: serial.SerialBase | None = None

    def open(self) -> None:
        """Connect (PortError: no answer); where that was done, anew."""
        connection = getattr(self._serial, '_socket', None)
        if connection is not None:
            discard_unsent(connection)
        self.close()
        try:
            self._serial = serial.serial_for_url(
                self._url,
                baudrate=self._settings.baud_rate,
                bytesize=self._settings.data_bits,
                parity=self._settings.parity,
                stopbits=self._settings.stop_bits,
                timeout=0,
                write_timeout=1,
            )
        except (OSError, ValueError) as error:
            raise PortError(f'{self._url} cannot be opened ({error}): {_CONNECT_HINT}') from error
        connection = getattr(self._serial, '_socket', None)
        if connection is not None:
            # pyserial has no option for it
            watch_over(connection)

    def close(self) -> None:
        """Disconnect; harmless when it is closed already."""
        port, self._serial = self._serial, None
        if port is not None:
            port.close()

    def write(self, data: bytes) -> None:
        """Hand all bytes to the far end (PortError: the connection is gone)."""
        try:
            self._port().write(data)
        except OSError as error:
            raise self._lost(error) from error

    def read(self, until: float) -> bytes:
        """Return what has come, or nothing; wait for the first byte until a moment."""
        port = self._port()
        try:
            port.timeout = max(0.0, until - time.monotonic())
            data: bytes = port.read(1)
            if data:
                port.timeout = 0
                data += port.read(_READ_SIZE)
        except OSError as error:
            raise self._lost(error) from error
        return data

    def _port(self) -> serial.SerialBase:
        if self._serial is None:
            raise PortError(f'{self._url} is not open')
        return self._serial

    def _lost(self, error: OSError) -> PortError:
        return PortError(f'{self._url} was lost ({error}): {CLOSED_HINT}')


def _kind(url: str) -> str:
    return url.split('://')[0].lower()


def _check(url: str) -> None:
    """Check a URL without connecting; a ValueError says what is wrong with it."""
    kind = _kind(url)
    try:
        port: Any = serial.serial_for_url(url, do_not_open=True)
    except ValueError:
        raise ValueError(f'port {url!r}: there is no {kind}:// here; {_REMEDY}') from None
    except OSError:
        # known, but its device does not exist yet
        return
    if kind not in _SERVERS:
        return
    try:
        parts = urlsplit(url)
        complete = parts.hostname and parts.port
    except ValueError:
        complete = False
    if not complete:
        raise ValueError(f'port {url!r} lacks a host or a port from 1 to 65535: {_REMEDY}')
    try:
        port.from_url(url)
    except (OSError, ValueError, LookupError):
        raise ValueError(
            f'port {url!r}: omit {"?" + parts.query!r}, which is no option of {kind}://'
        ) from None
