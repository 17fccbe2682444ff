# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a bag says of drives: curves, spans, calls, and why they stopped."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
import dataclasses
from dataclasses import dataclass, field
from datetime import datetime
import functools
import math
from pathlib import Path
from typing import Any

from nfo_sinus_driver.node.bags import bags
from nfo_sinus_driver.node.drive.callers import COMMANDS

_EVENT = '/_service_event'
_STATUS = 'nfo_sinus_msgs/msg/DriveStatus'
_BUS = 'nfo_sinus_bus'
#: The topics of a drive that are read, besides its service events.
_READ = ('status', 'setpoint', 'actual_speed', 'telemetry', 'inv_st')
#: Those of all drives.
_COMMON = ('/diagnostics', '/rosout')
#: What the states of DriveStatus mean for the motor.
_PHASE_OF_STATE = {
    'OPERATION_ENABLED': 'running',
    'STOPPING': 'stopping',
    'QUICK_STOP': 'stopping',
    'FAULT_REACTION_ACTIVE': 'fault',
    'FAULTED': 'fault',
}
_REASON = 'REASON_'
#: Below this part of the highest speed of a run a motor stands.
_STANDS = 0.05
_CALLED_BY = ' called by '
#: A reason that a later status gives is a better one for the same stop, not that of another one.
_BETTER = {
    ('drive lost', 'power cycle'), ('setpoint refused', 'fault'),
    ('setpoint refused', 'drive timeout'),
}


@dataclass
class Curve:
    """Values over time, s since the run began."""

    times: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def add(self, time: float, value: float) -> None:
        """Append a point."""
        self.times.append(time)
        self.values.append(value)

    def broken_at(self, moments: Iterable[float]) -> Curve:
        """Return a curve without a line through moments at which nothing is known."""
        gaps = ((moment, math.nan) for moment in moments)
        known = zip(self.times, self.values, strict=True)
        points = sorted((*known, *gaps), key=lambda point: point[0])
        return Curve([time for time, _ in points], [value for _, value in points])


@dataclass(frozen=True)
class Span:
    """Something that held for a while, s since the run began; a fault has a code."""

    begin: float
    end: float
    what: str
    code: int = 0


@dataclass(frozen=True)
class Call:
    """A command that was called, s since the run began, and what was answered, if that is known."""

    time: float
    name: str
    answer: str = ''


@dataclass(frozen=True)
class Stop:
    """
    A stop of the motor, s since the run began.

    :ivar reason: such as ``setpoint timeout``: the constant of DriveStatus in small letters.
    :ivar text: the same in words, with who requested it.
    """

    time: float
    reason: str
    text: str


@dataclass(frozen=True)
class Recording:
    """
    What a bag says of the run of a drive.

    :ivar drive: the full name of its node.
    :ivar began: when the first drive was connected; times are counted from there, s.
    :ivar source: the bag, its messages and its topics.
    :ivar unit: of the set-point and of what follows it.
    :ivar identity: model, serial number and firmware, as far as the drive reports them.
    :ivar connected: when the drive answered.
    :ivar phases: what the motor did: standby, running, stopping or fault; lost: not known.
    :ivar texts: what the drive's display said.
    :ivar faults: of the texts, those that name a fault.
    :ivar unknown: when it was not known how fast the motor turned: the drive did not tell, or had
        released it, and reported the 0 of its output.
    :ivar enabled: when the driver followed set-points.
    :ivar calls: which services were called, and when.
    :ivar logged: what the log says of calls, with who called.
    :ivar stops: when the motor was stopped, and why.
    """

    drive: str
    began: datetime
    length: float
    remarks: dict[str, str]
    source: str
    unit: str
    identity: list[str]
    setpoint: Curve
    actual: Curve
    speed: Curve
    current: Curve
    connected: list[Span]
    phases: list[Span]
    texts: list[Span]
    faults: list[Span]
    unknown: list[Span]
    enabled: list[Span]
    calls: list[Call]
    logged: list[Call]
    stops: list[Stop]


def drives_in(folder: Path) -> list[str]:
    """Return the names of the drives in a bag, in order; a ValueError if there is none."""
    if drives := _drives_in(folder):
        return drives
    raise ValueError('it has no drive: no topic ~/status was recorded')


def _drives_in(folder: Path) -> list[str]:
    return sorted(
        topic.removesuffix('/status')
        for topic, type_ in bags.topics(folder)
        if type_ == _STATUS and topic.endswith('/status')
    )


