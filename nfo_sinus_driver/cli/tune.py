# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``tune``: the drive measures its motor, or calculates it."""

from __future__ import annotations

import argparse
import time

from nfo_sinus_driver.cli.console import CliError, as_json, require_yes, say
from nfo_sinus_driver.cli.control_session import (
    INTERRUPTED,
    MUTE,
    ControlSession,
    Ended,
    control_session,
)
from nfo_sinus_driver.cli.options import Verb
from nfo_sinus_driver.cli.session import Session
from nfo_sinus_driver.drive import Cause, DriveError, Procedure, Report, Tuned
from nfo_sinus_driver.drive.procedure import require_known

_PROCEDURES = {
    'full': Procedure.FULL,
    'basic': Procedure.BASIC,
    'rs': Procedure.STATOR_RESISTANCE,
    'calculate': Procedure.CALCULATE,
}
_STATUS_PERIOD = 0.2
#: What is reported as the result, and not as an event.
_OUTCOMES = (
    Cause.TUNING_CHANGED,
    Cause.TUNING_FAILED,
    Cause.TUNING_STOPPED,
    Cause.TUNING_CUT_SHORT,
    Cause.TUNING_DOES_NOT_BEGIN,
)


class Tune(Verb):
    """Have the drive measure or calculate its motor."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        parser.add_argument(
            'procedure', choices=_PROCEDURES,
            help='full or basic tuning, rs: only the stator resistance, calculate: from the motor '
            'plate alone',
        )

    def main(self, options: argparse.Namespace) -> int:
        """Tune, and report which parameters have changed."""
        procedure = _PROCEDURES[options.procedure]
        what = procedure.value
        with Session(options) as session:
            drive = session.drive()
            drive.identify(thoroughly=False)
            require_known(procedure, drive.model)
            if drive.read_status().driven:
                raise CliError(f'{what}: the motor runs ({drive.state.describe()}): stop it first')
        effect = (
            'the drive changes its motor parameters.'
            if procedure is Procedure.CALCULATE
            else 'the motor is energised and may turn, for minutes.'
        )
        require_yes(options, f'{what[0].upper()}{what[1:]}: {effect} Go on?')
        with control_session(options, mute={*MUTE, *_OUTCOMES}, live=not options.json) as control:
            return _Tuning(control, options, procedure).run()


class _Tuning:
    """One procedure, from beginning to end."""

    def __init__(
        self, control: ControlSession, options: argparse.Namespace, procedure: Procedure
    ) -> None:
        self._control = control
        self._options = options
        self._procedure = procedure
        self._drive = control.command()
        self._begun = time.monotonic()
        self._shown = ''
        self._shown_at = 0.0

    def run(self) -> int:
        """Tune; return the exit status."""
        control, status = self._control, 1
        try:
            tuned, status = self._tune()
        except Ended as end:
            how = Report(Cause.INTERRUPTED, signal=str(end))
            tuned, status = Tuned(False, how, ()), end.status
        except DriveError as error:
            tuned = Tuned(False, error.report, ())
        text = say(tuned.how)
        if self._drive.stop_unconfirmed and not self._drive.blocked_by_fault:
            # a fault keeps it still; else nothing retries when this command has ended
            control.screen.say(text)
            control.confirmed_late()
            status = status or 1
        self._put(tuned, text)
        control.screen.say(text)
        return status

    def _tune(self) -> tuple[Tuned, int]:
        """Return how it ended, and the exit status."""
        control, drive = self._control, self._drive
        control.wait(drive.connect())
        drive.activate()
        control.show = self._show
        future = drive.tune(self._procedure)
        self._begun = time.monotonic()
        try:
            tuned = control.wait(future)
        except Ended as end:
            control.screen.say(f'{end.key}: stopping it')
            control.finish(drive.cancel_tuning())
            return control.finish(future), INTERRUPTED
        return tuned, int(not tuned.success)

    def _put(self, tuned: Tuned, text: str) -> None:
        screen = self._control.screen
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
            screen.put(as_json(facts))
            return
        for change in tuned.changes:
            screen.put(str(change))
        if tuned.success and not tuned.changes:
            screen.put('no parameter has changed')

    def _show(self) -> None:
        snapshot = self._drive.snapshot
        if snapshot.status is None:
            return
        screen, now = self._control.screen, time.monotonic()
        stage = f'{snapshot.status.code} {snapshot.text}'
        line = f'{self._procedure.value}  {stage}  {now - self._begun:.0f} s'
        if screen.live and now > self._shown_at + _STATUS_PERIOD:
            self._shown_at = now
            screen.status(line)
        elif not screen.live and stage != self._shown:
            self._shown = stage
            screen.say(line)
