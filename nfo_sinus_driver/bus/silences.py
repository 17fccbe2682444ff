# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Which units of one line do not answer, and where another one may be by now.

No thread, no clock and nothing sent: :class:`nfo_sinus_driver.bus.Bus` reports the outcome of each
request, and asks.
"""

from __future__ import annotations

import math

from nfo_sinus_driver.link import LinkError, NotSent, PortError, Refused

__all__ = ['EXCHANGE', 'Silences']

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
#: How much longer than a loss takes a stop may be written, s: until it is noticed that nothing
#: answers, the last answer is older than the first request in vain, and others have turns.
_NOTICED_WITHIN = 0.5
#: How long after a request its answer counts as missing, s, however long it is waited for.
_ANSWERED_WITHIN = 0.1
#: How many units have to be asked in vain until it is the line that is silent.
_A_LINE = 2


class Silences:
    """
    How long each unit has not answered its requests; all times are of one clock, s.

    Silence begins with the first request that is not answered, when the answer has failed to come,
    however much longer it was waited for: a unit without requests is not silent, and one lost
    answer is no silence yet. Any valid frame of the unit ends it.

    Where no unit answers, they share the time, and each request takes the longest: many would get
    none for a while. So from the first request in vain on, the line is silent, once two units were
    asked (one, if there are no more), and whoever would have been asked counts as asked.

    Each request to a unit that is missing costs the others a whole time-out, so there is a pause
    behind it, in which none of the missing units gets one.

    Where no unit answers any more, the port itself may be mute: what carries the bytes may pass
    none until it is opened again, and report no error. Units that are switched off look the same,
    so it is opened again more and more seldom. An address that never answered shows nothing.

    :ivar heard: something valid has ever come.
    :ivar opened_at: when the port was opened that had been lost.
    :ivar moved_at: when it was last opened where it may not be the port that it was before.
    """

    def __init__(self) -> None:
        #: After which silence the drive at a unit is lost, s: all units that have a drive.
        self._lost_after: dict[int, float] = {}
        self._last_frame_at: dict[int, float] = {}
        self._since: dict[int, float] = {}
        #: The same, when the first answer had failed to come, with the time in which the worker did
        #: not run: a drive can be exchanged in it.
        self._gone_since: dict[int, float] = {}
        #: The units asked in vain since the last valid frame, and since when one of them was.
        self._in_vain: set[int] = set()
        self._in_vain_since = math.inf
        #: When each unit was last sent anything.
        self._asked_at: dict[int, float] = {}
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
        self.opened_at = self.moved_at = -math.inf
        #: When a silence ended that was long enough for an exchange: of the line, and of each unit.
        self._line_since = -math.inf
        self._unit_since: dict[int, float] = {}

    def watch(self, unit: int, lost_after: float) -> None:
        """Note that there is a drive at a unit, and after which silence that is lost, s."""
        self._lost_after[unit] = lost_after

    def note(self, unit: int, now: float, error: LinkError | None, seconds: float = 0.0) -> bool:
        """Note the outcome of a request that took ``seconds``; return whether the port carries."""
        if isinstance(error, NotSent):
            return False
        if not isinstance(error, PortError):
            self._asked_at[unit] = now
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
            self._in_vain.clear()
            self._in_vain_since = math.inf
        elif self.is_missing(unit, now):
            self._pause_ends = now + seconds * (1 / _MISSING_SHARE - 1)
        if error is not None and not isinstance(error, (PortError, Refused)):
            # by then a drive has answered
            failed_at = now - max(seconds - _ANSWERED_WITHIN, 0.0)
            self._since.setdefault(unit, failed_at)
            self._gone_since.setdefault(unit, now)
            self._in_vain.add(unit)
            self._in_vain_since = min(self._in_vain_since, failed_at)
        if error is None or error.responded or error.heard:
            self.heard, self._opened, self._mute_since = True, 0, math.inf
            return True
        if not isinstance(error, PortError) and (not self.heard or unit in self._last_frame_at):
            self._mute_since = min(self._mute_since, now)
        return False

    def opened(self, now: float, *, lost: bool, same_place: bool = False) -> None:
        """
        Note that the port was opened; after it was lost, other units may be behind it.

        :param same_place: it is where it was before.
        """
        if lost:
            self.opened_at = now
            if not same_place:
                self.moved_at = now
            if not same_place or now - self._any_frame_at > EXCHANGE:
                self._line_since = now
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
        self._in_vain_since += seconds
        self._mute_since += seconds

    def _note_exchange(self, unit: int, now: float) -> None:
        """Note that a silence ends in which a unit, or any, may have been exchanged."""
        if now - self._gone_since.get(unit, now) > EXCHANGE:
            self._unit_since[unit] = now
        if now - self._any_frame_at > EXCHANGE:
            # this end may have stood still
            self._line_since = now

    def there_since(self, unit: int, now: float, *, to_stop: bool = False) -> float:
        """
        Return since when a unit cannot have been exchanged; infinity if it may be by now.

        :param to_stop: it is to be stopped only: for that it is the same until it is lost, however
            long that takes.
        """
        longest = EXCHANGE
        if to_stop:
            longest = max(EXCHANGE, self._lost_after.get(unit, 0.0) + _NOTICED_WITHIN)
        if now - min(self._gone_since.get(unit, now), self._any_frame_at) > longest:
            return math.inf
        return max(self._line_since, self._unit_since.get(unit, -math.inf))

    @property
    def is_line_silent(self) -> bool:
        """No unit has answered since several were asked in vain, or the only one."""
        return len(self._in_vain) >= min(_A_LINE, max(len(self._lost_after), 1))

    def is_silent(self, unit: int) -> bool:
        """Return whether a unit has not answered the last request to it."""
        return unit in self._since

    def silent_since(self, unit: int, *, is_watched: bool) -> float:
        """
        Return since when a unit does not answer; infinity if it does.

        :param is_watched: it would have been asked all the time, were there time for it.
        """
        since = self._since.get(unit, math.inf)
        return min(since, self._in_vain_since) if is_watched and self.is_line_silent else since

    def line_lasts(self, now: float) -> float:
        """Return for how long the line has been silent, s; 0 if a unit answers."""
        return now - self._in_vain_since if self.is_line_silent else 0.0

    @property
    def any_silent(self) -> bool:
        """A unit has not answered the last request to it."""
        return bool(self._since)

    def asked_at(self, unit: int | None = None) -> float:
        """Return when a unit, or any, was last sent anything."""
        if unit is None:
            return max(self._asked_at.values(), default=-math.inf)
        return self._asked_at.get(unit, -math.inf)

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
