# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verbs ``stop`` and ``ack``."""

from __future__ import annotations

import argparse
import math
import time

from nfo_sinus_driver.catalog import Kind, Meaning
from nfo_sinus_driver.cli.console import CliError, as_json, say
from nfo_sinus_driver.cli.control_session import RELEASED, ControlSession, control_session
from nfo_sinus_driver.cli.options import Verb, add_flag
from nfo_sinus_driver.cli.screen import as_line
from nfo_sinus_driver.drive import Cause, DriveError, InverterStatus, Report

_STATUS_PERIOD = 0.2


class Stop(Verb):
    """Stop a motor that the bus runs, and give control back."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        add_flag(parser, '--quick', 'release the motor at once: it coasts')

    def complete(self, options: argparse.Namespace) -> None:
        """Ask nothing: where the first request stops a motor, that is what is wanted."""
        options.may_take_control = True

    def main(self, options: argparse.Namespace) -> int:
        """Stop a motor that the bus runs."""
        with control_session(options, live=not options.json) as control:
            try:
                done, answer = _stop(control, options)
            except DriveError as error:
                done, answer = False, (
                    f'the stop is NOT confirmed: {say(error)}. '
                    'Use the enable input or the emergency stop if the motor turns'
                )
            if options.json:
                control.screen.put(as_json({'confirmed': done, 'message': answer}))
            elif done:
                control.screen.put(answer)
        if not done:
            raise CliError(answer)
        return 0


def _stop(control: ControlSession, options: argparse.Namespace) -> tuple[bool, str]:
    """Return whether it is stopped, and what to say of it."""
    offline = control.offline
    offline.identify(thoroughly=False)
    status = offline.read_status()
    shown = offline.state.describe()
    if not (status.from_bus or status.unknown):
        if status.driven or status.means(Meaning.START_DELAY):
            return False, (
                f'keypad or terminals run the motor ({shown}), so the bus cannot stop it: '
                'press STOP at the keypad, or open its enable input'
            )
        return True, f'the motor does not run ({shown})'
    control.connect_as_controlled().activate()
    shown_at = -math.inf

    def show() -> None:
        nonlocal shown_at
        if control.screen.live and time.monotonic() > shown_at + _STATUS_PERIOD:
            shown_at = time.monotonic()
            control.screen.status(as_line(control.drive.snapshot, control.values))

    control.show = show
    stopped = control.stop(quick=options.quick)
    how = say(control.answer)
    if not stopped:
        return False, how
    if not options.json:
        control.screen.say(how)
    if not control.give_back():
        return not control.drive.stop_waits, f'{how}, but control was not released'
    return True, say(control.answer)


class Ack(Verb):
    """Acknowledge a fault; nothing starts by it."""

    def main(self, options: argparse.Namespace) -> int:
        """Acknowledge a fault or an alarm."""
        with control_session(options) as control:
            offline = control.offline
            offline.identify(thoroughly=False)
            status = offline.read_status()
            answer, failed = '', False
            try:
                answer = say(_acknowledge(control, status))
            except (DriveError, CliError) as failure:
                answer, failed = say(failure), True
            if options.json:
                now = offline.read_status()
                facts = {
                    'acknowledged': not failed and _is_to_acknowledge(status),
                    'code': status.code,
                    'text': offline.state.text_of(status),
                    'code_now': now.code,
                    'text_now': offline.state.text,
                    'message': answer,
                }
                control.screen.put(as_json(facts))
            elif not failed:
                control.screen.put(answer)
        if failed:
            raise CliError(answer)
        return 0


def _is_to_acknowledge(status: InverterStatus) -> bool:
    return status.faulted or status.kind is not Kind.STATUS


def _acknowledge(control: ControlSession, status: InverterStatus) -> Report:
    """Acknowledge, while the motor stands, and leave nothing that could start it."""
    shown = control.offline.state.describe()
    if not _is_to_acknowledge(status):
        return Report(Cause.NOTHING_TO_ACKNOWLEDGE, status=shown)
    if status.driven:
        raise CliError(
            f'the motor runs ({shown}), and to acknowledge would stop it: type nfo-sinus stop first'
        )
    drive = control.connect_as_controlled()
    answer = control.finish(drive.acknowledge())
    # after this command nothing keeps the drive from timing out
    released = control.finish(drive.disconnect(1.0))
    if released.cause not in RELEASED:
        return answer
    return Report(released.cause, **{**released.values, 'stop': answer})
