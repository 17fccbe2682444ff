# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What is sent next on one line.

No thread, no clock and nothing sent: :class:`nfo_sinus_driver.bus.Bus` takes what is next, sends
it, and reports how long that kept the line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import itertools
import math
from typing import Literal, NamedTuple

from nfo_sinus_driver.bus.tasks import LatestValue, Priority, Request, Task

__all__ = ['BACKGROUND_SHARE', 'Scheduler', 'Waiting']

#: The share of the time that TELEMETRY and REFRESH get, each of them, when everything above wants
#: more; of the time that set-points leave, for else these would take nearly all from the polls.
BACKGROUND_SHARE = 1 / 6
#: The same for all polls and set-points of units that do not answer: each of them may cost a whole
#: time-out.
RETRY_SHARE = 1 / 2
#: How much of its share each may be owed while it waits for it, s: what it earns by two requests
#: without a response, when the time-out is that of the factory.
_MOST_OWED = 0.07
#: How much it may save up while it is idle, s: less than the shortest transaction takes.
_MOST_SAVED = 0.005
#: What takes no longer in vain is noise, s.
_PASSING = 0.1
_BACKGROUND = (Priority.TELEMETRY, Priority.REFRESH)
#: What only reads, and can wait for a unit that does not answer.
_READS = (Priority.POLL, *_BACKGROUND)

#: Polls and set-points for a unit that did not answer the last request.
_RETRY: Literal['retry'] = 'retry'
#: What is for a unit that has been silent for long.
_MISSING: Literal['missing'] = 'missing'
_SLOT: Literal['slot'] = 'slot'
_Rank = Priority | Literal['slot', 'retry', 'missing']
_STOPS = (Priority.STOP, Priority.LOOK)
#: How often all stops are sent where no unit answers, before anything else that may be in vain.
_ROUNDS = 2
#: Of so many stops in vain one is waited for as long as an answer may take, the second first.
_PATIENT = 8
#: What goes on at once where it was not answered.
_REPEATED = (*_STOPS, Priority.SERVICE)
_SHARES: dict[_Rank, float] = {
    _RETRY: RETRY_SHARE,
    Priority.TELEMETRY: BACKGROUND_SHARE,
    Priority.REFRESH: BACKGROUND_SHARE,
}


class Waiting(NamedTuple):
    """A transaction, and the task that awaits it."""

    task: Task
    request: Request


class _Tried(NamedTuple):
    """What was in vain: of which unit, a write or a read, of a stop or of a set-point 0."""

    unit: int
    writes: bool
    stops: bool


def _tried(entry: Waiting) -> _Tried:
    task, request = entry
    return _Tried(request.unit, request.writes, task.stops)


def _any_of(request: Request) -> list[_Tried]:
    """Return what a request may be, by the task that makes it."""
    return [_Tried(request.unit, request.writes, stops) for stops in (True, False)]


def _unit_of(entry: LatestValue | Waiting) -> int:
    return entry.unit if isinstance(entry, LatestValue) else entry.request.unit


