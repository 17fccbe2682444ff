# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What may turn the motor, and how it is stopped.

Every command, every status that matters and every loss is an event of
:mod:`..known.control_state`. The motor follows set-points only while the state is ENABLED, to which
:meth:`Controller.enable` alone leads. All of this runs on the bus.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Coroutine
import contextlib
import math
from typing import Any

from nfo_sinus_driver.bus import Cancelled, Priority, Task
from nfo_sinus_driver.catalog import InverterStatus, Kind, Limits, Meaning, State
from nfo_sinus_driver.drive.known.control_state import ControlEvent, ControlState
from nfo_sinus_driver.drive.known.diagnosis import (
    explain_fall,
    explain_fault,
    explain_stop,
    report_of,
    require_no_fault,
)
from nfo_sinus_driver.drive.known.drive_state import LOOK_PERIOD, TIMEOUT, DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.exclusive_access import ExclusiveAccess
from nfo_sinus_driver.drive.known.steps import run_steps
from nfo_sinus_driver.drive.known.stop_reason import StopReason, reason_of
from nfo_sinus_driver.drive.motion.following import FollowingCheck
from nfo_sinus_driver.drive.motion.jam import JamCheck
from nfo_sinus_driver.drive.motion.setpoint import Setpoint
from nfo_sinus_driver.drive.motion.starting import Prepare, StartSequence
from nfo_sinus_driver.drive.motion.stopping import StopSequence
from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, Refused

#: How long a stop at the end of a release may take at least, s.
_LEAST_PATIENCE = 1.0
#: How long a motor that was released may be shown as driven still, by its voltage, s.
_RELEASED_WITHIN = 0.1

#: A stop of the drive's own kind, and why it is made.
_OwnStop = Callable[[Report], Coroutine[Any, Any, Report]]


