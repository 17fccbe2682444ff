# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verbs ``run``, until somebody or something ends it, ``stop`` and ``ack``."""

from __future__ import annotations

import argparse
import json
import math
import time

from nfo_sinus_driver.catalog import Kind, Meaning, Role
from nfo_sinus_driver.cli.console import CliError, UsageError, say
from nfo_sinus_driver.cli.control_session import (
    NO_TIMEOUT,
    RELEASED,
    SHUTDOWN_TIMEOUT,
    ControlSession,
    Ended,
    Stopping,
    control_session,
    spoken,
)
from nfo_sinus_driver.cli.screen import as_json, as_line
from nfo_sinus_driver.drive import Cause, Drive, DriveError, InverterStatus, Report
from nfo_sinus_driver.drive.commands import read_limits

#: How often the set-point is sent anew, s; it is given up as old after 2.5 s.
_PERIOD = 0.1
#: How long the word may take why it was stopped, s.
_LONGEST_WORD = 1.0
#: How long the stop may take that comes with connecting, s.
_LONGEST_STOP = 5.0
#: Why a motor follows set-points no more.
_ENDS = (Cause.STOPPED_BECAUSE, Cause.STOPPED_BECAUSE_OF_FAULT, Cause.LOST, Cause.LOST_IN_USE)
_FAILED = 1
_INTERRUPTED = 130


def run(options: argparse.Namespace) -> int:
    """Run the motor until it is ended; however that happens, the motor is stopped."""
    follows = options.reference == 'fieldbus'
    if follows and options.setpoint is None:
        raise UsageError('which set-point? Such as: nfo-sinus run 10')
    if not follows and options.setpoint is not None:
        raise UsageError(
            f'with --reference {options.reference} the drive follows its own reference: '
            'leave the set-point out'
        )
    with control_session(options, live=not options.json) as control:
        return _Ride(control, options).go()


