# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The measurements: each gives some rows of the tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from row import Effort, Row
import setpoints
import speed
import stops


@dataclass(frozen=True)
class Measurement:
    """
    What is measured at a time.

    :ivar group: what ``--only`` takes.
    :ivar measure: makes it, once, and returns its rows.
    :ivar minor: ``--quick`` leaves it out, unless its group is asked for.
    """

    group: str
    what: str
    baud_rate: int
    measure: Callable[[Effort], list[Row]]
    minor: bool = False

    def __str__(self) -> str:
        return f'{self.what}, {self.baud_rate} bit/s'


def all_measurements() -> Iterator[Measurement]:
    """Return every measurement in the order of the tables."""
    for group, protocol in (('rtu', 'modbus_rtu'), ('classic', 'classic')):
        for baud_rate in (57600, 19200):
            measure = partial(speed.measure, protocol, baud_rate, speed.DRIVES)
            yield Measurement(group, protocol, baud_rate, measure)
    measure = partial(speed.measure, 'movitrac', 9600, speed.SLOW_DRIVES)
    yield Measurement('movitrac', 'movitrac', 9600, measure)
    at = setpoints.BAUD_RATE
    yield Measurement('setpoints', 'an idle line', at, setpoints.measure_idle)
    for drives in setpoints.DRIVES:
        what = f'{drives} enabled'
        yield Measurement('setpoints', what, at, partial(setpoints.measure, drives))
    for protocol, baud_rate, kinds in (
        ('modbus_rtu', 57600, stops.KINDS),
        ('modbus_rtu', 19200, stops.KINDS),
        ('modbus_ascii', 19200, stops.FEW_KINDS),
        ('classic', 57600, stops.FEW_KINDS),
        ('classic', 9600, stops.SLOW_KINDS),
    ):
        measure = partial(stops.measure, protocol, baud_rate, kinds)
        yield Measurement(
            'stop', f'stops, {protocol}', baud_rate, measure, minor=baud_rate != 57600
        )
