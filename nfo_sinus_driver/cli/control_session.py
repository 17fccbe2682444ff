# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Commands one drive, and stops it; signals that would end the tool wait until it may end."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future
import contextlib
import math
import sys
import time
from typing import Any, TypeVar

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.cli.console import say
from nfo_sinus_driver.cli.screen import Screen
from nfo_sinus_driver.cli.session import Remote, Session
from nfo_sinus_driver.drive import (
    Cause,
    Drive,
    DriveError,
    Event,
    LogEntry,
    Report,
    Severity,
    Snapshot,
    Telemetry,
)
from nfo_sinus_driver.signals import SUSPENDING, HeldSignals, signal_name

_T = TypeVar('_T')

#: How often it is looked whether something is done, s.
_LOOK_PERIOD = 0.02
#: Often enough to be brisk; the line is not kept busy for nothing, Hz.
_POLL_RATE = 20.0


#: What connecting says of a drive that has no time-out of its own.
NO_TIMEOUT = frozenset(
    (Cause.NO_OWN_TIMEOUT, Cause.OWN_TIMEOUT_OFF, Cause.OWN_TIMEOUT_STOPS_NOTHING)
)


def spoken(name: str) -> str:
    """Return a signal as a person knows it."""
    return {'SIGINT': 'Ctrl-C', 'SIGTSTP': 'Ctrl-Z'}.get(name, name)


class Ended(Exception):
    """Something, such as a signal, ended it; with the exit status if all goes well from then on."""

    def __init__(self, why: str, status: int, signal: str = '') -> None:
        super().__init__(why)
        self.status = status
        self.signal = signal


class EventLog:
    """Hears what a drive has to tell, on the worker of the bus; of some causes nothing is said."""

    def __init__(self, show: Callable[[str], None], mute: Collection[Cause]) -> None:
        self._show = show
        self._mute = mute
        #: What an operator was told.
        self.told: list[Report] = []
        #: What was measured last.
        self.values: dict[Role, float] = {}

    def on_event(self, event: Event) -> None:
        """Pass on what an operator has to know."""
        if event.severity is Severity.INFO or event.cause in self._mute:
            return
        self.told.append(event.report)
        self._show(say(event.report))

    def on_snapshot(self, snapshot: Snapshot) -> None:
        """Nothing: it is looked at when it is shown."""

    def on_telemetry(self, telemetry: Telemetry) -> None:
        """Take measured values."""
        self.values = telemetry.values

    def on_parameters(self, keys: Collection[str]) -> None:
        """Nothing: nobody looks at them."""

    def on_log_entry(self, entry: LogEntry) -> None:
        """Nothing: what matters of it is told as an event."""


class ControlSession:
    """The means to command one drive, and ``remote`` to look at it before."""

    def __init__(
        self, session: Session, screen: Screen, signals: HeldSignals, mute: Collection[Cause]
    ) -> None:
        self._session = session
        self._signals = signals
        self.screen = screen
        self.events = EventLog(screen.say, mute)
        self.remote: Remote = session.drive()

    def drive(self, **settings: Any) -> Drive:
        """Return the drive to be commanded, with some settings not as usual; nothing is sent."""
        return self._session.command(self.events, poll_rate=_POLL_RATE, **settings)

    def signal(self, timeout: float) -> str:
        """Return the name of a signal that shall end it; ``''`` when none came in time, s."""
        number = self._signals.next(timeout)
        if number is None:
            return ''
        name = signal_name(number)
        if number in SUSPENDING:
            self.screen.say(
                f'{spoken(name)} ignored: a suspended command would leave the motor running'
            )
            return ''
        return name

    def wait(self, future: Future[_T], show: Callable[[], object] = lambda: None) -> _T:
        """
        Return the result of a future; meanwhile ``show`` is called again and again.

        :raises Ended: a signal came first.
        :raises DriveError: as the future does.
        """
        while not future.done():
            show()
            name = self.signal(_LOOK_PERIOD)
            if name:
                raise Ended(name, 130, name)
        return future.result()

    def finish(
        self, future: Future[_T], timeout: float, show: Callable[[], object] = lambda: None
    ) -> _T:
        """Return the result of a future, whatever signals come; or a DriveError after so many s."""
        deadline = time.monotonic() + timeout
        while not future.done():
            show()
            if time.monotonic() > deadline:
                raise DriveError(Cause.TOO_LATE, timeout=timeout)
            self.signal(_LOOK_PERIOD)
        return future.result()


