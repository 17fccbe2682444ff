# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a drive shows while its motor turns, slowly and with a person beside it.

The driver's own drive starts and stops the motor, for it stops one whatever the line does. Enter
stops the motor at any moment. The line falls silent only where a time-out of the drive that stops
the motor was read back before.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Iterator, Mapping
import contextlib
from dataclasses import dataclass, field
import functools
import math
import select
import struct
import sys
import time

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog.status import QUANTITIES
from nfo_sinus_driver.cli.console import CliError, say
from nfo_sinus_driver.cli.control_session import INTERRUPTED, MUTE, ControlSession, Ended
from nfo_sinus_driver.cli.screen import Screen
from nfo_sinus_driver.cli.session import OfflineDrive, Session
from nfo_sinus_driver.drive import DriveError, InverterStatus
from nfo_sinus_driver.drive.motion.starting import read_limits
from nfo_sinus_driver.signals import HeldSignals

#: The fastest that the motor turns, Hz, and which part of what is nominal.
_MOST, _PART = 5.0, 0.1
#: How long it may take to reach that, and how long it is held then, s; what is near, as a share.
_REACHES, _HOLDS, _NEAR = 15.0, 1.5, 0.15
#: The longest time-out of a drive that is waited for, and for how much longer it is, s.
_LONGEST_TIMEOUT, _LONGER = 10.0, 2.0
#: How long a motor may take to stand, and how long it is looked whether it turns again, s.
_STANDS, _TURNS_AGAIN = 30.0, 3.0
#: How long a person may take, and a drive until it answers after power-on, s.
_BY_HAND, _STARTS = 120.0, 60.0
_PERIOD = 0.05
_WORD = 'TURN'


@dataclass(frozen=True)
class Moment:
    """
    What a drive showed at one moment.

    :ivar saw: for people.
    :ivar as_expected: whether the motor did what it should; ``None``: it was not tried.
    :ivar words: the raw words of parameters, by their keys.
    """

    name: str
    saw: str
    as_expected: bool | None
    words: Mapping[str, tuple[int, ...]] = field(default_factory=dict)


def agreed(model: Family) -> bool:
    """Say what is going to happen; return whether the operator has typed the word for it."""
    profile = model.profile
    steps = [
        'the bus takes control, and sets the time-out of the drive if it has one',
        'the motor turns forward, in reverse where it can, and is stopped',
        'it turns, and the line falls silent: the drive has to stop it (where it has such a '
        'time-out)',
        'it turns, and you press STOP at the keypad',
        f'it turns, and you open the {profile.enable_input}',
        'it turns, and you switch the drive off and on',
    ]
    print(
        f'\nThe motor turns now, at {_MOST:g} Hz at most: take its load off, and have the '
        'emergency stop in reach. Enter stops it at any moment. The last three are asked for one '
        'by one.',
        *(f'  {number}. {step}' for number, step in enumerate(steps, 1)),
        sep='\n', file=sys.stderr,
    )
    return _answer(f'Type {_WORD} to begin (Enter: nothing turns): ') == _WORD


def _answer(question: str) -> str:
    print(question, end='', file=sys.stderr, flush=True)
    return sys.stdin.readline().strip()


def turn(
    options: argparse.Namespace, model: Family, keys: Collection[str]
) -> tuple[list[Moment], int]:
    """
    Go through all steps; return what the drive showed at each, and the exit status.

    What has ended them early is one of them.

    :param keys: the parameters whose words are wanted.
    """
    status = 0
    with HeldSignals() as signals, Screen(live=False) as screen:
        turning = _Turning(options, screen, signals, keys)
        try:
            turning.turn()
            turning.leave_alone()
            turning.stop_by_hand('keypad', 'press STOP at the keypad', '')
            if model.profile.has_enable_input:
                named = model.profile.enable_input
                turning.stop_by_hand('input', f'open the {named}', f'close the {named} again')
            turning.switch_off()
        except Ended as end:
            turning.moments.append(Moment('end', f'by {end.key or end}', None))
            status = end.status
        except (CliError, DriveError) as error:
            turning.moments.append(Moment('end', say(error), False))
        wrong = any(moment.as_expected is False for moment in turning.moments)
        return turning.moments, status or int(wrong)


