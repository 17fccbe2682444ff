# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Counts what one drive does, from its statuses and measured values; without I/O and clock."""

from __future__ import annotations

from collections.abc import Callable
import math

from nfo_sinus_driver.catalog import InverterStatus, Kind, Role
from nfo_sinus_driver.catalog.status import Meaning
from nfo_sinus_driver.drive import Report, Snapshot, StopReason, Telemetry
from nfo_sinus_driver.operating_record.figures import MJ_OF_KWH, Figures, Record

#: A longer time between two statuses, or two powers, s, is a pause of the driver: what the drive
#: did meanwhile is not known.
_LONGEST_GAP = 120.0
#: What turns slower may as well stand, Hz and rpm: noise has both signs.
_LEAST_FREQUENCY, _LEAST_SPEED = 0.1, 3.0
#: For how long the name of a fault may be read, s; behind a PLC, it never is.
_LONGEST_NAMING = 5.0
#: In this order: a counter that can be reset is the worse one.
_COUNTERS = (Role.TOTAL_ENERGY, Role.ENERGY)
_HIGHEST = (
    (Role.MOTOR_TEMPERATURE, 'motor_temperature'),
    (Role.PT1000_TEMPERATURE, 'pt1000_temperature'),
    (Role.ACTUAL_TORQUE, 'torque'),
    (Role.OUTPUT_CURRENT, 'output_current'),
)
#: Their size counts; a temperature has a sign.
_SIZES = frozenset((Role.ACTUAL_TORQUE, Role.OUTPUT_CURRENT))


