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

"""What a failed transaction or a status means to a person, and what to check."""

from __future__ import annotations

from nfo_sinus_driver.catalog import Fact
from nfo_sinus_driver.catalog import Meaning
from nfo_sinus_driver.catalog import State
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.inverter import Inverter
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.link import GatewaySilent
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import NoAnswer
from nfo_sinus_driver.link import NoPath
from nfo_sinus_driver.link import PortError
from nfo_sinus_driver.link import Refused

_SILENCE_ADVICE = (
    'check in this order: BusType in the drive (NFO, which is classic, is the factory setting; '
    'MbusRtu or MbusAsc for Modbus), jumper S5 (RS232 or RS485), the address, baud rate and parity'
)
#: Why a drive does not start that seems to be told to.
NO_RUN_INPUT = (
    'the drive stays in standby: its RUN input is not active '
    '(DIN1; strap it to +24 V or close its safety contact)'
)


def explain(error: LinkError, address: int, *, known: bool) -> str:
    """
    Return what a failed transaction means.

    :param known: the drive has answered before, so that its settings are right [C93].
    """
    if isinstance(error, (PortError, Refused, GatewaySilent, NoPath)):
        return str(error)
    if known:
        return f'{error}: check the cable and that the drive has power'
    if isinstance(error, NoAnswer):
        return f'nobody answers at address {address}: {_SILENCE_ADVICE}'
    return (
        f'what comes from address {address} is no answer ({error}): check baud rate '
        'and parity, that no other master is on the line, and the wiring'
    )


def explain_fault(inverter: Inverter, seen: InverterStatus) -> str:
    """Return which fault stands, what it means and what to do about its cause."""
    fault = seen.listed
    return f'fault {inverter.describe()}: {fault.description}. {fault.remedy}'


def require_no_fault(inverter: Inverter, seen: InverterStatus) -> None:
    """
    See to it that no fault stands, before the motor gets current.

    :raises DriveError: one does.
    """
    if seen.faulted:
        fault = seen.listed
        raise DriveError(
            f'fault {inverter.describe()} stands: {fault.description}. {fault.remedy}; '
            'then call ~/fault_ack'
        )


def explain_stop(inverter: Inverter, seen: InverterStatus, control_mode: str) -> str:
    """
    Return why the motor no longer follows us and what to do, before it is enabled again.

    :param control_mode: the one in which it was enabled.
    :returns: ``''`` if it does follow.
    """
    told = inverter.describe()
    if inverter.control_mode != control_mode:
        return (
            f'the control mode was changed to {inverter.control_mode or "?"} at the drive, and '
            f'set-points are in {inverter.unit or "another unit"} now: check what sends them'
        )
    if seen.faulted:
        return explain_fault(inverter, seen)
    if seen.state is State.NOT_READY_TO_SWITCH_ON:
        return f'the drive is starting ({told}): it was switched off and on; check its mains'
    if not seen.from_bus:
        return _explain_loss_of_control(inverter, seen)
    if Fact.RUN_INPUT_MISSING in seen.facts:
        return f'the RUN input (DIN1) of the drive was lost ({told}): close it'
    if not seen.runs:
        return (
            f'the drive stopped by itself ({told}). Either its RUN input (DIN1) was lost or '
            'another master stopped it: close the input'
        )
    return ''


def explain_loss(inverter: Inverter) -> str:
    """Return what became of a drive that was lost under our control and is back without it."""
    return (
        f'the bus has lost control meanwhile ({inverter.describe()}). The drive was switched off '
        'and on, or somebody used its keypad: check its mains; then call ~/enable to go on'
    )


def _explain_loss_of_control(inverter: Inverter, seen: InverterStatus) -> str:
    told = inverter.describe()
    if seen.means(Meaning.TERMINALS):
        return f'the terminals have control now ({told}): press STOP at the drive'
    if seen.means(Meaning.KEYPAD):
        return f'the keypad has control now and runs the motor ({told}): press STOP there'
    if seen.runs:
        # the current limit, for one, shows instead of who runs it
        return f'keypad or terminals have control now and run the motor ({told}): press STOP there'
    if inverter.was_silent:
        return (
            f'the drive did not answer for a moment, and the bus has lost control ({told}). It was '
            'switched off and on: check its mains'
        )
    return (
        f'the bus has lost control ({told}). Somebody pressed STOP at the keypad, or another '
        'master took it away: find out who'
    )
