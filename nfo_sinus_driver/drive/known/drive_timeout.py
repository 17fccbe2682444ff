# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The communication time-outs: by them a drive notices that the line is silent."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Family, Role, Value
from nfo_sinus_driver.drive.known.parameter_access import ParameterAccess
from nfo_sinus_driver.link import Refused


class DriveTimeout:
    """
    The communication time-outs of one drive, as far as they are known.

    :param has: whether the drive has a parameter.
    """

    def __init__(
        self, params: ParameterAccess, model: Family, has: Callable[[str], bool]
    ) -> None:
        self._params = params
        self._key = model.key(Role.COMMUNICATION_TIMEOUT)
        self._conditions = model.profile.timeout_conditions
        #: The values of those parameters; ``None``: not known.
        self._found: dict[str, Value | None] = dict.fromkeys(self._conditions)
        self._has = has
        self._is_read = False
        #: SioTot, s; 0 turns it off.
        self.seconds = 0.0
        #: After how long without a heartbeat or guarding the drive reacts, s, and which of both;
        #: 0: it does not.
        self.watched_for = 0.0
        self.watched_by = ''
        #: The longest that it may have taken since it last confirmed one, or that it has none, s.
        self.may_watch_for = 0.0

    @property
    def shortest(self) -> float:
        """The shortest silence after which the drive acts by itself, s; 0: none."""
        return min(filter(None, (self.seconds, self.watched_for)), default=0.0)

    @property
    def keys(self) -> tuple[str, ...]:
        """The parameters that it consists of, and that the drive has; the time first."""
        return tuple(key for key in (self._key, *self._conditions) if self._has(key))

    @property
    def can_be_set(self) -> bool:
        """The time-out can be read and set over this line."""
        return len(self.keys) == 1 + len(self._conditions)

    @property
    def prevented_by(self) -> Mapping[str, Value | None]:
        """The parameters by which the motor runs on, with their values; ``None``: not known."""
        return {
            key: value for key, value in self._found.items() if value not in self._conditions[key]
        }

    @property
    def stops_motor(self) -> bool:
        """When it is over the drive stops the motor, such as with AutoStop = ON [C91]."""
        return self._is_read and not self.prevented_by

    def stopping(self, key: str) -> Value:
        """Return the value of a parameter to be written so that the motor stops."""
        return self._conditions[key][0]

    async def watch(self, seconds: float) -> None:
        """
        Have the drive watch the heartbeat or guarding, with this time-out, s; 0: no longer.

        After an error the drive may go on as before, and so does what is known of it.
        """
        self.may_watch_for = max(seconds, self.may_watch_for)
        self.watched_by = await self._params.watch(seconds, Priority.SERVICE)
        self.watched_for = self.may_watch_for = seconds if self.watched_by else 0.0

    async def read(self) -> None:
        """Read SioTot, and on what it depends that the motor stops, where the drive has them."""
        if not self.can_be_set:
            return
        self.seconds = await self._params.read_number(self._key, Priority.SERVICE)
        for key in self._conditions:
            self._found[key] = await self._read(key)
        self._is_read = True

    async def _read(self, key: str) -> Value | None:
        """Return a value; a code that means none, or one that is refused, is not relied on."""
        try:
            return await self._params.read(key, Priority.SERVICE)
        except ValueError:
            return None
        except Refused as error:
            if error.is_busy:
                raise
            return None

    def take_values(self, keys: Collection[str], values: Mapping[str, Value]) -> bool:
        """
        Note new values of parameters; return whether SioTot is among them.

        :param values: of all parameters of the drive, by key.
        """
        for key in self._conditions:
            if key in keys:
                self._found[key] = values.get(key)
        if self._key in keys:
            self.seconds = float(values[self._key])
        return self._key in keys
