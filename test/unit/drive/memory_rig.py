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

"""The driver and the simulator's own line in virtual time, and perhaps another master on it."""

from __future__ import annotations

from collections.abc import Callable
import heapq
import itertools
from typing import Any

from any_order_rig import Rig
from support.variants import hardest
from support.variants import ramps

from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link import PROTOCOLS
from nfo_sinus_driver.link import LineSettings
from nfo_sinus_driver.link import line_settings
from nfo_sinus_driver.link.protocols import link_class
from nfo_sinus_driver.link.protocols import protocol_of
from nfo_sinus_driver.simulator.endpoints import endpoint
from nfo_sinus_driver.simulator.family import simulated_drive

_NEVER = float('inf')
for _protocol in PROTOCOLS.values():
    # loaded before a rig lets all modules of the driver see its clock
    link_class(_protocol)


class MemoryPort:
    """
    Both ends of a line: the port of a link, and that of the simulator's line.

    :ivar others_heard: this end of the line hears what other masters send.
    """

    name = 'memory'

    def __init__(self, rig: Rig, settings: LineSettings) -> None:
        self._rig = rig
        self._char_time = settings.char_time
        self.line: Any = None
        self.others_heard = True
        self.sent: list[bytes] = []
        self._come = b''
        #: What other masters do, and when.
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()

    # of the simulator
    def filenos(self) -> list[int]:
        return []

    def receive(self) -> bytes:
        return b''

    def send(self, data: bytes) -> None:
        self._come += data

    # of the link
    def open(self) -> None:
        pass

    def close(self) -> None:
        pass

    def write(self, data: bytes) -> None:
        self._catch_up()
        self.sent.append(data)
        self.line.receive(data, self._rig.clock.now)

    def read(self, until: float) -> bytes:
        self._catch_up()
        while not self._come and (due := self._due) <= until:
            self._go_to(due)
        if not self._come:
            self._go_to(until)
        data, self._come = self._come, b''
        return data

    def _go_to(self, moment: float) -> None:
        clock = self._rig.clock
        # exactly: what is due then is done
        clock.now = max(clock.now, moment)
        self._rig.elapse(0.0)
        self._catch_up()

    @property
    def _due(self) -> float:
        return min(self.line.due, self._events[0][0] if self._events else _NEVER)

    def _catch_up(self) -> None:
        now = self._rig.clock.now
        while (at := self._due) <= now:
            if self._events and self._events[0][0] == at:
                heapq.heappop(self._events)[2]()
            self.line.act(at)
        self.line.act(now)

    # of another master
    def later(self, at: float, do: Callable[[], None]) -> None:
        heapq.heappush(self._events, (at, next(self._order), do))

    def another_sends(self, frame: bytes, at: float) -> None:
        """Let another master begin to send a frame at a moment."""
        self.later(at, lambda: self.line.receive(frame, at))
        for number in range(len(frame) if self.others_heard else 0):
            end = at + (number + 1) * self._char_time
            self.later(end, lambda byte=frame[number : number + 1]: self.send(byte))

    def another_asks(self, frame: bytes, every: float) -> None:
        """Let another master send a frame again and again from now on."""

        def again() -> None:
            now = self._rig.clock.now
            self.another_sends(frame, now)
            self.later(now + every, again)

        self.later(self._rig.clock.now, again)


class MemoryRig(Rig):
    """A drive on the simulator's line."""

    port: MemoryPort

    def __init__(
        self,
        protocol: str,
        baud: int | None = None,
        response_timeout: float = 0.2,
        **settings: Any,
    ) -> None:
        model = settings.setdefault('model', 'sinus_g2')
        line = line_settings(protocol, baud_rate=baud or 0, response_timeout=response_timeout)
        far = simulated_drive(model, settings=ramps(model, 0.3, 0.3), **hardest(model))
        end = endpoint(protocol, baud=baud)
        far.control_unit.set_to([(end.spoken, end.timing)])

        def link(rig: Rig) -> Any:
            port = self.port = MemoryPort(rig, line)
            port.line = end.wire(
                port, [far], [far], rig.clock.monotonic, gateway_timeout=0.1, paced=True,
                turnaround=0.005, echo=False, always_heard=True, trace=None,
            )
            made = link_class(protocol_of(protocol))(port, line, rig.clock.monotonic)
            made.frames = port.sent
            return made

        super().__init__(far, DriveSettings(**settings), link)

    def run(self, frequency: float = 20.0) -> None:
        """Connect, enable and turn, with a program that keeps on sending the set-point."""
        self.answer(self.drive.connect(), 300.0)
        self.drive.activate()
        self.pass_time(0.5)
        assert 'enabled' in self.answer(self.drive.enable())
        self.send(frequency)
        self.pass_time(1.5)
        assert abs(self.far.motor.frequency - frequency) < 0.2
        self.notes.events.clear()
