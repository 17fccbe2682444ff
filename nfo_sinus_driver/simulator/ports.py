# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Where bytes come in and go out: a pseudo-terminal or a TCP port."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
import socket
import tty


class PortError(Exception):
    """The port cannot be had; the message says why and what to do."""


class PtyPort:
    """
    A pseudo-terminal, perhaps under a symbolic link.

    The simulator keeps the master's side open itself, so a master that goes away is no error and
    may come back.

    :param link: the symbolic link to make, or ``None``.
    :raises PortError: the link's place is taken by something else.

    :ivar name: what a master opens.
    """

    def __init__(self, link: str | None = None) -> None:
        self._link = Path(link) if link else None
        #: That of the simulator, and the one that a master opens; none while it is hung up.
        self._ends: list[int] = []
        self._device = ''
        self.come_back()
        self.name = str(self._link or self._device)

    def filenos(self) -> list[int]:
        """The descriptors to wait on for reading."""
        return self._ends[:1]

    def receive(self) -> bytes:
        """Return what has arrived."""
        try:
            return os.read(self._ends[0], 4096) if self._ends else b''
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EIO):
                return b''
            raise

    def send(self, data: bytes) -> None:
        """Send; what does not fit because it is not read is lost."""
        if self._ends:
            with contextlib.suppress(BlockingIOError):
                os.write(self._ends[0], data)

    def hang_up(self) -> None:
        """Close the pseudo-terminal; the link goes with it."""
        if self._ends and self._link is not None and self._points_here():
            self._link.unlink()
        while self._ends:
            os.close(self._ends.pop())

    def come_back(self) -> None:
        """Open a pseudo-terminal and put the link on it."""
        if self._ends:
            return
        far, near = os.openpty()
        self._ends = [far, near]
        # the program that opens it configures it; until then no byte is to be changed
        tty.setraw(near)
        os.set_blocking(far, False)
        self._device = os.ttyname(near)
        if self._link is not None:
            try:
                _put_link(self._link, self._device)
            except BaseException:
                self.hang_up()
                raise

    def _points_here(self) -> bool:
        assert self._link is not None
        return self._link.is_symlink() and os.readlink(self._link) == self._device


def _put_link(link: Path, device: str) -> None:
    """Make or replace the link in one step, so that it is never missing."""
    if link.is_symlink():
        if not os.readlink(link).startswith('/dev/pts/'):
            raise PortError(f'{link} is a link to {os.readlink(link)}: choose another --link')
    elif link.exists():
        raise PortError(f'{link} exists and is no link of a simulator: choose another --link')
    temporary = link.with_name(f'.{link.name}.{os.getpid()}')
    try:
        temporary.unlink(missing_ok=True)
        temporary.symlink_to(device)
        temporary.replace(link)
    except OSError as error:
        raise PortError(f'cannot make the link {link}: {error.strerror}') from error


class TcpPort:
    """A TCP port here, 0: any, as of a serial device server: one master after another."""

    def __init__(self, port: int = 0) -> None:
        self._client: socket.socket | None = None
        self._number = port
        self._listener = self._listen()
        self._number = self._listener.getsockname()[1]
        self.name = f'127.0.0.1:{self._number}'

    def filenos(self) -> list[int]:
        """The descriptors to wait on for reading."""
        waiting = self._client or self._listener
        return [waiting.fileno()] if waiting.fileno() >= 0 else []

    def receive(self) -> bytes:
        """Return what has arrived, or take the next master in."""
        if self._client is None:
            with contextlib.suppress(OSError):
                self._client, _ = self._listener.accept()
                self._client.setblocking(False)
                self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b''
        try:
            data = self._client.recv(4096)
        except BlockingIOError:
            return b''
        except OSError:
            data = b''
        if not data:
            self._client.close()
            self._client = None
        return data

    def send(self, data: bytes) -> None:
        """Send; what is not taken is lost."""
        if self._client is not None:
            with contextlib.suppress(OSError):
                self._client.send(data)

    def hang_up(self) -> None:
        """Close the connection and refuse new ones."""
        if self._client is not None:
            self._client.close()
            self._client = None
        self._listener.close()

    def come_back(self) -> None:
        """Listen again on the same port."""
        if self._listener.fileno() < 0:
            self._listener = self._listen()

    def _listen(self) -> socket.socket:
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.setblocking(False)
        try:
            listener.bind(('127.0.0.1', self._number))
        except OSError as error:
            listener.close()
            raise PortError(
                f'TCP port {self._number} cannot be had ({error.strerror}): choose another, '
                'or --tcp 0'
            ) from error
        listener.listen(1)
        return listener


#: Where a line ends; what is sent and not taken is lost, as on a wire.
Port = PtyPort | TcpPort
