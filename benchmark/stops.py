# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How long after an event the command that stops the motor is on the line.

All drives run on a full line, with set-points a hundred times a second. One event after another
has to stop one of them, which is then enabled again.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass, replace
import itertools
from itertools import pairwise
import random
import signal
import statistics
import threading
import time
from typing import NamedTuple

from driver_rig import DriverRig
from nfo_sinus_msgs.msg import DriveStatus
from rclpy.qos import QoSProfile
from rig import PATIENCE
from row import Effort, Figures, Row
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger
import trace_file
from trace_file import Frame

from nfo_sinus_driver.catalog import Meaning, load_family
from nfo_sinus_driver.families.sinus_g2.words import Mode, Scmd, Status
from nfo_sinus_driver.link import classic
from nfo_sinus_driver.simulator.control import Client

#: ``setpoint_timeout`` of every drive, s.
TIMEOUT = 1.5
#: Between two set-points, s; each drive has one in its turn.
_PERIOD = 0.01
#: Hz, in turn: no set-point is the one before it.
_VALUES = (10.0, 12.0)
#: The next event comes at any moment of that time, s: longer than a cycle of the slowest line.
_PAUSE = 1.0
#: Undervoltage: a fault that can be acknowledged.
_FAULT = 5
#: What of DriveStatus tells that a motor no longer runs as it was told to.
_TELLS = ~int(Status.SETPOINT_REACHED | Status.LIMIT_ACTIVE | Status.REV_OP_ENABLED) & 0xFFFF
_MODEL = load_family('sinus_g2')
_STATUS, _INV_ST, _MODE_KEY = 'fieldbus.drive_status', 'fieldbus.inv_st', 'control.mode'

#: The character that stands for address 0 in a Classic frame [M0 §6.1].
_ADDRESS_ZERO = 0x20
#: How many drives are on the line.
_DRIVES = 8


@dataclass(frozen=True)
class _Event:
    """
    Something that has to stop a motor.

    :ivar at: when, s; of a set-point that does not come, when it was due at last.
    """

    kind: str
    unit: int
    at: float


class _Seen(NamedTuple):
    """
    How an event was answered.

    :ivar since: when it was detected, s.
    :ivar delay: how long after that the stop was on the line, s.
    :ivar polls: how often the status was read until then.
    """

    since: float
    delay: float
    polls: int


class _Wire:
    """What frames mean on one line, whichever function carries it."""

    def __init__(self, protocol: str) -> None:
        self._protocol = protocol
        self._classic = protocol == 'classic'
        self._space = 'classic' if self._classic else 'modbus'
        self.setpoint = 'fieldbus.setpoint' if self._classic else 'status.frq_set'

    def reads(self, request: bytes, unit: int, key: str) -> bool:
        """Tell whether a request reads a parameter."""
        place = _MODEL[key].at(self._space).index
        if self._classic:
            return request == classic.encode(classic.Enquiry(unit, place))
        message = self._message(request)
        return message[0] == unit and trace_file.read_register(message) == place

    def writes(self, request: bytes, units: Container[int], key: str, word: int) -> bool:
        """Tell whether a request gives one of some units a word."""
        place = _MODEL[key].at(self._space).index
        if self._classic:
            unit = request[1] - _ADDRESS_ZERO
            return unit in units and request == classic.encode(classic.Select(unit, place, word))
        unit, register, value = trace_file.written(self._message(request))
        return unit in units and (register, value) == (place, word)

    def is_refusal(self, unit: int, answer: bytes) -> bool:
        """Tell whether an answer is the refusal of a drive."""
        if self._classic:
            return answer == classic.encode(classic.Nak(unit))
        message = self._message(answer)
        return message[0] == unit and message[1] >= 0x80

    def word(self, answer: bytes) -> int:
        """Return what a read is answered, the low word of it."""
        if self._classic:
            return int(answer[8:12], 16)
        return int.from_bytes(self._message(answer)[3:5], 'big')

    def _message(self, frame: bytes) -> bytes:
        if self._protocol == 'modbus_ascii':
            return bytes.fromhex(frame[1:-2].decode())
        return frame


class _Feeder(threading.Thread):
    """Publishes set-points for all drives in turn, but for those that are held back."""

    def __init__(self, rig: DriverRig) -> None:
        super().__init__(daemon=True)
        self._publishers = [
            rig.listener.create_publisher(Float32, f'/{name}/setpoint', QoSProfile(depth=1))
            for name in rig.names
        ]
        #: Who gets none, and who gets 0.
        self.held = self.standing = 0
        #: When each drive got its last one.
        self.published: dict[int, float] = {}
        self._ended = threading.Event()

    def run(self) -> None:
        """Publish until told to end."""
        numbers = itertools.cycle(enumerate(self._publishers, start=1))
        values = itertools.cycle(value for value in _VALUES for _ in self._publishers)
        due = time.monotonic()
        while not self._ended.wait(max(0.0, due - time.monotonic())):
            due += _PERIOD
            unit, publisher = next(numbers)
            value = next(values)
            message = Float32(data=0.0 if unit == self.standing else value)
            if unit != self.held:
                self.published[unit] = time.monotonic()
                publisher.publish(message)

    def end(self) -> None:
        """End."""
        self._ended.set()
        self.join()


