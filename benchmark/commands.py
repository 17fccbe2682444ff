# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How soon set-points and stops are on a full line with enabled drives; the peer beside it."""

from __future__ import annotations

from collections.abc import Iterator
import json
import statistics
import subprocess
from typing import Any

from rig import DRIVER, PEER, Rig, end
import trace_file

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.families.sinus_g2.words import Scmd

_BAUD_RATE = 57600
DRIVES = (1, 8, 32)
_MODEL = load_family('sinus_g2')
_SETPOINT = _MODEL['status.frq_set'].at('modbus').index
_SCMD = _MODEL['fieldbus.scmd'].at('modbus').index
#: A drive may wait for its turn of the client, s. Its own time-out is set, as on a real conveyor; a
#: machine that is busy elsewhere stops no motor.
_SETTINGS = {'setpoint_timeout': 10.0, 'drive_timeout': 5.0, 'lost_after': 4.0}
#: A set-point that is not on the line by then was replaced by a newer one, s.
_LOST = 1.5
COLUMNS = (
    ('events', 'events', 0),
    ('median, ms', 'time', 2),
    ('p99, ms', 'p99', 2),
    ('longest, ms', 'longest', 2),
    ('transaction, ms', 'limit', 2),
    ('never came', 'lost', 0),
    ('CPU, % of a core', 'cpu', 1),
)


def measure(count: int) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the title and the figures of each row, of so many set-points and a tenth of stops."""
    for drives in DRIVES:
        for master in (PEER, DRIVER):
            where = f'{master}, {_BAUD_RATE} bit/s, {drives} drive{"s" * (drives != 1)}'
            settings = _SETTINGS if master == DRIVER else {}
            with Rig(master, _BAUD_RATE, drives, **settings) as rig:
                rig.enable_all()
                yield f'set-point to wire, {where}', _delays(rig, 'setpoints', count)
                rig.enable_all()
                steady = rig.script('client.py', 'steady', '0', *rig.names)
                yield f'stop to wire, {where}', _delays(rig, 'stops', max(count // 10, 5))
                end(steady)


def _delays(rig: Rig, what: str, count: int) -> dict[str, float]:
    """Have a client do something so often; return how long it took to the line."""
    watched_since = rig.begin_watch()
    client = rig.script('client.py', what, str(count), *rig.names, stdout=subprocess.PIPE)
    assert client.stdout is not None
    called: list[tuple[float, int, float]] = json.loads(client.stdout.readline() or '[]')
    window = watched_since()
    if not called:
        raise RuntimeError(f'the client that makes {what} has failed')
    written: dict[tuple[Any, ...], list[float]] = {}
    register = _SETPOINT if what == 'setpoints' else _SCMD
    for at, unit, word in trace_file.writes(window.frames, register):
        written.setdefault((unit, word), []).append(at)
    delays = []
    for at, drive, value in called:
        word = int(Scmd.STOP)
        if what == 'setpoints':
            word = int.from_bytes(_MODEL['status.frq_set'].quantise(value, 'modbus'), 'big')
        moments = written.get((drive + 1, word), ())
        came = [moment for moment in moments if at <= moment < at + _LOST]
        delays += [moment - at for moment in came[:1]]
    if not delays:
        raise RuntimeError(f'none of the {what} came to the line')
    return {
        'events': len(called),
        'time': 1e3 * statistics.median(delays),
        'p99': 1e3 * trace_file.percentile(delays, 99),
        'longest': 1e3 * max(delays),
        'limit': 1e3 * trace_file.longest_transaction(window.frames, rig.line),
        'lost': len(called) - len(delays),
        **window.figures(),
    }
