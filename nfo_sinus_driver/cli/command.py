# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The verbs ``stop`` and ``ack``."""

from __future__ import annotations

import argparse
import json
import math
import time

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog import Meaning
from nfo_sinus_driver.cli.console import CliError
from nfo_sinus_driver.cli.control_session import NO_TIMEOUT
from nfo_sinus_driver.cli.control_session import RELEASED
from nfo_sinus_driver.cli.control_session import ControlSession
from nfo_sinus_driver.cli.control_session import Stopping
from nfo_sinus_driver.cli.control_session import control_session
from nfo_sinus_driver.cli.screen import as_line
from nfo_sinus_driver.cli.wording import say
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import InverterStatus
from nfo_sinus_driver.drive import Report

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
                'Use the RUN input or the emergency stop if the motor turns'
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
    told = remote.inverter.describe()
    if not seen.from_bus:
        if seen.driven or seen.means(Meaning.START_DELAY):
            return False, (
                f'keypad or terminals run the motor ({told}), so the bus cannot stop it: '
                'press STOP at the keypad, or open its RUN input'
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
        told = remote.inverter.describe()
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
                'text': remote.inverter.text_of(seen.code),
                'code_now': now.code,
                'text_now': remote.inverter.text,
                'message': answer,
            }
            control.screen.put(json.dumps(facts, ensure_ascii=False))
        elif not error:
            control.screen.put(answer)
    if error is not None:
        raise CliError(answer)
    return 0


def _acknowledge(control: ControlSession, seen: InverterStatus) -> Report:
    """
    Acknowledge, and leave nothing behind that could start the motor.

    :raises DriveError: the fault is still active.
    :raises CliError: the motor runs.
    """
    remote = control.remote
    if seen.driven:
        raise CliError(
            f'the motor runs ({remote.inverter.describe()}), and to acknowledge would stop it: '
            'type nfo-sinus stop first'
        )
    drive = _in_charge(control)
    control.finish(drive.connect(), _LONGEST)
    answer = control.finish(drive.acknowledge(), _LONGEST)
    # nobody is here afterwards to keep the drive from timing out
    released = control.finish(drive.disconnect(1.0), _LONGEST)
    return Report(Cause.CONTROL_RELEASED, stop=answer) if released.cause in RELEASED else answer
