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

"""What a transaction costs the computer, in function calls: no more with many drives."""

from __future__ import annotations

from collections.abc import Collection
import sys
from types import FrameType
from typing import Any

from any_order_rig import Clock
from support.addresses import register

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Event
from nfo_sinus_driver.drive import LogEntry
from nfo_sinus_driver.drive import Snapshot
from nfo_sinus_driver.drive import Telemetry
from nfo_sinus_driver.link import rtu
from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.link.modbus_pdu import read_of
from nfo_sinus_driver.link.rtu import RtuLink
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.modbus_frames import ModbusRtu

_TRANSACTIONS = 800
_TURNAROUND = 0.002


class Nobody:
    """Listens to nothing."""

    def on_snapshot(self, snapshot: Snapshot) -> None:
        pass

    def on_telemetry(self, telemetry: Telemetry) -> None:
        pass

    def on_parameters(self, keys: Collection[str]) -> None:
        pass

    def on_log_entry(self, entry: LogEntry) -> None:
        pass

    def on_event(self, event: Event) -> None:
        pass


class Line:
    """
    A port with many drives behind it, each read of which is answered as it was at first.

    :ivar requests: how many frames were sent.
    """

    def __init__(self, clock: Clock, settings: LineSettings) -> None:
        self._clock = clock
        self._settings = settings
        self._protocol = ModbusRtu()
        self._drives: dict[int, SimulatedDrive] = {}
        self._reads: dict[bytes, bytes] = {}
        self._answer = b''
        self._answered_at = 0.0
        self.requests = 0

    def open(self) -> None:
        pass

    def close(self) -> None:
        pass

    def write(self, data: bytes) -> None:
        self.requests += 1
        self._answer = self._reads.get(data, b'') or self._ask(data)
        length = len(data) + len(self._answer)
        self._answered_at = self._clock.now + length * self._settings.char_time + _TURNAROUND

    def read(self, until: float) -> bytes:
        came = b''
        if self._answer and self._answered_at <= until:
            self._clock.now = max(self._answered_at, self._clock.now)
            came, self._answer = self._answer, b''
        else:
            self._clock.now = max(until, self._clock.now)
        return came

    def _ask(self, data: bytes) -> bytes:
        unit = data[0]
        if unit not in self._drives:
            self._drives[unit] = simulated_drive(address=unit, boot_time=0.0)
            self._drives[unit].advance(1.0)
        request = self._protocol.unwrap(data)
        assert request is not None
        answer = self._protocol.answer(self._drives[unit], request)
        if data[1] == 3:
            self._reads[data] = answer
        return answer


class Counter:
    """Counts what the driver calls, built-in functions too, but not what the line does."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        where = frame.f_code.co_filename
        if event in ('call', 'c_call') and 'nfo_sinus_driver' in where and 'simulator' not in where:
            self.calls += 1


def calls_per_transaction(drives: int) -> float:
    """Return what a transaction costs while drives are polled as fast as the line allows."""
    clock, settings = Clock(), LineSettings(baud_rate=57600)
    line = Line(clock, settings)
    bus = Bus(RtuLink(line, settings, clock.monotonic), now=clock.monotonic)
    made = [Drive(bus, DriveSettings(address=n + 1), Nobody()) for n in range(drives)]

    def step() -> None:
        until = bus.step()
        if clock.now < until < clock.now + 10:
            clock.now = until

    connected = [drive.connect() for drive in made]
    while not all(future.done() for future in connected):
        step()
    for drive in made:
        drive.activate()
    begun = line.requests
    while line.requests < begun + 40 * drives:
        step()
    begun, counter = line.requests, Counter()
    sys.setprofile(counter)
    try:
        while line.requests < begun + _TRANSACTIONS:
            step()
    finally:
        sys.setprofile(None)
    bus.close()
    return counter.calls / _TRANSACTIONS


def test_a_transaction_costs_no_more_with_many_drives() -> None:
    alone = calls_per_transaction(1)
    among_many = calls_per_transaction(24)
    assert among_many <= 1.1 * alone


def test_a_request_that_comes_again_is_prepared_once() -> None:
    frame = rtu.encode(read_of(7, register(0x258, 2)))
    assert rtu.encode(read_of(7, register(0x258, 2))) is frame
    kept = rtu.encode.cache_info().maxsize
    assert kept is not None
    for unit in range(kept // 8 + 1):
        for number in range(8):
            rtu.encode(read_of(unit % 248, register(0x400 + unit // 248 * 8 + number)))
    assert rtu.encode.cache_info().currsize <= kept
