# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The figures of an operating record, and the text in which they are kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
import enum
import json
import math
from typing import Any

#: Nanoseconds of an hour, millijoules of a kWh.
NS_OF_HOUR = 3600 * 10**9
MJ_OF_KWH = 3_600_000_000

#: The highest of each of these is kept, with its unit; names as in the message Telemetry.
HIGHEST = {
    'motor_temperature': '%', 'pt1000_temperature': 'degC', 'torque': '%', 'output_current': 'A',
}


class EnergySource(enum.IntEnum):
    """Where the energy comes from; the codes are those of OperatingRecord."""

    NONE = 0
    COUNTER = 1
    POWER = 2


@dataclass
class Fault:
    """
    How often a fault came.

    :ivar text: its name, as on the display.
    :ivar last: when it came last, s since 1970.
    """

    count: int = 0
    text: str = ''
    last: float = 0.0


@dataclass
class Figures:
    """
    What was counted since a moment, in whole numbers: their sums are exact.

    :ivar since: that moment, s since 1970.
    :ivar powered: how long the drive was connected, ns.
    :ivar running: how long its motor was driven, ns.
    :ivar stops: how often the motor was stopped, by the name of the reason.
    :ivar faults: by their codes.
    :ivar energy: mJ; ``None``: nothing tells it.
    :ivar highest: the highest of what was measured, by the names in :data:`HIGHEST`.
    :ivar line_errors: requests without an answer, and damaged answers.
    :ivar longest_silence: the longest time between two statuses, or to a loss, in which a request
        was in vain, s.
    """

    since: float
    powered: int = 0
    running: int = 0
    starts: int = 0
    reversals: int = 0
    stops: Counter[str] = field(default_factory=Counter)
    faults: dict[int, Fault] = field(default_factory=dict)
    energy: int | None = None
    highest: dict[str, float] = field(default_factory=dict)
    line_errors: int = 0
    longest_silence: float = 0.0

    @property
    def powered_time(self) -> float:
        """How long the drive was connected, h."""
        return self.powered / NS_OF_HOUR

    @property
    def running_time(self) -> float:
        """How long its motor was driven, h."""
        return self.running / NS_OF_HOUR

    @property
    def energy_kwh(self) -> float:
        """The energy, kWh; NaN: nothing tells it."""
        return math.nan if self.energy is None else self.energy / MJ_OF_KWH

    def add_energy(self, millijoules: int) -> None:
        """Add energy, mJ; 0 where it is known from now on."""
        self.energy = (self.energy or 0) + millijoules

    def add_fault(self, code: int, text: str, at: float) -> None:
        """Count a fault that came at a moment, s since 1970."""
        count = self.faults[code].count if code in self.faults else 0
        self.faults[code] = Fault(count + 1, text, at)

    def see(self, name: str, value: float) -> None:
        """Keep a measured value if it is the highest so far."""
        if value > self.highest.get(name, -math.inf):
            self.highest[name] = value

    def followed_by(self, later: Figures) -> Figures:
        """Return these with what was counted later."""
        faults = {code: replace(fault) for code, fault in self.faults.items()}
        for code, fault in later.faults.items():
            count = faults[code].count if code in faults else 0
            faults[code] = replace(fault, count=count + fault.count)
        known = [energy for energy in (self.energy, later.energy) if energy is not None]
        both = (self.highest, later.highest)
        return Figures(
            self.since,
            self.powered + later.powered,
            self.running + later.running,
            self.starts + later.starts,
            self.reversals + later.reversals,
            self.stops + later.stops,
            faults,
            sum(known) if known else None,
            {name: max(h[name] for h in both if name in h) for name in {**both[0], **both[1]}},
            self.line_errors + later.line_errors,
            max(self.longest_silence, later.longest_silence),
        )


