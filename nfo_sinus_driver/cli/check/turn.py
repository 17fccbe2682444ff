# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a drive shows while its motor turns, slowly and with a person beside it.

One drive of the driver's own starts and stops the motor throughout, for it stops one whatever the
line does; the port is never given up while the motor may turn. Enter stops the motor at any moment,
and so does a signal, also one that came while something else was awaited. Where the line is to be
silent, the worker of the bus sleeps: what wakes it is Enter, or the end of that time.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Coroutine, Iterator, Mapping
import contextlib
from dataclasses import dataclass, field
import functools
import math
import os
import select
import struct
import sys
import threading
import time
from typing import Any, TypeVar

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Family, Role
from nfo_sinus_driver.catalog.status import QUANTITIES
from nfo_sinus_driver.cli.console import CliError, say
from nfo_sinus_driver.cli.control_session import INTERRUPTED, ControlSession, Ended
from nfo_sinus_driver.cli.screen import Screen
from nfo_sinus_driver.cli.session import Session
from nfo_sinus_driver.drive import Cause, DriveError, InverterStatus
from nfo_sinus_driver.drive.motion.starting import read_limits
from nfo_sinus_driver.signals import HeldSignals

_T = TypeVar('_T')

#: The fastest that the motor turns, Hz, and which part of what is nominal.
_MOST, _PART = 5.0, 0.1
#: For how long it is held at that, and without any rise before it counts as not reached, s; what is
#: near, as a share.
_HOLDS, _RISES_WITHIN, _NEAR = 1.5, 8.0, 0.15
#: The longest time-out of a drive that is waited for, and for how much longer it is, s.
_LONGEST_TIMEOUT, _LONGER = 10.0, 2.0
#: How long a motor may take to stand, and how long it is looked whether it turns again, s.
_STANDS, _TURNS_AGAIN = 60.0, 3.0
#: How long a person may take, s.
_BY_HAND = 120.0
#: A motor that turns more slowly than this share of its set-point stands, and one that turns faster
#: than that is not the one that was told to.
_STILL, _TOO_FAST = 0.04, 2.0
#: How often a motor that turns on is stopped again, s.
_AGAIN = 2.0
#: By when a drive without power is lost, and by when one with power is connected again, s.
_LOST_WITHIN, _CONNECTS_WITHIN = 3.0, 30.0
_PERIOD = 0.05
_WORD = 'TURN'
_ENTER = 'Enter'
#: Lines that are not made silent, and why.
_NEVER_SILENT = {
    'canopen': 'a CAN line has the heartbeat of this computer, by whose end other drives may stop, '
    'too: it is not withheld',
}
_NO_STOP_KEY = 'no manual says that a key of its keypad stops a motor that the bus runs'
#: What is said at other places, or is expected.
_MUTE = (Cause.FOUND_RUNNING, Cause.FAULT_APPEARED)
#: What a drive that is switched off leads to.
_WITHOUT_POWER = (Cause.LOST, Cause.LOST_IN_USE, Cause.CANNOT_STOP, Cause.CANNOT_STOP_BUT_STANDS)
_DONE, _FAILED = 0, 1


@dataclass(frozen=True)
class Moment:
    """
    What a drive showed at one moment.

    :ivar saw: for people.
    :ivar as_expected: whether the motor did what it should; ``None``: it was not tried.
    :ivar hertz: the frequency that it was given; NaN: it was given none, or a speed.
    :ivar words: the raw words of parameters, by their keys.
    """

    name: str
    saw: str
    as_expected: bool | None
    hertz: float = math.nan
    words: Mapping[str, tuple[int, ...]] = field(default_factory=dict)


class _Left(Exception):
    """
    A step cannot be done, for a reason; the next one can.

    :ivar right: as :attr:`Moment.as_expected`.
    """

    def __init__(self, why: str, right: bool | None = None) -> None:
        super().__init__(why)
        self.right = right


