# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Polls one drive, checks its status, and notices when it is lost."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
import contextlib
import functools
import logging
import math
from typing import TypeVar

from nfo_sinus_driver.bus import Priority, Task, Watch
from nfo_sinus_driver.catalog import InverterStatus, Role
from nfo_sinus_driver.drive.known.changes import ParameterChange
from nfo_sinus_driver.drive.known.contact import MODE, STATUS, ContactEvent
from nfo_sinus_driver.drive.known.diagnosis import Conditions, explain_failure, explain_fault
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.recognising import Recogniser
from nfo_sinus_driver.drive.known.settings import MONITOR
from nfo_sinus_driver.drive.known.snapshot import NAN, NOT_MEASURED, Measured, Snapshot
from nfo_sinus_driver.drive.motion.controller import Controller
from nfo_sinus_driver.drive.motion.setpoint import Setpoint
from nfo_sinus_driver.drive.watch.poll_plan import WATCH_PERIOD, PollPlan, Turn
from nfo_sinus_driver.link import (
    Interrupted,
    LinkError,
    NoData,
    PortError,
    Refused,
    Reply,
    silent,
)

_log = logging.getLogger(__name__)
_T = TypeVar('_T')

#: After this share of its own time-out the drive gets a request ahead of all but stops and
#: set-points.
_LATEST_SHARE = 0.5
#: How long before the silence of all others passes for its own a drive is asked itself, s, and for
#: how long its turn is waited for, where a request to another one took all of that time.
_LOOK_BEFORE_LOSS, _LOOKED_FOR = 0.4, 0.2
#: What is measured in every control mode.
_BASIC = (Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED)
#: A motor is at its speed while the controlled quantity changes by no more than this share from
#: poll to poll; else frequency and speed are both measured each time.
_STEADY = 0.02
#: How often what is known is published while a stop keeps polls from their turns, s.
_SHOW_PERIOD = 0.25
#: How often a read beside the status is tried in one poll: what the driver has to know, and what it
#: measures, which did not fail just before.
_TRIES, _MEASURED_TRIES = 3, 2


