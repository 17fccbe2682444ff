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
from nfo_sinus_driver.drive.advice import explain
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.inverter import Inverter
from nfo_sinus_driver.drive.procedure import Procedures
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.drive.snapshot import Severity
from nfo_sinus_driver.drive.write_access import Allow
from nfo_sinus_driver.drive.write_access import WriteAccess
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import Refused

_SERVICE = Priority.SERVICE
#: How often it is tried to put a value back that the drive refuses.
_TRIES = 3


class ParameterError(DriveError):
    """
    A parameter was not changed; the message begins with its name and says why.

    :ivar left: the keys of those that may not be as they were.
    """

    def __init__(self, text: str, left: Iterable[str] = ()) -> None:
        super().__init__(text)
        self.left = tuple(left)


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


def describe_drift(drift: Change) -> str:
    """Return what to say of a parameter that the drive has otherwise than it was wanted."""
    has, wanted = f'{show(drift.new)} {drift.unit}'.rstrip(), show(drift.old)
    return f'{drift.key} is {has} in the drive, but {wanted} was asked for: it is left so'


class ParameterWriter:
    """Changes parameters of one drive, for coroutines on the bus."""

    def __init__(self, inverter: Inverter, registers: Registers, procedures: Procedures) -> None:
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
                text, left = await self._put_back(done, allow)
                raise ParameterError(f'{error}; {text}', (*error.left, *left)) from error
            except Cancelled:
                if done:
                    changes = ', '.join(str(self.describe(entry)) for entry in done)
                    text = f'ended half-way, NOT put back: {changes}'
                    self._inverter.tell(Severity.WARNING, text)
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

        :raises ParameterError: the motor runs, or nobody answers.
        """
        stopped = ', '.join(key for key in keys if self._registers.model[key].stopped)
        if not stopped:
            return
        try:
            seen = await self._inverter.look(_SERVICE)
        except LinkError as error:
            raise ParameterError(f'{stopped}: {self.explain(error)}') from error
        if seen.driven:
            raise ParameterError(
                f'{stopped}: only while the motor is stopped, but it is not '
                f'({self._inverter.describe()})'
            )

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
            raise ParameterError(f'{key}: {self.explain(error)}') from error
        if before == data:
            return ()
        try:
            await allow()
        except LinkError as error:
            raise ParameterError(f'{key}: {self.explain(error)}') from error
        except DriveError as error:
            raise ParameterError(f'{key}: {error}') from error
        failure = await self._send(key, data)
        kept: bytes | None = None
        try:
            kept = await self._registers.read_data(key, _SERVICE)
        except LinkError as error:
            failure = failure or error
        if kept == data:
            # whatever became of the answer to the write, a repeated one too
            return (Written(key, before, data),)
        text = f'{key}: {await self._why(key, data, kept, failure)}'
        if kept == before and isinstance(failure, Refused):
            bad = failure.code == Refused.ILLEGAL_VALUE
            raise (_BadValue if bad else ParameterError)(text) from failure
        trouble, left = '', list[str]()
        if kept != before:
            trouble, left = await self._put_back([Written(key, before, data)], allow)
        if not left:
            raise ParameterError(f'{text}; it is {self._show(key, before)} as before') from failure
        if kept is None:
            text += f'; whether the drive took {self._show(key, data)} is not known'
        raise ParameterError(f'{text}; {trouble}', left) from failure

    async def _send(self, key: str, data: bytes) -> LinkError | None:
        """Write; return why the drive may not have taken it: reading it back tells."""
        try:
            await self._registers.write_data(key, data, _SERVICE)
        except LinkError as error:
            return error
        return None

    async def _restore(self, key: str, before: bytes, allow: Allow) -> str:
        """
        See to it that a parameter is as it was; return why it is not.

        Tried again when the drive refuses, for it had the value once.

        :raises LinkError: nobody answers.
        """
        trouble = ''
        for _ in range(_TRIES):
            try:
                await allow()
            except DriveError as refused:
                return str(refused)
            error = await self._send(key, before)
            try:
                kept = await self._registers.read_data(key, _SERVICE)
            except Refused as refused:
                trouble = str(refused)
                continue
            if kept == before:
                return ''
            trouble = self.explain(error) if error else f'the drive keeps {self._show(key, kept)}'
        return trouble

    async def _put_back(
        self, done: Sequence[Written], allow: Allow
    ) -> tuple[str, list[str]]:
        """Undo what was written; return what to say of it, and what may not be as it was."""
        stuck: dict[str, str] = {}
        silence = ''
        for entry in reversed(done):
            trouble = silence
            if not silence:
                try:
                    trouble = await self._restore(entry.key, entry.before, allow)
                except LinkError as error:
                    # two time-outs are enough for the others on the line
                    trouble = self.explain(error)
                    silence = 'not tried any more'
            if trouble:
                before = self._show(entry.key, entry.before)
                stuck[entry.key] = f'{entry.key} is NOT put back to {before}: {trouble}'
        back = [entry.key for entry in done if entry.key not in stuck]
        said = [f'put back: {", ".join(back)}'] if back else []
        return '; '.join((*said, *stuck.values())), list(stuck)

    def value(self, key: str, data: bytes) -> Value:
        """Return what bytes mean, or the bytes as text where they have no meaning."""
        try:
            return self._registers.value(key, data)
        except ValueError:
            return shown_raw(data)

    def _show(self, key: str, data: bytes) -> str:
        unit = self._registers.model[key].unit
        return f'{show(self.value(key, data))} {unit}'.rstrip()

    def explain(self, error: LinkError) -> str:
        """Return what a failed transaction means to a person."""
        return explain(error, self._inverter.settings.address, known=True)

    async def _why(
        self, key: str, data: bytes, kept: bytes | None, error: LinkError | None
    ) -> str:
        """Return why a parameter was not changed."""
        if isinstance(error, Refused):
            return await self._refusal(key, data, error)
        if error is not None:
            return self.explain(error)
        assert kept is not None
        return f'the drive keeps {self._show(key, kept)} where {self._show(key, data)} was written'

    async def _refusal(self, key: str, data: bytes, error: Refused) -> str:
        """Return what the drive said, and what else is known that may be the reason [C87]."""
        inverter = self._inverter
        text = f'{error}'
        if error.code == Refused.ILLEGAL_VALUE:
            text = f'the drive does not accept {self._show(key, data)}{error.behind}'
        with contextlib.suppress(LinkError):
            # the last poll may have been before the fault
            await inverter.look(_SERVICE)
        seen = inverter.seen
        if seen is not None and seen.driven and self._registers.model[key].stopped:
            return f'{text}: the motor must be stopped for this, and it runs'
        if seen is not None and seen.faulted:
            return f'{text}; fault {inverter.describe()} stands: acknowledge it first (~/fault_ack)'
        return text
