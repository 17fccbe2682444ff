# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A device server between a driver and its line, and what may be wrong with it."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import tty

from support.writes import is_write


class DeviceServer:
    """
    One that serves one client after another.

    :ivar mute: nothing passes for the present client.
    :ivar reads_only: what writes does not pass.
    :ivar unheard: requests that have these bytes do not pass.
    :ivar clients: how many there were.
    """

    def __init__(self, line: str) -> None:
        self._line = os.open(line, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._line)
        self._listener = socket.create_server(('127.0.0.1', 0))
        self.port = f'socket://127.0.0.1:{self._listener.getsockname()[1]}'
        self.mute = self.reads_only = False
        self.unheard = b''
        self.clients = 0
        self._stop, self._stopped = os.pipe()
        self._thread = threading.Thread(target=self._work)
        self._thread.start()

    def close(self) -> None:
        os.write(self._stopped, b'x')
        self._thread.join()
        self._listener.close()
        for fd in (self._line, self._stop, self._stopped):
            os.close(fd)

    def _work(self) -> None:
        while self._stop not in select.select([self._listener, self._stop], [], [])[0]:
            client, _ = self._listener.accept()
            self.mute = False
            self.clients += 1
            with client, contextlib.suppress(ConnectionError):
                self._serve(client)

    def _serve(self, client: socket.socket) -> None:
        while True:
            ready = select.select([client, self._line, self._stop], [], [])[0]
            if self._stop in ready:
                os.write(self._stopped, b'x')
                return
            if client in ready:
                data = client.recv(4096)
                if not data:
                    return
                # the driver hands over a frame as a whole
                held = self.reads_only and is_write('modbus_rtu', data)
                held |= bool(self.unheard) and self.unheard in data
                if not (self.mute or held):
                    os.write(self._line, data)
            if self._line in ready:
                data = os.read(self._line, 4096)
                if not self.mute:
                    client.sendall(data)
