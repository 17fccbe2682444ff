# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Whether a drive answers, whether another may be in its place, and what may be sent to it by that.

One account for each drive; whatever polls it, writes to it or explains what it shows looks here.
With flags in several classes, two events in an unforeseen order went wrong again and again: a loss
that was seen here was not seen there, and a stop was kept back, or written to another drive.

**Does it answer?** :class:`ContactState` and its table. It is lost by one of two rules,
whichever shows it first:

- :meth:`Contact.lost_at`: it has been silent for ``lost_after``, whatever was asked;
- :meth:`Contact.poll_failed`: it answers, but has given no status for as long; or its port is gone,
  its PLC has no data of it, another drive answers.

**Is it the same one?** :class:`Recognition`. To a drive of another make a stop may be a run
command, so whatever writes passes this gate. But what is owed to a motor that runs is no less: the
gate before a stop is the smallest there is, and a stop that became due while the gate was open is
written twice although it has closed since (:attr:`Contact.may_stop`).

How long nothing has come is not kept here: :class:`nfo_sinus_driver.bus.silences.Silences` has it
for all units of the line, as it hears every request of every drive. ``docs/control.md`` has both
tables.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import enum
import math
from typing import NamedTuple

from nfo_sinus_driver.bus import SWAP_TIME, Bus
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report
from nfo_sinus_driver.drive.known.transitions import read_table
from nfo_sinus_driver.link import Interrupted, LinkError, NoAnswer, NoData, PortError

#: The reads without which a poll fails.
STATUS, MODE = 'status', 'control mode'
_POLL = 'poll'
#: How often a stop is written although nothing answers: the answer to one may be lost.
_BLIND_STOPS = 2


class ContactState(enum.Enum):
    """Whether a drive answers; the values describe it to users."""

    LOST = 'not connected, or not any more: it is only looked for, and stopped'
    ANSWERS = 'connected, and the last poll was answered'
    MISSED = 'a request was not answered since: what can wait is not asked before a poll is'


class ContactEvent(enum.Enum):
    """What can happen; the values describe it to users."""

    CONNECTED = 'all was read that tells which drive it is'
    ANSWERED = 'a request of a poll is answered'
    MISSED = 'a request is not answered, of a poll or another'
    LOST = 'it is silent for `lost_after`, or gives no status for as long; or the port is gone'


#: Where each event leads from each state; with a dot it changes nothing.
_TABLE = """
           LOST     ANSWERS  MISSED
CONNECTED  ANSWERS  .        ANSWERS
ANSWERED   .        .        ANSWERS
MISSED     .        MISSED   .
LOST       .        LOST     LOST
"""

#: The same by state and event; what is missing changes nothing.
TRANSITIONS = read_table(_TABLE, ContactState, ContactEvent)


class Recognition(enum.Enum):
    """Whether it is known which drive is there; the values say what is written to it."""

    NONE = 'nothing, before all is read that tells which drive it is'
    LAPSED = 'a stop after one look shows the same drive; and twice one that was due before'
    FOR_STOP = 'a stop; anything else after all is read again'
    HOLDS = 'anything'


class _Failures:
    """
    Since when each read of a poll has failed, s of one clock.

    Failures of several reads, one after the other, are one: each began with the first of them,
    when its answer failed to come, as a silence does.

    :ivar newest: the last one.
    """

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._all_since = math.inf
        self.newest: LinkError | DriveError = NoAnswer()

    def add(self, what: str, now: float, error: LinkError | DriveError) -> None:
        """Note that a read failed."""
        self.newest = error
        self._all_since = min(self._all_since, now)
        self._since[what] = min(self._since.get(what, math.inf), self._all_since)

    def last(self, what: str, now: float) -> float:
        """Return for how long a read has failed, s; 0: it has not."""
        return now - self._since.get(what, now)

    def end(self, what: str) -> None:
        """Note that a read was answered."""
        self.forget(what)
        self._all_since = math.inf

    def forget(self, what: str) -> None:
        """Note that something is over that is no read: it ends no failures of reads."""
        self._since.pop(what, None)


class _Between(NamedTuple):
    """
    What was between a status and the one before.

    :ivar apart: how far apart they were, s.
    :ivar alone: the longest time without a valid frame, s.
    :ivar in_vain: a request got no answer.
    """

    apart: float = 0.0
    alone: float = 0.0
    in_vain: bool = False