class _Turning:
    """One drive, its motor and its operator."""

    def __init__(
        self,
        options: argparse.Namespace,
        screen: Screen,
        signals: HeldSignals,
        keys: Collection[str],
    ) -> None:
        self._options = options
        self._screen = screen
        self._signals = signals
        self._keys = keys
        self.moments: list[Moment] = []
        #: How fast it turns, in the unit of the control mode; the least set-point.
        self._speed = self._least = 0.0
        #: The motor is left running, for something else has to stop it.
        self._left = False

    # --- the steps ----------------------------------------------------------------------------

    def turn(self) -> None:
        """Take control, turn both ways, stop."""
        with self._enabled() as control:
            self._add('control', control, control.drive.following)
            for name, speed in (('forward', self._speed), ('reverse', -self._speed)):
                if speed >= self._least:
                    reached = self._reach(control, speed)
                    self._add(name, control, reached, f'{control.drive.snapshot.actual:.4g}')
            self._stop(control, 'stopped')

    def leave_alone(self) -> None:
        """Let the line be silent while the motor turns: the drive has to stop it."""
        with self._enabled() as control:
            timeout = control.drive.state.timeout
            seconds = timeout.seconds
            if not (timeout.stops_motor and 0 < seconds <= _LONGEST_TIMEOUT):
                self._leave_out('silence', 'no time-out that stops it was read back')
                return
            self._reach(control, self._speed)
            self._left = True
        seconds += _LONGER
        self._screen.say(f'the line is silent for {seconds:g} s: the drive has to stop the motor')
        until = time.monotonic() + seconds
        early = False
        while time.monotonic() < until and not early:
            early = self._is_enter() or self._signals.next(_PERIOD) is not None
        with self._session() as control:
            try:
                status = control.offline.read_status()
                if early:
                    self._leave_out('silence', 'ended by Enter')
                else:
                    self._add('silence', control, not _runs(status))
            finally:
                control.connect_as_controlled()
            try:
                if status.faulted:
                    control.finish(control.drive.acknowledge())
                    now = control.offline.read_status()
                    self._add('acknowledged', control, not (now.faulted or now.driven))
            finally:
                self._stop(control)

    def stop_by_hand(self, name: str, what: str, again: str) -> None:
        """Let a person stop the motor; nothing may turn it afterwards."""
        if not self._wanted(f'{what} while it turns'):
            self._leave_out(name)
            return
        with self._enabled() as control:
            self._reach(control, self._speed)
            self._screen.say(f'{what} now')
            if not self._until_done(control, lambda: control.drive.following):
                self._leave_out(name)
                return
            self._add(name, control, self._stands(control))
            if again:
                self._screen.say(f'{again}, then press Enter')
                self._during(control, lambda: True)
            # a set-point that comes now turns nothing
            until = time.monotonic() + _TURNS_AGAIN

            def stands() -> bool:
                return not abs(control.drive.snapshot.frequency) > 0

            self._during(
                control, lambda: stands() and time.monotonic() < until, give=self._speed
            )
            self._add(f'after {name}', control, stands())

    def switch_off(self) -> None:
        """Let the mains go while the motor turns: does it run by itself afterwards."""
        if not self._wanted('switch the drive off and on while it turns: it may start by itself'):
            self._leave_out('power')
            return
        with self._enabled() as control:
            self._reach(control, self._speed)
            self._screen.say('switch the drive off now')
            if not self._until_done(control, lambda: control.drive.snapshot.connected):
                self._leave_out('power')
                return
            keeps_run = control.drive.model.profile.keeps_run
            self._left = True
        self._screen.say('switch it on now: it is looked at as soon as it answers')
        with self._session() as control:
            try:
                status = self._first_status(control)
                saw = 'it runs by itself' if _runs(status) else 'it does not run'
                right = keeps_run is None or keeps_run == _runs(status)
                self._add('power', control, right, saw)
            finally:
                control.connect_as_controlled()
                self._stop(control)

    # --- what they are made of ----------------------------------------------------------------

    @contextlib.contextmanager
    def _session(self) -> Iterator[ControlSession]:
        with Session(self._options, writes=True) as session:
            yield ControlSession(session, self._screen, self._signals, MUTE)

    @contextlib.contextmanager
    def _enabled(self) -> Iterator[ControlSession]:
        """Enable the motor; it is stopped however the block ends, unless it was left."""
        with self._session() as control:
            control.require_ready()
            mode = self._choose_speed(control.offline)
            settings = {
                'control_method': self._options.control_method, 'expected_control_mode': mode
            }
            # given by number, what it depends on is set, too
            timeout = control.command(**settings).settings.wanted_drive_timeout
            drive = control.command(**settings, drive_timeout=timeout)
            self._left = False
            try:
                control.connect()
                control.enable()
                yield control
            finally:
                if not (self._left or drive.identity is None):
                    self._stop(control)

    def _choose_speed(self, offline: OfflineDrive) -> str:
        """Choose how fast the motor turns; return the control mode of the drive."""
        mode = offline.do(offline.state.read_control_mode)
        unit = QUANTITIES[mode].unit if mode in offline.model.profile.setpoints else ''
        if unit not in ('Hz', 'rpm'):
            raise CliError(
                f'the drive is in control mode {mode}: a motor is turned here by a frequency or a '
                'speed alone'
            )
        limits = offline.do(lambda: read_limits(offline.state, mode))
        part = _PART * limits.nominal
        self._speed, self._least = min(part, _MOST) if unit == 'Hz' else part, limits.least
        if self._speed < self._least:
            raise CliError(f'the motor may turn no slower than {self._least:g} {unit}')
        return mode

    def _reach(self, control: ControlSession, speed: float) -> bool:
        """Turn at a speed for a while; return whether the drive shows that it is reached."""
        drive, begun, near_since = control.drive, time.monotonic(), math.inf

        def goes_on() -> bool:
            nonlocal near_since
            now = time.monotonic()
            near = abs(drive.snapshot.actual - speed) <= _NEAR * abs(speed)
            near_since = min(near_since, now) if near else math.inf
            return drive.following and now < min(near_since + _HOLDS, begun + _REACHES)

        if not self._during(control, goes_on, give=speed):
            raise Ended('Enter', 0)
        if not drive.following:
            raise CliError(f'the motor was stopped meanwhile: {drive.state.describe()}')
        return near_since < math.inf

    def _stands(self, control: ControlSession) -> bool:
        """Wait until the motor stands; return whether it does."""
        until = time.monotonic() + _STANDS

        def turns() -> bool:
            status = control.drive.snapshot.status
            return status is not None and status.driven and time.monotonic() < until

        return self._during(control, turns) and time.monotonic() < until

    def _during(
        self, control: ControlSession, condition: Callable[[], bool], give: float | None = None
    ) -> bool:
        """Wait while a condition holds, with a set-point; return whether Enter has not ended it."""
        while condition():
            if self._is_enter():
                return False
            if give is not None:
                control.drive.set_setpoint(give)
            control.pause(_PERIOD)
        return True

    def _until_done(self, control: ControlSession, condition: Callable[[], bool]) -> bool:
        """Turn while a person has something to do; return whether it is done."""
        until = time.monotonic() + _BY_HAND
        self._during(
            control, lambda: condition() and time.monotonic() < until, give=self._speed
        )
        return not condition()

    def _stop(self, control: ControlSession, name: str = '') -> None:
        """Stop the motor, and give control back (CliError: the stop is not confirmed)."""
        confirmed = control.stop()
        if name and confirmed:
            self._add(name, control, self._stands(control))
        if not confirmed or not control.give_back(_STANDS):
            raise CliError('look whether the motor turns; nfo-sinus stop tries again')

    def _first_status(self, control: ControlSession) -> InverterStatus:
        """Return the first status of a drive that is switched on."""
        until = time.monotonic() + _BY_HAND + _STARTS
        while True:
            try:
                return control.offline.read_status()
            except DriveError:
                if time.monotonic() > until:
                    raise
            control.pause(_PERIOD)

    def _add(self, name: str, control: ControlSession, right: bool, saw: str = '') -> None:
        """Record what the drive shows now."""
        offline, words = control.offline, {}
        for key in filter(offline.params.reaches, self._keys):
            read = functools.partial(offline.params.read_data, key, Priority.SERVICE)
            # what it refuses now is not seen
            with contextlib.suppress(DriveError):
                data = offline.do(read)
                words[key] = struct.unpack(f'>{len(data) // 2}h', data)
        offline.read_status()
        saw = ', '.join(filter(None, (saw, offline.state.describe())))
        self.moments.append(Moment(name, saw, right, words))

    def _leave_out(self, name: str, why: str = 'left out') -> None:
        self.moments.append(Moment(name, why, None))

    def _wanted(self, what: str) -> bool:
        """Ask whether a step is to be done; Enter leaves it out."""
        print(f'{what[0].upper()}{what[1:]}? [y/N] ', end='', file=sys.stderr, flush=True)
        until = time.monotonic() + _BY_HAND
        while time.monotonic() < until:
            if select.select([sys.stdin], [], [], _PERIOD)[0]:
                return sys.stdin.readline().strip().lower() in ('y', 'yes')
            if self._signals.next(0.0) is not None:
                raise Ended('Ctrl-C', INTERRUPTED)
        return False

    @staticmethod
    def _is_enter() -> bool:
        """Return whether Enter was pressed, or there is no operator any more."""
        if not select.select([sys.stdin], [], [], 0.0)[0]:
            return False
        sys.stdin.readline()
        return True


def _runs(status: InverterStatus) -> bool:
    return status.driven and status.from_bus
