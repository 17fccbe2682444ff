# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Simulated drives on a CAN interface of the kernel: a socket made of paper, and a real vcan."""

from __future__ import annotations

from collections.abc import Iterator
import errno
import os
from pathlib import Path
import re
import select
import signal
import socket
import struct
import subprocess
import sys

import pytest

from nfo_sinus_driver.link.canopen_link import CanopenLink
from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.simulator import socketcan
from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.ports import PortError
from nfo_sinus_driver.simulator.simulator import Simulator
from nfo_sinus_driver.simulator.socketcan import CanInterface
from nfo_sinus_driver.simulator.socketcan import CanPort
from nfo_sinus_driver.simulator.socketcan import is_interface

READ_VENDOR = bytes.fromhex('4018100100000000')
VENDOR = bytes.fromhex('431810011b000000')
ROOT = Path(__file__).resolve().parents[3]


def raw(identifier: int, data: bytes = b'', length: int | None = None) -> bytes:
    """Return a struct can_frame as linux/can.h has it."""
    size = len(data) if length is None else length
    return struct.pack('=I', identifier) + bytes((size, 0, 0, 0)) + data.ljust(8, b'\0')


class PaperSocket:
    """A CAN socket whose other end is the test."""

    def __init__(self) -> None:
        self.near, self.far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.bound: tuple[str, ...] | None = None
        self.fails: dict[str, int] = {}

    def _may_fail(self, method: str) -> None:
        if method in self.fails:
            raise OSError(self.fails[method], os.strerror(self.fails[method]))

    def bind(self, address: tuple[str, ...]) -> None:
        self._may_fail('bind')
        self.bound = address

    def setblocking(self, blocking: bool) -> None:
        self.near.setblocking(blocking)

    def fileno(self) -> int:
        return self.near.fileno()

    def recv(self, size: int) -> bytes:
        self._may_fail('recv')
        return self.near.recv(size)

    def send(self, data: bytes) -> int:
        self._may_fail('send')
        return self.near.send(data)

    def close(self) -> None:
        self.near.close()

    def hear(self) -> bytes:
        """Return the next frame that came out."""
        ready, _, _ = select.select([self.far], [], [], 10.0)
        return self.far.recv(16) if ready else b''


@pytest.fixture
def paper(monkeypatch: pytest.MonkeyPatch) -> Iterator[PaperSocket]:
    paper = PaperSocket()
    real = socket.socket

    def make(family: int = -1, kind: int = -1, protocol: int = -1, *rest: object) -> object:
        if family != socket.AF_CAN:
            return real(family, kind, protocol, *rest)
        assert (kind, protocol) == (socket.SOCK_RAW, socket.CAN_RAW)
        paper._may_fail('socket')
        return paper

    monkeypatch.setattr(socketcan.socket, 'socket', make)
    yield paper
    paper.close()
    paper.far.close()


def test_drives_on_an_interface(paper: PaperSocket) -> None:
    with Simulator([1, 2], protocol='canopen', link='can0', control=None) as simulator:
        assert paper.bound == ('can0',) and simulator.port == 'can0'
        # an interface is there from the beginning: it hears them start
        assert {paper.hear(), paper.hear()} == {raw(0x701, b'\0'), raw(0x702, b'\0')}
        paper.far.send(raw(0x602, READ_VENDOR))
        assert paper.hear() == raw(0x582, VENDOR)
        # not for them: other lengths, error frames, extended ones
        for other in (
            raw(0x602, READ_VENDOR, 9),
            raw(0x20000602, READ_VENDOR),
            raw(0x80000602, READ_VENDOR),
            b'short',
        ):
            paper.far.send(other)
        paper.far.send(raw(0x40000701, b'', 1))
        assert paper.hear() == raw(0x701, b'\x7f')


def test_frames_as_structures() -> None:
    adapter = CanInterface()
    for frame, structure in (
        (Frame(0x605, b'\x01\x02'), raw(0x605, b'\x01\x02')),
        (Frame(0x701, bytes(1), remote=True), raw(0x40000701, b'', 1)),
        (Frame(0x12345678, b'\x01', extended=True), raw(0x92345678, b'\x01')),
    ):
        assert adapter.told(frame, 0.0) == structure
        assert list(adapter.take(structure)) == [frame]
    assert adapter.on_bus(125_000) and adapter.tried(Frame(1), sent=False) == b''


