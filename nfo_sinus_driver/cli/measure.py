# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What ``monitor`` reads of a drive, and the figures of the line that it ends with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import dataclasses
import math

from nfo_sinus_driver.bus import Priority, Statistics
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.cli.session import OfflineDrive, Session
from nfo_sinus_driver.drive import InverterStatus
from nfo_sinus_driver.link import Refused

#: What is measured: its name, as in the messages of the driver, its width and its decimals.
VALUES = {
    Role.ACTUAL_FREQUENCY: ('frequency', 6, 1),
    Role.ACTUAL_SPEED: ('speed', 5, 0),
    Role.OUTPUT_CURRENT: ('output_current', 6, 2),
    Role.OUTPUT_VOLTAGE: ('output_voltage', 4, 0),
    Role.OUTPUT_POWER: ('output_power', 5, 0),
    Role.ACTUAL_TORQUE: ('torque', 4, 0),
    Role.DC_LINK_VOLTAGE: ('dc_link_voltage', 4, 0),
}


async def measure(drive: OfflineDrive) -> tuple[InverterStatus, Mapping[Role, float]]:
    """Read the status of a drive and what it measures; NaN for what it has not got."""
    seen = await drive.state.look(Priority.POLL, once=True)
    values = dict.fromkeys(VALUES, math.nan)
    for role in VALUES:
        key = drive.model.key(role)
        if not drive.params.reaches(key):
            continue
        try:
            values[role] = await drive.params.read_number(key, Priority.POLL, once=True)
        except Refused:
            # it has none
            continue
    return seen, values


#: The columns: what stands above, and the width.
_COLUMNS = (
    ('', 7),
    ('used', 5),
    ('cycle', 8),
    ('min', 7),
    ('median', 7),
    ('p99', 7),
    ('max', 7),
    ('requests', 8),
    ('no answer', 9),
    ('damaged', 7),
    ('refused', 7),
    ('repeated', 8),
)


def statistics_table(session: Session, addresses: Sequence[int]) -> list[str]:
    """Return the lines of a table: the line, and each drive; round trips and cycle in ms."""
    rows = [('line', session.statistics())]
    if len(addresses) > 1:
        rows += [(f'drive {address}', session.statistics(address)) for address in addresses]
    cells = [[name for name, _ in _COLUMNS], *(_cells(name, figures) for name, figures in rows)]
    return [_row(row) for row in cells]


def as_facts(figures: Statistics) -> dict[str, float | int | None]:
    """Return figures for JSON, which has no NaN; the names are those of BusStatistics."""
    return {
        name: None if math.isnan(value) else value
        for name, value in dataclasses.asdict(figures).items()
    }


def _cells(name: str, figures: Statistics) -> list[str]:
    times = (
        figures.cycle_time,
        figures.round_trip_min,
        figures.round_trip_median,
        figures.round_trip_p99,
        figures.round_trip_max,
    )
    counts = (
        figures.transactions,
        figures.timeouts,
        figures.damaged,
        figures.refused,
        figures.retries,
    )
    share = f'{100 * figures.utilisation:.0f} %'
    return [name, share, *map(_milliseconds, times), *map(str, counts)]


def _milliseconds(seconds: float) -> str:
    return '-' if math.isnan(seconds) else f'{1000 * seconds:.1f}'


def _row(cells: list[str]) -> str:
    first, *others = zip(cells, _COLUMNS, strict=True)
    left = f'{first[0]:<{first[1][1]}}'
    return '  '.join((left, *(f'{cell:>{width}}' for cell, (_, width) in others)))
