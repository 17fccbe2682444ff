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

"""Writes parameters, all of them or none, and believes only what it reads back."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
import contextlib
from dataclasses import dataclass

from nfo_sinus_driver.bus import Cancelled
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive.diagnosis import explain
from nfo_sinus_driver.drive.diagnosis import report_of
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.events import Severity
from nfo_sinus_driver.drive.parameter_access import ParameterAccess
from nfo_sinus_driver.drive.procedure import Procedures
from nfo_sinus_driver.drive.write_access import Allow
from nfo_sinus_driver.drive.write_access import WriteAccess
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import Refused

_SERVICE = Priority.SERVICE
#: How often it is tried to put a value back that the drive refuses.
_TRIES = 3


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
        """Return the same error with more to say of it."""
        report = Report(Cause.SEVERAL, reports=(self.report, *more))
        return ParameterError(self.key, report, (*self.left, *left))


class _BadValue(ParameterError):
    """The drive does not accept the value as things are; after other changes it may."""


@dataclass(frozen=True)
class Change:
    """
    A parameter that was written.

    :ivar old: the value before, or the bytes as text where they had no meaning.
    """

    key: str
    old: Value
    new: Value
    unit: str

    def __str__(self) -> str:
        return f'{self.key}: {show(self.old)} -> {show(self.new)} {self.unit}'.rstrip()


@dataclass(frozen=True)
class Written:
    """A parameter that was written and read back, as it stands in the drive."""

    key: str
    before: bytes
    after: bytes


def show(value: Value) -> str:
    """Return a value as a person writes it in a parameter file."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    return f'{value:.10g}' if isinstance(value, float) else str(value)


def shown_raw(data: bytes) -> str:
    """Return bytes that mean nothing, as the manuals print numbers."""
    return f'{data.hex().upper()}h'


def not_changed(key: str, why: Report) -> ParameterError:
    """Return the error of a parameter that was not changed."""
    return ParameterError(key, Report(Cause.NOT_CHANGED, key=key, why=why))


