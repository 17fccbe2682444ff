# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Writes parameters that may be written, all or none, and believes only what it reads back."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Mapping, Sequence
import contextlib

from nfo_sinus_driver.bus import Cancelled, Priority
from nfo_sinus_driver.catalog import Family, Role, Value
from nfo_sinus_driver.catalog.profile import Wait
from nfo_sinus_driver.drive.known.changes import ParameterChange, Written, show, shown_raw
from nfo_sinus_driver.drive.known.diagnosis import explain_failure, report_of
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.exclusive_access import ExclusiveAccess
from nfo_sinus_driver.drive.motion.procedure import Procedures
from nfo_sinus_driver.link import LinkError, Refused

_SERVICE = Priority.SERVICE
#: How often an old value that the drive refuses is written.
_TRIES = 3
#: How a drive refuses what it may accept after other settings have changed.
_AS_THINGS_ARE = (Refused.ILLEGAL_VALUE, Refused.SETTINGS_CONFLICT)


class ParameterError(DriveError):
    """
    A parameter was not changed.

    :ivar key: which one; several, with commas, where they were refused together.
    :ivar left: the keys of those that may not be as they were.
    """

    def __init__(self, key: str, report: Report, left: Iterable[str] = ()) -> None:
        super().__init__(report)
        self.key = key
        self.left = tuple(left)

    def followed_by(self, *more: Report, left: Iterable[str] = ()) -> ParameterError:
        """Return the same error with more reports."""
        report = Report(Cause.SEVERAL, reports=(self.report, *more))
        return ParameterError(self.key, report, (*self.left, *left))


class _BadValue(ParameterError):
    """The drive does not accept the value as things are; after other changes it may."""


def not_changed(key: str, why: Report) -> ParameterError:
    """Return the error of a parameter that was not changed."""
    return ParameterError(key, Report(Cause.NOT_CHANGED, key=key, why=why))


