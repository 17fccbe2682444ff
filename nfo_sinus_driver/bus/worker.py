# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The worker of one line.

One worker thread owns the link. What takes several transactions is a coroutine
(``async def``) that awaits :meth:`Bus.ask` and :meth:`Bus.sleep`; the worker steps all of
them and sends one transaction at a time, the most urgent first. So the state that coroutines share
is only ever touched by the worker, a stop waits for one transaction at most, and nothing that a
coroutine raises can end the worker.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Awaitable, Callable, Coroutine, Iterator
from concurrent.futures import Future
import contextlib
import ctypes
import dataclasses
import functools
import logging
import math
import threading
import time
from typing import Any, NamedTuple, TypeVar

from nfo_sinus_driver.bus.mute_port import MutePort
from nfo_sinus_driver.bus.scheduler import Scheduler, Waiting
from nfo_sinus_driver.bus.silences import Silences
from nfo_sinus_driver.bus.statistics import Recorder, Statistics
from nfo_sinus_driver.bus.tasks import (
    Cancelled,
    LatestValue,
    Pause,
    Priority,
    Request,
    Sleepers,
    Task,
    consistent_read,
    inquire,
    log_unexpected,
    set_up,
)
from nfo_sinus_driver.link import (
    Address,
    AnotherValue,
    Clock,
    Identification,
    InProgress,
    LineProtocol,
    Link,
    LinkError,
    NoAnswer,
    NotReady,
    Operation,
    PortError,
    Read,
    Reconnect,
    Refused,
    Reply,
    Why,
)

_log = logging.getLogger(__name__)
_T = TypeVar('_T')

#: How often a lost port is tried again, s.
REOPEN_PERIOD = 0.5


#: What share of the time after which another drive is lost a silent one may have at a time.
_OF_A_LOSS = 1 / 4
#: The same of a drive that has answered so far.
_ALONE_OF_A_LOSS = 1 / 2


class Watch(NamedTuple):
    """
    What a line has to do with a drive beside its requests; called on the worker.

    :ivar look_for_loss: called before each request while the unit, or no unit, answers; returns
        when it has to be called again at the latest, s, or infinity.
    :ivar may_run: returns whether the driver may have run its motor.
    :ivar paused: told for how long the worker has not run, s.
    """

    look_for_loss: Callable[[], float]
    may_run: Callable[[], bool]
    paused: Callable[[float], None]


