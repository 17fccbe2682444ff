# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Who a drive says it is."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
import functools
import math


@dataclass(frozen=True)
class Identity:
    """
    Who answers; ``''`` is what it does not tell.

    :ivar firmware: SWVer, such as 4.38 [M0 §8.1]; NaN if it does not tell.
    :ivar motor_firmware: NFOVer, such as 4018.
    :ivar vendor: who made it.
    :ivar model: its product name and size, such as ``NFO Sinus 1.50/400`` [M0 §6.2.4].
    :ivar serial: its serial number.
    """

    firmware: float = math.nan
    motor_firmware: int = 0
    vendor: str = ''
    model: str = ''
    serial: str = ''

    @functools.cached_property
    def version(self) -> Fraction | None:
        """The firmware as a number that can be compared exactly; ``None`` if it does not tell."""
        return None if math.isnan(self.firmware) else Fraction(self.firmware)

    @property
    def versions(self) -> str:
        """Both firmwares, such as ``4.38 / 4018``."""
        if math.isnan(self.firmware):
            return ''
        return f'{self.firmware:.2f} / {self.motor_firmware}'

    def __str__(self) -> str:
        told = {'': self.model, 'firmware ': self.versions, 'serial ': self.serial}
        return ', '.join(f'{name}{value}' for name, value in told.items() if value)
