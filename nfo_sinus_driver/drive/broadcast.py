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

from collections.abc import Iterable

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.link import Address


async def broadcast_stop(bus: Bus, models: Iterable[Family]) -> None:
    """
    Release the motors of all drives of a line that has a broadcast; nobody confirms it.

    :param models: those that are on the line.
    :raises LinkError: the port is lost.
    """
    everybody = bus.protocol.broadcast
    assert everybody is not None, 'the protocol has a broadcast'
    addressing = bus.protocol.addressing
    for model in dict.fromkeys(models):
        stop = model.profile.broadcast_stop
        if stop is not None:
            parameter = model[stop.key]
            address = Address(*parameter.at(addressing).place)
            data = parameter.encode(stop.value, addressing)
            await bus.write(everybody, address, data, Priority.STOP)
