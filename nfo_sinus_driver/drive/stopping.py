# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Removes the run command of a drive, until its status confirms that it stops."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import enum
import math

from nfo_sinus_driver.bus import Priority, Task
from nfo_sinus_driver.catalog import InverterStatus, Removal, State
from nfo_sinus_driver.drive import drive_state
from nfo_sinus_driver.drive.commands import Commands
from nfo_sinus_driver.drive.control_state import Control, ControlEvent
from nfo_sinus_driver.drive.diagnosis import report_of
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, Refused

#: How often a stop that was answered and is not confirmed is written again, s.
_RETRY_PERIOD = 0.2
#: How often one to a lost drive is, to spare its neighbours, s.
_LOST_RETRY_PERIOD = 1.0
#: How often an unconfirmed stop is reported, s.
_COMPLAINT_PERIOD = 5.0
#: The interval grows each time, up to this, s.
_LONGEST_COMPLAINT_PERIOD = 60.0
#: After how many stops in a row without an answer the drive is tried with other requests.
_UNANSWERED_BEFORE_FORCE = 4
#: The slowest ramp, of 2000 s, shows in the frequency by then, s, however coarse that is.
_RAMP_SHOWS_BY = 7.0
_NO_ANSWER_YET = Report(Cause.NO_ANSWER_YET)


class _Outcome(enum.Enum):
    CONFIRMED = enum.auto()
    #: It is unknown whether the drive has received it, or it was refused in a fault that is over:
    #: it is repeated at once, for a while.
    UNANSWERED = enum.auto()
    #: The drive was too busy for it, and may take it the next moment.
    BUSY = enum.auto()
    #: It was answered, or it is known that it was not sent.
    UNCONFIRMED = enum.auto()
    #: A fault keeps the motor still, and the drive refuses the stop until it is over.
    BLOCKED_BY_FAULT = enum.auto()


