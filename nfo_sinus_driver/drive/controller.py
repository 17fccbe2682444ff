# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Who may make the motor turn, and how it is made to stop.

The controller of a drive turns the table of :mod:`.control_state`: every command, everything that
the status tells and every loss is an event in it. The motor follows set-points only while the state
is ENABLED, to which a person's :meth:`Controller.enable` alone leads. All of this runs on the bus.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator
import contextlib
import math

from nfo_sinus_driver.bus import Cancelled, Priority, Task
from nfo_sinus_driver.catalog import InverterStatus, Kind, Limits, State
from nfo_sinus_driver.drive import control_state
from nfo_sinus_driver.drive.commands import Commands
from nfo_sinus_driver.drive.control_state import COMMANDED, ControlEvent, ControlState
from nfo_sinus_driver.drive.diagnosis import (
    explain_fall,
    explain_fault,
    explain_stop,
    report_of,
    require_no_fault,
)
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.following import Following
from nfo_sinus_driver.drive.sequences import StartSequence, StopSequence
from nfo_sinus_driver.drive.setpoint import Setpoint
from nfo_sinus_driver.link import LinkError, Refused


class ExclusiveAccess:
    """The drive in the hands of a procedure, such as a tuning, whose name is ``what``."""

    def __init__(self, what: str) -> None:
        self.what = what
        self._aborted = False

    @property
    def aborted(self) -> bool:
        """The procedure shall stop what it does, or not begin it."""
        return self._aborted

    def abort(self) -> None:
        """Have the procedure stop."""
        self._aborted = True

    def require_wanted(self) -> None:
        """Raise a :class:`DriveError` if somebody has stopped the procedure meanwhile."""
        if self._aborted:
            raise DriveError(Cause.PROCEDURE_NOT_BEGUN, what=self.what)


