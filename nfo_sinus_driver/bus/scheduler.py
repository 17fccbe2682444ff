# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What is sent next on one line, and which units do not answer.

No thread, no clock and nothing sent: :class:`nfo_sinus_driver.bus.Bus` takes what is next, sends
it, and reports how long that kept the line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import itertools
import math
from typing import Literal, NamedTuple

from nfo_sinus_driver.bus.tasks import Exchange, LatestValue, Priority, Task
from nfo_sinus_driver.link import LinkError, NotSent, PortError, Refused

__all__ = ['BACKGROUND_SHARE', 'EXCHANGE', 'Scheduler', 'Waiting']

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
    exchange: Exchange


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
    owed, and none for which as much was in vain.

    Units that have been silent for long are missing. Reads from them, set-points, and stops that
    did not reach them, wait until :meth:`take` may give them out, and then go ahead of other polls.

    :param is_silent: whether a unit has not answered the last request.
    :param is_missing: whether it has been silent for long.
    """

    def __init__(
        self,
        is_silent: Callable[[int], bool] = lambda unit: False,
        is_missing: Callable[[int], bool] = lambda unit: False,
    ) -> None:
        self._is_silent = is_silent
        self._is_missing = is_missing
        #: In order; the values are not used.
        self._queues: dict[_Rank, dict[LatestValue | Waiting, None]] = {
            rank: {} for rank in (*Priority, _SLOT, _RETRY, _MISSING)
        }
        #: How much time those that have a share are owed, s; they owe if that is negative.
        self._owed = dict.fromkeys(_SHARES, 0.0)
        #: What was given out just now, and of which rank.
        self._given: _Rank = _SLOT
        self._wanted: LatestValue | Exchange | None = None
        self._slot_went = False
        #: The stop, its read, or the service that has just not been answered.
        self._unanswered: Exchange | None = None
        #: What units have not answered since they last answered anything: a stop (true), its read.
        self._unanswered_stops: set[tuple[int, bool]] = set()

    def add(self, entry: LatestValue | Waiting) -> None:
        """Queue a slot or a transaction, behind its equals."""
        self._queues[self._rank(entry)][entry] = None

    @property
    def missing_wait(self) -> bool:
        """Something waits that is for a missing unit."""
        return bool(self._queues[_MISSING])

    @property
    def waits(self) -> bool:
        """Anything waits that is not for a missing unit."""
        return any(queue for rank, queue in self._queues.items() if rank != _MISSING)

    def take(
        self, *, missing: bool = True, only_stops: bool = False
    ) -> LatestValue | Waiting | None:
        """
        Take out what goes next, or ``None``; for a missing unit only with ``missing``.

        :param only_stops: everything but a stop has to wait.
        """
        self._release_found()
        for rank in _STOPS if only_stops else self._order(missing):
            # most are empty, and this runs for every transaction
            entry = self._first(rank) if self._queues[rank] else None
            if entry is not None:
                del self._queues[rank][entry]
                self._given = rank
                self._wanted = entry if isinstance(entry, LatestValue) else entry.exchange
                return entry
        if self._unanswered is None:
            return None
        # no other unit waits
        self._unanswered = None
        return self.take(missing=missing, only_stops=only_stops)

    def _release_found(self) -> None:
        """Requeue what waits for a unit that answers again: it may be a stop."""
        if not self._queues[_MISSING]:
            return
        found = [one for one in self._queues[_MISSING] if self._rank(one) != _MISSING]
        for entry in found:
            del self._queues[_MISSING][entry]
            self.add(entry)

    def _first(self, rank: _Rank) -> LatestValue | Waiting | None:
        """Return what goes next of one rank; what is for a unit that is silent by now is behind."""
        queue = self._queues[rank]
        while True:
            others = queue if self._unanswered is None else itertools.filterfalse(
                self._gives_way, queue
            )
            entry = next(iter(others), None)
            if entry is None or rank == _MISSING:
                return entry
            behind = self._rank(entry)
            if behind == rank or behind not in (_RETRY, _MISSING):
                return entry
            del queue[entry]
            self._queues[behind][entry] = None

    def _gives_way(self, entry: LatestValue | Waiting) -> bool:
        """Return whether it is for the unit that has just not answered, or for one like it."""
        if isinstance(entry, LatestValue):
            return False
        exchange = entry.exchange
        before = self._unanswered
        is_repeated = self._is_repeated(exchange)
        if before is not None and exchange.unit == before.unit:
            # the first stop that is requested is not held back by a service in vain
            return is_repeated or exchange.priority not in _STOPS or before.priority in _STOPS
        # else two of them would take turns, and no other had one
        is_in_vain = is_repeated or exchange.priority == Priority.SERVICE
        return is_in_vain and self._is_silent(exchange.unit)

    def took(self, seconds: float) -> None:
        """Account for the time, s, for which what was taken out last has kept the line."""
        wanted = self._wanted
        in_vain = wanted is not None and self._is_silent(wanted.unit)
        is_stop = self._given in _STOPS
        is_unanswered = in_vain and self._given in _REPEATED
        self._unanswered = wanted if isinstance(wanted, Exchange) and is_unanswered else None
        # what was in vain takes no turn: else the next one were that of a set-point again
        self._slot_went = self._given == _SLOT or (
            self._slot_went and self._unanswered is not None
        )
        if self._unanswered is not None and is_stop:
            # each by itself: the stop behind a read that was not answered goes out at once
            self._unanswered_stops.add((self._unanswered.unit, self._unanswered.writes))
        for rank, share in _SHARES.items():
            if self._slot_went and rank in _BACKGROUND:
                continue
            owed = self._owed[rank] + seconds * share
            if rank == self._given or (rank == _RETRY and in_vain and not is_stop):
                # the request with which a unit falls silent is of that share, too;
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
        exchange = entry.exchange
        if not self._is_silent(exchange.unit):
            if self._unanswered_stops:
                self._unanswered_stops -= {(exchange.unit, False), (exchange.unit, True)}
        elif exchange.priority in _READS:
            return _MISSING if self._is_missing(exchange.unit) else _RETRY
        elif self._is_repeated(exchange) and self._is_missing(exchange.unit):
            return _MISSING
        return exchange.priority

    def _is_repeated(self, exchange: Exchange) -> bool:
        before = (exchange.unit, exchange.writes)
        return exchange.priority <= Priority.LOOK and before in self._unanswered_stops


#: A unit that has been silent for so long counts as missing, s: short enough to spare the others,
#: longer than a burst of noise.
_MISSING_AFTER = 2.0
#: The share of the time that all missing units may take together while others answer.
_MISSING_SHARE = 1 / 20
#: How much longer than before a port is mute, s, until it is opened again, each time in vain; and
#: the longest: less than the command line repeats a stop before it gives up.
_MUTE_STEP = 2.0
_MUTE_LONGEST = 6.0
#: The same where nothing was ever heard: opening it was in vain already, s.
_MUTE_FROM_THE_START = 30.0
#: In a longer silence another unit may have been put in the place of one, s: that is how long it
#: takes to move the plug of the line from a drive to a spare one beside it that has power.
EXCHANGE = 3.0


class Silences:
    """
    How long each unit has not answered its requests; all times are of one clock, s.

    Silence begins when the first answer has failed to come, however long the wait was: a unit
    without requests is not silent, and one lost answer is no silence yet. Any valid frame ends it.

    Each request to a unit that is missing costs the others a whole time-out, so there is a pause
    behind it, in which none of the missing units gets one.

    Where no unit answers any more, the port itself may be mute: what carries the bytes may pass
    none until it is opened again, and report no error. Units that are switched off look the same,
    so it is opened again more and more seldom. An address that never answered shows nothing.

    :ivar heard: something valid has ever come.
    """

    def __init__(self) -> None:
        self._last_frame_at: dict[int, float] = {}
        self._since: dict[int, float] = {}
        #: The same, with the time in which the worker did not run: a drive can be exchanged in it.
        self._gone_since: dict[int, float] = {}
        #: The longest time from one valid frame to the next.
        self._longest: dict[int, float] = {}
        #: When the last valid frame of any unit came.
        self._any_frame_at = -math.inf
        self._pause_ends = -math.inf
        #: When the last silence of the whole line ended.
        self._back_at = -math.inf
        self.heard = False
        #: Since when every request has failed, and how often the port was opened since the last
        #: that did not.
        self._mute_since = math.inf
        self._opened = 0
        #: When the port was opened that had been lost, s.
        self.opened_at = -math.inf
        #: When a silence ended that was long enough for an exchange: of the line, and of each unit.
        self._line_since = -math.inf
        self._unit_since: dict[int, float] = {}

    def note(self, unit: int, now: float, error: LinkError | None, seconds: float = 0.0) -> bool:
        """Note the outcome of a request that took ``seconds``; return whether the port carries."""
        if isinstance(error, NotSent):
            return False
        if error is None or error.responded or isinstance(error, Refused):
            self._note_exchange(unit, now)
            if now - self._any_frame_at >= _MISSING_AFTER:
                # it was the line: the others may be back with this one, and have to be stopped
                self._back_at = now
            pause = now - self._last_frame_at.get(unit, now)
            self._longest[unit] = max(self._longest.get(unit, 0.0), pause)
            self._last_frame_at[unit] = self._any_frame_at = now
            self._since.pop(unit, None)
            self._gone_since.pop(unit, None)
        elif self.is_missing(unit, now):
            self._pause_ends = now + seconds * (1 / _MISSING_SHARE - 1)
        if error is not None and not isinstance(error, (PortError, Refused)):
            self._since.setdefault(unit, now)
            self._gone_since.setdefault(unit, now)
        if error is None or error.responded or error.heard:
            self.heard, self._opened, self._mute_since = True, 0, math.inf
            return True
        if not isinstance(error, PortError) and (not self.heard or unit in self._last_frame_at):
            self._mute_since = min(self._mute_since, now)
        return False

    def opened(self, now: float, *, lost: bool) -> None:
        """Note that the port was opened; after it was lost, other units may be behind it."""
        if lost:
            self.opened_at = self._line_since = now
        self._opened += 1
        self._mute_since = math.inf

    def hurry(self) -> None:
        """Have a port that is mute opened again soon, however often that was in vain."""
        self._opened = 0

    def mute_for(self, now: float) -> float:
        """Return for how long nothing has come, s, although units were asked; 0: not at all."""
        return max(0.0, now - self._mute_since)

    def is_mute(self, now: float, lost_after: float) -> bool:
        """
        Return whether the port is to be opened again.

        :param lost_after: how long every unit of the line may be silent, s.
        """
        longest = min(_MUTE_STEP * self._opened, _MUTE_LONGEST)
        least = longest if self.heard else _MUTE_FROM_THE_START
        return now - self._mute_since >= max(lost_after, least)

    def paused(self, seconds: float) -> None:
        """Note that nothing was sent for so long, s, for the worker did not run."""
        self._since = {unit: since + seconds for unit, since in self._since.items()}
        self._mute_since += seconds

    def _note_exchange(self, unit: int, now: float) -> None:
        """Note that a silence ends in which a unit, or any, may have been exchanged."""
        if now - self._gone_since.get(unit, now) > EXCHANGE:
            self._unit_since[unit] = now
        if now - self._any_frame_at > EXCHANGE:
            # this end may have stood still
            self._line_since = now

    def there_since(self, unit: int, now: float) -> float:
        """Return since when a unit cannot have been exchanged; infinity if it may be by now."""
        if now - min(self._gone_since.get(unit, now), self._any_frame_at) > EXCHANGE:
            return math.inf
        return max(self._line_since, self._unit_since.get(unit, -math.inf))

    def is_silent(self, unit: int) -> bool:
        """Return whether a unit has not answered the last request to it."""
        return unit in self._since

    def last_frame_at(self, unit: int) -> float:
        """Return when the last valid frame of a unit came."""
        return self._last_frame_at.get(unit, -math.inf)

    def take_longest(self, unit: int) -> float:
        """Return the longest time between two valid frames of a unit since the last call."""
        return self._longest.pop(unit, 0.0)

    def lasts(self, unit: int, now: float) -> float:
        """Return for how long a unit has been silent; 0 if it answers."""
        return now - self._since.get(unit, now)

    def is_missing(self, unit: int, now: float) -> bool:
        """Return whether a unit has been silent for so long that it gets few requests."""
        return min(self.lasts(unit, now), now - self._back_at) >= _MISSING_AFTER

    @property
    def missing_from(self) -> float:
        """From when on a missing unit may get a request; at any time while no unit responds."""
        return min(self._pause_ends, self._any_frame_at + _MISSING_AFTER)