class Contact:
    """
    The account of one drive; used on the bus alone, readable from anywhere.

    :param lost_after: returns after which silence it is lost, s.
    :param enable_input: what keeps its motor still, for an operator.
    :ivar state: whether it answers.
    :ivar behind_plc: a PLC answers that has no new data of it.
    :ivar missed_since_poll: it has not answered a request since a poll has read its status. One
        that was busy, or whose answer was damaged, has responded; and a status that is read while
        it is connected to again hides no silence.
    :ivar missed_before_poll: that was so when the newest poll read it.
    """

    def __init__(
        self, bus: Bus, unit: int, lost_after: Callable[[], float], enable_input: str
    ) -> None:
        self._bus = bus
        self._unit = unit
        self._lost_after = lost_after
        self._enable_input = enable_input
        self.state = ContactState.LOST
        self.behind_plc = False
        self.missed_since_poll = self.missed_before_poll = False
        self._failures = _Failures()
        #: The newest is last; and whether a request got no answer since.
        self._between = deque((_Between(),), maxlen=4)
        self._in_vain = False
        #: When all was read that tells its family, and when one look has shown that it is there.
        self._recognised_at = self._looked_at = math.nan
        #: When a stop became due to a drive that was known, for how long the driver had paused by
        #: then, s; and how often it may be written since although nothing answers.
        self._stop_due_at, self._paused = -math.inf, 0.0
        self._blind_left = 0

    # --- does it answer? ----------------------------------------------------------------------

    @property
    def connected(self) -> bool:
        """It was recognised, and has not been lost since."""
        return self.state is not ContactState.LOST

    @property
    def responsive(self) -> bool:
        """No request was in vain since; while one was, no other should wait for the drive."""
        return self.state is ContactState.ANSWERS

    def dispatch(self, event: ContactEvent) -> None:
        """Go where an event leads."""
        self.state = TRANSITIONS.get((self.state, event), self.state)
        if event is ContactEvent.CONNECTED:
            self._failures = _Failures()
        elif event is ContactEvent.MISSED:
            self._in_vain = True

    def count(self, error: LinkError) -> None:
        """Note what became of one try of a request, repeated or not."""
        self.missed_since_poll |= isinstance(error, NoAnswer)

    def read_answered(self, what: str) -> None:
        """Note that a read of a poll was answered."""
        self._failures.end(what)
        self.dispatch(ContactEvent.ANSWERED)

    def read_failed(self, what: str, error: LinkError) -> bool:
        """Note that one was not; return whether the poll fails by that."""
        self._failures.add(what, self._bus.running, error)
        return self.is_silent_for_long or self.fails_for_long(what)

    def poll_passed(self) -> None:
        """Note that a poll did not fail."""
        self._failures.forget(_POLL)

    def poll_failed(self, error: LinkError | DriveError) -> bool:
        """Note that a poll, or connecting, failed; return whether a drive is lost by that."""
        self.dispatch(ContactEvent.MISSED)
        is_old = isinstance(error, DriveError) and error.report.cause is Cause.OLD_DATA
        self.behind_plc = isinstance(error, NoData) or is_old
        if not self.connected:
            return False
        self._failures.add(_POLL, self._bus.running, error)
        # these have been waited out, or cannot be
        at_once = self.behind_plc or isinstance(error, (PortError, Interrupted))
        another = isinstance(error, DriveError) and not self.is_recognised
        # one that answers, but gives no status, cannot be watched either
        unwatched = any(map(self.fails_for_long, (STATUS, MODE, _POLL)))
        return at_once or another or self.is_silent_for_long or unwatched

    @property
    def newest_failure(self) -> LinkError | DriveError:
        """Why the last read failed that did."""
        return self._failures.newest

    def is_failing(self, what: str) -> bool:
        """Return whether a read was not answered when it was tried last."""
        return bool(self._failures.last(what, self._bus.running))

    def fails_for_long(self, what: str) -> bool:
        """Return whether a read has failed for ``lost_after``, whatever else was answered."""
        return self._failures.last(what, self._bus.running) >= self._lost_after()

    # --- for how long not? --------------------------------------------------------------------

    @property
    def last_frame_at(self) -> float:
        """When its last valid frame came, s of the clock of the bus."""
        return self._bus.silences.last_frame_at(self._unit)

    @property
    def ever_answered(self) -> bool:
        """It has, in this process."""
        return self.last_frame_at > -math.inf

    @property
    def is_silent(self) -> bool:
        """It has not answered the last request."""
        return self._bus.silences.is_silent(self._unit)

    def is_silent_since(self, at: float) -> bool:
        """Return whether it is silent, and has answered nothing since then."""
        return self.is_silent and self.last_frame_at <= at

    def was_silent_at(self, at: float) -> bool:
        """Return whether a silence had begun by then that has not ended; true if there is none."""
        return self._bus.silences.lasts(self._unit, at) >= 0

    @property
    def is_silent_for_long(self) -> bool:
        """It has answered no request for ``lost_after``: the next poll finds it lost."""
        return self._bus.silences.lasts(self._unit, self._bus.now()) >= self._lost_after()

    def lost_at(self, *, is_watched: bool) -> float:
        """
        Return when it is lost, if it answers nothing until then, s; infinity while it answers.

        :param is_watched: its motor may run: where no unit of the line answers, it is silent as
            they are, although it was not asked itself.
        """
        since = self._bus.silences.silent_since(self._unit, is_watched=is_watched)
        return since + self._lost_after()

    @property
    def was_asked_itself(self) -> bool:
        """What is silent is this drive, and not only others of the line that were asked."""
        silences = self._bus.silences
        return silences.is_silent(self._unit) or silences.was_asked_since_silent(self._unit)

    @property
    def answers_twice(self) -> bool:
        """It does, and what is read of it takes longer than a stop may wait."""
        return self._bus.answers_twice(self._unit)

    @property
    def is_gone(self) -> bool:
        """It is lost, or the whole line is silent for more than noise."""
        return not self.connected or self._bus.silences.is_dead(self._bus.now())

    # --- what was between two statuses? -------------------------------------------------------

    def note_status(self, apart: float) -> None:
        """Note that a newer status was read, so long after the one before, s."""
        alone = self._bus.silences.take_longest(self._unit)
        self._between.append(_Between(apart, alone, self._in_vain))
        self._in_vain = False

    def note_poll(self) -> None:
        """Note that a poll has read the status."""
        self.missed_before_poll, self.missed_since_poll = self.missed_since_poll, False

    @property
    def left_alone_for(self) -> float:
        """How long it got no request before the newest status, s; 0 where one was in vain."""
        newest = self._between[-1]
        return 0.0 if newest.in_vain else newest.alone

    @property
    def unheard(self) -> bool:
        """Before the newest status no frame came for as long as a loss takes, asked or not."""
        return self._between[-1].alone >= self._lost_after()

    @property
    def usual_interval(self) -> float:
        """How far apart the statuses before the newest were, s."""
        return max(between.apart for between in list(self._between)[:-1])

    # --- is it the same one? ------------------------------------------------------------------

    @property
    def recognition(self) -> Recognition:
        """Whether it is known which drive is there."""
        if self.is_recognised:
            return Recognition.HOLDS
        if self._allows_stop:
            return Recognition.FOR_STOP
        return Recognition.LAPSED if self.was_here else Recognition.NONE

    @property
    def is_recognised(self) -> bool:
        """It was recognised, and no other can be in its place by now."""
        return self._is_same_since(self._recognised_at)

    @property
    def _allows_stop(self) -> bool:
        """The same, for a stop: it was looked at, or is lost only now."""
        looked_at = self._looked_at
        newest = self._recognised_at if math.isnan(looked_at) else looked_at
        return self._is_same_since(newest, to_stop=True)

    @property
    def since_port_opened(self) -> bool:
        """It was recognised since the port was opened; another one may be in its place by now."""
        return self._recognised_at >= self._bus.silences.opened_at

    @property
    def was_here(self) -> bool:
        """It was recognised behind this port, however often that was opened since."""
        return self._recognised_at >= self._bus.silences.moved_at

    def recognised(self) -> None:
        """Note that all was read just now that tells its family."""
        self._recognised_at = self._bus.now()
        self._looked_at = math.nan

    def seen_again(self) -> None:
        """Note that what was recognised here was seen again just now."""
        self._looked_at = self._bus.now()

    def another_answers(self) -> None:
        """Note that another drive answers."""
        self._recognised_at = self._looked_at = math.nan

    def require_recognised(self, began: float = math.inf) -> None:
        """
        Make sure, at the moment of sending, that it may be written to (DriveError: not).

        :param began: when the first of several writes that belong together was wanted, s.
        """
        if not self.is_recognised or not self._is_same_since(began):
            raise self.not_recognised(Report(Cause.NO_ANSWER_YET))

    def not_recognised(self, why: Report) -> DriveError:
        """Return the error of a write that is not sent."""
        return DriveError(
            Cause.NOT_RECOGNISED, address=self._unit, why=why, enable_input=self._enable_input
        )

    def _is_same_since(self, at: float, *, to_stop: bool = False) -> bool:
        now = self._bus.now()
        return at >= self._bus.silences.there_since(self._unit, now, to_stop=to_stop)

    # --- may a stop be written? ---------------------------------------------------------------

    def stop_begins(self) -> None:
        """Judge anew what may be written of a stop that becomes due now."""
        self._blind_left = 0
        self.stop_is_due()

    def stop_is_due(self) -> None:
        """Judge what may be written of a stop that becomes due now, for one more reason."""
        if self._allows_stop:
            self._stop_due_at, self._paused = self._bus.now(), self._bus.paused
            self._blind_left = _BLIND_STOPS

    def stop_in_vain(self) -> None:
        """Note that a stop got no answer."""
        self._blind_left -= self._blind_left > 0

    @property
    def stops_blind(self) -> bool:
        """A stop may be written once more although nothing answers."""
        return self._blind_left > 0

    @property
    def may_stop(self) -> bool:
        """A stop may be written: it is known what is there, or was when the stop became due."""
        if self._allows_stop:
            return True
        silences = self._bus.silences
        # the stops of all others may go before the second one
        longest = SWAP_TIME + silences.round_in_vain
        in_time = self._bus.now() <= self._stop_due_at + longest
        in_time &= self._bus.paused <= self._paused + SWAP_TIME
        return self.stops_blind and in_time and self._stop_due_at >= silences.away_at
