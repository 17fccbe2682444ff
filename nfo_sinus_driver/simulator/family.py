# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The drive families that can be simulated, each by the name of its folder.

``families/<name>/`` has its tables, and ``simulator/<name>/family.py`` what a simulated drive of it
does, as ``FAMILY``. Nobody imports such a folder: :func:`load` finds it by its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
import functools
import importlib
import importlib.util
from typing import Any

from nfo_sinus_driver.catalog import Family, Value, families, load_family
from nfo_sinus_driver.families import USUAL
from nfo_sinus_driver.simulator import modbus
from nfo_sinus_driver.simulator.control_unit import ControlUnit
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.injections import VERBS, Verb
from nfo_sinus_driver.simulator.memory import Memory


@dataclass(frozen=True)
class Option:
    """
    Something of a drive that can be chosen; a switch where it has no choices.

    :ivar name: the keyword argument of the control unit; with dashes, that of the command line.
    """

    name: str
    help: str
    choices: tuple[str, ...] = ()


def _nothing_beside(model: Family) -> Family:
    return model


@dataclass(frozen=True)
class SimulatedFamily:
    """
    What the folder of a family says of itself.

    :ivar control_unit: makes what decides in a drive, of the memory, the address and the options.
    :ivar factory: what leaves the factory otherwise than at the least value, in engineering units.
    :ivar machine: adds to the tables what a drive of this family keeps beside.
    :ivar servers: makes what answers the requests to a drive, by the protocols of the tables.
    :ivar options: what can be chosen of a drive beyond what all have.
    :ivar verbs: what can be made to happen to it, likewise.
    """

    control_unit: Callable[..., ControlUnit]
    factory: Mapping[str, Value] = field(default_factory=dict)
    machine: Callable[[Family], Family] = _nothing_beside
    servers: Mapping[str, Callable[[SimulatedDrive], object]] = field(
        default_factory=lambda: {'modbus': modbus.Server}
    )
    options: tuple[Option, ...] = ()
    verbs: Mapping[str, Verb] = field(default_factory=dict)


def simulated() -> tuple[str, ...]:
    """Return the names of the families that can be simulated."""
    here = __package__
    return tuple(name for name in families() if importlib.util.find_spec(f'{here}.{name}'))


@functools.cache
def load(name: str) -> SimulatedFamily:
    """Return what the folder of a family says; a ValueError lists the families there are."""
    if name not in simulated():
        raise ValueError(f'unknown model {name!r}: choose one of {", ".join(simulated())}')
    family = importlib.import_module(f'{__package__}.{name}.family').FAMILY
    assert isinstance(family, SimulatedFamily)
    return family


@functools.cache
def machine_of(name: str) -> Family:
    """Return the tables of a family with all that a simulated drive of it keeps."""
    return load(name).machine(load_family(name))


def simulated_drive(
    model: str = USUAL,
    address: int = 1,
    *,
    settings: Mapping[str, Value] | None = None,
    run_input: bool = True,
    boot_time: float = 2.0,
    serial_number: str | None = None,
    **options: Any,
) -> SimulatedDrive:
    """
    Return a drive of a family.

    :param address: its address on the line.
    :param settings: parameters other than factory, in engineering units, by key.
    :param options: what can be chosen of this family.
    :raises ValueError: an unknown model, parameter or option, or a value that is not possible.
    """
    family = load(model)
    known = {option.name for option in family.options}
    for option in options:
        if option not in known:
            raise ValueError(f'{model} has no option {option}')
    memory = Memory(machine_of(model), family.factory, settings or {})
    return SimulatedDrive(
        load_family(model),
        family.control_unit(memory, address, **options),
        family.servers,
        run_input=run_input,
        boot_time=boot_time,
        serial_number=serial_number,
    )


def verbs_of(name: str) -> Mapping[str, Verb]:
    """Return what can be made to happen to the drives of a family, and to their line."""
    return {**VERBS, **load(name).verbs}


def every_verb() -> Mapping[str, Verb]:
    """Return what can be made to happen to a drive of any family."""
    found: dict[str, Verb] = {}
    for name in simulated():
        for verb, what in verbs_of(name).items():
            found[verb] = found[verb].joined(what) if verb in found else what
    return found


def every_option() -> Mapping[str, Option]:
    """Return what can be chosen of a drive of any family, by name."""
    return {option.name: option for name in simulated() for option in load(name).options}
