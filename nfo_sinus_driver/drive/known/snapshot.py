# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a drive publishes: immutable snapshots of one moment."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from datetime import datetime
import math
from typing import NamedTuple

from nfo_sinus_driver.catalog import InverterStatus, Kind, Role
from nfo_sinus_driver.drive.known.events import Event, Report
from nfo_sinus_driver.drive.known.stop_reason import StopReason, reason_of
from nfo_sinus_driver.link import Clock

NAN = math.nan


class Measured(NamedTuple):
    """
    A measured value; NaN where there is none.

    :ivar at: when it arrived, s of the clock of the bus; minus infinity before the first.
    """

    value: float = NAN
    at: float = -math.inf


NOT_MEASURED = Measured()


@dataclass(frozen=True)
class Snapshot:
    """
    One poll of a drive, or what has changed since; NaN where nothing was measured.

    :ivar at: when the status arrived, s of the clock of the bus.
    :ivar status: ``None`` while the drive is not connected.
    :ivar control_mode: the manual's label, ``''`` while unknown.
    :ivar unit: of ``setpoint`` and ``actual``.
    :ivar setpoint: what the drive was last given, NaN while it was given none.
    :ivar setpoint_age: s since the newest valid set-point came in; NaN if none did.
    :ivar frequency: Hz, as last measured, which was at ``frequency_at``.
    :ivar speed: rpm, likewise.
    :ivar text: the inverter status as on the display.
    :ivar kind: its kind; the fault bit decides [C95].
    :ivar stop: why the motor was stopped last; ``None`` before the first time, and while it is
        enabled and set-points arrive.
    :ivar polled: a poll has measured it just now. Else it is there because something else has
        changed, and the measured values are those of the last poll: no time tells that apart, for
        a poll does not measure each of them.
    """

    at: float
    connected: bool
    enabled: bool
    control_method: str
    status: InverterStatus | None = None
    control_mode: str = ''
    unit: str = ''
    setpoint: float = NAN
    setpoint_age: float = NAN
    setpoint_clamped: bool = False
    actual: float = NAN
    frequency: float = NAN
    frequency_at: float = -math.inf
    speed: float = NAN
    speed_at: float = -math.inf
    text: str = ''
    description: str = ''
    remedy: str = ''
    kind: Kind = Kind.STATUS
    requires_ack: bool = False
    stop: Report | None = None
    polled: bool = True

    def shows_the_same(self, other: Snapshot) -> bool:
        """Return whether another one shows the same, but for measured values and times."""
        return self._known == other._known

    @property
    def _known(self) -> tuple[object, ...]:
        status = self.status
        shown = () if status is None else (status.shown_word, status.facts, status.code)
        return (
            self.connected,
            self.enabled,
            self.control_mode,
            self.unit,
            self.setpoint,
            self.setpoint_clamped,
            self.text,
            self.kind,
            self.stop,
            *shown,
        )

    @property
    def stop_reason(self) -> StopReason:
        """Which kind of reason that is."""
        return reason_of(self.stop)


@dataclass(frozen=True)
class Telemetry:
    """
    Measured values, NaN where there is none.

    :ivar at: when the last one arrived, s of the clock of the bus.
    :ivar values: those that every family may have, by role.
    :ivar measured: those that the setting ``measured`` names, by key.
    """

    at: float
    values: Mapping[Role, float]
    measured: Mapping[str, float] = field(default_factory=dict)


class Listener:
    """Receives what is published; called by the bus worker, which it must not keep waiting."""

    def on_snapshot(self, snapshot: Snapshot) -> None:
        """Take the result of a poll."""

    def on_telemetry(self, telemetry: Telemetry) -> None:
        """Take measured values."""

    def on_parameters(self, keys: Collection[str]) -> None:
        """Note that these settings of the drive have new values."""

    def on_log_entry(self, entry: LogEntry) -> None:
        """Take a new entry of the drive's error log."""

    def on_event(self, event: Event) -> None:
        """Take what an operator should know."""


@dataclass(frozen=True)
class LogEntry:
    """
    One entry of the error log.

    :ivar code: as the inverter status has it.
    :ivar text: as on the display.
    :ivar operating_time: the drive's operating time when it happened, h; NaN if unknown.
    :ivar age: operating hours ago; NaN if unknown.
    :ivar at: when it happened, s of the clock of the bus, if it came while the log was watched, or
        the drive has had power ever since; else NaN.
    :ivar readings: what the drive has kept of that moment, such as ``DC link 540 V``.
    :ivar latest: it cannot have been later, s of the clock of the bus; NaN if there is no age.
    :ivar now: the clock of the bus.
    """

    code: int
    text: str
    operating_time: float = math.nan
    age: float = math.nan
    at: float = math.nan
    latest: float = math.nan
    readings: tuple[str, ...] = ()
    now: Clock = field(default=lambda: NAN, repr=False, compare=False)

    @property
    def wall_time(self) -> str:
        """The local time, such as ``2026-11-21 17:02``, or that time ``or before``."""
        if not math.isnan(self.at):
            return self._local(self.at)
        latest = '' if math.isnan(self.latest) else self._local(self.latest)
        return f'{latest} or before' if latest else ''

    @property
    def full_text(self) -> str:
        """The text, and what the drive has kept of that moment."""
        return f'{self.text} ({", ".join(self.readings)})' if self.readings else self.text

    def __str__(self) -> str:
        if math.isnan(self.operating_time):
            return f'{self.code} {self.full_text}'
        # a wall time that is known is more exact
        known = math.isnan(self.age) or not math.isnan(self.at)
        age = '' if known else f', {self.age:.1f} operating hours ago'
        wall_time = f' ({self.wall_time})' if self.wall_time else ''
        return f'{self.code} {self.text} at {self.operating_time:.1f} h{age}{wall_time}'

    def _local(self, at: float) -> str:
        try:
            # as the computer has it now: its time may have been set since
            moment = datetime.fromtimestamp(datetime.now().timestamp() - self.now() + at)
        except (ValueError, OverflowError, OSError):
            # no calendar goes back so far: the operating time is nonsense
            return ''
        return moment.isoformat(' ', 'minutes')
