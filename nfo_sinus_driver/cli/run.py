# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``run``: the motor runs until something ends it, and is stopped however that happens."""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog.status import QUANTITIES
from nfo_sinus_driver.cli.console import CliError, UsageError, as_json, say
from nfo_sinus_driver.cli.control_session import (
    INTERRUPTED,
    ControlSession,
    Ended,
    control_session,
)
from nfo_sinus_driver.cli.options import SETTINGS, Verb, add_setting, duration, period, setpoint
from nfo_sinus_driver.cli.screen import as_facts, as_line
from nfo_sinus_driver.drive import Cause, DriveError, Report
from nfo_sinus_driver.drive.known.diagnosis import explain_fault
from nfo_sinus_driver.drive.known.settings import REFERENCES
from nfo_sinus_driver.drive.motion.starting import read_limits

#: How often the set-point is sent anew, s; it is given up as old after 2.5 s.
_PERIOD = 0.1
#: How long the report may take why it was stopped, s.
_LONGEST_REPORT = 1.0
#: The same as the parameter ``shutdown_timeout`` of the driver has, s.
_SHUTDOWN_TIMEOUT = 4.0
#: Why a motor follows set-points no more.
_ENDS = (Cause.STOPPED_BECAUSE, Cause.STOPPED_BECAUSE_OF_FAULT, Cause.LOST, Cause.LOST_IN_USE)
#: What names the fault of a drive, and what to do.
_NAMES_FAULT = (Cause.FAULT_APPEARED, Cause.STOPPED_BECAUSE_OF_FAULT)
_FAILED = 1
#: Settings of a drive that may be given for one run: how they are typed, and what they mean here.
_SETTINGS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ('control_method', '--method', {}),
    ('reference', '--reference', {'metavar': 'REFERENCE', 'help': (
        f'what the motor follows: {", ".join(REFERENCES)} (default: fieldbus, which is '
        'SETPOINT)'
    )}),
    ('expected_control_mode', '--control-mode', {'help': (
        'refuse to run in another one; an Optimal, which does not tell it, is taken to be in '
        'this one (default: any; an Optimal: Freque)'
    )}),
    ('setpoint_max', '--setpoint-max', {'help': (
        'the greatest SETPOINT that is meant to be one (default: what is nominal for the '
        'motor, where the drive tells it)'
    )}),
    ('drive_timeout', '--drive-timeout', {}),
)