class Poller:
    """
    Watches one drive from :meth:`begin` to :meth:`end`; used on the bus alone.

    :param controller: how it is commanded; ``None`` if this driver only reads.
    :param connect: connects to the drive again after it was lost.
    """

    def __init__(
        self,
        state: DriveState,
        setpoint: Setpoint,
        controller: Controller | None,
        recogniser: Recogniser,
        connect: Callable[[], Awaitable[None]],
    ) -> None:
        self._bus = state.bus
        self._unit = state.settings.address
        self._state = state
        self._contact = state.contact
        self._params = state.params
        self._setpoint = setpoint
        self._controller = controller
        self._recogniser = recogniser
        self._connect = connect
        self._task: Task | None = None
        self._keep_alive_task: Task | None = None
        self._show_task: Task | None = None
        #: Asks the drive before the silence of all others passes for its own.
        self._look_task: Task | None = None
        self._looked_at = -math.inf
        #: When it is polled, and what is read.
        self._plan = PollPlan(state, setpoint, controller)
        #: The newest poll.
        self.snapshot = take_snapshot(state, setpoint)
        #: When it was published, s; its own time is that of its status.
        self._shown_at = -math.inf
        #: When a value was last asked for, pauses of the worker aside, s.
        self._requested_at = 0.0
        self._complaint: Report | None = None
        #: A status word that came with a set-point, and has not been checked yet.
        self._received: Reply | None = None
        #: For how long the worker had paused when the status was last requested, s.
        self._status_paused = 0.0
        self._reported_fault = 0
        self._conditions = Conditions(state)
        watch = Watch(self._look_for_loss, lambda: state.control.stop_owed, self._paused)
        self._bus.watch_over(self._unit, watch)

    @property
    def begun(self) -> bool:
        """It is polling."""
        return self._task is not None

    @property
    def active(self) -> bool:
        """It polls at full rate."""
        return self._plan.active

    @property
    def yields(self) -> bool:
        """Whether it polls seldom while another drive's settings are first read."""
        return self._plan.yields

    def begin(self) -> None:
        """Poll from now on."""
        self._task = self._bus.spawn(self._poll_repeatedly())
        if self._keep_alive_task is None and self._controller is not None:
            self._keep_alive_task = self._bus.spawn(self._keep_alive())

    def end(self) -> None:
        """Stop polling."""
        if self._task is not None:
            task, self._task = self._task, None
            self._bus.cancel(task)
        self._bus.cancel(self._keep_alive_task)
        self._keep_alive_task = None
        self._bus.cancel(self._show_task)
        self._bus.recorder.cycle(self._unit, math.nan)
        self._publish(None)

    def take_status(self, reply: Reply) -> None:
        """
        Take a status word that came with another answer, if one came.

        It is the answer to a read that waits for it; else, if it is news, the next poll comes at
        once. A poll that may have to stop the motor replaces one that waits for its turn to read
        something else: on a full line that may take long.
        """
        state, params = self._state, self._params
        if self._task is None or not state.contact.connected or not reply.data:
            return
        place = params.address(state.reader.word_key)
        if self._bus.answer(self._task, self._unit, place, reply):
            return
        # impossible values are ignored: the next poll reads again
        if not params.can_be(state.reader.word_key, reply.data):
            return
        word = state.reader.status_word(reply.data)
        if state.status is None or word == state.status.word:
            return
        if self._received is not None and word == state.reader.status_word(self._received.data):
            return
        self._received = reply
        if self._alarming(state.reader.status_of_word(word, reply.arrived)):
            self._bus.cancel(self._task)
            self.begin()
        else:
            self.wake()

    def restarted(self) -> None:
        """Note that the drive has restarted: it is lost until it is connected to again."""
        if self._task is None or not self._contact.connected:
            return
        self._begin_anew(DriveError(Cause.RESTARTED))

    def _begin_anew(self, error: LinkError | DriveError) -> None:
        """Treat the drive as lost until it is connected to again, and poll anew."""
        self._bus.cancel(self._task)
        self._mark_lost(error)
        self._plan.connected()
        self.begin()

    def set_active(self, active: bool) -> None:
        """Poll at full rate, or only so that the drive stays watched."""
        self._plan.set_active(active)
        if active:
            self.wake()

    def wake(self) -> None:
        """Poll at once."""
        if self._task is not None:
            self._bus.wake(self._task)

    def poll_soon(self) -> None:
        """Find out at once whether a drive responds that did not answer another request."""
        if not self._contact.connected:
            return
        if self._contact.fails_for_long(STATUS):
            # the read that waits for its turn would come too late
            self._begin_anew(self._contact.newest_failure)
        self.wake()

    def read_mode_soon(self) -> None:
        """Read the control mode with the next poll: it may be another one now."""
        self._plan.read_rare_soon()
        self.wake()

    def connected(self) -> None:
        """Reset the counts of failures: the drive is connected."""
        self._bus.recorder.connected(self._unit)
        self._plan.connected()
        self._complaint = None
        self._received = None
        self._state.measurements.forget()

    async def _poll_repeatedly(self) -> None:
        polled_at = -math.inf
        while True:
            started = self._bus.now()
            turn = self._plan.turn(polled_at)
            try:
                match turn:
                    case Turn.CONNECT:
                        await self._connect()
                        # nothing is measured yet: it is polled at once
                        polled_at = started - self._plan.period
                    case Turn.POLL:
                        await self._poll()
                    case Turn.STATUS:
                        await self._read_status()
                        self._publish_changed()
                if self._contact.connected and not self._contact.is_recognised:
                    # it was silent for long, or this driver stood still: is it still the same?
                    await self._recogniser.recognise(Priority.POLL)
                self._contact.poll_passed()
            except (LinkError, DriveError) as error:
                self._on_poll_failed(error)
            except Exception as error:
                # a drive that is no longer watched must not go on running
                self._on_poll_failed(DriveError(Cause.DRIVER_ERROR, error=repr(error)))
            if turn is Turn.POLL:
                if self._contact.connected and self.active and polled_at > 0:
                    self._bus.recorder.cycle(self._unit, started - polled_at)
                polled_at = started
            lost = not self._contact.connected
            await self._bus.sleep(self._plan.pause(polled_at), or_opening=lost)

    async def _keep_alive(self) -> None:
        """
        Send the drive a request before its own time-out strikes, where polls wait for too long.

        They give way to commands, and enabling many drives at once takes seconds. A silent drive
        gets one such request, for then the polls have to find out that it is lost.
        """
        state = self._state
        asked_after = -math.inf
        while True:
            latest = state.timeout.seconds * _LATEST_SHARE
            if not state.contact.connected or not latest or self._bus.is_quiet:
                await self._bus.sleep(WATCH_PERIOD)
                continue
            frame_at = self._contact.last_frame_at
            left = frame_at + latest - self._bus.now()
            if left <= 0 and frame_at != asked_after:
                asked_after = frame_at
                await self._be_heard()
            await self._bus.sleep(left if left > 0 else latest / 2)

    def _alarming(self, status: InverterStatus) -> bool:
        """Return whether a status may have to stop the motor."""
        return self._controller is not None and self._controller.alarmed_by(status)

    async def _read_status(self) -> InverterStatus:
        state = self._state

        received = taken = self._received
        if received is not None and state.status and received.arrived <= state.status.at:
            # a command has read a newer one since
            received = None

        async def read() -> InverterStatus:
            # once: both words of a status are of one moment, so they are repeated together
            nonlocal received
            word, received = received, None
            alarming, code_for = self._alarming, self._plan.code_holds
            if word is not None:
                return await state.reader.complete(
                    word, self._plan.priority, alarming=alarming, code_for=code_for
                )
            return await state.reader.read(
                self._plan.priority, retry=False, alarming=alarming, code_for=code_for
            )

        paused = self._bus.paused
        while (status := await self._try(STATUS, read)) is None:
            # what was read before stays valid
            continue
        self._status_paused = paused
        if self._received is taken:
            self._received = None
        state.require_fresh(status)
        self._contact.note_poll()
        reported = self._controller is not None and self._controller.on_status(status)
        self._report_fault(status, reported)
        self._conditions.take_status(status)
        return status

    async def _poll(self) -> None:
        state = self._state
        last = state.measurements.last(state.controlled).value
        status = await self._read_status()
        reads, started = self._plan.reads, self._bus.now()
        answered = reads.mode and await self._read_mode(status)
        answered = answered and await self._check_scales(all_of_them=reads.every_scale)
        if reads.is_regular and answered:
            self._plan.rare_read(started)
        actual = state.controlled
        steady = True
        if actual is not None and not self._is_slow(actual):
            now = await self._measure(actual)
            steady = abs(now - last) <= _STEADY * max(abs(now), abs(last))
        for role in _BASIC:
            age = self._bus.now() - state.measurements.last(role).at
            due = age >= self._plan.slow_period or not steady
            if role is not actual and due and not self._is_slow(role):
                await self._measure(role)
        if self._bus.paused == self._status_paused:
            # else the status may be old: the next poll is due
            self._publish(status)

    def _is_slow(self, role: Role) -> bool:
        """Return whether a value comes by the mailbox of a PLC, which is too slow for a poll."""
        return self._params.by_mailbox(self._state.model.key(role))

    async def _check_scales(self, *, all_of_them: bool) -> bool:
        """
        Read what scales set-points, or any value, and stop the motor if that was changed.

        :returns: whether each was answered.
        """
        state, scales = self._state, self._state.nameplate.scales
        target = state.model.profile.setpoints.get(state.control_mode)
        keys = scales.keys if all_of_them else scales.of(target.key) if target else ()
        for key in keys:
            before = scales.found.get(key)
            read = functools.partial(scales.read_one, key, self._plan.priority)
            try:
                now = await self._read(key, read, _TRIES)
            except Refused:
                # it may be busy
                continue
            if now is None:
                return False
            controller = self._controller
            # a start that is under way reads them itself
            if before not in (None, now) and controller is not None and state.control.enabled:
                change = ParameterChange(key, before, now, state.model[key].unit)
                controller.stop_because(Report(Cause.SCALE_CHANGED, change=change))
        return True

    def _report_fault(self, status: InverterStatus, reported: bool) -> None:
        """Report on change that a fault is active, unless a stop because of it was reported."""
        code = status.code if status.faulted else 0
        if code and code != self._reported_fault and not reported:
            fault = explain_fault(self._state, status)
            self._state.notify(Severity.ERROR, Cause.FAULT_APPEARED, fault=fault)
        self._reported_fault = code

    async def _measure(self, role: Role) -> float:
        """Measure a value anew; NaN if a drive that responds does not give it."""
        state = self._state
        status = state.status
        measurements = state.measurements
        if role is measurements.turning.role and status and not math.isnan(status.frequency):
            # it came with the status
            return measurements.last(role).value
        key = state.model.key(role)
        try:
            tries = 1 if self._contact.is_failing(key) else _MEASURED_TRIES
            value = await self._read(
                key, lambda: measurements.measure(key, self._plan.priority, state.status), tries
            )
        except (PortError, Interrupted):
            # raised once only: the status that is read next would show a drive that was stopped
            raise
        except Refused:
            value = NAN
        except LinkError:
            if self._contact.is_silent_for_long:
                raise
            value = NAN
        if value is None:
            # the last one counts until the next poll
            return measurements.last(role).value
        measurements.take_value(role, value)
        if role in state.model.roles:
            self._plan.measured(self._bus.running - self._requested_at)
        return value

    async def _read_mode(self, status: InverterStatus) -> bool:
        """Read the control mode, and judge the status by it; return whether it was answered."""
        state = self._state
        before = state.control_mode
        mode = await self._read(
            MODE, lambda: state.read_control_mode(self._plan.priority, retry=False), _TRIES
        )
        if mode not in (None, before) and self._controller:
            # before it is published: a set-point never has the unit of another mode
            self._controller.on_status(status)
        return mode is not None

    async def _read(self, what: str, read: Callable[[], Awaitable[_T]], tries: int) -> _T | None:
        """
        Do one read of a poll, again at once if need be; ``None``: the next poll has to.

        However seldom the polls, noise is no loss; and however bad a value, the status is read.

        :param what: by which its failures are counted.
        :raises LinkError: as for :meth:`_try`.
        """
        for _ in range(tries):
            if (answer := await self._try(what, read)) is not None:
                return answer
        return None

    async def _try(self, what: str, read: Callable[[], Awaitable[_T]]) -> _T | None:
        """
        Do one read of a poll, once; return ``None`` if it was not answered, and may be repeated.

        :param what: by which its failures are counted.
        :raises LinkError: the drive has been silent for too long, or has answered everything but
            this; it refuses; the port is gone; or the PLC has no valid data of it.
        """
        asked_at, self._requested_at = self._bus.now(), self._bus.running
        try:
            answer = await read()
        except (PortError, Refused, Interrupted, NoData):
            raise
        except LinkError as error:
            self._contact.dispatch(ContactEvent.MISSED)
            self._check_silence(asked_at, self._bus.now())
            if self._contact.read_failed(what, error):
                raise
            self._bus.recorder.retry(self._unit)
            return None
        self._contact.read_answered(what)
        self._setpoint.answered()
        return answer

    def _check_silence(self, asked_at: float, now: float) -> None:
        """Report a silence of more than one lost answer to what may have to stop the motor."""
        # it has begun before the request that was in vain just now
        if self._controller is not None and self._contact.was_silent_at(asked_at):
            self._controller.silent(now - self._contact.last_frame_at)

    def _paused(self, seconds: float) -> None:
        """Note that the driver did not run for so long, s."""
        if self._controller is not None:
            self._controller.paused(seconds)

    async def _be_heard(self) -> None:
        """Send the drive a request, ahead of what can wait."""
        with contextlib.suppress(LinkError):
            await self._state.keep_alive()

    def _look_for_loss(self) -> float:
        """Treat the drive as lost once it is silent for too long; return by when it may be, s."""
        state, now = self._state, self._bus.now()
        if not state.contact.connected or self._task is None:
            return math.inf
        # a motor that may run is watched all the time
        lost_at = self._contact.lost_at(is_watched=state.control.stop_owed)
        if not self._contact.was_asked_itself:
            # it is only the others that were asked in vain
            look_at = lost_at - min(_LOOK_BEFORE_LOSS, state.settings.lost_after / 2)
            if now < look_at:
                return look_at
            if self._look_task is None or self._look_task.future.done():
                self._look_task, self._looked_at = self._bus.spawn(self._be_heard()), now
            lost_at = max(lost_at, self._looked_at + _LOOKED_FOR)
        if now < lost_at:
            return lost_at
        self._begin_anew(silent(self._unit))
        return math.inf

    def _on_poll_failed(self, error: LinkError | DriveError) -> None:
        state = self._state
        is_lost = self._contact.poll_failed(error)
        if not self._contact.connected:
            self._plan.connecting_failed()
            if isinstance(error, DriveError) and error.report != self._complaint:
                # what keeps the drive from being used is reported once
                self._complaint = error.report
                state.notify(Severity.ERROR, error.report)
            return
        if is_lost:
            self._mark_lost(error)

    def _mark_lost(self, error: LinkError | DriveError) -> None:
        """Treat the drive as lost until it can be connected to again, and report why."""
        state = self._state
        self._contact.dispatch(ContactEvent.LOST)
        why = explain_failure(error, state)
        self._bus.recorder.cycle(self._unit, math.nan)
        in_use = self._controller is not None and self._controller.lost(why)
        cause = Cause.LOST_IN_USE if in_use else Cause.LOST
        state.notify(Severity.ERROR, cause, why=why)
        try:
            self._publish(None)
        except Exception:
            # an error of the listener must not end the polling
            _log.exception('the loss of the drive could not be reported')

    def publish_change(self) -> None:
        """
        Publish what is known, if that is not what was published last.

        However seldom the polls: what the driver acts on is shown when it changes.
        """
        def publish() -> None:
            try:
                self._publish_changed()
            except Exception:
                # an error of the listener must end nothing
                _log.exception('a change could not be reported')

        # what happens at this moment may change more of it, and be a stop, which goes first
        self._bus.call(publish)

    def _publish_changed(self) -> None:
        """Publish what is known if it has changed, but for what the next poll has to show."""
        state = self._state
        if self._task is None:
            return
        if state.contact.connected:
            # a stop may have read it since
            is_old = state.status is not None and state.status.at < self._bus.resumed_at
            # on a slow line one may be enabled before it is measured for the first time
            is_shown = self.snapshot.connected or state.control.enabled
            if is_old or not is_shown:
                # it is read, or measured for the first time, at once
                return
        snapshot = self._snapshot(state.status if state.contact.connected else None, polled=False)
        if not snapshot.shows_the_same(self.snapshot):
            self._show(snapshot)

    def show_stop(self) -> None:
        """Have what is known published until the motor is stopped."""
        self._bus.cancel(self._show_task)
        self._show_task = self._bus.spawn(self._show_while_stopping())

    async def _show_while_stopping(self) -> None:
        """Publish what is known while the stop of a drive that answers in part delays its polls."""
        control = self._state.control
        pause = _SHOW_PERIOD
        while control.stopping:
            paused = self._bus.paused
            await self._bus.sleep(pause)
            left = self._shown_at + _SHOW_PERIOD - self._bus.now()
            pause = left if left > 0 else _SHOW_PERIOD
            waits = left <= 0 and paused == self._bus.paused and control.stopping
            # one that was lost has shown nothing since that could be shown again
            known = self._contact.connected and self.snapshot.connected
            if waits and known and self._task is not None:
                self._publish(self._state.status)

    def _measured(self, role: Role | None, *, polled: bool) -> Measured:
        """Return what was measured last; nothing from before a pause, until a poll has passed."""
        last = self._state.measurements.last(role)
        polled |= self._bus.paused == self._status_paused
        return last if polled or last.at >= self._bus.resumed_at else NOT_MEASURED

    def _publish(self, status: InverterStatus | None) -> None:
        self._show(self._snapshot(status))

    def _show(self, snapshot: Snapshot) -> None:
        self.snapshot = snapshot
        self._shown_at = self._bus.now()
        self._state.listener.on_snapshot(snapshot)

    def _snapshot(self, status: InverterStatus | None, *, polled: bool = True) -> Snapshot:
        state = self._state
        if status is not None and state.status is not None and state.status.at > status.at:
            # a command has read a newer one: the drive may be enabled since, its fault acknowledged
            status = state.status
        measured = (*_BASIC, state.controlled)
        frequency, speed, controlled = (self._measured(role, polled=polled) for role in measured)
        actual = state.measurements.shown(state.controlled, controlled.value)
        stop = None if self._controller is None else self._controller.stopped_for
        return take_snapshot(
            state, self._setpoint, status, frequency, speed, actual, stop, polled=polled
        )


