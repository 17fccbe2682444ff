# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Factors of a drive that differ from its family's tables, by firmware or by its own scale."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive.parameter_access import ParameterAccess
from nfo_sinus_driver.link import Refused

_ONE = Fraction(1)
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
    :ivar speed: the factor of speeds on the bus [M0 §8.3.2].
    """

    def __init__(
        self,
        params: ParameterAccess,
        has: Callable[[str], bool],
        chosen: Mapping[Role, float],
    ) -> None:
        self._params = params
        self._has = has
        self._chosen = {
            role: Fraction(str(value)) / FACTORY[role] for role, value in chosen.items()
        }
        self._dialect: Mapping[str, Fraction] = {}
        #: Parameters by whose value others are multiplied, and those values.
        model = params.model
        self._named = frozenset(one.scale for one in model.values() if one.scale in model)
        self._own: Mapping[str, Fraction] = {}
        self.speed = _ONE
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
        before, self.speed = self.speed, await self._read_speed()
        self._own = {key: await self._read_own(key) for key in self._named}
        self._apply()
        return self.speed != before

    async def _read_speed(self) -> Fraction:
        model = self._params.model
        roles = (Role.SPEED_SCALE_NUMERATOR, Role.SPEED_SCALE_DENOMINATOR)
        keys = [model.key(role) for role in roles]
        if not all(map(self._has, keys)):
            return _ONE
        try:
            above, below = [
                int(await self._params.read_number(key, Priority.SERVICE)) for key in keys
            ]
        except Refused:
            return _ONE
        # an impossible scale is none [C114]
        return Fraction(above, below) if above > 0 and below > 0 else _ONE

    async def _read_own(self, key: str) -> Fraction:
        return Fraction(str(await self._params.read_number(key, Priority.SERVICE)))

    def _apply(self) -> None:
        model = self._params.model
        scales: dict[str, Fraction] = {}
        for role, factor in {**self._chosen, Role.ACTUAL_SPEED: self.speed}.items():
            key = model.key(role)
            if key and model[key].scale:
                scales[model[key].scale] = factor
        # what the drive itself has comes first
        scales |= self._own
        found = {
            parameter.key: scales[parameter.scale] * self._dialect.get(parameter.key, _ONE)
            for parameter in model.values()
            if parameter.scale in scales
        }
        self._params.rescale({**self._dialect, **found})
