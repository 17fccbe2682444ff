# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Tuning: the drive measures its motor, or calculates what it should be [M0 table 18]."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import MOTOR_PLATE, InverterStatus, Meaning, Procedure, Role
from nfo_sinus_driver.drive.change.parameters import Parameters
from nfo_sinus_driver.drive.known import drive_state
from nfo_sinus_driver.drive.known.changes import ParameterChange
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.exclusive_access import ExclusiveAccess
from nfo_sinus_driver.drive.motion.procedure import Procedures
from nfo_sinus_driver.drive.motion.starting import Prepare

#: How often the status is read; the polls go on beside it, s.
_LOOK_PERIOD = 0.05
#: How often progress is reported while nothing changes, s.
_REPORT_PERIOD = 0.5
#: Longer than any tuning takes; a drive that is still at it then is stopped, s.
_LONGEST = 900.0
#: In standby the status does not show how it ended: a lost RUN input leads there, too, and a short
#: procedure may be over before the first reading. What was measured decides.
_UNDECIDED = (Cause.TUNING_WITHOUT_RESULT, Cause.TUNING_DOES_NOT_BEGIN)

#: Called on the bus with the status and the time elapsed, s.
Progress = Callable[[InverterStatus, float], None]


@dataclass(frozen=True)
class Tuned:
    """
    How a procedure ended.

    :ivar success: the drive reports that it has finished.
    :ivar how: what the drive reports, or what went wrong.
    :ivar changes: the parameters that have changed, whether it has finished or not.
    """

    success: bool
    how: Report
    changes: tuple[ParameterChange, ...]

    @property
    def report(self) -> Report:
        """How it ended, with the changes."""
        if not self.success and not self.changes:
            return self.how
        return Report(Cause.TUNING_CHANGED, how=self.how, changes=self.changes)


class Tuning:
    """
    Tunes one drive; used on the bus alone.

    :param prepare: runs before the motor is energised.
    """

    def __init__(
        self,
        state: DriveState,
        parameters: Parameters,
        procedures: Procedures,
        prepare: Prepare,
    ) -> None:
        self._state = state
        self._parameters = parameters
        self._procedures = procedures
        self._prepare = prepare

    async def tune_now(self, procedure: Procedure, progress: Progress) -> Tuned:
        """
        Have the drive tune, wait for the end, and read what it changed.

        The motor is energised and may turn, whatever the set-point is.

        :param progress: called whenever the inverter status changes, and twice a second.
        :raises DriveError: it was not begun, and why; or its end is unknown.
        """
        what = procedure.value
        # from here on a stop ends the tuning, too
        with self._procedures.begun(procedure) as access:
            await self._require_motor_plate(what)
            if not self._state.nameplate.is_older:
                # older firmware takes settings under bus control alone, which only an enable has
                await self._prepare()
            motor = self._state.model.group_of(Role.NOMINAL_POWER)
            keys = [key for key in self._parameters.available() if key in motor]
            async with self._parameters.left_to_the_drive(keys) as changes:
                ended = Report(Cause.PROCEDURE_ENDED, what=what)
                async with self._procedures.in_standby(access, ended):
                    self._state.notify(Severity.INFO, Cause.TUNING_BEGINS, what=what)
                    await self._procedures.command(access, procedure)
                    how = await self._outcome(procedure, access, progress)
                changed = await changes()
                if changed and how.cause in _UNDECIDED:
                    how = self._state.report(Cause.TUNED, what=what)
                result = Tuned(how.cause is Cause.TUNED, how, changed)
        self._state.notify(Severity.INFO if result.success else Severity.ERROR, result.report)
        return result

    async def _require_motor_plate(self, what: str) -> None:
        for role in MOTOR_PLATE:
            key = self._state.model.key(role)
            if not await self._state.params.read_number(key, Priority.SERVICE) > 0:
                raise DriveError(Cause.TUNING_NEEDS, what=what, key=key)

    async def _outcome(
        self, procedure: Procedure, access: ExclusiveAccess, progress: Progress
    ) -> Report:
        state, what = self._state, procedure.value
        started = state.bus.now()
        begun = False
        reported_code, reported_at = -1, 0.0
        faulted_at = math.inf
        while True:
            status = await state.reader.read(Priority.POLL)
            elapsed = state.bus.now() - started
            if status.code != reported_code or elapsed > reported_at + _REPORT_PERIOD:
                reported_code, reported_at = status.code, elapsed
                progress(status, elapsed)
            if status.faulted:
                faulted_at = min(faulted_at, elapsed)
                if status.means(Meaning.UNNAMED) and elapsed < faulted_at + drive_state.TIMEOUT:
                    # a PLC tells the name later
                    await state.bus.sleep(_LOOK_PERIOD)
                    continue
                return state.report(Cause.TUNING_FAILED, what=what, fault=status.listed)
            if status.means(Meaning.TUNED):
                return state.report(Cause.TUNED, what=what)
            if status.means(Meaning.TUNING):
                begun = True
            elif access.aborted:
                return state.report(Cause.TUNING_STOPPED, what=what)
            elif begun and status.standby:
                # it "returns to 'SioStby' when ready" [M0 table 18], and may show no code [C112]
                calculated = procedure is Procedure.CALCULATE
                done = Cause.TUNED if calculated else Cause.TUNING_WITHOUT_RESULT
                return state.report(done, what=what)
            elif begun:
                return state.report(Cause.TUNING_CUT_SHORT, what=what)
            elif elapsed > drive_state.TIMEOUT:
                return state.report(Cause.TUNING_DOES_NOT_BEGIN, what=what)
            if elapsed > _LONGEST:
                raise DriveError(state.report(Cause.TUNING_ENDLESS, what=what))
            await self._state.bus.sleep(_LOOK_PERIOD)