@dataclass
class Record:
    """
    The operating record of one drive.

    :ivar drive: its name: family and serial number, or the place where it is connected.
    :ivar serial: its serial number; ``''``: it has none that can be read, so that another drive at
        its place is counted here, too.
    :ivar total: what was counted since the record began.
    :ivar shift: what was counted since the shift began.
    :ivar counters: the last reading of each energy counter of the drive, kWh.
    :ivar fault: the code of the fault that was active last; ``None``: none was.
    """

    drive: str
    serial: str
    total: Figures
    shift: Figures
    counters: dict[str, float] = field(default_factory=dict)
    fault: int | None = None

    @classmethod
    def begun(cls, drive: str, serial: str, now: float) -> Record:
        """Return a new one (now: s since 1970)."""
        return cls(drive, serial, Figures(now), Figures(now))

    @property
    def energy_source(self) -> EnergySource:
        """Where the energy comes from."""
        if self.counters:
            return EnergySource.COUNTER
        return EnergySource.NONE if self.total.energy is None else EnergySource.POWER

    def begin_shift(self, now: float) -> Figures:
        """Count for the shift from now on (s since 1970); return the shift that has ended."""
        ended, self.shift = self.shift, Figures(now)
        if self.total.energy is not None:
            self.shift.add_energy(0)
        return ended

    def followed_by(self, later: Record) -> Record:
        """Return this one with what was counted in another, which began later."""
        new_shift = later.shift.since != later.total.since
        return Record(
            self.drive,
            self.serial,
            self.total.followed_by(later.total),
            later.shift if new_shift else self.shift.followed_by(later.shift),
            {**self.counters, **later.counters},
            later.fault,
        )

    def encoded(self) -> bytes:
        """Return the content of its file."""
        facts = {
            'drive': self.drive,
            'serial': self.serial,
            'total': _facts(self.total),
            'shift': _facts(self.shift),
            'counters': self.counters,
            'fault': self.fault,
        }
        return json.dumps(facts, indent=1).encode()


def decoded(data: bytes) -> Record:
    """Return the record of a file (ValueError: it is damaged); what a file lacks is 0."""
    try:
        facts = json.loads(data)
        return Record(
            _text(facts['drive']),
            _text(facts['serial']),
            _figures(facts['total']),
            _figures(facts['shift']),
            {_text(name): _number(kwh) for name, kwh in facts.get('counters', {}).items()},
            None if facts.get('fault') is None else _count(facts['fault']),
        )
    except (AttributeError, KeyError, RecursionError, TypeError) as error:
        raise ValueError(repr(error)) from error


def _facts(figures: Figures) -> dict[str, Any]:
    facts = dict(vars(figures))
    facts['faults'] = {str(code): vars(fault) for code, fault in figures.faults.items()}
    return facts


def _figures(facts: Mapping[str, Any]) -> Figures:
    energy = facts.get('energy')
    return Figures(
        since=_moment(facts['since']),
        stops=Counter(_each(facts.get('stops', {}), str, _count)),
        faults=_each(facts.get('faults', {}), _code, _fault),
        energy=None if energy is None else _count(energy),
        highest=_each(facts.get('highest', {}), str, _number),
        longest_silence=_moment(facts.get('longest_silence', 0.0)),
        **{
            name: _count(facts.get(name, 0))
            for name in ('powered', 'running', 'starts', 'reversals', 'line_errors')
        },
    )


def _each(facts: Any, key: Callable[[str], Any], value: Callable[[Any], Any]) -> dict[Any, Any]:
    return {key(name): value(fact) for name, fact in facts.items()}


def _fault(facts: Mapping[str, Any]) -> Fault:
    return Fault(_count(facts['count']), _text(facts['text']), _moment(facts['last']))


def _code(name: str) -> int:
    return _count(int(name))


def _text(fact: object) -> str:
    if not isinstance(fact, str):
        raise ValueError(f'{fact!r} is no text')
    return fact


def _count(fact: object) -> int:
    if type(fact) is not int or not 0 <= fact < 2**63:
        raise ValueError(f'{fact!r} is no count')
    return fact


def _number(fact: object) -> float:
    if isinstance(fact, bool) or not isinstance(fact, (int, float)) or not abs(fact) < 1e15:
        raise ValueError(f'{fact!r} is no number')
    return float(fact)


def _moment(fact: object) -> float:
    seconds = _number(fact)
    if not 0 <= seconds < 2**31:
        raise ValueError(f'{fact!r} is no time')
    return seconds
