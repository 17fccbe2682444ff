# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``tune``: the drive measures its motor, or calculates it."""

from __future__ import annotations

import argparse
import json
import time

from nfo_sinus_driver.cli.console import CliError, require_yes, say
from nfo_sinus_driver.cli.control_session import (
    NO_TIMEOUT,
    ControlSession,
    Ended,
    Stopping,
    control_session,
    spoken,
)
from nfo_sinus_driver.cli.session import Session
from nfo_sinus_driver.drive import Cause, DriveError, Procedure, Report, Tuned
from nfo_sinus_driver.drive.procedure import require_known

PROCEDURES = {
    'full': Procedure.FULL,
    'basic': Procedure.BASIC,
    'rs': Procedure.STATOR_RESISTANCE,
    'calculate': Procedure.CALCULATE,
}
#: How long connecting may take, and a cancelled tuning until it has ended, s.
_LONGEST = 15.0
_STATUS_PERIOD = 0.2
_INTERRUPTED = 130
#: What is told as the result.
_OUTCOMES = (
    Cause.TUNING_CHANGED,
    Cause.TUNING_FAILED,
    Cause.TUNING_STOPPED,
    Cause.TUNING_CUT_SHORT,
    Cause.TUNING_DOES_NOT_BEGIN,
)


def tune(options: argparse.Namespace) -> int:
    """Tune, and tell which parameters have changed."""
    procedure = PROCEDURES[options.procedure]
    what = procedure.value
    with Session(options) as session:
        drive = session.drive()
        drive.identify(thoroughly=False)
        require_known(procedure, drive.model)
        if drive.look().driven:
            raise CliError(f'{what}: the motor runs ({drive.state.describe()}): stop it first')
    require_yes(options, f'{what[0].upper()}{what[1:]}: {_warning(procedure)} Go on?')
    mute = {*NO_TIMEOUT, Cause.FAULT_APPEARED, *_OUTCOMES}
    with control_session(options, mute=mute, live=not options.json) as control:
        return _Tuning(control, options, procedure).go()


def _warning(procedure: Procedure) -> str:
    if procedure is Procedure.CALCULATE:
        return 'the drive changes its motor parameters.'
    return 'the motor is energised and may turn, for minutes.'


class _Tuning:
    """One procedure, from beginning to end."""

    def __init__(
        self, control: ControlSession, options: argparse.Namespace, procedure: Procedure
    ) -> None:
        self._session = control
        self._options = options
        self._procedure = procedure
        self._drive = control.drive()
        self._begun = time.monotonic()
        self._shown = ''
        self._shown_at = 0.0

    def go(self) -> int:
        """Tune; return the exit status."""
        screen, status = self._session.screen, 1
        try:
            tuned, status = self._tuned()
        except Ended as end:
            how = Report(Cause.INTERRUPTED, signal=str(end))
            tuned, status = Tuned(False, how, ()), end.status
        except DriveError as error:
            tuned = Tuned(False, error.report, ())
        text = say(tuned.how)
        if self._drive.stop_unconfirmed and not self._drive.blocked_by_fault:
            # a fault keeps it still; else nobody tries on when this command has ended
            screen.say(text)
            Stopping(self._session, self._drive, self._show).confirmed_late()
            status = status or 1
        if self._options.json:
            facts = {
                'success': tuned.success,
                'message': text,
                'seconds': round(time.monotonic() - self._begun, 1),
                'changed': [
                    {'name': one.key, 'old': one.old, 'new': one.new, 'unit': one.unit}
                    for one in tuned.changes
                ],
            }
            screen.put(json.dumps(facts, ensure_ascii=False))
        else:
            for change in tuned.changes:
                screen.put(str(change))
            if tuned.success and not tuned.changes:
                screen.put('no parameter has changed')
        screen.say(text)
        return status

    def _tuned(self) -> tuple[Tuned, int]:
        """Return how it ended, and the exit status."""
        control, drive = self._session, self._drive
        control.wait(drive.connect())
        drive.activate()
        future = drive.tune(self._procedure)
        self._begun = time.monotonic()
        try:
            tuned = control.wait(future, self._show)
        except Ended as end:
            control.screen.say(f'{spoken(str(end))}: stopping it')
            control.finish(drive.cancel_tuning(), _LONGEST)
            return control.finish(future, _LONGEST, self._show), _INTERRUPTED
        return tuned, int(not tuned.success)

    def _show(self) -> None:
        seen = self._drive.snapshot
        if seen.status is None:
            return
        screen, now = self._session.screen, time.monotonic()
        stage = f'{seen.status.code} {seen.text}'
        line = f'{self._procedure.value}  {stage}  {now - self._begun:.0f} s'
        if screen.live and now > self._shown_at + _STATUS_PERIOD:
            self._shown_at = now
            screen.status(line)
        elif not screen.live and stage != self._shown:
            self._shown = stage
            screen.say(line)
