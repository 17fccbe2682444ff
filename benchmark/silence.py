# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How soon the stops of all drives are on a line whose answers are lost from one moment on.

In virtual time, with the rig of the tests: what counts are time-outs, and not the machine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
import statistics
import sys

from nfo_sinus_driver.families.sinus_g2.words import Scmd

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test'))
from support.rig import Rig

_BAUD_RATES = (57600, 19200)
_DRIVES = (1, 8, 32)
#: The settings of the driver that the rig of the tests has otherwise.
_DEFAULTS = {'poll_rate': 50.0, 'telemetry_rate': 2.0, 'drive_timeout': -1.0}
#: When the stop is called for, after the first answer that was lost, s.
_CALLED_AFTER = 0.3
#: What is not on the line by then never comes, s.
_LOST = 30.0
#: How long a driver that ends waits for its drives, s.
_PATIENCE = 4.0


def _stop_all(rig: Rig) -> None:
    for drive in rig.drives.values():
        drive.stop()


def _exit(rig: Rig) -> None:
    for drive in rig.drives.values():
        drive.stop_for_good(_PATIENCE)


#: Who stops the motors; ``None``: the driver itself, when it finds the drives lost.
CASES: dict[str, Callable[[Rig], None] | None] = {
    'loss': None, 'stop_all': _stop_all, 'SIGTERM': _exit,
}
COLUMNS = (
    ('drives', 'drives', 0),
    ('first, s', 'first', 2),
    ('median, s', 'median', 2),
    ('last, s', 'last', 2),
    ('last / N time-outs', 'ratio', 2),
    ('never came', 'lost', 0),
    ('motors that still turn', 'turning', 0),
)


def measure(baud_rates: tuple[int, ...] = _BAUD_RATES) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the title and the figures of each row."""
    for baud_rate in baud_rates:
        for title, stop in CASES.items():
            for drives in _DRIVES:
                where = f'{baud_rate} bit/s, {drives} drive{"s" * (drives != 1)}'
                yield f'{title} to wire, {where}', _measure(baud_rate, drives, stop)


def _measure(
    baud_rate: int, drives: int, stop: Callable[[Rig], None] | None
) -> dict[str, float]:
    rig = Rig(drives=drives, line={'baud': baud_rate}, **_DEFAULTS)
    try:
        rig.turn()
        rig.line.state = 'deaf'
        begun = rig.clock.now
        stopped: dict[int, float] = {}

        def meet(key: str, data: bytes | None) -> None:
            unit = rig.asked[-1][0]
            if key == 'fieldbus.scmd' and data is not None and rig.number(data) == Scmd.STOP:
                stopped.setdefault(unit, rig.clock.now - begun)

        rig.meet = meet
        if stop is not None:
            # in the midst of a request that is in vain
            begun += _CALLED_AFTER
            rig.line.later(begun, lambda: stop(rig))
        rig.pass_time(_LOST)
        turning = sum(far.motor.driven and far.motor.demand != 0 for far in rig.fars.values())
    finally:
        rig.kill()
    figures = {'drives': drives, 'lost': drives - len(stopped), 'turning': turning}
    if stopped:
        came = sorted(stopped.values())
        least = drives * rig.line.settings.response_timeout
        figures |= {
            'first': came[0],
            'median': statistics.median(came),
            'last': came[-1],
            'ratio': came[-1] / least,
        }
    return figures
