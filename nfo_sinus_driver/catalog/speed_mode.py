# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a telegram is in Speed mode that has one place for frequencies and speeds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class SpeedMode:
    """
    What the parameters that are frequencies are in Speed mode, where the same have both.

    :ivar keys: those parameters; the last one takes the set-point.
    :ivar count: gives what one count of them is, rpm, for a nominal speed of the motor, rpm.
    :ivar most: gives the greatest set-point, rpm, likewise.
    """

    keys: tuple[str, ...]
    count: Callable[[Fraction], Fraction]
    most: Callable[[float], float]
