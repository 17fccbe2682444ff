# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Reads the status of a drive: its word, its code, who has control, and how fast it turns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Fact, Holder, InverterStatus, Kind, Meaning, Role
from nfo_sinus_driver.catalog.inverter_status import NO_CODE
from nfo_sinus_driver.drive.known.control_state import ControlTable
from nfo_sinus_driver.drive.known.identity import Nameplate
from nfo_sinus_driver.drive.known.measurements import Measurements
from nfo_sinus_driver.drive.known.parameter_access import ParameterAccess
from nfo_sinus_driver.link import DamagedAnswer, NoAnswer, Refused, Reply

#: How long bus control is assumed to last, s, where it has to be read separately.
_BY_MODE_FOR = 1.0
#: And while the motor is enabled: a hand takes longer to take control and to give it back.
_BY_MODE_WHILE_ENABLED = 0.08


class StatusReader:
    """
    Reads the status of one drive, on the bus alone; nothing that it reads acknowledges.

    :param latest: returns the newest status.
    :param note: takes each status that was read.
    """

    def __init__(
        self,
        params: ParameterAccess,
        nameplate: Nameplate,
        measurements: Measurements,
        control: ControlTable,
        latest: Callable[[], InverterStatus | None],
        note: Callable[[InverterStatus], None],
    ) -> None:
        self._params = params
        self._model = params.model
        self._nameplate = nameplate
        self._measurements = measurements
        self._control = control
        self._latest = latest
        self._note = note
        #: The code that the drive reports beside its word, while a procedure needs it; 0: not read.
        self._reported_code = 0
        #: The code of a fault or alarm that the status word does not name, and the one that does.
        self._resolved: tuple[int, int] | None = None

    async def read(
        self,
        priority: Priority,
        *,
        retry: bool = True,
        alarming: Callable[[InverterStatus], bool] = lambda _: False,
        code_for: float = 0.0,
    ) -> InverterStatus:
        """
        Read the status, without acknowledging anything.

        :param retry: repeat a request when there is no response.
        :param alarming: as for :meth:`complete`, and so is ``code_for``.
        :raises LinkError: the drive does not answer.
        """
        if not self._nameplate.has(self.word_key):
            return await self._read_code(priority, retry)
        before = self._latest()
        word, at = await self._read_int(self.word_key, priority, retry)
        return await self._complete(word, at, before, priority, retry, alarming, code_for)

    async def complete(
        self,
        reply: Reply,
        priority: Priority,
        *,
        alarming: Callable[[InverterStatus], bool],
        code_for: float,
    ) -> InverterStatus:
        """
        Read what a status word lacks that has come with another answer, without retries.

        :param alarming: whether a status of which one half is known may have to stop the motor; the
            rest is then read ahead of all else, unless that half is old.
        :param code_for: how long an inverter status counts, s, while the status word stays the
            same, if nothing was changing (:attr:`InverterStatus.plain`).
        :raises LinkError: the drive does not answer.
        """
        word, before = self.status_word(reply.data), self._latest()
        return await self._complete(
            word, reply.arrived, before, priority, False, alarming, code_for
        )

    async def _complete(
        self,
        word: int,
        at: float,
        before: InverterStatus | None,
        priority: Priority,
        retry: bool,
        alarming: Callable[[InverterStatus], bool],
        code_for: float,
    ) -> InverterStatus:
        half = self.status_of_word(word, at)
        alarmed = before is not None and word != before.word and alarming(half)
        priority = Priority.LOOK if alarmed else priority
        if self._model.profile.status_word.code is not None:
            half = await self._with_fault_code(half, before, priority)
            status = await self._with_control(half, priority, retry)
            return await self._with_frequency(status, priority, retry)
        last = self._latest()
        if last is not None and last.word == word and at - last.code_at < code_for and last.plain:
            status = replace(last, at=at)
            if not alarming(status):
                return await self._with_frequency(status, priority, retry)
        code, code_at = await self._read_int(self._model.key(Role.STATUS_CODE), priority, retry)
        status = replace(half, code=code, code_at=code_at)
        is_new = before is not None and code != before.code
        news = is_new and not alarmed
        # a fault or an alarm came or went between the two; where they go on to differ, the drive
        # treats the one as the other [C95]
        kind = status.listed.kind
        differs = (
            is_new and status.kind is not kind
            if kind is Kind.ALARM
            else (kind is Kind.FAULT) != status.faulted
        )
        if news and alarming(replace(status, word=None)):
            differs, priority = True, Priority.LOOK
        if differs:
            word, at = await self._read_int(self.word_key, priority, retry)
            status = replace(status, word=word, at=at)
        return await self._with_frequency(status, priority, retry)

    def status_of_word(self, word: int, at: float) -> InverterStatus:
        """Return the status that a status word alone shows; the rest of it is unknown."""
        code_of = self._model.profile.status_word.code
        if code_of is None:
            return InverterStatus(at, word, NO_CODE, self._model)
        code = code_of(word)
        if self._resolved is not None and self._resolved[0] == code:
            code = self._resolved[1]
        elif Meaning.UNNAMED not in self._model.status_code(code).meanings:
            # the name of a fault is found otherwise: this may be from before it
            code = self._reported_code or code
        status = InverterStatus(at, word, code, self._model, code_at=at)
        return self._with_control_as_before(status)

    async def _with_fault_code(
        self, status: InverterStatus, before: InverterStatus | None, priority: Priority
    ) -> InverterStatus:
        """Name a fault that has just come, so that its first report has the name; one try."""
        key = self._model.key(Role.FAULT_CODE)
        has_come = before is None or before.code != status.code
        if not (has_come and status.means(Meaning.UNNAMED) and self._params.reaches(key)):
            return status
        if self._params.by_mailbox(key):
            # that takes several transactions, and a stop does not wait for them
            return status
        try:
            self.resolve_fault(status.code, await self.read_fault_code(priority))
        except (Refused, NoAnswer):
            return status
        assert status.word is not None
        return self.status_of_word(status.word, status.at)

    async def read_fault_code(self, priority: Priority) -> int:
        """Read which fault or alarm it is that the status word does not name; one try."""
        key = self._model.key(Role.FAULT_CODE)
        number = await self._params.read_number(key, priority, retry=False)
        return self._model.profile.fault_code(int(number))

    async def read_reported_code(self, priority: Priority) -> None:
        """Read what the drive does, and show it with each status word until it is forgotten."""
        self._reported_code = await self.read_fault_code(priority)

    def forget_reported_code(self) -> None:
        """Show again what the status word shows alone."""
        self._reported_code = 0

    @property
    def unresolved_code(self) -> int:
        """The code of the fault or alarm that the status word does not name; 0: there is none."""
        return self._unresolved(self._latest())

    def _unresolved(self, status: InverterStatus | None) -> int:
        code_of = self._model.profile.status_word.code
        if code_of is None or status is None or status.word is None:
            return 0
        code = code_of(status.word)
        return code if Meaning.UNNAMED in self._model.status_code(code).meanings else 0

    def resolve_fault(self, unresolved: int, code: int) -> None:
        """Take the name of a fault or alarm that the status word does not name; 0: it has none."""
        is_one = self._model.status_code(code).kind is not Kind.STATUS
        # where all codes are the drive's own numbers, one that is not listed names it, too
        names = code in self._model.status_codes or (code and self._model.unlisted is not None)
        self._resolved = (unresolved, code) if is_one and names else None

    @property
    def fault_resolved(self) -> bool:
        """The fault or alarm that the status word does not name has a name."""
        return self._resolved is not None

    async def _with_frequency(
        self, status: InverterStatus, priority: Priority, retry: bool
    ) -> InverterStatus:
        """Add the frequency to a status, where its word shows no stop, or where it is free."""
        if not (status.by_frequency or self._model.profile.status_word.frequency_beside):
            return self._noted(status)
        measured = await self._measured_with(status, self._latest(), priority, retry=retry)
        return self._noted(measured)

    async def measured_with(
        self, status: InverterStatus, before: InverterStatus | None, *, retry: bool
    ) -> InverterStatus:
        """
        Return a status with the frequency, measured now unless it has come with it.

        :param before: the last one that was measured; what it fell from is in it.
        :param retry: repeat a request when there is no response.
        :raises LinkError: the drive does not answer.
        """
        has = self._nameplate.has(self._model.key(self._measurements.turning.role))
        if not has or not math.isnan(status.frequency):
            return status
        return await self._measured_with(status, before, Priority.LOOK, retry=retry)

    async def _measured_with(
        self,
        status: InverterStatus,
        before: InverterStatus | None,
        priority: Priority,
        *,
        retry: bool,
    ) -> InverterStatus:
        role, hertz = self._measurements.turning.role, self._measurements.turning.hertz
        try:
            value = await self._measurements.measure(
                self._model.key(role), priority, status, retry=retry
            )
        except Refused:
            value = math.nan
        self._measurements.take_value(role, value)
        return status.with_frequency(value * hertz, before)

    async def _read_int(self, key: str, priority: Priority, retry: bool) -> tuple[int, float]:
        reply = await self._params.read_reply(key, priority, retry=retry)
        return int(self._params.number(key, reply.data)), reply.arrived

    @property
    def word_key(self) -> str:
        """The parameter that a status begins with; ``''`` if the model has none."""
        return self._model.key(Role.STATUS_WORD)

    def status_word(self, data: bytes) -> int:
        """Return the status word that bytes mean."""
        return int(self._params.number(self.word_key, data))

    async def _read_code(self, priority: Priority, retry: bool) -> InverterStatus:
        """Read the inverter status alone: older firmware has no status word [C21]."""
        code, at = await self._read_int(self._model.key(Role.STATUS_CODE), priority, retry)
        status = InverterStatus(at, None, code, self._model, code_at=at)
        return self._noted(await self._with_control(status, priority, retry))

    def _with_control_as_before(self, status: InverterStatus) -> InverterStatus:
        before = self._latest()
        if before is None:
            return status
        return replace(status, by_mode=before.by_mode, by_mode_at=before.by_mode_at)

    async def _with_control(
        self, status: InverterStatus, priority: Priority, retry: bool
    ) -> InverterStatus:
        """
        Add to a status who has control, where neither its word nor its code shows it.

        Bus control is assumed to last for a while, as long as the code stays the same; not for long
        where the motor is enabled, which would go on after a take-over that was not seen. That is
        one if it is read twice, for one reading may be wrong.
        """
        in_word = status.word is not None and Fact.NETWORK_CONTROL in status.valid
        if in_word or not status.means(Meaning.ANONYMOUS):
            return status
        before = self._latest()
        same = before is not None and before.code == status.code
        enabled = self._control.enabled
        age = status.at - status.by_mode_at if same and status.by_mode else math.inf
        if age < (_BY_MODE_WHILE_ENABLED if enabled else _BY_MODE_FOR):
            return status
        try:
            by_bus, at = await self._held_by_bus(priority, retry)
            if enabled and not by_bus:
                by_bus, at = await self._held_by_bus(Priority.LOOK, retry)
        except DamagedAnswer:
            # noise; after no answer at all the whole status is read anew, for it is from before
            if age < _BY_MODE_FOR:
                return status
            raise
        return replace(status, by_mode=by_bus, by_mode_at=at)

    async def _held_by_bus(self, priority: Priority, retry: bool) -> tuple[bool, float]:
        """Read whether the bus has control; return when the answer came, too, s."""
        source = self._model.key(Role.CONTROL_SOURCE)
        reply = await self._params.read_reply(source, priority, retry=retry)
        holder = self._model.profile.holders.get(self._params.value(source, reply.data))
        by_bus = holder is Holder.BUS and not await self._operated_locally(priority, retry)
        return by_bus, reply.arrived

    async def _operated_locally(self, priority: Priority, retry: bool) -> bool:
        """Return whether keypad or terminals command, whatever the control source says."""
        key = self._model.key(Role.LOCAL_OPERATION)
        if not self._params.reaches(key):
            return False
        return bool(await self._params.read(key, priority, retry=retry))

    def _noted(self, status: InverterStatus) -> InverterStatus:
        before = self._latest()
        if (before is None or status.at >= before.at) and not self._unresolved(status):
            self._resolved = None
        self._note(status)
        return status
