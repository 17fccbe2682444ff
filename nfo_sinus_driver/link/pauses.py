# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How long a line, or a unit, is left alone before a request, where the protocol is not enough.

Without I/O; time is in seconds of one steady clock.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
import math
from typing import NamedTuple

__all__ = ['Pauses']

#: The pauses that are tried, s.
_STEPS = (0.005, 0.01, 0.02, 0.05, 0.1)
_LONGEST = _STEPS[-1]
#: So many losses more than answers are no noise: where no longer pause is tried yet, and where one
#: is; how many more yet if such a request was answered before; and how many fewer there may be.
_MANY = 3
_MORE = 1
_DOUBT = 6
_MOST_CREDIT = -12
#: So many answers show that a pause helps; each came after no more than so many times that pause.
_HELPS = 3
_NEARLY = 2
#: The share of a pause that is none less, for no clock is exact.
_ALMOST = 0.9


class _Stage(NamedTuple):
    """
    A pause.

    :ivar own: it counts from the last answer of the unit, and others may be asked meanwhile; else
        from the last answer of any.
    """

    own: bool
    seconds: float


#: All pauses, behind none at all.
_STAGES = (
    _Stage(own=True, seconds=0.0),
    *(_Stage(own, seconds) for own in (True, False) for seconds in _STEPS),
)
#: Where this does not help, no pause after its own answers does.
_LONGEST_OWN = len(_STEPS)


class _Sent(NamedTuple):
    """How long after an answer of its unit, and of any, a request was sent, s."""

    own: float
    line: float


@dataclass
class _Learner:
    """
    Learns after which pause a unit hears a request that follows an answer.

    What is lost counts once the unit answers a later request: it is there, and heard nothing too
    early.

    :ivar between: another unit has answered since this one did.
    :ivar stage: of the pause in force; :ivar kept: of the one that has helped.
    """

    between: bool
    stage: int = 0
    kept: int = 0
    #: How many requests more were lost than were answered.
    credit: int = 0
    #: How long after an answer the last of them was sent; and after one of the unit at most.
    lost_at: float = 0.0
    lost_own: float = 0.0
    #: How soon one was answered.
    own_at: float = math.inf
    line_at: float = math.inf
    #: How many answers came since the pause is tried.
    answers: int = 0
    #: No pause has helped.
    in_vain: bool = False

    def pause(self, *, own: bool) -> float:
        """Return the pause in force, s, if it is of this kind."""
        stage = _STAGES[self.stage]
        return stage.seconds if stage.own is own else 0.0

    def count_loss(self, sent: _Sent, usual: float) -> None:
        """
        Count a request that was lost.

        :param usual: the longest pause that helps any unit of the line, s: a gateway needs it for
            all of them.
        """
        if self.in_vain or min(sent.own, sent.line) >= max(_LONGEST, self._longest_tried):
            return
        if self._silence(sent) < _ALMOST * _STAGES[self.stage].seconds:
            # it was sent before this pause was tried
            return
        if not self.lost_at and sent.own >= self.own_at and sent.line >= self.line_at:
            self.credit = -_DOUBT
        self.credit += 1
        self.lost_at = self._silence(sent)
        if sent.own < _LONGEST:
            self.lost_own = max(sent.own, self.lost_own)
        if self.credit < (_MORE if self.stage > self.kept else _MANY):
            return
        self.credit = self.answers = 0
        if self.between and self.stage < _LONGEST_OWN and sent.own < _LONGEST:
            # this shows whose answer it is that counts
            self.stage = _LONGEST_OWN
            return
        if self.between:
            sent = sent._replace(line=max(sent.line, usual - _STEPS[0]))
        self.stage = self._next(max(self.stage, _LONGEST_OWN * self.between) + 1, sent)
        # it may have been silent for longer than all pauses that are left
        if self.stage > (len(_STAGES) - 1 if self.between else _LONGEST_OWN):
            self.stage, self.in_vain = self.kept, True

    def count_answer(self, sent: _Sent) -> bool:
        """Count one that was answered; return whether a longer pause is known to help by it."""
        self.own_at, self.line_at = min(sent.own, self.own_at), min(sent.line, self.line_at)
        silence = self._silence(sent)
        if silence <= self.lost_at:
            self.credit = max(self.credit - 1, _MOST_CREDIT)
        if self.stage == self.kept or silence > self._longest_tried:
            # it may be answered because it came so late
            return False
        self.answers += 1
        if self.answers < _HELPS:
            return False
        if self.between and self.stage == _LONGEST_OWN:
            # a shorter one may do, if it is longer than what did not
            self.stage = self._next(self.kept + 1, sent._replace(own=self.lost_own))
            self.credit = self.answers = 0
            if self.stage != _LONGEST_OWN:
                return False
        self.kept, self.credit = self.stage, 0
        return True

    def _next(self, stage: int, sent: _Sent) -> int:
        """Return the first stage from one on that is longer than the silence before a request."""
        while stage < len(_STAGES):
            own, seconds = _STAGES[stage]
            if seconds > (sent.own if own else sent.line):
                break
            stage += 1
        return stage

    @property
    def _longest_tried(self) -> float:
        # a request comes a little later than the pause has it
        return _NEARLY * _STAGES[self.stage].seconds

    def _silence(self, sent: _Sent) -> float:
        return sent.own if _STAGES[self.stage].own else sent.line


