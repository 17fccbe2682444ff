# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Carries out the sequences of a family's profile on the bus.

A control method says what to write; :mod:`.controller` decides when.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import replace
import math
from typing import Any, TypeVar

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import (
    Access,
    Holder,
    InverterStatus,
    NotPossible,
    Procedure,
    Refusal,
    Removal,
    Reset,
    SetpointTarget,
    profile,
)
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.parameter_access import ParameterAccess
from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, Refused

_T = TypeVar('_T')

_Condition = Callable[[InverterStatus], bool]
#: Waits until the drive's status fulfils a condition; raises DriveError if it does not.
Reached = Callable[[_Condition], Awaitable[None]]
#: Waits for that, for some seconds at most; returns whether it came true.
Holds = Callable[[_Condition, float], Awaitable[bool]]


async def _not_reached(condition: _Condition) -> None:
    raise AssertionError('nothing is awaited here')


async def _not_awaited(condition: _Condition, seconds: float) -> bool:
    raise AssertionError('no status is awaited here')


def _not_stored(severity: Severity, report: Report) -> None:
    raise AssertionError('nothing is stored here')


async def carry_out(
    steps: profile.Steps[_T],
    params: ParameterAccess,
    priority: Priority,
    reached: Reached = _not_reached,
    notify: Callable[[Severity, Report], None] = _not_stored,
    holds: Holds = _not_awaited,
    *,
    onward: bool = False,
) -> _T:
    """
    Carry out a sequence of a profile on the bus.

    :param reached: for a sequence that waits for the drive's status between two steps.
    :param notify: for one that writes to a memory that wears out: reports what was written.
    :param holds: for one that waits for the status for a limited time.
    :param onward: go on after a step without an answer, as if it had been refused, unless it is
        a write that reading shows to have been carried out.
    :raises DriveError: it cannot be carried out.
    :raises LinkError: the drive does not answer; or it refuses, and the sequence ends by that.
    """
    brought: Any = None
    refusal: Refusal | None = None
    written_at = -math.inf

    def after_write(condition: _Condition) -> _Condition:
        # behind a PLC a status from before is shown for a while [C117]
        return lambda status: status.at > written_at and condition(status)

    while True:
        try:
            step = steps.send(brought) if refusal is None else steps.throw(refusal)
        except StopIteration as end:
            result: _T = end.value
            return result
        except Refusal as refused:
            assert isinstance(refused.__cause__, LinkError)
            raise refused.__cause__ from None
        except NotPossible as error:
            raise DriveError(Cause.NOT_POSSIBLE, why=str(error)) from error
        brought = refusal = None
        try:
            if isinstance(step, profile.Read):
                params.require_fitted(step.key)
                brought = await params.read(step.key, priority, retry=step.retry)
            elif isinstance(step, profile.Write) and step.stored:
                await _store(step, params, priority, notify)
            elif isinstance(step, profile.Write):
                await params.write(step, priority)
            elif isinstance(step, profile.Acknowledge):
                brought = await params.acknowledge(step.key, priority)
            elif isinstance(step, profile.AcknowledgeThenWrite):
                await params.acknowledge_and_write(step.key, step.write)
            elif isinstance(step, profile.Wait):
                await params.sleep(step.seconds)
            elif isinstance(step, profile.Hold):
                brought = await holds(after_write(step.condition), step.seconds)
            else:
                await reached(after_write(step.condition))
        except (Refused, NoAnswer, DamagedAnswer) as error:
            if not (onward or isinstance(error, Refused)):
                raise
            if not await _was_written(step, params, priority, error):
                named = error.naming() if isinstance(error, Refused) else error
                refusal = Refusal(str(named))
                refusal.__cause__ = named
        if isinstance(step, profile.Write):
            written_at = params.now()


async def _was_written(
    step: profile.Step, params: ParameterAccess, priority: Priority, error: LinkError
) -> bool:
    """Return whether the drive has taken a write that it did not answer, where that can be read."""
    if isinstance(error, Refused) or not isinstance(step, profile.Write):
        return False
    if params.model[step.key].access is not Access.READ_WRITE:
        return False
    address, data = params.target(step)
    try:
        return await params.read_from(address, priority, retry=False) == data
    except LinkError:
        return False


