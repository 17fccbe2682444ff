# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A stop for all drives of a line at once, over Classic; no drive confirms it."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Future

from nfo_sinus_driver.bus import Bus, Priority
from nfo_sinus_driver.drive.drive import Drive
from nfo_sinus_driver.drive.known.diagnosis import ended
from nfo_sinus_driver.drive.known.events import Cause, DriveError
from nfo_sinus_driver.link import Address, Write


def broadcast_stop(bus: Bus, drives: Iterable[Drive]) -> Future[None]:
    """
    Release the motors of all drives of a line with a broadcast; from any thread.

    :param drives: those of the line; only what stops a family counts of which one was recognised
        since the port was opened.
    :raises DriveError: none was, and nothing is written; or the driver ends.
    :raises LinkError: it was not sent.
    """
    return bus.run(_broadcast(bus, drives), ended, stops=True)


async def _broadcast(bus: Bus, drives: Iterable[Drive]) -> None:
    models = [drive.model for drive in drives if drive.state.contact.since_port_opened]
    if not models:
        raise DriveError(Cause.NONE_RECOGNISED)
    everyone = bus.protocol.broadcast
    assert everyone is not None, 'the protocol has a broadcast'
    addressing = bus.protocol.addressing
    for model in dict.fromkeys(models):
        stop = model.profile.broadcast_stop
        if stop is not None:
            parameter = model[stop.key]
            address = Address(*parameter.at(addressing).place)
            data = parameter.encode(stop.value, addressing)
            await bus.ask(everyone, Write(address, data), Priority.STOP)