class ParameterWriter:
    """Changes parameters of one drive, on the bus; if not, a ParameterError says why."""

    def __init__(self, state: DriveState, procedures: Procedures) -> None:
        self._state = state
        self._params = state.params
        self._procedures = procedures
        self._access = WriteAccess(state, procedures)

    async def write(
        self, wanted: Mapping[str, bytes], pace: Priority = Priority.POLL
    ) -> tuple[ParameterChange, ...]:
        """
        Write what differs, all of it or nothing: after an error what was written is put back.

        Values that bound each other, such as I-magn and I-limt [C34], may come in any order.

        :param pace: the priority with which each one is begun.
        """
        done: list[Written] = []
        async with self._access.granted() as allow:
            try:
                await self._write_all(wanted, done.append, allow, pace)
            except ParameterError as error:
                if not done:
                    raise
                reports, left = await self._put_back(done, allow)
                raise error.followed_by(*reports, left=left) from error
            except Cancelled:
                if done:
                    changes = tuple(self.describe(entry) for entry in done)
                    self._state.notify(Severity.WARNING, Cause.ENDED_HALF_WAY, changes=changes)
                raise
        return tuple(self.describe(entry) for entry in done)

    async def write_each(
        self, wanted: Mapping[str, bytes], wrote: Callable[[Written], None]
    ) -> None:
        """Write what differs, one by one; what was written before a refusal stays."""
        async with self._access.granted() as allow:
            await self._write_all(wanted, wrote, allow, Priority.POLL)

    async def _write_all(
        self,
        wanted: Mapping[str, bytes],
        wrote: Callable[[Written], None],
        allow: Allow,
        pace: Priority,
    ) -> None:
        waiting = sorted(wanted, key=self._order)
        while waiting:
            refused: dict[str, _BadValue] = {}
            for key in waiting:
                try:
                    for written in await self._write_one(key, wanted[key], allow, pace):
                        wrote(written)
                except _BadValue as error:
                    refused[key] = error
            if len(refused) == len(waiting):
                raise refused[waiting[0]]
            waiting = list(refused)

    async def require_standstill(self, keys: Iterable[str]) -> None:
        """Refuse what needs a motor at standstill, even if the drive would take it."""
        keys = tuple(keys)
        for key in keys:
            self._require_not_enabled(key)
        stopped = ', '.join(filter(self._params.model.needs_standstill, keys))
        if not stopped:
            return
        try:
            status = await self._state.reader.read(_SERVICE)
        except LinkError as error:
            raise not_changed(stopped, explain_failure(error, self._state)) from error
        if status.driven:
            raise not_changed(stopped, self._state.report(Cause.STANDSTILL_NEEDED))

    def _require_not_enabled(self, key: str) -> None:
        """
        Refuse what a start, a set-point or the line depends on while enabled, even at set-point 0.
        """
        model = self._state.model
        depends = key in model.profile.start_settings or key in model.scaling
        # a drive may show no run at set-point 0
        depends = depends or (key in model.communication and model.needs_standstill(key))
        if depends and self._procedures.enabled:
            raise not_changed(key, Report(Cause.NOT_WHILE_ENABLED))

    def describe(self, entry: Written) -> ParameterChange:
        """Return what was written, as values."""
        model = self._params.model[entry.key]
        before, after = self.value(entry.key, entry.before), self.value(entry.key, entry.after)
        return ParameterChange(entry.key, before, after, model.unit)

    def _order(self, key: str) -> tuple[bool, bool]:
        """Sort what a running motor forbids to the front, what may cut the line to the end."""
        model = self._params.model
        return key in model.communication, not model[key].stopped

    async def _write_one(
        self, key: str, data: bytes, allow: Allow, pace: Priority
    ) -> Iterable[Written]:
        try:
            before = await self._params.read_data(key, pace)
        except LinkError as error:
            raise not_changed(key, explain_failure(error, self._state)) from error
        if before == data:
            return ()
        try:
            await allow()
        except (LinkError, DriveError) as error:
            raise not_changed(key, explain_failure(error, self._state)) from error
        self._require_not_enabled(key)
        failure = await self._send(key, data)
        await self._keep()
        kept: bytes | None = None
        try:
            kept = await self._params.read_data(key, _SERVICE)
        except LinkError as error:
            failure = failure or error
        if kept == data:
            # with or without an answer to the write, even after a repeated one
            return (Written(key, before, data),)
        refused = not_changed(key, await self._why(key, data, kept, failure))
        if kept == before and isinstance(failure, Refused):
            bad = failure.code in _AS_THINGS_ARE
            raise _BadValue(key, refused.report) if bad else refused from failure
        stuck, left = list[Report](), list[str]()
        if kept != before:
            stuck, left = await self._put_back([Written(key, before, data)], allow)
        if not left:
            value = self._show(key, before)
            raise refused.followed_by(Report(Cause.AS_BEFORE, value=value)) from failure
        if kept is None:
            stuck.insert(0, Report(Cause.PERHAPS_CHANGED, value=self._show(key, data)))
        raise refused.followed_by(*stuck, left=left) from failure

    async def _keep(self) -> None:
        """Have what was written take effect, and be kept, where that needs further writes."""
        for step in self._state.model.profile.after_write:
            if isinstance(step, Wait):
                await self._state.bus.sleep(step.seconds)
                continue
            with contextlib.suppress(LinkError, DriveError):
                await self._params.write(step, _SERVICE)
            self._params.rest()

    async def _send(self, key: str, data: bytes) -> LinkError | DriveError | None:
        """Write; return why the drive may not have taken it, which only reading back shows."""
        try:
            await self._params.write_data(key, data, _SERVICE)
        except (LinkError, DriveError) as error:
            return error
        return None

    async def _restore(self, key: str, before: bytes, allow: Allow) -> Report | None:
        """Restore the value that a parameter had; return why it does not have it."""
        trouble: Report | None = None
        for _ in range(_TRIES):
            try:
                await allow()
            except DriveError as refused:
                return refused.report
            error = await self._send(key, before)
            try:
                kept = await self._params.read_data(key, _SERVICE)
            except Refused as refused:
                trouble = report_of(refused)
                continue
            if kept == before:
                return None
            keeps = Report(Cause.DRIVE_KEEPS, value=self._show(key, kept))
            trouble = explain_failure(error, self._state) if error else keeps
        return trouble

    async def _put_back(
        self, done: Sequence[Written], allow: Allow
    ) -> tuple[list[Report], list[str]]:
        """Undo what was written; return the reports, and the keys that may not be as before."""
        stuck: dict[str, Report] = {}
        silence: Report | None = None
        for entry in reversed(done):
            trouble = silence
            if silence is None:
                try:
                    trouble = await self._restore(entry.key, entry.before, allow)
                except LinkError as error:
                    # two time-outs are enough for the others on the line
                    trouble = explain_failure(error, self._state)
                    silence = Report(Cause.NOT_TRIED_ANY_MORE)
            if trouble is not None:
                stuck[entry.key] = Report(
                    Cause.NOT_PUT_BACK,
                    key=entry.key,
                    value=self._show(entry.key, entry.before),
                    why=trouble,
                )
        back = tuple(entry.key for entry in done if entry.key not in stuck)
        reports = [Report(Cause.PUT_BACK, keys=back)] if back else []
        return [*reports, *stuck.values()], list(stuck)

    def value(self, key: str, data: bytes) -> Value:
        """Return what bytes mean, or the bytes as text where they have no meaning."""
        try:
            return self._params.value(key, data)
        except ValueError:
            return shown_raw(data)

    def _show(self, key: str, data: bytes) -> str:
        unit = self._params.model[key].unit
        return f'{show(self.value(key, data))} {unit}'.rstrip()

    async def _why(
        self, key: str, data: bytes, kept: bytes | None, error: LinkError | DriveError | None
    ) -> Report:
        if isinstance(error, Refused):
            return await self._refusal(key, data, error)
        if error is not None:
            return explain_failure(error, self._state)
        assert kept is not None
        value, written = self._show(key, kept), self._show(key, data)
        return Report(Cause.DRIVE_KEEPS_OTHER, value=value, written=written)

    async def _refusal(self, key: str, data: bytes, error: Refused) -> Report:
        """Return why the drive refused, with what else may be the reason [C87]."""
        state = self._state
        why = report_of(error)
        if error.code == Refused.ILLEGAL_VALUE:
            value = self._show(key, data)
            why = Report(Cause.VALUE_NOT_ACCEPTED, value=value, behind=error.behind)
        elif error.code == Refused.RELEASE_NEEDED:
            why = Report(Cause.RELEASE_NEEDED, why=why)
        with contextlib.suppress(LinkError):
            # the last poll may have been before the fault
            await state.reader.read(_SERVICE)
        status = state.status
        if status is not None and status.driven and self._params.model[key].stopped:
            return Report(Cause.REFUSED_WHILE_RUNNING, why=why)
        if status is not None and status.faulted:
            return state.report(Cause.REFUSED_WHILE_FAULTED, why=why)
        return why