class ParameterWriter:
    """Changes parameters of one drive, for coroutines on the bus."""

    def __init__(
        self, inverter: DriveState, registers: ParameterAccess, procedures: Procedures
    ) -> None:
        self._inverter = inverter
        self._registers = registers
        self._access = WriteAccess(inverter, procedures)

    async def write(self, wanted: Mapping[str, bytes]) -> tuple[Change, ...]:
        """
        Write what differs from what the drive has; all of it or nothing.

        Values that bound each other, such as I-magn and I-limt [C34], may come in any order.

        :returns: what was changed.
        :raises ParameterError: something was not taken; what had been written is put back, and
            the message names what could not be.
        """
        done: list[Written] = []
        async with self._access.granted() as allow:
            try:
                await self._write_all(wanted, done.append, allow)
            except ParameterError as error:
                if not done:
                    raise
                reports, left = await self._put_back(done, allow)
                raise error.followed_by(*reports, left=left) from error
            except Cancelled:
                if done:
                    changes = tuple(self.describe(entry) for entry in done)
                    ended = Report(Cause.ENDED_HALF_WAY, changes=changes)
                    self._inverter.tell(Severity.WARNING, ended)
                raise
        return tuple(self.describe(entry) for entry in done)

    async def write_each(
        self, wanted: Mapping[str, bytes], wrote: Callable[[Written], None]
    ) -> None:
        """
        Write what differs, one after the other; what was written before a refusal stays.

        :param wrote: told of each that was written; what it raises ends the writing.
        :raises ParameterError: something was not taken.
        """
        async with self._access.granted() as allow:
            await self._write_all(wanted, wrote, allow)

    async def _write_all(
        self, wanted: Mapping[str, bytes], wrote: Callable[[Written], None], allow: Allow
    ) -> None:
        waiting = sorted(wanted, key=self._order)
        while waiting:
            refused: dict[str, _BadValue] = {}
            for key in waiting:
                try:
                    for written in await self._write_one(key, wanted[key], allow):
                        wrote(written)
                except _BadValue as error:
                    refused[key] = error
            if len(refused) == len(waiting):
                raise refused[waiting[0]]
            waiting = list(refused)

    async def require_standstill(self, keys: Iterable[str]) -> None:
        """
        Refuse what only a standing motor allows; a drive that is lax about it is not trusted.

        :raises ParameterError: the motor runs, or there is no response.
        """
        stopped = ', '.join(key for key in keys if self._registers.model[key].stopped)
        if not stopped:
            return
        try:
            seen = await self._inverter.look(_SERVICE)
        except LinkError as error:
            raise not_changed(stopped, self.explain(error)) from error
        if seen.driven:
            raise not_changed(stopped, self._inverter.report(Cause.STANDSTILL_NEEDED))

    def describe(self, entry: Written) -> Change:
        """Return what was written as a person reads it."""
        model = self._registers.model[entry.key]
        before, after = self.value(entry.key, entry.before), self.value(entry.key, entry.after)
        return Change(entry.key, before, after, model.unit)

    def _order(self, key: str) -> tuple[bool, bool]:
        """Sort what a running motor forbids to the front, what may cut the line to the end."""
        model = self._registers.model
        return key in model.communication, not model[key].stopped

    async def _write_one(self, key: str, data: bytes, allow: Allow) -> Iterable[Written]:
        """Write one parameter if it differs; return what was written."""
        try:
            # between any two parameters, everybody who polls has a turn
            before = await self._registers.read_data(key, Priority.POLL)
        except LinkError as error:
            raise not_changed(key, self.explain(error)) from error
        if before == data:
            return ()
        try:
            await allow()
        except LinkError as error:
            raise not_changed(key, self.explain(error)) from error
        except DriveError as error:
            raise not_changed(key, error.report) from error
        failure = await self._send(key, data)
        kept: bytes | None = None
        try:
            kept = await self._registers.read_data(key, _SERVICE)
        except LinkError as error:
            failure = failure or error
        if kept == data:
            # whatever became of the answer to the write, a repeated one too
            return (Written(key, before, data),)
        refused = not_changed(key, await self._why(key, data, kept, failure))
        if kept == before and isinstance(failure, Refused):
            bad = failure.code == Refused.ILLEGAL_VALUE
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

    async def _send(self, key: str, data: bytes) -> LinkError | None:
        """Write; return why the drive may not have taken it: reading it back tells."""
        try:
            await self._registers.write_data(key, data, _SERVICE)
        except LinkError as error:
            return error
        return None

    async def _restore(self, key: str, before: bytes, allow: Allow) -> Report | None:
        """
        See to it that a parameter is as it was; return why it is not.

        Tried again when the drive refuses, for it had the value once.

        :raises LinkError: there is no response.
        """
        trouble: Report | None = None
        for _ in range(_TRIES):
            try:
                await allow()
            except DriveError as refused:
                return refused.report
            error = await self._send(key, before)
            try:
                kept = await self._registers.read_data(key, _SERVICE)
            except Refused as refused:
                trouble = report_of(refused)
                continue
            if kept == before:
                return None
            keeps = Report(Cause.DRIVE_KEEPS, value=self._show(key, kept))
            trouble = self.explain(error) if error else keeps
        return trouble

    async def _put_back(
        self, done: Sequence[Written], allow: Allow
    ) -> tuple[list[Report], list[str]]:
        """Undo what was written; return what to say of it, and what may not be as it was."""
        stuck: dict[str, Report] = {}
        silence: Report | None = None
        for entry in reversed(done):
            trouble = silence
            if silence is None:
                try:
                    trouble = await self._restore(entry.key, entry.before, allow)
                except LinkError as error:
                    # two time-outs are enough for the others on the line
                    trouble = self.explain(error)
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
            return self._registers.value(key, data)
        except ValueError:
            return shown_raw(data)

    def _show(self, key: str, data: bytes) -> str:
        unit = self._registers.model[key].unit
        return f'{show(self.value(key, data))} {unit}'.rstrip()

    def explain(self, error: LinkError) -> Report:
        """Return what a failed transaction means."""
        return explain(error, self._inverter.settings.address)

    async def _why(
        self, key: str, data: bytes, kept: bytes | None, error: LinkError | None
    ) -> Report:
        """Return why a parameter was not changed."""
        if isinstance(error, Refused):
            return await self._refusal(key, data, error)
        if error is not None:
            return self.explain(error)
        assert kept is not None
        value, written = self._show(key, kept), self._show(key, data)
        return Report(Cause.DRIVE_KEEPS_OTHER, value=value, written=written)

    async def _refusal(self, key: str, data: bytes, error: Refused) -> Report:
        """Return what the drive said, and what else is known that may be the reason [C87]."""
        inverter = self._inverter
        why = report_of(error)
        if error.code == Refused.ILLEGAL_VALUE:
            value = self._show(key, data)
            why = Report(Cause.VALUE_NOT_ACCEPTED, value=value, behind=error.behind)
        with contextlib.suppress(LinkError):
            # the last poll may have been before the fault
            await inverter.look(_SERVICE)
        seen = inverter.seen
        if seen is not None and seen.driven and self._registers.model[key].stopped:
            return Report(Cause.REFUSED_WHILE_RUNNING, why=why)
        if seen is not None and seen.faulted:
            return inverter.report(Cause.REFUSED_WHILE_FAULTED, why=why)
        return why
