# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The drive families that can be simulated, each by the name of its folder.

``families/<name>/`` has its tables, and ``simulator/<name>/family.py`` what a simulated drive of it
does, as ``FAMILY``. No file imports such a folder: :func:`load` finds it by its name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
import functools
import importlib
import importlib.util
import operator

from nfo_sinus_driver.catalog import Family, Value, families, is_described, load_family
from nfo_sinus_driver.families import USUAL
from nfo_sinus_driver.simulator import modbus
from nfo_sinus_driver.simulator.control_unit import ControlUnit, Option, Variant
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.injections import INJECTIONS, Injection
from nfo_sinus_driver.simulator.memory import Memory


@dataclass(frozen=True)
class SimulatedFamily:
    """
    What the folder of a family says of itself.

    :ivar control_unit: makes what decides in a drive, of the memory, the address and the variant.
    :ivar variant: what can be chosen of a drive.
    :ivar factory: what leaves the factory otherwise than at the least value, in engineering units.
    :ivar machine: adds to the tables what a drive of this family keeps beside.
    :ivar servers: makes what answers the requests to a drive, by the protocols of the tables.
    :ivar injections: what else can be made to happen to it.
    :ivar line: how its line leaves the factory, where that is not as usual of its protocol.
    """

    control_unit: Callable[..., ControlUnit]
    variant: type[Variant] = Variant
    factory: Mapping[str, Value] = field(default_factory=dict)
    machine: Callable[[Family], Family] = lambda model: model
    servers: Mapping[str, Callable[[SimulatedDrive], object]] = field(
        default_factory=lambda: {'modbus': modbus.Server}
    )
    injections: Mapping[str, Injection] = field(default_factory=dict)
    line: Mapping[str, int | str] = field(default_factory=dict)


def simulated() -> tuple[str, ...]:
    """Return the names of the families that can be simulated."""
    here = __package__
    return tuple(name for name in families() if importlib.util.find_spec(f'{here}.{name}'))


@functools.cache
def load(name: str) -> SimulatedFamily:
    """Return what the folder of a family says; a ValueError lists the families there are."""
    if is_described(name):
        family = importlib.import_module(f'{__package__}._declared.family').family_of(name)
    elif name in simulated():
        family = importlib.import_module(f'{__package__}.{name}.family').FAMILY
    else:
        raise ValueError(f'unknown model {name!r}: choose one of {", ".join(simulated())}')
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
    **options: str | None,
) -> SimulatedDrive:
    """
    Return a drive of a family.

    :param address: its address on the line.
    :param settings: parameters other than factory, in engineering units, by key.
    :param options: what can be chosen of this family; ``None``: the usual.
    :raises ValueError: an unknown model, parameter or option, or a value that is not possible.
    """
    family = load(model)
    known = {option.name for option in family.variant.options()}
    for option in options:
        if option not in known:
            raise ValueError(f'{model} has no option {option}')
    chosen = {name: value for name, value in options.items() if value is not None}
    memory = Memory(machine_of(model), family.factory, settings or {})
    return SimulatedDrive(
        load_family(model),
        family.control_unit(memory, address, family.variant(**chosen)),
        family.servers,
        run_input=run_input,
        boot_time=boot_time,
        serial_number=serial_number,
    )


def _kinds() -> Sequence[SimulatedFamily]:
    """Return all families, and what those have in common that files describe."""
    described = importlib.import_module(f'{__package__}._declared.family').ANY
    return [*map(load, simulated()), described]


def every_injection() -> Mapping[str, Injection]:
    """Return what can be made to happen to a drive of any family."""
    return functools.reduce(operator.or_, (kind.injections for kind in _kinds()), INJECTIONS)


def every_option() -> Collection[Option]:
    """Return what can be chosen of a drive of any family, as the first that has it shows it."""
    found: dict[str, Option] = {}
    for family in _kinds():
        for option in family.variant.options():
            found.setdefault(option.name, option)
    return found.values()
