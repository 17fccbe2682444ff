# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Which units of one line do not answer, and where another one may be by now.

No thread, no clock and nothing sent: :class:`nfo_sinus_driver.bus.Bus` reports the outcome of each
request, and asks.
"""

from __future__ import annotations

import dataclasses
import math

from nfo_sinus_driver.link import DamagedAnswer, LinkError, NotSent, PortError, Refused

__all__ = ['SWAP_TIME', 'Silences']

#: A unit that has been silent for so long counts as missing, s: short enough to spare the others,
#: longer than a burst of noise.
_MISSING_AFTER = 2.0
#: The share of the time that all missing units may take together while others answer.
_MISSING_SHARE = 1 / 20
#: The same for stops to silent units while noise damages answers: they may be there.
_STOPS_IN_NOISE = 1 / 2
#: In a longer silence another unit may have been put in the place of one, s: that is how long it
#: takes to move the plug of the line from a drive to a spare one beside it that has power.
SWAP_TIME = 3.0
#: How much longer than a loss takes a stop may be written, s: until it is noticed that nothing
#: answers, the last answer is older than the first request in vain, and others have turns.
_NOTICED_WITHIN = 0.5
#: How long after a request its answer counts as missing, s, however long it is waited for.
_ANSWERED_WITHIN = 0.1
#: A silence of one unit that is longer is no noise, s.
_NOISE = 0.4
#: For how long noise counts that has damaged an answer, s.
_NOISE_LASTS = 5.0
#: How many units have to be asked in vain until it is the line that is silent.
_A_LINE = 2


@dataclasses.dataclass(slots=True)
class _Unit:
    """
    What is known of the answers of one unit; all times are of one clock, s.

    :ivar frame_at: when its last valid frame came.
    :ivar asked_at: when it was last sent anything.
    :ivar gone_since: when the first answer had failed to come since it does not answer, with the
        time in which the worker did not run: a drive can be exchanged in it.
    :ivar there_since: when a silence of it ended that was long enough for a swap.
    :ivar longest: the longest time from one valid frame to the next.
    """

    frame_at: float = -math.inf
    asked_at: float = -math.inf
    gone_since: float = math.inf
    there_since: float = -math.inf
    longest: float = 0.0

    def note_asked(self, now: float) -> None:
        """Note that it was sent something."""
        self.asked_at = now

    def answered(self, now: float) -> None:
        """Note that a valid frame came; a silence in which it may have been exchanged ends."""
        if now - self.gone_since > SWAP_TIME:
            self.there_since = now
        if self.frame_at > -math.inf:
            self.longest = max(self.longest, now - self.frame_at)
        self.frame_at = now
        self.gone_since = math.inf

    def not_answered(self, now: float) -> None:
        """Note that a request was in vain."""
        self.gone_since = min(self.gone_since, now)

    def take_longest(self) -> float:
        """Return the longest time from one valid frame to the next since the last call."""
        longest, self.longest = self.longest, 0.0
        return longest


#: What is known of a unit that was never asked.
_NEVER_ASKED = _Unit()


class Silences:
    """
    How long each unit has not answered its requests; all times are of one clock, s.

    Silence begins with the first request that is not answered, when the answer has failed to come,
    however much longer it was waited for: a unit without requests is not silent, and one lost
    answer is no silence yet. Any valid frame of the unit ends it.

    Where no unit answers, they share the time, and each request takes the longest: many would get
    none for a while. So from the first request in vain on, the line is silent, once two units were
    asked (one, if there are no more), and all that would have been asked count as asked.

    Each request to a unit that is missing costs the others a whole time-out, so there is a pause
    behind it, in which none of the missing units gets one.

    :ivar opened_at: when the port was opened that had been lost.
    :ivar moved_at: when it was last opened where it may not be the port that it was before.
    :ivar away_at: when it was last opened after so long that other units may be behind it.
    """

    def __init__(self) -> None:
        #: Of each that was ever asked; other threads look here, too, and add none.
        self._units: dict[int, _Unit] = {}
        #: The units that do not answer, and since when.
        self._silent: dict[int, float] = {}
        #: After which silence the drive at a unit is lost, s: all units that have a drive.
        self._lost_after: dict[int, float] = {}
        #: The units asked in vain since the last valid frame, and since when one of them was.
        self._in_vain: set[int] = set()
        self._in_vain_since = math.inf
        #: How long a request in vain has taken at most, s.
        self._longest_in_vain = 0.0
        #: When an answer was last damaged.
        self._damaged_at = -math.inf
        #: When the last valid frame of any unit came.
        self._any_frame_at = -math.inf
        self._pause_ends = -math.inf
        #: The same of stops to units that are silent, in noise.
        self._stops_from = -math.inf
        #: When the last silence of the whole line ended.
        self._back_at = -math.inf
        self.opened_at = self.moved_at = self.away_at = -math.inf
        #: When a silence of the line ended that was long enough for a swap.
        self._line_since = -math.inf

    def watch(self, unit: int, lost_after: float) -> None:
        """Note that there is a drive at a unit, and after which silence that is lost, s."""
        self._lost_after[unit] = lost_after

    def note_request(
        self,
        unit: int,
        now: float,
        error: LinkError | None,
        seconds: float = 0.0,
        silence: float = 0.0,
        *,
        is_stop: bool = False,
    ) -> None:
        """
        Note the outcome of a request that took ``seconds``.

        :param silence: how long the line was kept silent for it before, s.
        :param is_stop: it was a stop, or the look before it.
        """
        if isinstance(error, NotSent):
            return
        its = self._units.get(unit)
        if its is None:
            its = self._units[unit] = _Unit()
        if isinstance(error, DamagedAnswer):
            self._damaged_at = now
        if not isinstance(error, PortError):
            its.note_asked(now)
        if error is None or error.responded or isinstance(error, Refused):
            if now - self._any_frame_at > SWAP_TIME:
                # this end may have stood still
                self._line_since = now
            if now - self._any_frame_at >= _MISSING_AFTER:
                # it was the line: the others may be back with this one, and have to be stopped
                self._back_at = now
            its.answered(now)
            self._silent.pop(unit, None)
            self._any_frame_at = now
            self._in_vain.clear()
            self._in_vain_since = math.inf
        elif self.is_missing(unit, now):
            self._pause_ends = now + (silence + seconds) * (1 / _MISSING_SHARE - 1)
        if is_stop and unit in self._silent:
            self._stops_from = now + (silence + seconds) * (1 / _STOPS_IN_NOISE - 1)
        if error is not None and not isinstance(error, (PortError, Refused)):
            # by then a drive has answered
            failed_at = now - max(seconds - _ANSWERED_WITHIN, 0.0)
            its.not_answered(now)
            self._silent.setdefault(unit, failed_at)
            self._in_vain.add(unit)
            self._longest_in_vain = max(seconds, self._longest_in_vain)
            self._in_vain_since = min(self._in_vain_since, failed_at)

    def opened(self, now: float, *, same_place: bool = False) -> None:
        """
        Note that a port that was lost was opened: other units may be behind it.

        :param same_place: it is where it was before.
        """
        self.opened_at = now
        if not same_place:
            self.moved_at = now
        if not same_place or now - self._any_frame_at > SWAP_TIME:
            self._line_since = self.away_at = now

    def paused(self, seconds: float) -> None:
        """Note that nothing was sent for so long, s, for the worker did not run."""
        for unit in self._silent:
            self._silent[unit] += seconds
        self._in_vain_since += seconds

    def _of(self, unit: int) -> _Unit:
        return self._units.get(unit, _NEVER_ASKED)

    def there_since(self, unit: int, now: float, *, to_stop: bool = False) -> float:
        """
        Return since when a unit cannot have been exchanged; infinity if it may be by now.

        :param to_stop: it is to be stopped only: for that it is the same until it is lost, however
            long that takes.
        """
        longest = SWAP_TIME
        if to_stop:
            longest = max(SWAP_TIME, self._lost_after.get(unit, 0.0) + _NOTICED_WITHIN)
        its = self._of(unit)
        if now - min(its.gone_since, self._any_frame_at) > longest:
            return math.inf
        return max(self._line_since, its.there_since)

    @property
    def is_line_silent(self) -> bool:
        """No unit has answered since several were asked in vain, or the only one."""
        return len(self._in_vain) >= min(_A_LINE, max(len(self._lost_after), 1))

    def is_silent(self, unit: int) -> bool:
        """Return whether a unit has not answered the last request to it."""
        return unit in self._silent

    def silent_since(self, unit: int, *, is_watched: bool) -> float:
        """
        Return since when a unit does not answer; infinity if it does.

        :param is_watched: it would have been asked all the time, were there time for it.
        """
        since = self._silent.get(unit, math.inf)
        return min(since, self._in_vain_since) if is_watched and self.is_line_silent else since

    @property
    def round_in_vain(self) -> float:
        """How long it takes at most to send something to each drive in vain, s."""
        return len(self._lost_after) * self._longest_in_vain

    @property
    def soonest_loss(self) -> float:
        """After which silence the first drive of the line is lost, s."""
        return min(self._lost_after.values(), default=math.inf)

    @property
    def latest_loss(self) -> float:
        """After which silence all drives of the line are lost, s."""
        return max(self._lost_after.values(), default=math.inf)

    def was_asked_since_silent(self, unit: int) -> bool:
        """Return whether a unit was sent anything since the line is silent."""
        return self._of(unit).asked_at >= self._in_vain_since

    def is_dead(self, now: float) -> bool:
        """Return whether the line is silent for more than noise: for several units, or for long."""
        several = len(self._in_vain) >= _A_LINE
        return several or (self.is_line_silent and now - self._in_vain_since >= _NOISE)

    @property
    def any_silent(self) -> bool:
        """A unit has not answered the last request to it."""
        return bool(self._silent)

    def asked_at(self, unit: int | None = None) -> float:
        """Return when a unit, or any, was last sent anything."""
        if unit is None:
            return max((its.asked_at for its in self._units.values()), default=-math.inf)
        return self._of(unit).asked_at

    def last_frame_at(self, unit: int) -> float:
        """Return when the last valid frame of a unit came."""
        return self._of(unit).frame_at

    def take_longest(self, unit: int) -> float:
        """Return the longest time between two valid frames of a unit since the last call."""
        return self._of(unit).take_longest()

    def lasts(self, unit: int, now: float) -> float:
        """Return for how long a unit has been silent; 0 if it answers."""
        since = self._silent.get(unit, math.inf)
        return now - since if since < math.inf else 0.0

    def is_missing(self, unit: int, now: float) -> bool:
        """Return whether a unit has been silent for so long that it gets few requests."""
        return min(self.lasts(unit, now), now - self._back_at) >= _MISSING_AFTER

    def is_in_noise(self, now: float) -> bool:
        """Return whether an answer was damaged just before: those that are missing may be there."""
        return now < self._damaged_at + _NOISE_LASTS

    @property
    def missing_from(self) -> float:
        """From when on a missing unit may get a request; at any time while no unit responds."""
        return min(self._pause_ends, self._any_frame_at + _MISSING_AFTER)

    def stops_in_vain_from(self, now: float) -> float:
        """Return from when on a silent unit gets its stop ahead of others; infinity: not."""
        return self._stops_from if self.is_in_noise(now) else math.inf
