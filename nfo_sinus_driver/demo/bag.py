# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Reads a recorded run back from its bag, as arrays that can be drawn; needs no ROS."""

from __future__ import annotations

from collections.abc import Iterable
import dataclasses
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader
import yaml

_EVENT = '/_service_event'
_STATUS = 'nfo_sinus_msgs/msg/DriveStatus'
#: What the states of DriveStatus are to someone who watches the motor.
_PHASES = {
    'OPERATION_ENABLED': 'running',
    'STOPPING': 'stopping',
    'QUICK_STOP': 'stopping',
    'FAULT_REACTION_ACTIVE': 'fault',
    'FAULTED': 'fault',
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


@dataclass(frozen=True)
class Span:
    """Something that held for a while, s since the run began; a fault has a code."""

    begin: float
    end: float
    what: str
    code: int = 0


@dataclass
class Recording:
    """
    What a bag tells of a run.

    :ivar began: when the drive was connected; times are counted from there.
    :ivar source: the bag, its messages and its topics.
    :ivar unit: of the set-point and of what follows it.
    :ivar identity: model, serial number and firmware, as far as the drive tells.
    :ivar phases: what the motor did: standby, running, stopping or fault.
    :ivar texts: what the drive's display said.
    :ivar faults: of the texts, those that name a fault.
    :ivar enabled: when the driver followed set-points.
    :ivar calls: which services were called, and when.
    """

    began: datetime
    length: float
    remarks: dict[str, str]
    source: str
    unit: str = 'Hz'
    identity: list[str] = field(default_factory=list)
    setpoint: Curve = field(default_factory=Curve)
    actual: Curve = field(default_factory=Curve)
    speed: Curve = field(default_factory=Curve)
    current: Curve = field(default_factory=Curve)
    phases: list[Span] = field(default_factory=list)
    texts: list[Span] = field(default_factory=list)
    faults: list[Span] = field(default_factory=list)
    enabled: list[Span] = field(default_factory=list)
    calls: list[tuple[float, str]] = field(default_factory=list)


def read(folder: Path, drive: str = '/nfo_sinus') -> Recording:
    """Read the run of a drive from a bag; a ValueError if it was never connected."""
    heard: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([folder]) as reader:
        for connection, stamp, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            heard.setdefault(connection.topic, []).append((stamp, message))
    described = yaml.safe_load((folder / 'metadata.yaml').read_text())
    remarks = dict(described['rosbag2_bagfile_information'].get('custom_data') or {})

    statuses = [m for _, m in heard.get(f'{drive}/status', ()) if m.connected]
    if not statuses:
        raise ValueError(f'{drive} was never connected')
    start = _nanoseconds(statuses[0].header.stamp)

    def since(nanoseconds: int) -> float:
        return (nanoseconds - start) / 1e9

    def measured(topic: str) -> list[tuple[float, Any]]:
        """Messages by the time that they tell themselves."""
        return [
            (since(_nanoseconds(m.header.stamp)), m) for _, m in heard.get(f'{drive}/{topic}', ())
        ]

    def received(topic: str, curve: Curve) -> None:
        for stamp, message in heard.get(f'{drive}/{topic}', ()):
            curve.add(since(stamp), message.data)

    length = since(_nanoseconds(statuses[-1].header.stamp))
    source = f'{folder.name}: {sum(map(len, heard.values()))} messages on {len(heard)} topics'
    run = Recording(datetime.fromtimestamp(start / 1e9), length, remarks, source)
    run.identity = _identity((m for _, m in heard.get('/diagnostics', ())), drive)
    received('setpoint', run.setpoint)
    received('actual_speed', run.speed)
    phases, enabled = [], []
    for time, status in measured('status'):
        if status.connected:
            run.actual.add(time, status.actual)
            run.unit = status.unit or run.unit
            phases.append((time, _phase(status)))
            enabled.append((time, 'enabled' if status.enabled else ''))
    run.phases = _spans(phases, length)
    run.enabled = [span for span in _spans(enabled, length) if span.what]
    for time, telemetry in measured('telemetry'):
        run.current.add(time, telemetry.output_current)
    texts = measured('inv_st')
    run.texts = _spans([(time, m.text) for time, m in texts], length)
    # a fault is named a moment before the drive's state is one
    faults = {m.text: m.code for _, m in texts if m.kind == m.FAULT}
    run.faults = [
        dataclasses.replace(span, code=faults[span.what])
        for span in run.texts
        if span.what in faults
    ]
    run.calls = sorted(_calls(heard, drive, since))
    return run


def only_drive(folder: Path) -> str:
    """Return the name of the drive that is in a bag; a ValueError if there is none, or several."""
    if not (folder / 'metadata.yaml').is_file():
        raise ValueError('it is no bag: a folder with a metadata.yaml is one')
    with AnyReader([folder]) as reader:
        drives = sorted(
            connection.topic.removesuffix('/status')
            for connection in reader.connections
            if connection.msgtype == _STATUS and connection.topic.endswith('/status')
        )
    if len(drives) == 1:
        return drives[0]
    if drives:
        raise ValueError(f'it has several drives: choose one by --drive: {", ".join(drives)}')
    raise ValueError('it has no drive: no topic ~/status was recorded')


def _calls(
    heard: dict[str, list[tuple[int, Any]]], drive: str, since: Any
) -> Iterable[tuple[float, str]]:
    for topic, events in heard.items():
        if topic.startswith(drive) and topic.endswith(_EVENT):
            name = topic.removesuffix(_EVENT).rpartition('/')[2]
            for _, event in events:
                if event.info.event_type == event.info.REQUEST_SENT:
                    off = not getattr(event.request[0], 'data', True)
                    yield since(_nanoseconds(event.info.stamp)), f'{name} off' if off else name


def _identity(arrays: Iterable[Any], drive: str) -> list[str]:
    """Return what diagnostics tell of who the drive is."""
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
    for name, phase in _PHASES.items():
        if status.state == getattr(status, name):
            return phase
    return 'standby'


def _spans(points: list[tuple[float, str]], end: float) -> list[Span]:
    """Join equal neighbours to spans that follow each other up to the end."""
    changes: list[tuple[float, str]] = []
    for time, what in points:
        if not changes or what != changes[-1][1]:
            changes.append((time, what))
    ends = [*(time for time, _ in changes[1:]), end]
    # what is latched may have been told before the first status that was heard
    return [
        Span(max(begin, 0.0), until, what)
        for (begin, what), until in zip(changes, ends, strict=False)
        if until > 0
    ]


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)
