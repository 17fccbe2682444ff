# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Which fault or alarm a drive has whose status word only says that there is one."""

from __future__ import annotations

import math

from nfo_sinus_driver.bus import Priority, Task
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import DriveError
from nfo_sinus_driver.link import LinkError

#: How often to check whether there is one without a name, s.
_WAIT = 0.1
#: How often its name is read until it is known, and then, for another may have come, s.
_RETRY_PERIOD = 0.5
_PERIOD = 2.0


class FaultNamer:
    """
    Reads the name of a fault or an alarm, beside the polls; used on the bus alone.

    A stop does not wait for it: a fault without a name stops the motor, too.
    """

    def __init__(self, state: DriveState) -> None:
        self._state = state
        self._task: Task | None = None

    def begin(self) -> None:
        """Name what comes from now on, where the model has a parameter for that."""
        if self._state.model.key(Role.FAULT_CODE):
            self._task = self._state.bus.spawn(self._name_repeatedly())

    def end(self) -> None:
        """Stop reading names."""
        self._state.bus.cancel(self._task)

    async def _name_repeatedly(self) -> None:
        state, read_at = self._state, -math.inf
        while True:
            now = state.bus.now()
            if not state.reader.unresolved_code:
                read_at = -math.inf
            elif now - read_at > (_PERIOD if state.reader.fault_resolved else _RETRY_PERIOD):
                read_at = now
                await self._name(state.reader.unresolved_code)
            await state.bus.sleep(_WAIT)

    async def _name(self, unresolved: int) -> None:
        state = self._state
        if not state.params.reaches(state.model.key(Role.FAULT_CODE)):
            return
        try:
            code = await state.reader.read_fault_code(Priority.POLL)
        except (LinkError, DriveError):
            # the poll reports it if the drive is lost, or has to be recognised anew
            return
        if state.reader.unresolved_code == unresolved:
            state.reader.resolve_fault(unresolved, code)
