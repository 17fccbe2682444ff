# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Each protocol of a serial line on real ports, with drives in a thread at the other end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import os
import select
import socket
import threading
import time
import tty
from typing import Any

import classic_far_end as classic
from line_bench import UNIT, WAYS, Ascii, Bench, Classic, Movitrac, same
import pytest
from virtual_wire import DROP, REFUSE

from nfo_sinus_driver.link import BusSettings
from nfo_sinus_driver.link.interface import LinkError, NoAnswer, PortError, Refused
from nfo_sinus_driver.link.late_replies import LATEST_REPLY

Way = type[Bench]
#: Longer than any drive here takes to answer, on any machine, s.
PATIENT = 10.0
#: For those that never answer, s.
SHORT = 0.05
#: How long requests are: to a MOVITRAC by their start, of Modbus RTU by their function.
_LENGTHS = {0xB5: 5, 0xA9: 9, 17: 4, 43: 7}


def first_request(way: Way, data: bytes) -> bytes:
    """Return the first request in some bytes, of one word on Modbus; empty: it is not whole."""
    if way is Classic:
        found = classic.REQUEST.match(data)
        return found[0] if found else b''
    if way is Ascii:
        frame, end, _ = data.partition(b'\r\n')
        return frame + end if end else b''
    length = _LENGTHS.get(data[0 if way is Movitrac else 1], 8) if data[1:] else 8
    return data[:length] if len(data) >= length else b''


class PortDrives:
    """
    Drives at the far end of a port; what becomes of a request as ``drive`` has it, but at once.

    :ivar send: sends an answer; to be replaced.
    """

    def __init__(self, way: Way, end: int) -> None:
        self._way, self.end = way, end
        self._wire = way.wire_class(way.settings)
        self._wire.arrive = self._arrive  # type: ignore[method-assign]
        self.drive: Any = way.far_class(self._wire)
        self.send: Callable[[bytes], object] = lambda data: os.write(end, data)
        self._stop, self._stopped = os.pipe()
        self._thread = threading.Thread(target=self._work)
        self._thread.start()

    def close(self) -> None:
        os.write(self._stopped, b'x')
        self._thread.join()
        os.close(self._stop)
        os.close(self._stopped)

    def answer_of(self) -> bytes:
        """What the last request is answered with."""
        asked = self.drive.requests[-1]
        value: bytes = self.drive.value(asked.place, asked.size, len(self.drive.requests) - 1)
        return value

    def _arrive(self, at: float, data: bytes, *, lump: bool = False) -> float:
        if data:
            self.send(data)
        return at

    def _work(self) -> None:
        data = b''
        while self._stop not in select.select([self.end, self._stop], [], [])[0]:
            came = os.read(self.end, 100)
            if not came:
                return
            data += came
            while frame := first_request(self._way, data):
                data = data[len(frame) :]
                self.drive.take(self._wire.unpack(frame), 0.0)


@pytest.fixture(params=WAYS.values(), ids=WAYS)
def way(request: pytest.FixtureRequest) -> Way:
    found: Way = request.param
    return found


@pytest.fixture
def far(way: Way) -> Iterator[tuple[PortDrives, str]]:
    end, near = os.openpty()
    tty.setraw(near)
    drives = PortDrives(way, end)
    yield drives, os.ttyname(near)
    drives.close()
    os.close(end)
    os.close(near)


def connected(way: Way, port: str, timeout: float = PATIENT, char_format: str = '') -> Any:
    protocol = way.link_class.protocol.name
    settings = BusSettings(port, protocol, char_format=char_format, response_timeout=timeout)
    link = settings.open()
    way.tell(link)
    link.open()
    return link


@pytest.mark.parametrize('echo', [False, True])
def test_drives_are_read_and_written(way: Way, far: tuple[PortDrives, str], echo: bool) -> None:
    drives, port = far
    if echo:
        drives.drive.echo = same
    for char_format in way.link_class.protocol.char_formats or ('',):
        link = connected(way, port, char_format=char_format)
        for address in (way.A, way.B):
            assert link.read(UNIT, address).data == drives.answer_of()
            assert link.write(UNIT, address, way.VALUE).data == b''
            assert drives.drive.requests[-1].written == way.VALUE
        drives.drive.heal(REFUSE)
        with pytest.raises(Refused):
            link.read(UNIT, way.A)
        link.close()
        with pytest.raises(PortError):
            link.read(UNIT, way.A)


def test_an_answer_byte_by_byte(way: Way, far: tuple[PortDrives, str]) -> None:
    drives, port = far
    drives.send = lambda data: [os.write(drives.end, bytes((byte,))) for byte in data]
    link = connected(way, port)
    assert link.read(UNIT, way.A).data == drives.answer_of()
    link.write(UNIT, way.A, way.VALUE)
    link.close()


def test_no_answer(way: Way, far: tuple[PortDrives, str]) -> None:
    drives, port = far
    drives.drive.heal(DROP, DROP)
    link = connected(way, port, SHORT)
    with pytest.raises(NoAnswer, match='unit 5 did not answer'):
        link.read(5, way.A)
    with pytest.raises(NoAnswer):
        link.write(5, way.A, way.VALUE)
    link.close()


@pytest.mark.parametrize('late', [1.5, 3.0])
def test_a_late_answer(way: Way, far: tuple[PortDrives, str], late: float) -> None:
    drives, port = far
    link = connected(way, port, SHORT)
    given_up, send = threading.Event(), drives.send
    sent: list[float] = []

    def hold_back(data: bytes) -> None:
        # whatever is asked meanwhile is answered behind this
        drives.send = send
        given_up.wait(PATIENT)
        time.sleep((late - 1) * SHORT)
        send(data)
        sent.append(time.monotonic())

    drives.send = hold_back
    asked = time.monotonic()
    with pytest.raises(NoAnswer):
        link.read(UNIT, way.A)
    given_up.set()
    deadline = time.monotonic() + PATIENT
    reply = b''
    while not reply:
        assert time.monotonic() < deadline
        try:
            reply = link.read(UNIT, way.A).data
        except LinkError as error:
            assert not isinstance(error, (PortError, Refused))
    # where the machine stood still it was later than any drive is
    assert reply == drives.answer_of() or sent[0] - asked > LATEST_REPLY * SHORT
    link.close()


def test_behind_a_device_server(way: Way) -> None:
    with socket.create_server(('127.0.0.1', 0)) as listener:
        link = connected(way, f'socket://127.0.0.1:{listener.getsockname()[1]}')
        end, _ = listener.accept()
        with end:
            drives = PortDrives(way, end.fileno())
            assert link.read(UNIT, way.A).data == drives.answer_of()
            link.write(UNIT, way.A, way.VALUE)
            link.close()
            drives.close()
