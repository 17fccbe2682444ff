# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Which model answers at an address."""

from __future__ import annotations

from concurrent.futures import Future

from nfo_sinus_driver.bus import Bus, Priority
from nfo_sinus_driver.catalog import Family, families, load_family
from nfo_sinus_driver.drive.known.diagnosis import explained
from nfo_sinus_driver.drive.known.events import Cause, DriveError
from nfo_sinus_driver.link import Address, Identification, Read, Refused


def detect_model(bus: Bus, unit: int) -> Future[str]:
    """
    Find out which model a drive is; from any thread.

    It is the only one with the protocol of the line, or the one that identifies itself, or the one
    with a parameter that no other has, or the only one left.

    :raises DriveError: it does not answer, or several are left; the message says what to do.
    """
    return bus.run(_detect(bus, unit), lambda error: explained(error, unit, bus.protocol.check))


async def _detect(bus: Bus, unit: int) -> str:
    addressing = bus.protocol.addressing
    models = [model for model in map(load_family, families()) if _speaks(model, addressing)]
    if len(models) > 1 and await bus.identify(unit, Priority.SERVICE) != Identification():
        models = [model for model in models if model.profile.names_itself]
    for model in models if len(models) > 1 else ():
        if not model.profile.identified_by:
            continue
        if await _has(bus, unit, model, model.profile.identified_by):
            return model.name
        models = [other for other in models if other is not model]
    if len(models) == 1:
        return models[0].name
    names = ' or '.join(model.name for model in models)
    raise DriveError(Cause.SEVERAL_MODELS, address=unit, models=names)


def _speaks(model: Family, protocol: str) -> bool:
    return any(protocol in parameter.addresses for parameter in model.values())


async def _has(bus: Bus, unit: int, model: Family, key: str) -> bool:
    address = Address(*model[key].at(bus.protocol.addressing).place)
    try:
        await bus.ask(unit, Read(address), Priority.SERVICE)
    except Refused:
        return False
    return True
