# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the view shows, wherever it comes from: the graph of ROS, or the line itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from enum import Enum
import math
from typing import Any, Protocol

NAN = math.nan


class Condition(Enum):
    """How a drive is, in one word; the first that is true counts."""

    #: Nothing is reported of it any more: its driver has ended, or the graph is torn.
    GONE = 'gone'
    #: The drive does not answer.
    SILENT = 'silent'
    FAULT = 'fault'
    ALARM = 'alarm'
    #: The motor turns, or may.
    RUNS = 'running'
    STANDS = 'standing'


@dataclass(frozen=True)
class Measured:
    """What is measured, in the units of the message Telemetry; NaN: not known."""

    frequency: float = NAN
    speed: float = NAN
    output_current: float = NAN
    output_voltage: float = NAN
    output_power: float = NAN
    torque: float = NAN
    dc_link_voltage: float = NAN
    motor_temperature: float = NAN


#: How a line is doing, or one drive on it: what has the fields of the message BusStatistics.
Figures = Any


@dataclass(frozen=True)
class DriveView:
    """
    One drive.

    :ivar name: as one would type it: a node, or an address.
    :ivar status: code and text, as on the display.
    :ivar cause: what the status means, where there is more to say than its text.
    :ivar remedy: what to do about it.
    :ivar age: s since it was last reported.
    :ivar line: how the line does with this drive; None: not known.
    :ivar errors: its error log, an entry a line, newest first, or why there is none.
    """

    name: str
    condition: Condition
    status: str = ''
    cause: str = ''
    remedy: str = ''
    requires_ack: bool = False
    enabled: bool = False
    setpoint: float = NAN
    actual: float = NAN
    unit: str = ''
    age: float = 0.0
    measured: Measured = field(default_factory=Measured)
    line: Figures | None = None
    errors: Sequence[str] = ()


def error_line(code: int, text: str, operating_time: float, at: float) -> str:
    """
    Return one entry of an error log.

    :param operating_time: h; :param at: when, s of ``time.time``; NaN: not known.
    """
    parts = [f'{code} {text}']
    if not math.isnan(at):
        parts.append(f'{datetime.fromtimestamp(at):%Y-%m-%d %H:%M}')
    if not math.isnan(operating_time):
        parts.append(f'at {operating_time:.1f} h of operation')
    return ', '.join(parts)


class Level(Enum):
    """How much a note matters."""

    INFO = 'info'
    WARNING = 'warning'
    ERROR = 'error'


@dataclass(frozen=True)
class Note:
    """A line of the log: when (s of ``time.time``, NaN: unknown), who, what."""

    at: float
    level: Level
    who: str
    text: str


@dataclass(frozen=True)
class Picture:
    """
    All there is to show.

    :ivar lines: each by its name.
    :ivar notes: only those that are new.
    :ivar stops: what is to be known of stops that were asked for here and are not confirmed.
    """

    drives: Sequence[DriveView]
    lines: Mapping[str, Figures]
    notes: Sequence[Note]
    stops: Sequence[str] = ()


class Source(Protocol):
    """Where pictures come from; used by one thread, and nothing here waits."""

    #: What is looked at, such as a domain or a port.
    title: str
    #: What to do while there is no drive.
    advice: str
    #: Why nothing can be stopped or acknowledged from here; empty: it can.
    only_looks: str

    def next_picture(self) -> Picture:
        """Return what is so now."""

    def stop(self, name: str) -> None:
        """Ask that a drive be stopped; a note reports what came of it."""

    def stop_all(self) -> None:
        """Ask that all be stopped; a note reports what came of it."""

    def acknowledge(self, name: str) -> None:
        """Ask that the fault of a drive be acknowledged; a note reports what came of it."""

    def read_errors(self, name: str) -> None:
        """Ask that the error log of a drive be read; a later picture has it."""
