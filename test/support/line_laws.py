# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What must hold for each motor of a line that stops answering, judged from both ends of the line.

S1: a drive that was asked in vain, and sent no valid frame for ``lost_after`` since that request,
is lost: this is told within 0.3 s, and ``enabled`` is false. Where no drive of the line answers and
two were asked in vain (one, if the line has one), each counts as asked from the first of these
requests on.

S2: a stop for it has been on the wire 0.5 s after that, or 0.3 s after it was called for; besides
there is the rest of the request under way, and the stops of all that are due, one after the other,
each of which waits as long as the drive has ever taken to answer.

What was sent and what answered is known from the link and its port, what the motors do from the
simulated drives, what is told from what the driver publishes. Nothing else of the driver is asked.
"""

from __future__ import annotations

from dataclasses import dataclass, field
import math

from support.rig import Asked, Rig
from support.stops import takes_run_away

#: S1: within this a loss is told, s.
_TOLD = 0.3
#: S2: within this a stop is on the wire after a loss, and after it was called for, s.
_AFTER_LOSS, _AFTER_CALL = 0.5, 0.3
#: How often is looked, s, and what a look may come too late.
_LOOKS, _SLACK = 0.01, 0.02
#: A request and its gaps have no more characters than this, and that of a stop.
_CHARACTERS = 24


@dataclass
class _Unit:
    """
    One drive, as it was seen from both ends of the line.

    :ivar asked_at: when the first request in vain was sent since its last valid frame.
    :ivar longest: the longest time from a request to the end of its answer, s; infinite: none came.
    :ivar stop_at: when the last request was sent that takes its run command away.
    :ivar due_since: since when a stop is due that was not sent; infinite: none is.
    :ivar due_within: how long after that it has to be sent, s.
    :ivar running: its motor may run by this driver: it did, and no stop was sent since.
    :ivar broken: the laws that it has broken; each is told once.
    """

    asked_at: float = math.inf
    longest: float = -math.inf
    stop_at: float = -math.inf
    due_since: float = math.inf
    due_within: float = 0.0
    running: bool = False
    broken: set[str] = field(default_factory=set)


class LineLaws:
    """
    Watches the drives of a rig whose motors run by its driver.

    :ivar broken: what breaks a law, in sentences.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._clock = rig.clock
        self._line = rig.line
        self._units = {unit: _Unit() for unit in rig.drives}
        self._began = self._looked_at = rig.clock.now
        #: When the first request in vain was sent since the last valid frame of any drive.
        self._asked_at = math.inf
        #: Whom it was in vain for since then.
        self._in_vain: set[int] = set()
        self.broken: list[str] = []
        rig.told = self._take
        rig.looked = self._look

    # --- what happens ---------------------------------------------------------------------------

    def called(self, *units: int) -> None:
        """Note that a stop is called for now, for some drives or for all."""
        for number in units or self._units:
            self._due(self._units[number], self._clock.now, _AFTER_CALL)

    def stood_still(self, seconds: float) -> None:
        """Note that the driver did not run for so long, s, until now: that is no silence."""
        self._asked_at += seconds
        for unit in self._units.values():
            unit.asked_at += seconds
            unit.due_since += seconds

    def _take(self, asked: Asked) -> None:
        """Take a request that is over."""
        stops = asked.sent > -math.inf and takes_run_away(self._rig, asked.key, asked.data)
        unit = self._units.get(asked.unit)
        if unit is None:
            # all obey it
            for each in self._units.values() if stops else ():
                self._stopped(each, asked.sent)
            return
        if asked.answered:
            if asked.sent > -math.inf:
                unit.longest = max(unit.longest, asked.ended - asked.sent)
            unit.asked_at = self._asked_at = math.inf
            self._in_vain.clear()
        elif asked.sent > -math.inf:
            unit.asked_at = min(unit.asked_at, asked.sent)
            self._asked_at = min(self._asked_at, asked.sent)
            self._in_vain.add(asked.unit)
        if stops:
            self._stopped(unit, asked.sent)

    @staticmethod
    def _stopped(unit: _Unit, at: float) -> None:
        unit.stop_at = at
        unit.due_since = math.inf
        unit.running = False

    def _due(self, unit: _Unit, since: float, within: float) -> None:
        """Note that a stop is due for a drive; the earliest counts."""
        if unit.running and since + within < unit.due_since + unit.due_within:
            unit.due_since, unit.due_within = since, within

    # --- the laws -------------------------------------------------------------------------------

    def _look(self) -> None:
        now = self._clock.now
        if now - self._looked_at < _LOOKS:
            return
        self._looked_at = now
        for number, unit in self._units.items():
            far = self._rig.fars[number]
            snapshot = self._rig.notes_of[number].snapshot
            enabled = snapshot is not None and snapshot.enabled
            # one that was stopped and not enabled again does not run by this driver
            turns = far.motor.driven and far.motor.demand != 0
            unit.running = unit.running or (turns and enabled and now > unit.stop_at)
            self._judge_loss(number, unit)
            self._judge_stop(number, unit)

    def lost_at(self, number: int) -> float:
        """Return when a drive is lost by S1; infinite: it is not asked in vain."""
        unit, settings = self._units[number], self._rig.drives[number].settings
        whole_line = len(self._in_vain) >= min(2, len(self._units))
        asked_at = min(unit.asked_at, self._asked_at if whole_line else math.inf)
        return asked_at + settings.lost_after

    def _judge_loss(self, number: int, unit: _Unit) -> None:
        """Judge S1."""
        lost_at = self.lost_at(number)
        if self._clock.now < lost_at:
            return
        self._due(unit, lost_at, _AFTER_LOSS)
        snapshot = self._rig.notes_of[number].snapshot
        if self._clock.now > lost_at + _TOLD + _SLACK and snapshot is not None:
            told = [name for name in ('connected', 'enabled') if getattr(snapshot, name)]
            if told:
                self._break('S1', number, f'is told as {" and ".join(told)}, lost at', lost_at)

    def _judge_stop(self, number: int, unit: _Unit) -> None:
        """Judge S2."""
        if unit.due_since == math.inf:
            return
        frame = _CHARACTERS * self._line.settings.char_time
        timeout = self._line.settings.response_timeout
        # the request under way, and the stops of all others, each of which waits for its answer
        round_of_stops = sum(
            frame + (each.longest if each.longest > 0 else timeout)
            for each in self._units.values()
            if each.due_since < math.inf
        )
        until = unit.due_since + unit.due_within + frame + timeout + round_of_stops
        if self._clock.now > until + _SLACK:
            self._break('S2', number, 'has no stop on the wire, due since', unit.due_since)

    def _break(self, law: str, number: int, what: str, since: float) -> None:
        unit = self._units[number]
        if law in unit.broken:
            return
        unit.broken.add(law)
        now = self._clock.now
        self.broken.append(
            f'{law}: drive {number} {what} {since - self._began:.2f} s, and it is '
            f'{now - self._began:.2f} s'
        )

    def still_turning(self) -> list[int]:
        """Return whose motors the drives turn now."""
        return [
            number for number, far in self._rig.fars.items()
            if far.motor.driven and far.motor.demand != 0
        ]

