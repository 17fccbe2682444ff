# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Makes a simulated drive of a file that describes it."""

from __future__ import annotations

from dataclasses import replace
import functools
from pathlib import Path

from nfo_sinus_driver.catalog.declared import read
from nfo_sinus_driver.simulator._declared.control_unit import (
    DeclaredControlUnit,
    DeclaredVariant,
)
from nfo_sinus_driver.simulator._declared.server import Server
from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.injections import SWITCH, Injection, assign

_INJECTIONS = {
    'local': Injection('let keypad or terminals take control, or give it back',
        lambda at, given: assign(at.unit, local=given.state == 'on'), SWITCH)
}

#: What all of them have in common.
ANY = SimulatedFamily(
    control_unit=DeclaredControlUnit, variant=DeclaredVariant, injections=_INJECTIONS
)


def family_of(path: str) -> SimulatedFamily:
    """
    Return the family that a file describes.

    :raises CatalogError: the file is none, or wrong.
    """
    file = read(Path(path))
    return replace(
        ANY,
        control_unit=functools.partial(DeclaredControlUnit, drive=file),
        factory=file.defaults,
        servers={'modbus': functools.partial(Server, file=file)},
        line=file.line.factory,
    )
