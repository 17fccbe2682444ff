# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Starts the motor of a drive, and removes its run command; each is confirmed by its status."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator
import contextlib
import enum
import math

from nfo_sinus_driver.bus import Priority, Task
from nfo_sinus_driver.catalog import Fact, InverterStatus, Limits, Meaning, Removal, Role, State
from nfo_sinus_driver.drive import drive_state
from nfo_sinus_driver.drive.commands import Commands, read_limits, read_scales
from nfo_sinus_driver.drive.control_state import ControlEvent
from nfo_sinus_driver.drive.diagnosis import report_of, require_no_fault
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, Refused

#: How often a stop is written again that was heard and is not confirmed, s.
_RETRY_PERIOD = 0.2
#: How often one is that a lost drive does not hear, for its neighbours' sake, s.
_LOST_RETRY_PERIOD = 1.0
#: How long all that a start waits for may take together, s, the start delay of the drive aside.
_START_TIMEOUT = 4.0
#: How often it is said that a stop is not confirmed, s.
_COMPLAINT_PERIOD = 5.0
#: Each time it is said after a longer while, up to this, s.
_LONGEST_COMPLAINT_PERIOD = 60.0
#: After so many stops in a row that got no answer it is looked whether the drive answers others.
_UNHEARD_BEFORE_FORCE = 4
#: The slowest ramp, of 2000 s, shows in the frequency by then, s, in whatever steps that is told.
_RAMP_SHOWS_BY = 7.0
_NO_ANSWER_YET = Report(Cause.NO_ANSWER_YET)


class _Outcome(enum.Enum):
    CONFIRMED = enum.auto()
    #: Nobody knows whether the drive has heard it: it is repeated at once, for a while.
    UNHEARD = enum.auto()
    #: The drive was too busy for it, and may take it the next moment.
    BUSY = enum.auto()
    #: It was heard, or it is known that it was not sent.
    UNCONFIRMED = enum.auto()
    #: A fault keeps the motor still, and the drive from taking the stop until it is over.
    BLOCKED_BY_FAULT = enum.auto()


