# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Factors of a drive that differ from its family's tables, by firmware or by its own scale."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive.known.parameter_access import ParameterAccess
from nfo_sinus_driver.link import Refused

_ONE = Fraction(1)
_OF_SPEED = (Role.SPEED_SCALE_NUMERATOR, Role.SPEED_SCALE_DENOMINATOR)
#: The factory's scales of frequency, torque and process values, which the tables have [C16].
FACTORY = {
    Role.ACTUAL_FREQUENCY: Fraction(1, 10),
    Role.ACTUAL_TORQUE: _ONE,
    Role.ACTUAL_PROCESS_VALUE: Fraction(1, 10),
}


class Scales:
    """
    The scales of one drive; for the bus.

    :param has: whether the drive has a parameter.
    :param chosen: the value of one count, of the scales that cannot be read, by role.
    :param unused: what else multiplies set-points, and has to be 1 before each start.
    :ivar found: what the parameters were that scale others, when they were last read, by key.
    """

    def __init__(
        self,
        params: ParameterAccess,
        has: Callable[[str], bool],
        chosen: Mapping[Role, float],
        unused: Sequence[str] = (),
    ) -> None:
        self._params = params
        self._has = has
        self._chosen = {
            role: Fraction(str(value)) / FACTORY[role] for role, value in chosen.items()
        }
        self._dialect: Mapping[str, Fraction] = {}
        model = params.model
        #: Parameters by whose value others are multiplied.
        scales = {parameter.scale for parameter in model.values()}
        self._named = frozenset(scale for scale in scales if scale in model)
        self._of_speed = tuple(filter(None, map(model.key, _OF_SPEED)))
        self._unused = tuple(unused)
        self.found: Mapping[str, float] = {}
        self._apply()

    def use_dialect(self, factors: Mapping[str, Fraction]) -> None:
        """Take the factors of the firmware that the drive has, by key."""
        self._dialect = factors
        self._apply()

    async def read(self) -> bool:
        """
        Read the scale of speeds, 1 where the drive has none; return whether it has changed.

        :raises LinkError: the drive does not answer.
        """
        before = self.speed
        found = {}
        for key in self.keys:
            try:
                found[key] = await self._params.read_number(key, Priority.SERVICE)
            except Refused:
                if key in self._named:
                    raise
        self.found = found
        self._apply()
        return self.speed != before

    async def read_one(self, key: str, priority: Priority) -> float:
        """Read one of the :attr:`keys` anew, without retries, take it, and return it."""
        value = await self._params.read_number(key, priority, retry=False)
        if value != self.found.get(key):
            self.found = {**self.found, key: value}
            self._apply()
        return value

    @property
    def keys(self) -> tuple[str, ...]:
        """The parameters that scale others, as far as this drive has them."""
        return (*filter(self._has, (*self._of_speed, *self._unused)), *sorted(self._named))

    def of(self, key: str) -> tuple[str, ...]:
        """Return those of the :attr:`keys` that scale a set-point."""
        model = self._params.model
        scale, speed = model[key].scale, model.key(Role.ACTUAL_SPEED)
        by_speed = speed and scale == model[speed].scale
        scaling = {scale, *self._unused, *(self._of_speed if by_speed else ())}
        return tuple(key for key in self.keys if key in scaling)

    @property
    def speed(self) -> Fraction:
        """The factor of speeds on the bus [M0 §8.3.2]; an impossible one is none [C114]."""
        numbers = [int(self.found.get(key, 0)) for key in self._of_speed]
        return Fraction(*numbers) if numbers and min(numbers) > 0 else _ONE

    @property
    def impossible(self) -> str:
        """A parameter that is not above 0 and scales others, which mean nothing then, or ``''``."""
        return next((key for key in self._named if not self.found.get(key, 1.0) > 0), '')

    def _apply(self) -> None:
        model = self._params.model
        scales: dict[str, Fraction] = {}
        for role, factor in {**self._chosen, Role.ACTUAL_SPEED: self.speed}.items():
            key = model.key(role)
            if key and model[key].scale:
                scales[model[key].scale] = factor
        # what the drive itself has comes first; by a scale of 0 not even a stop could be written
        own = {key: self.found.get(key, 0.0) for key in self._named}
        scales |= {key: Fraction(str(value)) for key, value in own.items() if value > 0}
        found = {
            parameter.key: scales[parameter.scale] * self._dialect.get(parameter.key, _ONE)
            for parameter in model.values()
            if parameter.scale in scales
        }
        self._params.rescale({**self._dialect, **found})