@dataclass
class _Unit:
    """What is known of one unit."""

    #: How long the line is silent before each request to it, s.
    gap: float = 0.0
    answered_at: float = -math.inf
    #: The last request that was answered was a write; the last one is.
    wrote: bool = False
    writes: bool = False
    #: What is learnt of requests behind the answer to a write, or to a read, and by whether another
    #: unit has answered between.
    learners: dict[tuple[bool, bool], _Learner] = field(
        default_factory=lambda: {
            (wrote, between): _Learner(between)
            for wrote in (False, True)
            for between in (False, True)
        }
    )
    #: The last request, if it follows an answer at once, and what learns of it; those that were
    #: lost since the unit has answered.
    sent: tuple[_Learner, _Sent] | None = None
    lost: list[tuple[_Learner, _Sent]] = field(default_factory=list)
    #: How many they are, with those that do not count.
    in_vain: int = 0
    #: After so many the next request comes after a silence that is long enough for any.
    probe_at: int = _MANY
    #: What kinds of requests it has ever answered.
    known: set[type[object]] = field(default_factory=set)
    #: The pauses in force: after its own answer to a read, and to a write; after any answer. They
    #: are asked for before each request, and hardly ever change: each is worked out then, once.
    after_own: tuple[float, float] = (0.0, 0.0)
    after_any: float = 0.0

    def take_pauses(self) -> None:
        """Work out which pauses are in force, behind what may have changed them."""
        own = {kind: learner.pause(own=True) for kind, learner in self.learners.items()}
        after_read = max(pause for (wrote, _), pause in own.items() if not wrote)
        self.after_own = after_read, max(own.values())
        self.after_any = max(learner.pause(own=False) for learner in self.learners.values())

    def rests_until(self) -> float:
        """Return until when it is asked nothing, s."""
        return self.answered_at + max(self.gap, self.after_own[self.wrote])

    def learnt(self) -> float:
        """Return how long after any answer it is asked nothing, s."""
        return _LONGEST if self.in_vain == self.probe_at else self.after_any

    def kept(self, *, own: bool) -> float:
        """Return the longest pause of a kind that is known to help, s."""
        stages = (_STAGES[learner.kept] for learner in self.learners.values())
        return max(stage.seconds if stage.own is own else 0.0 for stage in stages)

    def forget(self) -> None:
        """Begin anew with what has not helped."""
        self.sent, self.in_vain, self.probe_at = None, 0, _MANY
        self.lost.clear()
        for learner in self.learners.values():
            learner.in_vain = False


