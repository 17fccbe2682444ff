# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``monitor``: what drives and line do, again and again; it only reads."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from datetime import datetime
import importlib.util
import itertools
import json
import math
import os
import shutil
import sys
import time

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.cli.console import UsageError, put, remark, say
from nfo_sinus_driver.cli.live import live
from nfo_sinus_driver.cli.measure import VALUES, as_facts, measure, statistics_table
from nfo_sinus_driver.cli.session import OfflineDrive, Session
from nfo_sinus_driver.drive import DriveError, InverterStatus
from nfo_sinus_driver.link import PortError
from nfo_sinus_driver.view import terminal

_CLEAR_LINE = '\r\x1b[K'


#: The view of the running driver: only there ROS is known.
_ROS_VIEW = 'nfo_sinus_driver.node.monitor'


def monitor(options: argparse.Namespace) -> int:
    """Show what the drives do until somebody ends it, and then how the line was doing."""
    if options.ros:
        if importlib.util.find_spec('rclpy') is None:
            raise UsageError('--ros needs ROS 2: source /opt/ros/jazzy/setup.bash first')
        if options.json or options.lines or options.count or options.addresses:
            raise UsageError('--ros shows the drives of running drivers, with no other option')
        os.execv(sys.executable, [sys.executable, '-m', _ROS_VIEW])
    if terminal.is_terminal() and not (options.json or options.lines or options.count):
        why_not = terminal.why_not()
        if not why_not:
            return live(options)
        remark(f'{why_not}. What it would show comes line by line')
    return _by_lines(options)


def _by_lines(options: argparse.Namespace) -> int:
    addresses = options.addresses or (options.address,)
    one_line = sys.stdout.isatty() and not options.json and len(addresses) == 1
    answered = False
    with Session(options) as session:
        drives = [session.drive(address) for address in addresses]
        if len(drives) == 1:
            # with others beside it the missing one has a line that says so
            drives[0].identify(thoroughly=False)
        try:
            for turn in itertools.count(1):
                started = time.monotonic()
                shown = [_show(drive, session, options, one_line=one_line) for drive in drives]
                answered = all(shown)
                if turn == options.count:
                    break
                time.sleep(max(0.0, started + options.period - time.monotonic()))
        except KeyboardInterrupt:
            # this is how one ends it
            answered = True
        finally:
            if one_line:
                print()
        if not options.json:
            for line in statistics_table(session, addresses):
                print(line, file=sys.stderr)
    return int(not answered)


def _show(
    drive: OfflineDrive, session: Session, options: argparse.Namespace, *, one_line: bool
) -> bool:
    """Print one line; return whether the drive answered."""
    now = datetime.now().astimezone()
    try:
        if drive.state.identity is None:
            drive.identify(thoroughly=False)
        seen, values = drive.do(lambda: measure(drive))
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
    if one_line:
        width = shutil.get_terminal_size().columns - 1
        print(f'{_CLEAR_LINE}{text[:width]}', end='', flush=True)
    else:
        put(text)
    return answered


def _facts(
    drive: OfflineDrive, seen: InverterStatus, values: Mapping[Role, float]
) -> dict[str, object]:
    measured = {
        name: None if math.isnan(values[role]) else values[role]
        for role, (name, _, _) in VALUES.items()
    }
    return {
        'connected': True,
        'code': seen.code,
        'text': drive.state.text,
        'kind': drive.state.kind.value,
        'state': seen.state.name,
        **measured,
    }


def _line(drive: OfflineDrive, values: Mapping[Role, float]) -> str:
    cells = [f'{drive.state.describe():<18}']
    for role, (_, width, decimals) in VALUES.items():
        value, key = values[role], drive.model.key(role)
        number = '-' if math.isnan(value) else f'{value:.{decimals}f}'
        unit = drive.model[key].unit if key in drive.model else ''
        cells.append(f'{number:>{width}} {unit}')
    return '  '.join(cells)
