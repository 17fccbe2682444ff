# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the PROFINET module of a Sinus H says of itself, in words: PNU 964 [M3 §8]."""

from __future__ import annotations

import calendar
from collections.abc import Callable, Mapping

from nfo_sinus_driver.catalog.parameter import Value

_PROFINET = 1


def _device(type_: Value) -> str:
    return 'PROFINET module' if type_ == _PROFINET else f'device type {type_}'


def _version(number: Value) -> str:
    """Return 102 as 1.2."""
    whole, part = divmod(int(number), 100)
    return f'version {whole}.{part}'


def _day(number: Value) -> str:
    """Return 2512 as 25 December; what is no day as its number."""
    day, month = divmod(int(number), 100)
    return f'of {day} {calendar.month_name[month]}' if 1 <= month <= 12 else f'of {number}'


#: By the parameter, in the order in which it is said.
MODULE: Mapping[str, Callable[[Value], str]] = {
    'profidrive.manufacturer': 'manufacturer {}'.format,
    'profidrive.device_type': _device,
    'profidrive.version': _version,
    'profidrive.firmware_day': _day,
    'profidrive.firmware_year': str,
}
