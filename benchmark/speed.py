# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Cycle, processor, memory and start by number of drives, and other masters on the same line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
import subprocess
import time

from driver_rig import DriverRig
import masters
import recorded_cycle
import resources
from rig import Rig, Window
from row import Effort, Figures, Row
import trace_file
from trace_file import Line

from nfo_sinus_driver.catalog import load_family

#: The first and the second are measured one after the other: they are compared.
DRIVES = (32, 1, 8)
#: Of a MOVITRAC a cycle at 9600 bit/s takes half a second with so many.
SLOW_DRIVES = (8, 1)
#: What a poll reads, one transaction each, by the model: the plain cycle.
_POLLED = {
    'sinus_g2': ('fieldbus.drive_status', 'fieldbus.inv_st', 'status.frq_act', 'status.spd_act'),
    # the status has the code in it; who controls the drive is asked once a second
    'movitrac31': ('fieldbus.inverter_status', 'status.frequency', 'status.speed'),
}
#: So much longer than the plain cycle is a cycle that carries telemetry and parameters too.
_LONGER = 1.4
#: A window lasts this many cycles more at most, until it has two polls of every drive.
_MOST_ROUNDS = 20
#: What the first cycles of another master are not counted for, s.
_WARM_UP = 1.0
#: Where others than the bare loop and minimalmodbus are measured: bit/s and drives.
_OTHERS_AT = (57600, 8)
_AIMS = {'ratio': 1.05, 'bare_ratio': 1.02, 'short_gaps': 0.0, 'cpu_to_bare': 2.0}
_CHAR_FORMATS = {'modbus_rtu': '8N2', 'classic': '7E1', 'movitrac': '8N1'}


def measure(
    protocol: str, baud_rate: int, numbers: Sequence[int], effort: Effort
) -> list[Row]:
    """Return the rows of the driver, and of other masters that make its transactions."""
    rows = [
        row for drives in numbers for row in _with(protocol, baud_rate, drives, effort)
    ]
    of_one = next(row for row in rows if row.table == 'driver' and row.drives == 1)
    rows = [_compared(row, of_one) if row.table == 'driver' else row for row in rows]
    # the sort is stable: the driver stays ahead of the others
    return sorted(rows, key=lambda row: row.drives)


def _compared(row: Row, of_one: Row) -> Row:
    cost = 'cpu_transaction'
    to_one = row.figures[cost] / of_one.figures[cost]
    return replace(row, figures={**row.figures, 'cpu_to_one': to_one})


def _with(protocol: str, baud_rate: int, drives: int, effort: Effort) -> Iterator[Row]:
    with DriverRig(baud_rate, drives, protocol) as rig:
        window = watch(rig, rig.driver, effort)
        driver = {
            **rig.startup,
            **resources.memory(rig.driver.pid),
            **cycles(window, rig),
            'short_gaps': trace_file.short_gaps(rig.frames(), rig.line),
        }
        asked = time.monotonic()
        rig.end(rig.driver)
        driver['ended'] = time.monotonic() - asked
        recorded = rig.folder / 'cycle'
        recorded_cycle.save(window.frames, recorded)
        others = {
            name: _other(name, protocol, baud_rate, drives, recorded, effort)
            for name in _others(protocol, baud_rate, drives)
        }
    bare = others['bare loop']
    driver['bare_ratio'] = driver['ratio'] / bare['ratio']
    driver['cpu_to_bare'] = driver['cpu_transaction'] / bare['cpu_transaction']
    aims = {**_AIMS, 'rss': 60.0 + 2.0 * drives}
    if drives == max(DRIVES):
        aims.update(cpu_to_one=1.1, cpu=10.0, start_ratio=1.2)
    yield Row('driver', 'driver', baud_rate, drives, driver, aims)
    for name, figures in others.items():
        yield Row('other', name, baud_rate, drives, figures)


def _others(protocol: str, baud_rate: int, drives: int) -> list[str]:
    if protocol != 'modbus_rtu':
        return ['bare loop']
    everywhere, *elsewhere = masters.MASTERS
    return ['bare loop', everywhere, *(elsewhere if (baud_rate, drives) == _OTHERS_AT else ())]


def _other(
    name: str, protocol: str, baud_rate: int, drives: int, recorded: Path, effort: Effort
) -> Figures:
    with Rig(baud_rate, drives, _CHAR_FORMATS[protocol], protocol) as rig:
        process = _start(name, rig, recorded)
        rig.wait_for(lambda: bool(rig.frames()), process)
        time.sleep(_WARM_UP)
        window = watch(rig, process, effort)
        return {
            **cycles(window, rig),
            'short_gaps': trace_file.short_gaps(window.frames, rig.line),
        }


def _start(name: str, rig: Rig, recorded: Path) -> subprocess.Popen[str]:
    if name == 'bare loop':
        return rig.start_script(
            'bare_loop.py', rig.line.protocol, rig.port, str(rig.line.gap), str(recorded)
        )
    return rig.start_script('masters.py', name, rig.port, str(rig.line.baud_rate), str(recorded))


def watch(rig: Rig, process: subprocess.Popen[str], effort: Effort) -> Window:
    """
    Return what happened in a window, in which every drive was polled twice at least.

    :raises RuntimeError: they never were.
    """
    cycle = _LONGER * rig.drives * plain_cycle(rig.line)
    watched_since = rig.begin_watch(process)
    time.sleep(max(effort.window, effort.rounds * cycle))
    for _ in range(_MOST_ROUNDS):
        window = watched_since()
        if trace_file.units_with_cycles(window.frames, rig.line, _place(rig)) == rig.drives:
            return window
        time.sleep(cycle)
    raise RuntimeError(f'not every drive was polled twice:\n{rig.log}')


def plain_cycle(line: Line) -> float:
    """Return the least time of the transactions of a poll, for one drive, s."""
    return sum(_read_time(line, key) for key in _POLLED[line.model])


def _read_time(line: Line, key: str) -> float:
    parameter = load_family(line.model)[key]
    if line.protocol == 'movitrac':
        # an ENQUIRY of 5 characters and a DATA of 8 [M4 §2.1.1]
        return 13 * line.character + line.gap
    if line.protocol == 'classic':
        # an ENQUIRY of 8 characters and a REPLY of 14 for each word [M0 §6.1.3]
        return parameter.at('classic').codec.size * 11 * line.character
    # 8 bytes ask, 5 and the words answer, t3.5 is before each
    size = parameter.at('modbus').codec.size
    return (13 + size) * line.character + 2 * line.gap


def cycles(window: Window, rig: Rig) -> Figures:
    """Return the figures of the cycles in a window."""
    return {
        **trace_file.cycles(window.frames, rig.line, _place(rig)),
        **trace_file.additions(window.frames, rig.line),
        **window.figures(),
    }


def _place(rig: Rig) -> int:
    """Return the register or Classic id of the status."""
    line = rig.line
    return load_family(line.model)[_POLLED[line.model][0]].at(line.space).index
