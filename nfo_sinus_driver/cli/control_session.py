# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Commands one drive and stops it; signals that would end the tool wait until it may end."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import Future
import contextlib
import math
import sys
import time
from typing import Any, TypeVar

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.cli.console import CliError, say
from nfo_sinus_driver.cli.screen import Screen
from nfo_sinus_driver.cli.session import Session
from nfo_sinus_driver.drive import (
    Cause,
    Drive,
    DriveError,
    Event,
    Listener,
    Report,
    Severity,
    Telemetry,
)
from nfo_sinus_driver.signals import SUSPENDING, HeldSignals, signal_name

_T = TypeVar('_T')

INTERRUPTED = 130
#: Often enough to be brisk; the line is not kept busy for nothing, Hz.
_POLL_RATE = 20.0
#: How often it is looked whether something is done, or whether a motor has stopped, s.
_LOOK_PERIOD = 0.02
_STOP_LOOK_PERIOD = 0.05
#: How long the stop may take that comes with connecting, and how often an enable waits for it, s.
_LONGEST_STOP, _RETRY_PERIOD = 5.0, 0.1
#: How long a drive may take for all that a command consists of, s; it gives up earlier by itself.
_LONGEST = 15.0
#: How long a stop that is not confirmed is retried, s.
_LAST_TRIES = 10.0
#: How long a poll may take, s.
_LONGEST_POLL = 2.0
#: How control was released.
RELEASED = (Cause.CONTROL_RELEASED, Cause.CONTROL_KEPT)
#: What connecting reports, and what does not matter to a command that starts nothing.
MUTE = frozenset(
    (
        Cause.NO_OWN_TIMEOUT,
        Cause.OWN_TIMEOUT_OFF,
        Cause.OWN_TIMEOUT_STOPS_NOTHING,
        Cause.FOUND_RUNNING,
        Cause.FAULT_APPEARED,
    )
)
_EMERGENCY = 'use the enable input or the emergency stop if the motor turns'
_KEYS = {'SIGINT': 'Ctrl-C', 'SIGTSTP': 'Ctrl-Z'}


class Ended(Exception):
    """Something, such as a signal, ended it; with the exit status if all goes well from then on."""

    def __init__(self, why: str, status: int, signal: str = '') -> None:
        super().__init__(why)
        self.status = status
        self.signal = signal

    @property
    def key(self) -> str:
        """The signal as an operator knows it."""
        return _KEYS.get(self.signal, self.signal)


