# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a failed transaction or a status means, and what of a status is told when it begins."""

from __future__ import annotations

from collections.abc import Iterator
import math

from nfo_sinus_driver.catalog import Fact, InverterStatus, Kind, Meaning, State
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.link import (
    GatewayFault,
    GatewayLate,
    GatewaySilent,
    Interrupted,
    LinkError,
    NoAnswer,
    NoData,
    NoPath,
    PortError,
    Refused,
)

#: What is wrong is not the drive, nor the settings of its line.
_SAYS_WHAT_TO_DO = (
    PortError, Refused, GatewaySilent, GatewayLate, GatewayFault, NoPath, NoData, Interrupted
)


def explain(error: LinkError, address: int, *, check: str | None = None) -> Report:
    """
    Return what a failed transaction means.

    :param check: what to look at while the drive has never answered; ``None``: it has, so that its
        settings are right [C93].
    """
    if isinstance(error, _SAYS_WHAT_TO_DO):
        return Report(Cause.LINE_FAILED, error=str(error))
    if check is None:
        return Report(Cause.NOT_REACHED, error=str(error))
    if isinstance(error, NoAnswer):
        behind = f' ({error.hint})' if error.hint else ''
        return Report(Cause.NO_RESPONSE, address=address, behind=behind, check=check)
    return Report(Cause.NO_VALID_ANSWER, address=address, error=str(error))


def explain_failure(error: LinkError | DriveError, inverter: DriveState) -> Report:
    """Return what went wrong with a drive that has answered before."""
    if isinstance(error, DriveError):
        return error.report
    return explain(error, inverter.settings.address)


def report_of(error: Exception) -> Report:
    """Return what an error says, as far as that is known."""
    if isinstance(error, DriveError):
        return error.report
    if isinstance(error, LinkError):
        return Report(Cause.LINE_FAILED, error=str(error))
    return Report(Cause.DRIVER_ERROR, error=repr(error))


def explain_fault(inverter: DriveState, seen: InverterStatus) -> Report:
    """Return which fault is active, what it means and what to do about its cause."""
    return inverter.report(Cause.FAULT, fault=seen.listed)


def require_no_fault(inverter: DriveState, seen: InverterStatus) -> None:
    """Raise a :class:`DriveError` if a fault is active, before the motor is energised."""
    if seen.faulted:
        raise DriveError(inverter.report(Cause.FAULT_FORBIDS, fault=seen.listed))


def explain_stop(inverter: DriveState, seen: InverterStatus, control_mode: str) -> Report | None:
    """Return why the motor no longer follows us, who enabled it in a control mode, if so."""
    if inverter.control_mode != control_mode:
        mode, unit = inverter.control_mode, inverter.unit
        return Report(Cause.CONTROL_MODE_CHANGED, mode=mode, unit=unit)
    if seen.faulted:
        return explain_fault(inverter, seen)
    cause = None
    if seen.state is State.NOT_READY_TO_SWITCH_ON:
        cause = Cause.DRIVE_STARTING
    elif not seen.from_bus:
        cause = _why_control_is_lost(inverter, seen)
    elif Fact.RUN_INPUT_MISSING in seen.facts:
        cause = Cause.RUN_INPUT_LOST
    elif not seen.runs:
        cause = Cause.STOPPED_BY_ITSELF
    return cause and inverter.report(cause)


def _why_control_is_lost(inverter: DriveState, seen: InverterStatus) -> Cause:
    if seen.means(Meaning.WITHHELD):
        return Cause.CONTROL_WITHHELD
    if seen.means(Meaning.TERMINALS):
        return Cause.TERMINALS_IN_CONTROL
    if seen.means(Meaning.KEYPAD):
        return Cause.KEYPAD_IN_CONTROL
    if seen.runs:
        # the current limit, for one, shows instead of who runs it
        return Cause.OTHERS_IN_CONTROL
    return Cause.POWER_CYCLED if inverter.was_silent else Cause.CONTROL_LOST


def explain_fall(
    inverter: DriveState, before: InverterStatus, seen: InverterStatus, least: float
) -> Report | None:
    """
    Return why a motor turns slower than it was told to, if it does so after a silence.

    A drive that keeps its run command without power turns the motor by it when it is back, from
    standstill on. Where the status word shows the same then as before, the frequency alone tells.

    :param before: the status before the silence.
    :param least: Hz, the slowest that the drive can have been told to turn since then.
    """
    was = min(abs(before.frequency), least)
    away = seen.at - before.at
    if inverter.plc_time:
        # the PLC answers all the while, and a drive that is back may catch a motor that coasts
        silent = away >= _LIFE_STOOD + inverter.usually_apart
        most = min(was - _LEAST_FALL, was * _CAUGHT)
    else:
        silent, most = inverter.was_silent and away >= _SHORTEST_POWER_OFF, was / 2
    # where the frequency is not read with the status, nothing falls
    if not (silent and was >= _LEAST_FALL and abs(seen.frequency) < most):
        return None
    return inverter.report(
        Cause.SLOWER_AFTER_SILENCE, before=abs(before.frequency), now=abs(seen.frequency)
    )


#: No drive is off and on again, and answers, within less, s; a single lost answer takes less.
_SHORTEST_POWER_OFF = 0.4
#: A PLC's life counter that stands for so much longer than it is looked at is a silence of the
#: drive, s [C125].
_LIFE_STOOD = 0.2
#: A motor that is caught turns at no more than this share of what it did.
_CAUGHT = 0.95
#: A frequency from which on a fall is looked at, Hz: what is less may be a wobble.
_LEAST_FALL = 0.5
#: What comes and goes is told again only when it was away for so long, s.
_AGAIN_AFTER = 10.0


class Conditions:
    """Tells of alarms, the current limit and sleep of one drive; nothing is stopped by them."""

    def __init__(self, inverter: DriveState) -> None:
        self._inverter = inverter
        #: When each was last there.
        self._seen_at: dict[tuple[Cause, int], float] = {}
        #: An alarm stood when it was last looked at, with a code that is no alarm's.
        self._unnamed = False

    def take(self, seen: InverterStatus) -> None:
        """Tell what has begun."""
        for severity, report in self._reports(seen):
            # each alarm by its code
            name = (report.cause, seen.code if report.cause is Cause.ALARM else 0)
            before = self._seen_at.get(name, -math.inf)
            self._seen_at[name] = seen.at
            if seen.at - before > _AGAIN_AFTER:
                self._inverter.tell(severity, report)
        self._unnamed = seen.kind is Kind.ALARM and not seen.listed.remedy

    def _reports(self, seen: InverterStatus) -> Iterator[tuple[Severity, Report]]:
        by_code = seen.means(Meaning.CURRENT_LIMIT)
        limited = by_code or Fact.LIMIT_ACTIVE in seen.facts
        if limited and not seen.faulted:
            (limit,) = seen.model.codes(Meaning.CURRENT_LIMIT)
            yield Severity.WARNING, self._inverter.report(Cause.CURRENT_LIMITED, limit=limit)
        if seen.kind is Kind.ALARM and not by_code:
            if seen.listed.remedy:
                yield Severity.WARNING, self._inverter.report(Cause.ALARM, alarm=seen.listed)
            elif self._unnamed and not limited:
                # once only, it came or went between the two readings
                yield Severity.WARNING, self._inverter.report(Cause.ALARM_UNNAMED)
        if Fact.SLEEPING in seen.facts:
            yield Severity.INFO, self._inverter.report(Cause.ASLEEP)
