# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The tasks of a bus worker: coroutines that await transactions and pauses; slots."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Generator, Iterator, Sequence
from concurrent.futures import Future
import contextlib
from dataclasses import dataclass
import enum
import heapq
import itertools
import logging
import math
from typing import Any, TypeVar

from nfo_sinus_driver.link import (
    Address,
    Ask,
    DamagedAnswer,
    Identification,
    InProgress,
    LinkError,
    Operation,
    Plan,
    PortError,
    Read,
    Refused,
    Reply,
    WriteAndRead,
    Written,
)

_log = logging.getLogger(__name__)
_Found = TypeVar('_Found')

#: How often the parts of a value that changes meanwhile are read again.
_TRIES = 5


class Priority(enum.IntEnum):
    """The urgency of a transaction; the least goes first."""

    STOP = 0
    #: Reads whether a motor stops, or has to be stopped: no stop waits for it.
    LOOK = 1
    SETPOINT = 2
    SERVICE = 3
    POLL = 4
    TELEMETRY = 5
    REFRESH = 6


class Cancelled(BaseException):
    """
    Raised inside a coroutine whose task was cancelled.

    Not an ``Exception``, so that a coroutine that survives every mistake still ends.
    """


@dataclass(eq=False, slots=True)
class Request:
    """
    What is wanted of a unit; a coroutine awaits its answer.

    :ivar require_wanted: called by the worker at the moment of sending; what it raises goes to the
        coroutine, and nothing is sent.
    :ivar is_brief: its answer is waited for no longer than the unit has ever taken: it is sent for
        the unit to hear it.
    :ivar anew: it is read once more already, because what it read was old.
    """

    unit: int
    operation: Operation
    priority: Priority
    require_wanted: Callable[[], None] = lambda: None
    is_brief: bool = False
    anew: bool = False

    @property
    def writes(self) -> bool:
        """It writes a parameter."""
        return not isinstance(self.operation, (Read, Ask))

    @property
    def is_for_all(self) -> bool:
        """Every unit answers it; a question who it is some ignore, and that is no silence."""
        return not isinstance(self.operation, Ask)

    def reads(self, unit: int, address: Address) -> bool:
        """Return whether it only reads a parameter."""
        operation = self.operation
        return isinstance(operation, Read) and (self.unit, operation.address) == (unit, address)

    def without_old(self, reply: Reply) -> Reply:
        """
        Return what counts of a reply that a worker took which has paused meanwhile.

        :raises InProgress: it is to be read again.
        """
        operation = self.operation
        if isinstance(operation, WriteAndRead):
            return reply._replace(data=b'')
        if isinstance(operation, Read) and not (operation.once or self.anew):
            self.anew = True
            raise InProgress(reply.arrived)
        return reply

    def __await__(self) -> Generator[Request, Reply, Reply]:
        return (yield self)


async def consistent_read(unit: int, parts: Sequence[Address], priority: Priority) -> Reply:
    """
    Read a value each of whose two parts is a transaction of its own, so that a stop may go between.

    The high part, the low one, and the high one again until it stands still: the value may change
    meanwhile, but what is returned has been the value at one moment.

    :param parts: the low one, then the high one.
    :raises DamagedAnswer: it never stood still.
    :raises LinkError: as the link does.
    """
    low_part, high_part = parts
    high = await Request(unit, Read(high_part), priority)
    for _ in range(_TRIES):
        low = await Request(unit, Read(low_part), priority)
        again = await Request(unit, Read(high_part), priority)
        if again.data == high.data:
            # the drive had both at the moment in between; the last answer may be from after a write
            return Reply(low.data + high.data, low.arrived)
        high = again
    raise DamagedAnswer(f'unit {unit}: {high_part.space} {high_part.index:04X}h never stood still')


async def inquire(unit: int, questions: Plan[Identification], priority: Priority) -> Identification:
    """Ask a unit who it is, each question once and by itself; return what was found."""

    async def ask(question: Operation) -> Reply | None:
        try:
            return await Request(unit, question, priority)
        except PortError:
            raise
        except LinkError as error:
            _log.debug('unit %d does not identify itself: %s', unit, error)
            return None

    return await _follow(questions, ask)


async def set_up(
    unit: int,
    steps: Plan[str],
    priority: Priority,
    tries: int,
    require_wanted: Callable[[], None],
) -> str:
    """
    Have a unit watch this end of the line, each step by itself; return by which means.

    :param tries: how often a step without an answer is tried: each may be done again.
    :param require_wanted: as for :class:`Request`.
    """

    async def ask(step: Operation) -> Reply | None:
        for left in reversed(range(tries)):
            try:
                return await Request(unit, step, priority, require_wanted)
            except LinkError as error:
                if isinstance(error, Refused) and not error.is_busy:
                    return None
                if isinstance(error, PortError) or not left:
                    raise
        raise AssertionError

    return await _follow(steps, ask)


async def _follow(
    plan: Plan[_Found], ask: Callable[[Operation], Coroutine[Any, Any, Reply | None]]
) -> _Found:
    reply = None
    while True:
        try:
            step = plan.send(reply)
        except StopIteration as end:
            found: _Found = end.value
            return found
        reply = await ask(step)


