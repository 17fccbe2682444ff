# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The settings of one drive: read once, watched, changed on request."""

from __future__ import annotations

from collections.abc import (
    AsyncIterator,
    Awaitable,
    Callable,
    Collection,
    Mapping,
    Sequence,
)
import contextlib
import logging

from nfo_sinus_driver.bus import Lock, Priority, Run, on_bus
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive.change.parameter_writer import (
    ParameterError,
    ParameterWriter,
    after_change,
    followers,
    not_changed,
    write_forbidden,
)
from nfo_sinus_driver.drive.known.changes import ParameterChange, Written, show
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.motion.procedure import Procedures
from nfo_sinus_driver.link import LinkError, Refused

_log = logging.getLogger(__name__)

#: How long one round of reading every parameter again takes at least, s: a change at the keypad
#: is noticed within 10 s, and a fast line is not kept busy for nothing.
_ROUND = 9.8
#: How often at most one is read by the mailbox of a PLC, s: it has other work.
_MAILBOX_PACE = 0.5
#: How often to check whether there is something to read, s.
_WAIT = 0.5
#: When progress is logged first while the parameters are read for the first time, s; then each time
#: after a pause twice as long, for on a line with many drives it takes minutes.
_PROGRESS = 5.0
#: After how many rounds of refusals alone the drive does not have the parameters left.
_REFUSALS = 2