def take_snapshot(
    state: DriveState,
    setpoint: Setpoint,
    status: InverterStatus | None = None,
    frequency: Measured = NOT_MEASURED,
    speed: Measured = NOT_MEASURED,
    actual: float = NAN,
    stop: Report | None = None,
    *,
    polled: bool = True,
) -> Snapshot:
    """Return a snapshot; without a status while the drive is not connected."""
    common = (state.contact.connected, setpoint.following, state.settings.method)
    if status is None:
        return Snapshot(state.bus.now(), *common, stop=stop, polled=polled)
    code = status.listed
    watched = state.settings.method == MONITOR
    return Snapshot(
        status.at,
        *common,
        status=status,
        control_mode=state.control_mode,
        unit=state.unit,
        setpoint=state.own_setpoint if watched else setpoint.commanded,
        setpoint_age=setpoint.age,
        setpoint_clamped=setpoint.clamped,
        text=state.text_of(status),
        description=code.description,
        remedy=code.remedy,
        kind=status.kind,
        requires_ack=code.requires_ack,
        frequency=state.measurements.shown(Role.ACTUAL_FREQUENCY, frequency.value),
        frequency_at=frequency.at,
        speed=state.measurements.shown(Role.ACTUAL_SPEED, speed.value),
        speed_at=speed.at,
        actual=actual,
        stop=stop,
        polled=polled,
    )
