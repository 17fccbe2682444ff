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

"""The driver of one drive over a real link, in virtual time, on a line with noise."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Mapping
import heapq
import itertools
import random
from typing import Any
from typing import NamedTuple
from unittest import mock

from any_order_rig import Clock
from any_order_rig import Notes
from any_order_rig import Rig
from support.said import says
from support.variants import ramps

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive import Snapshot
from nfo_sinus_driver.drive import Telemetry
from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.link.movitrac_link import MovitracLink
from nfo_sinus_driver.link.rtu import RtuLink
from nfo_sinus_driver.simulator import drive as simulated
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.modbus_frames import ModbusRtu
from nfo_sinus_driver.simulator.movitrac import Movitrac

_TURNAROUND = 0.002
#: The driver gave the motor up, whether or not it could tell the drive.
_ENDS = ('lost: ', 'stopped: ', 'stopping: ')


class Kind(NamedTuple):
    """
    A kind of line, and the drive at it.

    :ivar link: the driver's end of it, on a port.
    :ivar spoken: the same for the drive.
    :ivar wait: how long an answer is waited for at most, s.
    :ivar variant: what the drive does where the manual is open.
    """

    model: str
    settings: LineSettings
    link: Callable[[Any, LineSettings, Clock], Any]
    spoken: Any
    wait: float
    variant: Mapping[str, str]


def modbus_rtu(baud: int) -> Kind:
    """Return a G2 on Modbus RTU."""
    return Kind('sinus_g2', LineSettings(baud_rate=baud), RtuLink, ModbusRtu(), 0.2, {})


def movitrac(**variant: str) -> Kind:
    """Return a MOVITRAC on its own line; it may be set to answer up to 0.2 s late (P843)."""
    settings = LineSettings(9600, '8N1')
    return Kind('movitrac31', settings, MovitracLink, Movitrac(), 0.4, variant)


class Line:
    """
    A serial port with the simulated drive behind it; whole frames come in one piece.

    :ivar damage: how likely an answer is damaged.
    :ivar bursts: from when to when nothing gets through, either way.
    :ivar sent: when each request began.
    :ivar meet: called with each frame that arrives whole; returns the answer in place of the
        drive's, or ``None``.
    """

    def __init__(self, rig: NoiseRig, line: Kind, seed: int) -> None:
        self._rig = rig
        self._settings = line.settings
        self._random = random.Random(seed)
        self._protocol = line.spoken
        #: Frames by the moment of their last byte; those to the drive, and those from it.
        self._coming: list[tuple[float, int, bool, bytes]] = []
        self._order = itertools.count()
        self.damage = 0.0
        self.bursts: list[tuple[float, float]] = []
        self.sent: list[float] = []
        self.meet: Callable[[bytes], bytes | None] = lambda frame: None

    def open(self) -> None:
        pass

    def close(self) -> None:
        self._coming.clear()

    def write(self, data: bytes) -> None:
        self.sent.append(self._rig.clock.now)
        self._put(self._rig.clock.now, data, to_drive=True)

    def read(self, until: float) -> bytes:
        clock = self._rig.clock
        while self._coming and self._coming[0][0] <= max(until, clock.now):
            at, _, to_drive, frame = heapq.heappop(self._coming)
            # the drive catches up when it hears something, or when the bus has nothing to do
            clock.now = max(at, clock.now)
            if not to_drive:
                return frame
            self._carry_out(frame)
        clock.now = max(until, clock.now)
        return b''

    def _put(self, begin: float, frame: bytes, *, to_drive: bool) -> None:
        end = begin + len(frame) * self._settings.char_time
        if not any(first < end and begin < last for first, last in self.bursts):
            heapq.heappush(self._coming, (end, next(self._order), to_drive, frame))

    def _carry_out(self, frame: bytes) -> None:
        far = self._rig.far
        far.advance_to(self._rig.clock.now)
        request = self._protocol.unwrap(frame)
        if request is None or not far.listening or not self._protocol.concerns(far, request):
            return
        far.heard()
        answer = self.meet(frame) or self._protocol.answer(far, request)
        if self._random.random() < self.damage:
            place = self._random.randrange(len(answer))
            spoiled = answer[place] ^ 1 << self._random.randrange(8)
            answer = answer[:place] + bytes((spoiled,)) + answer[place + 1 :]
        self._put(self._rig.clock.now + _TURNAROUND, answer, to_drive=False)


class TimedNotes(Notes):
    """
    Keeps when what was told.

    :ivar published: when each status of a connected drive was told, and what it was.
    """

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self.published: list[tuple[float, Snapshot]] = []
        self.telemetry: list[Telemetry] = []

    def on_snapshot(self, snapshot: Snapshot) -> None:
        super().on_snapshot(snapshot)
        if snapshot.connected:
            self.published.append((self._clock.now, snapshot))

    def on_telemetry(self, telemetry: Telemetry) -> None:
        self.telemetry.append(telemetry)

    def on_parameters(self, keys: Collection[str]) -> None:
        pass


class NoiseRig(Rig):
    """The driver, the line and the drive; the answer time-out is that of the factory."""

    notes: TimedNotes

    def __init__(
        self, kind: Kind | None = None, seed: int = 0, **settings: Any
    ) -> None:
        self._kind = kind or modbus_rtu(57600)
        self._seed = seed
        # the motor need not be exact here, and the time is long
        self._coarse = mock.patch.object(simulated, '_STEP', 0.05)
        self._coarse.start()
        model = self._kind.model
        far = simulated_drive(model, settings=ramps(model, 0.5, 0.5), **self._kind.variant)
        super().__init__(far, DriveSettings(model=model, **settings))

    def begin(self) -> None:
        """Start a driver."""
        self.notes = TimedNotes(self.clock)
        self.line = Line(self, self._kind, self._seed)
        now = self.clock.monotonic
        link = self._kind.link(self.line, self._kind.settings, now)
        self.bus = Bus(link, now=now)
        self.drive = Drive(self.bus, self.settings, self.notes)

    def close(self) -> None:
        super().close()
        self._coarse.stop()

    def ride(self, frequency: float = 20.0) -> None:
        """Connect, enable and turn, with a program that keeps on sending a set-point."""
        self.answer(self.drive.connect())
        self.drive.activate()
        self.enable(frequency)

    def enable(self, frequency: float = 20.0) -> None:
        """Enable and turn."""
        assert 'enabled' in self.answer(self.drive.enable())
        self.send(frequency)
        self.pass_time(1.0)
        self.notes.events.clear()

    def register(self, key: str) -> int:
        """Return where a parameter stands."""
        return self.drive.registers.address(key).index

    @property
    def ends(self) -> list[str]:
        """Why the driver gave the motor up since the ride began, each time."""
        return [text for _, _, text in self.notes.events if text.startswith(_ENDS)]

    def said(self, what: str | Cause, severity: Severity | None = None) -> bool:
        """Whether an event says this."""
        return any(
            says(text, what) for _, grave, text in self.notes.events if severity in (None, grave)
        )
