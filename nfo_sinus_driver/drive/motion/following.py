# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Whether the motor follows its set-points, in direction and speed."""

from __future__ import annotations

import math
from typing import NamedTuple

from nfo_sinus_driver.catalog import Fact, Meaning
from nfo_sinus_driver.catalog.status import FREQUENCY, SPEED
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, Report, Severity
from nfo_sinus_driver.drive.known.movement import (
    FALLS_WITHIN,
    STANDS_FOR,
    STANDSTILL,
    STEP,
    Fall,
    Standing,
)
from nfo_sinus_driver.drive.motion.setpoint import NO_TURN, Setpoint, sign

#: From here on a motor counts as turning backwards, Hz: slip and measuring errors show less.
_BACKWARDS = 2.0
#: How long a drive may take to begin to follow another set-point, s.
REACTION = 1.0
#: Slip, its compensation and overshoot exceed a set-point by this share of it and this much, Hz.
_BEYOND = 0.1
_BEYOND_BY = 3.0
#: How far below its set-points a motor is, and by how much it has slowed down, if it stops: Hz.
_SHORT, _FALLEN = 1.0, 0.4
#: How much faster than a set-point a motor turns at most that follows it: this share of it and this
#: much, Hz. One that turns faster does so for another reason, such as a least frequency.
_ABOVE, _ABOVE_BY = 1.1, 0.5
#: A wrong factor or unit makes a number so many times greater, or smaller: decimals, and rpm for Hz
#: of a motor of one to three pairs of poles.
_MULTIPLES = (10, 20, 30, 60, 100, 1000)
#: Slip takes a motor no further from a multiple than this share of it.
_NEARLY = 0.05
#: For how long a speed has to be steady, s, and within what, Hz: the slowest ramp, of 2000 s, is no
#: such speed.
_STEADY_FOR, _STEADY = 8.0, 0.1
#: What is compared with set-points, and what one of its units is for 1 Hz of a four-pole motor.
COMPARED = {FREQUENCY.mode: (FREQUENCY.role, 1.0), SPEED.mode: (SPEED.role, 30.0)}


class _Shown(NamedTuple):
    """What a status shows; the speed in Hz, whatever its direction."""

    word: int | None
    code: int
    size: float