class Pauses:
    """
    The pauses of one line.

    Some units, and some gateways, lose a request that follows an answer too soon for them. What is
    lost so, again and again, while the unit answers otherwise, makes the pause of that unit longer:
    that after its own answers, in which others may be asked; where that does not help, that after
    each answer on the line. A pause is kept once what was lost is answered after it, and given up
    where none helps. A unit whose requests always follow the answers of others is asked once after
    a pause that is long enough for any, and seldom again if that was in vain, too.

    :param tell: takes a sentence of what was learnt.
    :param line_end: returns when the last byte was on the line.
    :param least: the least silence before any request, s.
    :param broadcast: the unit that is all of them.
    """

    def __init__(
        self,
        tell: Callable[[str], None],
        line_end: Callable[[], float],
        least: float = 0.0,
        broadcast: int | None = None,
    ) -> None:
        self._tell = tell
        self._line_end = line_end
        self._least = least
        self._broadcast = broadcast
        self._units: defaultdict[int, _Unit] = defaultdict(_Unit)
        #: When the last answer came.
        self._answered_at = -math.inf

    def require(self, unit: int, gap: float) -> None:
        """Have the line silent for so long, s, before each request to a unit."""
        self._units[unit].gap = gap

    def silence(self, unit: int) -> float:
        """Return how long the line is silent before a request to a unit, s; 0: as usual."""
        if unit == self._broadcast and self._units:
            return max(self._least, *(record.gap for record in self._units.values()))
        return max(self._least, self._units[unit].gap)

    def kept_silent(self, unit: int) -> float:
        """Return how long a request to a unit keeps the line silent before it, s; 0: as usual."""
        return max(self.silence(unit), self._learnt(unit))

    def silent_until(self, unit: int) -> float:
        """Return until when the line has to be silent for a request to a unit, if for longer."""
        learnt = self._learnt(unit)
        silence = self.silence(unit)
        until = self._line_end() + silence if silence else -math.inf
        return max(until, self._answered_at + learnt) if learnt else until

    def rests_until(self, unit: int) -> float:
        """Return until when a unit is asked nothing, while others may be."""
        if unit == self._broadcast and self._units:
            return max(record.rests_until() for record in self._units.values())
        return self._units[unit].rests_until()

    def ready_at(self, unit: int) -> float:
        """Return when a request to a unit may be sent."""
        return max(self.silent_until(unit), self.rests_until(unit))

    def round(self, units: Iterable[int]) -> float:
        """Return how much of a round in which each unit is asked once is pauses, s."""
        asked = [self._units[unit] for unit in units]
        silences = sum(max(self._least, record.gap, record.kept(own=False)) for record in asked)
        return max((silences, *(record.kept(own=True) for record in asked)))

    # --- what the line tells ------------------------------------------------------------------

    def sent(self, unit: int, now: float, *, writes: bool) -> None:
        """Note a request at the moment when it begins."""
        record = self._units[unit]
        record.writes, record.sent = writes, None
        line = now - self._answered_at
        if line < _NEARLY * _LONGEST:
            own = now - record.answered_at
            learner = record.learners[record.wrote, own > line]
            record.sent = learner, _Sent(own, line)

    def answered(self, unit: int, kind: type[object], now: float) -> None:
        """Note that a unit has answered the last request to it."""
        record = self._units[unit]
        self._answered_at = record.answered_at = now
        record.wrote = record.writes
        record.known.add(kind)
        lost, record.lost = record.lost, []
        record.in_vain, record.probe_at = 0, _MANY
        if lost:
            units = self._units.values()
            usual = max(other.kept(own=own) for other in units for own in (True, False))
            for learner, request in lost:
                learner.count_loss(request, usual)
            record.take_pauses()
        if record.sent is not None and not lost:
            learner, request = record.sent
            stage, helps = learner.stage, learner.count_answer(request)
            if learner.stage != stage:
                record.take_pauses()
            if helps:
                self._tell(_learnt(unit, _STAGES[learner.kept]))
        record.sent = None

    def unanswered(self, unit: int, kind: type[object]) -> None:
        """Note that a unit has not answered the last request to it."""
        record = self._units[unit]
        sent, record.sent = record.sent, None
        if record.in_vain >= record.probe_at:
            record.probe_at *= 2
        if sent is None:
            # it was not too early: the unit is not there
            record.lost.clear()
            return
        record.in_vain += 1
        # what it has never answered it may not know
        if kind in record.known and len(record.lost) < _MANY:
            record.lost.append(sent)

    def forget_failures(self) -> None:
        """Try again what has not helped: the line is another one, perhaps."""
        for record in self._units.values():
            record.forget()

    def _learnt(self, unit: int) -> float:
        if unit == self._broadcast and self._units:
            return max(record.learnt() for record in self._units.values())
        return self._units[unit].learnt()


def _learnt(unit: int, stage: _Stage) -> str:
    """Return what is told of a pause that helps."""
    whose = 'its own answers' if stage.own else 'any answer on the line'
    return (
        f'unit {unit} loses what comes too soon after {whose}: from now on it is asked nothing for '
        f'{1000 * stage.seconds:.0f} ms then; to have that from the start, set request_gap to '
        f'{stage.seconds:g}, or line: {{gap: {stage.seconds:g}}} in the file that describes it'
    )
