# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The factory settings of line and drive that a family describes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from nfo_sinus_driver.catalog import load_profile, with_factory_line
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link import PROTOCOLS, BusSettings
from nfo_sinus_driver.setting import Setting

_LINE = ('protocol', 'baud_rate', 'char_format')


def line_of(families: Mapping[str, object], given: Mapping[str, object]) -> dict[str, Any]:
    """
    Return protocol, speed and format of a line: as given, else the factory settings of its drives.

    Empty where no drive has a ``family``: then the protocol decides.

    :param families: the ``family`` of each drive as given, by its name.
    :param given: the settings of the line as given.
    :raises ValueError: there is no such family, or the drives differ in what is not given.
    """
    if not any(families.values()):
        return {}
    found = {name: given.get(name) for name in _LINE}
    for name in _LINE:
        if not found[name]:
            found[name] = _alike(name, {
                drive: _of_drive(drive, family, found)[name] for drive, family in families.items()
            })
    return found


def with_factory_address(settings: Mapping[str, Setting], family: object) -> Mapping[str, Setting]:
    """Return the settings of a drive, with the default address that its family has."""
    address = _factory(family).get('address')
    if address is None:
        return settings
    return {**settings, 'address': replace(settings['address'], default=address)}


def _of_drive(drive: str, family: object, given: Mapping[str, object]) -> Mapping[str, Any]:
    try:
        line = with_factory_line(given, _factory(family))
    except ValueError as error:
        raise ValueError(f'{drive}: {error}') from error
    protocol = line.get('protocol', BusSettings.protocol)
    usual = PROTOCOLS.get(protocol, PROTOCOLS[BusSettings.protocol])
    return {
        'protocol': protocol, 'baud_rate': usual.baud_rate, 'char_format': usual.char_format,
        **line,
    }


def _factory(family: object) -> Mapping[str, Any]:
    if not family or not isinstance(family, str):
        return {}
    return load_profile(DriveSettings(family=family).model).line


def _alike(name: str, of_drives: Mapping[str, Any]) -> Any:
    """Return what all drives have (ValueError: they differ)."""
    first, *others = dict.fromkeys(of_drives.values())
    if others:
        differ = ', '.join(f'{value} of {drive}' for drive, value in of_drives.items())
        raise ValueError(
            f'{name}: the drives of this line leave the factory with different ones ({differ}): '
            f'set them alike, and say {name} at nfo_sinus_bus'
        )
    return first
