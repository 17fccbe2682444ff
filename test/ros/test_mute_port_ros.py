# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A device server that stops passing bytes until it is connected to again."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import os
import select
import signal
import socket
import threading
import tty

from bench import FULL_RATE, Bench, wait_until
from connections import needs
import pytest

pytestmark = needs('rtu')

_SPEED = 20.0
#: Longer than it may take to find out, to connect again and to stop, also on a busy machine, s.
_SOON = 10.0


class DeviceServer:
    """
    One that serves one client after another.

    :ivar mute: nothing passes for the present client.
    :ivar clients: how many there were.
    """

    def __init__(self, line: str) -> None:
        self._line = os.open(line, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._line)
        self._listener = socket.create_server(('127.0.0.1', 0))
        self.port = f'socket://127.0.0.1:{self._listener.getsockname()[1]}'
        self.mute = False
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
                if not self.mute:
                    os.write(self._line, data)
            if self._line in ready:
                data = os.read(self._line, 4096)
                if not self.mute:
                    client.sendall(data)


@pytest.fixture
def server(bench: Bench) -> Iterator[DeviceServer]:
    """Return a device server between a driver and its drive."""
    bench.drive = bench.simulator(*bench.drives.ramps(0.3), paced=True)
    server = DeviceServer(bench.port)
    bench.port = server.port
    yield server
    server.close()


def test_the_motor_stops_although_the_system_reports_no_error(
    bench: Bench, server: DeviceServer
) -> None:
    driver = bench.driver(*FULL_RATE)
    client = bench.client().connected()
    with client.run_at(_SPEED):
        server.mute = True
        bench.drive.wait_for(lambda state: not state['driven'], timeout=_SOON)
    assert server.clients == 2
    client.wait_for('status', lambda status: status.connected and not status.enabled, 'it answers')
    wait_until(lambda: 'drives answer again' in driver.text, 'it is reported')
    assert driver.text.count('the port is opened again') == 1


def test_an_end_connects_once_more_before_it_gives_up(bench: Bench, server: DeviceServer) -> None:
    driver = bench.driver(
        *FULL_RATE, '-p', 'lost_after:=30.0', '-p', 'shutdown_timeout:=30.0'
    )
    client = bench.client().connected()
    with client.run_at(_SPEED):
        server.mute = True
        driver.signal(signal.SIGTERM)
        assert driver.wait() == 0
    assert server.clients == 2
    # it may still be on its ramp
    wait_until(lambda: not bench.drive.state()['turning'], 'the motor stands')
