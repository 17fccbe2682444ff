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

"""The verb ``monitor``: what drives and line do, again and again; it only reads."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from collections.abc import Sequence
import dataclasses
from datetime import datetime
import itertools
import json
import math
import shutil
import sys
import time

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.bus import Statistics
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.cli.console import put
from nfo_sinus_driver.cli.console import say
from nfo_sinus_driver.cli.session import Remote
from nfo_sinus_driver.cli.session import Session
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import InverterStatus
from nfo_sinus_driver.link import PortError
from nfo_sinus_driver.link import Refused

#: What is measured: its name, as in the messages of the driver, its width and its decimals.
_VALUES = {
    Role.ACTUAL_FREQUENCY: ('frequency', 6, 1),
    Role.ACTUAL_SPEED: ('speed', 5, 0),
    Role.OUTPUT_CURRENT: ('output_current', 6, 2),
    Role.OUTPUT_VOLTAGE: ('output_voltage', 4, 0),
    Role.OUTPUT_POWER: ('output_power', 5, 0),
    Role.ACTUAL_TORQUE: ('torque', 4, 0),
    Role.DC_LINK_VOLTAGE: ('dc_link_voltage', 4, 0),
}
_CLEAR_LINE = '\r\x1b[K'


def monitor(options: argparse.Namespace) -> int:
    """Show what the drives do until somebody ends it, and then how the line was doing."""
    addresses = options.addresses or (options.address,)
    live = sys.stdout.isatty() and not options.json and len(addresses) == 1
    answered = False
    with Session(options) as session:
        drives = [session.drive(address) for address in addresses]
        if len(drives) == 1:
            # with others beside it the missing one has a line that says so
            drives[0].identify(thoroughly=False)
        try:
            for turn in itertools.count(1):
                started = time.monotonic()
                shown = [_show(drive, session, options, live=live) for drive in drives]
                answered = all(shown)
                if turn == options.count:
                    break
                time.sleep(max(0.0, started + options.period - time.monotonic()))
        except KeyboardInterrupt:
            # this is how one ends it
            answered = True
        finally:
            if live:
                print()
        if not options.json:
            for line in statistics_table(session, addresses):
                print(line, file=sys.stderr)
    return int(not answered)


def _show(drive: Remote, session: Session, options: argparse.Namespace, *, live: bool) -> bool:
    """Print one line; return whether the drive answered."""
    now = datetime.now().astimezone()
    try:
        if drive.inverter.identity is None:
            drive.identify(thoroughly=False)
        seen, values = drive.do(lambda: _measure(drive))
    except DriveError as error:
        if isinstance(error.__cause__, PortError):
            raise
        facts: dict[str, object] = {'connected': False}
        text = say(error)
        answered = False
    else:
        session.polled(drive.address)
        facts = _facts(drive, seen, values)
        text = _line(drive, values)
        answered = True
    if options.json:
        told = as_facts(session.statistics(drive.address))
        whole = {'time': now.isoformat(), 'address': drive.address, **facts, 'statistics': told}
        put(json.dumps(whole, ensure_ascii=False))
        return answered
    who = f'{drive.address:>3}  ' if options.addresses else ''
    text = f'{now:%H:%M:%S}  {who}{text}'
    if live:
        width = shutil.get_terminal_size().columns - 1
        print(f'{_CLEAR_LINE}{text[:width]}', end='', flush=True)
    else:
        put(text)
    return answered


async def _measure(drive: Remote) -> tuple[InverterStatus, Mapping[Role, float]]:
    seen = await drive.inverter.look(Priority.POLL, once=True)
    values = dict.fromkeys(_VALUES, math.nan)
    for role in _VALUES:
        key = drive.model.key(role)
        if not drive.registers.reaches(key):
            continue
        try:
            values[role] = await drive.registers.read_number(key, Priority.POLL, once=True)
        except Refused:
            # it has none
            continue
    return seen, values


def _facts(drive: Remote, seen: InverterStatus, values: Mapping[Role, float]) -> dict[str, object]:
    measured = {
        name: None if math.isnan(values[role]) else values[role]
        for role, (name, _, _) in _VALUES.items()
    }
    return {
        'connected': True,
        'code': seen.code,
        'text': drive.inverter.text,
        'kind': drive.inverter.kind.value,
        'state': seen.state.name,
        **measured,
    }


def _line(drive: Remote, values: Mapping[Role, float]) -> str:
    cells = [f'{drive.inverter.describe():<18}']
    for role, (_, width, decimals) in _VALUES.items():
        value, key = values[role], drive.model.key(role)
        number = '-' if math.isnan(value) else f'{value:.{decimals}f}'
        unit = drive.model[key].unit if key in drive.model else ''
        cells.append(f'{number:>{width}} {unit}')
    return '  '.join(cells)


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
