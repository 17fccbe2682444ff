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

"""A stop goes ahead of everything that waits for the bus, of whatever priority."""

from __future__ import annotations

from collections.abc import Collection
import threading

from support.addresses import register

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Event
from nfo_sinus_driver.drive import LogEntry
from nfo_sinus_driver.drive import Snapshot
from nfo_sinus_driver.drive import Telemetry
from nfo_sinus_driver.link import LineSettings
from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.simulator.simulator import Simulator

_PATIENCE = 60.0
_EACH = 20
_DRIVE_STATUS = register(0x0258, 2)
_STOP = '010602980000'


class _Deaf:
    def on_snapshot(self, snapshot: Snapshot) -> None: ...

    def on_telemetry(self, telemetry: Telemetry) -> None: ...

    def on_parameters(self, keys: Collection[str]) -> None: ...

    def on_log_entry(self, entry: LogEntry) -> None: ...

    def on_event(self, event: Event) -> None: ...


def test_a_stop_goes_ahead_of_all_that_waits(tmp_path) -> None:
    trace = tmp_path / 'trace.jsonl'
    with Simulator(baud=57600, trace=str(trace)) as simulator:
        link = open_link('modbus_rtu', simulator.port, LineSettings(57600, response_timeout=2.0))
        bus = Bus(link)
        bus.start()
        drive = Drive(bus, DriveSettings(), _Deaf())
        drive.connect().result(_PATIENCE)
        drive.activate()
        drive.enable().result(_PATIENCE)
        ended = threading.Event()

        async def flood(priority: Priority) -> None:
            while not ended.is_set():
                await bus.read(1, _DRIVE_STATUS, priority)

        others = [priority for priority in Priority if priority is not Priority.STOP]
        flooding = [bus.run(flood(priority)) for priority in others * _EACH]
        before = bus.statistics().transactions
        while bus.statistics().transactions < before + 2 * _EACH:
            pass
        asked_at = len(trace.read_text().splitlines())
        stop = drive.stop()
        stop.result(_PATIENCE)
        ended.set()
        for future in flooding:
            future.result(_PATIENCE)
        bus.close()
    lines = trace.read_text().splitlines()[asked_at:]
    requests = [line for line in lines if '"request"' in line]
    place = next(number for number, line in enumerate(requests) if _STOP in line)
    # the one under way, and those that began before this thread came to ask
    assert place <= 5, requests[: place + 1]