def agreed(model: Family, protocol: str) -> bool:
    """Say what is going to happen; return whether the operator has typed the word for it."""
    profile = model.profile
    by_itself = [
        'the bus takes control, and sets the time-out of the drive if it has one',
        'the motor turns forward, in reverse where it can, and is stopped',
    ]
    if protocol not in _NEVER_SILENT:
        by_itself.append(
            'it turns, and the line falls silent: the drive has to stop it (where it has a '
            'time-out)'
        )
    by_hand = []
    if profile.has_stop_key:
        by_hand.append('it turns, and you press STOP at the keypad')
    if profile.has_enable_input:
        by_hand.append(f'it turns, and you open the {profile.enable_input}')
    by_hand.append('it turns, and you switch the drive off and on')
    for line in (
        '',
        f'The motor turns now, at {_MOST:g} Hz at most: take its load off, and have the emergency '
        'stop in reach.',
        f'{_ENTER} stops it at any moment. If this computer or the cable fails, only the time-out '
        'of the drive does, if it has one, and the emergency stop.',
        *(f'  {number}. {step}' for number, step in enumerate((*by_itself, *by_hand), 1)),
        f'From step {len(by_itself) + 1} on each is asked for.',
    ):
        print(line, file=sys.stderr)
    print(f'Type {_WORD} to begin ({_ENTER}: nothing turns): ', end='', file=sys.stderr, flush=True)
    return sys.stdin.readline().strip() == _WORD


def turn(
    options: argparse.Namespace, model: Family, keys: Collection[str]
) -> tuple[list[Moment], int]:
    """
    Go through all steps; return what the drive showed at each, and the exit status.

    What has ended them early is one of them.

    :param keys: the parameters whose words are wanted.
    """
    moments: list[Moment] = []
    status = _DONE
    try:
        session, mute = Session(options, writes=True), set(_MUTE)
        # before any other thread is there
        with HeldSignals() as signals, Screen(live=False) as screen, session:
            control = ControlSession(session, screen, signals, mute)
            _Turning(options, control, model, mute, keys, moments).run()
    except Ended as end:
        moments.append(Moment('end', f'by {end.key or end}', None))
        status = end.status
    except (CliError, DriveError, OSError, ValueError) as error:
        moments.append(Moment('end', say(error), None))
        status = _FAILED
    wrong = any(moment.as_expected is False for moment in moments)
    return moments, status or int(wrong)


