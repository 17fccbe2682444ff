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

"""The verb ``monitor``: what the drives do, again and again; it only reads."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from datetime import datetime
import itertools
import json
import math
import shutil
import sys
import time

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.cli.progress import put
from nfo_sinus_driver.cli.session import Remote
from nfo_sinus_driver.cli.session import Session
from nfo_sinus_driver.cli.statistics_table import as_facts
from nfo_sinus_driver.cli.statistics_table import statistics_table
from nfo_sinus_driver.cli.wording import say
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


def _show(
    drive: Remote, session: Session, options: argparse.Namespace, *, live: bool
) -> bool:
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


def _facts(
    drive: Remote, seen: InverterStatus, values: Mapping[Role, float]
) -> dict[str, object]:
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
