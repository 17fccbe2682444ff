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

"""The driver of several drives over a real link, in virtual time, with their simulated drives."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
import contextlib
import heapq
import itertools
from typing import Any
from unittest import mock

from any_order_rig import Clock
from noise_rig import Kind
from noise_rig import TimedNotes
from noise_rig import modbus_rtu
from noise_rig import movitrac
from support.said import Said
from support.said import said
from support.variants import ramps

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link.classic_link import ClassicLink
from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.simulator import drive as simulated
from nfo_sinus_driver.simulator.classic import Classic
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import simulated_drive

_TURNAROUND = 0.002
#: The longest step in which nobody looks at anything, s.
_SLICE = 0.02
#: How often a program sends its set-points, s.
_SENDING_PERIOD = 0.1
_CLASSIC_FORMAT = '7E1'


def _kind(protocol: str, baud: int) -> Kind:
    """Return a kind of line by the name of its protocol."""
    if protocol == 'movitrac':
        return movitrac()
    if protocol == 'modbus_rtu':
        return modbus_rtu(baud)
    settings = LineSettings(baud, _CLASSIC_FORMAT)
    return Kind('sinus_g2', settings, ClassicLink, Classic(), 0.2, {})


class Line:
    """
    A serial port with the simulated drives behind it; whole frames come in one piece.

    :ivar frames: every request, and when its last byte was sent.
    :ivar unplugged: the addresses of the drives that nobody reaches.
    :ivar lost: called with each request and a drive that would hear it; true: it does not.
    """

    def __init__(self, rig: LineRig, kind: Kind) -> None:
        self._rig = rig
        self._settings = kind.settings
        self._protocol = kind.spoken
        #: Frames by the moment of their last byte; those to the drives, and those from them.
        self._coming: list[tuple[float, int, bool, bytes]] = []
        self._order = itertools.count()
        self.frames: list[tuple[float, bytes]] = []
        self.unplugged: set[int] = set()
        self.lost: Callable[[bytes, SimulatedDrive], bool] = lambda frame, far: False

    def open(self) -> None:
        pass

    def close(self) -> None:
        self._coming.clear()

    def write(self, data: bytes) -> None:
        end = self._rig.clock.now + len(data) * self._settings.char_time
        self.frames.append((end, data))
        heapq.heappush(self._coming, (end, next(self._order), True, data))

    def read(self, until: float) -> bytes:
        clock = self._rig.clock
        while self._coming and self._coming[0][0] <= max(until, clock.now):
            at, _, to_drives, frame = heapq.heappop(self._coming)
            clock.now = max(at, clock.now)
            if not to_drives:
                return frame
            self._carry_out(frame)
        clock.now = max(until, clock.now)
        return b''

    def _carry_out(self, frame: bytes) -> None:
        request = self._protocol.unwrap(frame)
        assert request is not None
        for address, far in self._rig.fars.items():
            if address in self.unplugged or not self._protocol.concerns(far, request):
                continue
            far.advance_to(self._rig.clock.now)
            if not far.listening or self.lost(frame, far):
                continue
            far.heard()
            answer = self._protocol.answer(far, request)
            if answer:
                begin = self._rig.clock.now + _TURNAROUND
                end = begin + len(answer) * self._settings.char_time
                heapq.heappush(self._coming, (end, next(self._order), False, answer))


class LineRig:
    """
    The driver, the line and its drives at the addresses from 1 on.

    :param settings: of every drive, as the driver has them.
    :ivar fars: the simulated drives by address.
    :ivar drives: the driver's, by address.
    """

    def __init__(
        self,
        count: int,
        *,
        protocol: str = 'modbus_rtu',
        baud: int = 57600,
        parameters: dict[str, Any] | None = None,
        own: dict[int, dict[str, Any]] | None = None,
        **settings: Any,
    ) -> None:
        self.clock = Clock()
        self._stack = contextlib.ExitStack()
        # the motors need not be exact here, and the time is long
        self._stack.enter_context(mock.patch.object(simulated, '_STEP', 0.05))
        kind = _kind(protocol, baud)
        self.fars = {
            address: simulated_drive(
                kind.model,
                address=address,
                settings={**ramps(kind.model, 0.5, 0.5), **(parameters or {})},
            )
            for address in range(1, count + 1)
        }
        for far in self.fars.values():
            far.advance_to(self.clock.now)
        self.line = Line(self, kind)
        now = self.clock.monotonic
        self.bus = Bus(kind.link(self.line, kind.settings, now), now=now)
        settings = {'model': kind.model, **settings}
        self.notes = {address: TimedNotes(self.clock) for address in self.fars}
        self.drives = {
            address: Drive(
                self.bus,
                DriveSettings(**{'address': address, **settings, **(own or {}).get(address, {})}),
                self.notes[address],
            )
            for address in self.fars
        }
        self._program: Callable[[], None] = lambda: None
        self._program_at = 0.0

    def close(self) -> None:
        self.bus.close()
        self._stack.close()

    def connect(self) -> None:
        """Connect to all drives and activate them."""
        for future in [drive.connect() for drive in self.drives.values()]:
            self.answer(future)
        for drive in self.drives.values():
            drive.activate()
        self.pass_time(0.5)

    def start(self, *addresses: int, apart: float = 0.0) -> float:
        """
        Connect to some drives, or to all, read their settings, and activate each as it is done.

        :param apart: how much later than the one before each is begun, s.
        :returns: how long it took, s.
        """
        began = self.clock.now
        due = {
            address: began + number * apart for number, address in enumerate(addresses or self.fars)
        }
        begun: dict[int, Future[Any]] = {}
        while due or begun:
            for address in [address for address, at in due.items() if at <= self.clock.now]:
                del due[address]
                begun[address] = self.drives[address].connect(parameters=True)
            for address in [address for address, future in begun.items() if future.done()]:
                begun.pop(address).result()
                self.drives[address].activate()
            self.pass_time(_SLICE)
        return self.clock.now - began

    def enable(self, *addresses: int) -> None:
        """Enable some drives, or all."""
        chosen = addresses or tuple(self.drives)
        for future in [self.drives[address].enable() for address in chosen]:
            assert 'enabled' in self.answer(future)
        # what is asked for in the very moment of enabling does not come after it
        self.pass_time(_SLICE)

    def keep(self, program: Callable[[], None]) -> None:
        """Have a program do something again and again, as one that sends set-points."""
        self._program, self._program_at = program, self.clock.now

    def give_all(self, value: float) -> None:
        """Give each drive a set-point of its own."""
        for drive in self.drives.values():
            drive.set_setpoint(value)

    def pass_time(self, seconds: float) -> None:
        """Let time pass for all."""
        end = self.clock.now + seconds
        while self.clock.now < end:
            if self.clock.now >= self._program_at:
                self._program_at = self.clock.now + _SENDING_PERIOD
                self._program()
            until = min(self.bus.step(), end, self.clock.now + _SLICE)
            self.clock.now = max(until, self.clock.now)
        for far in self.fars.values():
            far.advance_to(self.clock.now)

    def answer(self, future: Future[Any], patience: float = 60.0) -> Said:
        """Let time pass until a command is answered; return what it says, done or not."""
        end = self.clock.now + patience
        while not future.done():
            assert self.clock.now < end, 'no answer'
            self.pass_time(_SLICE)
        return said(future.exception() or future.result())

    def polls(self, seconds: float) -> Counter[int]:
        """Let time pass; return how many statuses of each drive were told meanwhile."""
        before = {address: len(notes.published) for address, notes in self.notes.items()}
        self.pass_time(seconds)
        return Counter(
            {
                address: len(notes.published) - before[address]
                for address, notes in self.notes.items()
            }
        )

    def measured(self) -> Counter[int]:
        """Return how often each drive was measured."""
        return Counter({address: len(notes.telemetry) for address, notes in self.notes.items()})


MakeLine = Callable[..., LineRig]