@dataclass(eq=False, slots=True)
class Pause:
    """
    A wait until a moment, or until the task is woken.

    :ivar or_opening: it ends when the port is opened, too.
    """

    until: float
    or_opening: bool = False

    def __await__(self) -> Generator[Pause, None, None]:
        yield self


class Task:
    """A coroutine on the bus; :attr:`future` has its result, or what explains its error."""

    def __init__(
        self,
        coroutine: Coroutine[Any, Any, Any],
        explain: Callable[[BaseException], BaseException] = lambda error: error,
        *,
        stops: bool = False,
    ) -> None:
        self._coroutine = coroutine
        self._explain = explain
        #: It stops a motor.
        self.stops = stops
        #: How many requests it has made.
        self.requests = 0
        self.future: Future[Any] = Future()
        self.cancelled = False
        #: It is being stepped, so :class:`Cancelled` can only reach it where it awaits next.
        self.running = False
        self.cancel_due = False
        #: What it waits for.
        self.awaited: Request | Pause | None = None
        #: Distinguishes the timers of earlier pauses from that of the present one.
        self.pause = 0
        self.asleep = False
        self._joiners: list[Task] = []
        # the future is cancelled by the worker alone
        self.future.set_running_or_notify_cancel()

    @property
    def joiners(self) -> tuple[Task, ...]:
        """Tasks that wait for the end of this one."""
        return tuple(self._joiners)

    @contextlib.contextmanager
    def joined_by(self, other: Task) -> Iterator[None]:
        """Wake another task at its end, meanwhile."""
        self._joiners.append(other)
        try:
            yield
        finally:
            self._joiners.remove(other)

    def cancel(self) -> None:
        """End it where it awaits: at once, or at the next await if it is being stepped."""
        self.cancelled = True
        self.cancel_due = self.running
        if not self.running:
            self.end_pause()

    def take_cancellation(self) -> bool:
        """Return whether its cancellation still has to reach it, once."""
        due, self.cancel_due = self.cancel_due, False
        return due

    def fall_asleep(self) -> None:
        """Begin a pause."""
        self.asleep = True

    def end_pause(self) -> None:
        """End its pause, if it is in one: no timer of it counts any more."""
        self.asleep = False
        self.pause += 1

    def step(self, value: Any, error: BaseException | None) -> Request | Pause | None:
        """Run it up to what it awaits next; ``None`` when it has ended."""
        self.running = True
        self.awaited = None
        try:
            coroutine = self._coroutine
            awaited = coroutine.throw(error) if error is not None else coroutine.send(value)
        except StopIteration as end:
            self.future.set_result(end.value)
        except BaseException as failure:
            self.future.set_exception(self._explain(failure))
        else:
            assert isinstance(awaited, (Request, Pause))
            self.awaited = awaited
            self.requests += isinstance(awaited, Request)
            return awaited
        finally:
            self.running = False
        return None


def log_unexpected(future: Future[Any]) -> None:
    """Log the error of a task that is not awaited, unless it was cancelled or the line failed."""
    error = future.exception()
    if error is not None and not isinstance(error, (Cancelled, LinkError)):
        _log.error('a task on the bus failed', exc_info=error)


class Sleepers:
    """Tasks in a pause, by the moment at which each ends."""

    def __init__(self) -> None:
        self._pauses: list[tuple[float, int, Task, int]] = []
        self._order = itertools.count()

    def add(self, task: Task, until: float) -> None:
        """Have a task sleep until a moment of the steady clock, s."""
        task.fall_asleep()
        heapq.heappush(self._pauses, (until, next(self._order), task, task.pause))

    def take_due(self, now: float) -> Task | None:
        """Remove and return one whose pause is over; ``None`` if all go on."""
        while self._pauses and self._pauses[0][0] <= now:
            _, _, task, pause = heapq.heappop(self._pauses)
            if task.asleep and task.pause == pause:
                return task
        return None

    @property
    def next_moment(self) -> float:
        """When the next pause is over, s; infinity if no task sleeps."""
        return self._pauses[0][0] if self._pauses else math.inf


@dataclass(eq=False)
class LatestValue:
    """
    A place for one pending write of which only the latest counts, such as a set-point.

    :ivar unit: whose it is; one that does not answer has a share of the time only.
    :ivar make: called by the worker at the moment of sending; returns what to write now, or
        ``None`` if there is nothing to write any more.
    :ivar done: called by the worker with the error, or ``None`` when the unit took it.
    :ivar answered: called after that with the answer of a unit that took it.
    :ivar urgent: returns whether it goes ahead all the same; called by any thread.
    """

    unit: int
    make: Callable[[], Written | None]
    done: Callable[[Written, LinkError | None], None]
    answered: Callable[[Reply], None] = lambda reply: None
    pending: bool = False
    urgent: Callable[[], bool] = lambda: False

    def ask(self) -> bool:
        """Mark it for writing; return whether that is new."""
        # only set when read as False: the worker may be taking it out
        if self.pending:
            return False
        self.pending = True
        return True

    def take_value(self) -> Written | None:
        """Return what is to be written now; ``None`` if there is nothing any more."""
        self.pending = False
        return self.make()