class ControlSession(Listener):
    """
    One drive under command.

    :ivar offline: the same drive, read before it is connected.
    :ivar show: called again and again while something takes its time.
    :ivar reported: what the operator was informed of, oldest first.
    :ivar values: what was measured last.
    :ivar answer: what the drive said to its last stop, or what became of that.
    :ivar interrupted: the first signal that asked for the end, also one that came while a stop was
        awaited; ``''``: none did.
    """

    def __init__(
        self, session: Session, screen: Screen, signals: HeldSignals, mute: Collection[Cause]
    ) -> None:
        self._session = session
        self._signals = signals
        self._mute = mute
        self.screen = screen
        self.offline = session.drive()
        session.on_mute(self._on_mute)
        self.drive: Drive
        self.show: Callable[[], object] = lambda: None
        self.reported: list[Report] = []
        self.values: Mapping[Role, float] = {}
        self.answer: Report | None = None
        self.interrupted = ''

    def command(self, **settings: Any) -> Drive:
        """Have the drive to be commanded, with some settings not as usual; nothing is sent."""
        self.drive = self._session.commanded_drive(self, poll_rate=_POLL_RATE, **settings)
        return self.drive

    def connect_as_controlled(self) -> Drive:
        """Connect by the control method that the bus has used so far; what runs is stopped so."""
        method = self.offline.active_control_method()
        methods = self.offline.model.profile.methods
        references = methods[method].references
        # nothing is started, so it matters only that an unusual method leaves the reference alone
        reference = references[0] if method == next(iter(methods)) else references[-1]
        drive = self.command(control_method=method, reference=reference)
        self.finish(drive.connect())
        return drive

    def require_ready(self) -> None:
        """
        Ensure that the motor stands, without a fault; nothing is written.

        :raises CliError: it cannot be started.
        """
        self.offline.identify(thoroughly=False)
        status = self.offline.read_status()
        shown = self.offline.state.describe()
        if status.driven:
            by = 'the bus: nfo-sinus stop stops it' if status.from_bus else 'keypad or terminals'
            raise CliError(f'the motor runs already ({shown}), by {by}')
        if status.faulted:
            fault = status.listed
            raise CliError(
                f'fault {shown} is active: {fault.description}. {fault.remedy}; '
                'then type nfo-sinus ack'
            )

    def connect(self) -> None:
        """Connect the drive that :meth:`command` has returned (Ended, DriveError)."""
        self.wait(self.drive.connect())
        self.drive.activate()

    def enable(self) -> None:
        """
        Enable it, once the stop is confirmed that connecting has made sure of.

        :raises Ended: a signal came first.
        :raises DriveError: it cannot be enabled.
        """
        deadline = time.monotonic() + _LONGEST_STOP
        while True:
            try:
                self.wait(self.drive.enable())
                return
            except DriveError as error:
                pending = error.report.cause is Cause.STOP_PENDING
                if not pending or time.monotonic() >= deadline:
                    raise
            self.pause(_RETRY_PERIOD)

    # --- waiting ------------------------------------------------------------------------------

    def signal(self, timeout: float) -> str:
        """Return the name of a signal that shall end it; ``''`` when none came in time, s."""
        number = self._signals.next(timeout)
        if number is None:
            return ''
        name = signal_name(number)
        if number in SUSPENDING:
            self.screen.say(
                f'{_KEYS.get(name, name)} ignored: a suspended command would leave the motor '
                'running'
            )
            return ''
        self.interrupted = self.interrupted or name
        return name

    def pause(self, seconds: float) -> None:
        """Let some time go by (Ended: a signal came)."""
        name = self.signal(seconds)
        if name:
            raise Ended(name, INTERRUPTED, name)

    def wait(self, future: Future[_T]) -> _T:
        """
        Return the result of a future.

        :raises Ended: a signal came first.
        :raises DriveError: as the future does.
        """
        while not future.done():
            self.show()
            self.pause(_LOOK_PERIOD)
        return future.result()

    def finish(self, future: Future[_T]) -> _T:
        """Return the result of a future, whatever signals come (DriveError: it takes too long)."""
        deadline = time.monotonic() + _LONGEST
        while not future.done():
            self.show()
            if time.monotonic() > deadline:
                raise DriveError(Cause.TOO_LATE, timeout=_LONGEST)
            self.signal(_LOOK_PERIOD)
        return future.result()

    def _wait_while(self, condition: Callable[[], bool], timeout: float) -> None:
        """Wait until a condition no longer holds, a signal comes, or the time is over, s."""
        deadline = time.monotonic() + timeout
        while condition() and time.monotonic() < deadline:
            self.show()
            if self.signal(_STOP_LOOK_PERIOD):
                return

    # --- stopping -----------------------------------------------------------------------------

    def stop(self, *, quick: bool = False) -> bool:
        """
        Stop the motor; true when the drive has confirmed it, else the operator is warned.

        What a late confirmation says is left to the caller, as that of a stop in time.
        """
        asked_at = time.monotonic()
        try:
            self.answer = self.finish(self.drive.quick_stop() if quick else self.drive.stop())
        except DriveError as error:
            self.answer = error.report
            self.screen.say(f'{say(error)}: {_EMERGENCY}')
            if error.cause is Cause.NOT_RECOGNISED and not self.drive.stop_owed:
                # nothing was written to it, and no stop is on its way
                return False
            return self.confirmed_late(asked_at)
        return True

    def confirmed_late(self, asked_at: float) -> bool:
        """
        Let a stop be retried for a while; true when the drive has confirmed it.

        :param asked_at: when it was requested, s, monotonic: an earlier status confirms nothing.
        """
        self._session.last_tries(_LAST_TRIES)
        self._wait_while(lambda: self.drive.stop_unconfirmed, _LAST_TRIES)
        status = self.drive.state.status
        confirmed = status is not None and status.at > asked_at
        if self.drive.stop_unconfirmed or self.drive.stop_overdue or not confirmed:
            self.screen.say(f'{self.drive.end_unconfirmed}; nfo-sinus stop tries again')
            return False
        # a drive that was lost has a status before it is polled again
        self.answer = self.drive.state.report(Cause.STOP_CONFIRMED_LATE)
        return True

    def give_back(self, patience: float = math.inf) -> bool:
        """Wait until the motor stands, or for so many s, and release control; false if not."""
        begun = time.monotonic()

        def may_turn() -> bool:
            snapshot = self.drive.snapshot
            if snapshot.at < begun:
                # no poll yet; if none comes, there is nothing to wait for
                return time.monotonic() < begun + _LONGEST_POLL
            return snapshot.status is not None and snapshot.status.driven

        self._wait_while(may_turn, patience)
        try:
            # a motor that is still on its ramp has had its time
            released = self.finish(self.drive.disconnect(0.0 if may_turn() else 1.0))
        except DriveError as error:
            self.screen.say(f'control was not released: {say(error)}')
            return False
        if released.cause in (*RELEASED, Cause.LEFT_TO_RAMP):
            self.answer = released
        return True

    # --- as a listener, on the worker of the bus ----------------------------------------------

    def on_event(self, event: Event) -> None:
        """Report what an operator has to know."""
        # what is changed in the drive stays so
        matters = event.severity is not Severity.INFO or event.cause is Cause.CHANGED_FOR_TIMEOUT
        if not matters or event.cause in self._mute:
            return
        self.reported.append(event.report)
        self.screen.say(say(event.report))

    def _on_mute(self, seconds: float) -> None:
        """Say for how long the drive has not answered, s; 0: it does again."""
        again = f'no answer for {seconds:.1f} s: the port is opened again, until the drive answers'
        self.screen.say(again if seconds else 'the drive answers again')

    def on_telemetry(self, telemetry: Telemetry) -> None:
        """Take measured values."""
        self.values = telemetry.values


@contextlib.contextmanager
def control_session(
    options: argparse.Namespace, *, mute: Collection[Cause] = MUTE, live: bool = False
) -> Iterator[ControlSession]:
    """Open the line to command a drive; signals are held while the ``with`` block lasts."""
    live = live and sys.stdout is not None and sys.stdout.isatty()
    # it may ask something, which Ctrl-C ends
    session = Session(options, writes=True)
    with (
        # before any other thread is there
        HeldSignals() as signals,
        Screen(live=live) as screen,
        session,
    ):
        yield ControlSession(session, screen, signals, mute)