def read(folder: Path, drives: Sequence[str]) -> list[Recording]:
    """
    Read the runs of drives, all from the same moment; one that was never connected has none.

    :raises ValueError: one is not in the bag, or none of them was ever connected.
    """
    there = _drives_in(folder)
    if there and (missing := sorted({*drives} - {*there})):
        raise ValueError(f'there is no drive {", ".join(missing)} in it, only {", ".join(there)}')
    messages: dict[str, list[tuple[int, Any]]] = {}
    for topic, stamp, message in bags.read(folder, lambda topic: _is_of(drives, topic)):
        messages.setdefault(topic, []).append((stamp, message))
    began = {drive: _first_answer(messages.get(f'{drive}/status', ())) for drive in drives}
    connected = {drive: stamp for drive, stamp in began.items() if stamp is not None}
    if not connected:
        raise ValueError(f'{", ".join(drives)} was never connected')
    with bags.reading():
        described = bags.metadata(folder)
        source = (
            f'{folder.name}: {described["message_count"]} messages on '
            f'{len(bags.topics(folder))} topics'
        )
        remarks = dict(described.get('custom_data') or {})
    start = min(connected.values())
    return [_Reader(messages, drive, start).recording(source, remarks) for drive in connected]


def _first_answer(statuses: Iterable[tuple[int, Any]]) -> int | None:
    return next((_nanoseconds(m.header.stamp) for _, m in statuses if m.connected), None)


class _Reader:
    """Makes the recording of one drive of the messages of a bag."""

    def __init__(
        self, messages: dict[str, list[tuple[int, Any]]], drive: str, start: int
    ) -> None:
        self._messages = messages
        self._drive = drive
        self._start = start
        self._statuses = self._measured('status')

    def recording(self, source: str, remarks: dict[str, str]) -> Recording:
        """Return all that there is of it."""
        statuses = [(time, status) for time, status in self._statuses if status.connected]
        length = self._statuses[-1][0]
        currents, texts = self._measured('telemetry'), self._measured('inv_st')
        shown = _spans([(time, m.text) for time, m in texts], length)
        # a fault is named a moment before the drive's state is one
        faults = {m.text: m.code for _, m in texts if m.kind == m.FAULT}
        phases = _spans([(time, _phase(m)) for time, m in self._statuses], length)
        lost = [span.begin for span in phases if span.what == 'lost']
        actual = Curve([time for time, _ in statuses], [m.actual for _, m in statuses])
        current = Curve([time for time, _ in currents], [m.output_current for _, m in currents])
        diagnostics = (m for _, m in self._messages.get('/diagnostics', ()))
        return Recording(
            drive=self._drive,
            began=datetime.fromtimestamp(self._start / 1e9),
            length=length,
            remarks=remarks,
            source=source,
            unit=next((m.unit for _, m in reversed(statuses) if m.unit), 'Hz'),
            identity=identity(diagnostics, self._drive),
            setpoint=self._setpoint(),
            actual=actual.broken_at(lost),
            speed=self._received('actual_speed').broken_at(lost),
            current=current.broken_at(lost),
            connected=self._while('connected', length),
            phases=phases,
            texts=shown,
            faults=[
                dataclasses.replace(span, code=faults[span.what])
                for span in shown
                if span.what in faults
            ],
            unknown=self._unknown(length),
            enabled=self._while('enabled', length),
            calls=sorted(self._calls(), key=lambda call: call.time),
            logged=list(self._logged()),
            stops=list(_stops(self._statuses)),
        )

    def _since(self, nanoseconds: int) -> float:
        return (nanoseconds - self._start) / 1e9

    def _measured(self, topic: str) -> list[tuple[float, Any]]:
        """Return messages by the time that they carry themselves."""
        found = self._messages.get(f'{self._drive}/{topic}', ())
        return [(self._since(_nanoseconds(m.header.stamp)), m) for _, m in found]

    def _received(self, topic: str) -> Curve:
        found = self._messages.get(f'{self._drive}/{topic}', ())
        return Curve([self._since(stamp) for stamp, _ in found], [m.data for _, m in found])

    def _setpoint(self) -> Curve:
        """Return what was given: by other topics than ``~/setpoint`` as the status has it."""
        given = self._received('setpoint')
        if given.times:
            return given
        enabled = [(time, m) for time, m in self._statuses if m.enabled]
        return Curve([time for time, _ in enabled], [m.setpoint for _, m in enabled])

    def _while(self, flag: str, end: float) -> list[Span]:
        """Return when a field of the status was true."""
        points = [(time, flag * bool(getattr(m, flag))) for time, m in self._statuses]
        return [span for span in _spans(points, end) if span.what]

    def _unknown(self, end: float) -> list[Span]:
        told = (abs(m.actual) for _, m in self._statuses if not math.isnan(m.actual))
        most = max(told, default=0.0)
        points = []
        turned = released = False
        for time, m in self._statuses:
            phase = _phase(m)
            if phase in ('running', 'stopping'):
                released, turned = False, abs(m.actual) > _STANDS * most
            else:
                # a motor that is not released is at standstill by then
                released, turned = released or turned, False
            unknown = m.connected and (released or math.isnan(m.actual))
            points.append((time, 'speed unknown' * unknown))
        return [span for span in _spans(points, end) if span.what]

    def _calls(self) -> Iterator[Call]:
        bus = f'{self._drive.rpartition("/")[0]}/{_BUS}/'
        for topic, events in self._messages.items():
            if topic.endswith(_EVENT) and topic.startswith((f'{self._drive}/', bus)):
                name = topic.removesuffix(_EVENT).rpartition('/')[2]
                yield from self._calls_of(name, [event for _, event in events])

    def _calls_of(self, name: str, events: Sequence[Any]) -> Iterator[Call]:
        """Yield each call once; client and server may both have published it."""
        answers = {
            _call_id(event): event.response[0].message for event in events if len(event.response)
        }
        known = set()
        for event in events:
            if len(event.request) and _call_id(event) not in known:
                known.add(_call_id(event))
                off = not getattr(event.request[0], 'data', True)
                time = self._since(_nanoseconds(event.info.stamp))
                yield Call(time, f'{name} off' if off else name, answers.get(_call_id(event), ''))

    def _logged(self) -> Iterator[Call]:
        """Yield what the log says of calls of the drive, and of all drives of its line."""
        namespace = self._drive.rpartition('/')[0]
        names = [name.strip('/').replace('/', '.') for name in (self._drive, f'{namespace}/{_BUS}')]
        for _, message in self._messages.get('/rosout', ()):
            if message.name in names and _CALLED_BY in message.msg:
                called, _, outcome = message.msg.partition(': ')
                yield Call(self._since(_nanoseconds(message.stamp)), called, outcome)


