# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Whether the motor is jammed: it takes much current, and hardly turns.

What is measured anyway is judged, each pair of a current and a speed once. A pair shows a jam while
the set-points of the last second have one direction and are beyond ``jam_speed``, and the motor
turns at less than that and than half of them: one that is asked to be slow is not jammed.

A motor on its ramp takes much current, too, and is slow at first. It is told apart by its speed,
which changes; that of a jammed one keeps within a range (:class:`..known.movement.Still`). How long
it has to: ``jam_time`` where the motor has been beyond ``jam_speed`` in that direction; after a
start or a turn at least as long as the slowest ramp takes to show.

Three pairs in a row tell it at least. A pair without a number is a break, and so is a pause between
two that is longer than a full line makes.
"""

from __future__ import annotations

import math

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive.known.diagnosis import AGAIN_AFTER
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.movement import FALLS_WITHIN, STEP, Still
from nfo_sinus_driver.drive.known.snapshot import Measured
from nfo_sinus_driver.drive.motion.following import COMPARED, REACTION
from nfo_sinus_driver.drive.motion.setpoint import Setpoint
from nfo_sinus_driver.link import NoData, Refused

#: How much slower than its set-point a jammed motor is at least: this share of it.
_FAR_BELOW = 0.5
#: How many pairs in a row tell a jam: one or two impossible values stop no motor.
_PAIRS = 3
#: The longest pause between two pairs, s; or ``jam_time``, if that is longer.
_PAUSE = 5.0
#: For how long nothing could be judged when that is reported, s; and that many times ``jam_time``.
_UNSEEN_FOR, _UNSEEN_TIMES = 10.0, 2


class JamCheck:
    """
    Judges one motor while it is enabled.

    :ivar jammed: what it takes, and how slow it is, while it is jammed.
    """

    def __init__(self, state: DriveState, setpoint: Setpoint) -> None:
        self._state = state
        self._setpoint = setpoint
        #: How long the drive brakes its motor before it starts, s.
        self._braking = 0.0
        #: When it was jammed last, s of the clock of the bus.
        self._jammed_at = -math.inf
        self.jammed: Report | None = None
        self.begin()

    async def prepare(self) -> None:
        """Read what is needed to judge a start (LinkError: the drive does not tell it)."""
        is_on = self._state.settings.jam_current > 0
        self._braking = await self._state.read_start_braking() if is_on else 0.0

    async def require_measured(self) -> None:
        """
        Make sure that the drive tells its current, where that is needed.

        :raises DriveError: it does not.
        :raises LinkError: it does not answer.
        """
        if not self._state.settings.jam_current:
            return
        key = self._state.model.key(Role.OUTPUT_CURRENT)
        try:
            await self._state.params.read_data(key, Priority.SERVICE)
        except (Refused, NoData) as error:
            raise DriveError(Cause.JAM_NOT_MEASURED, why=str(error)) from error

    def begin(self) -> None:
        """Begin again: the motor was enabled just now."""
        now = self._state.bus.now()
        #: The drive may brake the motor until then.
        self._from = now + self._braking
        #: The newest pair, and when the older one of both values came.
        self._current, self._speed = Measured(at=now), Measured(at=now)
        self._at = now
        self._reported = False
        self.rest()

    def rest(self) -> None:
        """Begin anew: the motor is stopped, turns round, or is to be slow."""
        #: It was beyond ``jam_speed`` in its direction.
        self._passed = False
        #: When something could be judged last, s.
        self._seen_at = self._state.bus.now()
        self._break()

    def _break(self) -> None:
        """Note that it is not jammed."""
        self._still = Still()
        self._since, self._pairs = math.inf, 0
        self.jammed = None

    def check(self) -> Report | None:
        """Return why the newest pair has to stop the motor; report a jam that has not to."""
        if not self._state.settings.jam_current:
            self.rest()
            return None
        if self._setpoint.control_mode not in COMPARED:
            self._report_once(Report(Cause.JAM_NOT_JUDGED, mode=self._setpoint.control_mode))
            return None
        now = self._state.bus.now()
        least, most = self._setpoint.range_since(now - REACTION)
        jam_speed = self._state.settings.jam_speed
        direction = 1 if least > jam_speed else -1 if most < -jam_speed else 0
        if now < self._from or not direction:
            # on its way from one direction to the other it has set-points of both for a moment
            self.rest()
            return None
        if not self._take_pair():
            self._check_unseen(now)
            return None
        if direction * self._speed.value >= jam_speed:
            self._passed = True
        return self._judge(min(jam_speed, _FAR_BELOW * min(abs(least), abs(most))))

    def _take_pair(self) -> bool:
        """Return whether there is another pair; one that comes too late is a break."""
        role, _ = COMPARED[self._setpoint.control_mode]
        measurements = self._state.measurements
        current, speed = measurements.last(Role.OUTPUT_CURRENT), measurements.last(role)
        if not (current.at > self._current.at and speed.at > self._speed.at):
            return False
        self._current, self._speed = current, speed
        before, self._at = self._at, min(current.at, speed.at)
        if self._at - before > max(_PAUSE, self._state.settings.jam_time):
            self._break()
        elif not math.isnan(current.value + speed.value):
            self._seen_at = self._at
        return True

    def _judge(self, slowest: float) -> Report | None:
        """
        Return why this pair has to stop the motor.

        :param slowest: a motor that turns at this speed at least is not jammed.
        """
        settings = self._state.settings
        current, size = self._current.value, abs(self._speed.value)
        if not (current > settings.jam_current and size < slowest):
            self._break()
            return None
        self._since, self._pairs = min(self._since, self._at), self._pairs + 1
        _, unit = COMPARED[self._setpoint.control_mode]
        still_since = self._still.note(size, self._at, STEP * unit)
        needed = settings.jam_time if self._passed else max(settings.jam_time, FALLS_WITHIN)
        if self._at - still_since < needed or self._pairs < _PAIRS:
            return None
        report = Report(
            Cause.JAMMED,
            current=current,
            speed=size,
            unit=self._state.unit,
            seconds=self._at - self._since,
            jam_current=settings.jam_current,
            jam_speed=settings.jam_speed,
        )
        if settings.on_jam == 'stop':
            return report
        self.jammed = report
        if self._at - self._jammed_at > AGAIN_AFTER:
            self._state.notify(Severity.WARNING, Cause.JAM_SEEN, why=report)
        self._jammed_at = self._at
        return None

    def _check_unseen(self, now: float) -> None:
        """Report that nothing can be judged, where that lasts."""
        seconds = now - self._seen_at
        if seconds > max(_UNSEEN_FOR, _UNSEEN_TIMES * self._state.settings.jam_time):
            self._report_once(Report(Cause.JAM_UNSEEN, seconds=seconds))

    def _report_once(self, report: Report) -> None:
        if not self._reported:
            self._reported = True
            self._state.notify(Severity.WARNING, report)
