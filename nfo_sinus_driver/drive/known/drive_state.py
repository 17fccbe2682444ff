# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is known of one drive, and what follows from it in its other parts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import logging
import math
from typing import NamedTuple

from nfo_sinus_driver.bus import Bus, Priority
from nfo_sinus_driver.catalog import Fact, InverterStatus, Kind, Role, load_family
from nfo_sinus_driver.catalog.status import PROCESS_VALUE, QUANTITIES
from nfo_sinus_driver.drive.known.contact import Contact, ContactEvent
from nfo_sinus_driver.drive.known.control_state import ControlTable
from nfo_sinus_driver.drive.known.drive_timeout import DriveTimeout
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Event, Report, Severity
from nfo_sinus_driver.drive.known.identity import Nameplate
from nfo_sinus_driver.drive.known.measurements import Measurements
from nfo_sinus_driver.drive.known.parameter_access import ParameterAccess
from nfo_sinus_driver.drive.known.settings import DriveSettings
from nfo_sinus_driver.drive.known.snapshot import Listener
from nfo_sinus_driver.drive.known.status_reader import StatusReader
from nfo_sinus_driver.link import LinkError, PortError, Reply

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
        method = settings.method_class
        #: How long after the driver's last message a PLC stops the drive, s; 0: no PLC.
        self.plc_time = method.plc_time
        #: Whether it answers, and whether it is the same one.
        self.contact = Contact(
            bus,
            settings.address,
            lambda: self.settings.lost_after,
            self.model.profile.enable_input,
        )
        #: Its parameters.
        self.params = ParameterAccess(
            bus,
            settings.address,
            self.model,
            settings.retries,
            self.contact,
            method.addressing,
            settings.block_address,
        )
        #: What is called with every poll and event.
        self.listener = listener
        #: Its identity, and what it has by that.
        self.nameplate = Nameplate(self.params, settings, self.notify)
        #: What was measured of it.
        self.measurements = Measurements(self.params, self.model, bus.now, self.notify)
        #: Reads its status.
        self.reader = StatusReader(
            self.params,
            self.nameplate,
            self.measurements,
            self.control,
            lambda: self.status,
            self._note_status,
        )
        self.status: InverterStatus | None = None
        #: The status that first showed the active fault, and whether that had just come.
        self.fault: InverterStatus | None = None
        self.fault_is_fresh = False
        #: It is changing its parameters itself.
        self.tuning = False
        self.control_mode = ''
        self.unit = ''
        #: Its communication time-outs.
        self.timeout = DriveTimeout(self.params, self.model, self.nameplate.has)

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
        while not wanted(await self.reader.read(priority)):
            if self.bus.now() > deadline:
                raise DriveError(self.report(Cause.NOT_CONFIRMED))
            await self.bus.sleep(LOOK_PERIOD)

    @property
    def held_by_line(self) -> str:
        """Why control stays with the bus on this line, once taken; ``''``: it does not."""
        return self.model.profile.holds_control.get(self.params.protocol, '')

    def _note_status(self, status: InverterStatus) -> None:
        # a read of low priority may be overtaken by one that began later
        before = self.status
        if before is None or status.at >= before.at:
            self.status = status
            self.contact.note_status(status.at - before.at if before else 0.0)
            self._note_fault(before)
            if before is None or before.tells_otherwise(status):
                self.hooks.status_changed()

    async def keep_alive(self) -> None:
        """Keep the drive from stopping by itself, with one request (LinkError: it failed)."""
        has_word = self.nameplate.has(self.reader.word_key)
        key = self.reader.word_key if has_word else self.model.key(Role.STATUS_CODE)
        await self.bus.keep_alive(self.settings.address, self.params.address(key))

    def pause_before_timeout(self, pause: float, timeout: float) -> float:
        """
        Return a pause, s, that leaves time for tries before a silent drive stops by itself.

        :param timeout: after which silence it does, s; 0: it does not.
        """
        strikes_in = self.contact.last_frame_at + timeout - self.bus.now()
        if strikes_in <= 0:
            return pause
        return min(pause, max(strikes_in - _LAST_CHANCE, LOOK_PERIOD))

    @property
    def left_alone(self) -> bool:
        """Before the newest status the drive got no request for longer than its own time-out."""
        timeout, alone = self.timeout, self.contact.left_alone_for
        return timeout.stops_motor and 0 < timeout.shortest <= alone

    def may_have_restarted(self, silent: float) -> bool:
        """Return whether a drive that was silent for so long, s, may run again by itself."""
        return self.model.profile.may_run_again and silent >= SHORTEST_POWER_OFF

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
        self.contact.dispatch(ContactEvent.MISSED)
        self.hooks.request_missed()

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

    @property
    def measured_keys(self) -> tuple[str, ...]:
        """The parameters whose values are measured beside the telemetry."""
        named = tuple(filter(None, self.settings.measured))
        return named or tuple(filter(self.params.reaches, self.model.profile.measured))

    @property
    def own_setpoint(self) -> float:
        """The set-point that the drive follows, in the unit of its control mode; NaN if none."""
        target = self.model.profile.setpoints.get(self.control_mode)
        if target is None:
            return math.nan
        return self.measurements.beside.get(target.followed or target.key, math.nan)

    @property
    def controlled(self) -> Role | None:
        """The actual value of what the control mode controls, measured with every poll."""
        quantity = QUANTITIES.get(self.control_mode)
        return quantity and quantity.role

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
