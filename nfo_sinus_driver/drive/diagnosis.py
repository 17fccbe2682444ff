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

"""What a failed transaction or a status means."""

from __future__ import annotations

from nfo_sinus_driver.catalog import Fact
from nfo_sinus_driver.catalog import Meaning
from nfo_sinus_driver.catalog import State
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.link import GatewaySilent
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import NoAnswer
from nfo_sinus_driver.link import NoPath
from nfo_sinus_driver.link import PortError
from nfo_sinus_driver.link import Refused


def explain(error: LinkError, address: int, *, check: str | None = None) -> Report:
    """
    Return what a failed transaction means.

    :param check: what to look at while the drive has never answered; ``None``: it has, so that its
        settings are right [C93].
    """
    if isinstance(error, (PortError, Refused, GatewaySilent, NoPath)):
        return Report(Cause.LINE_FAILED, error=str(error))
    if check is None:
        return Report(Cause.NOT_REACHED, error=str(error))
    if isinstance(error, NoAnswer):
        return Report(Cause.NO_RESPONSE, address=address, check=check)
    return Report(Cause.NO_VALID_ANSWER, address=address, error=str(error))


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
    """
    See to it that no fault is active before the motor is energised.

    :raises DriveError: one is.
    """
    if seen.faulted:
        raise DriveError(inverter.report(Cause.FAULT_FORBIDS, fault=seen.listed))


def explain_stop(
    inverter: DriveState, seen: InverterStatus, control_mode: str
) -> Report | None:
    """
    Return why the motor no longer follows us, before it is enabled again.

    :param control_mode: the one in which it was enabled.
    :returns: ``None`` if it does follow.
    """
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
    if seen.means(Meaning.TERMINALS):
        return Cause.TERMINALS_IN_CONTROL
    if seen.means(Meaning.KEYPAD):
        return Cause.KEYPAD_IN_CONTROL
    if seen.runs:
        # the current limit, for one, shows instead of who runs it
        return Cause.OTHERS_IN_CONTROL
    return Cause.POWER_CYCLED if inverter.was_silent else Cause.CONTROL_LOST
