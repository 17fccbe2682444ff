# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Starts the motor of a drive; each step is confirmed by its status."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
import contextlib
from dataclasses import replace
import math

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import ControlMethod, Fact, InverterStatus, Limits, Meaning, Role
from nfo_sinus_driver.catalog.status import SPEED
from nfo_sinus_driver.drive.known import drive_state
from nfo_sinus_driver.drive.known.diagnosis import require_no_fault
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError
from nfo_sinus_driver.drive.known.steps import run_steps
from nfo_sinus_driver.link import Refused

#: How long the steps of a start may take together, s, delays of the drive itself aside.
_START_TIMEOUT = 4.0

#: Runs before the motor is energised.
Prepare = Callable[[], Awaitable[None]]


async def read_limits(state: DriveState, control_mode: str) -> Limits:
    """
    Read what a set-point may be, in the unit of a control mode.

    :returns: no limits where the drive takes no set-points in that mode.
    """
    target = state.model.profile.setpoints.get(control_mode)
    if target is None:
        return Limits()
    steps = target.read_limits(state.nameplate.has, older=state.nameplate.is_older)
    limits = await run_steps(state, steps, Priority.SERVICE)
    if not state.params.is_rescaled(target.key):
        return limits
    # with another scale a word may not hold all that the drive takes
    least, most, _ = state.params.limits(target.key)
    least = least if target.has_sign else -most
    return replace(limits, least=max(limits.least, least), most=min(limits.most, most))


class _StepTime:
    """
    The time for a step of a start, with the delays of the drive itself.

    :param deadline: when it has to be over without them, s of the clock of the bus.
    """

    def __init__(self, state: DriveState, deadline: float) -> None:
        self._state = state
        self._deadline = deadline
        self._delay: float | None = None
        self._braking: float | None = None

    @property
    def added(self) -> float:
        """The delays of the drive itself, as far as they were read, s."""
        return (self._delay or 0.0) + (self._braking or 0.0)

    async def is_over(self, status: InverterStatus) -> bool:
        """Return whether the time of a drive with this status is over."""
        if self._delay is None and status.means(Meaning.START_DELAY):
            self._delay = await self._state.read_start_delay()
        if self._braking is None and self._is_late(status):
            # no manual says what it shows while it brakes the motor before the start [C122]
            self._braking = await self._state.read_start_braking()
        return self._is_late(status)

    def _is_late(self, status: InverterStatus) -> bool:
        # in standby after the start delay, or without control, it has forgotten the start, and must
        # not wait for another one
        in_standby = status.standby and not self._braking
        forgotten = self._delay is not None and (in_standby or not status.from_bus)
        return forgotten or self._state.bus.now() > self._deadline + self.added


