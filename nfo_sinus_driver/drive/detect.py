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

"""Which model answers at an address."""

from __future__ import annotations

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Cancelled
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.drive.advice import explain
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.link import Address
from nfo_sinus_driver.link import Identification
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import Refused


async def detect_model(bus: Bus, unit: int) -> str:
    """
    Find out which model a drive is, for coroutines on the bus.

    Only the G2 speaks Classic, tells who it is by functions 43 and 17, and has SWVer [C57].

    :raises DriveError: it does not answer; the message says what to check.
    """
    if not bus.protocol.identifies:
        return 'sinus_g2'
    g2 = load_family('sinus_g2')
    firmware = g2[g2.key(Role.FIRMWARE)].at(bus.protocol.addressing)
    try:
        if await bus.identify(unit, Priority.SERVICE) != Identification():
            return 'sinus_g2'
        await bus.read(unit, Address(*firmware.place), Priority.SERVICE)
    except Refused:
        return 'sinus_optimal'
    except Cancelled:
        raise DriveError('the driver is ending') from None
    except LinkError as error:
        raise DriveError(explain(error, unit, known=False)) from error
    return 'sinus_g2'
