# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The measurements: each is made once a run, and gives the figures of one row."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
import functools
import json
import statistics
import struct
import subprocess
import time

from driver_rig import DriverRig
import masters
from rig import Rig
from rig import Window
import stops
import trace_file
from trace_file import Frame

from nfo_sinus_driver.catalog import Protocol
from nfo_sinus_driver.catalog import load_model

_WRITE = 6
_SETPOINT = 'status.frq_set'
#: A set-point that is not on the line by then was replaced by a newer one, s.
_LOST = 1.5
#: What the first cycles of another master are not counted for, s.
_WARM_UP = 1.0

Figures = dict[str, float]


@dataclass(frozen=True)
class Effort:
    """
    How much is measured in one run.

    :ivar window: how long cycles are watched, s.
    :ivar setpoints: how many set-points are published.
    :ivar events: how many of each kind have to stop a motor.
    """

    window: float
    setpoints: int
    events: int


@dataclass(frozen=True)
class Measurement:
    """
    What is measured at a time: one row of a table, or several.

    :ivar group: what ``--only`` takes.
    :ivar aims: the most that is aimed at, by the name of the figure.
    :ivar measure: returns the figures of each row, by its title.
    """

    group: str
    title: str
    baud_rate: int
    drives: int
    aims: Figures
    measure: Callable[[Effort], dict[str, Figures]]


def all_measurements() -> Iterator[Measurement]:
    """Return every measurement in the order of the tables."""
    lines = [(57600, 8), (57600, 1), (19200, 8), (19200, 1)]
    aims = {'ratio': 1.05, 'short_gaps': 0, 'cpu': 10}
    for title, settings in (('driver', {}), ('driver, telemetry off', {'telemetry_rate': 0.0})):
        for baud_rate, drives in lines:
            measure = _bound(title, _driver_cycle, baud_rate, drives, settings)
            yield Measurement('driver', title, baud_rate, drives, aims, measure)
    for baud_rate, drives in ((57600, 8), (57600, 1), (9600, 1)):
        measure = _bound('driver, Classic', _classic_cycle, baud_rate, drives)
        yield Measurement(
            'classic', 'driver, Classic', baud_rate, drives, {'ratio': 1.05, 'cpu': 10}, measure
        )
    for name in masters.MASTERS:
        for baud_rate, drives in lines:
            measure = _bound(name, _other_cycle, name, baud_rate, drives)
            yield Measurement('masters', name, baud_rate, drives, {}, measure)
    idle = {'poll_rate': 1.0, 'telemetry_rate': 0.0}
    for title, drives, settings, aims in (
        ('set-point to wire, idle', 1, idle, {'time': 2, 'short_gaps': 0}),
        ('set-point to wire, saturated', 8, {}, {'p99': 15, 'short_gaps': 0, 'cpu': 10}),
    ):
        measure = _bound(title, _setpoints, 57600, drives, settings)
        yield Measurement('setpoints', title, 57600, drives, aims, measure)
    for protocol, baud_rate, kinds in (
        ('modbus_rtu', 57600, stops.KINDS),
        ('modbus_rtu', 19200, stops.KINDS),
        ('modbus_ascii', 19200, stops.FEW_KINDS),
        ('classic', 57600, stops.FEW_KINDS),
        ('classic', 9600, stops.SLOW_KINDS),
    ):
        yield Measurement(
            'stop', f'stop, {protocol}', baud_rate, 8, {'beyond': 5, 'polls': 2},
            functools.partial(_stops, protocol, baud_rate, kinds),
        )


def _bound(
    title: str, function: Callable[..., Figures], *arguments: object
) -> Callable[[Effort], dict[str, Figures]]:
    return lambda effort: {title: function(*arguments, effort)}


def _stops(
    protocol: str, baud_rate: int, kinds: Sequence[str], effort: Effort
) -> dict[str, Figures]:
    with stops.StopRig(baud_rate, 8, protocol, setpoint_timeout=stops.TIMEOUT) as rig:
        figures = stops.measure(rig, kinds, effort.events)
        return {f'{kind}, {protocol}': found for kind, found in figures.items()}