def _is_of(drives: Sequence[str], topic: str) -> bool:
    """Return whether a topic is one of those that are read."""
    if topic in _COMMON:
        return True
    node, _, name = topic.removesuffix(_EVENT).rpartition('/')
    if topic.endswith(_EVENT):
        if name not in COMMANDS:
            return False
        return node in drives or node in {f'{drive.rpartition("/")[0]}/{_BUS}' for drive in drives}
    return node in drives and name in _READ


def _call_id(event: Any) -> tuple[object, ...]:
    return (*map(int, event.info.client_gid), int(event.info.sequence_number))


def identity(arrays: Iterable[Any], drive: str) -> list[str]:
    """Return what diagnostics report of the identity of a drive."""
    mine = f'{drive.lstrip("/")}: drive'
    for array in arrays:
        for status in array.status:
            values = {pair.key: pair.value for pair in status.values}
            if status.name == mine and values.get('firmware'):
                named = {
                    '': values.get('model', ''),
                    'serial ': values.get('serial number', ''),
                    'firmware ': values['firmware'],
                }
                return [name + value for name, value in named.items() if value]
    return []


def _phase(status: Any) -> str:
    if not status.connected:
        return 'lost'
    for name, phase in _PHASE_OF_STATE.items():
        if status.state == getattr(status, name):
            return phase
    return 'standby'


def _stops(statuses: Iterable[tuple[float, Any]]) -> Iterator[Stop]:
    """Yield the stops; what a bag begins with was before it."""
    newest: Stop | None = None
    before: str | None = None
    for time, status in statuses:
        # a bag from before there were any has none
        reason = _reasons(type(status)).get(getattr(status, 'stop_reason', 0), '')
        text = str(getattr(status, 'stop_text', ''))
        is_new = before is not None and reason != before and (before, reason) not in _BETTER
        if newest is not None and (is_new or not reason):
            yield newest
            newest = None
        if is_new and reason:
            newest = Stop(time, reason, text)
        elif newest is not None:
            newest = dataclasses.replace(newest, reason=reason, text=text)
        before = reason
    if newest is not None:
        yield newest


@functools.cache
def _reasons(message: type) -> dict[int, str]:
    """Return the reasons of stops that a message has constants for, but for none."""
    names = [name for name in dir(message) if name.startswith(_REASON) and name != f'{_REASON}NONE']
    words = (name.removeprefix(_REASON).lower().replace('_', ' ') for name in names)
    return {getattr(message, name): word for name, word in zip(names, words, strict=True)}


def _spans(points: list[tuple[float, str]], end: float) -> list[Span]:
    """Join equal neighbours to spans that follow each other up to the end."""
    changes: list[tuple[float, str]] = []
    for time, what in points:
        if not changes or what != changes[-1][1]:
            changes.append((time, what))
    ends = [*(time for time, _ in changes[1:]), end]
    # what is latched may have been published before the first status that was received
    return [
        Span(max(begin, 0.0), until, what)
        for (begin, what), until in zip(changes, ends, strict=False)
        if until > 0
    ]


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)