async def read_scales(state: DriveState) -> None:
    """Read the scale of speeds, and report one that is not the one before."""
    if await state.nameplate.scales.read():
        state.notify(Severity.INFO, Cause.SPEED_SCALE, scale=str(state.nameplate.scales.speed))


async def read_limits(state: DriveState, control_mode: str) -> profile.Limits:
    """
    Read what a set-point may be, in the unit of a control mode.

    :returns: no limits where the drive takes no set-points in that mode.
    """
    target = state.model.profile.setpoints.get(control_mode)
    if target is None:
        return profile.Limits()
    steps = target.read_limits(state.nameplate.has, older=state.nameplate.is_older)
    limits = await carry_out(steps, state.params, Priority.SERVICE)
    if not state.params.is_rescaled(target.key):
        return limits
    # with another scale a word may not hold all that the drive takes
    least, most, _ = state.params.limits(target.key)
    least = least if target.has_sign else -most
    return replace(limits, least=max(limits.least, least), most=min(limits.most, most))


async def _store(
    step: profile.Write,
    params: ParameterAccess,
    priority: Priority,
    notify: Callable[[Severity, Report], None],
) -> None:
    """Write to a memory that wears out, only what differs, and report it."""
    address, data = params.target(step)
    before = await params.read_from(address, priority)
    if before == data:
        return
    await params.write(step, priority)
    old, new = params.value(step.key, before), params.value(step.key, data)
    name = params.model[step.key].name
    notify(Severity.INFO, Report(Cause.STORED, key=step.key, name=name, old=old, new=new))


