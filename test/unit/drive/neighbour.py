# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Another drive of a line, as far as the line is concerned."""

from __future__ import annotations

import contextlib

from nfo_sinus_driver.bus import Bus, Priority
from nfo_sinus_driver.link import Address, LinkError, Read


async def neighbour(bus: Bus, address: Address, priority: Priority = Priority.POLL) -> None:
    """Read something again and again, with this urgency; never ends by itself."""
    while True:
        with contextlib.suppress(LinkError):
            await bus.ask(1, Read(address), priority)
