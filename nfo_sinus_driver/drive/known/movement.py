# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
When a motor stands, when it falls, and which way it turns.

What is measured fluctuates, comes in steps and is late, so whether a motor moves is a matter of
thresholds. All that judges a motor takes them from here; what a status itself shows of a fall is
kept with it (:mod:`nfo_sinus_driver.catalog.inverter_status`), for it is carried from one to the
next.

====================  =======  ===================================================================
`STANDSTILL`          0.5 Hz   a slower motor stands, or what is measured fluctuates
`STEP`                0.04 Hz  no drive shows a frequency in greater steps: less is no fall at all
`WOBBLE`              0.1 Hz   a motor that keeps its speed shows no more than this
`FALL_AFTER_SILENCE`  0.5 Hz   between two statuses far apart the load may change the speed as well
`FALLS_WITHIN`        5 s      the slowest ramp, of 2000 s, falls by 0.1 Hz in 4 s
`RAMP_SHOWS_BY`       7 s      it shows by then, however coarse the frequency is
`STANDS_FOR`          2 s      where turning alone shows a run, the slowest ramp is 600 s
====================  =======  ===================================================================
"""

from __future__ import annotations

import math

from nfo_sinus_driver.catalog.inverter_status import FALLS_WITHIN, WOBBLE
from nfo_sinus_driver.drive.known.snapshot import NAN

__all__ = [
    'FALLS_WITHIN',
    'FALL_AFTER_SILENCE',
    'RAMP_SHOWS_BY',
    'STANDSTILL',
    'STANDS_FOR',
    'STEP',
    'WOBBLE',
    'Direction',
    'Fall',
    'Standing',
    'Still',
]

STANDSTILL = 0.5
STEP = 0.04
FALL_AFTER_SILENCE = 0.5
RAMP_SHOWS_BY = 7.0
STANDS_FOR = 2.0
#: A motor that is on its way to the other direction becomes slower by a wobble each so many s; one
#: that becomes faster by so much, Hz, has turned.
_TURNS_WITHIN, _RISE = 1.0, 0.5


class Fall:
    """
    A size that ought to fall.

    :ivar least: the least so far.
    """

    def __init__(self) -> None:
        self.least = math.inf
        self._fell_at = math.inf

    def has_ended(self, size: float, at: float, step: float = STEP) -> bool:
        """Note a size; return whether it has not fallen for longer than any ramp takes."""
        if size < self.least - step:
            self.least, self._fell_at = size, at
        return at - self._fell_at > FALLS_WITHIN


class Standing:
    """
    Since when a motor stands, by what was noted without a gap.

    :ivar since: s; infinity: it does not.
    """

    def __init__(self) -> None:
        self.since = math.inf

    def note_standing(self, at: float, stands: bool) -> float:
        """Note whether it stood at a moment, s; return since when it does."""
        self.since = min(self.since, at) if stands else math.inf
        return self.since


class Still:
    """A size that keeps within a range: that of a motor on its ramp does not."""

    def __init__(self) -> None:
        self._low, self._high = math.inf, -math.inf
        self._since = math.inf

    def note(self, size: float, at: float, step: float = STEP) -> float:
        """Note a size; return since when the range of all sizes has not grown by a step, s."""
        if size < self._low - step or size > self._high + step:
            self._low, self._high = min(self._low, size), max(self._high, size)
            self._since = at
        return self._since


class Direction:
    """The direction of one motor, as commanded."""

    def __init__(self) -> None:
        #: The set-point that the drive has, in any unit; NaN: the driver commands none.
        self._commanded = NAN
        self._way = NAN
        #: Of a motor whose direction is to change: its least frequency, and since when.
        self._least = (math.inf, math.inf)

    @property
    def known(self) -> bool:
        """A motor that turns does so by a command of the driver."""
        return not math.isnan(self._way)

    def command(self, setpoint: float) -> None:
        """Note the set-point that the drive has, in any unit; NaN: the driver commands none."""
        self._commanded = setpoint

    def take_size(self, size: float, now: float) -> None:
        """Take what was measured, Hz, and when, s of the clock of the bus."""
        # set-point 0 is in no direction: the motor stops in that which it has
        wanted = math.copysign(1.0, self._commanded) if abs(self._commanded) > 0 else NAN
        least, since = self._least
        if size < STANDSTILL or not self.known:
            self._turns(wanted)
        elif math.isnan(wanted) or wanted == self._way:
            self._least = math.inf, math.inf
        elif size < least - WOBBLE:
            self._least = size, now
        elif size > least + _RISE or now - since > _TURNS_WITHIN:
            self._turns(wanted)

    def _turns(self, way: float) -> None:
        self._way, self._least = way, (math.inf, math.inf)

    def of(self, size: float) -> float:
        """Return a size with the sign of its direction; where that is not known, as it is."""
        return size * self._way if self.known and size else size