class ProfileRunner:
    """
    The commands of one drive, by the control method of its settings; on the bus alone.

    Each is the sequence of that name in :class:`~nfo_sinus_driver.catalog.profile.ControlMethod`.

    :raises DriveError: it cannot be carried out.
    :raises LinkError: the drive does not answer, so that the outcome is unknown; or it refuses.
    """

    def __init__(self, state: DriveState) -> None:
        self._name = state.settings.method
        #: The other control methods that this line carries.
        self._others = state.settings.other_methods(state.bus.protocol)
        method = state.model.profile.methods[state.settings.method]
        self._method = method(state.settings.reference, state.params.reaches)
        self._state = state
        self._params = state.params
        #: Why control stays with the bus on this line; ``''``: it does not.
        self._line_keeps_control = state.model.profile.holds_control.get(state.params.protocol, '')
        self._notify = state.notify
        self._wait_until = state.wait_until

    @property
    def coasts(self) -> bool:
        """It can release the motor at once."""
        return self._method.coasts

    @property
    def stop_ramp(self) -> bool:
        """It can have the drive take a stop ramp of its own."""
        return self._method.stop_ramp

    @property
    def reads_run_command(self) -> bool:
        """A status that shows a run does not say whether a run command stands."""
        return self._method.reads_run_command

    @property
    def plc_time(self) -> float:
        """How long after the driver's last message a PLC stops the drive, s; 0: no PLC."""
        return self._method.plc_time

    @property
    def control_retained(self) -> str:
        """Why control may stay with the bus at :meth:`release`; ``''`` where it does not."""
        return self._method.control_retained or self._line_keeps_control

    def require_fitted(self) -> None:
        """
        Make sure that the drive has what the control method needs.

        :raises DriveError: it lacks something; the message names the other control methods.
        """
        lacking = [key for key in self._method.needs if not self._params.reaches(key)]
        if lacking:
            names = ' and '.join(self._params.model[key].name for key in lacking)
            raise DriveError(
                Cause.METHOD_NEEDS, names=names, method=self._name, others=self._others
            )

    def setpoint_target(self, control_mode: str) -> SetpointTarget | None:
        """Return where set-points of a control mode go; ``None``: the motor follows none."""
        if not self._state.settings.follows_setpoints:
            return None
        return self._method.setpoint_target(self._params.model.profile.setpoints[control_mode])

    async def retains_control(self) -> bool:
        """Return whether control has stayed with the bus; true if the drive does not answer."""
        if not self._line_keeps_control:
            return bool(self.control_retained)
        try:
            return await self.in_control(Priority.SERVICE)
        except LinkError:
            return True

    async def in_control(self, priority: Priority) -> bool:
        """Return whether the bus has control, taken by this session or an earlier one."""
        return await carry_out(self._method.in_control(), self._params, priority)

    async def holder(self, priority: Priority) -> Holder:
        """Return who has control of the drive."""
        return await carry_out(self._method.holder(), self._params, priority)

    async def require_startable(self) -> None:
        """Make sure that nothing but a fault prevents a start; only reads."""
        await carry_out(self._method.require_startable(), self._params, Priority.SERVICE)

    async def take_control(self, reached: Reached) -> None:
        """Put the drive under bus control, with no run command active."""
        steps = self._method.take_control()
        await carry_out(steps, self._params, Priority.SERVICE, reached, self._notify)

    async def zero_setpoint(self, control_mode: str, priority: Priority) -> None:
        """Write set-point 0 in the unit of a control mode, and read it back."""
        await carry_out(self._method.zero_setpoint(control_mode), self._params, priority)

    async def run(self, reached: Reached) -> None:
        """Give the run command, once: the state before a second one would be unknown."""
        await carry_out(self._method.run(), self._params, Priority.SERVICE, reached)

    async def has_run_command(self) -> bool:
        """Return whether a run command of the bus stands in a drive that shows a run."""
        return await carry_out(self._method.has_run_command(), self._params, Priority.LOOK)

    async def stop(self, control_mode: str) -> None:
        """Remove the run command and write set-point 0, ahead of all else on the bus."""
        await carry_out(self._method.stop(control_mode), self._params, Priority.STOP)

    async def remove_leftover(self) -> None:
        """Remove a run command of an earlier session, while the bus has no control."""
        await carry_out(self._method.remove_leftover(), self._params, Priority.STOP)

    async def quick_stop(self, control_mode: str) -> None:
        """Do the quick stop of the drive, if it has one; it may release control."""
        await carry_out(self._method.quick_stop(control_mode), self._params, Priority.STOP)

    async def rapid_stop(self, control_mode: str) -> None:
        """Have the drive take its stop ramp, if it has one, ahead of all else on the bus."""
        await carry_out(self._method.rapid_stop(control_mode), self._params, Priority.STOP)

    async def force_stop(self, control_mode: str) -> bool:
        """Stop by every means left, ahead of all else; return whether the drive obeyed."""
        steps = self._method.force_stop(control_mode)
        return await carry_out(steps, self._params, Priority.STOP, onward=True)

    async def release(self) -> None:
        """Release control; again from the beginning where a step that is sent once is lost."""
        try:
            await carry_out(self._method.release(), self._params, Priority.SERVICE)
        except (NoAnswer, DamagedAnswer):
            await carry_out(self._method.release(), self._params, Priority.SERVICE)

    async def remove(self, control_mode: str) -> Removal:
        """
        Remove run command and set-point while a fault is active, each by itself [C98].

        Ahead of all else on the bus: the fault may end by itself, and the motor run on.
        """
        steps = self._method.remove(control_mode)
        return await carry_out(steps, self._params, Priority.STOP)

    async def acknowledge(self, code: int, control_mode: str) -> str:
        """Remove run command and set-point, acknowledge the fault; return its details."""
        shown = self._params.model.status_code(code)
        # it is no stop, and does not have the priority of one: the motor might start
        steps = self._method.acknowledge(shown, control_mode)
        return await carry_out(steps, self._params, Priority.SERVICE, holds=self._hold)

    async def _hold(self, condition: Callable[[InverterStatus], bool], seconds: float) -> bool:
        try:
            await self._wait_until(condition, Priority.SERVICE, seconds)
        except DriveError:
            return False
        return True

    async def begin(self, procedure: Procedure | Reset, require_wanted: Callable[[], None]) -> None:
        """
        Have the drive begin a procedure, once: the state before a second try would be unknown.

        It queues with the stops, so that no later one overtakes it; if ``require_wanted`` raises
        at its turn, nothing is written. A busy drive has done nothing, and gets it again.
        """
        write = self._method.procedures[procedure]
        await self._params.write(write, Priority.STOP, require_wanted)
