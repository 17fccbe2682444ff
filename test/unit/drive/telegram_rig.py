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


"""A drive behind a simulated PLC, over Modbus TCP, and the judge of the manuals' tables on top."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
import contextlib
import json
from pathlib import Path
import threading
import time
from typing import Any
from unittest import mock

from drive_rig import MODEST
from drive_rig import PATIENCE
from drive_rig import Notes
from drive_rig import wait_until
from support import telegram_laws
from support.said import said

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link import LineSettings
from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.link import telegram
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.plc import PlcSetting
from nfo_sinus_driver.simulator.simulator import Simulator

MODELS = ('sinus_optimal', 'sinus_h', 'sinus_g2')
#: Longer than the machine ever rests: no test that waits for something else is lost by it.
UNHURRIED = 10.0


class TelegramRig:
    """A simulated drive, its PLC, a bus and a drive on it."""

    def __init__(
        self,
        trace: Path,
        model: str,
        *,
        plc: PlcSetting | None = None,
        response_timeout: float = 2.0,
        plc_time: float = UNHURRIED,
        **settings: Any,
    ) -> None:
        self.model = model
        self._trace = trace
        plc = plc or PlcSetting(ros_time=UNHURRIED, drive_time=UNHURRIED)
        self.simulator = Simulator(
            protocol='telegram1', model=model, trace=str(trace), plc=plc
        )
        line = LineSettings(response_timeout=response_timeout)
        self.link = open_link('modbus_tcp', self.simulator.port, line)
        self.bus = Bus(self.link)
        self.notes = Notes()
        usual = {
            'control_method': 'telegram1',
            'lost_after': UNHURRIED,
            'setpoint_timeout': 0.0,
            'poll_rate': MODEST,
        }
        self.settings = DriveSettings(model=model, **{**usual, **settings})
        self.drive = Drive(self.bus, self.settings, self.notes)
        #: Somebody waits for less than a busy machine may rest.
        self._hurried = min(plc_time, plc.ros_time, plc.drive_time) < UNHURRIED
        # as the PLC, the driver gives it the benefit of the doubt
        self._plc_time = mock.patch.object(telegram, 'PLC_TIME', plc_time)
        self._publishing = threading.Event()
        self._publisher: threading.Thread | None = None

    def start(self) -> None:
        self._plc_time.start()
        self.simulator.start()
        self.bus.start()

    def stop(self) -> None:
        self.send(None)
        self.bus.close()
        self.simulator.stop()
        self._plc_time.stop()
        found = telegram_laws.violations(self.frames, self.model)
        assert not found, found

    def connect(self) -> None:
        """Connect, activate, and wait until nothing is being stopped."""
        self.drive.connect().result(PATIENCE)
        self.drive.activate()
        wait_until(lambda: not self.drive.stop_unconfirmed)

    def enable(self) -> str:
        return said(self.drive.enable().result(PATIENCE))

    def send(self, value: float | None) -> None:
        """Publish a set-point again and again; or nothing any more."""
        self._publishing.clear()
        if self._publisher is not None:
            self._publisher.join()
            self._publisher = None
        if value is None:
            return
        self._publishing.set()

        def work() -> None:
            while self._publishing.is_set():
                with contextlib.suppress(DriveError):
                    self.drive.set_setpoint(value)
                time.sleep(1 / MODEST)

        self._publisher = threading.Thread(target=work, daemon=True)
        self._publisher.start()

    def ride(self, frequency: float = 20.0) -> None:
        """Connect, enable and turn, with a program that keeps on sending the set-point."""
        if not self.drive.snapshot.connected:
            self.connect()
        self.enable()
        self.send(frequency)

        def turns() -> bool:
            if self._hurried and not self.drive.armed:
                # the machine has rested for longer than the PLC waits
                with contextlib.suppress(DriveError):
                    self.enable()
            return abs(self.far.motor.frequency - frequency) < 0.5

        wait_until(turns)

    def answer(self, future: Future[Any]) -> str:
        """What a command answers, done or not."""
        try:
            return str(said(future.result(PATIENCE)))
        except DriveError as error:
            return str(said(error))

    @property
    def far(self) -> SimulatedDrive:
        return self.simulator.drives[1]

    @property
    def frames(self) -> list[dict[str, Any]]:
        lines = self._trace.read_text(encoding='utf-8').splitlines(keepends=True)
        return [json.loads(line) for line in lines if line.endswith('\n')]

    @property
    def words(self) -> list[int]:
        """The control words that were written, each once in a row."""
        found: list[int] = []
        for one in telegram_laws.exchanges(self.frames, 1):
            if found[-1:] != [one.stw1]:
                found.append(one.stw1)
        return found

    def stands(self) -> None:
        wait_until(lambda: not self.far.motor.driven)

    def stays(self) -> None:
        """Nothing turns although set-points keep arriving."""
        self.stands()
        count = len(self.notes.snapshots)
        wait_until(lambda: self.far.motor.driven or len(self.notes.snapshots) > count + 40)
        assert not self.far.motor.driven and not self.drive.armed


@contextlib.contextmanager
def running(rig: TelegramRig) -> Iterator[TelegramRig]:
    """Have everything stopped in the end."""
    rig.start()
    try:
        yield rig
    finally:
        rig.stop()