@contextlib.contextmanager
def control_session(
    options: argparse.Namespace, *, mute: Collection[Cause] = (), live: bool = False
) -> Iterator[ControlSession]:
    """Open the line to command a drive; signals are held while the ``with`` block lasts."""
    live = live and sys.stdout is not None and sys.stdout.isatty()
    with (
        HeldSignals() as signals,
        Screen(live=live) as screen,
        Session(options, writes=True) as session,
    ):
        yield ControlSession(session, screen, signals, mute)


#: How long an answer of the drive layer may take, s; it gives up earlier by itself.
_LONGEST_ANSWER = 10.0
#: How long a stop that is not confirmed is retried, s.
_LAST_TRIES = 10.0
#: The same as the parameter ``shutdown_timeout`` of the driver has, s.
SHUTDOWN_TIMEOUT = 4.0
_STOP_LOOK_PERIOD = 0.05
#: How long a poll may take, s.
_LONGEST_POLL = 2.0

#: How control was released.
RELEASED = (Cause.CONTROL_RELEASED, Cause.CONTROL_KEPT)

_EMERGENCY = 'use the enable input or the emergency stop if the motor turns'


class Stopping:
    """Stops one motor, whatever signals come (show: called again and again meanwhile)."""

    def __init__(self, control: ControlSession, drive: Drive, show: Callable[[], object]) -> None:
        self._session = control
        self._drive = drive
        self._show = show
        #: What the drive answered, or what became of its stop.
        self.answer: Report | None = None

    def stop(self, *, quick: bool = False) -> bool:
        """Stop it; true when the drive has confirmed it. It says loudly when it has not."""
        show, drive = self._session.screen.say, self._drive
        try:
            self.answer = self._finish(drive.quick_stop() if quick else drive.stop())
        except DriveError as error:
            self.answer = error.report
            show(f'{say(error)}: {_EMERGENCY}')
            return self.confirmed_late()
        return True

    def give_back(self, patience: float = math.inf) -> bool:
        """Wait until the motor stands, or for so many s, and give control back; false if not."""
        begun = time.monotonic()
        while self._may_turn(begun) and time.monotonic() < begun + patience:
            self._show()
            if self._session.signal(_STOP_LOOK_PERIOD):
                break
        try:
            # what is still on its ramp has had its time
            patience = 0.0 if self._may_turn(begun) else 1.0
            released = self._finish(self._drive.disconnect(patience))
        except DriveError as error:
            self._session.screen.say(f'control was not released: {say(error)}')
            return False
        if released.cause in (*RELEASED, Cause.LEFT_TO_RAMP):
            self.answer = released
        return True

    def _may_turn(self, since: float) -> bool:
        """Tell whether the drive drives the motor, for all that is known since then."""
        seen = self._drive.snapshot
        if seen.at < since:
            # no poll yet; if none comes, there is nothing to wait for
            return time.monotonic() < since + _LONGEST_POLL
        return seen.status is not None and seen.status.driven

    def confirmed_late(self) -> bool:
        """Let a stop be retried for a while; true when the drive has confirmed it."""
        show, drive = self._session.screen.say, self._drive
        deadline = time.monotonic() + _LAST_TRIES
        while drive.stop_unconfirmed and time.monotonic() < deadline:
            self._show()
            if self._session.signal(_STOP_LOOK_PERIOD):
                break
        if drive.stop_unconfirmed:
            show(
                'ending WITHOUT a confirmed stop, the motor may still run: use the enable input or '
                'the emergency stop; nfo-sinus stop tries again'
            )
            return False
        seen = drive.snapshot
        status = f'{seen.status.code} {seen.text}' if seen.status is not None else ''
        self.answer = Report(Cause.STOP_CONFIRMED_LATE, status=status)
        show(say(self.answer))
        return True

    def _finish(self, future: Future[Report]) -> Report:
        return self._session.finish(future, _LONGEST_ANSWER, self._show)
