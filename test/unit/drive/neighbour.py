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

"""Another drive of a line, as far as the line is concerned."""

from __future__ import annotations

import contextlib

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.link import Address
from nfo_sinus_driver.link import LinkError


async def neighbour(bus: Bus, address: Address) -> None:
    """Read something again and again, with the urgency of a poll; never ends by itself."""
    while True:
        with contextlib.suppress(LinkError):
            await bus.read(1, address, Priority.POLL)
