# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Whether the motor does what it was told: its direction and size beside the set-points."""

from __future__ import annotations

import math

from nfo_sinus_driver.catalog import Meaning, Role
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause, Report, Severity
from nfo_sinus_driver.drive.setpoint import Setpoint

#: By more than this a size has to fall, Hz, within so long, s: the slowest ramp, of 2000 s, falls
#: by 0.1 in 4 s, and no drive tells it in greater steps.
_FALL = 0.04
_FALLS_WITHIN = 5.0
#: A motor that is slower stands, or wobbles, Hz.
_STANDS = 0.5
#: One that turns the other way does so from here on, Hz: slip and measuring show no more.
_BACKWARDS = 2.0
#: So long a drive may take to begin to follow another set-point, s.
_REACTION = 1.0
#: By this share of a set-point slip, its compensation and overshoot go beyond, and so much more.
_BEYOND = 0.1
_BEYOND_BY = 3.0
#: A motor that is slowed down by so much, so far below its set-points, goes to a stop: Hz.
_SHORT, _FALLEN = 1.0, 0.4
#: What is compared with set-points, and what one of its units is for 1 Hz of a four-pole motor.
_COMPARED = {'Freque': (Role.ACTUAL_FREQUENCY, 1.0), 'Speed': (Role.ACTUAL_SPEED, 30.0)}


class _Fall:
    """A size that ought to fall."""

    def __init__(self) -> None:
        self.least = math.inf
        self._fell_at = math.inf

    def take(self, size: float, at: float, wobble: float = _FALL) -> bool:
        """Take a size; tell whether it has not fallen for so long that no ramp is that slow."""
        if size < self.least - wobble:
            self.least, self._fell_at = size, at
        return at - self._fell_at > _FALLS_WITHIN


class Following:
    """Compares what is measured of one drive with its set-points, from when it is armed on."""

    def __init__(self, state: DriveState, setpoint: Setpoint) -> None:
        self._state = state
        self._setpoint = setpoint
        self._at = -math.inf
        #: It told a frequency below 0: it has a sign.
        self._signed = False
        self.begin()

    def begin(self) -> None:
        """Begin anew."""
        self._after_expiry, self._backwards, self._beyond = _Fall(), _Fall(), _Fall()
        #: In which direction all set-points of late point; 0: in none, or in both.
        self._way = 0
        self._wrong_way = 0
        #: From which size on the drive slows it down, below its set-points.
        self._falls_from = 0.0
        self._reported = False

    def judge(self) -> Report | None:
        """Return why the motor has to be stopped, for what was measured last; tell what else is."""
        measured = self._state.turned
        role, unit = _COMPARED.get(self._setpoint.control_mode, (None, 1.0))
        actual = self._state.last_polled(role)
        if measured.at <= max(self._at, self._setpoint.following_since):
            return None
        self._at = measured.at
        least, most = self._setpoint.range_since(measured.at - _REACTION)
        frequency = measured.value
        self._signed = self._signed or frequency < 0
        cause = None
        if self._goes_on(frequency, measured.at):
            cause = Cause.NOT_SLOWER_AFTER_TIME_OUT
        elif role is not None and self._turns_back(frequency, measured.at, least, most):
            cause = Cause.TURNS_BACKWARDS
        elif role is not None and self._goes_to_a_stop(actual.value, least, most, unit):
            cause = Cause.STOPPED_BY_ITSELF
        elif role is not None:
            self._look_beyond(actual.value, measured.at, max(-least, most), unit)
        turning = self._state.turning
        now = frequency / turning.hertz
        return cause and self._state.report(cause, now=now, unit=turning.unit)

    def _goes_on(self, frequency: float, at: float) -> bool:
        """Tell whether it does not slow down, although no set-point comes any more."""
        if not self._setpoint.expired or not abs(frequency) > _STANDS:
            self._after_expiry = _Fall()
            return False
        return self._after_expiry.take(abs(frequency), at)

    def _turns_back(self, frequency: float, at: float, least: float, most: float) -> bool:
        """
        Tell whether it turns against all set-points of late, and does not only ramp down.

        One that has begun to, through standstill, has been told by another master.
        """
        if not self._setpoint.directed:
            return False
        way = 0
        if least >= 0 and most > 0:
            way = 1
        elif most <= 0 and least < 0 and self._signed:
            way = -1
        if way != self._way:
            # a motor that ramps down from the other direction was never seen to begin in this one
            self._way, self._backwards, self._wrong_way = way, _Fall(), 0
        if not way:
            return False
        back = -way * frequency
        endless = self._backwards.take(max(back, 0.0), at)
        begun = self._backwards.least < _STANDS
        self._wrong_way = self._wrong_way + 1 if back > _BACKWARDS and (begun or endless) else 0
        # one value that cannot be stops no motor
        return self._wrong_way > 1

    def _goes_to_a_stop(self, actual: float, least: float, most: float, unit: float) -> bool:
        """
        Tell whether the drive slows the motor down although all set-points of late are beyond it.

        Where no status word distinguishes a ramp to a stop from a run. By less the slip of the
        motor goes below a set-point.
        """
        status = self._state.status
        if status is None or not (status.word is None or status.by_frequency):
            return False
        way = 1 if least > 0 else -1 if most < 0 else 0
        size, wanted = way * actual, min(abs(least), abs(most))
        short = 0 < size < wanted * (1 - _BEYOND) - _SHORT * unit
        if not (short and status.means(Meaning.SLOWING)):
            self._falls_from = 0.0
            return False
        self._falls_from = max(self._falls_from, size)
        return size < self._falls_from - _FALLEN * unit

    def _look_beyond(self, value: float, at: float, most: float, unit: float) -> None:
        """Tell of a motor that turns faster than it was told, and give the set-point again."""
        size, margin = abs(value), _BEYOND_BY * unit
        if not size > most * (1 + _BEYOND) + margin:
            self._beyond, self._reported = _Fall(), False
            return
        endless = self._beyond.take(size, at, _FALL * unit)
        if self._reported or not (endless or size > self._beyond.least + margin):
            return
        self._reported = True
        wanted, name = self._setpoint.commanded, self._state.unit
        report = self._state.report(
            Cause.FASTER_THAN_SETPOINT, now=value, setpoint=wanted, unit=name
        )
        self._state.tell(Severity.WARNING, report)
        self._setpoint.write_again()
