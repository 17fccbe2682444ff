# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A stop for all drives of a line at once, over Classic; no drive confirms it."""

from __future__ import annotations

from collections.abc import Iterable

from nfo_sinus_driver.bus import Bus, Priority
from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.link import Address


async def broadcast_stop(bus: Bus, models: Iterable[Family]) -> None:
    """Release the motors of all drives of a line with a broadcast."""
    everyone = bus.protocol.broadcast
    assert everyone is not None, 'the protocol has a broadcast'
    addressing = bus.protocol.addressing
    for model in dict.fromkeys(models):
        stop = model.profile.broadcast_stop
        if stop is not None:
            parameter = model[stop.key]
            address = Address(*parameter.at(addressing).place)
            data = parameter.encode(stop.value, addressing)
            await bus.write(everyone, address, data, Priority.STOP)
