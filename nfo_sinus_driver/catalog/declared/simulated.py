# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a file says for the simulated drive alone: it answers others than this driver, too."""

from __future__ import annotations

from collections.abc import Iterator

from nfo_sinus_driver.catalog.declared.description import Copied, Shown, Simulated
from nfo_sinus_driver.catalog.declared.register_map import RegisterMap, internal, place_of
from nfo_sinus_driver.catalog.declared.settings import Settings
from nfo_sinus_driver.catalog.declared.yaml_file import Node, Problems
from nfo_sinus_driver.catalog.parameter import Access
from nfo_sinus_driver.catalog.status import Role

#: In place of a measured value: the set-point.
_SETPOINT = 'setpoint'
#: What an entry says of its register, one of them.
_SAYS = ('shows', 'copies', 'value')


def read_simulated(
    node: Node, register_map: RegisterMap, settings: Settings, problems: Problems
) -> Simulated:
    """Return what the section says; what is wrong goes to the problems."""
    reverse = node.get('reverse')
    turned = None
    if 'register' in reverse:
        turned = register_map.register(reverse['register']), 1 << reverse.integer('bit')
    return Simulated(
        accel=settings.known(node.get('accel')),
        decel=settings.known(node.get('decel')),
        loopback=node.flag('loopback'),
        reverse=turned,
        registers=_copied_once(
            dict(_registers(node.get('registers'), register_map, settings, problems)),
            node, problems,
        ),
    )


def _copied_once(
    registers: dict[int, int | Shown | Copied], node: Node, problems: Problems
) -> dict[int, int | Shown | Copied]:
    """Return the registers, where none copies one that copies."""
    for found in registers.values():
        if isinstance(found, Copied) and isinstance(registers.get(found.register), Copied):
            problems.add(node.line, 'what is simulated copies a register that is a copy, too')
    return registers


def _registers(
    node: Node, register_map: RegisterMap, settings: Settings, problems: Problems
) -> Iterator[tuple[int, int | Shown | Copied]]:
    for entry in node.items:
        what = place_of(entry, 'what is simulated')
        address = register_map.address(entry, what)
        if sum(says in entry for says in _SAYS) != 1:
            problems.add(entry.line, f'{what} says one of {", ".join(_SAYS)}')
        elif 'value' in entry:
            yield address.index, entry.integer('value')
        elif 'copies' in entry:
            source = register_map.register(entry['copies'])
            has_bit = 'bit' in entry
            shift = entry.integer('bit') if has_bit else 0
            yield address.index, Copied(source, shift, 1 if has_bit else 0xFFFF)
        else:
            name = entry.text('shows')
            parameter = internal(f'simulated.{name}', what, address, Access.READ)
            quantity = None if name == _SETPOINT else Role(name)
            yield address.index, Shown(settings.scaled(entry, parameter), quantity)
