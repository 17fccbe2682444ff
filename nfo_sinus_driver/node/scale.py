# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The unit of set-points and actual values: the drive's, or one of the user, as of a belt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import math


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


def require_scale(values: Mapping[str, object]) -> None:
    """Make sure that these settings have a valid scale, if they have one."""
    factor = values.get('scale')
    if isinstance(factor, float) and (factor == 0 or not math.isfinite(factor)):
        raise ValueError(
            f'scale {factor:g}: how much of the unit 1 Hz (1 rpm, 1 %) of the drive is, never 0'
        )
