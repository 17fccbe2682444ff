# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Which way a motor turns whose drive measures sizes without a sign, and reports no direction."""

from __future__ import annotations

import math

from nfo_sinus_driver.drive.known.snapshot import NAN

#: Below this frequency, Hz, a motor has no direction.
_STANDSTILL = 0.5
#: A motor that is on its way to the other direction becomes slower, by more than it fluctuates, Hz,
#: each so many s; one that becomes faster by so much, Hz, has turned.
_FALL, _WITHIN, _RISE = 0.1, 1.0, 0.5


class Direction:
    """The direction of one motor, as commanded."""

    def __init__(self) -> None:
        #: The set-point that the drive has, in any unit; NaN: the driver commands none.
        self._commanded = NAN
        self._way = NAN
        #: Of a motor whose direction is to change: its least frequency, and since when.
        self._least = (math.inf, math.inf)

    @property
    def known(self) -> bool:
        """A motor that turns does so by a command of the driver."""
        return not math.isnan(self._way)

    def command(self, setpoint: float) -> None:
        """Note the set-point that the drive has, in any unit; NaN: the driver commands none."""
        self._commanded = setpoint

    def take(self, size: float, now: float) -> None:
        """Take what was measured, Hz, and when, s of the clock of the bus."""
        # set-point 0 is in no direction: the motor stops in that which it has
        wanted = math.copysign(1.0, self._commanded) if abs(self._commanded) > 0 else NAN
        least, since = self._least
        if size < _STANDSTILL or not self.known:
            self._turns(wanted)
        elif math.isnan(wanted) or wanted == self._way:
            self._least = math.inf, math.inf
        elif size < least - _FALL:
            self._least = size, now
        elif size > least + _RISE or now - since > _WITHIN:
            self._turns(wanted)

    def _turns(self, way: float) -> None:
        self._way, self._least = way, (math.inf, math.inf)

    def of(self, size: float) -> float:
        """Return a size with the sign of its direction; where that is not known, as it is."""
        return size * self._way if self.known and size else size
