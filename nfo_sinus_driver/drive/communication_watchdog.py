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

    def __init__(self, state: DriveState, parameters: Parameters, *, commanded: bool) -> None:
        self._state = state
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
            state, status = self._state, self._state.status
            barred = state.nameplate.is_older and status is not None and not status.from_bus
            if not barred and (status is None or not status.faulted):
                raise
            self._state.tell(Severity.WARNING, Cause.OWN_TIMEOUT_LATER, why=error.report)

    async def require_set(self) -> None:
        """Set it if that could not be done before: nothing runs without it."""
        if self._due:
            await self.set_now(self._state.settings.drive_timeout)
            self._due = False

    async def set_now(self, seconds: float) -> Sequence[Change]:
        """Set and verify it; 0 leaves it as it is. Tells what was changed."""
        if not self._commanded:
            raise DriveError(Cause.MONITOR_ONLY)
        if not seconds:
            return ()
        state = self._state
        if state.plc_time:
            raise DriveError(Report(Cause.OWN_TIMEOUT_OF_PLC, seconds=state.plc_time))
        await state.timeout.watch(seconds)
        key = state.model.key
        wanted: dict[str, Value] = {}
        if not state.timeout.watched_by:
            if not state.timeout.can_be_set:
                raise DriveError(Cause.OWN_TIMEOUT_IMPOSSIBLE)
            wanted[key(Role.COMMUNICATION_TIMEOUT)] = seconds
        if state.nameplate.has(key(Role.STOP_AT_TIMEOUT)):
            wanted[key(Role.STOP_AT_TIMEOUT)] = state.model.profile.stops_at_timeout
        try:
            changes = await self._change(wanted)
        except DriveError as error:
            faulted = state.status is not None and state.status.faulted
            if faulted or not state.bus.supervised:
                raise
            # whether a drive has any means at all is nowhere written for such a line [C102]
            report = state.report(Cause.OWN_TIMEOUT_NOT_TAKEN, why=error.report)
            state.tell(Severity.WARNING, report)
            return ()
        for change in changes:
            self._found.setdefault(change.key, change.old)
            self._set[change.key] = change.new
        return changes

    async def put_back(self) -> None:
        """
        Put back what was found, at a clean end after which the drive would go on watching.

        What another master has set meanwhile is left alone. Tells why the drive will have a fault,
        if it will; nothing of that keeps the driver from ending.
        """
        state = self._state
        await self._end_watch()
        if not state.timeout.can_be_set:
            return
        try:
            for key in reversed(self._found):
                if await state.params.read(key, Priority.SERVICE) == self._set[key]:
                    await self._change({key: self._found[key]})
            await state.timeout.read()
        except (LinkError, DriveError) as error:
            self._tell_left(explain_failure(error, state))
        else:
            if state.timeout.seconds and state.timeout.stops_motor:
                self._tell_left(Report(Cause.OWN_TIMEOUT_NOT_OURS))

    async def _end_watch(self) -> None:
        state = self._state
        by, seconds = state.timeout.watched_by, state.timeout.watched_for
        if not by:
            return
        try:
            await state.timeout.watch(0.0)
        except LinkError as error:
            why = explain_failure(error, state)
            state.tell(Severity.WARNING, Cause.WATCH_LEFT, why=why, by=by, seconds=seconds)

    async def _change(self, wanted: Mapping[str, Value]) -> Sequence[Change]:
        return await self._parameters.change_now(
            wanted, guarded=False, told_as=Cause.CHANGED_FOR_TIMEOUT
        )

    def _tell_left(self, why: Report) -> None:
        key = self._state.model.key(Role.COMMUNICATION_TIMEOUT)
        name, timeout = self._state.model[key].name, self._state.timeout.seconds
        self._state.tell(
            Severity.WARNING, Cause.OWN_TIMEOUT_LEFT, key=key, name=name, timeout=timeout, why=why
        )

    def warn_if_unfit(self) -> None:
        """Tell that it is missing, or strikes too soon; once for each reason in a row."""
        complaint = self._complaint() if self._commanded else None
        if complaint is not None and complaint != self._told:
            self._told = complaint
            self._state.tell(Severity.WARNING, complaint)

    def _complaint(self) -> Report | None:
        state, model = self._state, self._state.model
        timeout, margin = state.timeout.shortest, DRIVE_TIMEOUT_MARGIN
        least = state.settings.lost_after + margin
        method = state.settings.method_class
        if method.plc_time:
            caution = method.caution
            return Report(Cause.OWN_TIMEOUT_UNKNOWN, what=caution) if caution else None
        if not state.timeout.can_be_set and not state.timeout.watched_by:
            return state.report(Cause.NO_OWN_TIMEOUT)
        name = state.timeout.watched_by or model[model.key(Role.COMMUNICATION_TIMEOUT)].name
        if not timeout:
            return Report(Cause.OWN_TIMEOUT_OFF, name=name)
        if not state.timeout.stops_motor:
            stop = model[model.key(Role.STOP_AT_TIMEOUT)].name
            return Report(Cause.OWN_TIMEOUT_STOPS_NOTHING, name=stop)
        if timeout < least - 1e-9:
            return Report(
                Cause.OWN_TIMEOUT_SHORT, name=name, timeout=timeout, margin=margin, least=least
            )
        return None
