# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Starts a simulated drive and the driver for it: what ``make run`` and ``make demo`` share."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import random
import signal
import socket
import subprocess
import sys
import tempfile
from typing import IO, Any

_SIMULATOR = (sys.executable, '-m', 'nfo_sinus_driver.simulator')
_DRIVER = (sys.executable, '-m', 'nfo_sinus_driver.node')

BAUD_RATE = 57600


def handle_signals(handler: Any) -> None:
    """
    Handle the signals that end a program, whatever was inherited.

    Ignored they are as soon as the driver stops the motor, which must not be cut short.
    """
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, handler)


class Bench(contextlib.ExitStack):
    """A simulated drive on a pseudo-terminal and a driver for it, whose log is ours or a file."""

    def __init__(self, log: IO[bytes] | None = None) -> None:
        super().__init__()
        folder = self.enter_context(tempfile.TemporaryDirectory(prefix='nfo_sinus_'))
        self.port = str(Path(folder) / 'line')
        self._log = log
        self._processes: list[subprocess.Popen[bytes]] = []

    def start_simulator(self) -> str:
        """Start the simulated drive, wait until it serves, and return what it says of itself."""
        arguments = ('--link', self.port, '--baud-rate', str(BAUD_RATE), '--paced')
        process = self._start(*_SIMULATOR, *arguments, stdout=subprocess.PIPE)
        assert process.stdout is not None
        line = process.stdout.readline().decode().strip()
        if not line:
            raise RuntimeError('the simulator does not start; see what it says above')
        return line

    def start_driver(self, *arguments: str) -> subprocess.Popen[bytes]:
        """Start the driver on the simulated drive's port."""
        settings = ('-p', f'port:={self.port}', '-p', f'baud_rate:={BAUD_RATE}')
        return self._start(*_DRIVER, '--ros-args', *settings, *arguments, stdout=self._log)

    def inject(self, *what: str) -> None:
        """
        Have something happen to the simulated drive.

        :raises subprocess.CalledProcessError: the simulator refuses; it said why.
        """
        subprocess.run((*_SIMULATOR, 'inject', '--link', self.port, *what), check=True)

    def wait(self) -> int:
        """Wait until one of the processes ends; return its exit status."""
        while True:
            for process in self._processes:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    return process.wait(0.2)

    def _start(
        self, *command: str, stdout: IO[bytes] | int | None
    ) -> subprocess.Popen[bytes]:
        # in a session of its own, so that Ctrl-C does not end the simulated drive while the
        # driver stops its motor; the driver is asked to end by us
        process = subprocess.Popen(
            command, stdout=stdout, stderr=self._log, start_new_session=True
        )
        self._processes.append(process)
        self.callback(_end, process)
        return process


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ask a process to end; it takes as long as a stop may take."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(20.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


#: All that DDS has ports for on every system; 0 is that of everything else.
_DOMAINS = range(1, 102)
#: The first port of a domain, and that of its first participant; each next one has two more.
_PORT, _PORTS_OF_DOMAIN, _FIRST = 7400, 250, 10
#: As many participants find each other on one machine.
_PARTICIPANTS = 32


@contextlib.contextmanager
def own_domain() -> Iterator[int]:
    """Have a ROS domain that no other caller and no other program here has, nor the user."""
    users = os.environ.get('ROS_DOMAIN_ID', '')
    for number in random.sample(_DOMAINS, len(_DOMAINS)):
        if str(number) == users:
            continue
        with socket.socket(socket.AF_UNIX) as claim:
            # a name that only one on this machine can have, and that goes with its process
            try:
                claim.bind(f'\0nfo_sinus_driver/domain/{number}')
            except OSError:
                continue
            if _is_used(number):
                continue
            yield number
            return
    raise RuntimeError('no ROS domain is free')


def _is_used(domain: int) -> bool:
    """Return whether a program on this machine is in a domain: its drives may have our names."""
    first = _PORT + _PORTS_OF_DOMAIN * domain
    for port in (first, *range(first + _FIRST, first + _FIRST + 2 * _PARTICIPANTS, 2)):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(('', port))
            except OSError:
                return True
    return False
