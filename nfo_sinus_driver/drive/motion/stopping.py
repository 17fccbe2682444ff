# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Removes the run command of a drive, until its status confirms that it stops."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator
import contextlib
import enum
import math
from typing import NamedTuple

from nfo_sinus_driver.bus import Priority, Task
from nfo_sinus_driver.catalog import ControlMethod, InverterStatus, Removal, State
from nfo_sinus_driver.drive.known import drive_state
from nfo_sinus_driver.drive.known.control_state import ControlEvent
from nfo_sinus_driver.drive.known.diagnosis import report_of
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.movement import RAMP_SHOWS_BY, STANDSTILL, Standing
from nfo_sinus_driver.drive.known.steps import NotRead, run_steps
from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, NoData, PortError, Refused

#: How often a stop that was answered and is not confirmed is written again, s.
_RETRY_PERIOD = 0.2
#: How often one to a lost drive is, to spare its neighbours, s.
_LOST_RETRY_PERIOD = 0.5
#: How often it is looked whether a lost drive is there that may not be written to any more, s.
_LOOK_AGAIN_PERIOD = 1.0
#: After how many attempts without an answer a stop is written without what it would read before.
_READ_IN_VAIN = 2
#: How much longer than its own time-out a drive is left alone, s.
_LEFT_ALONE_LONGER = 0.5
#: How often an unconfirmed stop is reported, s.
_COMPLAINT_PERIOD = 5.0
#: The interval grows each time, up to this, s.
_LONGEST_COMPLAINT_PERIOD = 60.0
#: After how many stops in a row without an answer the drive is tried with other requests.
_UNANSWERED_BEFORE_FORCE = 3
#: How long a motor that was released may show its speed without a fall, s, until it is reported
#: that this is not clear.
_CLEAR_BY = 2.0
#: How long a drive may go on showing its run command at standstill, s, its braking not counted.
_SHOWN_FOR = 1.5
_NO_ANSWER_YET = Report(Cause.NO_ANSWER_YET)


class _Outcome(enum.Enum):
    CONFIRMED = enum.auto()
    #: It is unknown whether the drive has received it, or it was refused in a fault that is over:
    #: it is repeated at once, for a while.
    UNANSWERED = enum.auto()
    #: It got no answer, and another request did, for the first time: it is repeated at once, for
    #: the line may have come back only between the two.
    IGNORED = enum.auto()
    #: The drive was too busy for it, and may take it the next moment.
    BUSY = enum.auto()
    #: It was answered, or it is known that it was not sent.
    UNCONFIRMED = enum.auto()
    #: A fault keeps the motor still, and the drive refuses the stop until it is over.
    BLOCKED_BY_FAULT = enum.auto()
    #: The drive has taken all there is and shows no run, but a speed that does not fall.
    UNCLEAR = enum.auto()


class _Sent(NamedTuple):
    """
    What became of a stop that was written.

    :ivar failure: why it was not acknowledged; a status may show what it did all the same.
    :ivar is_busy: the drive has no time for it, and is asked once more.
    """

    failure: LinkError | None = None
    is_busy: bool = False


#: What ends the tries.
_ENDS = (_Outcome.CONFIRMED, _Outcome.UNCLEAR)


