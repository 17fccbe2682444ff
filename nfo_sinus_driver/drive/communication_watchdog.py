# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The time-out of the drive itself: what stops the motor when the driver is gone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role, Value
from nfo_sinus_driver.drive.diagnosis import explain_failure
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.parameter_writer import Change
from nfo_sinus_driver.drive.parameters import Parameters
from nfo_sinus_driver.drive.settings import DRIVE_TIMEOUT_MARGIN
from nfo_sinus_driver.link import LinkError


class CommunicationWatchdog:
    """
    SioTot with AutoStop of one drive [C91], or why not in a :class:`DriveError`; on the bus alone.

    On a line on which something lives beside questions and answers, such as a heartbeat, the drive
    watches over that, if it can.

    :param commanded: this driver may command the drive, and not only watch it.
    """

    def __init__(self, inverter: DriveState, parameters: Parameters, *, commanded: bool) -> None:
        self._inverter = inverter
        self._parameters = parameters
        self._commanded = commanded
        self._told: Report | None = None
        #: It could not be set yet.
        self._due = False
        #: What this driver has changed: what was found before, and what it has set.
        self._found: dict[str, Value] = {}
        self._set: dict[str, Value] = {}

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
        inverter = self._inverter
        if inverter.plc_time:
            raise DriveError(Report(Cause.OWN_TIMEOUT_OF_PLC, seconds=inverter.plc_time))
        await inverter.timeout.watch(seconds)
        key = inverter.model.key
        wanted: dict[str, Value] = {}
        if not inverter.timeout.watched_by:
            if not inverter.timeout.can_be_set:
                raise DriveError(Cause.OWN_TIMEOUT_IMPOSSIBLE)
            wanted[key(Role.COMMUNICATION_TIMEOUT)] = seconds
        if inverter.has(key(Role.STOP_AT_TIMEOUT)):
            wanted[key(Role.STOP_AT_TIMEOUT)] = True
        try:
            changes = await self._change(wanted)
        except DriveError as error:
            faulted = inverter.seen is not None and inverter.seen.faulted
            if faulted or not inverter.bus.supervised:
                raise
            # whether a drive has any means at all is nowhere written for such a line [C102]
            report = inverter.report(Cause.OWN_TIMEOUT_NOT_TAKEN, why=error.report)
            inverter.tell(Severity.WARNING, report)
            return ()
        for change in changes:
            self._found.setdefault(change.key, change.old)
            self._set[change.key] = change.new
        return changes

    async def put_back(self) -> None:
        """
        Put back what was found, at a clean end after which the drive would go on watching.

        What somebody else has set meanwhile is left alone. Tells why the drive will have a fault,
        if it will; nothing of that keeps the driver from ending.
        """
        inverter = self._inverter
        await self._end_watch()
        if not inverter.timeout.can_be_set:
            return
        try:
            for key in reversed(self._found):
                if await inverter.registers.read(key, Priority.SERVICE) == self._set[key]:
                    await self._change({key: self._found[key]})
            await inverter.timeout.read()
        except (LinkError, DriveError) as error:
            self._tell_left(explain_failure(error, inverter))
        else:
            if inverter.timeout.seconds and inverter.timeout.stops_motor:
                self._tell_left(Report(Cause.OWN_TIMEOUT_NOT_OURS))

    async def _end_watch(self) -> None:
        inverter = self._inverter
        by, seconds = inverter.timeout.watched_by, inverter.timeout.watched_for
        if not by:
            return
        try:
            await inverter.timeout.watch(0.0)
        except LinkError as error:
            why = explain_failure(error, inverter)
            inverter.tell(Severity.WARNING, Cause.WATCH_LEFT, why=why, by=by, seconds=seconds)

    async def _change(self, wanted: Mapping[str, Value]) -> Sequence[Change]:
        return await self._parameters.change_now(
            wanted, guarded=False, told_as=Cause.CHANGED_FOR_TIMEOUT
        )

    def _tell_left(self, why: Report) -> None:
        key = self._inverter.model.key(Role.COMMUNICATION_TIMEOUT)
        name, timeout = self._inverter.model[key].name, self._inverter.timeout.seconds
        self._inverter.tell(
            Severity.WARNING, Cause.OWN_TIMEOUT_LEFT, key=key, name=name, timeout=timeout, why=why
        )

    def warn_if_unfit(self) -> None:
        """Tell that it is missing, or strikes too soon; once for each reason in a row."""
        complaint = self._complaint() if self._commanded else None
        if complaint is not None and complaint != self._told:
            self._told = complaint
            self._inverter.tell(Severity.WARNING, complaint)

    def _complaint(self) -> Report | None:
        inverter, model = self._inverter, self._inverter.model
        timeout, margin = inverter.timeout.shortest, DRIVE_TIMEOUT_MARGIN
        least = inverter.settings.lost_after + margin
        method = inverter.settings.method_class
        if method.plc_time:
            caution = method.caution
            return Report(Cause.OWN_TIMEOUT_UNKNOWN, what=caution) if caution else None
        if not inverter.timeout.can_be_set and not inverter.timeout.watched_by:
            return inverter.report(Cause.NO_OWN_TIMEOUT)
        name = inverter.timeout.watched_by or model[model.key(Role.COMMUNICATION_TIMEOUT)].name
        if not timeout:
            return Report(Cause.OWN_TIMEOUT_OFF, name=name)
        if not inverter.timeout.stops_motor:
            stop = model[model.key(Role.STOP_AT_TIMEOUT)].name
            return Report(Cause.OWN_TIMEOUT_STOPS_NOTHING, name=stop)
        if timeout < least - 1e-9:
            return Report(
                Cause.OWN_TIMEOUT_SHORT, name=name, timeout=timeout, margin=margin, least=least
            )
        return None