class StopSequence:
    """
    Removes the run command of one drive; there is one for a drive, shared by all who ask.

    :param report: called with ``STOPPED`` when it is over, and after each attempt before with
        ``FAULT_BLOCKS`` or ``FAULT_OVER``.
    """

    def __init__(
        self, state: DriveState, method: Commands, report: Callable[[ControlEvent], None]
    ) -> None:
        self._bus = state.bus
        self._state = state
        self._method = method
        self._report = report
        #: What removes the run command, while there may be one that nobody wants any more.
        self._task: Task | None = None
        #: How many stops are on their way that come with something else.
        self._held = 0
        #: What became of the last attempt, and when; ``None`` before the first has ended.
        self._outcome: _Outcome | None = None
        self._tried_at = 0.0
        #: How often there was a new reason; what an earlier attempt shows says nothing of it.
        self._reasons = 0
        #: Why it has not been confirmed yet.
        self._unconfirmed = _NO_ANSWER_YET
        #: When the drive had been told to stop for the reasons that there are.
        self._told_at = math.inf
        #: From when on a drive that has still not confirmed it is complained of.
        self._due = 0.0
        #: From when on one that has taken it and does not confirm it is stopped by force.
        self._force_at = math.inf
        #: How many attempts in a row the drive has refused, and how many got no answer.
        self._refusals = self._unheard = 0
        #: The last stop that was confirmed was one by force.
        self.forced = False

    @property
    def overdue(self) -> bool:
        """A stop is not confirmed although there was time; no fault keeps the motor still."""
        waiting = self._task is not None and not self.blocked_by_fault
        return waiting and self._bus.now() >= self._due

    @property
    def blocked_by_fault(self) -> bool:
        """The drive stands by a fault, and refuses the stop until it is acknowledged."""
        return self._task is not None and self._outcome is _Outcome.BLOCKED_BY_FAULT

    @property
    def active(self) -> bool:
        """A stop is not confirmed yet."""
        return self._task is not None or self._held > 0

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Count as active while something goes on that stops the motor in its own way."""
        self._held += 1
        try:
            yield
        finally:
            self._held -= 1
            self._report_end()

    def request(self) -> None:
        """
        Remove the run command, again and again until the drive says that it stops.

        Where that is going on already nothing has to be added: nobody is let start the motor
        meanwhile. Only what a fault has blocked is tried once more, for it may be over by now.
        """
        if self.blocked_by_fault and self._bus.now() > self._tried_at + _RETRY_PERIOD:
            self.request_anew()
        if self._task is None:
            self._outcome = None
            self._unconfirmed = _NO_ANSWER_YET
            self._told_at = self._force_at = math.inf
            self._refusals = self._unheard = 0
            self.forced = False
            self._due = self._bus.now() + drive_state.TIMEOUT
            task = self._bus.spawn(self._keep_trying())
            self._task = None if task.future.done() else task

    def request_anew(self) -> None:
        """Request it, or try again at once: what attempts show that have begun counts no more."""
        if self._task is None:
            self.request()
        else:
            self._outcome = None
            self._told_at = math.inf
            self._reasons += 1
            self._report_fault()
            self._bus.wake(self._task)

    async def wait_confirmed(self, patience: float | None = None) -> None:
        """
        Wait until the drive has confirmed that it stops, or stands because of a fault.

        :param patience: how long to wait, s; by default not for a drive that is lost. Within it the
            motor is stopped by force, if need be.
        :raises DriveError: it does not in time; the sequence goes on.
        """
        task = self._task
        if patience is not None:
            self._force_at = min(self._force_at, self._bus.now() + patience / 2)
        deadline = self._bus.now() + (drive_state.TIMEOUT if patience is None else patience)
        while task is not None and not await self._bus.join(task, drive_state.LOOK_PERIOD):
            if self.blocked_by_fault:
                return
            # who waits for a drive that is not there keeps others waiting, and learns no more
            lost = patience is None and not self._state.connected and self._outcome is not None
            if lost or self._bus.now() > deadline:
                raise DriveError(Cause.STOP_UNCONFIRMED, why=self._unconfirmed)
        if task is not None and task.future.exception() is not None:
            raise DriveError(Cause.STOP_UNCONFIRMED_AT_END)

    async def _keep_trying(self) -> None:
        complain_at = self._due
        pause = 0.0
        stood = False
        while await self._attempt() is not _Outcome.CONFIRMED:
            if self.blocked_by_fault:
                await self._fault_gone()
                self._due = complain_at = self._bus.now() + drive_state.TIMEOUT
                continue
            stands = self._stands
            if self._bus.now() >= complain_at or (stood and not stands):
                pause = min(pause + _COMPLAINT_PERIOD, _LONGEST_COMPLAINT_PERIOD)
                complain_at = self._bus.now() + pause
                why = self._unconfirmed
                if stands:
                    standing = self._state.report(Cause.CANNOT_STOP_BUT_STANDS, why=why)
                    self._state.tell(Severity.WARNING, standing)
                else:
                    by = self._state.model.profile.enable_input
                    self._state.tell(
                        Severity.ERROR, Cause.CANNOT_STOP, why=why, enable_input=by
                    )
                stood = stands
            await self._rest()
        self._task = None
        self._report_end()
        if pause:
            self._state.tell(Severity.INFO, self._state.report(Cause.STOP_CONFIRMED_LATE))

    @property
    def _stands(self) -> bool:
        """The drive has just shown that the motor stands, and no run command."""
        status = self._state.status
        if status is None or self._bus.now() - status.at > _RETRY_PERIOD:
            return False
        # a code that is not in the manual shows nothing
        shows = status.state is not State.UNKNOWN or status.standby
        return shows and not (status.driven or status.runs)

    async def _fault_gone(self) -> None:
        """Wait until the drive may take commands again; the polls tell, and cost nothing more."""
        while self.blocked_by_fault:
            await self._bus.sleep(_RETRY_PERIOD)
            status = self._state.status
            if not self._state.connected:
                # one that is only being connected to has no polls yet
                return
            if status is not None and not status.faulted:
                if status.runs_by_bus:
                    started = self._state.report(Cause.STARTED_AFTER_FAULT)
                    self._state.tell(Severity.WARNING, started)
                return

    async def _rest(self) -> None:
        """Let some time pass before the next attempt, but none after one that nobody heard."""
        if not self._state.connected:
            await self._bus.sleep(_LOST_RETRY_PERIOD)
        elif self._is_lost or self._bus.now() >= self._due:
            # what helps neither at once nor in a while must not keep the line from all others
            await self._bus.sleep(_RETRY_PERIOD)
        elif self._outcome is _Outcome.BUSY:
            await self._bus.sleep(drive_state.LOOK_PERIOD)
        elif self._outcome is not _Outcome.UNHEARD:
            await self._bus.sleep(_RETRY_PERIOD)

    @property
    def _is_lost(self) -> bool:
        """The drive has been silent for so long that the next poll gives it up."""
        settings = self._state.settings
        silent = self._bus.silences.lasts(settings.address, self._bus.now())
        return silent >= settings.lost_after

    async def _attempt(self) -> _Outcome:
        reasons = self._reasons
        try:
            self._outcome = await self._try_once()
        except (NoAnswer, DamagedAnswer) as error:
            self._outcome, self._unconfirmed = _Outcome.UNHEARD, report_of(error)
        except Exception as error:
            # even a mistake of ours must not end the trying
            self._outcome, self._unconfirmed = _Outcome.UNCONFIRMED, report_of(error)
        if self._reasons > reasons:
            self._outcome, self._unconfirmed = _Outcome.UNHEARD, _NO_ANSWER_YET
            self._told_at = math.inf
        self._tried_at = self._bus.now()
        self._report_fault()
        return self._outcome

    def _report_fault(self) -> None:
        blocked = self._outcome is _Outcome.BLOCKED_BY_FAULT
        self._report(ControlEvent.FAULT_BLOCKS if blocked else ControlEvent.FAULT_OVER)

    def _report_end(self) -> None:
        if not self.active:
            self._report(ControlEvent.STOPPED)

    async def _try_once(self) -> _Outcome:
        control_mode = self._state.control_mode
        reasons = self._reasons
        failure: LinkError | None = None
        try:
            await self._method.stop(control_mode)
            self._told_at = min(self._told_at, self._bus.now())
            self._refusals = self._unheard = 0
        except Refused as error:
            if error.code == Refused.BUSY and self._bus.now() < self._due:
                self._unconfirmed = report_of(error)
                return _Outcome.BUSY
            failure = error
            self._refusals += 1
        except (NoAnswer, DamagedAnswer) as error:
            self._unheard += 1
            # among late answers a refusal is not believed, until something else was answered
            if isinstance(error, DamagedAnswer) and self._outcome is _Outcome.UNHEARD:
                await self._state.read_status(Priority.LOOK, once=True)
            if self._unheard < _UNHEARD_BEFORE_FORCE:
                raise
            failure = error
        # one that answers nothing at all ends it here
        status = await self._state.read_status(Priority.LOOK, once=True)
        if failure is None:
            status = await self._newer(status, reasons, self._told_at)
        if isinstance(failure, Refused) and status.faulted and not status.runs_by_bus:
            if await self._method.remove(control_mode) is Removal.COMMAND:
                return _Outcome.CONFIRMED
            self._unconfirmed = report_of(failure)
            return _Outcome.BLOCKED_BY_FAULT
        unconfirmed = self._why_not(status, failure)
        if unconfirmed is not None and self._needs_force(status, failure):
            unconfirmed = await self._force(control_mode, reasons, unconfirmed)
        if unconfirmed is None:
            return _Outcome.CONFIRMED
        self._unconfirmed = unconfirmed
        return _Outcome.UNCONFIRMED

    def _needs_force(self, status: InverterStatus, failure: LinkError | None) -> bool:
        """Tell whether an ordinary stop will not do: refused again, ignored, or without effect."""
        if status.local:
            return False
        if isinstance(failure, Refused):
            # once may have been a moment at which it could not
            return self._refusals > 1 and (status.from_bus or status.driven)
        if failure is not None:
            return True
        shows_at = min(self._told_at + _RAMP_SHOWS_BY, self._force_at)
        # what a PLC has from before says nothing of a motor that may well be ramping down
        return status.at > self._told_at and self._bus.now() >= shows_at

    async def _force(self, control_mode: str, reasons: int, why: Report) -> Report | None:
        """Stop by all that is left [C126]; return what keeps that from being confirmed."""
        obeyed = await self._method.force_stop(control_mode)
        told_at = self._bus.now()
        status = await self._state.read_status(Priority.LOOK, once=True)
        if not obeyed:
            return why
        self._told_at = min(self._told_at, told_at)
        unconfirmed = self._why_not(await self._newer(status, reasons, told_at), None)
        if unconfirmed is None:
            self.forced = True
            self._state.tell(Severity.WARNING, self._state.report(Cause.STOP_FORCED, why=why))
        return unconfirmed

    async def _newer(self, status: InverterStatus, reasons: int, told_at: float) -> InverterStatus:
        """
        Look until a status is from after the stop: a PLC shows for a while what was before.

        :param reasons: those that the stop was for; with a new one it has to be written again.
        """
        until = self._bus.now() + _RETRY_PERIOD
        while self._reasons == reasons and status.at <= told_at:
            if self._bus.now() > until:
                break
            await self._bus.sleep(drive_state.LOOK_PERIOD)
            status = await self._state.read_status(Priority.LOOK, once=True)
        return status

    def _why_not(self, status: InverterStatus, refusal: LinkError | None) -> Report | None:
        """Return what keeps a stop from being confirmed; ``None`` if nothing does."""
        if status.tuning and refusal:
            return self._state.report(Cause.TUNING_REFUSES, error=str(refusal))
        if status.tuning:
            return self._state.report(Cause.TUNING_ENERGISES)
        if refusal and not status.local:
            return report_of(refusal)
        if refusal is None and status.at < self._told_at:
            # a PLC whose data stand still goes on showing what was before
            return _NO_ANSWER_YET
        keeps_running = status.keeps_running_since(self._told_at)
        return self._state.report(Cause.DRIVE_SAYS) if keeps_running else None


class StartSequence:
    """Starts the motor of one drive, or says in a :class:`DriveError` why not; on the bus alone."""

    def __init__(self, state: DriveState, method: Commands) -> None:
        self._state = state
        self._method = method
        #: When the start has to be over, s of the clock of the bus.
        self._deadline = math.inf

    async def check(self) -> tuple[str, Limits]:
        """
        See to it that the motor may be started, writing nothing.

        :returns: the control mode, and what its set-points may be.
        """
        state = self._state
        status = await state.read_status(Priority.SERVICE)
        require_no_fault(state, status)
        control_mode = await state.read_control_mode()
        expected = state.settings.expected_control_mode
        if expected and control_mode != expected:
            key = state.model.key(Role.CONTROL_MODE)
            raise DriveError(
                Cause.WRONG_CONTROL_MODE, mode=control_mode, expected=expected, key=key
            )
        await self._method.require_startable()
        # it may have been changed since the drive was connected, at its keypad
        await read_scales(state)
        return control_mode, await read_limits(state, control_mode)

    async def start(self, control_mode: str, prepare: Callable[[], Awaitable[None]]) -> None:
        """
        Take control and run at set-point 0; after an error a run command may stand all the same.

        :param prepare: does what has to be done before a run command, once the bus has control.
        """
        await self.take_control(control_mode)
        await self._await_status(lambda now: now.from_bus)
        if self._state.settings.follows_setpoints:
            await self._method.zero_setpoint(control_mode, Priority.SERVICE)
        await prepare()
        await self._method.run(self._await_start)
        run_at = self._state.bus.now()
        # behind a PLC a status from before the run command is shown for a while
        await self._await_start(lambda now: now.runs and now.at > run_at)

    async def _await_status(self, wanted: Callable[[InverterStatus], bool]) -> None:
        """Wait for a step that every drive makes soon."""
        left = self._deadline - self._state.bus.now()
        await self._state.wait_until(wanted, timeout=min(left, drive_state.TIMEOUT))

    async def _await_start(self, wanted: Callable[[InverterStatus], bool]) -> None:
        """Wait until the drive has made a step on its way to run."""
        deadline = min(self._state.bus.now() + drive_state.TIMEOUT, self._deadline)
        delayed = False
        while True:
            status = await self._state.read_status(Priority.SERVICE)
            if wanted(status):
                return
            if status.faulted:
                raise DriveError(self._state.report(Cause.START_FAULTED))
            # in standby after the start delay it has forgotten the start, and must not wait for
            # another one
            if Fact.RUN_INPUT_MISSING in status.facts or (delayed and status.standby):
                raise DriveError(self._state.report(Cause.NO_RUN_INPUT))
            if status.means(Meaning.START_DELAY) and not delayed:
                delayed = True
                delay = await self._state.read_start_delay()
                self._deadline += delay
                deadline += delay
            if self._state.bus.now() > deadline:
                cause = Cause.NO_RUN_INPUT if status.standby else Cause.NOT_STARTED
                raise DriveError(self._state.report(cause))
            await self._state.bus.sleep(drive_state.LOOK_PERIOD)

    async def take_control(self, control_mode: str) -> None:
        """
        Put the drive under bus control, with no run command standing.

        The set-point of an earlier session is removed before, where the drive lets us: one that has
        kept its run command, too, would turn the motor at once.
        """
        self._deadline = self._state.bus.now() + _START_TIMEOUT
        if not self._state.settings_need_control:
            with contextlib.suppress(DriveError, Refused):
                await self._method.zero_setpoint(control_mode, Priority.SERVICE)
        await self._method.take_control(self._await_status)