class Counting:
    """
    Counts into a record; all moments are of one steady clock, s.

    :param wall: returns the wall time of such a moment, s since 1970.
    :param stop: the newest report of a stop of the drive that was connected before.
    :ivar stop: the newest report of a stop.
    """

    def __init__(
        self, record: Record, wall: Callable[[float], float], stop: Report | None = None
    ) -> None:
        self.record = record
        self._wall = wall
        #: When the last status came; NaN: the drive is not connected.
        self._at = math.nan
        self._running = False
        #: The motor runs, and no stop of that run was counted.
        self._open = False
        self.stop = stop
        #: In which direction the motor turned last; 0: not known.
        self._direction = 0
        #: A fault that may get another name: code, text, and when it came.
        self._unnamed: tuple[int, str, float] | None = None
        #: The last power, W, and when it was measured.
        self._power = math.nan, math.nan
        #: What the driver had counted of the line.
        self._line_errors = 0
        #: A request was in vain since the last status.
        self._missed = False

    @property
    def _both(self) -> tuple[Figures, Figures]:
        return self.record.total, self.record.shift

    def take_status(self, snapshot: Snapshot) -> None:
        """Count what a status shows, or that there is none."""
        status, at = snapshot.status, snapshot.at
        if status is None or not snapshot.connected:
            self._disconnect(snapshot)
            return
        connects = math.isnan(self._at)
        if not connects and at > self._at:
            self._pass_time(at - self._at)
            self._take_silence(at - self._at)
        # a status that is published again has the moment of the first time
        if connects or at > self._at:
            self._at = at
        runs = status.driven and not status.unknown
        if runs is not self._running or snapshot.stop is not self.stop or connects:
            self._take_run(runs, snapshot, connects=connects)
        if runs:
            self._take_direction(snapshot)
        if snapshot.kind is Kind.FAULT or self.record.fault is not None:
            self._take_fault(snapshot, status)

    def _pass_time(self, seconds: float) -> None:
        if seconds > _LONGEST_GAP:
            return
        passed = round(seconds * 1e9)
        for figures in self._both:
            figures.powered += passed
            if self._running:
                figures.running += passed

    def _disconnect(self, snapshot: Snapshot) -> None:
        """Count a loss; what the drive does from now on is not known."""
        self._take_silence(snapshot.at - self._at)
        if snapshot.stop is not self.stop:
            self._take_stop(snapshot)
        self._name_fault()
        self._at, self._running, self._open = math.nan, False, False
        self._power = math.nan, math.nan

    def _take_silence(self, seconds: float) -> None:
        """Keep a time without a status, if a request was in vain meanwhile."""
        if self._missed and 0 < seconds <= _LONGEST_GAP:
            for figures in self._both:
                figures.longest_silence = max(figures.longest_silence, seconds)
        self._missed = False

    def _take_run(self, runs: bool, snapshot: Snapshot, *, connects: bool) -> None:
        """Count a start and a stop; each stop once, by the first reason for it."""
        begins = runs and (not self._running or snapshot.stop is None)
        if connects:
            # of one that was lost the stop is counted; one that was found running may stand by now
            self._open = self.stop is None if snapshot.stop is not None else runs
        elif begins and not self._open:
            # it may be on its ramp to a stop yet
            self._open = True
            for figures in self._both:
                figures.starts += 1
        if snapshot.stop is not self.stop:
            self._take_stop(snapshot)
        if not runs and self._open:
            self._count_stop(StopReason.NONE)
        self._running = runs

    def _take_stop(self, snapshot: Snapshot) -> None:
        self.stop = snapshot.stop
        if self.stop is not None and self._open:
            self._count_stop(snapshot.stop_reason)

    def _count_stop(self, reason: StopReason) -> None:
        self._open = False
        for figures in self._both:
            figures.stops[reason.name] += 1

    def _take_direction(self, snapshot: Snapshot) -> None:
        value, least = snapshot.frequency, _LEAST_FREQUENCY
        if math.isnan(value):
            value, least = snapshot.speed, _LEAST_SPEED
        if not abs(value) > least:
            return
        direction = 1 if value > 0 else -1
        if direction == -self._direction:
            for figures in self._both:
                figures.reversals += 1
        self._direction = direction

    def _take_fault(self, snapshot: Snapshot, status: InverterStatus) -> None:
        """Count a fault that has come, by its name as soon as that is read."""
        if snapshot.kind is not Kind.FAULT:
            self._name_fault()
            self.record.fault = None
            return
        before = self.record.fault
        if status.code == before:
            return
        if before is not None and Meaning.UNNAMED in status.model.status_code(before).meanings:
            # its name comes late: it is counted already
            self.record.fault = status.code
            return
        came_at = self._unnamed[-1] if self._unnamed else status.at
        self._unnamed = status.code, snapshot.text, came_at
        if not status.means(Meaning.UNNAMED) or snapshot.at > came_at + _LONGEST_NAMING:
            self._name_fault()

    def _name_fault(self) -> None:
        """Count a fault by what is known of its name."""
        if self._unnamed is None:
            return
        (code, text, at), self._unnamed = self._unnamed, None
        self.record.fault = code
        for figures in self._both:
            figures.add_fault(code, text, self._wall(at))

    def take_telemetry(self, telemetry: Telemetry) -> None:
        """Count energy, and keep the highest values."""
        values = telemetry.values
        for role, name in _HIGHEST:
            value = values.get(role, math.nan)
            if not math.isnan(value):
                value = abs(value) if role in _SIZES else value
                for figures in self._both:
                    figures.see(name, value)
        self._take_counters(telemetry)
        power = values.get(Role.OUTPUT_POWER, math.nan)
        if not self.record.counters:
            self._take_power(power, telemetry.at)

    def _take_counters(self, telemetry: Telemetry) -> None:
        """Count what the drive has counted since the last reading, also while it was alone."""
        counters = self.record.counters
        for role in _COUNTERS:
            kwh = telemetry.values.get(role, math.nan)
            if math.isnan(kwh):
                continue
            before = counters.get(role.value)
            counters[role.value] = kwh
            if role is Role.ENERGY and Role.TOTAL_ENERGY.value in counters:
                continue
            # one that was reset says nothing of what was before
            self._add_energy(0.0 if before is None else max(0.0, kwh - before) * MJ_OF_KWH)

    def _take_power(self, watts: float, at: float) -> None:
        """Count the energy to a motor; what it gives back while it brakes is not counted."""
        (before, before_at), self._power = self._power, (max(0.0, watts), at)
        if math.isnan(watts):
            self._power = math.nan, math.nan
            return
        seconds = at - before_at
        known = 0 < seconds <= _LONGEST_GAP
        self._add_energy((before + self._power[0]) / 2 * seconds * 1e3 if known else 0.0)

    def _add_energy(self, millijoules: float) -> None:
        for figures in self._both:
            figures.add_energy(round(millijoules))

    def take_line_errors(self, count: int) -> None:
        """
        Count the errors of the line while the drive is connected, before the status after them.

        :param count: what the driver has counted so far; a drive without power answers nothing.
        """
        new, self._line_errors = count - self._line_errors, count
        if new > 0 and not math.isnan(self._at):
            self._missed = True
            for figures in self._both:
                figures.line_errors += new

    def continue_from(self, kept: Record) -> None:
        """Go on with a record that was kept before this one began."""
        self.record = kept.followed_by(self.record)
