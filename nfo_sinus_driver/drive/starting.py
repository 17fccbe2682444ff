# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Starts the motor of a drive; each step is confirmed by its status."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
import contextlib
import math

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Fact, InverterStatus, Limits, Meaning, Role
from nfo_sinus_driver.drive import drive_state
from nfo_sinus_driver.drive.commands import Commands, read_limits, read_scales
from nfo_sinus_driver.drive.diagnosis import require_no_fault
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause, DriveError
from nfo_sinus_driver.link import Refused

#: How long all that a start waits for may take together, s, the start delay of the drive aside.
_START_TIMEOUT = 4.0


class StartSequence:
    """Starts the motor of one drive, or says in a :class:`DriveError` why not; on the bus alone."""

    def __init__(self, inverter: DriveState, method: Commands) -> None:
        self._inverter = inverter
        self._method = method
        #: When the start has to be over, s of the clock of the bus.
        self._deadline = math.inf

    async def check(self) -> tuple[str, Limits]:
        """
        See to it that the motor may be started, writing nothing.

        :returns: the control mode, and what its set-points may be.
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
        # it may have been changed since the drive was connected, at its keypad
        await read_scales(inverter)
        return control_mode, await read_limits(inverter, control_mode)

    async def start(self, control_mode: str, prepare: Callable[[], Awaitable[None]]) -> None:
        """
        Take control and run at set-point 0; after an error a run command may stand all the same.

        :param prepare: does what has to be done before a run command, once the bus has control.
        """
        await self.take_control(control_mode)
        await self._await_status(lambda now: now.from_bus)
        if self._inverter.settings.follows_setpoints:
            await self._method.zero_setpoint(control_mode, Priority.SERVICE)
        await prepare()
        await self._method.run(self._await_start)
        run_at = self._inverter.bus.now()
        # behind a PLC a status from before the run command is shown for a while
        await self._await_start(lambda now: now.runs and now.at > run_at)

    async def _await_status(self, wanted: Callable[[InverterStatus], bool]) -> None:
        """Wait for a step that every drive makes soon."""
        left = self._deadline - self._inverter.bus.now()
        await self._inverter.wait_until(wanted, timeout=min(left, drive_state.TIMEOUT))

    async def _await_start(self, wanted: Callable[[InverterStatus], bool]) -> None:
        """Wait until the drive has made a step on its way to run."""
        deadline = min(self._inverter.bus.now() + drive_state.TIMEOUT, self._deadline)
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
                raise DriveError(self._inverter.report(Cause.NO_RUN_INPUT))
            if seen.means(Meaning.START_DELAY) and not delayed:
                delayed = True
                delay = await self._inverter.read_start_delay()
                self._deadline += delay
                deadline += delay
            if self._inverter.bus.now() > deadline:
                cause = Cause.NO_RUN_INPUT if seen.standby else Cause.NOT_STARTED
                raise DriveError(self._inverter.report(cause))
            await self._inverter.bus.sleep(drive_state.LOOK_PERIOD)

    async def take_control(self, control_mode: str) -> None:
        """
        Put the drive under bus control, with no run command standing.

        The set-point of an earlier session is removed before, where the drive lets us: one that has
        kept its run command, too, would turn the motor at once.
        """
        self._deadline = self._inverter.bus.now() + _START_TIMEOUT
        if not self._inverter.settings_need_control:
            with contextlib.suppress(DriveError, Refused):
                await self._method.zero_setpoint(control_mode, Priority.SERVICE)
        await self._method.take_control(self._await_status)
