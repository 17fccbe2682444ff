# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What was measured of one drive: how fast its motor turns, and which way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import math
from typing import Protocol

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Fact, Family, InverterStatus, Role
from nfo_sinus_driver.catalog.status import FREQUENCY, SPEED
from nfo_sinus_driver.drive.known.events import Cause, Severity
from nfo_sinus_driver.drive.known.movement import Direction
from nfo_sinus_driver.drive.known.parameter_access import ParameterAccess
from nfo_sinus_driver.drive.known.snapshot import NOT_MEASURED, Measured


class _Notify(Protocol):
    """Reports to the listener of the drive."""

    def __call__(self, severity: Severity, what: Cause, /, **values: object) -> None:
        """Report a cause with its values."""


class Measurements:
    """The measured values of one drive; read on the bus alone, the last ones from anywhere."""

    def __init__(
        self, params: ParameterAccess, model: Family, now: Callable[[], float], notify: _Notify
    ) -> None:
        self._params = params
        self._model = model
        self._now = now
        self._notify = notify
        only_speed = FREQUENCY.role not in model.roles and SPEED.role in model.roles
        #: What shows how fast the motor turns.
        self.turning = SPEED if only_speed else FREQUENCY
        #: Which way the motor turns, where the drive does not report that.
        self.direction = Direction()
        #: What was measured beside the telemetry, by key.
        self.beside: Mapping[str, float] = {}
        #: Those that were reported as impossible.
        self._reported_impossible: set[str] = set()
        #: What was polled last.
        self._polled: dict[Role, Measured] = {}

    async def measure(
        self,
        key: str,
        priority: Priority,
        status: InverterStatus | None,
        *,
        retry: bool = False,
    ) -> float:
        """
        Read a measured value; NaN if there is none, or if it stays impossible.

        :param key: of its parameter; ``''``: there is none.
        :param status: gives the direction of a speed that has no sign.
        :raises LinkError: it does not answer, or refuses.
        """
        if not key:
            return math.nan
        data = await self._params.read_data(key, priority, retry=retry)
        value = self._params.number(key, data)
        if await self.is_cut_off(key, value, priority, retry=retry):
            return math.nan
        if not self._params.is_odd(key):
            return self._signed(self._model.role_of.get(key), value, status)
        if key not in self._reported_impossible:
            self._reported_impossible.add(key)
            unit = self._model[key].unit
            shown = f'{value:g} {unit}'.rstrip()
            self._notify(Severity.WARNING, Cause.IMPOSSIBLE_VALUE, key=key, value=shown)
        return math.nan

    async def is_cut_off(
        self, key: str, value: float, priority: Priority, *, retry: bool
    ) -> bool:
        """
        Return whether a value says nothing, for 16 bits do not hold what it may be.

        Beyond them it stays at their end, or comes back with the other sign.
        """
        if key not in self._model.profile.narrow or not self._params.has_one_word(key):
            return False
        _, high, _ = self._params.limits(key)
        if 0 <= value < high:
            return False
        bound, times = self._model.profile.narrow[key]
        if not bound or value >= high:
            return True
        most = times * await self._params.read_number(bound, priority, retry=retry)
        return not -value <= most < high

    def _signed(self, role: Role | None, value: float, status: InverterStatus | None) -> float:
        """Return a measured value with the sign that the drive reports, or that is commanded."""
        word = self._model.profile.status_word
        if role not in word.sizes:
            return value
        if Fact.REVERSE in word.valid:
            # standstill has no direction
            return 0.0 - value if status is not None and Fact.REVERSE in status.facts else value
        if role is self.turning.role:
            self.direction.take_size(value * self.turning.hertz, self._now())
        return self.direction.of(value)

    def shown(self, role: Role | None, value: float) -> float:
        """Return what is published of a measured value; NaN where its direction is not known."""
        word = self._model.profile.status_word
        known = role not in word.sizes or Fact.REVERSE in word.valid or self.direction.known
        return value if known or value == 0 else math.nan

    def take_value(self, role: Role, value: float) -> None:
        """Note what a poll has just measured."""
        self._polled[role] = Measured(value, self._now())

    def note_beside(self, values: Mapping[str, float]) -> None:
        """Note what was measured beside the telemetry, by key."""
        self.beside = values

    def forget(self) -> None:
        """Forget what was polled: another drive may be there now."""
        self._polled.clear()
        self.beside = {}

    def last(self, role: Role | None) -> Measured:
        """Return what a poll has measured last; the speed may follow from the frequency."""
        pole_pairs = self._model.profile.pole_pairs
        if role is Role.ACTUAL_SPEED and pole_pairs and role not in self._model.roles:
            frequency, at = self.last(Role.ACTUAL_FREQUENCY)
            return Measured(60 * frequency / pole_pairs, at)
        return NOT_MEASURED if role is None else self._polled.get(role, NOT_MEASURED)

    @property
    def turned(self) -> Measured:
        """How fast the motor turns, as a poll has measured it last, Hz."""
        value, at = self.last(self.turning.role)
        return Measured(value * self.turning.hertz, at)

    @property
    def frequency(self) -> float:
        """The frequency as last polled, Hz."""
        return self.last(Role.ACTUAL_FREQUENCY).value

    @property
    def speed(self) -> float:
        """The speed as last polled, rpm."""
        return self.last(Role.ACTUAL_SPEED).value
