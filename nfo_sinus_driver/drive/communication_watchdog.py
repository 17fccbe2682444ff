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

"""The time-out of the drive itself: what stops the motor when the driver is gone."""

from __future__ import annotations

from collections.abc import Sequence

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.events import Severity
from nfo_sinus_driver.drive.parameter_writer import Change
from nfo_sinus_driver.drive.parameters import Parameters
from nfo_sinus_driver.drive.settings import DRIVE_TIMEOUT_MARGIN


class CommunicationWatchdog:
    """
    SioTot with AutoStop of one drive [C91], or why not in a :class:`DriveError`; on the bus alone.

    :param commanded: this driver may command the drive, and not only watch it.
    """

    def __init__(self, inverter: DriveState, parameters: Parameters, *, commanded: bool) -> None:
        self._inverter = inverter
        self._parameters = parameters
        self._commanded = commanded
        self._told: Report | None = None
        #: It could not be set yet.
        self._due = False

    async def prepare(self) -> None:
        """
        Set it as the settings want it; later, if the drive takes nothing now.

        That is so while a fault is active, which could not be acknowledged without a connection;
        and, where settings need bus control [C100], while others have it.
        """
        self._due = True
        try:
            await self.require_set()
        except DriveError as error:
            inverter, seen = self._inverter, self._inverter.seen
            barred = inverter.settings_need_control and seen is not None and not seen.from_bus
            if not barred and (seen is None or not seen.faulted):
                raise
            self._inverter.tell(Severity.WARNING, Cause.OWN_TIMEOUT_LATER, why=error.report)

    async def require_set(self) -> None:
        """Set it if that could not be done before: nothing runs without it."""
        if self._due:
            await self.set_now(self._inverter.settings.drive_timeout)
            self._due = False

    async def set_now(self, seconds: float) -> Sequence[Change]:
        """Set and verify it; 0 leaves it as it is. Tells what was changed."""
        if not self._commanded:
            raise DriveError(Cause.MONITOR_ONLY)
        if not seconds:
            return ()
        if not self._inverter.can_time_out:
            raise DriveError(Cause.OWN_TIMEOUT_IMPOSSIBLE)
        key = self._inverter.model.key
        wanted: dict[str, Value] = {key(Role.COMMUNICATION_TIMEOUT): seconds}
        if key(Role.STOP_AT_TIMEOUT):
            wanted[key(Role.STOP_AT_TIMEOUT)] = True
        return await self._parameters.change_now(
            wanted, guarded=False, told_as=Cause.CHANGED_FOR_TIMEOUT
        )

    def warn_if_unfit(self) -> None:
        """Tell that it is missing, or strikes too soon; once for each reason in a row."""
        complaint = self._complaint() if self._commanded else None
        if complaint is not None and complaint != self._told:
            self._told = complaint
            self._inverter.tell(Severity.WARNING, complaint)

    def _complaint(self) -> Report | None:
        inverter, model = self._inverter, self._inverter.model
        timeout, margin = inverter.sio_tot, DRIVE_TIMEOUT_MARGIN
        least = inverter.settings.lost_after + margin
        method = inverter.settings.method_class
        if method.watched_for:
            caution = method.caution
            return Report(Cause.OWN_TIMEOUT_UNKNOWN, what=caution) if caution else None
        if not inverter.can_time_out:
            return Report(Cause.NO_OWN_TIMEOUT)
        name = model[model.key(Role.COMMUNICATION_TIMEOUT)].name
        if not timeout:
            return Report(Cause.OWN_TIMEOUT_OFF, name=name)
        if not inverter.auto_stop:
            stop = model[model.key(Role.STOP_AT_TIMEOUT)].name
            return Report(Cause.OWN_TIMEOUT_STOPS_NOTHING, name=stop)
        if timeout < least - 1e-9:
            return Report(
                Cause.OWN_TIMEOUT_SHORT, name=name, timeout=timeout, margin=margin, least=least
            )
        return None
