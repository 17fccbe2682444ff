# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a failed transaction or a status means, and which conditions are reported."""

from __future__ import annotations

from collections.abc import Iterator
import math

from nfo_sinus_driver.bus import Cancelled
from nfo_sinus_driver.catalog import Fact, InverterStatus, Kind, Meaning, State
from nfo_sinus_driver.drive.known.drive_state import SHORTEST_POWER_OFF, DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.movement import FALL_AFTER_SILENCE
from nfo_sinus_driver.link import (
    GatewayFault,
    GatewayLate,
    GatewaySilent,
    Interrupted,
    LinkError,
    MailboxSilent,
    NoAnswer,
    NoData,
    NoPath,
    PortError,
    Refused,
    Unconfirmed,
)

#: Errors that say what to do: neither the drive nor the settings of its line are wrong.
_SAYS_WHAT_TO_DO = (
    PortError, Refused, GatewaySilent, GatewayLate, GatewayFault, NoPath, NoData, Interrupted,
    MailboxSilent, Unconfirmed,
)


def explain(error: LinkError, address: int, *, check: str | None = None) -> Report:
    """
    Return what a failed transaction means.

    :param check: what to check while the drive has never answered; ``None``: it has, so its
        settings are right [C93].
    """
    if isinstance(error, _SAYS_WHAT_TO_DO) or (check is None and error.hint):
        return Report(Cause.LINE_FAILED, error=str(error))
    if check is None:
        return Report(Cause.NOT_REACHED, error=str(error))
    if isinstance(error, NoAnswer):
        behind = f' ({error.hint})' if error.hint else ''
        return Report(Cause.NO_RESPONSE, address=address, behind=behind, check=check)
    return Report(Cause.NO_VALID_ANSWER, address=address, error=str(error), check=check)


def ended(error: BaseException) -> BaseException:
    """Return the error that a client gets: that the driver ends, where that cut a command short."""
    return DriveError(Cause.ENDING) if isinstance(error, Cancelled) else error


def explained(error: BaseException, address: int, check: str | None) -> BaseException:
    """Return the error that a client gets, as :func:`ended`; ``check`` as for :func:`explain`."""
    if not isinstance(error, LinkError):
        return ended(error)
    meant = DriveError(explain(error, address, check=check))
    meant.__cause__ = error
    return meant


def explain_failure(error: LinkError | DriveError, state: DriveState) -> Report:
    """Return what went wrong with a drive that has answered before."""
    if isinstance(error, DriveError):
        return error.report
    return explain(error, state.settings.address)


def report_of(error: Exception) -> Report:
    """Return the report of an error."""
    if isinstance(error, DriveError):
        return error.report
    if isinstance(error, LinkError):
        return Report(Cause.LINE_FAILED, error=str(error))
    return Report(Cause.DRIVER_ERROR, error=repr(error))


def explain_fault(state: DriveState, status: InverterStatus) -> Report:
    """Return which fault is active, what it means and what to do about its cause."""
    return state.report(Cause.FAULT, fault=status.listed)


def require_no_fault(state: DriveState, status: InverterStatus) -> None:
    """Raise a :class:`DriveError` if a fault is active, before the motor is energised."""
    if status.faulted:
        raise DriveError(state.report(Cause.FAULT_FORBIDS, fault=status.listed))


def explain_stop(state: DriveState, status: InverterStatus, control_mode: str) -> Report | None:
    """Return why a motor that was enabled in a control mode does not run any more, if so."""
    if state.control_mode != control_mode:
        mode, unit = state.control_mode, state.unit
        return Report(Cause.CONTROL_MODE_CHANGED, mode=mode, unit=unit)
    if status.faulted:
        return explain_fault(state, status)
    cause = None
    if status.state is State.NOT_READY_TO_SWITCH_ON:
        cause = Cause.DRIVE_STARTING
    elif status.unknown:
        cause = Cause.UNKNOWN_STATUS
    elif not status.from_bus:
        cause = _why_control_is_lost(state, status)
    elif Fact.RUN_INPUT_MISSING in status.facts:
        cause = Cause.RUN_INPUT_LOST
    elif state.left_alone:
        # not every drive shows a fault after its time-out, and some then run on
        cause = Cause.DRIVER_PAUSED
    elif not status.may_run:
        cause = Cause.STOPPED_BY_ITSELF
    elif state.model.profile.may_run_again and state.contact.unheard:
        cause = Cause.MAY_HAVE_RESTARTED
    return cause and state.report(cause, seconds=state.timeout.shortest)