class Parameters:
    """
    The settings of one drive.

    Reading and watching never write. Public methods may be called from any thread, those that end
    in ``_now`` on the bus alone.

    :param run: runs a coroutine on the bus; its errors explain themselves.
    :param on_change: called on the bus with the keys of parameters whose value is new.
    :param on_scale: called on the bus with a change, at the drive, of what scales other values.
    :raises LinkError: the drive does not answer.
    :raises ParameterError: a value is not taken, and why.
    """

    def __init__(
        self,
        state: DriveState,
        procedures: Procedures,
        run: Run,
        on_change: Callable[[Collection[str]], None],
        on_scale: Callable[[ParameterChange], None],
    ) -> None:
        self._bus = state.bus
        self._state = state
        self._params = state.params
        self.run = run
        self._on_change = on_change
        self._on_scale = on_scale
        self._writer = ParameterWriter(state, procedures)
        self._keys: tuple[str, ...] = ()
        self._data: dict[str, bytes] = {}
        self._values: dict[str, Value] = {}
        self._desired = DesiredConfig(self, state)
        self._turn = Lock(state.bus)
        #: What is being written, and may still be put back.
        self._changing: Collection[str] = ()
        self._rounds = 0
        #: How many are still to be read for the first time, and of how many.
        self._unread = self._total = 0

    # --- any thread ---------------------------------------------------------------------------

    @property
    def values(self) -> Mapping[str, Value]:
        """The settings that the drive has, by key, as last read."""
        return self._values

    @property
    def data(self) -> Mapping[str, bytes]:
        """The same as bytes, meaningful or not."""
        return self._data

    @property
    def progress(self) -> str:
        """How far the first reading has come, for diagnostics."""
        if self._unread:
            return f'{self._total - self._unread} of {self._total} read'
        return f'{len(self._keys)} read' if self._keys else 'not read'

    @property
    def drift(self) -> tuple[ParameterChange, ...]:
        """What differs from the wanted settings, as wanted -> what the drive has."""
        return self._desired.drift

    @property
    def wanted(self) -> Mapping[str, Value]:
        """The wanted settings, by key."""
        return dict(self._desired.values)

    def describe(self, key: str, before: Value, data: bytes) -> ParameterChange:
        """Return the difference between a value and what bytes mean."""
        unit = self._state.model[key].unit
        return ParameterChange(key, before, self._writer.value(key, data), unit)

    def coerce(self, key: str, value: Value) -> Value:
        """Return a value as the drive would show it."""
        known = self._values.get(key)
        if known is not None and type(known) is type(value) and known == value:
            # the drive has it, even if no manual allows it [C19]
            return known
        model = self._state.model
        if key not in model or not model[key].is_setting or not self._params.is_addressable(key):
            raise ParameterError(key, Report(Cause.NO_SETTING, key=key))
        try:
            return self._params.value(key, self._params.encode(key, value))
        except ValueError as error:
            raise ParameterError(key, Report(Cause.NOT_POSSIBLE, why=str(error))) from None

    def available(self, only: Collection[str] | None = None) -> list[str]:
        """Return the keys of the settings that the drive has, or of ``only`` some, in order."""
        return [
            parameter.key
            for parameter in self._state.model.kept
            if (parameter.is_setting if only is None else parameter.key in only)
            and self._state.nameplate.has(parameter.key)
        ]

    def validate(self, key: str, value: Value) -> Value:
        """Return the same, or raise why it may not be set; nothing is sent to the drive."""
        coerced = self.coerce(key, value)
        reason = write_forbidden(key, coerced, self._state)
        if reason is not None and self._values.get(key) != coerced:
            raise not_changed(key, reason)
        return coerced

    # --- on the bus ---------------------------------------------------------------------------

    async def read_now(self, only: Collection[str] | None = None) -> None:
        """Read every setting that the drive has, or only some."""
        state = self._state
        self._keys = ()
        self._data, self._values = {}, {}
        keys = self.available(only)
        self._unread = self._total = len(keys)
        started = self._bus.now()
        try:
            with self._bus.first_reading(state.settings.address):
                await self._read_first(keys)
        except BaseException:
            self._data, self._values = {}, {}
            raise
        finally:
            self._unread = 0
        self._keys = tuple(key for key in keys if key in self._data)
        if keys:
            took = self._bus.now() - started
            state.notify(Severity.INFO, Cause.SETTINGS_READ, progress=self.progress, seconds=took)

    async def _read_first(self, keys: Sequence[str]) -> None:
        """Read each once; what the drive refuses again and again it does not have."""
        pause = _PROGRESS
        report_at = self._bus.now() + pause
        refusals = 0
        while keys and refusals < _REFUSALS:
            refused: dict[str, Refused] = {}
            for key in keys:
                try:
                    await self._read(key, retry=True)
                    self._unread -= 1
                except Refused as error:
                    # by a busy drive, perhaps: read again after the others
                    refused[key] = error
                if self._bus.now() > report_at:
                    pause *= 2
                    report_at = self._bus.now() + pause
                    self._state.notify(
                        Severity.INFO, Cause.SETTINGS_BEING_READ, progress=self.progress
                    )
            refusals = refusals + 1 if len(refused) == len(keys) else 0
            keys = tuple(refused)
        self._report_unreadable({key: refused[key] for key in keys})

    def _report_unreadable(self, refused: Mapping[str, Refused]) -> None:
        cards: list[str] = []
        for key, error in refused.items():
            if option := self._state.model[key].option:
                cards.append(option)
            else:
                self._state.notify(
                    Severity.WARNING, Cause.SETTING_UNREADABLE, key=key, error=str(error)
                )
        if cards:
            options = ', '.join(dict.fromkeys(cards))
            self._state.notify(
                Severity.INFO, Cause.OPTIONS_MISSING, count=len(cards), options=options
            )

    async def watch_now(self) -> None:
        """Read the settings one after the other, again and again."""
        with self._bus.refreshing() as sharers:
            while True:
                await self._watch_round(sharers)

    async def _watch_round(self, sharers: Callable[[], int]) -> None:
        state = self._state
        keys = self._keys
        # if these had changed, the drive could hardly be read: one of them in a round will do
        settings = followers(state.model)
        rare = [key for key in keys if key in settings]
        self._rounds += 1
        skipped = {key for number, key in enumerate(rare) if (number + self._rounds) % len(rare)}
        due = [key for key in keys if key not in skipped and not self._cannot_change(key)]
        started = self._bus.now()
        for number, key in enumerate(due, start=1):
            if state.contact.connected and state.contact.responsive:
                try:
                    await self._read(key, retry=False)
                except Refused:
                    pass
                except (LinkError, DriveError):
                    # the poll reports it if the drive is lost, or has to be recognised anew
                    state.missed()
            # with many drives on a line a round takes longer, to leave time for other requests
            pace = _ROUND * sharers() / len(due)
            if self._params.by_mailbox(key):
                pace = max(pace, _MAILBOX_PACE)
            await self._bus.sleep(started + number * pace - self._bus.now())
            if keys is not self._keys:
                # they are being read anew
                return
        if not due:
            await self._bus.sleep(_WAIT)

    def _cannot_change(self, key: str) -> bool:
        """Return whether a running motor forbids a change, or this firmware does not have it."""
        status = self._state.status
        barred = self._state.model[key].stopped and status is not None and status.driven
        return barred or not self._state.nameplate.has(key)

    async def change_now(
        self, wanted: Mapping[str, Value], *, guarded: bool = True, report_as: Cause = Cause.CHANGED
    ) -> tuple[ParameterChange, ...]:
        """
        Write what differs, all of it or nothing, and read it back; return what was changed.

        :param guarded: false for what the driver sets itself.
        :param report_as: the cause of the report of each change.
        """
        take = self.validate if guarded else self.coerce
        coerced = {key: take(key, value) for key, value in wanted.items()}
        if guarded:
            # what may not be changed passes only because the drive has it already
            coerced = {
                key: value
                for key, value in coerced.items()
                if not write_forbidden(key, value, self._state)
            }
        data = {key: self._data_of(key, value) for key, value in coerced.items()}
        async with self._alone(data):
            await self._require_standstill(data)
            try:
                # between any two, polls have a turn, unless the motor waits for the change
                pace = Priority.POLL if guarded else Priority.SERVICE
                changes = await self._writer.write(data, pace)
            except ParameterError as error:
                hint = after_change({key: coerced[key] for key in error.left}, self._state.model)
                if hint is None:
                    raise
                raise error.followed_by(hint) from error
            self._desired.follow(coerced)
            written = {change.key for change in changes}
            for key in data:
                self._learn(key, data[key], quiet=key in written)
        for change in changes:
            self._state.notify(Severity.INFO, Report(report_as, change=change))
        hint = after_change({change.key: change.new for change in changes}, self._state.model)
        if hint is not None:
            self._state.notify(Severity.WARNING, hint)
        return changes

    async def write_each_now(
        self, wanted: Mapping[str, bytes], wrote: Callable[[ParameterChange], None]
    ) -> None:
        """
        Write what differs, one after the other; what was written before a refusal stays.

        :param wrote: called with each on the bus; an exception of it ends the writing.
        """
        for key, data in wanted.items():
            reason = write_forbidden(key, self._writer.value(key, data), self._state)
            if reason is not None:
                raise not_changed(key, reason)

        def learn(written: Written) -> None:
            self._learn(written.key, written.after, quiet=True)
            wrote(self._writer.describe(written))

        async with self._alone(wanted):
            await self._require_standstill(wanted)
            await self._writer.write_each(wanted, learn)

    @contextlib.asynccontextmanager
    async def left_to_the_drive(
        self, keys: Collection[str]
    ) -> AsyncIterator[Callable[[], Awaitable[tuple[ParameterChange, ...]]]]:
        """Let the drive change parameters itself; yield what reads which of them it changed."""
        before = {key: await self._params.read_data(key, Priority.SERVICE) for key in keys}

        async def changes() -> tuple[ParameterChange, ...]:
            found: list[ParameterChange] = []
            for key, old in before.items():
                data = await self._params.read_data(key, Priority.SERVICE)
                if key in self._data:
                    self._learn(key, data, quiet=True)
                if data != old:
                    found.append(self.describe(key, self._writer.value(key, old), data))
            self._desired.follow({change.key: change.new for change in found})
            return tuple(found)

        async with self._alone(keys):
            with self._state.changing_itself():
                yield changes

    #: The same for any thread.
    read = on_bus(read_now)
    change = on_bus(change_now)
    write_each = on_bus(write_each_now)

    @contextlib.asynccontextmanager
    async def _alone(self, keys: Collection[str]) -> AsyncIterator[None]:
        """Change parameters exclusively; they are not reported as changed meanwhile."""
        async with self._turn:
            self._changing = keys
            try:
                yield
            finally:
                self._changing = ()

    def _data_of(self, key: str, value: Value) -> bytes:
        if self._values.get(key) == value:
            return self._data[key]
        return self._params.encode(key, value)

    async def _require_standstill(self, data: Mapping[str, bytes]) -> None:
        new = [key for key, wanted in data.items() if self._data.get(key) != wanted]
        await self._writer.require_standstill(new)

    @on_bus
    async def apply(self, wanted: Mapping[str, Value], *, write: bool) -> None:
        """Take settings as the wanted ones, and report later drift; ``write``: write them now."""
        await self._desired.apply_now(wanted, write=write)

    @on_bus
    async def refresh(self) -> Report:
        """Read every parameter again; the answer says which have changed."""
        before = self._values
        keys = [key for key in self._keys if self._state.nameplate.has(key)]
        for key in keys:
            with contextlib.suppress(Refused):
                # an operator waits for it, so it takes turns with the polls
                await self._read(key, retry=True, priority=Priority.POLL)
        changed = [key for key in keys if before.get(key) != self._values.get(key)]
        return Report(Cause.SETTINGS_REFRESHED, count=len(keys), changed=tuple(changed))

    async def _read(self, key: str, *, retry: bool, priority: Priority = Priority.REFRESH) -> None:
        data = await self._params.read_data(key, priority, retry=retry)
        if key not in self._changing or key not in self._data:
            self._learn(key, data)

    def _learn(self, key: str, data: bytes, *, quiet: bool = False) -> None:
        """Take the value that the drive has of a parameter, and report a change."""
        own = self._params.is_own(key, data)
        same = self._data.get(key) == data
        # the same bytes mean another value where what scales them was changed
        if same and not self._state.model[key].scale:
            return
        # other threads may be reading the old ones
        self._data = {**self._data, key: data}
        values = dict(self._values)
        before = values.pop(key, None)
        try:
            values[key] = self._params.value(key, data)
        except ValueError as error:
            # and the value before no longer counts
            self._state.notify(Severity.WARNING, Cause.NOT_POSSIBLE, why=str(error))
        if same and values.get(key) == before:
            return
        self._values = values
        if not (quiet or same) and before is not None and key in values:
            change = ParameterChange(key, before, values[key], self._state.model[key].unit)
            self._report_change(change, own)
        try:
            self._on_change((key,))
        except Exception:
            _log.exception('a new value of %s could not be reported', key)

    def _report_change(self, change: ParameterChange, own: bool) -> None:
        if not self._desired.report_drift(change.key) and not own:
            self._state.notify(Severity.INFO, Cause.CHANGED_AT_DRIVE, change=change)
        if change.key in self._state.model.scaling and not own:
            self._on_scale(change)


