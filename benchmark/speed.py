# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How fast drives are polled, and what that costs, by number of drives; the peer beside it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import time

from rig import DRIVER, PEER, Rig, Window, memory
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
    ("CPU / peer's", 'cpu_to_peer', 2),
    ('the same, subscribed to', 'heard_transaction', 2),
    ("CPU / peer's, subscribed to", 'heard_to_peer', 2),
    ('memory, MB', 'memory', 0),
)


def measure(
    seconds: float, cases: Sequence[tuple[str, int, int]] = CASES
) -> Iterator[tuple[str, dict[str, float]]]:
    """
    Yield the title and the figures of each row; windows last so many seconds at least.

    Driver and peer are measured at once, each on a line of its own: whatever the machine does
    meanwhile, it does to both.
    """
    for protocol, baud_rate, drives in cases:
        masters = (PEER, DRIVER) if protocol == 'modbus_rtu' else (DRIVER,)
        with contextlib.ExitStack() as stack:
            rigs = [
                stack.enter_context(Rig(master, baud_rate, drives, protocol))
                for master in masters
            ]
            heard = _watch(rigs, seconds)
            for rig in rigs:
                rig.lose_audience()
            found = _watch(rigs, seconds)
            for rig, figures, with_audience in zip(rigs, found, heard, strict=True):
                # subscribers are the rule, and they take time from the line
                figures.update({name: with_audience[name] for name in ('time', 'p99', 'ratio')})
                figures['heard_transaction'] = with_audience['cpu_transaction']
                figures['memory'] = memory(rig.master.pid)
        number = f'{drives} drive{"s" * (drives != 1)}'
        for master, figures in zip(masters, found, strict=True):
            if masters != (DRIVER,):
                for name, ratio in _TO_PEER.items():
                    figures[ratio] = figures[name] / found[0][name]
            yield f'{master}, {protocol}, {baud_rate} bit/s, {number}', figures


#: What is compared with the peer's, and as what.
_TO_PEER = {
    'cpu_transaction': 'cpu_to_peer',
    'heard_transaction': 'heard_to_peer',
    'memory': 'memory_to_peer',
}


def _watch(rigs: Sequence[Rig], seconds: float) -> list[dict[str, float]]:
    """
    Return what happened on each line in a window in which all drives were polled twice at least.

    :raises RuntimeError: they never were.
    """
    watched = [rig.begin_watch() for rig in rigs]
    for _ in range(_MOST_WINDOWS):
        time.sleep(seconds)
        figures = [_figures(rig, end()) for rig, end in zip(rigs, watched, strict=True)]
        if all(figures):
            return figures
    raise RuntimeError('not every drive was polled twice')


def _figures(rig: Rig, window: Window) -> dict[str, float]:
    """Return the figures of a window; none if not every drive was polled twice."""
    line = rig.line
    place = load_family(line.model)[_STATUS[line.model]].at(line.space).index
    if trace_file.units_with_cycles(window.frames, line, place) != rig.drives:
        return {}
    return {
        **trace_file.cycles(window.frames, line, place),
        'short_gaps': trace_file.short_gaps(window.frames, line),
        **window.figures(),
    }
