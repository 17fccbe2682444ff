# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How fast drives are polled, and what that costs, by number of drives; the peer beside it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import time

from rig import DRIVER, PEER, Rig, memory
import trace_file

from nfo_sinus_driver.catalog import load_family

#: Protocol, bit/s, drives; a MOVITRAC needs half a second for a cycle of eight.
CASES = (
    ('modbus_rtu', 57600, 1),
    ('modbus_rtu', 57600, 8),
    ('modbus_rtu', 57600, 32),
    ('modbus_rtu', 19200, 8),
    ('classic', 57600, 8),
    ('movitrac', 9600, 8),
)
#: What begins a poll, by the model.
_STATUS = {'sinus_g2': 'fieldbus.drive_status', 'movitrac31': 'fieldbus.inverter_status'}
_MOST_WINDOWS = 20
COLUMNS = (
    ('cycle, ms', 'time', 1),
    ('p99, ms', 'p99', 1),
    ('cycle / wire time', 'ratio', 3),
    ('gaps < t3.5', 'short_gaps', 0),
    ('CPU, % of a core', 'cpu', 1),
    ('CPU, ms a transaction', 'cpu_transaction', 2),
    ("CPU / peer's with one drive", 'cpu_to_peer', 2),
    ('memory, MB', 'memory', 0),
)


def measure(
    seconds: float, cases: Sequence[tuple[str, int, int]] = CASES
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the title and the figures of each row; windows last so many seconds at least."""
    of_one = {}
    for protocol, baud_rate, drives in cases:
        # the peer first: the driver is compared with it
        for master in (PEER, DRIVER) if protocol == 'modbus_rtu' else (DRIVER,):
            with Rig(master, baud_rate, drives, protocol) as rig:
                figures = _watch(rig, seconds)
                figures['memory'] = memory(rig.master.pid)
            if (master, drives) == (PEER, 1):
                of_one = figures
            if protocol == 'modbus_rtu':
                figures['cpu_to_peer'] = figures['cpu_transaction'] / of_one['cpu_transaction']
            number = f'{drives} drive{"s" * (drives != 1)}'
            yield f'{master}, {protocol}, {baud_rate} bit/s, {number}', figures


def _watch(rig: Rig, seconds: float) -> dict[str, float]:
    """
    Return what happened in a window, in which every drive was polled twice at least.

    :raises RuntimeError: they never were.
    """
    line = rig.line
    place = load_family(line.model)[_STATUS[line.model]].at(line.space).index
    watched_since = rig.begin_watch()
    for _ in range(_MOST_WINDOWS):
        time.sleep(seconds)
        window = watched_since()
        if trace_file.units_with_cycles(window.frames, line, place) == rig.drives:
            return {
                **trace_file.cycles(window.frames, line, place),
                'short_gaps': trace_file.short_gaps(window.frames, line),
                **window.figures(),
            }
    raise RuntimeError('not every drive was polled twice')