class Run(Verb):
    """Run the motor, until Ctrl-C or --for is over; then stop it."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        parser.add_argument(
            'setpoint', nargs='?', type=setpoint, metavar='SETPOINT',
            help='in the unit of the control mode: Hz, rpm, %% of nominal torque, or that of the '
            'process; negative is reverse',
        )
        parser.add_argument(
            '--for', dest='seconds', type=duration, metavar='SECONDS',
            help='stop after so long (default: run until Ctrl-C)',
        )
        for name, option, more in _SETTINGS:
            add_setting(parser, name, option, default=SETTINGS[name].default, **more)
        parser.add_argument(
            '--period', type=period, default=0.5, metavar='SECONDS',
            help='from one status to the next (default: 0.5)',
        )

    def main(self, options: argparse.Namespace) -> int:
        """Run the motor until it is ended; however that happens, the motor is stopped."""
        follows = options.reference == 'fieldbus'
        if follows and options.setpoint is None:
            raise UsageError('which set-point? Such as: nfo-sinus run 10')
        if not follows and options.setpoint is not None:
            raise UsageError(
                f'with --reference {options.reference} the drive follows its own reference: '
                'leave the set-point out'
            )
        with control_session(options, mute=(), live=not options.json) as control:
            return _Run(control, options).run()


class _Run:
    """One motor that runs, from enable to stop."""

    def __init__(self, control: ControlSession, options: argparse.Namespace) -> None:
        self._control = control
        self._options = options
        self._drive = control.command(
            control_method=options.method or options.control_method,
            reference=options.reference,
            expected_control_mode=options.control_mode,
            drive_timeout=options.drive_timeout,
            setpoint_max=options.setpoint_max,
        )
        self._shown_at = -math.inf
        self._ends_at = math.inf

    def run(self) -> int:
        """
        Run the motor and stop it; return the exit status.

        :raises CliError: it cannot be run, and nothing was written.
        """
        self._control.require_ready()
        self._require_setpoint(self._control_mode())
        # whatever happens from here on, it is stopped
        status, why, signal = _FAILED, 'an error in this command', ''
        try:
            self._start()
            self._follow()
        except Ended as end:
            status, why, signal = end.status, str(end), end.signal
            if signal and self._drive.identity is not None:
                self._control.screen.say(f'{end.key}: stopping the motor')
            elif self._control.screen.gone:
                self._control.screen.say(why)
        except DriveError as error:
            why = say(error)
            self._control.screen.say(why)
        finally:
            confirmed = self._end(why, signal)
        return status if confirmed else _FAILED

    def _control_mode(self) -> str:
        """Return the control mode of the drive, which is the expected one."""
        offline, expected = self._control.offline, self._options.control_mode
        mode = offline.do(offline.state.read_control_mode)
        key = offline.model.key(Role.CONTROL_MODE)
        if not offline.params.reaches(key):
            # nothing reports it, so it is what was typed
            mode = expected or mode
        if expected not in ('', mode):
            raise CliError(
                f'the drive is in control mode {mode}, not {expected}: set '
                f'{key}, or give another --control-mode'
            )
        return mode

    def _require_setpoint(self, mode: str) -> None:
        """Ensure that the set-point is one for this mode and this motor."""
        offline, options = self._control.offline, self._options
        if options.setpoint is None:
            return
        if mode not in offline.model.profile.setpoints:
            raise CliError(f'the drive takes no set-point over the bus in control mode {mode}')
        unit = QUANTITIES[mode].unit or offline.state.unit
        limits = offline.do(lambda: read_limits(offline.state, mode))
        if not limits.least <= options.setpoint <= limits.most:
            raise CliError(
                f'set-point {options.setpoint:g} {unit} is out of range: '
                f'in control mode {mode} {limits.least:g} to {limits.most:g} {unit}'
            )
        most = options.setpoint_max or limits.nominal
        if abs(options.setpoint) > most:
            what = '--setpoint-max' if options.setpoint_max else 'what is nominal for this motor'
            raise CliError(
                f'set-point {options.setpoint:g} {unit} is beyond {what}, {most:g} {unit}: check '
                f'the unit; if it is meant so, give --setpoint-max {abs(options.setpoint):g}'
            )

    def _start(self) -> None:
        self._control.connect()
        self._control.show = self._show
        self._control.enable()
        if self._options.seconds is not None:
            self._ends_at = time.monotonic() + self._options.seconds

    def _follow(self) -> None:
        """Keep the set-point fresh until something ends it, by :class:`Ended`."""
        options, drive = self._options, self._drive
        while True:
            if options.setpoint is not None:
                drive.set_setpoint(options.setpoint)
            self._show()
            name = self._control.signal(max(0.0, min(_PERIOD, self._left)))
            if name:
                # without --for this is how one ends it
                wanted = name == 'SIGINT' and options.seconds is None
                raise Ended(name, 0 if wanted else INTERRUPTED, name)
            if not drive.following:
                raise Ended(self._why_disabled(), _FAILED)
            if self._control.screen.gone:
                raise Ended('the output has no reader any more, or no room', _FAILED)
            if self._left <= 0:
                raise Ended(f'{options.seconds:g} s are over', 0)

    @property
    def _left(self) -> float:
        return self._ends_at - time.monotonic()

    def _why_disabled(self) -> str:
        """Return why the motor follows set-points no more, as the operator was informed."""
        deadline = time.monotonic() + _LONGEST_REPORT
        while time.monotonic() < deadline:
            for report in reversed(self._control.reported):
                if report.cause in _ENDS:
                    return say(report)
            self._control.signal(0.01)
        return 'it was stopped'

    def _end(self, why: str, signal: str) -> bool:
        """Stop the motor and release control; true when the stop is confirmed."""
        if self._drive.identity is None:
            return True
        control, confirmed = self._control, False
        try:
            confirmed = control.stop()
            if confirmed:
                stop = control.answer
                control.screen.say(say(stop))
                # an operator who ended it so is in a hurry, or not there any more
                hurry = signal not in ('', 'SIGINT') or control.screen.gone
                given_back = control.give_back(_SHUTDOWN_TIMEOUT if hurry else math.inf)
                confirmed = not self._drive.stop_waits
                if given_back and control.answer != stop:
                    control.screen.say(say(control.answer))
                self._name_fault()
        finally:
            if self._options.json:
                facts = {'ended': why, 'stop_confirmed': confirmed, 'stop': say(control.answer)}
                control.screen.put(as_json(facts))
        return confirmed

    def _name_fault(self) -> None:
        """Say which fault is active and what to do, where no poll came to report it."""
        state = self._drive.state
        reported = any(report.cause in _NAMES_FAULT for report in self._control.reported)
        if state.status is not None and state.status.faulted and not reported:
            fault = explain_fault(state, state.status)
            self._control.screen.say(say(Report(Cause.FAULT_APPEARED, fault=fault)))

    def _show(self) -> None:
        now = time.monotonic()
        snapshot, values = self._drive.snapshot, self._control.values
        # what a poll showed before control was taken is past
        nothing_yet = not snapshot.enabled and self._shown_at < 0
        if nothing_yet or now < self._shown_at + self._options.period:
            return
        self._shown_at = now
        if self._options.json:
            text = as_json(as_facts(snapshot, values))
        else:
            timed = snapshot.enabled and self._left < math.inf
            left = f'{math.ceil(max(0.0, self._left))} s left' if timed else ''
            text = as_line(snapshot, values, left)
        self._control.screen.status(text)
