# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameters that a user names, where the manual says how they are reached and not which there are.

Each is a text: ``NAME=ADDRESS``, then what is not as usual: ``:FACTOR``, the value of one count
(1), ``:UNIT`` and ``:rw``, for one that may be written: ``drv.acc_time=1103h:0.1:s:rw``.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
import re

from nfo_sinus_driver.catalog.codec import codec_of
from nfo_sinus_driver.catalog.parameter import NO_SETTINGS, Access, Address, Parameter

_TEXT = re.compile(
    r'(?P<key>(?P<group>[a-z]\w*)\.[a-z]\w*)=(?P<address>[0-9a-fA-F]+h|\d+)'
    r'(:(?P<factor>\d+(\.\d+)?)?(:(?P<unit>[^:]*)(:(?P<access>rw))?)?)?',
    re.ASCII,
)
_FORM = 'write group.name=ADDRESS:FACTOR:UNIT:rw, such as drv.acc_time=1103h:0.1:s:rw'
_WORD = 'uint16_be'
_HIGHEST = 0xFFFF


@dataclass(frozen=True)
class OwnAddresses:
    """
    Parameters that the manual lets a user reach by addresses, without saying which there are.

    :ivar space: the numbering of these addresses.
    :ivar commands: those by which the drive is commanded: they are not reached so.
    :ivar source: where the manual says so.
    """

    space: str
    commands: frozenset[int]
    source: str


def own_parameter(text: str, addressing: str, places: OwnAddresses) -> Parameter:
    """
    Return the parameter that a text names.

    :param addressing: how it is reached.
    :param places: what the manual says of such addresses.
    :raises ValueError: the text says none.
    """
    found = _TEXT.fullmatch(text)
    if found is None:
        raise ValueError(f'{text!r}: {_FORM}')
    number = found['address']
    index = int(number[:-1], 16) if number.endswith('h') else int(number)
    group = found['group'].title()
    if index > _HIGHEST or index in places.commands or group in NO_SETTINGS:
        raise ValueError(f'{text!r}: not this address, or not this group')
    factor = Fraction(found['factor'] or 1)
    if not factor:
        raise ValueError(f'{text!r}: the factor is not 0')
    address = Address(
        addressing, places.space, index, None, codec_of(_WORD), factor, places.source
    )
    decimals = len((found['factor'] or '').partition('.')[2])
    return Parameter(
        key=found['key'],
        name=f'{index:04X}h',
        group=group,
        addresses={addressing: address},
        access=Access.READ_WRITE if found['access'] else Access.READ,
        unit=found['unit'] or '',
        decimals=decimals,
        description='As named in drive_addresses',
        source=places.source,
    )
