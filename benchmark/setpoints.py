# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Enabled drives: their cycle, how soon a set-point is on the line, and how soon a stop is."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
import json
import statistics
import subprocess
from typing import Any, NamedTuple

from driver_rig import DriverRig
from rig import Window
from row import Effort, Figures, Row
import speed
import trace_file
from trace_file import Frame, Line

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.families.sinus_g2.words import Scmd, Status

BAUD_RATE = 57600
DRIVES = (1, 8, 32)
_MODEL = load_family('sinus_g2')
_SETPOINT, _SCMD, _STATUS, *_POLLED = (
    _MODEL[key].at('modbus').index
    for key in (
        *('status.frq_set', 'fieldbus.scmd', 'fieldbus.drive_status', 'fieldbus.inv_st'),
        *('status.frq_act', 'status.spd_act', 'control.mode'),
    )
)
#: A drive may wait for its turn of the publisher, s. Its own time-out is set, as on a real
#: conveyor; a machine that is busy elsewhere stops no motor.
SETTINGS = {'setpoint_timeout': 10.0, 'drive_timeout': 5.0, 'lost_after': 4.0}
#: One drive that is rarely asked for anything.
_IDLE = {'poll_rate': 1.0, 'telemetry_rate': 0.0, 'setpoint_timeout': 0.0}
#: A set-point that is not on the line by then was replaced by a newer one, s.
_LOST = 1.5
#: Of the 99th percentile with eight drives, ms; with more, the longest read of a poll beside it.
_MOST = 10.0
_TRANSACTION = 6.75


class _Delay(NamedTuple):
    """
    How long something took to the line.

    :ivar since: when it was called, s.
    :ivar in_sender: how long the call itself took, in the process of the caller, s.
    """

    since: float
    seconds: float
    in_sender: float


def measure_idle(effort: Effort) -> list[Row]:
    """Return the row of set-points on a line that is idle."""
    with DriverRig(BAUD_RATE, 1, **_IDLE) as rig:
        rig.listener.enable_all()
        figures = _to_wire(rig, effort.setpoints)
    aims = {'time': 1.0, 'short_gaps': 0.0}
    return [Row('event', 'set-point to wire, idle', BAUD_RATE, 1, figures, aims)]


def measure(drives: int, effort: Effort) -> list[Row]:
    """Return the rows of a line with enabled drives that is full."""
    with DriverRig(BAUD_RATE, drives, **SETTINGS) as rig:
        steady = give_the_same(rig)
        rows = [_unchanged(rig, effort), _stops(rig, effort.stops)]
        rig.end(steady)
        rig.listener.enable_all()
        rows.append(_saturated(rig, effort.setpoints))
    return rows


def give_the_same(rig: DriverRig) -> subprocess.Popen[str]:
    """Enable all drives, and have a process give each the same set-point again and again."""
    rig.listener.enable_all()
    steady = rig.start_script('publisher.py', '0', *rig.names)
    rig.wait_for(lambda: _all_follow(rig), steady)
    return steady


def _all_follow(rig: DriverRig) -> bool:
    """Tell whether all drives have a set-point and say that they run at it."""
    words: dict[int, int] = {}
    for request, answer in pairwise(rig.frames()):
        if _reads(request, answer, (_STATUS,)):
            words[request.data[0]] = int.from_bytes(answer.data[3:5], 'big')
    written = {unit for _, unit, word in trace_file.writes(rig.frames(), _SETPOINT) if word}
    return len(written) == rig.drives and all(
        words.get(unit, 0) & Status.SETPOINT_REACHED for unit in written
    )


def _reads(request: Frame, answer: Frame, registers: Sequence[int]) -> bool:
    if not request.is_request or answer.is_request:
        return False
    return trace_file.read_register(request.data) in registers


def _unchanged(rig: DriverRig, effort: Effort) -> Row:
    """Measure the cycle while the same set-points come again and again."""
    window = speed.watch(rig, rig.driver, effort)
    figures = speed.cycles(window, rig)
    plain = speed.plain_cycle(rig.line)
    figures.update(
        plain=1e3 * rig.drives * plain,
        plain_ratio=figures['time'] / (1e3 * rig.drives * plain),
        polls_ratio=_time_of_a_poll(window.frames, rig.line) / plain,
    )
    aims = {'ratio': 1.05, 'polls_ratio': 0.6}
    return Row('enabled', 'enabled, same set-points', BAUD_RATE, rig.drives, figures, aims)


