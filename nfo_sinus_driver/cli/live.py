# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``monitor`` on a terminal: the same view as beside the running driver, from the line itself."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
import itertools
import queue
import sys
import threading
import time

from nfo_sinus_driver.catalog import Kind, State
from nfo_sinus_driver.cli.console import say
from nfo_sinus_driver.cli.measure import VALUES, measure, statistics_table
from nfo_sinus_driver.cli.session import OfflineDrive, Session
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.view import terminal
from nfo_sinus_driver.view.picture import (
    Condition,
    DriveView,
    Level,
    LineView,
    Measured,
    Note,
    Picture,
    line_view,
)

#: How long the present reading may take at the end, s.
_LAST_READING = 2.0

_CONDITIONS = {Kind.FAULT: Condition.FAULT, Kind.ALARM: Condition.ALARM}
_RUNS = (State.OPERATION_ENABLED, State.STOPPING, State.QUICK_STOP)


def live(options: argparse.Namespace) -> int:
    """Show the view until somebody ends it, and then how the line was doing."""
    addresses = options.addresses or (options.address,)
    with Session(options) as session:
        drives = [session.drive(address) for address in addresses]
        if len(drives) == 1:
            # who asks for one wants to be told at once that it is not there
            drives[0].identify(thoroughly=False)
        source = LineSource(options, session, drives)
        try:
            terminal.show(source)
        finally:
            source.close()
        for line in statistics_table(session, addresses):
            print(line, file=sys.stderr)
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
        self._views = {
            drive.address: (
                DriveView(_name(drive), Condition.SILENT, 'being asked'), time.monotonic()
            )
            for drive in drives
        }
        self._line: LineView | None = None
        self._said: dict[int, str] = {}
        self._notes: queue.SimpleQueue[Note] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._work, name='reader', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Read no more."""
        self._closing.set()
        self._thread.join(_LAST_READING)

    # --- as a source of pictures --------------------------------------------------------------

    def look(self) -> Picture:
        """Return what was read last."""
        notes = []
        while not self._notes.empty():
            notes.append(self._notes.get())
        now = time.monotonic()
        views = [replace(view, age=now - at) for view, at in self._views.values()]
        return Picture(views, [self._line] if self._line else [], notes)

    def stop(self, name: str) -> None:
        """Nothing: it only looks."""

    def stop_all(self) -> None:
        """Nothing: it only looks."""

    # --- on the thread that reads -------------------------------------------------------------

    def _work(self) -> None:
        try:
            self._read_all()
        except Exception as error:
            # what stands there would be taken for what is so
            for drive in self._drives:
                self._tell(drive, Level.ERROR, f'error in the view, nothing is read: {error!r}')
                lost = DriveView(_name(drive), Condition.SILENT, 'not read any more')
                self._views[drive.address] = lost, time.monotonic()

    def _read_all(self) -> None:
        started = time.monotonic()
        for turn in itertools.count(1):
            for drive in self._drives:
                if self._closing.is_set():
                    return
                self._views[drive.address] = self._read(drive), time.monotonic()
            self._line = line_view('line', self._session.statistics())
            self._closing.wait(max(0.0, started + turn * self._period - time.monotonic()))
            # a line that is slower than that is read without a pause, and catches up with nothing
            started = max(started, time.monotonic() - turn * self._period)

    def _read(self, drive: OfflineDrive) -> DriveView:
        try:
            if drive.state.identity is None:
                drive.identify(thoroughly=False)
            seen, values = drive.do(lambda: measure(drive))
        except DriveError as error:
            self._tell(drive, Level.ERROR, say(error))
            return DriveView(_name(drive), Condition.SILENT, 'not connected')
        self._session.polled(drive.address)
        described = drive.state.describe()
        grave = seen.kind is not Kind.STATUS
        level = Level.WARNING if grave else Level.INFO
        self._tell(drive, level, described)
        named = {name: values[role] for role, (name, _, _) in VALUES.items()}
        runs = seen.runs or seen.tuning or seen.state in _RUNS or abs(named['frequency']) > 0
        usual = Condition.RUNS if runs else Condition.STANDS
        return DriveView(
            _name(drive),
            _CONDITIONS.get(seen.kind, usual),
            described,
            seen.listed.description if grave else '',
            seen.listed.remedy,
            seen.listed.requires_ack,
            unit='Hz',
            actual=named['frequency'],
            measured=Measured(**named),
            line=line_view(_name(drive), self._session.statistics(drive.address)),
        )

    def _tell(self, drive: OfflineDrive, level: Level, text: str) -> None:
        """Put it into the log, if it is not what the last line about this drive says."""
        if self._said.get(drive.address) != text:
            self._said[drive.address] = text
            self._notes.put(Note(time.time(), level, _name(drive), text))


def _name(drive: OfflineDrive) -> str:
    return f'drive {drive.address}'
