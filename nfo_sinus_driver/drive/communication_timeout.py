# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a drive does by itself when it hears nothing for a while."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Family, Role, Value
from nfo_sinus_driver.drive.parameter_access import ParameterAccess


class CommunicationTimeout:
    """
    The time-outs by which one drive notices silence on the line, as far as they are known.

    :param has: tells whether the drive has a parameter.
    """

    def __init__(
        self, params: ParameterAccess, model: Family, has: Callable[[str], bool]
    ) -> None:
        self._params = params
        self._seconds_key = model.key(Role.COMMUNICATION_TIMEOUT)
        self._stop_key = model.key(Role.STOP_AT_TIMEOUT)
        self._stops = model.profile.stops_at_timeout
        self._has = has
        #: SioTot, s; 0 turns it off.
        self.seconds = 0.0
        #: AutoStop: without it the motor runs on when SioTot has passed [C91].
        self.stops_motor = False
        #: How long the drive may hear nothing of what lives on the line, s, and by what it notices;
        #: 0: it does not.
        self.watched_for = 0.0
        self.watched_by = ''

    @property
    def shortest(self) -> float:
        """After which silence the drive does something by itself, s; 0: after none."""
        return min(filter(None, (self.seconds, self.watched_for)), default=0.0)

    @property
    def can_be_set(self) -> bool:
        """There is one that can be read and set over this line."""
        return self._has(self._seconds_key) and (not self._stop_key or self._has(self._stop_key))

    async def watch(self, seconds: float) -> None:
        """
        Have the drive notice a silence of so long, s, by what lives on the line; 0: no more.

        Where that fails the drive may go on to watch as before, and that is what is known of it.
        """
        self.watched_by = await self._params.watch(seconds, Priority.SERVICE)
        self.watched_for = seconds if self.watched_by else 0.0

    async def read(self) -> None:
        """Read SioTot and AutoStop, where the drive has them."""
        if not self.can_be_set:
            return
        self.seconds = await self._params.read_number(self._seconds_key, Priority.SERVICE)
        if not self._stop_key:
            # where nothing can keep it from that, it stops the motor
            self.stops_motor = True
            return
        data = await self._params.read_data(self._stop_key, Priority.SERVICE)
        # a code that means neither ON nor OFF is not relied upon
        self.stops_motor = data == self._params.encode(self._stop_key, self._stops)

    def take(self, keys: Collection[str], values: Mapping[str, Value]) -> bool:
        """
        Take note of parameters that have new values; tell whether SioTot is among them.

        :param values: of all parameters of the drive, by key.
        """
        if self._seconds_key in keys:
            self.seconds = float(values[self._seconds_key])
        if self._stop_key in keys:
            self.stops_motor = values.get(self._stop_key) == self._stops
        return self._seconds_key in keys
