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
"""Waits until the status of a drive says what is expected of it."""

from __future__ import annotations

from collections.abc import Callable
import time

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.snapshot import InverterStatus

#: How long a drive may take to do what it was told, its start delay not counted, s.
TIMEOUT = 2.0
#: How often the status is read while something is awaited, s.
LOOK_PERIOD = 0.02


class Confirmation:
    """What the status of one drive confirms; used on the bus alone."""

    def __init__(self, bus: Bus, inverter: DriveState) -> None:
        self._bus = bus
        self._inverter = inverter

    async def wait(
        self, wanted: Callable[[InverterStatus], bool], priority: Priority, timeout: float
    ) -> None:
        """
        Read the status until it is as wanted.

        :param timeout: how long it may take, s.
        :raises DriveError: it takes longer.
        """
        deadline = time.monotonic() + timeout
        while not wanted(await self._inverter.look(priority)):
            if time.monotonic() > deadline:
                raise DriveError(self._inverter.report(Cause.NOT_CONFIRMED))
            await self._bus.sleep(LOOK_PERIOD)

    async def wait_for_step(self, wanted: Callable[[InverterStatus], bool]) -> None:
        """
        Wait until the drive has done what it was told at last.

        :raises DriveError: it does not.
        """
        await self.wait(wanted, Priority.SERVICE, TIMEOUT)