class StopSequence:
    """
    Removes the run command of one drive; all reasons to stop share it.

    It begins with the event ``STOP``, and ends with ``STOPPED``. After each attempt before it
    dispatches ``FAULT_BLOCKS`` or ``FAULT_OVER``.

    :param look: reads once what shows that a drive that was lost is there, and no other.
    """

    def __init__(
        self,
        state: DriveState,
        method: ControlMethod,
        look: Callable[[], Awaitable[None]],
    ) -> None:
        self._bus = state.bus
        self._unit = state.settings.address
        self._state = state
        self._contact = state.contact
        self._method = method
        self._control = state.control
        self._look = look
        #: The task that removes the run command, until that is confirmed.
        self._task: Task | None = None
        #: How many operations are stopping the motor by other means.
        self._external = 0
        #: When the stop for the present reasons was begun, s.
        self._begun_at = math.inf
        #: When the last attempt ended that counts; minus infinity before the first.
        self._tried_at = -math.inf
        #: How often there was a new reason; an earlier attempt does not confirm it.
        self._reasons = 0
        #: What is written cannot be made without what is in the drive: the next attempt reads that,
        #: although it takes long.
        self._has_to_read = False
        #: The present attempt has written something; and that was acknowledged, a word made without
        #: what is in the drive: what cannot be read before a stop cannot be read after it either.
        self._wrote = self._removed_blind = False
        #: The stop of the last attempt was acknowledged: only its confirmation may be missing.
        self._acknowledged = False
        #: What has ended the last attempt; ``None``: it was answered.
        self._failure: Exception | None = None
        #: Its own time-out has had the time to stop the drive.
        self._was_left_alone = False
        #: Why it has not been confirmed yet.
        self._unconfirmed = _NO_ANSWER_YET
        #: When the stop for the present reasons had been sent.
        self._sent_at = math.inf
        #: From when on an unconfirmed stop is reported, when again, and how long after the last
        #: report, s; 0: there was none.
        self._due = self._complain_at = self._pause = 0.0
        #: From when on a drive that has taken it and does not confirm it is stopped by force, and
        #: when one has first taken that.
        self._force_at = self._forced_at = math.inf
        #: While the run command does, too.
        self._standing = Standing()
        #: How long the drive may go on showing that, s.
        self.shown_for = _SHOWN_FOR
        #: The last status with a speed since the stop.
        self._measured: InverterStatus | None = None
        #: How many attempts in a row the drive has refused, how many got no answer, and after how
        #: many of the latter it answered another request.
        self._refusals = self._unanswered = self._ignored = 0
        #: The last stop that was confirmed was one by force.
        self.forced = False
        #: Why it is not clear whether the last one stops the motor; ``None``: it does.
        self.unclear: Report | None = None

    @property
    def coasts(self) -> bool:
        """The last stop left a motor that still turned when its speed was measured last."""
        return self._measured is not None and abs(self._measured.frequency) > STANDSTILL

    @property
    def waits(self) -> bool:
        """A stop is written until the drive confirms it, or it is not clear whether it does."""
        return self._task is not None or self.unclear is not None

    @property
    def overdue(self) -> bool:
        """A stop was not confirmed in time, and no fault keeps the motor still."""
        waiting = self._task is not None and not self._control.blocked
        return waiting and self._bus.now() >= self._due

    @contextlib.contextmanager
    def external_stop(self, why: Report) -> Iterator[None]:
        """Keep the state of a stop while an operation stops the motor by other means."""
        self._external += 1
        self._contact.stop_is_due()
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
            self._contact.stop_begins()
            self._was_left_alone, self._failure = False, None
            self._begun_at = self._bus.now()
            self._tried_at = -math.inf
            self._unconfirmed = _NO_ANSWER_YET
            self._sent_at = self._force_at = self._forced_at = math.inf
            self._standing = Standing()
            self._measured = self.unclear = None
            self._refusals = self._unanswered = self._ignored = 0
            self.forced = False
            self._due = self._bus.now() + drive_state.TIMEOUT
            task = self._bus.spawn(self._keep_trying(), stops=True)
            self._task = None if task.future.done() else task
        elif self.waits_to_look and self._bus.now() > self._tried_at + _LOOK_AGAIN_PERIOD:
            # one that is called for looks at once
            self._bus.wake(self._task)

    def restart(self, why: Report | None = None) -> None:
        """Start, or try again at once: an attempt that has begun no longer counts."""
        if self._task is None:
            self.start(why)
        else:
            self._contact.stop_is_due()
            self._tried_at = -math.inf
            self._begun_at = self._bus.now()
            self._sent_at = self._forced_at = math.inf
            self._measured = None
            self._reasons += 1
            self._control.dispatch(ControlEvent.FAULT_OVER)
            self._bus.wake(self._task)

    async def wait_confirmed(self, patience: float | None = None) -> None:
        """
        Wait until the drive has confirmed that it stops, or a fault keeps the motor still.

        :param patience: how long to wait, s; by default not for a drive that is lost. It begins
            with the first answer, or after as long again where none comes before. Within it the
            motor is stopped by force, if need be.
        :raises DriveError: it does not in time; the sequence goes on.
        """
        task = self._task
        begun = started = self._bus.now()
        while task is not None and not await self._bus.join(task, drive_state.LOOK_PERIOD):
            if self._control.blocked:
                return
            # waiting for a lost drive keeps the others waiting, with the same result
            tried = self._tried_at > -math.inf
            if patience is None:
                late = self._bus.now() > begun + drive_state.TIMEOUT
                late = late or (tried and not self._contact.connected)
            else:
                if self._contact.connected and not tried:
                    # where a line has many to stop, its turn is yet to come
                    started = min(self._bus.now(), begun + patience)
                else:
                    self._force_at = min(self._force_at, started + patience / 2)
                late = self._bus.now() > started + patience
            if late:
                raise DriveError(Cause.STOP_UNCONFIRMED, why=self._unconfirmed)
        if task is not None and task.future.exception() is not None:
            raise DriveError(Cause.STOP_UNCONFIRMED_AT_END)
        if self.unclear is not None:
            raise DriveError(self.unclear)

    async def _keep_trying(self) -> None:
        self._complain_at, self._pause = self._due, 0.0
        alarm = self._bus.spawn(self._complain_in_time())
        stood = False
        outcome = _Outcome.UNCONFIRMED
        while (outcome := await self._attempt(outcome)) not in _ENDS:
            if self._control.blocked:
                await self._fault_gone()
                self._due = self._complain_at = self._bus.now() + drive_state.TIMEOUT
                continue
            stands = self._at_standstill
            if self._bus.now() >= self._complain_at or (stood and not stands):
                self._complain(stands=stands)
                stood = stands
            await self._rest(outcome)
        self._bus.cancel(alarm)
        if outcome is _Outcome.UNCLEAR:
            self.unclear = self._state.report(Cause.STOP_UNCLEAR, why=self._unconfirmed)
            self._state.notify(Severity.ERROR, self.unclear)
        self._task = None
        self._report_end()
        if self._pause and self.unclear is None:
            self._state.notify(Severity.INFO, self._state.report(Cause.STOP_CONFIRMED_LATE))

    async def _complain_in_time(self) -> None:
        """Report once that no stop is acknowledged, however long the present attempt takes."""
        await self._bus.sleep(self._due - self._bus.now())
        is_due = self._bus.now() >= self._complain_at
        if is_due and self._unanswered and not self._control.blocked:
            self._complain(stands=self._at_standstill)

    def _complain(self, *, stands: bool) -> None:
        """Report that the stop is not confirmed, and when to report it again."""
        self._pause = min(self._pause + _COMPLAINT_PERIOD, _LONGEST_COMPLAINT_PERIOD)
        self._complain_at = self._bus.now() + self._pause
        why = self._unconfirmed
        if stands:
            standing = self._state.report(Cause.CANNOT_STOP_BUT_STANDS, why=why)
            self._state.notify(Severity.WARNING, standing)
            return
        by = self._state.model.profile.enable_input
        self._state.notify(Severity.ERROR, Cause.CANNOT_STOP, why=why, enable_input=by)

    @property
    def _at_standstill(self) -> bool:
        """The drive has just shown that the motor stands still, and no run command."""
        status = self._state.status
        if status is None or self._bus.now() - status.at > _RETRY_PERIOD:
            return False
        # a code that is not in the manual shows nothing
        shows = status.state is not State.UNKNOWN or status.standby
        shows = shows and self._unconfirmed.cause is not Cause.STILL_TURNS
        return shows and not (status.driven or status.runs)

    async def _fault_gone(self) -> None:
        """Wait until the drive may take commands again; the polls show it."""
        while self._control.blocked:
            await self._bus.sleep(_RETRY_PERIOD)
            status = self._state.status
            if not self._contact.connected:
                # one that is only being connected to has no polls yet
                return
            if status is not None and not status.faulted:
                if status.runs_by_bus:
                    started = self._state.report(Cause.STARTED_AFTER_FAULT)
                    self._state.notify(Severity.WARNING, started)
                return

    async def _rest(self, outcome: _Outcome) -> None:
        """Let some time pass before the next attempt, but none after one without an answer."""
        unanswered = isinstance(self._failure, LinkError) and not isinstance(
            self._failure, (Refused, PortError, NoData)
        )
        blind = unanswered and self._contact.stops_blind and not self._acknowledged
        if outcome is _Outcome.IGNORED or blind:
            return
        if isinstance(self._failure, DriveError) and self._failure.report == self._not_known:
            # it may not be written to any more since the attempt began: it is looked for
            return
        if not self._contact.connected:
            await self._leave_alone()
        elif self._contact.is_silent_for_long or self._bus.now() >= self._due:
            # tries that have not helped so far must not keep the line from all others
            await self._bus.sleep(_RETRY_PERIOD)
        elif outcome is _Outcome.BUSY:
            await self._bus.sleep(drive_state.LOOK_PERIOD)
        elif outcome is not _Outcome.UNANSWERED:
            await self._bus.sleep(_RETRY_PERIOD)

    async def _leave_alone(self) -> None:
        """
        Let some time pass before a drive that is lost gets a request again.

        While it may not be written to, its own time-out has to stop it, if it has one that does:
        for so long it gets no request at all, and where no drive is reached that may run, nothing
        is sent on the line.
        """
        timeout, now = self._state.timeout, self._bus.now()
        own = timeout.shortest if timeout.stops_motor else 0.0
        if not own or self._contact.may_stop:
            pause = _LOST_RETRY_PERIOD if self._contact.may_stop else _LOOK_AGAIN_PERIOD
            if self._bus.silences.is_in_noise(now) and not self._acknowledged:
                # in noise something is there, and may not have the stop
                pause = drive_state.LOOK_PERIOD
            pause = self._state.pause_before_timeout(pause, own)
            await self._bus.sleep(pause, or_opening=True)
            if not own or self._contact.may_stop:
                return
            now = self._bus.now()
        silences = self._bus.silences
        asked_at = silences.asked_at(self._unit if self._was_left_alone else None)
        until = max(asked_at + own + _LEFT_ALONE_LONGER, now + _RETRY_PERIOD)
        if not self._was_left_alone:
            self._bus.keep_quiet(self._unit, until)
            if self._bus.is_any_reached:
                named = self._state.report(Cause.MAY_RUN_ON, seconds=own)
                self._state.notify(Severity.WARNING, named)
        await self._bus.sleep(until - now, or_opening=True)
        self._was_left_alone |= self._bus.now() >= until

    @property
    def waits_to_look(self) -> bool:
        """The drive gets no other request than its stop, and the look before it."""
        answers = self._contact.may_stop and not self._contact.is_silent
        return self._task is not None and not (self._contact.connected or answers)

    @property
    def _not_known(self) -> Report:
        return self._contact.not_recognised(_NO_ANSWER_YET).report

    async def find(self) -> None:
        """
        Look for the drive before it is stopped, if it is not known what is there.

        :raises LinkError: it does not answer.
        :raises DriveError: another one is there.
        """
        if self._contact.may_stop:
            return
        self._ignored = 0
        try:
            await self._look()
        except DriveError as error:
            raise self._contact.not_recognised(error.report) from error

    def require_same(self) -> None:
        """Make sure, at the moment of sending, that a stop may be written (DriveError: not)."""
        if not self._contact.may_stop:
            raise DriveError(self._not_known)
        self._wrote = True

    async def _attempt(self, before: _Outcome) -> _Outcome:
        reasons, self._acknowledged = self._reasons, False
        try:
            outcome = await self._try_once(before)
        except NotRead as error:
            outcome, self._failure = _Outcome.UNANSWERED, error
        except (NoAnswer, DamagedAnswer) as error:
            # a PLC that has no data of the drive has answered
            heard = isinstance(error, NoData)
            outcome = _Outcome.UNCONFIRMED if heard else _Outcome.UNANSWERED
            self._unconfirmed, self._failure = report_of(error), error
        except Exception as error:
            # even an error in the driver must not end the tries
            outcome, self._unconfirmed = _Outcome.UNCONFIRMED, report_of(error)
            self._failure = error
        else:
            self._failure = None
        if self._reasons > reasons:
            outcome, self._unconfirmed = _Outcome.UNANSWERED, _NO_ANSWER_YET
            self._sent_at, self._acknowledged = math.inf, False
        self._tried_at = self._bus.now()
        blocked = outcome is _Outcome.BLOCKED_BY_FAULT
        self._control.dispatch(ControlEvent.FAULT_BLOCKS if blocked else ControlEvent.FAULT_OVER)
        return outcome

    def _report_end(self) -> None:
        if self._task is None and not self._external:
            self._control.dispatch(ControlEvent.STOPPED)

    async def _try_once(self, before: _Outcome) -> _Outcome:
        """Write the stop, see what the drive shows, and judge both."""
        control_mode, reasons = self._state.control_mode, self._reasons
        was_faulted = self._state.status is not None and self._state.status.faulted
        failure, is_busy = await self._send(control_mode, before)
        if failure is not None and is_busy:
            self._unconfirmed = report_of(failure)
            return _Outcome.BUSY
        # a drive that does not respond at all ends it here
        status = await self._state.reader.read(Priority.LOOK, retry=False)
        ignored = isinstance(failure, NoAnswer | DamagedAnswer)
        self._ignored += ignored
        if failure is None:
            status = await self._newer(status, reasons, self._sent_at)
        if isinstance(failure, Refused) and status.faulted and not status.runs_by_bus:
            removed, status = await self._remove_in_fault(control_mode, reasons)
            if removed:
                failure = None
            elif status.faulted and not await self.unrest(status):
                self._unconfirmed = report_of(failure)
                return _Outcome.BLOCKED_BY_FAULT
        unconfirmed = await self._why_unconfirmed(status, failure)
        if unconfirmed is not None and self._needs_force(status, failure):
            unconfirmed = await self._force(control_mode, reasons, unconfirmed)
        if unconfirmed is None:
            return _Outcome.CONFIRMED
        self._unconfirmed = unconfirmed
        if unconfirmed.cause is Cause.STILL_TURNS and self._bus.now() > self._forced_at + _CLEAR_BY:
            return _Outcome.UNCLEAR
        over = isinstance(failure, Refused) and was_faulted and not status.faulted
        if ignored and self._ignored == 1:
            return _Outcome.IGNORED
        return _Outcome.UNANSWERED if over else _Outcome.UNCONFIRMED

    async def _send(self, control_mode: str, before: _Outcome) -> _Sent:
        """
        Write the stop once.

        :raises LinkError: what it did is not to be seen: the line, or the drive, is gone.
        """
        await self.find()
        # what is read of a drive that answers twice takes long: first without, where that can be
        reads, self._has_to_read = self._has_to_read or not self._contact.answers_twice, False
        is_blind, self._wrote, self._removed_blind = self._is_blind(reads), False, False
        try:
            await run_steps(
                self._state,
                self._method.stop(control_mode),
                Priority.STOP,
                permit=self.require_same,
                is_blind=is_blind,
                reads=reads or not is_blind,
            )
        except Refused as error:
            self._unanswered = self._ignored = 0
            is_busy = error.is_busy and self._bus.now() < self._due
            self._refusals += not is_busy
            return _Sent(error, is_busy)
        except NotRead:
            # nothing was in vain
            self._has_to_read = True
            raise
        except PortError:
            raise
        except LinkError as error:
            if self._wrote or not self._contact.connected:
                # else what is read before a stop had no answer
                self._contact.stop_in_vain()
            if not isinstance(error, (NoAnswer, DamagedAnswer)):
                raise
            self._unanswered += 1
            # among late answers a refusal is not believed until another request was answered; what
            # only reads before a stop does not have to be: the stop is written without it
            is_damaged = isinstance(error, DamagedAnswer) and self._wrote
            if is_damaged and before is _Outcome.UNANSWERED:
                await self._state.reader.read(Priority.LOOK, retry=False)
            if self._unanswered < _UNANSWERED_BEFORE_FORCE:
                raise
            return _Sent(error)
        self._sent_at = min(self._sent_at, self._bus.now())
        self._refusals = self._unanswered = self._ignored = 0
        self._removed_blind, self._acknowledged = is_blind, True
        return _Sent()

    async def _remove_in_fault(
        self, control_mode: str, reasons: int
    ) -> tuple[bool, InverterStatus]:
        """
        Remove the run command of a drive in a fault; return whether it is gone, and the status.

        Ahead of all else, too: the fault may end by itself, and the motor run on.
        """
        removal = await run_steps(
            self._state,
            self._method.remove(control_mode),
            Priority.STOP,
            permit=self.require_same,
        )
        removed, removed_at = removal is Removal.COMMAND, self._bus.now()
        # some faults end as control is released
        status = await self._state.reader.read(Priority.LOOK, retry=False)
        if removed:
            self._sent_at = min(self._sent_at, removed_at)
            status = await self._newer(status, reasons, removed_at)
        return removed, status

    def _is_blind(self, reads: bool) -> bool:
        """Return whether nothing answers in time, and the bus had control when something did."""
        status = self._state.status
        silent = self._contact.is_gone or not reads
        # what is read before a stop was read in vain
        silent |= self._unanswered >= _READ_IN_VAIN and not self._wrote
        return silent and status is not None and status.from_bus

    def _needs_force(self, status: InverterStatus, failure: LinkError | None) -> bool:
        """Return whether an ordinary stop does not do: refused again, ignored or in vain."""
        if status.local:
            return False
        if isinstance(failure, Refused):
            # the first refusal may have been one of the moment
            return self._refusals > 1 and (status.from_bus or status.driven)
        if failure is not None:
            # the line may have come back only after the first one
            return self._ignored > 1
        shows_at = min(self._sent_at + RAMP_SHOWS_BY, self._force_at)
        ramps = status.driven and not status.ramp_hidden
        if status.by_frequency and ramps and not status.keeps_running:
            # set-point 0 leads it to standstill, whatever the run command does
            shows_at = self._force_at
        if status.stands_running:
            # it may be braked first, or magnetised for a while
            stands_since = self._standing.note_standing(status.at, status.stands_running)
            shows_at = max(shows_at, stands_since + self.shown_for)
        # a status from before, kept by a PLC, does not show whether the motor ramps down
        return status.at > self._sent_at and self._bus.now() >= shows_at

    async def _force(self, control_mode: str, reasons: int, why: Report) -> Report | None:
        """Stop by every means left [C126]; return why that is not confirmed."""
        steps = self._method.force_stop(control_mode)
        obeyed = await run_steps(
            self._state, steps, Priority.STOP, onward=True, permit=self.require_same
        )
        sent_at = self._bus.now()
        status = await self._state.reader.read(Priority.LOOK, retry=False)
        if not obeyed:
            return why
        self._sent_at = min(self._sent_at, sent_at)
        self._forced_at = min(self._forced_at, sent_at)
        status = await self._newer(status, reasons, sent_at)
        unconfirmed = await self._why_unconfirmed(status, None)
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
            status = await self._state.reader.read(Priority.LOOK, retry=False)
        return status

    async def _why_unconfirmed(
        self, status: InverterStatus, refusal: LinkError | None
    ) -> Report | None:
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
        if status.unknown:
            return self._state.report(Cause.UNKNOWN_STATUS)
        if status.keeps_running_since(self._sent_at):
            return self._state.report(Cause.DRIVE_SAYS)
        return None if status.local else await self.unrest(status)

    async def unrest(self, status: InverterStatus, *, retry: bool = False) -> Report | None:
        """
        Return what shows that a motor without a run may turn, or may be turned; ``None``: nothing.

        :param status: of a drive that stops, or stands.
        :param retry: repeat a request without a response; a stop is written again before.
        """
        if status.runs_by_bus and await self._has_run_command(status):
            return self._state.report(Cause.RUN_COMMAND_STANDS)
        if status.driven and not status.ramp_hidden:
            # it is on its way
            return None
        self._measured = status = await self._state.reader.measured_with(
            status, self._measured, retry=retry
        )
        if not self.coasts or status.falls_since(self._begun_at):
            return None
        turning = self._state.measurements.turning
        now = status.frequency / turning.hertz
        return self._state.report(Cause.STILL_TURNS, now=now, unit=turning.unit)

    async def _has_run_command(self, status: InverterStatus) -> bool:
        """Return whether a drive that shows a run has a run command, as far as that shows yet."""
        # without an answer, a word that was acknowledged just now has none
        steps, onward = self._method.has_run_command(), self._removed_blind
        stands = await run_steps(self._state, steps, Priority.LOOK, onward=onward)
        if stands or self._method.reads_run_command:
            return bool(stands)
        # on its ramp it shows a run, too
        braking = await self._state.read_stop_braking()
        self.shown_for = _SHOWN_FOR + braking
        return status.at >= self._standing.note_standing(status.at, status.stands_running) + braking
