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

"""The driver of one drive behind a gateway on Modbus TCP, in virtual time, over connections."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from any_order_rig import Rig
from support.variants import ramps

from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link.modbus_tcp import TcpLink
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.modbus import server

#: What a gateway takes to have an answer of its drive, and to accept a connection, s.
_TURNAROUND = 0.01
_ACCEPTS_AFTER = 0.001

Carry = Callable[[bytes], bytes]


class Gateway:
    """
    A gateway with one drive behind it.

    :ivar sessions: every connection that was begun.
    :ivar lost: nothing of a new connection arrives; :ivar:`refuses`: it says that it takes none.
    :ivar answer: returns what it answers a message; no bytes: nothing.
    :ivar number: returns the transaction number of the answer to one with a number.
    :ivar closes: it closes a connection after each answer.
    """

    def __init__(self, clock: Any, answer: Carry, elapse: Callable[[float], None]) -> None:
        self.clock = clock
        self.elapse = elapse
        self.answer = answer
        self.number: Callable[[int], int] = lambda number: number
        self.sessions: list[Session] = []
        self.lost = self.refuses = self.closes = False

    def connect(self, host: str, port: int) -> Session:
        session = Session(self)
        self.sessions.append(session)
        return session


class Session:
    """
    One connection.

    :ivar mute: what is sent stays on its way, and nothing comes.
    :ivar stuck: what is on its way.
    """

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._is_closed = self._hung_up = False
        self.mute = False
        self.stuck: list[bytes] = []
        self.requests: list[bytes] = []
        self._coming: list[tuple[float, bytes]] = []

    def open(self) -> None:
        if self._gateway.refuses:
            raise ConnectionRefusedError(111, 'Connection refused')

    def connected(self, until: float) -> bool:
        wait = until - self._gateway.clock.now
        if self._gateway.lost:
            self._gateway.elapse(max(0.0, wait))
            return False
        self._gateway.elapse(_ACCEPTS_AFTER)
        return True

    def write(self, data: bytes) -> None:
        if self._is_closed:
            raise ConnectionError('it is not open')
        if self._hung_up:
            raise BrokenPipeError(32, 'Broken pipe')
        if self.mute:
            self.stuck.append(data)
        else:
            self._arrive(data)

    def heal(self) -> None:
        """Let what is stuck arrive, unless it was discarded."""
        self.mute = False
        stuck, self.stuck = self.stuck, []
        for data in stuck:
            self._arrive(data)

    def _arrive(self, data: bytes) -> None:
        number = self._gateway.number(int.from_bytes(data[:2], 'big'))
        self.requests.append(data)
        answer = self._gateway.answer(data[6:])
        if answer:
            head = number.to_bytes(2, 'big') + bytes(2) + len(answer).to_bytes(2, 'big')
            self._coming.append((self._gateway.clock.now + _TURNAROUND, head + answer))

    def read(self, until: float) -> bytes:
        clock = self._gateway.clock
        if self._coming and self._coming[0][0] <= max(until, clock.now):
            at, data = self._coming.pop(0)
            self._gateway.elapse(max(0.0, at - clock.now))
            self._hung_up = self._gateway.closes
            return data
        if self._hung_up:
            raise ConnectionAbortedError('the gateway closed it')
        self._gateway.elapse(max(0.0, until - clock.now))
        return b''

    def close(self, *, discard: bool = False) -> None:
        self._is_closed = True
        if discard:
            self.stuck.clear()


class _Link(TcpLink):
    """The link, which counts what it sends for the rig."""

    def __init__(self, gateway: Gateway, response_timeout: float) -> None:
        super().__init__('gateway', 502, response_timeout, gateway.connect, gateway.clock.monotonic)
        self._gateway = gateway

    @property
    def frames(self) -> list[bytes]:
        return [one for session in self._gateway.sessions for one in session.requests]


class TcpRig(Rig):
    """
    A drive behind a gateway.

    :ivar gateway: what is between.
    """

    gateway: Gateway

    def __init__(self, response_timeout: float = 0.2, **settings: Any) -> None:
        self.far: SimulatedDrive
        far = simulated_drive('sinus_g2', settings=ramps('sinus_g2', 0.3, 0.3))

        def link(rig: Rig) -> _Link:
            def answer(message: bytes) -> bytes:
                far.heard()
                return message[:1] + server(far).answer(message[1:])

            self.gateway = Gateway(rig.clock, answer, rig.elapse)
            return _Link(self.gateway, response_timeout)

        super().__init__(far, DriveSettings(poll_rate=20.0, **settings), link)

    def run(self, frequency: float = 20.0) -> None:
        """Connect, enable and turn, with a program that keeps on sending the set-point."""
        self.answer(self.drive.connect())
        self.drive.activate()
        self.pass_time(0.2)
        assert 'enabled' in self.answer(self.drive.enable())
        self.send(frequency)
        self.pass_time(1.0)
        assert abs(self.far.motor.frequency - frequency) < 0.2
        self.notes.events.clear()