class Bus:
    """
    The line that several drives share; it opens, closes and re-opens the link.

    What is read and written with it is awaited by coroutines on the worker.

    :param max_requests: how many are sent a second at most, stops aside; 0: no limit.
    :param now: the steady clock of the link, and of all that run on the bus, s.
    :raises LinkError: a transaction fails, as the link does.
    """

    def __init__(
        self, link: Link, max_requests: float = 0.0, now: Clock = time.monotonic
    ) -> None:
        self._link = link
        self.now = now
        self._clock = link.clock
        #: For how long the worker had paused when that was last noted, s.
        self._paused = 0.0
        self._request_period = 1 / max_requests if max_requests else 0.0
        #: Until then only stops are sent.
        self._paced_until = -math.inf
        self._port = Reconnect(link)
        self._inbox: deque[Task | LatestValue | Callable[[], None]] = deque()
        self._awake = threading.Event()
        #: A stop has come in since the inbox was emptied last.
        self._stop_waits = False
        link.end_listening_if(lambda: self._stop_waits)
        #: Which units do not answer, for coroutines on the worker.
        self.silences = Silences()
        self._mute_port = MutePort()
        self._scheduler = Scheduler(
            self.silences.is_silent,
            lambda unit: self.silences.is_missing(unit, self.now()),
            lambda: self.silences.is_line_silent,
            self.silences.asked_at,
            lambda unit: self._is_held_until(self._rests_until(unit)),
            lambda unit: self._is_held_until(link.pauses.silent_until(unit)),
            link.answers_twice,
        )
        #: When the first of those that wait for a pause may go, s.
        self._held_until = math.inf
        #: Until when each unit is asked nothing, s.
        self._resting: dict[int, float] = {}
        self._sleepers = Sleepers()
        self._stopping = False
        self._closed = False
        #: In the order in which they began, so that one history gives one order of requests.
        self._tasks: dict[Task, None] = {}
        #: For coroutines on the worker to count in.
        self.recorder = Recorder(now)
        #: How many coroutines read parameters all the time; they share the time for it.
        self._refreshing = 0
        #: The units whose settings are read for the first time, and those for which that was begun.
        self._being_read_first: set[int] = set()
        self._read_before: set[int] = set()
        self._current: Task | None = None
        #: The drives of the line, and for how long the worker had paused when they were told.
        self._watches: dict[int, Watch] = {}
        self._pause_told = 0.0
        #: When the next drive that does not answer is lost, s.
        self._lost_at = math.inf
        #: Until when each unit is left alone, s.
        self._quiet_until: dict[int, float] = {}
        #: Called when the port is found mute, and when it is not any more.
        self._on_mute: Callable[[float], None] = lambda seconds: None
        self._is_mute = False
        #: For which opening of a mute port those were woken that wait for it: one that asks nothing
        #: all the same is not woken for it again.
        self._woken_for = math.inf
        #: How many writes were not answered since any unit has answered one.
        self.writes_in_vain = 0
        #: Called when a unit has restarted.
        self._on_restart: dict[int, Callable[[], None]] = {}
        self._thread = threading.Thread(target=self._work, name='bus', daemon=True)

    # --- for every thread ---------------------------------------------------------------------

    def start(self) -> None:
        """Start the worker; it opens the port and keeps trying if that fails."""
        self._thread.start()

    def close(self, timeout: float = 5.0) -> None:
        """
        End the worker after its present transaction and close the port.

        Every coroutine that has not ended is cancelled; one that comes later never begins.
        """
        self._stopping = True
        self._awake.set()
        if self._thread.is_alive():
            self._thread.join(timeout)
        elif not self._closed:
            self._end()

    def run(
        self,
        coroutine: Coroutine[Any, Any, _T],
        explain: Callable[[BaseException], BaseException] = lambda error: error,
        *,
        stops: bool = False,
    ) -> Future[_T]:
        """
        Run a coroutine on the worker; the future has its result, or what it raises.

        :param explain: returns what the future raises instead; :class:`Cancelled` may come before
            the coroutine has begun, where it cannot catch that itself.
        :param stops: it stops a motor, so what is on the line ends as soon as it can.
        """
        task = Task(coroutine, explain, stops=stops)
        self._enter(task)
        if stops:
            # not before: the worker may be emptying its inbox
            self._stop_waits = True
        return task.future

    def call(self, function: Callable[[], None]) -> None:
        """Have the worker call a short function between two transactions."""
        self._enter(function)

    def request(self, slot: LatestValue) -> None:
        """Request that a slot is written; again before it is written may only make it urgent."""
        if slot.ask() or slot.urgent():
            self._enter(slot)

    @property
    def protocol(self) -> LineProtocol:
        """The protocol of this line."""
        return self._link.protocol

    @property
    def supervised(self) -> bool:
        """The line has a heartbeat or guarding, too; see :meth:`watch`."""
        return self._link.supervision is not None

    @property
    def alive(self) -> bool:
        """The worker works."""
        return self._thread.is_alive()

    def statistics(self, unit: int | None = None) -> Statistics:
        """Return the counters and times of the line, or of one unit on it."""
        figures = self.recorder.statistics(unit)
        if unit is not None:
            return figures
        return dataclasses.replace(figures, foreign_frames=self._link.remarks.foreign_frames)

    def round_time(self) -> float:
        """Return how long it takes to ask each drive of the line once, s; NaN: not known yet."""
        mean = self.recorder.statistics(None).round_trip_mean
        return len(self._watches) * max(mean, self._request_period) + self.pauses_time()

    def pauses_time(self) -> float:
        """Return how long the pauses are in a round in which each drive is asked once, s."""
        return self._link.pauses.round(self._watches)

    @property
    def port_error(self) -> PortError | None:
        """Why the port is not open, or ``None`` when it is."""
        return None if self._port.is_open else self._port.error

    def use_resync_reads(self, unit: int, addresses: tuple[Address, ...], why: Why = None) -> None:
        """Give the link the parameters of a unit that it may read; see its method of this name."""
        self.call(lambda: self._link.use_resync_reads(unit, addresses, why))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the link has noticed about the line, in sentences that say what to do."""
        return self._link.remarks.texts

    def require_gap(self, unit: int, seconds: float) -> None:
        """Have the line silent for so long, s, before each request to a unit."""
        self.call(lambda: self._link.pauses.require(unit, seconds))

    def require_sign_of_life(self, unit: int, seconds: float) -> None:
        """Open the port again when no unit has answered for ``seconds``, the longest of all."""
        self.call(lambda: self.silences.watch(unit, seconds))

    def watch_over(self, unit: int, watch: Watch) -> None:
        """Ask and tell, on the worker, what stands between the line and the drive of a unit."""
        self.call(lambda: self._watches.update({unit: watch}))

    def on_mute(self, call: Callable[[float], None]) -> None:
        """
        Call a function, on the worker, when the port is opened again because no unit answers.

        :param call: given for how long none has, s; and 0 when one answers again.
        """
        self._on_mute = call

    def on_restart(self, unit: int, call: Callable[[], None]) -> None:
        """Call a function, on the worker, when a unit reports that it has restarted."""
        self._on_restart[unit] = call

    # --- for coroutines on the worker ---------------------------------------------------------

    def ask(
        self,
        unit: int,
        operation: Operation,
        priority: Priority,
        require_wanted: Callable[[], None] = lambda: None,
    ) -> Awaitable[Reply]:
        """
        Have an operation carried out (to be awaited), a parameter of two parts read as one.

        :param require_wanted: called when its turn has come; if it raises, nothing is sent.
        """
        parts = self.protocol.parts(operation.address) if isinstance(operation, Read) else ()
        if len(parts) > 1:
            return consistent_read(unit, parts, priority)
        return Request(unit, operation, priority, require_wanted)

    @property
    def is_quiet(self) -> bool:
        """Nothing but stops is sent on the line."""
        return self._line_quiet_until() > 0.0

    def rest(self, unit: int, seconds: float) -> None:
        """Ask a unit nothing for so long from now on, s, no stop either; others are asked."""
        if seconds:
            self._resting[unit] = self.now() + seconds

    def keep_alive(self, unit: int, address: Address) -> Awaitable[Reply]:
        """Have a unit hear something soon (to be awaited), by reading a parameter of it."""
        return Request(unit, Read(address), Priority.LOOK, is_brief=True)

    def last_tries(self, seconds: float) -> None:
        """
        Open a port that is mute once more, in time for an end that takes ``seconds``.

        After half of them at the latest, however often that was in vain; and not twice, for what is
        behind it may restart each time.
        """
        self._mute_port.hurry(self.now() + seconds / 2, self.now() + seconds)

    def keep_quiet(self, unit: int, until: float) -> None:
        """
        Leave the whole line alone, stops aside, while each drive that may run is left alone.

        A drive may take any message on the line for a sign that the driver is there [C127]. So one
        at standstill may trip by its own time-out, in favour of a motor that runs.

        :param until: until when this one is, s of the steady clock.
        """
        self._quiet_until[unit] = until

    def answers_twice(self, unit: int) -> bool:
        """Return whether a unit does: what is read of it takes longer than a stop may wait."""
        return self._link.answers_twice(unit)

    @property
    def is_any_reached(self) -> bool:
        """A drive of the line that may run answers."""
        return any(
            watch.may_run() and not self.silences.is_silent(unit)
            for unit, watch in self._watches.items()
        )

    @property
    def is_any_controlled(self) -> bool:
        """A drive of the line that may run is not left alone."""
        return any(
            watch.may_run() and self.now() >= self._quiet_until.get(unit, -math.inf)
            for unit, watch in self._watches.items()
        )

    def answer(self, task: Task, unit: int, address: Address, reply: Reply) -> bool:
        """Give a task a reading that came with another answer; false if it waits for no such."""
        awaited = task.awaited
        if not isinstance(awaited, Request) or not awaited.reads(unit, address):
            return False
        self._scheduler.remove(Waiting(task, awaited))
        self._advance(task, reply, None)
        return True

    def identify(self, unit: int, priority: Priority) -> Coroutine[Any, Any, Identification]:
        """Read the identity of a unit, each part once; what it does not give stays empty."""
        return inquire(unit, self._link.identify(unit), priority)

    async def watch(
        self,
        unit: int,
        seconds: float,
        priority: Priority,
        tries: int,
        require_wanted: Callable[[], None] = lambda: None,
    ) -> str:
        """
        Have a unit watch the heartbeat or guarding, with a time-out, s; 0: no longer.

        :param tries: how often each step is tried.
        :param require_wanted: called before each step, as for a write.
        :returns: by which means; ``''`` if it has none, or for 0.
        """
        supervision = self._link.supervision
        return '' if supervision is None else await set_up(
            unit, supervision.watch(unit, seconds), priority, tries, require_wanted
        )

    def sleep(self, seconds: float, *, or_opening: bool = False) -> Pause:
        """Let time pass (to be awaited), or so much as is left until the port is opened."""
        return Pause(self.now() + seconds, or_opening)

    @property
    def current(self) -> Task | None:
        """The task that is being stepped, or ``None`` between two."""
        return self._current

    async def join(self, task: Task, timeout: float) -> bool:
        """Wait for the end of another task (to be awaited); false when the time is over."""
        if not task.future.done():
            me = self._current
            assert me is not None, 'only for coroutines on the bus'
            with task.joined_by(me):
                await self.sleep(timeout)
        return task.future.done()

    def spawn(self, coroutine: Coroutine[Any, Any, Any], *, stops: bool = False) -> Task:
        """
        Start a coroutine in parallel; unexpected errors are logged.

        :param stops: it stops a motor, so a port that is mute is not left alone for long.
        """
        task = Task(coroutine, stops=stops)
        task.future.add_done_callback(log_unexpected)
        self._advance(task, None, None)
        return task

    def cancel(self, task: Task | None) -> None:
        """End a task, if any: :class:`Cancelled` is raised in it; nothing more is sent."""
        if task is None or task.future.done() or task.cancelled:
            return
        task.cancel()
        if not task.running:
            self._scheduler.withdraw(task)
            self._advance(task, None, Cancelled())

    def wake(self, task: Task | None) -> None:
        """End the pause of a task early; harmless if it is not in one."""
        if task is not None and task.asleep:
            self._end_pause(task)

    @contextlib.contextmanager
    def refreshing(self) -> Iterator[Callable[[], int]]:
        """Count a task that reads parameters all the time; yield a call for their number."""
        self._refreshing += 1
        try:
            yield lambda: self._refreshing
        finally:
            self._refreshing -= 1

    @contextlib.contextmanager
    def first_reading(self, unit: int) -> Iterator[None]:
        """Have units at standstill leave the line to this one, if it is read the first time."""
        first = unit not in self._read_before
        self._read_before.add(unit)
        if first:
            self._being_read_first.add(unit)
        try:
            yield
        finally:
            if first:
                self._being_read_first.discard(unit)

    def reads_another_first(self, unit: int) -> bool:
        """Return whether any other unit is being read for the first time."""
        return bool(self._being_read_first - {unit})

    # --- the worker ---------------------------------------------------------------------------

    def _enter(self, item: Task | LatestValue | Callable[[], None]) -> None:
        self._inbox.append(item)
        self._awake.set()
        if self._closed:
            # the worker may have emptied its inbox for the last time
            self._take_in()

    def _work(self) -> None:
        set_timer_slack()
        while not self._stopping:
            try:
                self._rest(self.step())
            except BaseException:
                # an error in a callback must not end the worker for every drive on the line
                _log.exception('error in the bus worker; it goes on')
        self._end()

    def _end(self) -> None:
        self._port.close()
        self._closed = True
        self._take_in()
        for task in tuple(self._tasks):
            self.cancel(task)

    def step(self) -> float:
        """
        Do what is due, and send one transaction at most; public for use without :meth:`start`.

        :returns: when there is more to do, s on the steady clock, unless a request comes before.
        """
        if self._awake.is_set():
            self._awake.clear()
        self._note_pause()
        self._take_in()
        self._ring_timers()
        self._tell_pause()
        # ahead of the port: to open it may take long
        self._lost_at = self._look_for_losses()
        reopen_at = self._open_when_due()
        quiet_until = self._line_quiet_until()
        supervised_at = math.inf
        if self._port.is_open and not quiet_until:
            supervised_at = self._supervise()
        if not self._port.is_open:
            self._fail_all(self._port.error)
            return self._clock.until(min(self._sleepers.next_moment, self._port.reopen_at))
        if self._send_next(only_stops=bool(quiet_until)):
            return -math.inf
        until = min(self._held_until, supervised_at, reopen_at)
        if quiet_until:
            until = min(quiet_until, self._held_until)
        return self._clock.until(min(self._sleepers.next_moment, self._lost_at, until))

    def _look_for_losses(self) -> float:
        """Have the drives looked at that do not answer; return when again, s."""
        if not self.silences.any_silent:
            return math.inf
        again_at = math.inf
        for unit, watch in self._watches.items():
            if self.silences.is_silent(unit) or self.silences.is_line_silent:
                again_at = min(again_at, watch.look_for_loss())
        return again_at

    def _tell_pause(self) -> None:
        """Tell all drives, ahead of the next request, that the worker did not run."""
        seconds = self._clock.paused - self._pause_told
        if seconds:
            self._pause_told = self._clock.paused
            for watch in self._watches.values():
                watch.paused(seconds)

    def _line_quiet_until(self) -> float:
        """Return until when only stops are sent, s: all that may run are left alone; 0: not so."""
        if not self._quiet_until:
            return 0.0
        now = self.now()
        self._quiet_until = {unit: at for unit, at in self._quiet_until.items() if at > now}
        if not self._quiet_until or self.is_any_controlled:
            return 0.0
        return min(self._quiet_until.values())

    @property
    def paused(self) -> float:
        """For how long the worker has not run so far, s; for coroutines on it."""
        return self._clock.paused

    @property
    def running(self) -> float:
        """The time, but for the time in which the worker did not run, s."""
        return self.now() - self._clock.paused

    @property
    def resumed_at(self) -> float:
        """When the worker last ran again after it had not, s; for coroutines on it."""
        return self._clock.resumed_at

    def _note_pause(self) -> float:
        """Return for how long the worker has not run since the last call, s."""
        self._clock()
        seconds = self._clock.paused - self._paused
        if seconds:
            self._paused = self._clock.paused
            self.silences.paused(seconds)
            self._mute_port.paused(seconds)
        return seconds

    def _supervise(self) -> float:
        """Serve heartbeat and guarding; return when that is due again, s."""
        supervision = self._link.supervision
        if supervision is None:
            return math.inf
        now = self.now()
        if now >= supervision.due:
            try:
                supervision.serve()
            except PortError as error:
                self._port.mark_lost(error, now + REOPEN_PERIOD)
        for unit in supervision.take_restarted():
            try:
                self._on_restart.get(unit, lambda: None)()
            except Exception:
                # the other drives of the line have to be notified all the same
                _log.exception('a restart could not be reported; the bus worker goes on')
        return supervision.due

    def _take_in(self) -> None:
        self._stop_waits = False
        while self._inbox:
            item = self._inbox.popleft()
            if isinstance(item, Task):
                self._advance(item, None, Cancelled() if self._closed else None)
            elif isinstance(item, LatestValue):
                self._scheduler.add(item)
            else:
                item()

    def _ring_timers(self) -> None:
        now = self.now()
        while (task := self._sleepers.take_due(now)) is not None:
            self._end_pause(task)

    def _end_pause(self, task: Task) -> None:
        task.end_pause()
        self._advance(task, None, None)

    def _rest(self, until: float) -> None:
        # no lock is touched between two transactions of a full line
        if until > -math.inf and not self._inbox and not self._stopping:
            self._awake.wait(None if until == math.inf else max(0.0, until - self.now()))

    def _advance(self, task: Task, value: Reply | None, error: BaseException | None) -> None:
        """Step a task and queue what it awaits next."""
        caller, self._current = self._current, task
        awaited = task.step(value, error)
        self._current = caller
        if awaited is not None and (task.take_cancellation() or self._closed):
            self._advance(task, None, Cancelled())
            return
        if awaited is None:
            self._tasks.pop(task, None)
            for joiner in task.joiners:
                self.wake(joiner)
            return
        self._tasks[task] = None
        if isinstance(awaited, Request):
            self._scheduler.add(Waiting(task, awaited))
        else:
            self._sleepers.add(task, awaited.until)

    def _send_next(self, *, only_stops: bool) -> bool:
        now = self.now()
        self._held_until = math.inf
        scheduler, silences = self._scheduler, self.silences
        is_paced, missing = now < self._paced_until, now >= silences.missing_from
        in_noise_from = silences.stops_in_vain_from(now)
        entry = scheduler.next_entry(
            missing=missing,
            in_noise=now >= in_noise_from,
            only_stops=only_stops or is_paced,
        )
        if is_paced and (scheduler.waits or (missing and scheduler.missing_wait)):
            self._held_until = min(self._held_until, self._paced_until)
        if scheduler.missing_wait and not missing:
            self._held_until = min(self._held_until, silences.missing_from)
            if now < in_noise_from < math.inf and scheduler.stops:
                self._held_until = min(self._held_until, in_noise_from)
        if isinstance(entry, LatestValue):
            self._write_slot(entry)
        elif entry is not None:
            self._serve(*entry)
        return entry is not None

    def _rests_until(self, unit: int) -> float:
        return max(self._link.pauses.rests_until(unit), self._resting.get(unit, -math.inf))

    def _is_held_until(self, moment: float) -> bool:
        """Return whether a moment has not come yet, and note it."""
        if moment <= self.now():
            return False
        self._held_until = min(self._held_until, moment)
        return True

    def _write_slot(self, slot: LatestValue) -> None:
        written = slot.take_value()
        if written is None:
            return
        try:
            reply = self._transact(Request(slot.unit, written, Priority.SETPOINT))
        except NotReady as error:
            self._later(error.until, functools.partial(self.request, slot))
        except LinkError as error:
            slot.done(written, error)
        else:
            slot.done(written, None)
            slot.answered(reply)

    def _serve(self, task: Task, request: Request) -> None:
        try:
            request.require_wanted()
            reply = self._transact(request)
        except NotReady as error:
            self._later(error.until, functools.partial(self._resume, task, request))
        except Exception as error:
            # the line failed, or it is not wanted any more
            self._advance(task, None, error)
        else:
            self._advance(task, reply, None)

    def _resume(self, task: Task, request: Request) -> None:
        if task.awaited is request:
            self._scheduler.add(Waiting(task, request))

    def _later(self, until: float, function: Callable[[], None]) -> None:
        async def wait() -> None:
            await Pause(until)
            function()

        self.spawn(wait())

    def _transact(self, request: Request) -> Reply:
        """
        Carry out a transaction.

        What was read while the worker paused may be old: it is read again, once.
        """
        started = self._clock()
        silence = self._link.pauses.kept_silent(request.unit)
        paced_until = self._paced_until
        self._paced_until = started + self._request_period
        self._link.wait_at_most(self._patience(request, started))
        try:
            reply = request.operation.carry_out(self._link, request.unit)
            if self._clock.resumed_at > started:
                reply = request.without_old(reply)
        except InProgress:
            self._account(request, started, silence, None)
            raise
        except NotReady:
            self._paced_until = paced_until
            raise
        except LinkError as error:
            self._account(request, started, silence, error, tells=request.is_for_all)
            self._count_write(request, error)
            raise
        except BaseException as error:
            # an error in the link must reach the caller, not leave it waiting
            _log.exception('error in the link')
            raise LinkError(f'error in the link: {error!r}') from error
        if not reply.requests:
            self._paced_until = paced_until
        self._account(request, started, silence, None)
        self._count_write(request, None)
        return reply

    def _patience(self, request: Request, now: float) -> float:
        """Return how long an answer is waited for at most, s."""
        if self._scheduler.is_brief(request):
            return 0.0
        if self.silences.is_silent(request.unit) or self.silences.is_line_silent:
            # a loss is noticed when it is due, and no other drive is lost because of this one
            most = self._lost_at - now
            if len(self._watches) > 1:
                most = min(most, _OF_A_LOSS * self.silences.soonest_loss)
            return most
        if request.priority is Priority.SERVICE or self.protocol.most_requests:
            # a gateway would go on waiting, and so would the next request
            return math.inf
        # one lost answer is no loss, however long an answer may take
        return _ALONE_OF_A_LOSS * self.silences.soonest_loss

    def _account(
        self,
        request: Request,
        started: float,
        silence: float,
        error: LinkError | None,
        *,
        tells: bool = True,
    ) -> None:
        now, unit = self.now(), request.unit
        seconds = now - started - self._note_pause()
        if tells and unit != self.protocol.broadcast:
            is_stop = request.priority <= Priority.LOOK
            self.silences.note_request(unit, now, error, seconds, silence, is_stop=is_stop)
            ever_answered = self.silences.last_frame_at(unit) > -math.inf
            if self._mute_port.note_request(now, error, ever_answered=ever_answered):
                self._report_mute(0.0)
        self._scheduler.took(silence + seconds)
        if isinstance(error, PortError):
            self._port.mark_lost(error, now + REOPEN_PERIOD)
        else:
            self.recorder.transaction(unit, now, seconds, error, silence)

    def _count_write(self, request: Request, error: LinkError | None) -> None:
        if not request.writes or request.unit == self.protocol.broadcast:
            return
        if error is None or isinstance(error, (Refused, AnotherValue)):
            self.writes_in_vain = 0
        elif isinstance(error, NoAnswer):
            # what comes damaged shows that something comes
            self.writes_in_vain += 1

    def _open_when_due(self) -> float:
        """Open a port that is not open, or open and mute; return when to call it again, s."""
        now, lost = self.now(), not self._port.is_open
        due = self._port.reopen_at if lost else self._mute_until()
        if now < due:
            return due
        # ahead of the request that shows whether it helps
        if not lost:
            if not self._mute_port.is_mute_at(due, self._link.last_byte_at):
                # while the line is left alone a time-out of a drive runs, which a request may feed
                if due != self._woken_for and not self._line_quiet_until():
                    self._woken_for = due
                    self._wake_for_port()
                return math.inf
            if self._mute_port.heard:
                self._report_mute(self._mute_port.mute_for(now))
        self._port.open(now + REOPEN_PERIOD)
        if self._port.is_open:
            self.recorder.opened()
            self._mute_port.opened(self.now())
            if lost:
                self.silences.opened(self.now(), same_place=self._port.is_at_same_place)
            self._wake_for_port()
        return math.inf

    def _mute_until(self) -> float:
        """Return when a port that is open and mute is opened again, s; infinity: it is not."""
        if not self._mute_port.mute_for(self.now()):
            return math.inf
        stop_waits = any(task.stops for task in self._tasks)
        return self._mute_port.reopen_at(
            self._link.last_byte_at, self.silences.latest_loss, stop_waits=stop_waits
        )

    def _wake_for_port(self) -> None:
        """End the pauses that last until the port is opened."""
        for task in tuple(self._tasks):
            if isinstance(task.awaited, Pause) and task.awaited.or_opening:
                self.wake(task)

    def _report_mute(self, seconds: float) -> None:
        """Report on change for how long no unit has answered, s; 0: one does."""
        if self._is_mute == bool(seconds):
            return
        self._is_mute = not self._is_mute
        try:
            self._on_mute(seconds)
        except Exception:
            # the line has to be served all the same
            _log.exception('a mute port could not be reported; the bus worker goes on')

    def _fail_all(self, error: PortError) -> None:
        for entry in self._scheduler.clear():
            if isinstance(entry, LatestValue):
                self._fail_slot(entry, error)
            elif entry.task.awaited is entry.request:
                # else an earlier callback has ended it
                self._advance(entry.task, None, error)

    def _fail_slot(self, slot: LatestValue, error: PortError) -> None:
        try:
            written = slot.take_value()
            if written is not None:
                slot.done(written, error)
        except BaseException:
            # the others have to be notified all the same
            _log.exception('error in a slot; the bus worker goes on')


_PR_SET_TIMERSLACK = 29


def set_timer_slack() -> None:
    """Have this thread woken when it asked to be, not 50 microseconds later."""
    try:
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    except (OSError, AttributeError):
        # only a little precision is lost
        return
