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

"""The driver of a G2 on CANopen, behind a simulated LAWICEL adapter."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from pathlib import Path
import threading
import time
from typing import Any

from drive_rig import MODEST
from drive_rig import PATIENCE
from drive_rig import QUICK
from drive_rig import Notes
from drive_rig import patient
from drive_rig import wait_until
from support.said import Said
from support.said import said

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link import line_settings
from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.simulator import Simulator


class CanopenRig(contextlib.ExitStack):
    """
    A bus with simulated nodes, and the driver of each.

    :ivar simulator: hold its lock to touch the drives.
    :param options: of the simulated drives, such as the shape of the node.
    """

    def __init__(
        self,
        folder: Path,
        *,
        addresses: tuple[int, ...] = (1,),
        parameters: dict[str, Any] | None = None,
        line: dict[str, Any] | None = None,
        options: dict[str, Any] | None = None,
        response_timeout: float = 2.0,
        **settings: Any,
    ) -> None:
        super().__init__()
        settings.setdefault('lost_after', patient(settings.get('drive_timeout', 0.0)))
        settings.setdefault('setpoint_timeout', 0.0)
        line = {'boot_time': 0.2, **(line or {})}
        self.simulator = Simulator(
            addresses,
            protocol='canopen',
            link=str(folder / 'bus'),
            settings={**QUICK, **(parameters or {})},
            **line,
            **(options or {}),
        )
        self.simulator.start()
        self.callback(self.simulator.stop)
        self.bus = Bus(
            open_link(
                'canopen',
                self.simulator.port,
                line_settings('canopen', response_timeout=response_timeout),
            )
        )
        self.bus.start()
        self.callback(self.bus.close)
        self.notes = {address: Notes() for address in addresses}
        self.drives = {
            address: Drive(
                self.bus,
                DriveSettings(**{'address': address, 'poll_rate': MODEST, **settings}),
                self.notes[address],
            )
            for address in addresses
        }

    @property
    def far(self) -> SimulatedDrive:
        """The first simulated drive."""
        return next(iter(self.simulator.drives.values()))

    @property
    def drive(self) -> Drive:
        """The driver's side of it."""
        return next(iter(self.drives.values()))

    def told(self, what: Any) -> bool:
        """Whether an event of the first drive says this."""
        return next(iter(self.notes.values())).told(what)

    def connect(self) -> None:
        for drive in self.drives.values():
            drive.connect().result(PATIENCE)
            drive.activate()

    def answer(self, future: Any) -> Said:
        """What a command answers, done or not."""
        try:
            return said(future.result(PATIENCE))
        except DriveError as error:
            return said(error)

    @contextlib.contextmanager
    def turning(self, frequency: float = 10.0) -> Any:
        """Turn the first motor, with a program that goes on sending its set-point."""
        ended = threading.Event()

        def publish() -> None:
            while not ended.wait(0.02):
                self.drive.set_setpoint(frequency)

        def turns() -> bool:
            if not self.drive.armed and self.far.faults:
                # the machine has rested for longer than the drive waits
                with contextlib.suppress(DriveError):
                    self.drive.acknowledge().result(PATIENCE)
                with contextlib.suppress(DriveError):
                    self.drive.enable().result(PATIENCE)
            return abs(self.far.motor.frequency - frequency) < 0.2

        try:
            self.drive.enable().result(PATIENCE)
        except DriveError:
            if not self.far.faults:
                raise
        thread = threading.Thread(target=publish, daemon=True)
        thread.start()
        try:
            wait_until(turns)
            yield
        finally:
            ended.set()
            thread.join()

    def touch(self, action: Callable[[], object]) -> None:
        """Do something to the simulated drives."""
        with self.simulator.lock:
            action()

    def still(self, seconds: float = 0.3) -> None:
        """Wait until the motor stands, and see that it stays so although set-points go on."""
        wait_until(lambda: not self.far.motor.driven)
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            assert not self.far.motor.driven
            time.sleep(0.01)