#: Awaited before each write of a setting; raises DriveError if the drive would not take it.
Allow = Callable[[], Awaitable[None]]

_WHAT = 'changing settings'


class WriteAccess:
    """
    Makes one drive take settings; used on the bus alone.

    Firmware of the v5.0 dialect takes them only while the bus has control. If control is free, it
    is taken while the motor stands still, with no run command and set-point 0, and released again.
    Other firmware takes settings at any time.
    """

    def __init__(self, state: DriveState, procedures: Procedures) -> None:
        self._state = state
        self._procedures = procedures

    @contextlib.asynccontextmanager
    async def granted(self) -> AsyncIterator[Allow]:
        """Yield what takes control, if need be; release control at the end, if it was taken."""
        async with contextlib.AsyncExitStack() as stack:
            access = ExclusiveAccess(_WHAT)

            async def allow() -> None:
                nonlocal access
                if not self._state.nameplate.is_older:
                    return
                if await self._procedures.controller.in_control(Priority.SERVICE):
                    return
                # control was lost: to a client that stopped the drive, or by a serial fault that a
                # refused write has caused
                if access.aborted:
                    raise DriveError(Cause.PROCEDURE_STOPPED, what=_WHAT)
                await stack.aclose()
                access = stack.enter_context(self._procedures.controller.exclusive(_WHAT))
                await stack.enter_async_context(self._procedures.in_standby(access))

            yield allow


#: The driver's own setting for each setting of the line.
_FOLLOWERS = {
    Role.BUS_PROTOCOL: 'protocol',
    Role.BUS_ADDRESS: 'address',
    Role.BAUD_RATE: 'baud_rate',
    Role.CHARACTER_FORMAT: 'char_format',
}


def followers(model: Family) -> Mapping[str, str]:
    """Return the driver's own setting for each setting of the line."""
    named = {model.key(role): setting for role, setting in _FOLLOWERS.items()}
    return {key: setting for key, setting in named.items() if key}


def write_forbidden(key: str, value: Value, state: DriveState) -> Report | None:
    """Return why a setting may not be changed to a value, ``None`` if it may."""
    settings = state.settings
    if settings.method == 'monitor':
        return Report(Cause.MONITOR_ONLY)
    if state.tuning:
        return Report(Cause.CHANGE_WHILE_TUNING)
    if key not in state.model.communication:
        return None
    if state.model.profile.cuts_off.get(key) == value:
        return Report(Cause.ENDS_COMMUNICATION, value=show(value))
    if not settings.allow_communication_changes:
        return Report(Cause.COMMUNICATION_PROTECTED)
    firmware = state.nameplate.identity.firmware if state.nameplate.identity else 0.0
    if firmware < state.model.profile.uncertain.get(key, 0.0):
        return Report(Cause.CODES_UNCERTAIN, firmware=firmware)
    return None


def after_change(changed: Mapping[str, Value], model: Family) -> Report | None:
    """Return how to follow a drive to new settings of the line, ``None`` if none was changed."""
    settings, ours = followers(model), model.profile.line_words
    follow = [
        f'{settings[key]} ({ours.get(value, value)})'
        for key, value in changed.items()
        if key in settings
    ]
    return Report(Cause.FOLLOW_THE_LINE, settings=' and '.join(follow)) if follow else None
