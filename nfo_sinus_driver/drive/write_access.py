# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Control of a drive for as long as its settings are written, where the drive wants that [C100]."""

from __future__ import annotations

from collections.abc import AsyncIterator
from collections.abc import Awaitable
from collections.abc import Callable
import contextlib

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.drive.controller import ExclusiveAccess
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.procedure import Procedures

#: Awaited before each write of a setting; raises DriveError if the drive would not take it.
Allow = Callable[[], Awaitable[None]]

_WHAT = 'changing settings'


class WriteAccess:
    """
    Has one drive take settings; used on the bus alone.

    Firmware of the v5.0 dialect takes them only while the bus has control. Where nobody has it, it
    is taken while the motor stands, with no run command and set-point 0, and given back. Everything
    else takes settings at any time.
    """

    def __init__(self, inverter: DriveState, procedures: Procedures) -> None:
        self._inverter = inverter
        self._procedures = procedures

    @contextlib.asynccontextmanager
    async def granted(self) -> AsyncIterator[Allow]:
        """
        Give control back at the end, if what this yields had to take it.

        :raises DriveError: the drive does not confirm that it is given back.
        """
        async with contextlib.AsyncExitStack() as stack:
            access = ExclusiveAccess(_WHAT)

            async def allow() -> None:
                nonlocal access
                if not self._inverter.settings_need_control:
                    return
                if await self._procedures.in_control(Priority.SERVICE):
                    return
                # what was had was lost: to somebody who stopped it, or by a serial fault that a
                # refused write has caused
                if access.aborted:
                    raise DriveError(Report(Cause.PROCEDURE_STOPPED, what=_WHAT))
                await stack.aclose()
                access = stack.enter_context(self._procedures.exclusive(_WHAT))
                await stack.enter_async_context(self._procedures.in_standby(access))

            yield allow