class FollowingCheck:
    """Compares the speed of one motor with its set-points while it is enabled."""

    def __init__(self, state: DriveState, setpoint: Setpoint) -> None:
        self._state = state
        self._setpoint = setpoint
        self._at = -math.inf
        #: There was a frequency below 0: it has a sign.
        self._signed = False
        self.begin()

    def begin(self) -> None:
        """Begin again."""
        self._after_expiry = Fall()
        self._backwards = Fall()
        self._beyond = Fall()
        #: The direction of all recent set-points; 0: none, or both.
        self._direction = 0
        self._wrong_polls = 0
        #: Against its set-points.
        self._standing = Standing()
        #: It has turned by all recent set-points, which are the command.
        self._has_begun = False
        #: The speed from which the drive slows it down, below its set-points.
        self._falls_from = 0.0
        self._reported = self._scale_reported = False
        #: A speed, and since when it has been that, s.
        self._steady, self._steady_since = 0.0, math.inf
        #: What the newest status shows, and what that was that has to change, with the moment from
        #: which on; ``None``: it has changed, or need not.
        self._shown: _Shown | None = None
        self._stale: _Shown | None = None
        self._newest_turn = self._stale_turn = NO_TURN

    def check(self) -> Report | None:
        """Return why the last measurement has to stop the motor; report what else is wrong."""
        measured = self._state.measurements.turned
        role, unit = COMPARED.get(self._setpoint.control_mode, (None, 1.0))
        actual = self._state.measurements.last(role)
        if measured.at <= max(self._at, self._setpoint.following_since):
            return None
        self._at = measured.at
        least, most = self._setpoint.range_since(measured.at - REACTION)
        frequency = measured.value
        self._signed = self._signed or frequency < 0
        cause = None
        if self._goes_on(frequency, measured.at):
            cause = Cause.NOT_SLOWER_AFTER_TIME_OUT
        elif role is not None and self._has_not_changed(frequency, measured.at, unit):
            cause = Cause.NOTHING_CHANGES
        elif self._has_ended(frequency, measured.at) or self._stands(frequency, measured.at):
            cause = Cause.STOPPED_BY_ITSELF
        elif role is not None and self._turns_back(frequency, measured.at, least, most):
            cause = Cause.TURNS_BACKWARDS
        elif role is not None and self._goes_to_a_stop(actual.value, least, most, unit):
            cause = Cause.STOPPED_BY_ITSELF
        elif role is not None:
            self._check_overspeed(actual.value, measured.at, max(-least, most), unit)
            self._check_scale(actual.value, measured.at, unit)
        turning = self._state.measurements.turning
        now = frequency / turning.hertz
        return cause and self._state.report(
            cause, now=now, unit=turning.unit, seconds=FALLS_WITHIN
        )

    def _has_not_changed(self, frequency: float, at: float, unit: float) -> bool:
        """
        Return whether nothing at all has changed since set-points have another sign, or are 0.

        Word, code or speed of a drive that has got them must: what answers may not be the drive.
        Counted is from when they were due, whether they are acknowledged or not.
        """
        status, turn = self._state.status, self._setpoint.turn
        if status is None:
            return False
        before, shown = self._shown, _Shown(status.word, status.code, abs(frequency))
        self._shown = shown
        if turn != self._newest_turn:
            self._newest_turn = turn
            # one that has been held at 0 for a moment since still has to change
            if self._stale is None or sign(turn.value) == sign(self._stale_turn.before):
                follows = abs(turn.before) / unit * _ABOVE + _ABOVE_BY
                must = before is not None and _BACKWARDS < before.size <= follows
                self._stale, self._stale_turn = before if must else None, turn
        stale = self._stale
        limited = status.means(Meaning.CURRENT_LIMIT) or Fact.LIMIT_ACTIVE in status.facts
        changed = stale is None or stale[:2] != shown[:2] or abs(stale.size - shown.size) > STEP
        if stale is None or changed or limited:
            self._stale = None
            return False
        # what has ceased is looked at for itself
        return not self._setpoint.ceased and at - self._stale_turn.at > FALLS_WITHIN

    def _goes_on(self, frequency: float, at: float) -> bool:
        """Return whether it does not slow down, although set-points have ceased and 0 is due."""
        if not self._setpoint.ceased or not abs(frequency) > STANDSTILL:
            self._after_expiry = Fall()
            return False
        return self._after_expiry.has_ended(abs(frequency), at)

    def _has_ended(self, frequency: float, at: float) -> bool:
        """
        Return whether a run has ended whose only command are the set-points, which go on.

        A drive whose enable input was open for a moment, or its power off, would run again. One
        that stands on its way to the other direction has not begun in that.
        """
        least, most = self._setpoint.range_since(at - REACTION)
        direction = 1 if least > 0 else -1
        wanted = max(least, -most) * self._state.measurements.turning.hertz
        status = self._state.status
        if not self._setpoint.is_command or status is None or wanted <= _BACKWARDS:
            self._has_begun = False
            return False
        begun = self._has_begun
        self._has_begun = status.driven and (begun or direction * frequency > _BACKWARDS)
        return begun and not self._has_begun

    def _stands(self, frequency: float, at: float) -> bool:
        """
        Return whether it stands against all recent set-points, where nothing but its turning shows
        that it runs by them.

        A motor that passes standstill on its way to the other direction stands for a moment.
        """
        status = self._state.status
        # where the set-point is the command, terminals may show a run
        is_command = self._setpoint.is_command
        hidden = status is not None and status.may_run and (is_command or not status.runs)
        since = self._standing.note_standing(at, hidden and frequency == 0)
        least, most = self._setpoint.range_since(at - STANDS_FOR)
        wanted = max(least, -most) * self._state.measurements.turning.hertz
        return wanted > STANDSTILL and at - since > STANDS_FOR

    def _turns_back(self, frequency: float, at: float, least: float, most: float) -> bool:
        """
        Return whether it turns against all recent set-points, and does not only ramp down.

        A motor that has begun to, through standstill, is commanded by another master.
        """
        if not self._setpoint.directed:
            return False
        direction = 0
        if least >= 0 and most > 0:
            direction = 1
        elif most <= 0 and least < 0 and self._signed:
            direction = -1
        if direction != self._direction:
            # a motor that ramps down from the other direction has not begun at standstill
            self._direction, self._backwards, self._wrong_polls = direction, Fall(), 0
        if not direction:
            return False
        back = -direction * frequency
        endless = self._backwards.has_ended(max(back, 0.0), at)
        begun = self._backwards.least < STANDSTILL
        self._wrong_polls = self._wrong_polls + 1 if back > _BACKWARDS and (begun or endless) else 0
        # one impossible value stops no motor
        return self._wrong_polls > 1

    def _goes_to_a_stop(self, actual: float, least: float, most: float, unit: float) -> bool:
        """
        Return whether the drive slows the motor down although all recent set-points are higher.

        Only where no status word distinguishes a ramp to a stop from a run. Slip takes the motor
        less far below a set-point.
        """
        status = self._state.status
        if status is None or not (status.word is None or status.by_frequency):
            return False
        direction = 1 if least > 0 else -1 if most < 0 else 0
        size, wanted = direction * actual, min(abs(least), abs(most))
        short = 0 < size < wanted * (1 - _BEYOND) - _SHORT * unit
        if not (short and status.means(Meaning.SLOWING)):
            self._falls_from = 0.0
            return False
        self._falls_from = max(self._falls_from, size)
        return size < self._falls_from - _FALLEN * unit

    def _check_overspeed(self, value: float, at: float, most: float, unit: float) -> None:
        """Report a motor that turns faster than its set-point, and write that again."""
        size, margin = abs(value), _BEYOND_BY * unit
        if not size > most * (1 + _BEYOND) + margin:
            self._beyond, self._reported = Fall(), False
            return
        endless = self._beyond.has_ended(size, at, STEP * unit)
        if self._reported or not (endless or size > self._beyond.least + margin):
            return
        self._reported = True
        wanted, name = self._setpoint.commanded, self._state.unit
        report = self._state.report(
            Cause.FASTER_THAN_SETPOINT, now=value, setpoint=wanted, unit=name
        )
        self._state.notify(Severity.WARNING, report)
        self._setpoint.write_again()

    def _check_scale(self, value: float, at: float, unit: float) -> None:
        """Report, once, a motor that turns steadily at a multiple of its set-point."""
        if not abs(value - self._steady) <= _STEADY * unit:
            self._steady, self._steady_since = value, at
        least, most = self._setpoint.range_since(self._steady_since)
        status = self._state.status
        limited = status is not None and status.means(Meaning.CURRENT_LIMIT)
        moves = not at - self._steady_since > _STEADY_FOR or least != most
        if self._scale_reported or moves or limited or not least:
            return
        share = _multiple(abs(value / most))
        if share:
            self._scale_reported = True
            report = self._state.report(
                Cause.OTHER_SCALE, now=value, setpoint=most, unit=self._state.unit, share=share
            )
            self._state.notify(Severity.WARNING, report)


def _multiple(ratio: float) -> str:
    """Return which multiple or part a ratio is; ``''``: none that a wrong scale would make."""
    for times in _MULTIPLES:
        if abs(ratio / times - 1) < _NEARLY:
            return f'{times} times'
        if abs(ratio * times - 1) < _NEARLY:
            return f'1/{times} of'
    return ''