class Controller:
    """
    Enables, stops and judges one drive.

    What a person asks for says in a :class:`DriveError` why it was not done. A stop that the drive
    does not confirm is such an error, too; it is retried until it does.
    """

    def __init__(self, state: DriveState, method: Commands, setpoint: Setpoint) -> None:
        self._bus = state.bus
        self._state = state
        #: How the drive is commanded, for a procedure too.
        self.method = method
        self._setpoint = setpoint
        self._state = ControlState.OFFLINE
        #: When something happened last: what was read before says nothing of it.
        self._since = 0.0
        #: When a stop was confirmed last.
        self._stopped_at = -math.inf
        #: What enables, and who has the drive, while there is one.
        self._enabling: Task | None = None
        self._access: ExclusiveAccess | None = None
        self._starting = StartSequence(state, method)
        self._sequence = StopSequence(state, method, self._happened)
        self._following = Following(state, setpoint)
        #: A set-point that the drive did not take: when, and what it answered.
        self._refusal: tuple[float, Report] | None = None
        #: The status that was judged last.
        self._judged: InverterStatus | None = None
        #: It was lost while it may have followed us.
        self._lost_in_use = False

    # --- where it stands ----------------------------------------------------------------------

    @property
    def state(self) -> ControlState:
        """What the driver is doing with the drive."""
        return self._state

    @property
    def enabled(self) -> bool:
        """The motor follows set-points, or the reference of the drive."""
        return self._state is ControlState.ENABLED

    @property
    def stopping(self) -> bool:
        """A stop is not confirmed yet."""
        return self._sequence.active

    @property
    def blocked_by_fault(self) -> bool:
        """The motor stands by a fault, and the drive refuses the stop until it is acknowledged."""
        return self._sequence.blocked_by_fault

    @property
    def stop_overdue(self) -> bool:
        """A stop is not confirmed although there was time; no fault keeps the motor still."""
        return self._sequence.overdue

    @property
    def commanded(self) -> bool:
        """Something that the driver has begun may drive the motor."""
        return self._state in COMMANDED

    @property
    def changing(self) -> bool:
        """The driver is waiting for the drive to say something else than before."""
        return self.stopping or (self.commanded and not self.enabled)

    @property
    def may_run(self) -> bool:
        """The motor runs by us, or may do so, or at least the bus has control of it."""
        status = self._state.status
        commanded = self.commanded or self.stopping
        return commanded or status is None or status.from_bus or status.tuning

    # --- the table ----------------------------------------------------------------------------

    def _happened(self, event: ControlEvent) -> None:
        """Turn the table by one event, and do what leaving a state means."""
        before = self._state
        self._state = control_state.TRANSITIONS.get((before, event), before)
        self._since = self._bus.now()
        if event is ControlEvent.STOPPED:
            self._stopped_at = self._since
        if self._state is before:
            return
        if before is ControlState.ENABLED:
            self._setpoint.stop_following()
        gone = before is ControlState.ENABLING and self._state is not ControlState.ENABLED
        if gone and self._enabling not in (None, self._bus.current):
            self._bus.cancel(self._enabling)
        if self._access is not None and self._state is not ControlState.PROCEDURE:
            self._access.abort()
        self._catch_up()

    def _catch_up(self) -> None:
        """See to it that IDLE is what is left: a stop may be pending, or the drive be lost."""
        if self._state is not ControlState.IDLE:
            return
        if self.blocked_by_fault:
            self._happened(ControlEvent.STOP)
            self._happened(ControlEvent.FAULT_BLOCKS)
        elif self.stopping:
            self._happened(ControlEvent.STOP)
        elif not self._state.connected:
            self._happened(ControlEvent.LOST)

    def _stop(self, *, anew: bool = False) -> None:
        """End what drives the motor; ``anew``: what attempts show that have begun counts not."""
        self._happened(ControlEvent.STOP)
        if anew:
            self._sequence.request_anew()
        else:
            self._sequence.request()

    @contextlib.contextmanager
    def _stopped_by_itself(self) -> Iterator[None]:
        """Be stopping while something goes on that stops the motor in its own way."""
        with self._sequence.held():
            self._happened(ControlEvent.STOP)
            yield

    @contextlib.contextmanager
    def exclusive(self, what: str) -> Iterator[ExclusiveAccess]:
        """Have the drive for a procedure: whoever stops it ends that, and its preparations."""
        self.require_idle(what)
        self._access = access = ExclusiveAccess(what)
        self._happened(ControlEvent.BEGIN)
        try:
            yield access
        finally:
            self._access = None
            self._happened(ControlEvent.END)

    def require_idle(self, what: str) -> None:
        """See to it that a procedure may begin."""
        if (self._state, ControlEvent.BEGIN) in control_state.TRANSITIONS:
            return
        if self._access is not None:
            other = self._access.what
            raise DriveError(Cause.OTHER_PROCEDURE_GOES_ON, what=what, other=other)
        if self.commanded:
            raise DriveError(Cause.MOTOR_ENABLED, what=what)
        if self._state is ControlState.CLOSED:
            raise DriveError(Cause.ENDING)
        if self.blocked_by_fault and self._state.status is not None:
            require_no_fault(self._state, self._state.status)
        raise DriveError(Cause.STOP_NOT_CONFIRMED_YET, what=what)

    def require_newer(self, requested_at: float) -> None:
        """
        See to it that no stop was confirmed since somebody asked for a motion, s, monotonic.

        Whoever asks for one thing and then for a stop may be heard in the other order.
        """
        if requested_at < self._stopped_at:
            raise DriveError(Cause.STOPPED_SINCE_ASKED)

    async def _require_enable(self) -> None:
        """
        See to it that an enable may begin.

        A stop that nobody has confirmed forbids it: who enables may not know of that.
        """
        if (self._state, ControlEvent.ENABLE) in control_state.TRANSITIONS:
            return
        if self._enabling is not None:
            raise DriveError(Cause.ENABLING_ALREADY)
        if self._access is not None:
            raise DriveError(Cause.PROCEDURE_GOES_ON, what=self._access.what)
        if self._state is ControlState.CLOSED:
            raise DriveError(Cause.NOT_ACTIVE)
        if self.blocked_by_fault:
            status = await self._state.read_status(Priority.SERVICE)
            self._explain_refusal(status)
            require_no_fault(self._state, status)
        raise DriveError(Cause.STOP_PENDING)

    # --- what a person asks for ---------------------------------------------------------------

    async def enable(
        self, prepare: Callable[[], Awaitable[None]], requested_at: float = math.inf
    ) -> Report:
        """
        Take control and run at set-point 0, then follow set-points that arrive from now on.

        :param prepare: does what has to be done before a run command, once the bus has control.
        :param asked_at: when somebody asked for it, s, monotonic.
        """
        self.require_newer(requested_at)
        if self.enabled:
            return Report(Cause.ENABLED_ALREADY)
        await self._require_enable()
        self._enabling = self._bus.current
        self._happened(ControlEvent.ENABLE)
        try:
            control_mode, limits = await self._check()
            await self._start(control_mode, limits, prepare)
        except Cancelled:
            raise DriveError(Cause.STOPPED_WHILE_ENABLING) from None
        finally:
            self._enabling = None
        if self._state.settings.follows_setpoints:
            return Report(Cause.ENABLED)
        reference = self._state.settings.reference
        return Report(Cause.ENABLED_BY_OWN_REFERENCE, reference=reference)

    async def _check(self) -> tuple[str, Limits]:
        """
        See to it that nothing keeps the motor from being started.

        :returns: the control mode, and what its set-points may be.
        """
        try:
            if self._refusal is not None:
                self._explain_refusal(await self._state.read_status(Priority.SERVICE))
            return await self._starting.check()
        except Exception as error:
            self._happened(ControlEvent.REFUSED)
            raise DriveError(report_of(error)) from error

    async def _start(
        self, control_mode: str, limits: Limits, prepare: Callable[[], Awaitable[None]]
    ) -> None:
        """Start the motor, and follow set-points from then on; else remove the run command."""
        try:
            await self._starting.start(control_mode, prepare)
            self._happened(ControlEvent.RUNNING)
            if not self.enabled:
                raise Cancelled
            self._setpoint.follow(control_mode, limits)
            self._following.begin()
        except Exception as error:
            # whatever went wrong, a run command may stand by now
            self._stop()
            await self._settle()
            raise DriveError(report_of(error)) from error

    async def stop(self, patience: float | None = None) -> Report:
        """
        Stop as the drive's StMode says; control is kept. Tells whether it ramps or coasts [C97].

        :param patience: how long the drive may take to confirm it, s.
        """
        self._stop()
        await self._sequence.wait_confirmed(patience or None)
        status = self._state.status
        if self.blocked_by_fault:
            return self._state.report(Cause.STOP_BLOCKED)
        if status is not None and status.faulted and not status.driven:
            return self._state.report(Cause.STOPPED_BY_FAULT)
        if status is not None and self._sequence.forced:
            # control may have been taken away by that
            return self._state.report(Cause.STOPPING if status.driven else Cause.STOPPED)
        if status is None or not status.from_bus:
            return self._no_control(status)
        if not status.driven:
            return self._state.report(Cause.STOPPED)
        try:
            coasts = await self._state.coasts_to_stop()
        except LinkError:
            # the stop is confirmed all the same
            return self._state.report(Cause.STOPPING)
        return Report(Cause.COASTING if coasts else Cause.RAMPING)

    async def take_control(self, control_mode: str) -> None:
        """Put the drive under bus control for a procedure, with no run command standing."""
        await self._starting.take_control(control_mode)

    async def withdraw_run_command(self) -> None:
        """Remove what a procedure has commanded; control is kept."""
        self._sequence.request()
        await self._sequence.wait_confirmed()

    async def quick_stop(self) -> Report:
        """
        Release the motor at once: it coasts; by MODE and SCMD control is given back, too.

        Where the drive has no way to do that, stop as usual [C96].
        """
        if not self.method.coasts:
            return Report(Cause.NO_QUICK_STOP, stop=await self.stop())
        may_run = self.may_run
        with self._stopped_by_itself():
            try:
                may_run = may_run or await self.method.in_control(Priority.STOP)
                may_run = may_run or (await self._state.read_status(Priority.LOOK)).tuning
                if may_run:
                    await self.method.quick_stop(self._state.control_mode)
                    told_at = self._bus.now()
                    # a PLC whose data stand still goes on showing what was before
                    await self._state.wait_until(
                        lambda status: status.at >= told_at and not status.driven, Priority.LOOK
                    )
            except Exception as error:
                # even after a mistake of ours the motor is not left as it is
                self._sequence.request()
                with contextlib.suppress(LinkError):
                    await self._state.read_status(Priority.LOOK)
                status = self._state.status
                by_fault = status is not None and status.faulted and not status.runs_by_bus
                if isinstance(error, Refused) and by_fault:
                    return self._state.report(Cause.STOP_BLOCKED)
                raise DriveError(
                    self._state.report(Cause.QUICK_STOP_UNCONFIRMED, why=report_of(error))
                ) from error
            if not may_run:
                return self._no_control(self._state.status)
            self._sequence.request()
            await self._settle()
            return Report(Cause.QUICK_STOPPED)

    async def acknowledge(self) -> Report:
        """Acknowledge a fault, run command and set-point first, where the drive lets us."""
        state = self._state
        status = await state.read_status(Priority.SERVICE)
        fault = status.listed
        if not status.faulted and fault.kind is Kind.STATUS:
            return state.report(Cause.NOTHING_TO_ACKNOWLEDGE)
        may_run = self.may_run or await self.method.in_control(Priority.SERVICE)
        with self._stopped_by_itself():
            return await self._acknowledge(status, may_run=may_run)

    async def _acknowledge(self, status: InverterStatus, *, may_run: bool) -> Report:
        state = self._state
        acknowledged = state.describe()
        if status.state is State.FAULT_REACTION_ACTIVE:
            # what comes before FAULTED acknowledges nothing [M0 table 16]
            with contextlib.suppress(DriveError):
                await self._state.wait_until(
                    lambda now: now.state is not State.FAULT_REACTION_ACTIVE, Priority.SERVICE
                )
        try:
            details = await self.method.acknowledge(status.code, state.control_mode)
        finally:
            # even if no answer came, the drive may be free to run now
            if may_run:
                self._sequence.request_anew()
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

    async def release(self, timeout: float) -> Report:
        """
        Give control back once the motor stands.

        A motor that still ramps after ``timeout`` is left to its ramp. Only if the drive has a
        time-out of its own that goes on it is released, for else that would end the ramp with a
        fault.

        :raises DriveError: the drive does not confirm that it stops.
        """
        # a run command may be on its way, whoever has control at this moment; and where the bus has
        # it, one may stand that an acknowledgement has not come to remove yet
        status = self._state.status
        may_run = self.commanded or self.stopping or (status is not None and status.from_bus)
        # nobody enables it while it is waited for that the motor stands
        with self._stopped_by_itself():
            return await self._release(timeout, may_run=may_run)

    async def _release(self, timeout: float, *, may_run: bool) -> Report:
        stopped = await self.stop() if may_run else None
        if not await self.method.in_control(Priority.SERVICE):
            return stopped or Report(Cause.NOT_IN_CONTROL)
        stopped = stopped or await self.stop()
        if self.blocked_by_fault:
            raise DriveError(self._state.report(Cause.RELEASE_BLOCKED))
        try:
            await self._state.wait_until(lambda status: not status.driven, Priority.SERVICE, timeout)
        except DriveError:
            await self._state.timeout.read()
            if not self._state.timeout.shortest or self.method.control_retained:
                return Report(Cause.LEFT_TO_RAMP, stop=stopped)
            stopped = Report(Cause.COASTED_FOR_TIMEOUT)
        await self.method.release()
        if await self.method.kept():
            return Report(Cause.CONTROL_KEPT, stop=stopped, why=self.method.control_retained)
        return Report(Cause.CONTROL_RELEASED, stop=stopped)

    async def leave(self, timeout: float) -> None:
        """
        Behind a PLC, whose block keeps the last word, leave it that of a motor that stands.

        :param timeout: how long the motor may take to stand, s.
        """
        if not self.method.plc_time or self.blocked_by_fault:
            return
        with contextlib.suppress(DriveError, LinkError):
            await self._state.wait_until(lambda status: not status.driven, Priority.LOOK, timeout)
            await self.method.release()

    def close(self) -> None:
        """Stop the motor if it may run, and let nothing start it any more."""
        # first, for another thread may look in between, and no stop would be pending
        if self.may_run:
            self._sequence.request()
        self._happened(ControlEvent.CLOSE)

    # --- what happens by itself ---------------------------------------------------------------

    async def secure_found(self) -> None:
        """Make sure that nothing runs under bus control that nobody has enabled since."""
        state, status = self._state, self._state.status
        if await self.method.in_control(Priority.SERVICE):
            turns = status is not None and (status.runs_by_bus or abs(status.frequency) > 0)
            if turns and not self.stopping:
                state.tell(Severity.WARNING, state.report(Cause.FOUND_RUNNING))
            self._stop(anew=True)
        elif self._lost_in_use and status is not None and not status.faulted:
            state.tell(Severity.WARNING, state.report(Cause.CONTROL_LOST_WHILE_AWAY))
        self._lost_in_use = False

    def connected(self) -> None:
        """Take note that the drive is connected."""
        self._happened(ControlEvent.CONNECTED)

    def disconnected(self) -> None:
        """Take note that the drive is left alone; what still drives the motor is stopped."""
        commanded = self.commanded
        self._happened(ControlEvent.LOST)
        if commanded:
            self._stop()

    def lost(self) -> bool:
        """Take note that the drive does not answer any more; true if it may have followed us."""
        self._lost_in_use = self.commanded or self._refusal is not None
        if self._refusal is not None:
            # no status will come that could tell a better reason
            (_, reason), self._refusal = self._refusal, None
            self._state.tell(Severity.WARNING, Cause.STOPPING_BECAUSE, why=reason)
        self._happened(ControlEvent.LOST)
        if self._lost_in_use:
            self._stop()
        return self._lost_in_use

    def alarmed_by(self, status: InverterStatus) -> bool:
        """Tell whether a status is a reason to stop."""
        follows = self.enabled and status.at >= self._since
        return follows and self._why_stopped(status) is not None

    def judge(self, status: InverterStatus) -> bool:
        """Judge what the drive says about itself; true if a person was told of it."""
        self._setpoint.answered()
        before, self._judged = self._judged, status
        if self.blocked_by_fault and not status.faulted:
            self._sequence.request_anew()
        if self._explain_refusal(status):
            return True
        if status.at < self._since:
            return False
        reason = None
        if self.enabled:
            reason = self._why_stopped(status) or self._why_slower(status, before)
            if reason is None and self._state.settings.follows_setpoints:
                reason = self._following.judge()
        elif not (self.commanded or self.stopping) and status.keeps_running:
            reason = Report(Cause.RUNS_UNASKED)
        if reason is not None:
            self._stop()
            self._tell_stopped(reason)
        return reason is not None

    def refused(self, reason: Report) -> None:
        """Stop because of a set-point; the next status may tell a better reason."""
        self._stop()
        self._refusal = (self._bus.now(), reason)

    def _explain_refusal(self, status: InverterStatus) -> bool:
        if self._refusal is None or status.at <= self._refusal[0]:
            return False
        # it was told to stop when it refused; a drive with a fault refuses everything
        (_, reason), self._refusal = self._refusal, None
        self._tell_stopped(explain_fault(self._state, status) if status.faulted else reason)
        return True

    def _tell_stopped(self, reason: Report) -> None:
        status = self._state.status
        if status is not None and status.faulted:
            self._state.tell(Severity.ERROR, Cause.STOPPED_BECAUSE_OF_FAULT, why=reason)
        else:
            self._state.tell(Severity.WARNING, Cause.STOPPED_BECAUSE, why=reason)

    # --- how --------------------------------------------------------------------------------

    async def _settle(self) -> None:
        """Let a stop that comes with something else be confirmed, so that enable can follow."""
        with contextlib.suppress(DriveError):
            await self._sequence.wait_confirmed()

    def _why_stopped(self, status: InverterStatus) -> Report | None:
        return explain_stop(self._state, status, self._setpoint.control_mode)

    def _why_slower(self, status: InverterStatus, before: InverterStatus | None) -> Report | None:
        if before is None or before.at < self._since or self._setpoint.control_mode != 'Freque':
            return None
        least = self._setpoint.least_since(before.at, reverse=before.frequency < 0)
        return explain_fall(self._state, before, status, least)

    def _no_control(self, status: InverterStatus | None) -> Report:
        if status is not None and status.driven:
            raise DriveError(self._state.report(Cause.RUN_BY_OTHERS))
        return self._state.report(Cause.NO_CONTROL)