def test_an_interface_that_goes_down_and_comes_back(paper: PaperSocket) -> None:
    port = CanPort('can0')
    paper.fails = {'send': errno.ENETDOWN, 'recv': errno.ENETDOWN}
    port.send(raw(1))
    assert port.receive() == b''
    paper.fails = {}
    paper.far.send(raw(2))
    paper.far.send(raw(3))
    assert port.receive() == raw(2) + raw(3)
    port.hang_up()
    assert port.filenos() == [] and port.receive() == b''
    port.send(raw(1))
    port.hang_up()


@pytest.mark.parametrize(
    ('method', 'number', 'problem'),
    [
        ('socket', errno.EAFNOSUPPORT, 'this kernel has no SocketCAN .*: serve a pseudo-terminal'),
        ('bind', errno.ENODEV, 'cannot use the CAN interface can0 .*: see "ip link"'),
    ],
)
def test_why_there_is_no_interface(
    paper: PaperSocket, method: str, number: int, problem: str
) -> None:
    paper.fails[method] = number
    with pytest.raises(PortError, match=problem):
        CanPort('can0')


def test_a_python_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(socketcan.socket, 'AF_CAN')
    with pytest.raises(PortError, match='no SocketCAN'):
        CanPort('can0')


@pytest.mark.parametrize(
    ('link', 'found'),
    [('can0', True), ('vcan12', True), ('/tmp/nfo0', False), ('./nfo0', False), (None, False)],
)
def test_what_names_an_interface(link: str | None, found: bool) -> None:
    assert is_interface(link) is found


def vcan() -> str:
    """Return the name of a virtual interface that is up; '' if there is none."""
    folder = Path('/sys/class/net')
    names = sorted(one.name for one in folder.glob('vcan*')) if folder.is_dir() else []
    for name in names:
        try:
            CanPort(name).close()
        except PortError:
            continue
        return name
    return ''


def test_a_virtual_interface_of_the_kernel() -> None:
    name = vcan()
    if not name:
        pytest.skip('this kernel has no vcan interface: ip link add vcan0 type vcan, and set it up')
    with Simulator([1], protocol='canopen', link=name, control=None):
        link = CanopenLink.on_port(name, LineSettings(baud_rate=125_000, response_timeout=5.0))
        link.open()
        assert link.read(1, Address('object', 0x1018, 1, 4)).data == VENDOR[4:]
        link.close()


# ---- the command ----


def test_the_command_serves_canopen(folder: Path) -> None:
    link = folder / 'nfo0'
    command = [sys.executable, '-m', 'nfo_sinus_driver.simulator']
    options = ['--protocol', 'canopen', '--address', '1', '--address', '7', '--link', str(link)]
    more = ['--baud-rate', '250000', '--trace', str(folder / 'trace'), '--canopen-types', 'wide']
    with subprocess.Popen(
        [*command, *options, *more], stdout=subprocess.PIPE, text=True, cwd=ROOT
    ) as process:
        assert process.stdout is not None
        said = process.stdout.readline().strip()
        assert said == (
            f'serving canopen at 250000 bit/s on {link}, drives 1, 7; control {link}.control'
        )
        client = CanopenLink.on_port(
            str(link), LineSettings(baud_rate=250_000, response_timeout=5.0)
        )
        client.open()
        assert len(client.read(7, Address('object', 0x2022, None, 2)).data) == 4
        client.close()
        process.send_signal(signal.SIGTERM)
        assert process.wait(20.0) == 0
    trace = (folder / 'trace').read_text(encoding='ascii')
    hexed = re.findall(r'"direction": "(\w+)", "hex": "(\w+)"', trace)
    assert ('request', '06074022200000000000') in hexed
    assert ('answer', '05874322200003000000') in hexed


@pytest.mark.parametrize(
    ('options', 'problem'),
    [
        ({'baud': 19200}, '19200 bit/s: choose one of 10000, 20000'),
        ({'addresses': [128]}, '1 to 127 over canopen'),
        ({'echo': True}, 'canopen has no echo'),
        ({'model': 'sinus_optimal'}, 'sinus_optimal does not speak canopen'),
        ({'canopen_types': 'long'}, 'canopen_types: choose one of'),
    ],
)
def test_what_is_not_possible(options: dict, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        Simulator(protocol='canopen', **options)


def test_canopen_beside_modbus(folder: Path) -> None:
    with Simulator(protocol='modbus_rtu', also=['canopen']) as simulator:
        link = CanopenLink.on_port(
            simulator.ports[1], LineSettings(baud_rate=125_000, response_timeout=5.0)
        )
        link.open()
        assert link.read(1, Address('object', 0x2005, None, 4)).data == (1500).to_bytes(4, 'little')
        link.close()
