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
"""Takes control of a drive and starts its motor, each step confirmed by its status."""

from __future__ import annotations

from collections.abc import Awaitable
from collections.abc import Callable
import contextlib
import time

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Fact
from nfo_sinus_driver.catalog import Meaning
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import drive_state
from nfo_sinus_driver.drive.commands import Commands
from nfo_sinus_driver.drive.diagnosis import require_no_fault
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.link import Refused


class StartSequence:
    """Starts the motor of one drive; used on the bus alone."""

    def __init__(self, inverter: DriveState, method: Commands) -> None:
        self._inverter = inverter
        self._method = method

    async def check(self) -> str:
        """
        See to it that nothing keeps the motor from being started; nothing is written.

        :returns: the control mode in which it will run.
        :raises DriveError: something does, and what to do about it.
        """
        inverter = self._inverter
        seen = await inverter.look(Priority.SERVICE)
        require_no_fault(inverter, seen)
        control_mode = await inverter.read_control_mode()
        expected = inverter.settings.expected_control_mode
        if expected and control_mode != expected:
            key = inverter.model.key(Role.CONTROL_MODE)
            raise DriveError(
                Cause.WRONG_CONTROL_MODE, mode=control_mode, expected=expected, key=key
            )
        await self._method.require_startable()
        return control_mode

    async def start(self, control_mode: str, prepare: Callable[[], Awaitable[None]]) -> None:
        """
        Take control and run at set-point 0.

        :param prepare: does what has to be done before a run command, once the bus has control.
        :raises DriveError: it does not run, and why; a run command may stand all the same.
        """
        await self.take_control(control_mode)
        await self._inverter.wait_until(lambda now: now.from_bus)
        if self._inverter.settings.follows_setpoints:
            await self._method.zero_setpoint(control_mode, Priority.SERVICE)
        await prepare()
        await self._method.run(self._await_start)
        await self._await_start(lambda now: now.runs)

    async def _await_start(self, wanted: Callable[[InverterStatus], bool]) -> None:
        """
        Wait until the drive has made a step on its way to run.

        :raises DriveError: it does not.
        """
        deadline = time.monotonic() + drive_state.TIMEOUT
        delayed = False
        while True:
            seen = await self._inverter.look(Priority.SERVICE)
            if wanted(seen):
                return
            if seen.faulted:
                raise DriveError(self._inverter.report(Cause.START_FAULTED))
            # in standby after the start delay it has forgotten the start, and must not wait for
            # another one
            if Fact.RUN_INPUT_MISSING in seen.facts or (delayed and seen.standby):
                raise DriveError(Cause.NO_RUN_INPUT)
            if seen.means(Meaning.START_DELAY) and not delayed:
                delayed = True
                deadline += await self._inverter.read_start_delay()
            if time.monotonic() > deadline:
                cause = Cause.NO_RUN_INPUT if seen.standby else Cause.NOT_STARTED
                raise DriveError(self._inverter.report(cause))
            await self._inverter.bus.sleep(drive_state.LOOK_PERIOD)

    async def take_control(self, control_mode: str) -> None:
        """
        Put the drive under bus control, with no run command standing.

        The set-point of an earlier session is removed before, where the drive lets us: one that has
        kept its run command, too, would turn the motor at once.

        :raises DriveError: it lets nobody take control.
        """
        if not self._inverter.settings_need_control:
            with contextlib.suppress(DriveError, Refused):
                await self._method.zero_setpoint(control_mode, Priority.SERVICE)
        await self._method.take_control(self._inverter.wait_until)
