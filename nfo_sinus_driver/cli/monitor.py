# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``monitor``: drives and line, again and again, as lines or as a view; it only reads."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
import contextlib
import dataclasses
from datetime import datetime
import itertools
import math
import queue
import sys
import threading
import time
from typing import Any

from nfo_sinus_driver.bus import Priority, Statistics
from nfo_sinus_driver.catalog import Kind, Role, State
from nfo_sinus_driver.cli.console import CliError, as_json, columns, put, remark, say
from nfo_sinus_driver.cli.options import Verb, add_flag, addresses, period, times
from nfo_sinus_driver.cli.session import OfflineDrive, Session
from nfo_sinus_driver.drive import DriveError, InverterStatus
from nfo_sinus_driver.link import PortError, Refused
from nfo_sinus_driver.view import is_terminal, show, why_unavailable
from nfo_sinus_driver.view.picture import (
    Condition,
    DriveView,
    Level,
    Measured,
    Note,
    Picture,
    error_line,
)

#: What is measured, by its name in the messages of the driver; its width and its decimals.
_VALUES = {
    'frequency': (Role.ACTUAL_FREQUENCY, 6, 1),
    'speed': (Role.ACTUAL_SPEED, 5, 0),
    'output_current': (Role.OUTPUT_CURRENT, 6, 2),
    'output_voltage': (Role.OUTPUT_VOLTAGE, 4, 0),
    'output_power': (Role.OUTPUT_POWER, 5, 0),
    'torque': (Role.ACTUAL_TORQUE, 4, 0),
    'dc_link_voltage': (Role.DC_LINK_VOLTAGE, 4, 0),
}
#: What stands above the figures of the line.
_COLUMNS = (
    '', 'used', 'cycle', 'min', 'median', 'p99', 'max', 'requests', 'no answer', 'damaged',
    'refused', 'repeated',
)
#: So many entries of an error log are shown.
_MOST_ERRORS = 8
#: How long the present reading may take at the end, s.
_LAST_READING = 2.0
_CONDITIONS = {Kind.FAULT: Condition.FAULT, Kind.ALARM: Condition.ALARM}
_RUNS = (State.OPERATION_ENABLED, State.STOPPING, State.QUICK_STOP)