class DesiredConfig:
    """The wanted settings of one drive; used on the bus, readable from anywhere."""

    def __init__(self, parameters: Parameters, state: DriveState) -> None:
        self._parameters = parameters
        self._state = state
        self.values: dict[str, Value] = {}

    @property
    def drift(self) -> tuple[ParameterChange, ...]:
        """What differs from the wanted settings, as wanted -> what the drive has."""
        data, values = self._parameters.data, self._parameters.values
        return tuple(
            self._parameters.describe(key, wanted, data[key])
            for key, wanted in self.values.items()
            if key in data and values.get(key) != wanted
        )

    def follow(self, changed: Mapping[str, Value]) -> None:
        """Take later changes by clients into the wanted settings, where those have the key."""
        self.values.update((key, changed[key]) for key in changed if key in self.values)

    def report_drift(self, key: str) -> bool:
        """Report that a parameter is not as wanted; false if it is."""
        for drift in self.drift:
            if drift.key == key:
                self._state.notify(Severity.WARNING, _not_as_wanted(drift))
                return True
        return False

    async def apply_now(self, wanted: Mapping[str, Value], *, write: bool) -> None:
        """
        Take settings as the wanted ones, and write them or only report how the drive differs.

        What cannot be written is logged, and stays reported as drift.
        """
        state = self._state
        here = {key: value for key, value in wanted.items() if key in self._parameters.data}
        self.values = {key: self._parameters.coerce(key, value) for key, value in here.items()}
        missing = [key for key in wanted if key not in here]
        if missing:
            state.notify(Severity.WARNING, Cause.WANTED_BUT_MISSING, keys=tuple(missing))
        drifts = self.drift
        while drifts:
            refused: list[ParameterError] = []
            for drift in drifts:
                if not write:
                    state.notify(Severity.WARNING, _not_as_wanted(drift))
                    continue
                try:
                    await self._parameters.change_now(
                        {drift.key: drift.old}, report_as=Cause.CHANGED_AS_WANTED
                    )
                except ParameterError as error:
                    refused.append(error)
            if len(refused) == len(drifts):
                for refusal in refused:
                    why = refusal.report
                    state.notify(Severity.ERROR, Cause.WANTED_BUT_REFUSED, why=why)
            # values that bound each other may come in any order
            drifts = self.drift if write and len(refused) < len(drifts) else ()


def _not_as_wanted(drift: ParameterChange) -> Report:
    has = f'{show(drift.new)} {drift.unit}'.rstrip()
    return Report(Cause.NOT_AS_WANTED, key=drift.key, has=has, wanted=show(drift.old))