class Scheduler:
    """
    What waits for the line, the next one in front.

    A stop goes first, its writes ahead of its reads, and a set-point in a slot next, so either
    waits for the transaction on the line and no other. The background, TELEMETRY and REFRESH, goes
    ahead of all else as long as it is owed its share of the time; what is owed more goes first.
    Set-points may come faster than the line can carry them, and without polls the fault that should
    stop the motor goes unnoticed: so after each of them something else has a turn, and the
    background's share is of the time between them.

    A unit that does not answer keeps the line for a time-out with every poll, and with every
    set-point but an urgent one. All of them together have no more than their share of the time as
    long as any other waits. A stop or a service that a unit does not answer is repeated at once,
    and after each of them another unit has a turn, too: the most urgent, whatever the others are
    owed, and none for which as much was in vain. Where no unit of the line answers, all stops go
    once, one after the other, ahead of everything else, which may be in vain as well; their answers
    are waited for briefly (:meth:`is_brief`). Then they go once more, ahead of all but requests to
    units that may answer.

    A unit that rests after its last answer lets all others go; where the line has to be silent for
    longer before a request, what is less urgent than that waits, too.

    Units that have been silent for long are missing. Reads from them, set-points, and stops that
    did not reach them, wait until :meth:`next_entry` may give them out, and then go ahead of other
    polls.

    :param is_silent: whether a unit has not answered the last request.
    :param is_missing: whether it has been silent for long.
    :param is_line_silent: whether no unit of the line answers.
    :param asked_at: when a unit was last sent anything, s.
    :param rests: whether a unit is to be asked nothing yet.
    :param needs_silence: whether the line has to be silent for longer before a request to it.
    :param answers_twice: whether an answer of it is certain only after a silence.
    """

    def __init__(
        self,
        is_silent: Callable[[int], bool] = lambda unit: False,
        is_missing: Callable[[int], bool] = lambda unit: False,
        is_line_silent: Callable[[], bool] = lambda: False,
        asked_at: Callable[[int], float] = lambda unit: -math.inf,
        rests: Callable[[int], bool] = lambda unit: False,
        needs_silence: Callable[[int], bool] = lambda unit: False,
        answers_twice: Callable[[int], bool] = lambda unit: False,
    ) -> None:
        self._is_silent = is_silent
        self._is_missing = is_missing
        self._is_line_silent = is_line_silent
        self._asked_at = asked_at
        self._rests = rests
        self._needs_silence = needs_silence
        self._answers_twice = answers_twice
        #: In order; the values are not used.
        self._queues: dict[_Rank, dict[LatestValue | Waiting, None]] = {
            rank: {} for rank in (*Priority, _SLOT, _RETRY, _MISSING)
        }
        #: How much time those that have a share are owed, s; they owe if that is negative.
        self._owed = dict.fromkeys(_SHARES, 0.0)
        #: What was given out just now, and of which rank.
        self._given: _Rank = _SLOT
        self._wanted: LatestValue | Waiting | None = None
        self._slot_went = False
        #: The stop, its read, or the service that has just not been answered.
        self._unanswered: Request | None = None
        #: What units have not answered since they last answered anything, and how often.
        self._unanswered_stops: dict[_Tried, int] = {}

    def add(self, entry: LatestValue | Waiting) -> None:
        """Queue a slot or a transaction, behind its equals."""
        self._queues[self._rank(entry)][entry] = None

    @property
    def missing_wait(self) -> bool:
        """Something waits that is for a missing unit."""
        return bool(self._queues[_MISSING])

    @property
    def stops(self) -> list[tuple[_Rank, Waiting]]:
        """The stops that may go, with their looks, and of which rank; none on a silent line."""
        if self._is_line_silent():
            return []
        return [
            (rank, entry)
            for rank in (*_STOPS, _MISSING)
            for entry in self._queues[rank]
            if isinstance(entry, Waiting)
            and entry.request.priority in _STOPS
            and not self._is_resting(entry)
        ]

    @property
    def waits(self) -> bool:
        """Anything waits that is not for a missing unit."""
        return any(queue for rank, queue in self._queues.items() if rank != _MISSING)

    def next_entry(
        self, *, missing: bool = True, in_noise: bool = False, only_stops: bool = False
    ) -> LatestValue | Waiting | None:
        """
        Take out what goes next, or ``None``; for a missing unit only with ``missing``.

        :param in_noise: of the stops goes that of which the fewest requests were made, whether its
            unit answers or not: those that answer more leave the others as much of the time.
        :param only_stops: everything but a stop has to wait.
        """
        self._release_found()
        if in_noise and (stops := self.stops):
            rank, stop = min(stops, key=self._requests_of)
            return None if self._needs_silence(stop.request.unit) else self._take_out(rank, stop)
        for rank in _STOPS if only_stops else self._order(missing):
            # most are empty, and this runs for every transaction
            entry = self._first(rank) if self._queues[rank] else None
            if entry is not None and self._needs_silence(_unit_of(entry)):
                # what is less urgent would end the silence, and this never had its turn
                entry = self._other_stop(rank)
                if entry is None:
                    return None
            if entry is not None:
                return self._take_out(rank, entry)
        if self._unanswered is None:
            return None
        # no other unit waits
        self._unanswered = None
        return self.next_entry(missing=missing, only_stops=only_stops)

    def _requests_of(self, stop: tuple[_Rank, Waiting]) -> tuple[int, bool, float]:
        """Return how many requests a stop has made; of equals the longest ago goes first."""
        _, (task, request) = stop
        unit = request.unit
        # none waits for another's silence but after its turn
        return task.requests, self._needs_silence(unit), self._asked_at(unit)

    def _take_out(self, rank: _Rank, entry: LatestValue | Waiting) -> LatestValue | Waiting:
        del self._queues[rank][entry]
        self._given = rank
        self._wanted = entry
        return entry

    def _release_found(self) -> None:
        """Requeue what waits for a unit that answers again: it may be a stop."""
        if not self._queues[_MISSING]:
            return
        missing = self._queues[_MISSING]
        found = [entry for entry in missing if self._rank(entry) != _MISSING]
        for entry in found:
            del missing[entry]
            self.add(entry)

    def _first(self, rank: _Rank) -> LatestValue | Waiting | None:
        """Return what goes next of one rank; what is for a unit that is silent by now is behind."""
        queue = self._queues[rank]
        while True:
            others = itertools.filterfalse(self._is_held, queue)
            entry = next(others, None)
            if entry is None or rank == _MISSING:
                return entry
            if rank in _STOPS and self._unanswered_stops:
                # those that answer come first, then those of which the least was in vain
                others = itertools.filterfalse(self._is_held, queue)
                entry = min(others, key=self._in_vain)
            behind = self._rank(entry)
            if behind == rank or behind not in (_RETRY, _MISSING):
                return entry
            del queue[entry]
            self._queues[behind][entry] = None

    def _is_held(self, entry: LatestValue | Waiting) -> bool:
        """Return whether another goes first."""
        gives_way = self._unanswered is not None and self._gives_way(entry)
        return gives_way or self._is_resting(entry)

    def _is_resting(self, entry: LatestValue | Waiting) -> bool:
        return self._rests(_unit_of(entry))

    def _other_stop(self, rank: _Rank) -> LatestValue | Waiting | None:
        """Return a stop for which the line is silent long enough: none waits for another."""
        for entry in self._queues[rank] if rank == Priority.STOP else ():
            if not self._is_held(entry) and not self._needs_silence(_unit_of(entry)):
                return entry
        return None

    def is_brief(self, request: Request) -> bool:
        """
        Return whether its answer is waited for no longer than the unit has ever taken.

        That is so of a stop, where others wait for it or may be in vain as well, of a look at one
        that answers no stop, both but for the second and then each eighth one, of what is read
        before a stop is written, for that goes without it, and of what is sent to be heard. Where
        an answer counts only after a silence nothing would ever be read so.
        """
        if request.is_brief:
            return True
        if request.priority is Priority.STOP and not request.writes:
            return not self._answers_twice(request.unit)
        tries = self._unanswered_stops
        is_look = request.priority is Priority.LOOK and any(
            tried._replace(writes=True) in tries for tried in _any_of(request)
        )
        if request.priority is not Priority.STOP and not is_look:
            return False
        if sum(tries.get(tried, 0) for tried in _any_of(request)) % _PATIENT == 1:
            return False
        return self._is_silent(request.unit) or any(
            isinstance(entry, Waiting) and entry.request.unit != request.unit
            for entry in self._queues[Priority.STOP]
        )

    def _in_vain(self, entry: LatestValue | Waiting) -> tuple[int, int]:
        """Return how often the like of it was in vain, and how many requests its stop has made."""
        assert isinstance(entry, Waiting)
        return self._unanswered_stops.get(_tried(entry), 0), entry.task.requests

    def _gives_way(self, entry: LatestValue | Waiting) -> bool:
        """Return whether it is for the unit that has just not answered, or for one like it."""
        if isinstance(entry, LatestValue):
            return not entry.urgent() and self._waits_for_stops(entry.unit)
        request = entry.request
        if request.priority not in _STOPS and self._waits_for_stops(request.unit):
            return True
        before = self._unanswered
        is_repeated = self._is_repeated(entry)
        if before is not None and request.unit == before.unit:
            # the first stop that is requested is not held back by a service in vain
            return is_repeated or request.priority not in _STOPS or before.priority in _STOPS
        # else two of them would take turns, and no other had one
        is_in_vain = is_repeated or request.priority == Priority.SERVICE
        return is_in_vain and self._is_silent(request.unit)

    def _waits_for_stops(self, unit: int) -> bool:
        """Return whether what is no stop has to wait until all stops were sent, on a dead line."""
        if not self._is_line_silent():
            return False
        rounds = _ROUNDS if self._is_silent(unit) else 1
        return any(
            isinstance(entry, Waiting)
            and self._unanswered_stops.get(_tried(entry), 0) < rounds
            for entry in self._queues[Priority.STOP]
        )

    def took(self, seconds: float) -> None:
        """Account for the time, s, for which what was taken out last has kept the line."""
        wanted = self._wanted
        in_vain = wanted is not None and self._is_silent(_unit_of(wanted))
        is_stop = self._given in _STOPS
        is_unanswered = in_vain and self._given in _REPEATED
        waited = wanted if isinstance(wanted, Waiting) and is_unanswered else None
        self._unanswered = waited.request if waited is not None else None
        # what was in vain takes no turn: else the next one were that of a set-point again
        self._slot_went = self._given == _SLOT or (
            self._slot_went and self._unanswered is not None
        )
        if waited is not None and is_stop and not waited.request.is_brief:
            # each by itself: the stop behind a read that was not answered goes out at once, and so
            # does the stop behind a set-point 0
            stop = _tried(waited)
            self._unanswered_stops[stop] = 1 + self._unanswered_stops.get(stop, 0)
        for rank, share in _SHARES.items():
            if self._slot_went and rank in _BACKGROUND:
                continue
            owed = self._owed[rank] + seconds * share
            falls_silent = in_vain and not is_stop and seconds > _PASSING
            if rank == self._given or (rank == _RETRY and falls_silent):
                # the request with which a unit falls silent is of that share, too, but for what
                # noise costs: in that it would leave none for those that are to be asked again;
                # no debt beyond this transaction: what is sent on an idle line delays none
                self._owed[rank] = max(owed - seconds, -seconds)
            else:
                most = _MOST_OWED if self._queues[rank] else _MOST_SAVED
                self._owed[rank] = min(owed, most)

    def remove(self, entry: Waiting) -> None:
        """Remove what need not be sent any more."""
        for queue in self._queues.values():
            queue.pop(entry, None)

    def withdraw(self, task: Task) -> None:
        """Remove all that a task waits to send."""
        for queue in self._queues.values():
            for entry in tuple(queue):
                if isinstance(entry, Waiting) and entry.task is task:
                    del queue[entry]

    def clear(self) -> list[LatestValue | Waiting]:
        """Remove and return everything."""
        entries = [entry for queue in self._queues.values() for entry in queue]
        for queue in self._queues.values():
            queue.clear()
        return entries

    def _order(self, missing: bool) -> Iterator[_Rank]:
        yield from _STOPS
        if not self._slot_went:
            yield _SLOT
        first, second = _BACKGROUND
        background = _BACKGROUND if self._owed[first] >= self._owed[second] else (second, first)
        # one turn after what was in vain: it is for the most urgent of the others
        between = self._unanswered is not None
        for priority in background:
            if self._owed[priority] > 0 and not between:
                yield priority
        yield from (Priority.SETPOINT, Priority.SERVICE)
        if missing:
            yield _MISSING
        if self._owed[_RETRY] > 0 and not between:
            yield _RETRY
        yield from (Priority.POLL, _SLOT, _RETRY)
        yield from background
        # what was found there that is for a unit that is silent by now
        yield _RETRY

    def _rank(self, entry: LatestValue | Waiting) -> _Rank:
        if isinstance(entry, LatestValue):
            if not self._is_silent(entry.unit) or entry.urgent():
                return _SLOT
            return _MISSING if self._is_missing(entry.unit) else _RETRY
        request = entry.request
        if not self._is_silent(request.unit):
            if self._unanswered_stops:
                for tried in _any_of(request):
                    self._unanswered_stops.pop(tried._replace(writes=False), None)
                    self._unanswered_stops.pop(tried._replace(writes=True), None)
        elif request.priority in _READS:
            return _MISSING if self._is_missing(request.unit) else _RETRY
        elif self._is_repeated(entry) and self._is_missing(request.unit):
            # of others that answer it takes no more than their share
            return request.priority if self._is_line_silent() else _MISSING
        return request.priority

    def _is_repeated(self, entry: Waiting) -> bool:
        return entry.request.priority <= Priority.LOOK and _tried(entry) in self._unanswered_stops