class _Ride:
    """All drives of a rig, running; makes events happen to them, and lets them run again."""

    def __init__(self, rig: DriverRig, drives: Client, feeder: _Feeder) -> None:
        self._rig = rig
        self._drives = drives
        self._feeder = feeder
        self._enabled: dict[int, bool] = {}
        # all of them at once: the first request of a new client waits until the driver knows it
        self._clients = {
            (name, service): rig.listener.create_client(kind, f'/{name}/{service}')
            for name in rig.names
            for service, kind in _TYPES.items()
        }
        for unit, name in enumerate(rig.names, start=1):
            rig.listener.create_subscription(
                DriveStatus,
                f'/{name}/status',
                lambda message, unit=unit: self._enabled.update({unit: message.enabled}),
                10,
            )

    def call(self, unit: int, service: str, **fields: object) -> float:
        """Call a service of a drive; return when."""
        client = self._clients[self._rig.names[unit - 1], service]
        if not client.wait_for_service(PATIENCE):
            raise RuntimeError(f'drive {unit} has no service {service}')
        request = _TYPES[service].Request(**fields)
        called = time.monotonic()
        response = client.call(request, timeout_sec=PATIENCE)
        if response is None or not response.success:
            raise RuntimeError(f'drive {unit}, {service}: {response}\n{self._rig.log}')
        return called

    def enable(self, unit: int) -> None:
        """Let a drive run."""
        self.call(unit, 'enable', data=True)
        self._await(lambda: self._enabled.get(unit), f'drive {unit} is enabled')

    def event(self, kind: str, unit: int) -> _Event:
        """Make something happen to a drive, and wait until it has been noticed."""
        if kind == 'set-point time-out':
            self._feeder.held = unit
            time.sleep(TIMEOUT + 0.3)
            at = self._feeder.published[unit] + TIMEOUT
            self._feeder.held = 0
            return _Event(kind, unit, at)
        if kind in _SERVICES:
            service, fields = _SERVICES[kind]
            return _Event(kind, unit, self.call(unit, service, **fields))
        if kind == 'fault in a poll':
            # the drive would refuse a set-point, and tell it by that
            self._feeder.held = unit
        elif kind == 'control mode changed':
            self._feeder.standing = unit
            self._drives.wait_for(lambda state: not state['turning'], PATIENCE, unit)
        at = time.monotonic()
        self._drives.inject(*_INJECTED[kind], address=unit)
        self._await(lambda: not self._enabled[unit], f'{kind} is noticed')
        self._feeder.held = self._feeder.standing = 0
        return _Event(kind, unit, at)

    def mend(self, kind: str, unit: int) -> None:
        """Let a drive run again after an event."""
        if kind == 'set-point time-out':
            return
        if kind.startswith('fault'):
            self.call(unit, 'fault_ack')
        elif kind == 'RUN input lost':
            self._drives.inject('run', True, address=unit)
        elif kind == 'control mode changed':
            self._drives.inject('set', _MODE_KEY, 'Freque', address=unit)
        self._await(lambda: not self._enabled[unit], f'{kind} is told')
        self.enable(unit)

    def _await(self, condition: Callable[[], object], what: str) -> None:
        self._rig.wait_for(lambda: bool(condition()), self._rig.driver)


_TYPES = {'enable': SetBool, 'stop': Trigger, 'quick_stop': Trigger, 'fault_ack': Trigger}
_SERVICES: dict[str, tuple[str, dict[str, object]]] = {
    'service stop': ('stop', {}),
    'service quick_stop': ('quick_stop', {}),
    'service enable, false': ('enable', {'data': False}),
}
_INJECTED: dict[str, tuple[object, ...]] = {
    'fault': ('fault', _FAULT),
    'fault in a poll': ('fault', _FAULT),
    'RUN input lost': ('run', False),
    'keypad STOP': ('keypad', 'stop'),
    'keypad takes over': ('keypad', 'ext'),
    'control mode changed': ('set', _MODE_KEY, 'Speed'),
}
KINDS = (*_SERVICES, *_INJECTED, 'set-point time-out', 'SIGTERM')
FEW_KINDS = ('service stop', 'fault', 'fault in a poll', 'set-point time-out', 'SIGTERM')
#: Where a cycle takes longer than the time-out, set-point 0 is refused before a poll can tell.
SLOW_KINDS = tuple(kind for kind in FEW_KINDS if kind != 'fault in a poll')