def _why_control_is_lost(state: DriveState, status: InverterStatus) -> Cause:
    if status.means(Meaning.WITHHELD):
        return Cause.CONTROL_WITHHELD
    if status.means(Meaning.TERMINALS):
        return Cause.TERMINALS_IN_CONTROL
    if status.means(Meaning.KEYPAD):
        return Cause.KEYPAD_IN_CONTROL
    if status.runs:
        # the current limit, for one, hides what runs it
        return Cause.OTHERS_IN_CONTROL
    return Cause.POWER_CYCLED if state.contact.missed_before_poll else Cause.CONTROL_LOST


def explain_fall(
    state: DriveState, before: InverterStatus, status: InverterStatus, least: float
) -> Report | None:
    """
    Return why a motor turns slower than commanded after a silence, if it does.

    A drive that keeps its run command without power starts the motor from standstill when it is
    back. Where the status word is the same as before, only the frequency shows it.

    :param before: the status before the silence.
    :param least: Hz, the lowest frequency that can have been commanded since then.
    """
    was = min(abs(before.frequency), least)
    away = status.at - before.at
    if state.plc_time:
        # the PLC answers all the time, and a drive that is back may catch a coasting motor
        silent = away >= _LIFE_STOOD + state.contact.usual_interval
        most = min(was - FALL_AFTER_SILENCE, was * _CAUGHT)
    else:
        silent, most = state.contact.missed_before_poll and away >= SHORTEST_POWER_OFF, was / 2
    # where the frequency is not read with the status, it is NaN and does not fall
    if not (silent and was >= FALL_AFTER_SILENCE and abs(status.frequency) < most):
        return None
    return state.report(
        Cause.SLOWER_AFTER_SILENCE,
        before=abs(before.frequency) / state.measurements.turning.hertz,
        now=abs(status.frequency) / state.measurements.turning.hertz,
        unit=state.measurements.turning.unit,
    )


#: A PLC's life counter that stands still for this much longer than the poll interval is a silence
#: of the drive, s [C125].
_LIFE_STOOD = 0.2
#: A motor that is caught turns at no more than this share of its speed before.
_CAUGHT = 0.95
#: How long a condition has to be absent before it is reported again, s.
AGAIN_AFTER = 10.0


class Conditions:
    """Reports alarms, the current limit and sleep of one drive; they stop nothing."""

    def __init__(self, state: DriveState) -> None:
        self._state = state
        #: When each was last present.
        self._last_at: dict[tuple[Cause, int], float] = {}
        #: The last status had an alarm, with a code that is no alarm's.
        self._unnamed = False

    def take_status(self, status: InverterStatus) -> None:
        """Report the conditions that have begun."""
        for severity, report in self._reports(status):
            # each alarm by its code
            name = (report.cause, status.code if report.cause is Cause.ALARM else 0)
            before = self._last_at.get(name, -math.inf)
            self._last_at[name] = status.at
            if status.at - before > AGAIN_AFTER:
                self._state.notify(severity, report)
        self._unnamed = status.kind is Kind.ALARM and not status.listed.remedy

    def _reports(self, status: InverterStatus) -> Iterator[tuple[Severity, Report]]:
        by_code = status.means(Meaning.CURRENT_LIMIT)
        limited = by_code or Fact.LIMIT_ACTIVE in status.facts
        if limited and not status.faulted:
            # by telegram 1 a family has it as a code and as a warning; another has none
            limit = next(iter(status.model.codes(Meaning.CURRENT_LIMIT)), status.listed)
            yield Severity.WARNING, self._state.report(Cause.CURRENT_LIMITED, limit=limit)
        if status.kind is Kind.ALARM and not by_code:
            if status.listed.remedy:
                yield Severity.WARNING, self._state.report(Cause.ALARM, alarm=status.listed)
            elif self._unnamed and not limited:
                # a single one came or went between the two readings
                yield Severity.WARNING, self._state.report(Cause.ALARM_UNNAMED)
        if Fact.SLEEPING in status.facts:
            yield Severity.INFO, self._state.report(Cause.ASLEEP)