class _Ride:
    """One motor that runs, from enable to stop."""

    def __init__(self, control: ControlSession, options: argparse.Namespace) -> None:
        self._session = control
        self._options = options
        self._screen = control.screen
        self._drive = control.drive(
            control_method=options.method,
            reference=options.reference,
            expected_control_mode=options.control_mode,
            drive_timeout=options.drive_timeout,
            setpoint_max=options.setpoint_max,
        )
        self._stopping = Stopping(control, self._drive, self._show)
        self._shown_at = -math.inf
        self._ends_at = math.inf

    def go(self) -> int:
        """
        Run the motor and stop it; return the exit status.

        :raises CliError: it cannot be run, and nothing was written.
        """
        self._require_admitted()
        # whatever happens from here on, it is stopped
        status, why, signal = _FAILED, 'an error in this command', ''
        try:
            self._start()
            self._follow()
        except Ended as end:
            status, why, signal = end.status, str(end), end.signal
        except DriveError as error:
            why = say(error)
            self._screen.say(why)
        finally:
            confirmed = self._end(why, signal)
        return status if confirmed else _FAILED

    def _require_admitted(self) -> None:
        """See to it that the motor may be run so; nothing is written."""
        remote, options = self._session.remote, self._options
        remote.identify(thoroughly=False)
        seen = remote.look()
        told = remote.state.describe()
        if seen.driven:
            by = 'the bus: nfo-sinus stop stops it' if seen.from_bus else 'keypad or terminals'
            raise CliError(f'the motor runs already ({told}), by {by}')
        if seen.faulted:
            fault = seen.listed
            raise CliError(
                f'fault {told} is active: {fault.description}. {fault.remedy}; '
                'then type nfo-sinus ack'
            )
        mode = remote.do(remote.state.read_control_mode)
        key = remote.model.key(Role.CONTROL_MODE)
        if not remote.params.reaches(key):
            # nothing tells it, so it is what was typed
            mode = options.control_mode or mode
        if options.control_mode not in ('', mode):
            raise CliError(
                f'the drive is in control mode {mode}, not {options.control_mode}: set '
                f'{key}, or give another --control-mode'
            )
        if options.setpoint is None:
            return
        target = remote.model.profile.setpoints.get(mode)
        if target is None:
            raise CliError(f'the drive takes no set-point over the bus in control mode {mode}')
        unit = {'Freque': 'Hz', 'Speed': 'rpm'}.get(mode) or remote.state.unit
        limits = remote.do(lambda: read_limits(remote.state, mode))
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
        control, drive = self._session, self._drive
        control.wait(drive.connect())
        drive.activate()
        self._enable()
        if self._options.seconds is not None:
            self._ends_at = time.monotonic() + self._options.seconds

    def _enable(self) -> None:
        """Enable it, once the stop is confirmed that connecting has made sure of."""
        deadline = time.monotonic() + _LONGEST_STOP
        while True:
            try:
                self._session.wait(self._drive.enable(), self._show)
                return
            except DriveError as error:
                pending = error.report.cause is Cause.STOP_PENDING
                if not pending or time.monotonic() >= deadline:
                    raise
            name = self._session.signal(_PERIOD)
            if name:
                raise Ended(name, _INTERRUPTED, name)

    def _follow(self) -> None:
        """Keep the set-point fresh until something ends it, by :class:`Ended`."""
        options, drive = self._options, self._drive
        while True:
            if options.setpoint is not None:
                drive.set_setpoint(options.setpoint)
            self._show()
            name = self._session.signal(max(0.0, min(_PERIOD, self._left)))
            if name:
                # without --for this is how one ends it
                wanted = name == 'SIGINT' and options.seconds is None
                raise Ended(name, 0 if wanted else _INTERRUPTED, name)
            if not drive.following:
                raise Ended(self._why_disarmed(), _FAILED)
            if self._screen.gone:
                raise Ended('nobody reads the output any more', _FAILED)
            if self._left <= 0:
                raise Ended(f'{options.seconds:g} s are over', 0)

    @property
    def _left(self) -> float:
        return self._ends_at - time.monotonic()

    def _why_disarmed(self) -> str:
        """Return why the motor follows set-points no more; a person has been told."""
        deadline = time.monotonic() + _LONGEST_WORD
        while time.monotonic() < deadline:
            for report in reversed(self._session.events.told):
                if report.cause in _ENDS:
                    return say(report)
            self._session.signal(0.01)
        return 'it was stopped'

    def _end(self, why: str, signal: str) -> bool:
        """Stop the motor and give control back; true when all of it was confirmed."""
        if self._drive.identity is None:
            return True
        confirmed = False
        try:
            if signal:
                self._screen.say(f'{spoken(signal)}: stopping the motor')
            confirmed = self._stopping.stop()
            if confirmed:
                told = self._stopping.answer
                self._screen.say(say(told))
                # who ended it so is in a hurry, or not there any more
                hurry = signal not in ('', 'SIGINT') or self._screen.gone
                confirmed = self._stopping.give_back(SHUTDOWN_TIMEOUT if hurry else math.inf)
                if confirmed and self._stopping.answer != told:
                    self._screen.say(say(self._stopping.answer))
        finally:
            if self._options.json:
                stop = say(self._stopping.answer)
                facts = {'ended': why, 'stop_confirmed': confirmed, 'stop': stop}
                self._screen.put(json.dumps(facts, ensure_ascii=False))
        return confirmed

    def _show(self) -> None:
        now = time.monotonic()
        seen, values = self._drive.snapshot, self._session.events.values
        nothing_yet = seen.status is None and self._shown_at < 0
        if nothing_yet or now < self._shown_at + self._options.period:
            return
        self._shown_at = now
        if self._options.json:
            self._screen.status(as_json(seen, values))
            return
        timed = seen.enabled and self._left < math.inf
        left = f'{math.ceil(max(0.0, self._left))} s left' if timed else ''
        self._screen.status(as_line(seen, values, left))


#: What connecting to a drive says, and what does not matter to who stops it or acknowledges.
_MUTE = {*NO_TIMEOUT, Cause.FOUND_RUNNING, Cause.FAULT_APPEARED}
#: How long a drive may take to answer to all that a command consists of, s.
_LONGEST = 15.0
_STATUS_PERIOD = 0.2


