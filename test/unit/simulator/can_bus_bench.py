# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""A CAN bus with simulated drives whose time is a number, and a master that writes lines."""

from __future__ import annotations

import re
from typing import Any

from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.endpoints import Endpoint
from nfo_sinus_driver.simulator.family import simulated_drive

_LINE = re.compile(rb'([tr])([0-9A-F]{3})(\d)((?:[0-9A-F]{2})*)\r')
#: How often drives catch up while no request comes, s.
_TICK = 0.01


class FakePort:
    """A port whose other end keeps what was said."""

    def __init__(self) -> None:
        self.name = 'paper'
        self.said = b''

    def send(self, data: bytes) -> None:
        self.said += data

    def hang_up(self) -> None:
        self.said += b'<gone>'

    def come_back(self) -> None:
        self.said += b'<back>'


class Bus:
    """
    A bus with drives, and an adapter that is on it.

    :ivar frames: what the nodes have sent, and when it was heard.
    """

    def __init__(
        self,
        nodes: tuple[int, ...] = (1,),
        *,
        paced: bool = False,
        turnaround: float = 0.0,
        rate: int | None = None,
        always_heard: bool = False,
        is_open: bool = True,
        boot_time: float = 2.0,
        settings: dict[str, Any] | None = None,
        model: str = 'sinus_g2',
        **options: Any,
    ) -> None:
        self.now = 100.0
        self.port = FakePort()
        way = Endpoint('canopen', baud=rate)
        self.drives = {
            node: simulated_drive(model, node, settings=settings, boot_time=boot_time, **options)
            for node in nodes
        }
        for drive in self.drives.values():
            drive.control_unit.set_to([(way.spoken, way.timing)])
            drive.advance_to(self.now)
        self.line = way.wire(
            self.port,
            list(self.drives.values()),
            (),
            lambda: self.now,
            paced=paced,
            turnaround=turnaround,
            always_heard=always_heard,
        )
        self.frames: list[tuple[float, Frame]] = []
        # no master hears their boot-up
        self.wait(0.1)
        if is_open:
            self.say(b'S4\rO\r')

    @property
    def drive(self) -> Any:
        """The only drive."""
        (drive,) = self.drives.values()
        return drive

    def say(self, data: bytes) -> bytes:
        """Write to the adapter; return what it says at once."""
        self._listen()
        self.line.receive(data, self.now)
        return self._listen()

    def send(self, identifier: int, data: bytes = b'', *, remote: bool = False) -> list[Frame]:
        """Send a frame; return those that come at once."""
        kind, text = ('r', '') if remote else ('t', data.hex())
        before = len(self.frames)
        assert self.say(f'{kind}{identifier:03X}{len(data)}{text}\r'.encode()).startswith(b'z\r')
        return [frame for _, frame in self.frames[before:]]

    def sdo(self, request: str, node: int = 1) -> str:
        """Send eight bytes to the SDO server of a node; return its answer, '' if there is none."""
        answers = self.send(0x600 + node, bytes.fromhex(request))
        found = [frame.data.hex() for frame in answers if frame.identifier == 0x580 + node]
        assert len(found) <= 1
        return found[0] if found else ''

    def read(self, index: int, sub_index: int = 0, node: int = 1) -> bytes:
        """Read an object of at most four bytes."""
        request = b'\x40' + index.to_bytes(2, 'little') + bytes((sub_index, 0, 0, 0, 0))
        answer = bytes.fromhex(self.sdo(request.hex(), node))
        assert answer[0] >> 4 == 4, answer.hex()
        return answer[4 : 8 - (answer[0] >> 2 & 3)]

    def write(self, index: int, sub_index: int, data: bytes, node: int = 1) -> str:
        """Write an object of at most four bytes; return the abort code, '' if there is none."""
        head = bytes((0x23 | 4 - len(data) << 2,)) + index.to_bytes(2, 'little')
        request = head + bytes((sub_index,)) + data.ljust(4, b'\0')
        answer = bytes.fromhex(self.sdo(request.hex(), node))
        return answer[:3:-1].hex() if answer[0] == 0x80 else ''

    def wait(self, seconds: float) -> list[Frame]:
        """Let time pass, and the line act exactly when it has to; return what came."""
        before = len(self.frames)
        end = self.now + seconds
        while self.now < end:
            self.now = min(end, max(self.now, min(self.now + _TICK, self.line.due)))
            for drive in self.drives.values():
                drive.advance_to(self.now)
            self.line.act(self.now)
            self._listen()
        return [frame for _, frame in self.frames[before:]]

    def _listen(self) -> bytes:
        said, self.port.said = self.port.said, b''
        for kind, identifier, length, data in _LINE.findall(said):
            value = bytes(int(length)) if kind == b'r' else bytes.fromhex(data.decode())
            self.frames.append((self.now, Frame(int(identifier, 16), value, kind == b'r')))
        return said
