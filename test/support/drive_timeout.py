# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Drives that stop by their own time-out, as the default of the driver sets it."""

from __future__ import annotations

from typing import Any

from nfo_sinus_driver.catalog import Role, load_family
from nfo_sinus_driver.drive.known.settings import AS_THE_DRIVE_CAN
from support.rig import CONNECTIONS, Rig
from support.variants import stopping_at_timeout

#: Where the drive has a time-out of its own that is counted in frames of the driver.
TIMED = [
    name for name, connection in CONNECTIONS.items()
    if connection.protocol not in ('telegram1', 'canopen')
    and connection.model not in ('sinus_optimal', 'acme')
]


def by_default(connection: str, found: float | None = None, **more: Any) -> Rig:
    """Return a rig with the default of ``drive_timeout``, and a drive that may stop by itself."""
    model, method = CONNECTIONS[connection].model, CONNECTIONS[connection].method
    parameters = {**stopping_at_timeout(model, method), **more.pop('parameters', {})}
    if found is not None:
        parameters[load_family(model, method).key(Role.COMMUNICATION_TIMEOUT)] = found
    return Rig(connection, parameters=parameters, drive_timeout=AS_THE_DRIVE_CAN, **more)


def drive_timeout(rig: Rig) -> float:
    """Return the time-out that stands in the drive, s."""
    key = rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT)
    return float(rig.far.memory.number(key))