def stop(options: argparse.Namespace) -> int:
    """Stop a motor that the bus runs."""
    with control_session(options, mute=_MUTE, live=not options.json) as control:
        try:
            done, answer = _stop(control, options)
        except DriveError as error:
            done, answer = False, (
                f'the stop is NOT confirmed: {say(error)}. '
                'Use the enable input or the emergency stop if the motor turns'
            )
        if options.json:
            facts = {'confirmed': done, 'message': answer}
            control.screen.put(json.dumps(facts, ensure_ascii=False))
        elif done:
            control.screen.put(answer)
    if not done:
        raise CliError(answer)
    return 0


def _stop(control: ControlSession, options: argparse.Namespace) -> tuple[bool, str]:
    """Return whether it is stopped, and what to say of it."""
    remote = control.remote
    remote.identify(thoroughly=False)
    seen = remote.look()
    told = remote.state.describe()
    if not seen.from_bus:
        if seen.driven or seen.means(Meaning.START_DELAY):
            return False, (
                f'keypad or terminals run the motor ({told}), so the bus cannot stop it: '
                'press STOP at the keypad, or open its enable input'
            )
        return True, f'the motor does not run ({told})'
    drive = _in_charge(control)
    shown_at = -math.inf

    def show() -> None:
        nonlocal shown_at
        if control.screen.live and time.monotonic() > shown_at + _STATUS_PERIOD:
            shown_at = time.monotonic()
            control.screen.status(as_line(drive.snapshot, control.events.values))

    stopping = Stopping(control, drive, show)
    control.finish(drive.connect(), _LONGEST)
    drive.activate()
    stopped = stopping.stop(quick=options.quick)
    how = say(stopping.answer)
    if not stopped:
        return False, how
    if not options.json:
        control.screen.say(how)
    if not stopping.give_back():
        return False, f'{how}, but control was not released'
    return True, say(stopping.answer)


def _in_charge(control: ControlSession) -> Drive:
    """Return the drive, to be commanded by whichever method has control of it already."""
    method = control.remote.method_in_charge()
    methods = control.remote.model.profile.methods
    references = methods[method].references
    # it does not matter to who starts nothing, and what is not usual leaves it to the drive
    reference = references[0] if method == next(iter(methods)) else references[-1]
    return control.drive(control_method=method, reference=reference)


def ack(options: argparse.Namespace) -> int:
    """Acknowledge a fault or an alarm."""
    with control_session(options, mute=_MUTE) as control:
        remote = control.remote
        remote.identify(thoroughly=False)
        seen = remote.look()
        told = remote.state.describe()
        error: DriveError | CliError | None = None
        acknowledged = False
        if not seen.faulted and seen.kind is Kind.STATUS:
            answer = say(Report(Cause.NOTHING_TO_ACKNOWLEDGE, status=told))
        else:
            try:
                answer = say(_acknowledge(control, seen))
                acknowledged = True
            except (DriveError, CliError) as failure:
                error, answer = failure, say(failure)
        if options.json:
            now = remote.look()
            facts = {
                'acknowledged': acknowledged,
                'code': seen.code,
                'text': remote.state.text_of(seen.code),
                'code_now': now.code,
                'text_now': remote.state.text,
                'message': answer,
            }
            control.screen.put(json.dumps(facts, ensure_ascii=False))
        elif not error:
            control.screen.put(answer)
    if error is not None:
        raise CliError(answer)
    return 0


def _acknowledge(control: ControlSession, seen: InverterStatus) -> Report:
    """Acknowledge, while the motor stands, and leave nothing that could start it."""
    remote = control.remote
    if seen.driven:
        raise CliError(
            f'the motor runs ({remote.state.describe()}), and to acknowledge would stop it: '
            'type nfo-sinus stop first'
        )
    drive = _in_charge(control)
    control.finish(drive.connect(), _LONGEST)
    answer = control.finish(drive.acknowledge(), _LONGEST)
    # nobody is here afterwards to keep the drive from timing out
    released = control.finish(drive.disconnect(1.0), _LONGEST)
    if released.cause not in RELEASED:
        return answer
    return Report(released.cause, **{**released.values, 'stop': answer})