class _Turning:
    """One drive, its motor and its operator."""

    def __init__(
        self,
        options: argparse.Namespace,
        control: ControlSession,
        model: Family,
        mute: set[Cause],
        keys: Collection[str],
        moments: list[Moment],
    ) -> None:
        self._options = options
        self._control = control
        self._profile = model.profile
        self._mute = mute
        self._keys = keys
        self._moments = moments
        self._mode = self._unit = ''
        #: How fast it turns, in the unit of the control mode; the least set-point.
        self._speed = self._least = 0.0
        #: How long it took from a stop to standstill, s.
        self._ramp = 0.0

    def run(self) -> None:
        """Do all steps; however they end, the motor is stopped and control is given back."""
        control = self._control
        control.require_ready()
        self._choose_speed()
        # given by number, what the time-out depends on is set, too
        settings = {
            'control_method': self._options.control_method, 'expected_control_mode': self._mode
        }
        timeout = control.command(**settings).settings.wanted_drive_timeout
        drive = control.command(**settings, drive_timeout=timeout)
        try:
            control.connect()
            self._step('forward', self._turn_both_ways)
            self._step('silence', self._leave_alone)
            self._step('keypad', self._press_stop)
            if self._profile.has_enable_input:
                self._step('input', self._open_input)
            self._step('power', self._switch_off)
        finally:
            if drive.identity is not None:
                self._give_back()

    # --- the steps ----------------------------------------------------------------------------

    def _step(self, name: str, do: Callable[[], None]) -> None:
        try:
            do()
        except _Left as why:
            self._moments.append(Moment(name, str(why), why.right))
            self._stop()

    def _turn_both_ways(self) -> None:
        """Take control, turn both ways, stop."""
        self._enable()
        self._add('control', self._control.drive.following)
        for name, speed in (('forward', self._speed), ('reverse', -self._speed)):
            if speed >= self._least:
                reached = self._reach(speed)
                self._add(name, reached, self._shown, speed)
        begun = time.monotonic()
        self._stop()
        self._add('stopped', True)
        self._ramp = time.monotonic() - begun

    def _leave_alone(self) -> None:
        """Let the line be silent while the motor turns: the drive has to stop it."""
        if why := _NEVER_SILENT.get(self._options.protocol):
            raise _Left(why)
        self._enable()
        timeout = self._control.drive.state.timeout
        if not (timeout.stops_motor and 0 < timeout.seconds <= _LONGEST_TIMEOUT):
            raise _Left('no time-out that stops the motor was read back')
        self._reach(self._speed)
        # one that stops it by the ramp takes as long as the driver's stop
        seconds = timeout.seconds + self._ramp + _LONGER
        self._control.screen.say(f'the line is silent for {seconds:.0f} s: the drive has to stop')
        with self._muted(Cause.STOPPED_BECAUSE, Cause.STOPPED_BECAUSE_OF_FAULT, *_WITHOUT_POWER):
            status = self._asleep(lambda: self._let(seconds))
            if status is None:
                raise _Left('no answer after it')
            self._add('silence', not status.driven)
            self._stop()
        if status.faulted:
            self._control.finish(self._control.drive.acknowledge())
            now = self._control.offline.read_status()
            self._add('acknowledged', not (now.faulted or now.driven))

    def _press_stop(self) -> None:
        if not self._profile.has_stop_key:
            raise _Left(_NO_STOP_KEY)
        self._stop_by_hand('keypad', 'press STOP at the keypad', '')

    def _open_input(self) -> None:
        named = self._profile.enable_input
        self._stop_by_hand('input', f'open the {named}', f'close the {named} again')

    def _stop_by_hand(self, name: str, what: str, again: str) -> None:
        """Let a person stop the motor; nothing may turn it afterwards."""
        self._require_yes(f'{what} while it turns')
        self._enable()
        self._reach(self._speed)
        self._control.screen.say(f'{what} now ({_ENTER}: leave it out)')
        if self._stopped_by_hand():
            self._wait_until_it_stands()
            # a fault stops it, too
            self._add(name, None if self._faulted else True)
        else:
            self._stop()
            self._require_yes(f'the motor turned on, and is stopped now. Had you done it ({what})')
            self._add(name, False, 'the motor turned on')
        if again:
            self._control.screen.say(f'{again}, then press {_ENTER}')
            self._enter_within(_BY_HAND)
        begun, turned = time.monotonic(), False
        while time.monotonic() < begun + _TURNS_AGAIN:
            self._pause()
            turned |= self._turns
        known = not math.isnan(self._control.drive.snapshot.actual)
        self._add(f'after {name}', not turned if known else None)
        if turned:
            self._stop()

    def _switch_off(self) -> None:
        """Let the mains go while the motor turns: does it run by itself afterwards."""
        self._require_yes('switch the drive off and on while it turns: it may start by itself')
        self._enable()
        self._reach(self._speed)
        with self._muted(*_WITHOUT_POWER):
            runs = self._runs_with_power()
        drive = self._control.drive
        keeps_run = drive.model.profile.keeps_run
        saw = 'it runs by itself' if runs else 'it does not run'
        self._add('power', keeps_run is None or keeps_run == runs, saw)

    def _runs_with_power(self) -> bool:
        """Return whether the drive runs by itself when its power is back; it is stopped then."""
        drive, screen = self._control.drive, self._control.screen
        screen.say(f'switch the drive off now, and press {_ENTER} once its display is dark')
        self._enter_within(_BY_HAND, self._speed)
        self._let(_LOST_WITHIN)
        if drive.snapshot.connected:
            raise _Left('it answered on')
        screen.say(
            f'switch it on, and press {_ENTER} once its display is up: if the motor turns by '
            f'itself, {_ENTER} stops it'
        )
        try:
            status = self._asleep(lambda: self._enter_within(_BY_HAND))
        except Ended:
            screen.say(
                'the drive may start the motor by itself when its power comes back: open the '
                f'{self._profile.enable_input} first, or run nfo-sinus stop as soon as it has power'
            )
            raise
        until = time.monotonic() + _CONNECTS_WITHIN
        while not drive.snapshot.connected and time.monotonic() < until:
            self._pause()
        if status is None or status.faulted:
            raise _Left('not seen: it did not answer at once, or shows a fault of the line')
        return status.driven and status.from_bus

    # --- what they are made of ----------------------------------------------------------------

    def _choose_speed(self) -> None:
        """
        Choose how fast the motor turns.

        :raises CliError: its control mode is no frequency and no speed.
        """
        offline = self._control.offline
        self._mode = mode = offline.do(offline.state.read_control_mode)
        modes = offline.model.profile.setpoints
        self._unit = unit = QUANTITIES[mode].unit if mode in modes else ''
        limits = offline.do(lambda: read_limits(offline.state, mode))
        if unit not in ('Hz', 'rpm') or (unit == 'rpm' and not math.isfinite(limits.nominal)):
            raise CliError(
                f'the drive is in control mode {mode}: set '
                f'{offline.model.key(Role.CONTROL_MODE) or "it"} so that its set-point is a '
                'frequency or a speed whose nominal value it tells'
            )
        most = _MOST
        if unit == 'rpm':
            key = offline.model.key(Role.NOMINAL_FREQUENCY)
            known = float(offline.measure(key)) if key else 0.0
            if not known > 0:
                raise CliError(
                    f'the drive does not tell how many {unit} are {_MOST:g} Hz: set '
                    f'{offline.model.key(Role.CONTROL_MODE) or "it"} so that its set-point is a '
                    'frequency'
                )
            most = _MOST / known * limits.nominal
        self._speed, self._least = min(_PART * limits.nominal, most), limits.least
        if self._speed < self._least:
            raise CliError(f'the motor may turn no slower than {self._least:g} {unit}')

    @property
    def _shown(self) -> str:
        return f'{self._control.drive.snapshot.actual:.4g} {self._unit}'

    @property
    def _turns(self) -> bool:
        """The motor turns, as far as the drive tells."""
        snapshot = self._control.drive.snapshot
        driven = snapshot.status is not None and snapshot.status.driven
        # on its ramp to a stop a drive may deny that it drives the motor
        still = _STILL * self._speed
        return driven or abs(snapshot.actual) > still or abs(snapshot.frequency) > _STILL * _MOST

    def _enable(self) -> None:
        self._check()
        try:
            self._control.enable()
        except DriveError as error:
            raise _Left(f'it cannot be enabled: {say(error)}') from None

    def _reach(self, speed: float) -> bool | None:
        """
        Turn at a speed for a while; return whether that is reached, ``None`` if it only rises.

        :raises _Left: something has stopped the motor meanwhile.
        """
        drive = self._control.drive
        most, rose_at, near_since = 0.0, time.monotonic(), math.inf
        while drive.following:
            now, actual = time.monotonic(), drive.snapshot.actual
            near = abs(actual - speed) <= _NEAR * abs(speed)
            near_since = min(near_since, now) if near else math.inf
            if now > near_since + _HOLDS:
                return True
            along = actual * math.copysign(1, speed)
            if not near and now > rose_at + _RISES_WITHIN:
                return None if max(most, along) > _STILL * abs(speed) else False
            if along > most + _NEAR * abs(speed):
                most, rose_at = along, now
            self._pause(speed)
        raise _Left(f'it was stopped before: {self._why_stopped}', right=False)

    @property
    def _why_stopped(self) -> str:
        reported = self._control.reported
        return say(reported[-1]) if reported else self._control.drive.state.describe()

    def _asleep(self, wait: Callable[[], object]) -> InverterStatus | None:
        """
        Have no request sent while a function waits; return the status after it.

        It is read before anything is written; ``None``: the drive does not answer at once.
        """
        drive, over = self._control.drive, threading.Event()

        async def sleep() -> InverterStatus:
            # the worker itself waits: nothing else is sent meanwhile
            over.wait(2 * _BY_HAND)
            return await drive.state.reader.read(Priority.STOP)

        reading = drive.run(sleep)
        try:
            wait()
        finally:
            over.set()
        try:
            return self._control.finish(reading)
        except DriveError:
            return None

    def _pause(self, give: float | None = None) -> None:
        """Let a moment go by, with a set-point or without (Ended: by a signal, or by Enter)."""
        self._check()
        if give is not None:
            self._control.drive.set_setpoint(give)
        self._control.pause(_PERIOD)
        self._check()

    def _check(self) -> None:
        """Go on only if nothing has asked for the end, also while something else was awaited."""
        name = self._control.interrupted
        if name:
            raise Ended(name, INTERRUPTED, name)
        if _typed():
            raise Ended(_ENTER, _DONE)
        if abs(self._control.drive.snapshot.actual) > _TOO_FAST * self._speed:
            raise CliError(
                f'the motor turns at {self._shown}, and was told {self._speed:.4g} {self._unit} at '
                'most: it is stopped'
            )

    def _let(self, seconds: float) -> None:
        """Let some time go by."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self._pause()

    def _enter_within(self, seconds: float, give: float | None = None) -> bool:
        """Wait for Enter, which ends nothing here; return whether it came in time."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            try:
                self._pause(give)
            except Ended as end:
                if end.signal:
                    raise
                return True
        return False

    def _stopped_by_hand(self) -> bool:
        """Turn until a person has stopped the motor; false: it is left out, or nothing happened."""
        until = time.monotonic() + _BY_HAND
        while time.monotonic() < until:
            if not self._control.drive.following:
                return True
            if self._enter_within(_PERIOD, self._speed):
                return False
        return False

    def _require_yes(self, what: str) -> None:
        """
        Ask whether a step is to be done.

        :raises _Left: it is not.
        """
        # what was typed before the question is no answer
        self._check()
        self._control.screen.say(f'{what[0].upper()}{what[1:]}? [y/N]')
        until = time.monotonic() + _BY_HAND
        while time.monotonic() < until:
            self._control.pause(_PERIOD)
            typed = _typed()
            if typed:
                if typed.strip().lower() in (b'y', b'yes'):
                    return
                raise _Left('left out')
        raise _Left(f'no answer for {_BY_HAND:g} s')

    def _stop(self) -> None:
        """
        Stop the motor, and wait until it stands.

        :raises CliError: the stop is not confirmed, or the motor turns on.
        """
        if not self._control.stop():
            raise CliError(self._not_confirmed)
        self._wait_until_it_stands()

    @property
    def _not_confirmed(self) -> str:
        return (
            f'the stop is NOT confirmed: open the {self._profile.enable_input}, or use the '
            'emergency stop, if the motor turns; nfo-sinus stop tries again'
        )

    @property
    def _faulted(self) -> bool:
        status = self._control.drive.snapshot.status
        return status is not None and status.faulted

    def _wait_until_it_stands(self) -> None:
        """
        Wait until the motor stands; one that turns on is stopped again, for others may command it.

        :raises CliError: a stop is not confirmed, or the motor turns on.
        """
        until, again = time.monotonic() + _STANDS, time.monotonic() + _AGAIN
        while self._turns:
            now = time.monotonic()
            if now > until:
                shown = self._control.drive.state.describe()
                raise CliError(f'the motor does not come to a standstill ({shown})')
            if now > again:
                again = now + _AGAIN
                if not self._control.stop():
                    raise CliError(self._not_confirmed)
            self._pause()

    def _give_back(self) -> None:
        """At the end: stop the motor, however this is ended, and give control back."""
        control = self._control
        if not control.stop():
            control.screen.say(self._not_confirmed)
            return
        if self._turns:
            # a slow ramp takes its time
            control.screen.say(say(control.answer))
        if control.give_back(_STANDS):
            control.screen.say(say(control.answer))

    @contextlib.contextmanager
    def _muted(self, *causes: Cause) -> Iterator[None]:
        """Have nothing said of what a step leads to by itself."""
        self._mute |= set(causes)
        try:
            yield
        finally:
            self._mute -= set(causes)

    def _add(
        self, name: str, right: bool | None, saw: str = '', speed: float = math.nan
    ) -> None:
        """Record what the drive shows now."""
        offline, words = self._control.offline, {}
        for key in filter(offline.params.reaches, self._keys):
            read = functools.partial(offline.params.read_data, key, Priority.SERVICE)
            # what it refuses now is not seen
            with contextlib.suppress(DriveError):
                data = self._read(read, speed)
                words[key] = struct.unpack(f'>{len(data) // 2}h', data)
        self._read(lambda: offline.state.reader.read(Priority.SERVICE), speed)
        saw = ', '.join(filter(None, (saw, offline.state.describe())))
        hertz = speed if self._unit == 'Hz' else math.nan
        self._moments.append(Moment(name, saw, right, hertz, words))

    def _read(self, command: Callable[[], Coroutine[Any, Any, _T]], speed: float) -> _T:
        """Return what a drive tells; the motor turns on at a speed meanwhile, NaN: at none."""
        reading = self._control.drive.run(command)
        while not reading.done():
            self._pause(None if math.isnan(speed) else speed)
        return reading.result()


def _typed() -> bytes:
    """
    Return what was typed, at once.

    :raises Ended: the terminal is gone.
    """
    try:
        if not select.select([sys.stdin], [], [], 0.0)[0]:
            return b''
        typed = os.read(sys.stdin.fileno(), 4096)
    except (OSError, ValueError):
        typed = b''
    if not typed:
        raise Ended('the terminal is gone', INTERRUPTED, 'SIGHUP')
    return typed
