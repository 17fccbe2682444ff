# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Who a MOVITRAC 31 says it is: inverter type, output stage and software [M4 §4]."""

from __future__ import annotations

import re

from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import NotPossible, Product, Read, Refusal, Steps

#: What other drives of this protocol have, too, with another value.
TYPE = 'status.inverter_type'
_OUTPUT_STAGE = 'status.output_stage'
_SOFTWARE = 'special.software_system'
_FIELDBUS = 'special.eprom_fieldbus'
#: Index 271: this family; and what speaks the same protocol, with other parameters.
_OURS = 'MOVITRAC 31..'
_OTHERS = ('MOVITRAC 3000', 'MOVIDYN 5000')
_VENDOR = 'SEW-EURODRIVE'
#: P810 without the 8 in front: 21123411 is 821 123 4.11, a digit A is an X.
_PART_NUMBER = re.compile('([0-9]{2})([0-9]{3})([0-9A])([0-9]{2})')


def read_if_there(key: str) -> Steps[Value | None]:
    """Read a parameter; ``None`` from a drive that does not have it."""
    try:
        value: Value = yield Read(key)
    except Refusal:
        return None
    return value


def read_product() -> Steps[Product]:
    """
    Read type (index 271), output stage (index 306) and software (P810).

    :raises NotPossible: it is a drive of another type.
    """
    type_ = yield from read_if_there(TYPE)
    if type_ in _OTHERS:
        raise NotPossible(
            f'this drive identifies itself as a {type_} (index 271), whose parameters are '
            f'others: model movitrac31 is for a {_OURS}'
        )
    size = yield from read_if_there(_OUTPUT_STAGE)
    software = yield from read_if_there(_SOFTWARE)
    number = ''
    if software is not None:
        number = part_number(int(software)) or f'P810 {int(software):08X}h'
    if type_ is None:
        return Product(software=number)
    listed = type_ == _OURS
    model = _model(size) if listed else f'drive of inverter type {type_}'
    return Product(_VENDOR, model, number, listed)


def _model(size: Value | None) -> str:
    """Return product and size, such as ``MOVITRAC 31C015-503-4-00``."""
    if size is None:
        return _OURS
    listed = str(size).startswith('31C')
    return f'MOVITRAC {size}' if listed else f'{_OURS} (output stage {size})'


def part_number(word: int) -> str:
    """Return the part number of a software, such as 821 123 4.11; ``''`` if it is none."""
    found = _PART_NUMBER.fullmatch(f'{word:08X}')
    if found is None:
        return ''
    first, second, major, minor = found.groups()
    return f"8{first} {second} {major.replace('A', 'X')}.{minor}"


#: P810 and P812.
SPELLED = {_SOFTWARE: part_number, _FIELDBUS: part_number}
#: What its display shows in bits or in hexadecimal, and what it keeps of such words with a fault.
BIT_FIELDS = frozenset(
    (
        'fieldbus.function_bits',
        'status.terminals',
        'status.options',
        'status.manual_control_word',
        *(f'status.po{number}_setpoint' for number in (1, 2, 3)),
        *(f'status.pi{number}_actual_value' for number in (1, 2, 3)),
        *(f'status.fault_t{age}_inverter_status' for age in range(5)),
        *(f'status.fault_t{age}_terminal_status' for age in range(5)),
    )
)