class Monitor(Verb):
    """Show what the drive does, until q or Ctrl-C; then how the line was doing."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        parser.add_argument(
            '--period', type=period, default=0.5, metavar='SECONDS',
            help='from one line to the next (default: 0.5)',
        )
        parser.add_argument('--count', type=times, metavar='TIMES', help='end after so many')
        add_flag(
            parser, '--lines',
            'a line each time, where a terminal would show the view; so does --count',
        )
        parser.add_argument(
            '--addresses', type=addresses, default=(), metavar='LIST',
            help='several drives of the line, such as 1-10,20 (default: that of --address)',
        )

    def main(self, options: argparse.Namespace) -> int:
        """Show it until the operator ends it, and then how the line was doing."""
        view = is_terminal() and not (options.json or options.lines or options.count)
        missing = why_unavailable() if view else ''
        if missing:
            remark(f'{missing}. What it would show comes line by line')
        numbers = options.addresses or (options.address,)
        with Session(options) as session:
            drives = [session.drive(number) for number in numbers]
            if len(drives) == 1:
                # of several, the one that is missing has a line that says so
                drives[0].identify(thoroughly=False)
            if view and not missing:
                status = _show_view(options, session, drives)
            else:
                status = _show_lines(options, session, drives)
            if not options.json:
                for line in _statistics_table(session, numbers):
                    print(line, file=sys.stderr)
        return status


def _read(
    session: Session, drive: OfflineDrive
) -> tuple[InverterStatus, Mapping[str, float]]:
    """Read the status of a drive and what it measures; NaN for what it has not got."""
    if drive.state.nameplate.identity is None:
        drive.identify(thoroughly=False)

    async def measure() -> tuple[InverterStatus, Mapping[str, float]]:
        status = await drive.state.reader.read(Priority.POLL, retry=False)
        values = dict.fromkeys(_VALUES, math.nan)
        for name, (role, _, _) in _VALUES.items():
            key = drive.model.key(role)
            # a drive that refuses it has none
            with contextlib.suppress(Refused):
                if drive.params.reaches(key):
                    values[name] = await drive.params.read_number(key, Priority.POLL, retry=False)
        return status, values

    found = drive.do(measure)
    session.polled(drive.address)
    return found


# --- as lines ---------------------------------------------------------------------------------


def _show_lines(
    options: argparse.Namespace, session: Session, drives: Sequence[OfflineDrive]
) -> int:
    answered = False
    try:
        for turn in itertools.count(1):
            started = time.monotonic()
            shown = [_show_line(drive, session, options) for drive in drives]
            answered = all(shown)
            if turn == options.count:
                break
            time.sleep(max(0.0, started + options.period - time.monotonic()))
    except KeyboardInterrupt:
        # this is how one ends it
        answered = True
    return int(not answered)


def _show_line(drive: OfflineDrive, session: Session, options: argparse.Namespace) -> bool:
    """Print one line; return whether the drive answered."""
    now = datetime.now().astimezone()
    facts: dict[str, object] = {'connected': False}
    try:
        status, values = _read(session, drive)
    except DriveError as error:
        if isinstance(error.__cause__, PortError):
            raise
        text = say(error)
    else:
        facts = {
            'connected': True,
            'code': status.code,
            'text': drive.state.text,
            'kind': drive.state.kind.value,
            'state': status.state.name,
            **values,
        }
        text = _line(drive, values)
    if options.json:
        # the names are those of BusStatistics
        figures = dataclasses.asdict(session.statistics(drive.address))
        whole = {'time': now.isoformat(), 'address': drive.address, **facts, 'statistics': figures}
        text = as_json(whole)
    else:
        address = f'{drive.address:>3}  ' if options.addresses else ''
        text = f'{now:%H:%M:%S}  {address}{text}'
    put(text)
    return facts['connected'] is True


def _line(drive: OfflineDrive, values: Mapping[str, float]) -> str:
    cells = [f'{drive.state.describe():<18}']
    for name, (role, width, decimals) in _VALUES.items():
        value, key = values[name], drive.model.key(role)
        number = '-' if math.isnan(value) else f'{value:.{decimals}f}'
        unit = drive.model[key].unit if key in drive.model else ''
        cells.append(f'{number:>{width}} {unit}')
    return '  '.join(cells)


def _statistics_table(session: Session, numbers: Sequence[int]) -> list[str]:
    """Return the lines of a table: the line, and each drive; round trips and cycle in ms."""
    rows = [('line', session.statistics())]
    if len(numbers) > 1:
        rows += [(f'drive {number}', session.statistics(number)) for number in numbers]
    cells = [_COLUMNS, *(_figures(*row) for row in rows)]
    return columns(cells, right=range(1, len(_COLUMNS)))


def _figures(name: str, of: Statistics) -> list[str]:
    times = (
        of.cycle_time, of.round_trip_min, of.round_trip_median, of.round_trip_p99,
        of.round_trip_max,
    )
    counts = (of.transactions, of.timeouts, of.damaged, of.refused, of.retries)
    shown = ['-' if math.isnan(seconds) else f'{1000 * seconds:.1f}' for seconds in times]
    return [name, f'{100 * of.utilisation:.0f} %', *shown, *map(str, counts)]


# --- as a view --------------------------------------------------------------------------------


def _show_view(
    options: argparse.Namespace, session: Session, drives: Sequence[OfflineDrive]
) -> int:
    source = LineSource(options, session, drives)
    try:
        show(source)
    finally:
        source.close()
    return 0


class LineSource:
    """What drives on a line say, read again and again by a thread of its own."""

    advice = ''
    only_looks = 'only looks: nfo-sinus stop stops'

    def __init__(
        self, options: argparse.Namespace, session: Session, drives: Sequence[OfflineDrive]
    ) -> None:
        self.title: str = options.port
        self._period: float = options.period
        self._session = session
        self._drives = drives
        #: What was read of each drive, and when (s of ``time.monotonic``).
        self._views: dict[int, tuple[DriveView, float]] = {}
        for drive in drives:
            self._set(drive, Condition.SILENT, 'being asked')
        self._line: dict[str, Statistics] = {}
        #: The drives whose error logs are to be read, and what came of those that were.
        self._wanted: set[str] = set()
        self._errors: dict[str, Sequence[str]] = {}
        self._logged: dict[int, str] = {}
        self._notes: queue.SimpleQueue[Note] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._work, name='reader', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Read no more."""
        self._closing.set()
        self._thread.join(_LAST_READING)

    def next_picture(self) -> Picture:
        """Return what was read last."""
        notes = [self._notes.get() for _ in range(self._notes.qsize())]
        now = time.monotonic()
        views = [
            dataclasses.replace(view, age=now - at, errors=self._errors.get(view.name, ()))
            for view, at in self._views.values()
        ]
        return Picture(views, self._line, notes)

    def stop(self, name: str) -> None:
        """Ignore it: this view only looks."""

    def stop_all(self) -> None:
        """Ignore it: this view only looks."""

    def acknowledge(self, name: str) -> None:
        """Ignore it: this view only looks."""

    def read_errors(self, name: str) -> None:
        """Read the error log of a drive with the next round."""
        self._errors.pop(name, None)
        self._wanted.add(name)

    # --- on the thread that reads -------------------------------------------------------------

    def _work(self) -> None:
        try:
            self._read_all()
        except Exception as error:
            # what stands there would be taken for what is so
            for drive in self._drives:
                self._log(drive, Level.ERROR, f'error in the view, nothing is read: {error!r}')
                self._set(drive, Condition.SILENT, 'not read any more')

    def _read_all(self) -> None:
        started = time.monotonic()
        for turn in itertools.count(1):
            for drive in self._drives:
                if self._closing.is_set():
                    return
                self._update(drive)
            self._line = {'line': self._session.statistics()}
            self._closing.wait(max(0.0, started + turn * self._period - time.monotonic()))
            # a line that is slower than that is read without a pause, and catches up with nothing
            started = max(started, time.monotonic() - turn * self._period)

    def _update(self, drive: OfflineDrive) -> None:
        try:
            status, values = _read(self._session, drive)
        except DriveError as error:
            self._log(drive, Level.ERROR, say(error))
            self._set(drive, Condition.SILENT, 'not connected')
            return
        shown = drive.state.describe()
        grave = status.kind is not Kind.STATUS
        self._log(drive, Level.WARNING if grave else Level.INFO, shown)
        runs = status.runs or status.tuning or status.state in _RUNS or abs(values['frequency']) > 0
        usual = Condition.RUNS if runs else Condition.STANDS
        self._set(
            drive, _CONDITIONS.get(status.kind, usual), shown,
            cause=status.listed.description if grave else '', remedy=status.listed.remedy,
            requires_ack=status.listed.requires_ack, unit='Hz', actual=values['frequency'],
            measured=Measured(**values),
            line=self._session.statistics(drive.address),
        )
        if (name := _name(drive)) in self._wanted:
            self._wanted.discard(name)
            self._errors[name] = _error_lines(drive)

    def _set(
        self, drive: OfflineDrive, condition: Condition, status: str, **more: Any
    ) -> None:
        view = DriveView(_name(drive), condition, status, **more)
        self._views[drive.address] = view, time.monotonic()

    def _log(self, drive: OfflineDrive, level: Level, text: str) -> None:
        """Put it into the log, if the last line about this drive is another one."""
        if self._logged.get(drive.address) != text:
            self._logged[drive.address] = text
            self._notes.put(Note(time.time(), level, _name(drive), text))


def _error_lines(drive: OfflineDrive) -> Sequence[str]:
    try:
        entries = drive.error_log(_MOST_ERRORS)
    except (CliError, DriveError) as error:
        return (say(error),)
    lines = [
        error_line(entry.code, entry.text, entry.operating_time, math.nan) for entry in entries
    ]
    return lines or ['empty']


def _name(drive: OfflineDrive) -> str:
    return f'drive {drive.address}'
