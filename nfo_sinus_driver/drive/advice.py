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

"""What a failed transaction means to a person, and what to check."""

from __future__ import annotations

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