def measure(protocol: str, baud_rate: int, kinds: Sequence[str], effort: Effort) -> list[Row]:
    """Return a row for each kind of event, on a full line of eight drives."""
    with DriverRig(baud_rate, _DRIVES, protocol, setpoint_timeout=TIMEOUT) as rig:
        found = _measure(rig, kinds, effort.events)
    aims = {'beyond': 5.0, 'polls': 2.0}
    return [
        Row('stop', f'{kind}, {protocol}', baud_rate, _DRIVES, figures, aims)
        for kind, figures in found.items()
    ]


def _measure(rig: DriverRig, kinds: Sequence[str], count: int) -> dict[str, Figures]:
    feeder = _Feeder(rig)
    with Client.at_link(rig.port) as drives:
        ride = _Ride(rig, drives, feeder)
        feeder.start()
        try:
            for unit in range(1, rig.drives + 1):
                ride.enable(unit)
            watched_since = rig.begin_watch(rig.driver)
            events = list(_happen(ride, kinds, rig.drives, count))
            window = watched_since()
        finally:
            feeder.end()
    if 'SIGTERM' in kinds:
        at = time.monotonic()
        rig.driver.send_signal(signal.SIGTERM)
        rig.driver.wait(PATIENCE)
        events.append(_Event('SIGTERM', 0, at))
    frames = rig.frames()
    stalls = replace(window, stalls=rig.stalls())
    limit = trace_file.longest_transaction(window.frames, rig.line)
    wire = _Wire(rig.line.protocol)
    found = {}
    for kind in dict.fromkeys(event.kind for event in events):
        seen = [_seen(event, frames, wire) for event in events if event.kind == kind]
        delays = [one.delay for one in seen]
        longest = max(seen, key=lambda one: one.delay)
        found[kind] = {
            'events': len(seen),
            'time': 1e3 * statistics.median(delays),
            'p99': 1e3 * trace_file.percentile(delays, 99),
            'longest': 1e3 * longest.delay,
            'limit': 1e3 * limit,
            'longest_ratio': longest.delay / limit,
            'beyond': 1e3 * (longest.delay - limit),
            'stood_still': 1e3 * stalls.stood_still(longest.since, longest.delay),
            'others': window.figures()['others'],
        }
        if kind in _INJECTED:
            found[kind]['polls'] = max(one.polls for one in seen)
    return found


def _happen(ride: _Ride, kinds: Sequence[str], drives: int, count: int) -> Iterator[_Event]:
    """Make everything happen, in turn and to all drives in turn."""
    chance = random.Random()
    units = itertools.cycle(range(1, drives + 1))
    for kind in [kind for kind in kinds if kind != 'SIGTERM'] * count:
        unit = next(units)
        time.sleep(chance.uniform(0.0, _PAUSE))
        yield ride.event(kind, unit)
        ride.mend(kind, unit)


def _seen(event: _Event, frames: list[Frame], wire: _Wire) -> _Seen:
    """Return how an event was answered."""
    stops = _stops(event, frames, wire)
    stop = next(frame.first for frame in stops if frame.first >= event.at)
    if event.kind not in _INJECTED:
        return _Seen(event.at, stop - event.at, 0)
    keys = (_MODE_KEY,) if event.kind == 'control mode changed' else (_STATUS, _INV_ST)
    asked = dict.fromkeys((_STATUS, *keys))
    before: dict[str, int] = {}
    told, polls = [], 0
    for request, answer in pairwise(frames):
        if answer.last > stop or not request.is_request or answer.is_request:
            continue
        key = next((key for key in asked if wire.reads(request.data, event.unit, key)), None)
        happened = answer.last >= event.at
        polls += happened and key == _STATUS
        if happened and wire.is_refusal(event.unit, answer.data):
            told.append(answer.last)
        elif key in keys:
            word = wire.word(answer.data)
            if happened and _tells(key, before.get(key), word):
                told.append(answer.last)
            elif not happened:
                before[key] = word
    if not told:
        raise RuntimeError(f'{event}: nothing told it')
    return _Seen(told[0], stop - told[0], polls)


def _tells(key: str, before: int | None, word: int) -> bool:
    if key == _INV_ST:
        return Meaning.BUS_RUNNING not in _MODEL.status_code(word).meanings
    return before is not None and bool((before ^ word) & (_TELLS if key == _STATUS else 0xFFFF))


def _stops(event: _Event, frames: list[Frame], wire: _Wire) -> Iterator[Frame]:
    """Return the requests that answer an event."""
    units = (event.unit,) if event.unit else range(1, 95)
    key, word = 'fieldbus.scmd', int(Scmd.STOP)
    if event.kind == 'set-point time-out':
        key, word = wire.setpoint, 0
    elif event.kind == 'service quick_stop':
        key, word = 'fieldbus.mode', int(Mode.STOP)
    return (
        frame
        for frame in frames
        if frame.is_request and wire.writes(frame.data, units, key, word)
    )
