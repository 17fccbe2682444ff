# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is known of one drive: its status, and whether it responds."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
import contextlib
from dataclasses import replace
import logging
import math
from typing import NamedTuple

from nfo_sinus_driver.bus import Bus, Priority
from nfo_sinus_driver.catalog import Fact, Holder, InverterStatus, Kind, Meaning, Role, load_family
from nfo_sinus_driver.catalog.inverter_status import NO_CODE
from nfo_sinus_driver.catalog.status import FREQUENCY, PROCESS_VALUE, QUANTITIES, SPEED
from nfo_sinus_driver.drive.known.control_state import ControlTable
from nfo_sinus_driver.drive.known.direction import Direction
from nfo_sinus_driver.drive.known.drive_timeout import DriveTimeout
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Event, Report, Severity
from nfo_sinus_driver.drive.known.identity import Nameplate
from nfo_sinus_driver.drive.known.parameter_access import ParameterAccess
from nfo_sinus_driver.drive.known.settings import DriveSettings
from nfo_sinus_driver.drive.known.snapshot import NOT_MEASURED, Listener, Measured
from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, PortError, Refused, Reply

_log = logging.getLogger(__name__)

#: How long a drive may take to carry out a command, its start delay not counted, s.
TIMEOUT = 2.0
#: No drive is switched off and on, and answers, within less, s; a lost answer takes less.
SHORTEST_POWER_OFF = 0.4
#: How often the status is read while something is awaited, s.
LOOK_PERIOD = 0.02
#: How long before its own time-out stops it a silent drive is tried without a longer pause, s.
_LAST_CHANCE = 0.6
#: No start delay of a drive is longer, s.
_LONGEST_START_DELAY = 3600.0
#: A fault whose status comes so soon after the one before has come just now, s.
_SOON = 2.0
#: How long bus control is assumed to last, s, where it has to be read separately.
_BY_MODE_FOR = 1.0
#: And while the motor is enabled: a hand takes longer to take control and to give it back.
_BY_MODE_WHILE_ENABLED = 0.08
#: Settings that mean another drive, or another way to command it.
_FIXED = (
    'address',
    'block_address',
    'telegram_words',
    'drive_addresses',
    'model',
    'control_method',
    'reference',
    'scales',
)


def _nothing(*_: object) -> None:
    """Do nothing: no other part of the drive is concerned."""


class Hooks(NamedTuple):
    """
    What follows in other parts of a drive; the list of them is in ``drive.py``.

    :ivar status_arrived: a status word came with the answer to a set-point.
    :ivar request_missed: a request other than that of a poll was not answered.
    :ivar fault_came: a fault that was not active before.
    :ivar setpoint_refused: the drive takes no set-points any more, for this reason.
    :ivar motor_stopped: a stop of the motor was begun, for this reason.
    :ivar status_changed: a status was read, by a poll or not, that says otherwise than the last.
    :ivar changed: what else is published of the drive may have changed, measured values aside.
    """

    status_arrived: Callable[[Reply], None] = _nothing
    request_missed: Callable[[], None] = _nothing
    fault_came: Callable[[], None] = _nothing
    setpoint_refused: Callable[[Report], None] = _nothing
    motor_stopped: Callable[[Report], None] = _nothing
    status_changed: Callable[[], None] = _nothing
    changed: Callable[[], None] = _nothing


