# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One connection to a gateway: begun, awaited in small steps, and checked by TCP itself."""

from __future__ import annotations

import os
import select
import socket
import struct
import time
from typing import Protocol

from nfo_sinus_driver.link.ports.trace import Trace

#: How long bytes may stay unacknowledged before the connection counts as lost, s.
_ACKNOWLEDGE_TIMEOUT = 5
#: After how long an idle connection is probed, how often, s, and how many times: a gateway that
#: has lost it says so, and one that is gone does not answer.
_KEEPALIVE = {socket.TCP_KEEPIDLE: 2, socket.TCP_KEEPINTVL: 1, socket.TCP_KEEPCNT: 3}
_READ_SIZE = 4096
#: What to do where a connection is closed, or refused by what is there.
CLOSED_HINT = (
    'it may have restarted, or it serves one client at a time and another has it: end that one, or '
    'allow more in its settings'
)
#: The addresses of a name, while they can be reached: a lookup may take long.
_known: dict[tuple[str, int], list[tuple[socket.AddressFamily, object]]] = {}


class Connection(Protocol):
    """A connection to a gateway; an ``OSError`` says what failed."""

    def open(self) -> None:
        """Begin to connect, without waiting."""

    def connected(self, until: float) -> bool:
        """Wait for the connection until a moment of ``time.monotonic``, s; return whether it is."""

    def write(self, data: bytes) -> None:
        """Hand all bytes over."""

    def read(self, until: float) -> bytes:
        """
        Return what has come, or nothing; wait for the first byte until a moment.

        :raises ConnectionError: the gateway has closed it.
        """

    def close(self, *, discard: bool = False) -> None:
        """Close it; ``discard``: bytes that have not arrived yet never will."""


class TcpConnection:
    """A connection by a socket; with several addresses of a host, each attempt tries the next."""

    def __init__(self, host: str, port: int) -> None:
        self._where = host, port
        self._socket: socket.socket | None = None
        self._is_connected = False

    def open(self) -> None:
        """Begin to connect; only the lookup of a name that is not known yet is waited for."""
        if self._where not in _known:
            found = socket.getaddrinfo(*self._where, type=socket.SOCK_STREAM)
            _known[self._where] = [(family, address) for family, _, _, _, address in found]
        family, address = _known[self._where][0]
        self._socket = connection = socket.socket(family, socket.SOCK_STREAM)
        connection.setblocking(False)
        watch_over(connection)
        try:
            connection.connect(address)  # type: ignore[arg-type]  # as it was found
        except BlockingIOError:
            # it is on its way
            return

    def connected(self, until: float) -> bool:
        """Wait for the connection until a moment; return whether it is there."""
        connection = self._open_socket()
        wait = max(0.0, until - time.monotonic())
        if not self._is_connected and select.select((), (connection,), (), wait)[1]:
            error = connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            if error:
                raise OSError(error, os.strerror(error))
            self._is_connected = True
        return self._is_connected

    def write(self, data: bytes) -> None:
        """Hand all bytes over: requests are small, and the buffer always has room for one."""
        self._open_socket().sendall(data)

    def read(self, until: float) -> bytes:
        """Return what has come, or nothing; wait for the first byte until a moment."""
        connection = self._open_socket()
        wait = max(0.0, until - time.monotonic())
        if not select.select((connection,), (), (), wait)[0]:
            return b''
        data = connection.recv(_READ_SIZE)
        if not data:
            raise ConnectionAbortedError('the gateway closed it')
        return data

    def close(self, *, discard: bool = False) -> None:
        """Close it; harmless when it is closed already."""
        connection, self._socket = self._socket, None
        if connection is None:
            return
        if not self._is_connected and (known := _known.pop(self._where, None)) and known[1:]:
            _known[self._where] = known[1:]
        if discard:
            discard_unsent(connection)
        connection.close()

    def _open_socket(self) -> socket.socket:
        if self._socket is None:
            raise ConnectionError('it is not open')
        return self._socket


class TracedConnection:
    """A connection whose bytes are traced; all else is as without."""

    def __init__(self, connection: Connection, trace: Trace) -> None:
        self._connection = connection
        self._trace = trace

    def open(self) -> None:
        """Begin to connect."""
        self._connection.open()

    def connected(self, until: float) -> bool:
        """Wait for the connection until a moment; return whether it is there."""
        return self._connection.connected(until)

    def write(self, data: bytes) -> None:
        """Hand all bytes over."""
        self._trace.sent(data)
        self._connection.write(data)

    def read(self, until: float) -> bytes:
        """Return what has come, or nothing."""
        data = self._connection.read(until)
        self._trace.came(data)
        return data

    def close(self, *, discard: bool = False) -> None:
        """Close it."""
        self._trace.flush()
        self._connection.close(discard=discard)


def discard_unsent(connection: socket.socket) -> None:
    """Have the kernel not keep trying to deliver what has not arrived when it is closed."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack('ii', 1, 0))


def watch_over(connection: socket.socket) -> None:
    """Have TCP find out by itself that a connection is broken, and send at once."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in _KEEPALIVE.items():
        connection.setsockopt(socket.IPPROTO_TCP, option, value)
    milliseconds = 1000 * _ACKNOWLEDGE_TIMEOUT
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, milliseconds)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
