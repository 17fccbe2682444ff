# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The time-outs by which a drive notices that the line is silent."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Family, Role, Value
from nfo_sinus_driver.drive.parameter_access import ParameterAccess


class CommunicationTimeout:
    """
    The communication time-outs of one drive, as far as they are known.

    :param has: whether the drive has a parameter.
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
        #: After how long without a heartbeat or guarding the drive reacts, s, and which of both;
        #: 0: it does not.
        self.watched_for = 0.0
        self.watched_by = ''

    @property
    def shortest(self) -> float:
        """The shortest silence after which the drive acts by itself, s; 0: none."""
        return min(filter(None, (self.seconds, self.watched_for)), default=0.0)

    @property
    def can_be_set(self) -> bool:
        """The time-out can be read and set over this line."""
        return self._has(self._seconds_key) and (not self._stop_key or self._has(self._stop_key))

    async def watch(self, seconds: float) -> None:
        """
        Have the drive watch the heartbeat or guarding, with this time-out, s; 0: no longer.

        After an error the drive may go on as before, and so does what is known of it.
        """
        self.watched_by = await self._params.watch(seconds, Priority.SERVICE)
        self.watched_for = seconds if self.watched_by else 0.0

    async def read(self) -> None:
        """Read SioTot and AutoStop, where the drive has them."""
        if not self.can_be_set:
            return
        self.seconds = await self._params.read_number(self._seconds_key, Priority.SERVICE)
        if not self._stop_key:
            # where no parameter can change that, it stops the motor
            self.stops_motor = True
            return
        data = await self._params.read_data(self._stop_key, Priority.SERVICE)
        # a code that means neither ON nor OFF is not relied on
        self.stops_motor = data == self._params.encode(self._stop_key, self._stops)

    def take(self, keys: Collection[str], values: Mapping[str, Value]) -> bool:
        """
        Note new values of parameters; return whether SioTot is among them.

        :param values: of all parameters of the drive, by key.
        """
        if self._seconds_key in keys:
            self.seconds = float(values[self._seconds_key])
        if self._stop_key in keys:
            self.stops_motor = values.get(self._stop_key) == self._stops
        return self._seconds_key in keys
