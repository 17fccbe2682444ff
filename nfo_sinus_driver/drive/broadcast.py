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

"""What is said to every drive on a Classic line at once [M0 §6.1.4]; a stop for all of them."""

from __future__ import annotations

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.link import Address


async def broadcast_stop(bus: Bus) -> None:
    """
    Write MODE = Stop to all drives of a Classic line; nobody confirms it.

    It works even on drives with a serial fault ([M0 §6.1.5], [C9]).

    :raises LinkError: the port is lost.
    """
    everybody = bus.protocol.broadcast
    assert everybody is not None, 'the protocol has a broadcast'
    g2 = load_family('sinus_g2')
    mode = g2[g2.key(Role.CONTROL_SOURCE)].at(bus.protocol.addressing)
    data = mode.number.encode(Mode.STOP)
    await bus.write(everybody, Address(*mode.place), data, Priority.STOP)