class DriveState:
    """What the driver knows of one drive; used on the bus alone, readable from anywhere."""

    def __init__(self, bus: Bus, settings: DriveSettings, listener: Listener) -> None:
        self.bus = bus
        self.settings = settings
        self.hooks = Hooks()
        #: What the driver is doing with it; nothing, where it only reads.
        self.control = ControlTable(bus.now)
        #: What the catalog knows of its family.
        self.model = load_family(
            settings.model,
            settings.method,
            settings.telegram_words,
            settings.telegram_speed,
            settings.own_parameters,
        )
        roles = self.model.roles
        only_speed = FREQUENCY.role not in roles and SPEED.role in roles
        #: What shows how fast the motor turns.
        self.turning = SPEED if only_speed else FREQUENCY
        #: Which way the motor turns, where the drive does not report that.
        self.direction = Direction()
        method = settings.method_class
        #: How long after the driver's last message a PLC stops the drive, s; 0: no PLC.
        self.plc_time = method.plc_time
        #: Its parameters.
        self.params = ParameterAccess(
            bus,
            settings.address,
            self.model,
            settings.retries,
            method.addressing,
            settings.block_address,
        )
        #: What is called with every poll and event.
        self.listener = listener
        #: Its identity, and what it has by that.
        self.nameplate = Nameplate(self.params, settings, self.notify)
        self.connected = False
        #: The last poll was answered; while it was not, no other request should wait for it.
        self.responsive = False
        #: It did not answer a request just before the last status.
        self.missed_reply = False
        #: How many requests had got no answer when the status was last read.
        self._unanswered = 0
        self.status: InverterStatus | None = None
        #: A request got no answer since the newest status, and before it.
        self._in_vain = self._asked_in_vain = False
        #: How far apart the last statuses were, s, the newest last.
        self._intervals: deque[float] = deque((0.0,), maxlen=4)
        #: The longest time without a valid frame before the newest one, s.
        self._alone = 0.0
        #: The status that first showed the active fault, and whether that had just come.
        self.fault: InverterStatus | None = None
        self.fault_is_fresh = False
        #: Measured values that were reported as impossible.
        self._reported_impossible: set[str] = set()
        #: What was polled last.
        self._polled: dict[Role, Measured] = {}
        self._measured: Mapping[str, float] = {}
        #: It is changing its parameters itself.
        self.tuning = False
        #: The code that the drive reports beside its word, while a procedure needs it; 0: not read.
        self._reported_code = 0
        #: The code of a fault or alarm that the status word does not name, and the one that does.
        self._resolved: tuple[int, int] | None = None
        self.control_mode = ''
        self.unit = ''
        #: Its communication time-outs.
        self.timeout = DriveTimeout(self.params, self.model, self.nameplate.has)

    async def read_status(
        self,
        priority: Priority,
        *,
        retry: bool = True,
        alarming: Callable[[InverterStatus], bool] = lambda _: False,
        received: Reply | None = None,
        code_for: float = 0.0,
    ) -> InverterStatus:
        """
        Read the status, without acknowledging anything.

        :param retry: repeat a request when there is no response.
        :param received: the status word, where it has just come with another answer.
        :param code_for: how long an inverter status counts, s, while the status word stays the
            same, if nothing was changing (:attr:`InverterStatus.plain`).
        :param alarming: whether a status of which one half is known may have to stop the motor; the
            rest is then read ahead of all else, unless that half is old.
        :raises LinkError: the drive does not answer.
        """
        if not self.nameplate.has(self.word_key):
            return await self._read_code(priority, retry)
        before = self.status
        if received is None:
            word, at = await self._read_int(self.word_key, priority, retry)
        else:
            word, at = self.status_word(received.data), received.arrived
        half = self.status_of_word(word, at)
        alarmed = before is not None and word != before.word and alarming(half)
        priority = Priority.LOOK if alarmed else priority
        if self.model.profile.status_word.code is not None:
            half = await self._with_fault_code(half, before, priority)
            status = await self._with_control(half, priority, retry)
            return await self._with_frequency(status, priority, retry)
        last = self.status
        if last is not None and last.word == word and at - last.code_at < code_for and last.plain:
            status = replace(last, at=at)
            if not alarming(status):
                return await self._with_frequency(status, priority, retry)
        code, code_at = await self._read_int(self.model.key(Role.STATUS_CODE), priority, retry)
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
        code_of = self.model.profile.status_word.code
        if code_of is None:
            return InverterStatus(at, word, NO_CODE, self.model)
        code = code_of(word)
        if self._resolved is not None and self._resolved[0] == code:
            code = self._resolved[1]
        elif Meaning.UNNAMED not in self.model.status_code(code).meanings:
            # the name of a fault is found otherwise: this may be from before it
            code = self._reported_code or code
        status = InverterStatus(at, word, code, self.model, code_at=at)
        return self._with_control_as_before(status)

    async def _with_fault_code(
        self, status: InverterStatus, before: InverterStatus | None, priority: Priority
    ) -> InverterStatus:
        """Name a fault that has just come, so that its first report has the name; one try."""
        key = self.model.key(Role.FAULT_CODE)
        has_come = before is None or before.code != status.code
        if not (has_come and status.means(Meaning.UNNAMED) and self.params.reaches(key)):
            return status
        if self.params.by_mailbox(key):
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
        key = self.model.key(Role.FAULT_CODE)
        number = await self.params.read_number(key, priority, retry=False)
        return self.model.profile.fault_code(int(number))

    async def read_reported_code(self, priority: Priority) -> None:
        """Read what the drive does, and show it with each status word until it is forgotten."""
        self._reported_code = await self.read_fault_code(priority)

    def forget_reported_code(self) -> None:
        """Show again what the status word shows alone."""
        self._reported_code = 0

    @property
    def unresolved_code(self) -> int:
        """The code of the fault or alarm that the status word does not name; 0: there is none."""
        code_of, status = self.model.profile.status_word.code, self.status
        if code_of is None or status is None or status.word is None:
            return 0
        code = code_of(status.word)
        return code if Meaning.UNNAMED in self.model.status_code(code).meanings else 0

    def resolve_fault(self, unresolved: int, code: int) -> None:
        """Take the name of a fault or alarm that the status word does not name; 0: it has none."""
        is_one = self.model.status_code(code).kind is not Kind.STATUS
        # where all codes are the drive's own numbers, one that is not listed names it, too
        names = code in self.model.status_codes or (code and self.model.unlisted is not None)
        self._resolved = (unresolved, code) if is_one and names else None

    @property
    def fault_resolved(self) -> bool:
        """The fault or alarm that the status word does not name has a name."""
        return self._resolved is not None

    def require_fresh(self, status: InverterStatus) -> None:
        """
        Make sure that a status is not older than ``lost_after``: a PLC may keep an old one.

        :raises DriveError: it is.
        """
        longest = self.settings.lost_after
        # a read of low priority waits for its turn, while others get newer ones
        newest = status.at if self.status is None else max(status.at, self.status.at)
        if self.plc_time and self.bus.now() - newest >= longest:
            raise DriveError(Cause.OLD_DATA, seconds=longest)

    async def wait_until(
        self,
        wanted: Callable[[InverterStatus], bool],
        priority: Priority = Priority.SERVICE,
        timeout: float | None = None,
    ) -> None:
        """
        Read the status until it is as wanted.

        :param timeout: how long it may take, s; by default :data:`TIMEOUT`.
        :raises DriveError: it takes longer.
        """
        deadline = self.bus.now() + (TIMEOUT if timeout is None else timeout)
        while not wanted(await self.read_status(priority)):
            if self.bus.now() > deadline:
                raise DriveError(self.report(Cause.NOT_CONFIRMED))
            await self.bus.sleep(LOOK_PERIOD)

    async def _with_frequency(
        self, status: InverterStatus, priority: Priority, retry: bool
    ) -> InverterStatus:
        """Add the frequency to a status, where its word shows no stop, or where it is free."""
        if not (status.by_frequency or self.model.profile.status_word.frequency_beside):
            return self._note_status(status)
        measured = await self._measured_with(status, self.status, priority, retry=retry)
        return self._note_status(measured)

    async def measured_with(
        self, status: InverterStatus, before: InverterStatus | None, *, retry: bool
    ) -> InverterStatus:
        """
        Return a status with the frequency, measured now unless it has come with it.

        :param before: the last one that was measured; what it fell from is in it.
        :param retry: repeat a request when there is no response.
        :raises LinkError: the drive does not answer.
        """
        has = self.nameplate.has(self.model.key(self.turning.role))
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
        role, hertz = self.turning.role, self.turning.hertz
        try:
            value = await self._measure(self.model.key(role), priority, retry, status)
        except Refused:
            value = math.nan
        self.polled(role, value)
        return status.with_frequency(value * hertz, before)

    async def _read_int(self, key: str, priority: Priority, retry: bool) -> tuple[int, float]:
        reply = await self.params.read_reply(key, priority, retry=retry)
        return int(self.params.number(key, reply.data)), reply.arrived

    @property
    def held_by_line(self) -> str:
        """Why control stays with the bus on this line, once taken; ``''``: it does not."""
        return self.model.profile.holds_control.get(self.params.protocol, '')

    @property
    def word_key(self) -> str:
        """The parameter that a status begins with; ``''`` if the model has none."""
        return self.model.key(Role.STATUS_WORD)

    def status_word(self, data: bytes) -> int:
        """Return the status word that bytes mean."""
        return int(self.params.number(self.word_key, data))

    async def _read_code(self, priority: Priority, retry: bool) -> InverterStatus:
        """Read the inverter status alone: older firmware has no status word [C21]."""
        code, at = await self._read_int(self.model.key(Role.STATUS_CODE), priority, retry)
        status = InverterStatus(at, None, code, self.model, code_at=at)
        return self._note_status(await self._with_control(status, priority, retry))

    def _with_control_as_before(self, status: InverterStatus) -> InverterStatus:
        before = self.status
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
        before = self.status
        same = before is not None and before.code == status.code
        enabled = self.control.enabled
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
        source = self.model.key(Role.CONTROL_SOURCE)
        reply = await self.params.read_reply(source, priority, retry=retry)
        holder = self.model.profile.holders.get(self.params.value(source, reply.data))
        by_bus = holder is Holder.BUS and not await self._operated_locally(priority, retry)
        return by_bus, reply.arrived

    async def _operated_locally(self, priority: Priority, retry: bool) -> bool:
        """Return whether keypad or terminals command, whatever the control source says."""
        key = self.model.key(Role.LOCAL_OPERATION)
        if not self.params.reaches(key):
            return False
        return bool(await self.params.read(key, priority, retry=retry))

    def _note_status(self, status: InverterStatus) -> InverterStatus:
        # a read of low priority may be overtaken by one that began later
        before = self.status
        if before is None or status.at >= before.at:
            self.status = status
            if not self.unresolved_code:
                self._resolved = None
            self._intervals.append(status.at - before.at if before else 0.0)
            self._alone = self.bus.silences.take_longest(self.settings.address)
            self._asked_in_vain, self._in_vain = self._in_vain, False
            self._note_fault(before)
            if before is None or before.tells_otherwise(status):
                self.hooks.status_changed()
        return status

    async def keep_alive(self) -> None:
        """Keep the drive from stopping by itself, with one request (LinkError: it failed)."""
        has_word = self.nameplate.has(self.word_key)
        key = self.word_key if has_word else self.model.key(Role.STATUS_CODE)
        await self.bus.keep_alive(self.settings.address, self.params.address(key))

    def pause_before_timeout(self, pause: float, timeout: float) -> float:
        """
        Return a pause, s, that leaves time for tries before a silent drive stops by itself.

        :param timeout: after which silence it does, s; 0: it does not.
        """
        strikes_in = self.bus.silences.last_frame_at(self.settings.address) + timeout
        strikes_in -= self.bus.now()
        if strikes_in <= 0:
            return pause
        return min(pause, max(strikes_in - _LAST_CHANCE, LOOK_PERIOD))

    @property
    def left_alone(self) -> bool:
        """Before the newest status the drive got no request for longer than its own time-out."""
        timeout = self.timeout
        alone = self._alone if not self._asked_in_vain else 0.0
        return timeout.stops_motor and 0 < timeout.shortest <= alone

    def may_have_restarted(self, silent: float) -> bool:
        """Return whether a drive that was silent for so long, s, may run again by itself."""
        return bool(self.model.profile.keeps_run) and silent >= SHORTEST_POWER_OFF

    @property
    def unheard(self) -> bool:
        """Before the newest status no frame came for as long as a loss takes, asked or not."""
        return self._alone >= self.settings.lost_after

    @property
    def usual_interval(self) -> float:
        """How far apart the statuses before the newest were, s."""
        return max(list(self._intervals)[:-1])

    def _note_fault(self, before: InverterStatus | None) -> None:
        status = self.status
        assert status is not None
        if not status.faulted:
            self.fault = None
        elif self.fault is None or self.fault.code != status.code:
            self.fault = status
            self.fault_is_fresh = before is not None and status.at - before.at < _SOON
            self.hooks.fault_came()

    def missed(self) -> None:
        """Note that a request failed; until it is known why, none should wait for it."""
        self.unanswered()
        self.hooks.request_missed()

    def answered(self) -> None:
        """Note that a poll was answered."""
        self.responsive = True

    def unanswered(self) -> None:
        """Note that a poll was not."""
        self.responsive = False
        self._in_vain = True

    def found(self) -> None:
        """Note that it is connected."""
        self.connected = self.responsive = True

    def lost(self) -> None:
        """Note that it is not connected any more."""
        self.connected = False

    @property
    def missed_since_status(self) -> bool:
        """It has not answered a request since the last status."""
        # one that was busy, or whose answer was damaged, has responded
        return self.params.unanswered > self._unanswered

    def status_read(self) -> None:
        """Note whether it did not answer a request just before the status read now."""
        self.missed_reply = self.missed_since_status
        self._unanswered = self.params.unanswered

    def use_hooks(self, hooks: Hooks) -> None:
        """Take what follows in other parts of the drive."""
        self.hooks = hooks

    def use(self, settings: DriveSettings) -> None:
        """
        Use other settings from now on.

        :raises ValueError: they mean another drive, or another way to command it.
        """
        for name in _FIXED:
            if getattr(settings, name) != getattr(self.settings, name):
                raise ValueError(f'{name} cannot change within a session: make another Drive')
        if settings.telegram_speed != self.settings.telegram_speed:
            raise ValueError('what a telegram means cannot change within a session')
        self.settings = settings

    @contextlib.contextmanager
    def changing_itself(self) -> Iterator[None]:
        """Note that the drive changes its parameters itself meanwhile, as when it tunes."""
        self.tuning = True
        try:
            yield
        finally:
            self.tuning = False

    async def measure(self, key: str, priority: Priority) -> float:
        """
        Read a measured value, without retries; NaN if there is none, or if it stays impossible.

        :param key: of its parameter; ``''``: there is none.
        :raises LinkError: it does not answer, or refuses.
        """
        return await self._measure(key, priority, False, self.status)

    async def _measure(
        self, key: str, priority: Priority, retry: bool, status: InverterStatus | None
    ) -> float:
        """Measure; where a speed has no sign, the status gives its direction."""
        if not key:
            return math.nan
        data = await self.params.read_data(key, priority, retry=retry)
        value = self.params.number(key, data)
        if await self.is_cut_off(key, value, priority, retry=retry):
            return math.nan
        if not self.params.is_odd(key):
            return self._signed(self.model.role_of.get(key), value, status)
        if key not in self._reported_impossible:
            self._reported_impossible.add(key)
            unit = self.model[key].unit
            shown = f'{value:g} {unit}'.rstrip()
            self.notify(Severity.WARNING, Cause.IMPOSSIBLE_VALUE, key=key, value=shown)
        return math.nan

    async def is_cut_off(
        self, key: str, value: float, priority: Priority, *, retry: bool
    ) -> bool:
        """
        Return whether a value says nothing, for 16 bits do not hold what it may be.

        Beyond them it stays at their end, or comes back with the other sign.
        """
        if key not in self.model.profile.narrow or not self.params.has_one_word(key):
            return False
        _, high, _ = self.params.limits(key)
        if 0 <= value < high:
            return False
        bound, times = self.model.profile.narrow[key]
        if not bound or value >= high:
            return True
        most = times * await self.params.read_number(bound, priority, retry=retry)
        return not -value <= most < high

    def _signed(self, role: Role | None, value: float, status: InverterStatus | None) -> float:
        """Return a measured value with the sign that the drive reports, or that is commanded."""
        word = self.model.profile.status_word
        if role not in word.sizes:
            return value
        if Fact.REVERSE in word.valid:
            # standstill has no direction
            return 0.0 - value if status is not None and Fact.REVERSE in status.facts else value
        if role is self.turning.role:
            self.direction.take(value * self.turning.hertz, self.bus.now())
        return self.direction.of(value)

    def shown(self, role: Role | None, value: float) -> float:
        """Return what is published of a measured value; NaN where its direction is not known."""
        word = self.model.profile.status_word
        known = role not in word.sizes or Fact.REVERSE in word.valid or self.direction.known
        return value if known or value == 0 else math.nan

    @property
    def measured_keys(self) -> tuple[str, ...]:
        """The parameters whose values are measured beside the telemetry."""
        named = tuple(filter(None, self.settings.measured))
        return named or tuple(filter(self.params.reaches, self.model.profile.measured))

    def polled(self, role: Role, value: float) -> None:
        """Note what a poll has just measured."""
        self._polled[role] = Measured(value, self.bus.now())

    def note_measured(self, values: Mapping[str, float]) -> None:
        """Note what was measured beside the telemetry, by key."""
        self._measured = values

    def forget_polled(self) -> None:
        """Forget what was polled: another drive may be there now."""
        self._polled.clear()
        self._measured = {}

    @property
    def own_setpoint(self) -> float:
        """The set-point that the drive follows, in the unit of its control mode; NaN if none."""
        target = self.model.profile.setpoints.get(self.control_mode)
        if target is None:
            return math.nan
        return self._measured.get(target.followed or target.key, math.nan)

    def last_polled(self, role: Role | None) -> Measured:
        """Return what a poll has measured last; the speed may follow from the frequency."""
        pole_pairs = self.model.profile.pole_pairs
        if role is Role.ACTUAL_SPEED and pole_pairs and role not in self.model.roles:
            frequency, at = self.last_polled(Role.ACTUAL_FREQUENCY)
            return Measured(60 * frequency / pole_pairs, at)
        return NOT_MEASURED if role is None else self._polled.get(role, NOT_MEASURED)

    @property
    def controlled(self) -> Role | None:
        """The actual value of what the control mode controls, measured with every poll."""
        quantity = QUANTITIES.get(self.control_mode)
        return quantity and quantity.role

    @property
    def turned(self) -> Measured:
        """How fast the motor turns, as a poll has measured it last, Hz."""
        value, at = self.last_polled(self.turning.role)
        return Measured(value * self.turning.hertz, at)

    @property
    def frequency(self) -> float:
        """The frequency as last polled, Hz."""
        return self.last_polled(Role.ACTUAL_FREQUENCY).value

    @property
    def speed(self) -> float:
        """The speed as last polled, rpm."""
        return self.last_polled(Role.ACTUAL_SPEED).value

    async def read_control_mode(
        self, priority: Priority = Priority.SERVICE, *, retry: bool = True
    ) -> str:
        """
        Read which quantity is controlled: ``Freque``, ``Speed``, ``Torque`` or ``PI-Reg``.

        Where no parameter shows it ([C58]), it is the one that the settings expect.
        """
        key = self.model.key(Role.CONTROL_MODE)
        expected = self.settings.expected_control_mode or next(iter(self.model.profile.setpoints))
        if not self.params.reaches(key):
            mode = expected
        elif self.params.by_mailbox(key):
            mode = await self._read_mode_by_mailbox(key, priority, self.control_mode or expected)
        else:
            mode = str(await self.params.read(key, priority, retry=retry))
        unit = QUANTITIES[mode].unit if mode in QUANTITIES else ''
        if mode == PROCESS_VALUE.mode and not self.params.in_block:
            key = self.model.key(Role.PROCESS_UNIT)
            unit = str(await self.params.read(key, priority, retry=retry))
        # both at once: neither is published without the other
        self.control_mode, self.unit = mode, unit
        return mode

    async def _read_mode_by_mailbox(self, key: str, priority: Priority, known: str) -> str:
        """Read it by the mailbox of a PLC, which is slow: not in a poll, and without retries."""
        if priority is not Priority.SERVICE:
            return known
        try:
            return str(await self.params.read(key, priority, retry=False))
        except PortError:
            raise
        except (LinkError, DriveError):
            return known

    async def coasts_to_stop(self) -> bool | None:
        """Return whether an ordinary stop releases the motor [C97]; ``None``: it is not known."""
        key = self.model.key(Role.STOP_MODE)
        if self.params.reaches(key):
            return await self.params.read(key, Priority.STOP) == self.model.profile.releases
        status = self.status
        if status is None or Fact.STOP_MODE_BRAKE not in status.valid:
            return None
        return Fact.STOP_MODE_BRAKE not in status.facts

    async def read_start_delay(self) -> float:
        """Read how long the drive waits after a run command, s; if unknown, an hour."""
        key = self.model.key(Role.START_DELAY)
        if self.params.reaches(key):
            return await self.params.read_number(key, Priority.SERVICE)
        return _LONGEST_START_DELAY

    async def read_start_braking(self) -> float:
        """Read how long the drive brakes the motor before it starts, s; if unknown, 0."""
        key = self.model.key(Role.START_BRAKING)
        if not self.nameplate.has(key):
            return 0.0
        return await self.params.read_number(key, Priority.SERVICE)

    async def read_stop_braking(self) -> float:
        """Read how long the drive brakes a motor that has stopped, s; if unknown, 0."""
        key = self.model.key(Role.STOP_BRAKING)
        if not self.nameplate.has(key):
            return 0.0
        return await self.params.read_number(key, Priority.LOOK)

    @property
    def kind(self) -> Kind:
        """Whether the inverter status is a fault, an alarm or neither."""
        return Kind.STATUS if self.status is None else self.status.kind

    @property
    def text(self) -> str:
        """The inverter status as on the display."""
        return '' if self.status is None else self.text_of(self.status)

    def text_of(self, status: InverterStatus) -> str:
        """Return a status as on the display; one that the manual does not list, as its number."""
        if status.unknown and status.code_is_of_word:
            return f'Unknown status {status.word:04X}h'
        return self.nameplate.text_of(status.code)

    def describe(self) -> str:
        """Return code and text of the inverter status; ``''`` before it was read."""
        return '' if self.status is None else f'{self.status.code} {self.text}'

    def report(self, cause: Cause, **values: object) -> Report:
        """Return a report with the inverter status and the name of the enable input."""
        named = self.model.profile.enable_input
        return Report(cause, status=self.describe(), enable_input=named, **values)

    def notify(self, severity: Severity, what: Report | Cause, /, **values: object) -> None:
        """Report to the listener; an error of the listener is only logged."""
        report = what if isinstance(what, Report) else Report(what, **values)
        code = None if self.status is None else self.status.code
        try:
            self.listener.on_event(Event(severity, report, code))
        except Exception:
            _log.exception('not reported: %s', report)