def _driver_cycle(baud_rate: int, drives: int, settings: Figures, effort: Effort) -> Figures:
    with DriverRig(baud_rate, drives, **settings) as rig:
        with rig.listener.cycle_times() as told:
            window = rig.watch(rig.driver, effort.window)
        return {
            **_cycles(window, rig),
            'driver_says': 1e3 * statistics.median(told),
            'short_gaps': trace_file.short_gaps(rig.frames(), rig.line),
        }


def _classic_cycle(baud_rate: int, drives: int, effort: Effort) -> Figures:
    with DriverRig(baud_rate, drives, 'classic') as rig:
        with rig.listener.cycle_times() as told:
            window = rig.watch(rig.driver, effort.window)
        place = load_model('sinus_g2')[masters.STATUS].place(Protocol.CLASSIC).address
        return {**_cycles(window, rig, place), 'driver_says': 1e3 * statistics.median(told)}


def _other_cycle(name: str, baud_rate: int, drives: int, effort: Effort) -> Figures:
    with Rig(baud_rate, drives, masters.CHAR_FORMAT) as rig:
        process = rig.start_script('masters.py', name, rig.port, str(baud_rate), str(drives))
        rig.wait_for(lambda: bool(rig.frames()), process)
        time.sleep(_WARM_UP)
        window = rig.watch(process, effort.window)
        short = trace_file.short_gaps(rig.frames(), rig.line)
        return {**_cycles(window, rig), 'short_gaps': short}


def _cycles(window: Window, rig: Rig, place: int | None = None) -> Figures:
    if place is None:
        place, _ = masters.place(masters.STATUS)
    figures = trace_file.cycles(window.frames, rig.line, place)
    if figures.pop('units') != rig.drives:
        raise RuntimeError(f'not every drive was polled twice:\n{rig.log}')
    return {**figures, **trace_file.additions(window.frames, rig.line), **window.figures()}


def _setpoints(baud_rate: int, drives: int, settings: Figures, effort: Effort) -> Figures:
    # a drive may wait longer for its turn than the time-out allows
    with DriverRig(baud_rate, drives, setpoint_timeout=0.0, **settings) as rig:
        for name in rig.names:
            rig.listener.enable(name)
        process = rig.start_script(
            'publisher.py', str(effort.setpoints), *rig.names, stdout=subprocess.PIPE
        )
        watched_since = rig.begin_watch(rig.driver)
        assert process.stdout is not None
        output = process.stdout.readline()
        if not output:
            raise RuntimeError(f'the publisher failed:\n{rig.log}')
        window = watched_since()
        delays, lost = _delays(json.loads(output), window.frames)
        median = statistics.median(delays)
        limit = trace_file.longest_transaction(window.frames, rig.line)
        return {
            'time': 1e3 * median,
            'p99': 1e3 * trace_file.percentile(delays, 99),
            'limit': 1e3 * limit,
            'ratio': median / limit,
            'short_gaps': trace_file.short_gaps(rig.frames(), rig.line),
            'lost': lost,
            **window.figures(),
        }


def _delays(
    published: list[tuple[float, int, float]], frames: list[Frame]
) -> tuple[list[float], int]:
    """Return how long each set-point took to the line (s), and how many did not come there."""
    written: dict[tuple[int, int], list[float]] = {}
    register, _ = masters.place(_SETPOINT)
    for frame in frames:
        unit, function, where, word = struct.unpack('>BBHH', frame.data[:6].ljust(6, b'\0'))
        if frame.is_request and (function, where) == (_WRITE, register):
            written.setdefault((unit, word), []).append(frame.first)
    parameter = load_model('sinus_g2')[_SETPOINT]
    delays = []
    for at, drive, value in published:
        (word,) = parameter.quantise(value, Protocol.MODBUS)
        moments = written.get((drive + 1, word), ())
        delays += [moment - at for moment in moments if at <= moment < at + _LOST][:1]
    return delays, len(published) - len(delays)
