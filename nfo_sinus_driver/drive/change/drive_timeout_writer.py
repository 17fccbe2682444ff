# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The communication time-out of the drive: what stops the motor when the driver is gone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future
import contextlib
from typing import TypeVar

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role, Value
from nfo_sinus_driver.drive.change.memory import Borrowed, Memory
from nfo_sinus_driver.drive.change.parameter_writer import not_changed
from nfo_sinus_driver.drive.change.parameters import Parameters
from nfo_sinus_driver.drive.known.changes import ParameterChange
from nfo_sinus_driver.drive.known.diagnosis import explain_failure
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.settings import AS_THE_DRIVE_CAN, DRIVE_TIMEOUT_MARGIN
from nfo_sinus_driver.drive.motion.controller import Controller
from nfo_sinus_driver.link import LinkError

_T = TypeVar('_T')

#: How long an enable or an end waits for the disk, s, and how often it looks.
_LONGEST_DISK = 1.0
_LOOK_PERIOD = 0.005


class DriveTimeoutWriter:
    """
    Sets SioTot with AutoStop of one drive [C91]; a :class:`DriveError` says why not; on the bus
    alone.

    On a line with a heartbeat or guarding the drive watches that instead, if it can.

    :param memory: keeps what is to be put back, for the driver after this one if it is killed.
    :param controller: commands the drive; ``None``: this driver only reads it.
    """

    def __init__(
        self,
        state: DriveState,
        parameters: Parameters,
        memory: Memory,
        controller: Controller | None,
    ) -> None:
        self._state = state
        self._parameters = parameters
        self._memory = memory
        self._controller = controller
        #: The last report of each cause.
        self._reported: dict[Cause, Report] = {}
        #: What it was set to since the drive was connected, s, and whether the motor stops by it;
        #: ``None``: not yet.
        self._settled: tuple[float, bool] | None = None
        #: What this driver has changed: the values before, and those that it has set.
        self._found: dict[str, Value] = {}
        self._set: dict[str, Value] = {}
        #: It is the default of no setting, so it does not stay.
        self._unasked = False
        #: By what name the drive is remembered, ``''``: not looked for yet; and what is.
        self._name = ''
        self._remembered: Borrowed = {}

    @property
    def _goes_on(self) -> bool:
        """The bus keeps control after the end, or gets it back: the drive goes on watching."""
        return self._controller is not None and bool(self._controller.control_retained)

    def connected(self) -> None:
        """Have it set with the next enable (DriveError: a setting wants it; there is none)."""
        self._settled = None
        if self._state.settings.drive_timeout > 0:
            self._require_possible()

    async def recall(self) -> None:
        """
        Take over what a driver that was killed has left in the drive, to put it back at the end.

        What has another value by now the owner has changed since: it is forgotten.
        """
        state = self._state
        timeout = state.timeout
        if self._name or self._controller is None or state.plc_time or not timeout.can_be_set:
            return
        name = self._name_of_drive()
        remembered = await self._from_disk(self._memory.read(name), {})
        for key, (found, ours) in remembered.items():
            if key in timeout.keys and await self._is(key, ours):
                self._found[key], self._set[key] = found, ours
        self._name, self._remembered = name, remembered
        self._unasked = bool(self._found)
        await self._remember()
        if self._found:
            names = tuple(state.model[key].name for key in self._found)
            state.notify(Severity.INFO, Cause.OWN_TIMEOUT_RECALLED, names=names)

    def _name_of_drive(self) -> str:
        """Return what tells this drive from all others: its serial number, or its place."""
        state = self._state
        serial = state.nameplate.identity.own_serial if state.nameplate.identity else ''
        known = (serial,) if serial else (self._memory.line, state.settings.address)
        return ' '.join(map(str, (state.model.name, *known)))

    async def _is(self, key: str, value: Value) -> bool:
        """Return whether a parameter has a value (LinkError: it cannot be read)."""
        try:
            return await self._state.params.read(key, Priority.SERVICE) == value
        except ValueError:
            return False

    async def _remember(self) -> None:
        """Have all that the end puts back outlive this process."""
        owed = {}
        if self._unasked or self._goes_on:
            owed = {key: (found, self._set[key]) for key, found in self._found.items()}
        if self._name and owed != self._remembered:
            await self._from_disk(self._memory.write(self._name, owed), None)
            self._remembered = owed

    async def _from_disk(self, future: Future[_T], otherwise: _T) -> _T:
        """Return what the disk says, or something else: no motor waits for it for long."""
        bus, why = self._state.bus, Report(Cause.TOO_LATE, timeout=_LONGEST_DISK)
        deadline = bus.now() + _LONGEST_DISK
        while not future.done() and bus.now() < deadline:
            await bus.sleep(_LOOK_PERIOD)
        if future.done():
            try:
                return future.result()
            except OSError as error:
                why = Report(Cause.NOT_POSSIBLE, why=str(error))
        keys = self._state.timeout.keys
        self._report_once(Severity.WARNING, Report(Cause.NOT_REMEMBERED, why=why, keys=keys))
        return otherwise

    async def ensure_set(self) -> None:
        """
        Set it, if that was not done yet.

        Failing to set the default prevents no start; the next enable tries again.
        """
        settings = self._state.settings
        if self._is_settled(settings.wanted_drive_timeout):
            return
        done = True
        if settings.drive_timeout == AS_THE_DRIVE_CAN:
            done = await self._try_usual(settings.wanted_drive_timeout)
        else:
            await self.set_now(settings.wanted_drive_timeout)
        if done:
            self._settled = settings.wanted_drive_timeout, self._state.timeout.stops_motor
        self._report_timeout()
        self.warn_if_unfit()

    def _is_settled(self, seconds: float) -> bool:
        """Return whether it was set to this, and nothing else was read since."""
        key = self._state.model.key(Role.COMMUNICATION_TIMEOUT)
        ours = self._set.get(key)
        settled = seconds, self._state.timeout.stops_motor
        return self._settled == settled and self._parameters.values.get(key, ours) == ours

    async def set_now(self, seconds: float) -> Sequence[ParameterChange]:
        """
        Set and verify it, and have it stop the motor; return what was changed.

        0 leaves it as it is, and :data:`AS_THE_DRIVE_CAN` leaves it to the next enable.
        """
        if self._controller is None:
            raise DriveError(Cause.MONITOR_ONLY)
        if seconds <= 0:
            return ()
        self._require_possible()
        state = self._state
        await state.timeout.watch(seconds)
        wanted: dict[str, Value] = {}
        if not state.timeout.watched_by:
            wanted[state.model.key(Role.COMMUNICATION_TIMEOUT)] = seconds
        try:
            await state.timeout.read()
            # a choice of the owner by which the motor stops is left
            for key in state.timeout.prevented_by:
                if state.nameplate.has(key):
                    wanted[key] = state.timeout.stopping(key)
            changes = await self._set_to(wanted)
        except (LinkError, DriveError) as error:
            faulted = state.status is not None and state.status.faulted
            if faulted or not state.bus.supervised:
                raise
            # no manual says whether a drive on such a line has any [C102]
            self._report_not_taken(error)
            return ()
        self._settled, self._unasked = (seconds, state.timeout.stops_motor), False
        await self._remember()
        return changes

    def _require_possible(self) -> None:
        state = self._state
        if state.plc_time:
            raise DriveError(Report(Cause.OWN_TIMEOUT_OF_PLC, seconds=state.plc_time))
        if not state.timeout.can_be_set and not state.bus.supervised:
            raise DriveError(Cause.OWN_TIMEOUT_IMPOSSIBLE)

    async def _try_usual(self, seconds: float) -> bool:
        """
        Set the default, where the drive is set to stop its motor; return whether nothing failed.

        That setting is left as it is, and so is a shorter time-out: others have chosen them.
        """
        timeout = self._state.timeout
        if not seconds or self._state.plc_time:
            return True
        try:
            await timeout.read()
            if timeout.stops_motor:
                await timeout.watch(seconds)
                if not timeout.watched_by and not self._is_kept(seconds):
                    await self._write_usual(seconds)
        except (LinkError, DriveError) as error:
            self._report_not_taken(error)
            return False
        return True

    def _is_kept(self, seconds: float) -> bool:
        """Return whether others have set one that is no longer than this."""
        found = self._state.timeout.seconds
        ours = self._set.get(self._state.model.key(Role.COMMUNICATION_TIMEOUT))
        return 0 < found <= seconds and found != ours

    async def _write_usual(self, seconds: float) -> None:
        self._unasked = True
        await self._set_to({self._state.model.key(Role.COMMUNICATION_TIMEOUT): seconds})
        await self._state.timeout.read()

    async def _set_to(self, wanted: Mapping[str, Value]) -> Sequence[ParameterChange]:
        """
        Write and verify values; return what was changed.

        What they replace is noted before, here and outside: a stop may cancel this, or the process
        may be killed, and the drive has them all the same.
        """
        for key, value in wanted.items():
            try:
                await self._note(key, value)
            except LinkError as error:
                raise not_changed(key, explain_failure(error, self._state)) from error
        await self._remember()
        return await self._change(wanted)

    async def _note(self, key: str, value: Value) -> None:
        """Note a value that is to be set, and what it replaces, unless that was set here, too."""
        if key not in self._found or not await self._is(key, self._set[key]):
            try:
                found = await self._state.params.read(key, Priority.SERVICE)
            except ValueError:
                # a code that means nothing cannot be written, so it is not put back either
                found = value
            if found == value:
                self._forget(key)
                return
            self._found[key] = found
        self._set[key] = value

    def _forget(self, key: str) -> None:
        self._found.pop(key, None)
        self._set.pop(key, None)

    async def undo(self) -> None:
        """Put back the default, while the drive still takes settings."""
        if self._unasked:
            with contextlib.suppress(LinkError, DriveError):
                await self._restore()

    async def put_back(self) -> None:
        """
        Put back the values before, at a clean end.

        What another master has set meanwhile is left alone, and so is what a setting wants where
        the drive stops watching. A fault to come is reported; no error keeps the driver from
        ending.
        """
        state, goes_on = self._state, self._goes_on
        await self._end_watch()
        if not state.timeout.can_be_set or not (goes_on or self._unasked):
            return
        try:
            await self._restore()
            if goes_on:
                await state.timeout.read()
        except (LinkError, DriveError) as error:
            self._report_left(explain_failure(error, state), goes_on=goes_on)
        else:
            if goes_on and state.timeout.seconds and state.timeout.stops_motor:
                self._report_left(Report(Cause.OWN_TIMEOUT_NOT_OURS), goes_on=True)

    def left(self, error: LinkError | DriveError) -> None:
        """Report that the default stays set: the motor may run, or could run again."""
        if self._unasked and self._found:
            self._report_left(explain_failure(error, self._state), goes_on=False)

    async def _restore(self) -> None:
        for key in reversed(tuple(self._found)):
            if await self._is(key, self._set[key]):
                await self._change({key: self._found[key]})
            self._forget(key)
        await self._remember()

    async def _end_watch(self) -> None:
        state = self._state
        by, seconds = state.timeout.watched_by, state.timeout.may_watch_for
        if not seconds:
            return
        try:
            await state.timeout.watch(0.0)
        except (LinkError, DriveError) as error:
            why, by = explain_failure(error, state), by or 'heartbeat or guarding'
            state.notify(Severity.WARNING, Cause.WATCH_LEFT, why=why, by=by, seconds=seconds)

    async def _change(self, wanted: Mapping[str, Value]) -> Sequence[ParameterChange]:
        return await self._parameters.change_now(
            wanted, guarded=False, report_as=Cause.CHANGED_FOR_TIMEOUT
        )

    def _report_not_taken(self, error: LinkError | DriveError) -> None:
        why = explain_failure(error, self._state)
        not_taken = self._state.report(Cause.OWN_TIMEOUT_NOT_TAKEN, why=why)
        self._report_once(Severity.WARNING, not_taken)

    def _report_timeout(self) -> None:
        """Report after what time the drive stops the motor by itself; each value once."""
        timeout, model = self._state.timeout, self._state.model
        if timeout.shortest and timeout.stops_motor:
            name = timeout.watched_by or model[model.key(Role.COMMUNICATION_TIMEOUT)].name
            watching = Report(Cause.OWN_TIMEOUT_SET, name=name, timeout=timeout.shortest)
            self._report_once(Severity.INFO, watching)

    def _report_left(self, why: Report, *, goes_on: bool) -> None:
        cause = Cause.OWN_TIMEOUT_LEFT if goes_on else Cause.OWN_TIMEOUT_NOT_PUT_BACK
        key = self._state.model.key(Role.COMMUNICATION_TIMEOUT)
        name, timeout = self._state.model[key].name, self._state.timeout.seconds
        self._state.notify(Severity.WARNING, cause, key=key, name=name, timeout=timeout, why=why)

    def warn_if_unfit(self) -> None:
        """Report that it is missing or too short; each reason once."""
        complaint = self._complaint() if self._controller is not None else None
        if complaint is not None:
            kept = complaint.cause is Cause.OWN_TIMEOUT_KEPT
            self._report_once(Severity.INFO if kept else Severity.WARNING, complaint)

    def _report_once(self, severity: Severity, what: Report) -> None:
        if self._reported.get(what.cause) != what:
            self._reported[what.cause] = what
            self._state.notify(severity, what)

    def _complaint(self) -> Report | None:
        """Return what will be wrong with it at the next enable, or why it stays as it is."""
        state, model, settings = self._state, self._state.model, self._state.settings
        timeout, margin = state.timeout.shortest, DRIVE_TIMEOUT_MARGIN
        method = settings.method_class
        if method.plc_time:
            caution = method.caution
            return Report(Cause.OWN_TIMEOUT_UNKNOWN, what=caution) if caution else None
        if settings.drive_timeout > 0:
            # one that does not fit is refused
            return None
        if not state.timeout.can_be_set and not state.timeout.watched_by:
            return state.report(Cause.NO_OWN_TIMEOUT)
        name = state.timeout.watched_by or model[model.key(Role.COMMUNICATION_TIMEOUT)].name
        asked = settings.drive_timeout
        if not timeout and not settings.wanted_drive_timeout:
            return Report(Cause.OWN_TIMEOUT_OFF, name=name, asked=asked)
        if prevented := state.timeout.prevented_by:
            return Report(
                Cause.OWN_TIMEOUT_STOPS_NOTHING,
                found=tuple(self._setting(key, value) for key, value in prevented.items()),
                wanted=tuple(self._setting(key, state.timeout.stopping(key)) for key in prevented),
            )
        least = settings.lost_after + margin
        if 0 < timeout < least - 1e-9:
            return Report(
                Cause.OWN_TIMEOUT_SHORT, name=name, timeout=timeout, margin=margin, least=least
            )
        if not asked and not self._found:
            return Report(Cause.OWN_TIMEOUT_KEPT, name=name, timeout=timeout)
        return None

    def _setting(self, key: str, value: Value | None) -> str:
        """Return a setting with its value, such as ``AutoStop = OFF``; ``?``: it is not known."""
        if isinstance(value, bool):
            value = 'ON' if value else 'OFF'
        return f'{self._state.model[key].name} = {"?" if value is None else value}'