def _time_of_a_poll(frames: Sequence[Frame], line: Line) -> float:
    """Return what polls and set-points take on the wire, for one status, s."""
    seconds, statuses = 0.0, 0
    for request, answer in pairwise(frames):
        if _reads(request, answer, (_STATUS, *_POLLED)) or (
            request.is_request and trace_file.written(request.data)[1] == _SETPOINT
        ):
            seconds += line.limit((request, answer))
            statuses += _reads(request, answer, (_STATUS,))
    return seconds / statuses


def _saturated(rig: DriverRig, count: int) -> Row:
    most = _MOST if rig.drives <= 8 else _MOST + _TRANSACTION
    figures = _to_wire(rig, count)
    aims = {'p99': most, 'short_gaps': 0.0}
    return Row('event', 'set-point to wire, saturated', BAUD_RATE, rig.drives, figures, aims)


def _stops(rig: DriverRig, count: int) -> Row:
    """Measure from the call of a stop to its command on the line."""
    called, window = _done_by(rig, 'stopper.py', count)
    stops: dict[int, list[float]] = {}
    for at, unit, word in trace_file.writes(window.frames, _SCMD):
        if word == Scmd.STOP:
            stops.setdefault(unit, []).append(at)
    delays = [
        _Delay(call, next(at for at in stops[drive + 1] if at >= call) - call, took)
        for call, drive, took in called
    ]
    figures = _delay_figures(delays, window, rig)
    return Row('event', 'service stop', BAUD_RATE, rig.drives, figures, {'beyond': 3.0})


def _to_wire(rig: DriverRig, count: int) -> Figures:
    published, window = _done_by(rig, 'publisher.py', count)
    delays, lost = _delays(published, window.frames)
    return {
        **_delay_figures(delays, window, rig),
        'short_gaps': trace_file.short_gaps(rig.frames(), rig.line),
        'lost': lost,
    }


def _done_by(rig: DriverRig, script: str, count: int) -> tuple[list[Any], Window]:
    """Let another process do something; return what it says of it, and what happened meanwhile."""
    process = rig.start_script(script, str(count), *rig.names, stdout=subprocess.PIPE)
    watched_since = rig.begin_watch(rig.driver)
    assert process.stdout is not None
    output = process.stdout.readline()
    if not output:
        raise RuntimeError(f'{script} failed:\n{rig.log}')
    window = watched_since()
    rig.end(process)
    return json.loads(output), window


def _delay_figures(found: Sequence[_Delay], window: Window, rig: DriverRig) -> Figures:
    limit = trace_file.longest_transaction(window.frames, rig.line)
    delays = [one.seconds for one in found]
    longest = max(found, key=lambda one: one.seconds)
    return {
        'events': len(delays),
        'time': 1e3 * statistics.median(delays),
        'p99': 1e3 * trace_file.percentile(delays, 99),
        'longest': 1e3 * max(delays),
        'limit': 1e3 * limit,
        'beyond': 1e3 * (max(delays) - limit),
        'in_sender': 1e3 * longest.in_sender,
        'stood_still': 1e3 * window.stood_still(longest.since, longest.seconds),
        **window.figures(),
    }


def _delays(
    published: Sequence[tuple[float, int, float, float]], frames: list[Frame]
) -> tuple[list[_Delay], int]:
    """Return how long each set-point took to the line, and how many did not come there."""
    written: dict[tuple[int, int], list[float]] = {}
    for at, unit, word in trace_file.writes(frames, _SETPOINT):
        written.setdefault((unit, word), []).append(at)
    delays = []
    for at, drive, value, took in published:
        word = int.from_bytes(_MODEL['status.frq_set'].quantise(value, 'modbus'), 'big')
        moments = written.get((drive + 1, word), ())
        came = (moment for moment in moments if at <= moment < at + _LOST)
        delays += [_Delay(at, moment - at, took) for moment in came][:1]
    return delays, len(published) - len(delays)
