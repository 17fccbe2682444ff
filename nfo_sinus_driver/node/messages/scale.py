# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The unit of set-points and actual values: the drive's, or one of the user, as of a belt."""

from __future__ import annotations

from collections.abc import Callable, Mapping

#: What speeds are multiplied or divided by.
_FACTORS = ('scale', 'gear_ratio')
#: No machine has more, and no speed becomes infinite by it, or 0.
_MOST = 1e9


class Scale:
    """
    A unit of the user, such as m/s, for what the drive has in Hz or rpm.

    :param factor: how much of it one unit of the drive is, not 0; negative inverts the direction.
    :param unit: its name; empty: that of the drive.
    """

    def __init__(self, factor: Callable[[], float], unit: Callable[[], str]) -> None:
        self._factor = factor
        self._unit = unit

    @property
    def factor(self) -> float:
        """How much one unit of the drive is."""
        return self._factor()

    def of_drive(self, value: float) -> float:
        """Return a set-point of the user in the unit of the drive."""
        return value / self._factor()

    def shown(self, value: float) -> float:
        """Return a value of the drive in the unit of the user."""
        return value * self._factor()

    def unit(self, unit_of_drive: str) -> str:
        """Return the name of the unit."""
        return self._unit() or unit_of_drive


def require_factors(values: Mapping[str, object]) -> None:
    """Make sure that these settings have valid factors of speed, as far as they have them."""
    for name in _FACTORS:
        factor = values.get(name)
        if isinstance(factor, float) and not 1 / _MOST <= abs(factor) <= _MOST:
            raise ValueError(
                f'{name} {factor:g}: a factor of speed is between {1 / _MOST:g} and {_MOST:g}, or '
                'as much below 0, never 0'
            )