class StartSequence:
    """Starts the motor of one drive, or says in a :class:`DriveError` why not; on the bus alone."""

    def __init__(self, state: DriveState, method: ControlMethod) -> None:
        self._state = state
        self._method = method
        #: When the start has to be over, s of the clock of the bus.
        self._deadline = math.inf

    async def check(self) -> tuple[str, Limits]:
        """
        Make sure that the motor may be started, writing nothing.

        :returns: the control mode, and the limits of its set-points.
        """
        state = self._state
        status = await state.reader.read(Priority.SERVICE)
        require_no_fault(state, status)
        control_mode = await state.read_control_mode()
        expected = state.settings.expected_control_mode
        if state.params.in_block and control_mode not in state.model.profile.setpoints:
            expected = expected or next(iter(state.model.profile.setpoints))
        if expected and control_mode != expected:
            key = state.model.key(Role.CONTROL_MODE)
            raise DriveError(
                Cause.WRONG_CONTROL_MODE, mode=control_mode, expected=expected, key=key
            )
        await run_steps(state, self._method.require_startable(), Priority.SERVICE)
        # the keypad may have changed it since the drive was connected
        await state.nameplate.read_scales()
        scales = state.nameplate.scales
        if key := scales.impossible:
            raise DriveError(Cause.SCALE_IMPOSSIBLE, key=key, value=scales.found[key])
        if control_mode == SPEED.mode:
            await self._require_no_scale()
        return control_mode, await read_limits(state, control_mode)

    async def _require_no_scale(self) -> None:
        """Ensure that nothing multiplies speeds that is not followed, where it can be read."""
        params = self._state.params
        keys = self._state.settings.method_class.unfollowed_scale
        if not keys or not all(map(params.reaches, keys)):
            return
        above, below = [await params.read_number(key, Priority.SERVICE) for key in keys]
        # one that is impossible is none [C114]
        if above != below and min(above, below) > 0:
            raise DriveError(
                Cause.SCALE_NOT_FOLLOWED,
                above=keys[0],
                below=keys[1],
                value=f'{above:g}/{below:g}',
                key=self._state.model.key(Role.CONTROL_MODE),
            )

    async def start(self, control_mode: str, prepare: Prepare) -> None:
        """
        Take control and run at set-point 0; even after an error a run command may be active.

        :param prepare: runs before the run command, once the bus has control.
        """
        await self.take_control(control_mode)
        await self._await_status(lambda now: now.from_bus)
        if self._state.settings.follows_setpoints:
            await self._zero_setpoint(control_mode)
        begun = self._state.bus.now()
        await prepare()
        self._deadline += self._state.bus.now() - begun
        run = self._method.run()
        await run_steps(self._state, run, Priority.SERVICE, self._await_start)
        run_at = self._state.bus.now()
        # behind a PLC a status from before the run command is shown for a while
        await self._await_start(lambda now: now.may_run and now.at > run_at)

    async def _await_status(self, wanted: Callable[[InverterStatus], bool]) -> None:
        """Wait for a step that every drive makes soon."""
        left = self._deadline - self._state.bus.now()
        await self._state.wait_until(wanted, timeout=min(left, drive_state.TIMEOUT))

    async def _await_start(self, wanted: Callable[[InverterStatus], bool]) -> None:
        """Wait until the drive has made a step on its way to run."""
        state = self._state
        step = _StepTime(state, min(state.bus.now() + drive_state.TIMEOUT, self._deadline))
        while not wanted(status := await state.reader.read(Priority.SERVICE)):
            if status.faulted:
                raise DriveError(state.report(Cause.START_FAULTED))
            if Fact.RUN_INPUT_MISSING in status.facts:
                raise DriveError(state.report(Cause.NO_RUN_INPUT))
            if await step.is_over(status):
                raise DriveError(state.report(self._why_not_started(status)))
            await state.bus.sleep(drive_state.LOOK_PERIOD)
        self._deadline += step.added

    def _why_not_started(self, status: InverterStatus) -> Cause:
        # one that reports its RUN input reports that it is active [C90]
        if not status.standby or Fact.RUN_INPUT_MISSING in status.valid:
            return Cause.NOT_STARTED
        has_one = self._state.model.profile.has_enable_input
        return Cause.NO_RUN_INPUT if has_one else Cause.STAYS_IN_STANDBY

    async def take_control(self, control_mode: str) -> None:
        """
        Put the drive under bus control, with no run command active.

        The set-point of an earlier session is removed first, if the drive allows it: with a run
        command that is left, too, it would turn the motor at once.
        """
        self._deadline = self._state.bus.now() + _START_TIMEOUT
        if not self._state.nameplate.is_older:
            with contextlib.suppress(DriveError, Refused):
                await self._zero_setpoint(control_mode)
        steps = self._method.take_control()
        await run_steps(self._state, steps, Priority.SERVICE, self._await_status)

    async def _zero_setpoint(self, control_mode: str) -> None:
        steps = self._method.zero_setpoint(control_mode)
        await run_steps(self._state, steps, Priority.SERVICE)
