# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Recognises a drive by what it answers; all of it only reads, on the bus alone."""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import math

from nfo_sinus_driver.bus import Priority, Task
from nfo_sinus_driver.catalog import InverterStatus, Role, Value
from nfo_sinus_driver.drive.known.diagnosis import explain_failure
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report
from nfo_sinus_driver.drive.known.identity import Identity
from nfo_sinus_driver.drive.known.parameter_access import NONE_SUCH
from nfo_sinus_driver.drive.known.steps import run_steps
from nfo_sinus_driver.link import LinkError, PortError, Refused

#: An inverter status has one byte; firmware that is newer than the manual may have more of them.
_LAST_CODE = 0xFF
#: How often who waits for a recognition looks whether it has ended unnoticed, s.
_JOINED_FOR = 10.0
#: No firmware has this number: so answers what has no such register, or all bits set.
_NO_FIRMWARE = (0.0, 100.0)


class Recogniser:
    """Recognises one drive."""

    def __init__(self, state: DriveState) -> None:
        self._state = state
        self._params = state.params
        self._profile = state.model.profile
        #: What the parameter that identifies the family was when all was read.
        self._identified_as: Value | None = None
        #: The recognition that is under way for all that want to write.
        self._task: Task | None = None

    @property
    def identifies(self) -> bool:
        """Something tells its drives from others that have all the registers which are read."""
        profile = self._profile
        is_named = profile.identify or profile.product or profile.vendor
        return bool(is_named) or self._params.in_block

    async def recognise(self, priority: Priority = Priority.SERVICE) -> bool:
        """
        Read all that tells whether it is a drive of this family.

        :param priority: as for :meth:`Nameplate.identify`.
        :returns: whether its nameplate was read. One that was recognised before is stopped first,
            and so is one that has none by which it could be told from another.
        :raises LinkError: it does not answer.
        :raises DriveError: it is another one.
        """
        state, profile = self._state, self._profile
        tells = profile.identify or profile.product
        known = self._params.contact.is_recognised
        named = bool(tells) and not known
        try:
            await state.nameplate.identify(priority)
            self._require_fitted()
            await self._read_what_identifies()
            if named:
                await self.read_nameplate()
            await state.nameplate.read_scales()
            await state.read_control_mode()
            await state.timeout.read()
            status = await state.reader.read(Priority.SERVICE)
        except Refused as error:
            raise self._meant(error) from error
        state.require_fresh(status)
        if not known:
            # of one that is known, a word that no manual has keeps no stop back
            self._require_possible(status)
        self._params.contact.recognised()
        return named

    async def require(self) -> None:
        """
        Recognise it before a write, once for all that wait for it.

        :raises DriveError: it is not known what is there.
        """
        if self._task is None or self._task.future.done():
            self._task = self._state.bus.spawn(self._find_out())
        task = self._task
        while not await self._state.bus.join(task, _JOINED_FOR):
            continue
        error = task.future.result()
        if error is not None:
            why = explain_failure(error, self._state)
            raise self._params.contact.not_recognised(why) from error

    async def _find_out(self) -> LinkError | DriveError | None:
        """Recognise it; return why not."""
        try:
            await self.recognise()
        except (LinkError, DriveError) as error:
            return error
        return None

    async def look_once(self) -> None:
        """
        See once that the drive is there, before one that was recognised here is stopped.

        What tells it: the value by which its file identifies it, its firmware, or the parameter
        that identifies its family. Where that is not answered, or there is nothing such, a status
        that still shows a run: what was put in its place stands, and may wait until all is read.

        :raises LinkError: it does not answer.
        :raises DriveError: another one does.
        """
        contact, state = self._params.contact, self._state
        if not contact.was_here:
            await self.recognise(Priority.LOOK)
            return
        if self._params.in_block:
            # the PLC shows the layout of its block with each answer
            await self._params.read(state.model.key_of_status, Priority.LOOK, retry=False)
            contact.seen_again()
            return
        key, values = self._identifying
        if key and await self._is_same(key, values):
            contact.seen_again()
            return
        if await self._still_runs():
            contact.seen_again()
        else:
            await self.recognise(Priority.LOOK)

    async def _still_runs(self) -> bool:
        """Return whether the drive shows a run, by its status word alone where it has one."""
        state, params = self._state, self._params
        if not state.nameplate.has(state.reader.word_key):
            status = await state.reader.read(Priority.LOOK, retry=False)
            return status.driven or status.runs_by_bus
        reply = await params.read_reply(state.reader.word_key, Priority.LOOK, retry=False)
        if not params.can_be(state.reader.word_key, reply.data):
            return False
        shown = state.reader.status_of_word(state.reader.status_word(reply.data), reply.arrived)
        return shown.driven or shown.runs_by_bus

    async def _is_same(self, key: str, values: Sequence[Value]) -> bool:
        """Return whether what identifies the drive is as before; false: it is not told any more."""
        try:
            value = await self._params.read(key, Priority.LOOK, retry=False)
        except PortError:
            raise
        except LinkError as error:
            if not self._params.contact.since_port_opened:
                raise (self._meant(error) if isinstance(error, Refused) else error) from error
            return False
        self._require_identity(key, value, values)
        return True

    async def _read_what_identifies(self) -> None:
        """Read what :meth:`look_once` will compare, where nothing else has it."""
        key = self._profile.identified_by
        self._identified_as = None
        if self._profile.product is not None and key and self._state.nameplate.has(key):
            with contextlib.suppress(Refused):
                self._identified_as = await self._params.read(key, Priority.SERVICE)

    @property
    def _identifying(self) -> tuple[str, Sequence[Value]]:
        """The parameter that shows that a drive is the one from before, and what it is; or none."""
        state, params = self._state, self._params
        identity, firmware = state.nameplate.identity, state.model.key(Role.FIRMWARE)
        for key, values in self._profile.identify.items():
            return key, values
        if self._identified_as is not None:
            return self._profile.identified_by, (self._identified_as,)
        if identity is not None and not math.isnan(identity.firmware) and params.reaches(firmware):
            return firmware, (identity.firmware,)
        return '', ()

    async def read_nameplate(self) -> Identity:
        """Read who it says that it is (DriveError: it is another one)."""
        for key, values in self._profile.identify.items():
            self._require_identity(key, await self._params.read(key, Priority.SERVICE), values)
        nameplate, product = self._state.nameplate, self._profile.product
        if product is None:
            identity = await nameplate.read_more()
            # on CANopen it is a number, which no manual gives
            by_name = self._params.protocol == 'modbus' and identity.vendor
            if by_name and not identity.vendor.startswith(self._profile.vendor):
                raise self._another(Report(Cause.MADE_BY, vendor=identity.vendor))
            return identity
        try:
            return nameplate.take_product(await run_steps(self._state, product(), Priority.SERVICE))
        except DriveError:
            self._params.contact.another_answers()
            raise

    def _require_fitted(self) -> None:
        """Make sure that the drive has what its control method needs (DriveError: it lacks it)."""
        settings, params = self._state.settings, self._params
        method = self._profile.methods.get(settings.method)
        lacking = [key for key in method.needs if not params.reaches(key)] if method else ()
        if lacking:
            names = ' and '.join(params.model[key].name for key in lacking)
            others = settings.other_methods(self._state.bus.protocol)
            raise DriveError(
                Cause.METHOD_NEEDS, names=names, method=settings.method, others=others
            )

    def _require_identity(self, key: str, value: Value, values: Sequence[Value]) -> None:
        if values and value not in values:
            name, shown = self._state.model[key].name, ' or '.join(map(str, values))
            why = Report(Cause.IS_NOT, name=name, value=value, values=shown)
            raise self._another(why)

    def _require_possible(self, status: InverterStatus) -> None:
        """Make sure that what was read can be of this family, where it has nothing better."""
        profile, state = self._profile, self._state
        if profile.identify or profile.product or self._params.in_block:
            return
        word, identity = status.word, state.nameplate.identity
        if word is not None and not profile.status_word.may_say(word):
            raise self._impossible(state.reader.word_key, f'{word:04X}h')
        if profile.status_word.code is None and status.code > _LAST_CODE:
            raise self._impossible(state.model.key(Role.STATUS_CODE), str(status.code))
        low, high = _NO_FIRMWARE
        if identity is not None and (identity.firmware <= low or identity.firmware >= high):
            firmware = f'{identity.firmware:.2f}'
            raise self._impossible(state.model.key(Role.FIRMWARE), firmware)

    def _impossible(self, key: str, value: str) -> DriveError:
        name = self._state.model[key].name
        return self._another(Report(Cause.CANNOT_BE, name=name, value=value))

    def _another(self, why: Report) -> DriveError:
        """Note that another drive answers; return the error for that."""
        self._params.contact.another_answers()
        return DriveError(Cause.ANOTHER_DRIVE, title=self._profile.title, why=why)

    def _meant(self, error: Refused) -> LinkError | DriveError:
        """Return what it means that the drive refuses what every one of its family has."""
        if error.is_busy:
            return error
        if error.code in NONE_SUCH:
            self._params.contact.another_answers()
        name, what = self._state.model.name, error.what or 'it'
        return DriveError(Cause.OTHER_MODEL, error=str(error), model=name, what=what)