class StopSequence:
    """
    Removes the run command of one drive; all reasons to stop share it.

    It begins with the event ``STOP``, and ends with ``STOPPED``. After each attempt before it
    dispatches ``FAULT_BLOCKS`` or ``FAULT_OVER``.
    """

    def __init__(self, state: DriveState, method: Commands, control: Control) -> None:
        self._bus = state.bus
        self._state = state
        self._method = method
        self._control = control
        #: The task that removes the run command, until that is confirmed.
        self._task: Task | None = None
        #: How many operations are stopping the motor by other means.
        self._external = 0
        #: When the last attempt ended that counts; minus infinity before the first.
        self._tried_at = -math.inf
        #: How often there was a new reason; an earlier attempt does not confirm it.
        self._reasons = 0
        #: Why it has not been confirmed yet.
        self._unconfirmed = _NO_ANSWER_YET
        #: When the stop for the present reasons had been sent.
        self._sent_at = math.inf
        #: From when on an unconfirmed stop is reported.
        self._due = 0.0
        #: From when on a drive that has taken it and does not confirm it is stopped by force.
        self._force_at = math.inf
        #: How many attempts in a row the drive has refused, and how many got no answer.
        self._refusals = self._unanswered = 0
        #: The last stop that was confirmed was one by force.
        self.forced = False

    @property
    def overdue(self) -> bool:
        """A stop was not confirmed in time, and no fault keeps the motor still."""
        waiting = self._task is not None and not self._control.blocked
        return waiting and self._bus.now() >= self._due

    @contextlib.contextmanager
    def external_stop(self, why: Report) -> Iterator[None]:
        """Keep the state of a stop while an operation stops the motor by other means."""
        self._external += 1
        self._control.dispatch(ControlEvent.STOP, why)
        try:
            yield
        finally:
            self._external -= 1
            self._report_end()

    def start(self, why: Report | None = None) -> None:
        """
        Remove the run command, again and again until the drive confirms that it stops.

        If that is going on already, nothing has to be added: no client can start the motor
        meanwhile. Only a stop that a fault has blocked is tried once more: the fault may be over.

        :param why: needed where something may run the motor.
        """
        self._control.dispatch(ControlEvent.STOP, why)
        if self._control.blocked and self._bus.now() > self._tried_at + _RETRY_PERIOD:
            self.restart()
        if self._task is None:
            self._tried_at = -math.inf
            self._unconfirmed = _NO_ANSWER_YET
            self._sent_at = self._force_at = math.inf
            self._refusals = self._unanswered = 0
            self.forced = False
            self._due = self._bus.now() + drive_state.TIMEOUT
            task = self._bus.spawn(self._keep_trying())
            self._task = None if task.future.done() else task

    def restart(self, why: Report | None = None) -> None:
        """Start, or try again at once: an attempt that has begun no longer counts."""
        if self._task is None:
            self.start(why)
        else:
            self._tried_at = -math.inf
            self._sent_at = math.inf
            self._reasons += 1
            self._control.dispatch(ControlEvent.FAULT_OVER)
            self._bus.wake(self._task)

    async def wait_confirmed(self, patience: float | None = None) -> None:
        """
        Wait until the drive has confirmed that it stops, or a fault keeps the motor still.

        :param patience: how long to wait, s; by default not for a drive that is lost. Within it the
            motor is stopped by force, if need be.
        :raises DriveError: it does not in time; the sequence goes on.
        """
        task = self._task
        if patience is not None:
            self._force_at = min(self._force_at, self._bus.now() + patience / 2)
        deadline = self._bus.now() + (drive_state.TIMEOUT if patience is None else patience)
        while task is not None and not await self._bus.join(task, drive_state.LOOK_PERIOD):
            if self._control.blocked:
                return
            # waiting for a lost drive keeps the others waiting, with the same result
            tried = self._tried_at > -math.inf
            lost = patience is None and not self._state.connected and tried
            if lost or self._bus.now() > deadline:
                raise DriveError(Cause.STOP_UNCONFIRMED, why=self._unconfirmed)
        if task is not None and task.future.exception() is not None:
            raise DriveError(Cause.STOP_UNCONFIRMED_AT_END)

    async def _keep_trying(self) -> None:
        complain_at = self._due
        pause = 0.0
        stood = False
        outcome = _Outcome.UNCONFIRMED
        while (outcome := await self._attempt(outcome)) is not _Outcome.CONFIRMED:
            if self._control.blocked:
                await self._fault_gone()
                self._due = complain_at = self._bus.now() + drive_state.TIMEOUT
                continue
            stands = self._at_standstill
            if self._bus.now() >= complain_at or (stood and not stands):
                pause = min(pause + _COMPLAINT_PERIOD, _LONGEST_COMPLAINT_PERIOD)
                complain_at = self._bus.now() + pause
                why = self._unconfirmed
                if stands:
                    standing = self._state.report(Cause.CANNOT_STOP_BUT_STANDS, why=why)
                    self._state.notify(Severity.WARNING, standing)
                else:
                    by = self._state.model.profile.enable_input
                    self._state.notify(
                        Severity.ERROR, Cause.CANNOT_STOP, why=why, enable_input=by
                    )
                stood = stands
            await self._rest(outcome)
        self._task = None
        self._report_end()
        if pause:
            self._state.notify(Severity.INFO, self._state.report(Cause.STOP_CONFIRMED_LATE))

    @property
    def _at_standstill(self) -> bool:
        """The drive has just shown that the motor stands still, and no run command."""
        status = self._state.status
        if status is None or self._bus.now() - status.at > _RETRY_PERIOD:
            return False
        # a code that is not in the manual shows nothing
        shows = status.state is not State.UNKNOWN or status.standby
        return shows and not (status.driven or status.runs)

    async def _fault_gone(self) -> None:
        """Wait until the drive may take commands again; the polls show it."""
        while self._control.blocked:
            await self._bus.sleep(_RETRY_PERIOD)
            status = self._state.status
            if not self._state.connected:
                # one that is only being connected to has no polls yet
                return
            if status is not None and not status.faulted:
                if status.runs_by_bus:
                    started = self._state.report(Cause.STARTED_AFTER_FAULT)
                    self._state.notify(Severity.WARNING, started)
                return

    async def _rest(self, outcome: _Outcome) -> None:
        """Let some time pass before the next attempt, but none after one without an answer."""
        if not self._state.connected:
            await self._bus.sleep(_LOST_RETRY_PERIOD)
        elif self._is_lost or self._bus.now() >= self._due:
            # tries that have not helped so far must not keep the line from all others
            await self._bus.sleep(_RETRY_PERIOD)
        elif outcome is _Outcome.BUSY:
            await self._bus.sleep(drive_state.LOOK_PERIOD)
        elif outcome is not _Outcome.UNANSWERED:
            await self._bus.sleep(_RETRY_PERIOD)

    @property
    def _is_lost(self) -> bool:
        """The drive has been silent for ``lost_after``: the next poll will find it lost."""
        settings = self._state.settings
        silent = self._bus.silences.lasts(settings.address, self._bus.now())
        return silent >= settings.lost_after

    async def _attempt(self, before: _Outcome) -> _Outcome:
        reasons = self._reasons
        try:
            outcome = await self._try_once(before)
        except (NoAnswer, DamagedAnswer) as error:
            outcome, self._unconfirmed = _Outcome.UNANSWERED, report_of(error)
        except Exception as error:
            # even an error in the driver must not end the tries
            outcome, self._unconfirmed = _Outcome.UNCONFIRMED, report_of(error)
        if self._reasons > reasons:
            outcome, self._unconfirmed = _Outcome.UNANSWERED, _NO_ANSWER_YET
            self._sent_at = math.inf
        self._tried_at = self._bus.now()
        blocked = outcome is _Outcome.BLOCKED_BY_FAULT
        self._control.dispatch(ControlEvent.FAULT_BLOCKS if blocked else ControlEvent.FAULT_OVER)
        return outcome

    def _report_end(self) -> None:
        if self._task is None and not self._external:
            self._control.dispatch(ControlEvent.STOPPED)

    async def _try_once(self, before: _Outcome) -> _Outcome:
        control_mode = self._state.control_mode
        reasons = self._reasons
        faulted = self._state.status is not None and self._state.status.faulted
        failure: LinkError | None = None
        try:
            await self._method.stop(control_mode)
            self._sent_at = min(self._sent_at, self._bus.now())
            self._refusals = self._unanswered = 0
        except Refused as error:
            if error.code == Refused.BUSY and self._bus.now() < self._due:
                self._unconfirmed = report_of(error)
                return _Outcome.BUSY
            failure = error
            self._refusals += 1
        except (NoAnswer, DamagedAnswer) as error:
            self._unanswered += 1
            # among late answers a refusal is not believed until another request was answered
            if isinstance(error, DamagedAnswer) and before is _Outcome.UNANSWERED:
                await self._state.read_status(Priority.LOOK, retry=False)
            if self._unanswered < _UNANSWERED_BEFORE_FORCE:
                raise
            failure = error
        # a drive that does not respond at all ends it here
        status = await self._state.read_status(Priority.LOOK, retry=False)
        if failure is None:
            status = await self._newer(status, reasons, self._sent_at)
        if isinstance(failure, Refused) and status.faulted and not status.runs_by_bus:
            if await self._method.remove(control_mode) is Removal.COMMAND:
                return _Outcome.CONFIRMED
            # some faults end as control is released
            status = await self._state.read_status(Priority.LOOK, retry=False)
            if status.faulted:
                self._unconfirmed = report_of(failure)
                return _Outcome.BLOCKED_BY_FAULT
        unconfirmed = self._why_unconfirmed(status, failure)
        if unconfirmed is not None and self._needs_force(status, failure):
            unconfirmed = await self._force(control_mode, reasons, unconfirmed)
        if unconfirmed is None:
            return _Outcome.CONFIRMED
        self._unconfirmed = unconfirmed
        over = isinstance(failure, Refused) and faulted and not status.faulted
        return _Outcome.UNANSWERED if over else _Outcome.UNCONFIRMED

    def _needs_force(self, status: InverterStatus, failure: LinkError | None) -> bool:
        """Return whether an ordinary stop does not do: refused again, ignored or in vain."""
        if status.local:
            return False
        if isinstance(failure, Refused):
            # the first refusal may have been one of the moment
            return self._refusals > 1 and (status.from_bus or status.driven)
        if failure is not None:
            return True
        shows_at = min(self._sent_at + _RAMP_SHOWS_BY, self._force_at)
        # a status from before, kept by a PLC, does not show whether the motor ramps down
        return status.at > self._sent_at and self._bus.now() >= shows_at

    async def _force(self, control_mode: str, reasons: int, why: Report) -> Report | None:
        """Stop by every means left [C126]; return why that is not confirmed."""
        obeyed = await self._method.force_stop(control_mode)
        sent_at = self._bus.now()
        status = await self._state.read_status(Priority.LOOK, retry=False)
        if not obeyed:
            return why
        self._sent_at = min(self._sent_at, sent_at)
        unconfirmed = self._why_unconfirmed(await self._newer(status, reasons, sent_at), None)
        if unconfirmed is None:
            self.forced = True
            self._state.notify(Severity.WARNING, self._state.report(Cause.STOP_FORCED, why=why))
        return unconfirmed

    async def _newer(self, status: InverterStatus, reasons: int, sent_at: float) -> InverterStatus:
        """
        Read until a status is from after the stop: a PLC shows the one before for a while.

        :param reasons: their number when it was written; with a new one it has to be written again.
        """
        until = self._bus.now() + _RETRY_PERIOD
        while self._reasons == reasons and status.at <= sent_at:
            if self._bus.now() > until:
                break
            await self._bus.sleep(drive_state.LOOK_PERIOD)
            status = await self._state.read_status(Priority.LOOK, retry=False)
        return status

    def _why_unconfirmed(self, status: InverterStatus, refusal: LinkError | None) -> Report | None:
        """Return why a stop is not confirmed; ``None`` if it is."""
        if status.tuning and refusal:
            return self._state.report(Cause.TUNING_REFUSES, error=str(refusal))
        if status.tuning:
            return self._state.report(Cause.TUNING_ENERGISES)
        if refusal and not status.local:
            return report_of(refusal)
        if refusal is None and status.at < self._sent_at:
            # a PLC with old data goes on showing the status before
            return _NO_ANSWER_YET
        keeps_running = status.keeps_running_since(self._sent_at)
        return self._state.report(Cause.DRIVE_SAYS) if keeps_running else None