class Controller:
    """
    Enables, stops and checks one drive.

    A :class:`DriveError` says why a command was not carried out. A stop that the drive does not
    confirm is such an error, too; it is retried until confirmed.

    :param look: as for :class:`StopSequence`.
    """

    def __init__(
        self,
        state: DriveState,
        setpoint: Setpoint,
        look: Callable[[], Awaitable[None]],
    ) -> None:
        self._bus = state.bus
        self._state = state
        chosen = state.model.profile.methods[state.settings.method]
        #: What is written for each command, for a procedure too.
        self.method = method = chosen(state.settings.reference, state.params.reaches)
        self._setpoint = setpoint
        self._control = state.control
        self._control.listen(self._changed, self._notify_stop)
        #: The task of the newest enable.
        self._enabling: Task | None = None
        #: The quick stop and the rapid stop that go on, by what makes them.
        self._own_stops: dict[_OwnStop, Task] = {}
        self._starting = StartSequence(state, method)
        self._sequence = StopSequence(state, method, look)
        self._following = FollowingCheck(state, setpoint)
        #: Whether the motor is jammed.
        self.jam = JamCheck(state, setpoint)
        #: A set-point that the drive refused: when, and why.
        self._refusal: tuple[float, Report] | None = None
        #: The last status that was checked.
        self._checked: InverterStatus | None = None
        #: When it was last seen not to run, and not to stand while its run command does.
        self._stood_at = self._ran_at = -math.inf
        #: It was lost while its motor may have been running by this driver.
        self._lost_in_use = False

    # --- the state ----------------------------------------------------------------------------

    @property
    def stop_waits(self) -> bool:
        """A stop is written until it is confirmed, or it is not clear whether the motor stops."""
        return self._sequence.waits

    @property
    def stop_overdue(self) -> bool:
        """A stop was not confirmed in time, or not at all, and no fault keeps the motor still."""
        unclear = self._sequence.unclear is not None and not self._control.commanded
        return unclear or self._sequence.overdue

    @property
    def waits_to_look(self) -> bool:
        """The drive gets no other request than its stop, and the look before it."""
        return self._sequence.waits_to_look

    @property
    def control_retained(self) -> str:
        """Why control may stay with the bus when it is released; ``''`` where it does not."""
        return self.method.control_retained or self._state.held_by_line

    @property
    def stopped_for(self) -> Report | None:
        """Why the motor was stopped last; ``None`` while it follows set-points that arrive."""
        return self._setpoint.timed_out if self._control.enabled else self._control.stopped_for

    @property
    def may_run(self) -> bool:
        """The motor runs by the bus, or may do so, or at least the bus has control."""
        status = self._state.status
        return self._control.stop_owed or status is None or status.from_bus or status.tuning

    # --- transitions --------------------------------------------------------------------------

    def _changed(self, before: ControlState) -> None:
        """Clean up after the state that was left."""
        if before is ControlState.ENABLED:
            self._setpoint.stop_following()
            self.jam.rest()
        elif before is ControlState.ENABLING:
            if not self._control.enabled and self._enabling is not self._bus.current:
                self._bus.cancel(self._enabling)
        elif before is ControlState.PROCEDURE and self._control.access is not None:
            self._control.access.abort()
        if self._control.state is ControlState.IDLE and not self._state.contact.connected:
            self._control.dispatch(ControlEvent.LOST)
        self._state.hooks.changed()

    def _notify_stop(self, why: Report) -> None:
        # after the stop of this motor is on its way
        self._bus.call(lambda: self._state.hooks.motor_stopped(why))

    def stop_because(self, why: Report) -> None:
        """Stop the motor, if this driver may run it, for a reason that its status does not show."""
        if self._control.commanded:
            self._sequence.start(why)
            self._report_stop(why)

    def exclusive(self, what: str) -> contextlib.AbstractContextManager[ExclusiveAccess]:
        """Give a procedure exclusive access; a stop ends it, during its preparations too."""
        self.require_idle(what)
        return self._control.exclusive(what)

    def require_idle(self, what: str) -> None:
        """Make sure that a procedure may begin."""
        if self._control.accepts(ControlEvent.BEGIN):
            return
        if self._control.closed:
            raise DriveError(Cause.ENDING)
        if other := self._control.procedure:
            raise DriveError(Cause.OTHER_PROCEDURE_GOES_ON, what=what, other=other)
        if self._control.commanded:
            raise DriveError(Cause.MOTOR_ENABLED, what=what)
        self._require_no_known_fault()
        raise DriveError(Cause.STOP_NOT_CONFIRMED_YET, what=what)

    def _require_no_known_fault(self) -> None:
        """Make sure that the drive had no fault last: it outlasts the stop that it causes."""
        if self._state.contact.connected and self._state.status is not None:
            require_no_fault(self._state, self._state.status)

    def require_newer(self, requested_at: float) -> None:
        """
        Make sure that no stop was confirmed since a client requested a motion, s, monotonic.

        A request for a motion and a later one for a stop may arrive in the other order. After a
        fault has stopped the motor, to request it again would not help.
        """
        if requested_at < self._control.stopped_at:
            self._require_no_known_fault()
            raise DriveError(Cause.STOPPED_SINCE_ASKED)

    async def _require_enable(self) -> None:
        """
        Make sure that an enable may begin.

        A stop that is not confirmed forbids it: the client may not know of it.
        """
        if self._control.accepts(ControlEvent.ENABLE):
            return
        if self._control.closed:
            raise DriveError(Cause.NOT_ACTIVE)
        if self._control.procedure:
            raise DriveError(Cause.PROCEDURE_GOES_ON, what=self._control.procedure)
        if self._control.state is ControlState.ENABLING:
            raise DriveError(Cause.ENABLING_ALREADY)
        if self._control.blocked:
            status = await self._state.reader.read(Priority.SERVICE)
            self._explain_refusal(status)
            require_no_fault(self._state, status)
        self._require_no_known_fault()
        raise DriveError(Cause.STOP_PENDING)

    # --- commands -----------------------------------------------------------------------------

    async def enable(self, prepare: Prepare, requested_at: float = math.inf) -> Report:
        """
        Take control and run at set-point 0, then follow set-points that arrive from now on.

        :param prepare: runs before the run command, once the bus has control.
        :param requested_at: when the client requested it, s, monotonic.
        """
        self.require_newer(requested_at)
        if self._control.enabled:
            return await self._enabled_already()
        await self._require_enable()
        self._enabling = self._bus.current
        self._control.dispatch(ControlEvent.ENABLE)
        try:
            control_mode, limits = await self._check()
            await self._start(control_mode, limits, prepare)
        except Cancelled:
            raise DriveError(Cause.STOPPED_WHILE_ENABLING) from None
        if self._state.settings.follows_setpoints:
            return Report(Cause.ENABLED)
        reference = self._state.settings.reference
        return Report(Cause.ENABLED_BY_OWN_REFERENCE, reference=reference)

    async def _enabled_already(self) -> Report:
        """Return that the motor is enabled; it may have stopped by itself since the last poll."""
        status = await self._state.reader.read(Priority.SERVICE)
        self._state.require_fresh(status)
        self.on_status(status)
        if not self._control.enabled:
            raise DriveError(self.stopped_for or Report(Cause.STOP_PENDING))
        return Report(Cause.ENABLED_ALREADY)

    async def _check(self) -> tuple[str, Limits]:
        """
        Make sure that nothing prevents a start.

        :returns: the control mode, and the limits of its set-points.
        """
        try:
            if self._refusal is not None:
                self._explain_refusal(await self._state.reader.read(Priority.SERVICE))
            await self.jam.prepare()
            return await self._starting.check()
        except Exception as error:
            self._control.dispatch(ControlEvent.REFUSED)
            raise DriveError(report_of(error)) from error

    async def _start(self, control_mode: str, limits: Limits, prepare: Prepare) -> None:
        """Start the motor and follow set-points; after an error remove the run command."""
        try:
            await self._starting.start(control_mode, prepare)
            self._control.dispatch(ControlEvent.RUNNING)
            if not self._control.enabled:
                raise Cancelled
            target = None
            if self._state.settings.follows_setpoints:
                targets = self._state.model.profile.setpoints
                target = self.method.setpoint_target(targets[control_mode])
            self._setpoint.follow(control_mode, limits, target)
            self._following.begin()
            self.jam.begin()
        except Exception as error:
            # whatever went wrong, a run command may be active by now
            self._sequence.start(Report(Cause.ENABLE_FAILED, why=report_of(error)))
            await self._settle()
            raise DriveError(report_of(error)) from error

    async def stop(self, why: Report | None = None, patience: float | None = None) -> Report:
        """
        Stop as the drive's StMode says, keep control, and return whether it ramps or coasts [C97].

        :param why: needed where something may run the motor.
        :param patience: how long the drive may take to confirm it, s.
        """
        await self._require_recognised(patience or 0.0)
        self._sequence.start(why)
        await self._sequence.wait_confirmed(patience or None)
        return await self._stopped()

    async def _stopped(self) -> Report:
        """Return how a motor stops, or what else the drive shows, once its stop is confirmed."""
        status = self._state.status
        if self._control.blocked:
            return self._state.report(Cause.STOP_BLOCKED)
        if status is not None and status.faulted and not status.driven:
            return self._state.report(Cause.STOPPED_BY_FAULT)
        if status is not None and self._sequence.forced:
            # a stop by force may have given control away
            return self._state.report(Cause.STOPPING if status.driven else Cause.STOPPED)
        if status is None or not status.from_bus:
            return self._no_control(status)
        if not status.driven:
            return self._state.report(Cause.COASTING if self._sequence.coasts else Cause.STOPPED)
        try:
            if await self._coasts(status):
                return Report(Cause.COASTING)
            if status.runs_by_bus and await self._read_run_command() is None:
                # a ramp to set-point 0 would show the same
                return Report(Cause.RAMPING_SO_FAR)
        except (LinkError, DriveError):
            # the stop is confirmed all the same
            return self._state.report(Cause.STOPPING)
        return Report(Cause.RAMPING)

    async def _read_run_command(self) -> bool | None:
        return await run_steps(self._state, self.method.has_run_command(), Priority.LOOK)

    async def _coasts(self, status: InverterStatus) -> bool:
        """Return whether a motor that is shown as driven after a stop is released all the same."""
        coasts = await self._state.coasts_to_stop()
        if coasts is not None or status.by_frequency:
            return bool(coasts)
        await self._bus.sleep(_RELEASED_WITHIN)
        return not (await self._state.reader.read(Priority.LOOK)).driven

    async def take_control(self, control_mode: str) -> None:
        """Put the drive under bus control for a procedure, with no run command active."""
        await self._starting.take_control(control_mode)

    async def in_control(self, priority: Priority) -> bool:
        """Return whether the bus has control, taken by this session or an earlier one."""
        return await run_steps(self._state, self.method.in_control(), priority)

    async def give_back(self) -> None:
        """Give control back; again from the beginning where a step that is sent once is lost."""
        try:
            await run_steps(self._state, self.method.release(), Priority.SERVICE)
        except (NoAnswer, DamagedAnswer):
            await run_steps(self._state, self.method.release(), Priority.SERVICE)

    async def _has_retained_control(self) -> bool:
        """Return whether control has stayed with the bus; true if the drive does not answer."""
        if not self._state.held_by_line:
            return bool(self.control_retained)
        try:
            return await self.in_control(Priority.SERVICE)
        except LinkError:
            return True

    async def withdraw_run_command(self, ended: Report | None) -> None:
        """Remove what a procedure has commanded, and note that it has ended; control is kept."""
        self._sequence.start(ended)
        await self._sequence.wait_confirmed()

    async def quick_stop(self, why: Report) -> Report:
        """
        Release the motor at once, so that it coasts; MODE and SCMD release control, too.

        Where the drive has no quick stop, stop as usual [C96].
        """
        if not self.method.coasts:
            return Report(Cause.NO_QUICK_STOP, stop=await self.stop(why))
        await self._require_recognised()
        return await self._one_at_once(self._quick_stop, why)

    async def _one_at_once(self, stop: _OwnStop, why: Report) -> Report:
        """
        Stop in a way of the drive's own; a call while that goes on waits for the same.

        A client may call until one call succeeds: as many stops would keep the line from those of
        other drives.
        """
        task = self._own_stops.get(stop)
        if task is None or task.future.done():
            task = self._own_stops[stop] = self._bus.spawn(_outcome(stop(why)), stops=True)
        while not await self._bus.join(task, LOOK_PERIOD):
            pass
        came: Report | Exception = task.future.result()
        if isinstance(came, Exception):
            raise came
        return came

    async def _quick_stop(self, why: Report) -> Report:
        may_run = self.may_run
        with self._sequence.external_stop(why):
            try:
                may_run = may_run or await self.in_control(Priority.STOP)
                may_run = may_run or (await self._state.reader.read(Priority.LOOK)).tuning
                if may_run:
                    await self._sequence.find()
                    steps = self.method.quick_stop(self._state.control_mode)
                    permit = self._sequence.require_same
                    await run_steps(self._state, steps, Priority.STOP, permit=permit)
                    await self._await_quick_stop(self._bus.now())
            except Exception as error:
                # even after an error in the driver the motor is stopped
                self._sequence.start()
                with contextlib.suppress(LinkError):
                    await self._state.reader.read(Priority.LOOK)
                status = self._state.status
                by_fault = status is not None and status.faulted and not status.runs_by_bus
                if isinstance(error, Refused) and by_fault:
                    return self._state.report(Cause.STOP_BLOCKED)
                raise DriveError(
                    self._state.report(Cause.QUICK_STOP_UNCONFIRMED, why=report_of(error))
                ) from error
            if not may_run:
                return self._no_control(self._state.status)
            self._sequence.start()
            await self._sequence.wait_confirmed()
            return Report(Cause.QUICK_STOPPED)

    async def rapid_stop(self, why: Report) -> Report:
        """
        Stop along the stop ramp of the drive, if it has one, else as usual; keep control.

        The stop goes on as any other, even if the request for that ramp fails.
        """
        if not self.method.stop_ramp:
            return Report(Cause.NO_RAPID_STOP, stop=await self.stop(why))
        await self._require_recognised()
        return await self._one_at_once(self._rapid_stop, why)

    async def _rapid_stop(self, why: Report) -> Report:
        with self._sequence.external_stop(why):
            with contextlib.suppress(LinkError, DriveError):
                await self._sequence.find()
                steps = self.method.rapid_stop(self._state.control_mode)
                permit = self._sequence.require_same
                await run_steps(self._state, steps, Priority.STOP, permit=permit)
            stopped = await self.stop(why)
        status = self._state.status
        if status is None or not status.driven or status.faulted:
            return stopped
        # the quick stop of PROFIdrive leads to S1, where the motor may still ramp [M3 §6]
        if status.state in (State.QUICK_STOP, State.SWITCH_ON_DISABLED):
            return self._state.report(Cause.RAPID_STOPPING)
        return self._state.report(Cause.NOT_RAPID, stop=stopped)

    async def _await_quick_stop(self, sent_at: float) -> None:
        """Wait until the motor is released."""
        # a PLC with old data goes on showing the status before
        await self._state.wait_until(
            lambda status: status.at >= sent_at and not status.driven, Priority.LOOK
        )

    async def acknowledge(self, why: Report) -> Report:
        """Acknowledge a fault; remove run command and set-point first, if the drive allows it."""
        state = self._state
        status = await state.reader.read(Priority.SERVICE)
        fault = status.listed
        if not status.faulted and fault.kind is Kind.STATUS:
            return state.report(Cause.NOTHING_TO_ACKNOWLEDGE)
        may_run = self.may_run or await self.in_control(Priority.SERVICE)
        with self._sequence.external_stop(why):
            return await self._acknowledge(status, may_run=may_run)

    async def _acknowledge(self, status: InverterStatus, *, may_run: bool) -> Report:
        state = self._state
        acknowledged = state.describe()
        if status.state is State.FAULT_REACTION_ACTIVE:
            # before FAULTED an acknowledgement has no effect [M0 table 16]
            with contextlib.suppress(DriveError):
                await self._state.wait_until(
                    lambda now: now.state is not State.FAULT_REACTION_ACTIVE, Priority.SERVICE
                )
        try:
            shown = state.model.status_code(status.code)
            # it is no stop, and does not have the priority of one: the motor might start
            steps = self.method.acknowledge(shown, state.control_mode)
            details = await run_steps(state, steps, Priority.SERVICE)
        finally:
            # even if no answer came, the drive may be free to run now
            if may_run:
                self._sequence.restart()
        try:
            await self._state.wait_until(
                lambda now: not now.faulted and now.code != status.code, Priority.SERVICE, 0.5
            )
            await self._settle()
        except DriveError:
            now = state.status or status
            report = state.report(Cause.STILL_FAULTED, fault=now.listed)
            if now.code != status.code:
                report = Report(Cause.NEXT_FAULT, acknowledged=acknowledged, still=report)
            raise DriveError(report) from None
        if details:
            return Report(Cause.ACKNOWLEDGED_DETAILED, status=acknowledged, details=details)
        return Report(Cause.ACKNOWLEDGED, status=acknowledged)

    async def release(self, timeout: float, why: Report, prepare: Prepare) -> Report:
        """
        Release control once the motor stands still.

        A motor that still ramps after ``timeout`` is left to its ramp. Only where a time-out of the
        drive would end the ramp with a fault, it is released instead.

        :param prepare: runs before, while the bus has control.
        :raises DriveError: the drive does not confirm that it stops.
        """
        await self._require_recognised()
        # a run command may be on its way, whatever has control now; and where the bus has it, one
        # may be active that an acknowledgement has not removed yet
        status = self._state.status
        may_run = self._control.stop_owed or (status is not None and status.from_bus)
        # at an end that has stopped it, one more would go ahead of the stops of other drives
        owed = self._control.stop_owed or self.stop_overdue
        ended = self._control.stopped_at >= self._control.closed_at and not owed
        if ended:
            # the last poll shows nothing of what has come since
            status = await self._state.reader.read(Priority.SERVICE)
            ended = status.from_bus and not (
                status.runs_by_bus or status.tuning or status.faulted
            )
        # no client can enable it until the motor stands still
        with self._sequence.external_stop(why):
            stop = self._stopped if ended else self.stop
            stopped = await stop() if may_run else None
            if not await self.in_control(Priority.SERVICE):
                return stopped or Report(Cause.NOT_IN_CONTROL)
            return await self._release(timeout, prepare, stopped or await stop())

    async def _release(self, timeout: float, prepare: Prepare, stopped: Report) -> Report:
        if self._control.blocked:
            raise DriveError(self._state.report(Cause.RELEASE_BLOCKED))
        stands = await self._await_standstill(timeout)
        if stands and stopped.cause is Cause.RAMPING_SO_FAR:
            stopped = Report(Cause.RAMPING)
        await prepare()
        if not stands:
            # not every drive shows whether it ramps or runs again, by a command that came late
            await self.stop(patience=_LEAST_PATIENCE)
            await self._state.timeout.read()
            if not self._state.timeout.shortest or self.control_retained:
                return Report(Cause.LEFT_TO_RAMP, stop=stopped)
            stopped = Report(Cause.COASTED_FOR_TIMEOUT)
        await self.give_back()
        if await self._has_retained_control():
            return Report(Cause.CONTROL_KEPT, stop=stopped, why=self.control_retained)
        return Report(Cause.CONTROL_RELEASED, stop=stopped)

    async def _await_standstill(self, timeout: float) -> bool:
        """
        Wait until the motor stands; return whether it does, and does not only ramp.

        :raises DriveError: its run command is still there, or it does not slow down.
        """
        until = self._bus.now() + timeout
        while True:
            left = max(until - self._bus.now(), 0.0)
            try:
                # a run command that was kept shows when the ramp is over
                await self._state.wait_until(
                    lambda now: not now.driven or now.keeps_running, Priority.SERVICE, left
                )
            except DriveError:
                return False
            status = self._state.status
            assert status is not None
            if self._stands_running(status):
                # for a moment, or while the motor is braked
                with contextlib.suppress(DriveError):
                    await self._state.wait_until(
                        lambda now: not self._stands_running(now),
                        Priority.SERVICE,
                        min(until - self._bus.now(), self._sequence.shown_for),
                    )
                status = self._state.status or status
            if not (status.keeps_running or await self._sequence.unrest(status, retry=True)):
                return True
            await self.stop(patience=max(until - self._bus.now(), _LEAST_PATIENCE))

    async def leave(self, timeout: float) -> None:
        """
        Behind a PLC, whose block keeps the last command, leave the one for a motor at standstill.

        :param timeout: how long the motor may take to stand still, s.
        """
        if not self.method.plc_time or self._control.blocked:
            return
        with contextlib.suppress(DriveError, LinkError):
            await self._state.wait_until(lambda status: not status.driven, Priority.LOOK, timeout)
            await self.give_back()

    def close(self, why: Report) -> None:
        """Stop the motor if it may run, and let nothing start it any more."""
        self._control.close()
        if self._control.stop_owed or (self.may_run and self._state.contact.is_recognised):
            self._sequence.start(why)

    async def _require_recognised(self, patience: float = 0.0) -> None:
        """
        Make sure that it is known what is to be stopped, where no stop of it is owed.

        Of one that this driver may have run, the stop goes on until the drive is there again.

        :param patience: how long to wait for one that does not answer, s.
        :raises DriveError: nothing is written to it.
        """
        until = self._bus.now() + patience
        while not self._control.stop_owed:
            try:
                await self._state.params.require_recognised()
                return
            except DriveError as error:
                silent = isinstance(error.__cause__, (NoAnswer, DamagedAnswer))
                if not silent or self._bus.now() >= until:
                    raise
            await self._bus.sleep(LOOK_PERIOD)

    # --- events of the drive ------------------------------------------------------------------

    async def stop_unexpected_run(self) -> None:
        """
        Stop a motor that runs under bus control and was not enabled since.

        Where the bus has no control, remove what would run the motor once it has.
        """
        state, status = self._state, self._state.status
        if await self.in_control(Priority.SERVICE):
            turns = status is not None and self._was_started(status)
            found = None
            # the stop of a drive that was lost may be confirmed, and its ramp not be over
            if turns and not (self._control.stopping or self._lost_in_use):
                found = state.report(Cause.FOUND_RUNNING)
                state.notify(Severity.WARNING, found)
            self._sequence.restart(found)
        else:
            await run_steps(self._state, self.method.remove_leftover(), Priority.STOP)
            if self._lost_in_use and status is not None and not status.faulted:
                why = state.report(Cause.CONTROL_LOST_WHILE_AWAY)
                state.notify(Severity.WARNING, why)
                self._control.explain(why)
        self._lost_in_use = False

    def connected(self) -> None:
        """Note that the drive is connected."""
        self._control.dispatch(ControlEvent.CONNECTED)

    def disconnected(self, why: Report) -> None:
        """Note that the drive is disconnected; stop the motor if it may still run."""
        self._control.dispatch(ControlEvent.LOST, why)
        if self._control.stopping:
            self._sequence.start()

    def lost(self, why: Report) -> bool:
        """Note that the drive is lost; return whether this driver may have run its motor."""
        self._lost_in_use = self._control.commanded or self._refusal is not None
        if self._refusal is not None:
            # no status will come to show a better reason
            (_, reason), self._refusal = self._refusal, None
            self._state.notify(Severity.WARNING, Cause.STOPPING_BECAUSE, why=reason)
        known = reason_of(why) is not StopReason.OTHER
        self._control.dispatch(ControlEvent.LOST, why if known else Report(Cause.LOST, why=why))
        if self._lost_in_use:
            self._sequence.start()
        return self._lost_in_use

    def silent(self, seconds: float) -> None:
        """Stop a motor whose drive has not answered for so long, s, that it may run anew."""
        if self._control.enabled and self._state.may_have_restarted(seconds):
            self.stop_because(Report(Cause.MAY_HAVE_RESTARTED))

    def paused(self, seconds: float) -> None:
        """Stop a motor whose drive has stopped it by itself while the driver did not run, s."""
        timeout = self._state.timeout
        if self._control.enabled and timeout.stops_motor and 0 < timeout.shortest <= seconds:
            self.stop_because(self._state.report(Cause.DRIVER_PAUSED, seconds=timeout.shortest))

    def alarmed_by(self, status: InverterStatus) -> bool:
        """Return whether a status is a reason to stop."""
        follows = self._control.enabled and status.at >= self._control.since
        return follows and self._why_stopped(status) is not None

    def _was_started(self, status: InverterStatus) -> bool:
        """Return whether the motor turns, or shows the run of a command that came over the bus."""
        # terminals may start one that stands. Whose run it is would take a read ahead of the stop
        runs = status.runs_by_bus and not status.stands_running
        return abs(status.frequency) > 0 or runs or self._stands_running(status)

    def on_status(self, status: InverterStatus) -> bool:
        """Check a status, and stop the motor if it says so; return whether that was reported."""
        self._setpoint.answered()
        before, self._checked = self._checked, status
        if self._control.blocked and not status.faulted:
            self._sequence.restart()
        if self._explain_refusal(status):
            return True
        if status.at < self._control.since:
            return False
        reason = None
        if self._control.enabled:
            reason = self._why_stopped(status) or self._why_slower(status, before)
            if reason is None and self._state.settings.follows_setpoints:
                reason = self._following.check() or self.jam.check()
        elif not self._control.stop_owed:
            reason = self._why_stopped_again(status)
        if reason is not None:
            self._sequence.start(reason)
            self._report_stop(reason)
        return reason is not None

    def _why_stopped_again(self, status: InverterStatus) -> Report | None:
        """Return why a motor is stopped that was not enabled since its last stop."""
        if self._runs_unasked(status):
            return Report(Cause.RUNS_UNASKED)
        self._ran_at = self._ran_at if self._stands_running(status) else status.at
        stood_for = status.at - max(self._ran_at, self._control.since)
        if stood_for < self._sequence.shown_for:
            return None
        return self._state.report(Cause.RUN_COMMAND_STANDS)

    def _stands_running(self, status: InverterStatus) -> bool:
        """Return whether a motor stands while its drive shows a run command."""
        return status.stands_running and not self.method.reads_run_command

    def _runs_unasked(self, status: InverterStatus) -> bool:
        self._stood_at = self._stood_at if status.keeps_running else status.at
        since = max(self._stood_at, self._control.since)
        # a current limit without a status word may be that of a ramp
        ramps = status.word is None and status.means(Meaning.CURRENT_LIMIT)
        return status.keeps_running and not (ramps and status.at - since < TIMEOUT)

    def refused(self, reason: Report) -> None:
        """Stop because of a set-point; the next status may show why it was refused."""
        if reason.cause is Cause.SETPOINT_UNACKNOWLEDGED:
            self.stop_because(reason)
            return
        self._sequence.start(reason)
        self._refusal = (self._bus.now(), reason)

    def _explain_refusal(self, status: InverterStatus) -> bool:
        if self._refusal is None or status.at <= self._refusal[0]:
            return False
        # the stop was begun when it refused; a drive with a fault refuses everything
        (_, reason), self._refusal = self._refusal, None
        if status.faulted:
            reason = explain_fault(self._state, status)
            self._control.explain(reason)
        self._report_stop(reason)
        return True

    def _report_stop(self, reason: Report) -> None:
        status = self._state.status
        if status is not None and status.faulted:
            self._state.notify(Severity.ERROR, Cause.STOPPED_BECAUSE_OF_FAULT, why=reason)
        elif reason.cause in (Cause.SETPOINT_UNACKNOWLEDGED, Cause.NOTHING_CHANGES):
            # a stop may not get there either
            self._state.notify(Severity.WARNING, Cause.STOPPING_BECAUSE, why=reason)
        else:
            self._state.notify(Severity.WARNING, Cause.STOPPED_BECAUSE, why=reason)

    async def _settle(self) -> None:
        """Wait for the confirmation of a stop, so that an enable can follow."""
        with contextlib.suppress(DriveError):
            await self._sequence.wait_confirmed()

    def _why_stopped(self, status: InverterStatus) -> Report | None:
        return explain_stop(self._state, status, self._setpoint.control_mode)

    def _why_slower(self, status: InverterStatus, before: InverterStatus | None) -> Report | None:
        turning = self._state.measurements.turning
        by_it = self._setpoint.control_mode == turning.mode
        if before is None or before.at < self._control.since or not by_it:
            return None
        reverse = self._setpoint.directed and before.frequency < 0
        least = self._setpoint.least_since(before.at, reverse=reverse)
        return explain_fall(self._state, before, status, least * turning.hertz)

    def _no_control(self, status: InverterStatus | None) -> Report:
        if status is not None and status.driven:
            raise DriveError(self._state.report(Cause.RUN_BY_OTHERS))
        return self._state.report(Cause.NO_CONTROL)


async def _outcome(stop: Awaitable[Report]) -> Report | Exception:
    """Return what a stop comes to, or why it failed: it is the same to all that wait for it."""
    try:
        return await stop
    except Exception as error:
        return error


def required(controller: Controller | None) -> Controller:
    """Return what commands a drive; a :class:`DriveError` if this driver only reads."""
    if controller is None:
        raise DriveError(Cause.MONITOR_ONLY)
    return controller
