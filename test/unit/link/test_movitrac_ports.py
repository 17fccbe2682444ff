# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A MOVITRAC at the far end of a pseudo-terminal, and behind a device server."""

from __future__ import annotations

from collections.abc import Iterator
import os
import select
import socket
import threading
import tty

import movitrac_far_end as far
import pytest

from nfo_sinus_driver.link import Address, BusSettings, NoAnswer, Refused

#: Longer than any drive here takes to answer, on any machine, s.
PATIENT = 10.0
RAMP = Address('index', 25, None, 4)
RATIO = Address('index', 263, None, 8)
ABSENT = 5


class Drive:
    """
    A drive with address 1: it keeps what is written.

    :ivar values: its parameters.
    """

    def __init__(self, end: int) -> None:
        self.values = {25: bytes.fromhex('00000370'), 263: bytes(8)}
        self._end = end
        self._stop, self._stopped = os.pipe()
        self._thread = threading.Thread(target=self._work)
        self._thread.start()

    def close(self) -> None:
        os.write(self._stopped, b'x')
        self._thread.join()
        os.close(self._stop)
        os.close(self._stopped)

    def _work(self) -> None:
        buffer = b''
        while self._stop not in select.select([self._end, self._stop], [], [])[0]:
            data = os.read(self._end, 100)
            if not data:
                return
            buffer += data
            length = {far.ENQUIRY: 5, far.SELECT: 9, far.LONG_SELECT: 13}[buffer[0]]
            if len(buffer) >= length:
                self._obey(*far.parsed(buffer[:length]))
                buffer = buffer[length:]

    def _obey(self, unit: int, index: int, value: bytes | None) -> None:
        if unit != 1:
            return
        if index not in self.values:
            os.write(self._end, far.nack(0x10))
        elif value is None:
            os.write(self._end, far.data(index, self.values[index]))
        else:
            self.values[index] = value
            os.write(self._end, far.ACK)


@pytest.fixture
def serial() -> Iterator[str]:
    far_end, near = os.openpty()
    tty.setraw(near)
    drive = Drive(far_end)
    yield os.ttyname(near)
    drive.close()
    os.close(far_end)
    os.close(near)


@pytest.fixture
def server() -> Iterator[str]:
    with socket.create_server(('127.0.0.1', 0)) as listener:
        drives: list[Drive] = []
        ends: list[socket.socket] = []

        def accept() -> None:
            end, _ = listener.accept()
            ends.append(end)
            drives.append(Drive(end.fileno()))

        thread = threading.Thread(target=accept)
        thread.start()
        yield f'socket://127.0.0.1:{listener.getsockname()[1]}'
        thread.join()
    for drive in drives:
        drive.close()
    for end in ends:
        end.close()


@pytest.mark.parametrize('kind', ['serial', 'server'])
def test_a_drive_is_read_and_written(kind: str, request: pytest.FixtureRequest) -> None:
    port: str = request.getfixturevalue(kind)
    link = BusSettings(port, 'movitrac', response_timeout=PATIENT).open()
    link.open()
    try:
        assert link.read(1, RAMP).data == bytes.fromhex('00000370')
        for address in (RAMP, RATIO):
            value = bytes(range(1, 1 + address.size))
            assert link.write(1, address, value).data == b''
            assert link.read(1, address).data == value
        with pytest.raises(Refused, match='illegal index'):
            link.read(1, Address('index', 9999, None, 4))
    finally:
        link.close()


def test_no_answer(serial: str) -> None:
    link = BusSettings(serial, 'movitrac', response_timeout=0.05).open()
    link.open()
    try:
        with pytest.raises(NoAnswer, match='unit 5 did not answer'):
            link.read(ABSENT, RAMP)
    finally:
        link.close()
