# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The trips of a Sinus H by their fault messages [M3 §9]; no telegram 1 tells which it is.

The bit positions behind them are not printed [C69]; the numbers are those of the table.
"""

from __future__ import annotations

from collections.abc import Mapping

from nfo_sinus_driver.catalog import Kind, StatusCode

LOST_COMMAND = 35

_NAMES: Mapping[int, str] = {
    1: 'Overload Trip',
    2: 'Underload Trip',
    3: 'Inverter Overload Trip',
    4: 'E-Thermal Trip',
    5: 'Ground Fault Trip',
    6: 'Missing Output Phase Trip',
    7: 'Missing Input Phase Trip',
    10: 'NTC Trip',
    11: 'Overcurrent Trip',
    12: 'Overvoltage Trip',
    13: 'External Trip',
    14: 'Arm Short',
    15: 'Overheat Trip',
    16: 'Fuse Open Trip',
    17: 'MC Fail Trip',
    19: 'PTC (Thermal sensor) Trip',
    20: 'FAN Trip',
    22: 'Parameter Write Error',
    23: 'Pre PID Fail',
    24: 'IO Board Connection Fault',
    25: 'External Brake Trip',
    26: 'No Motor Trip',
    27: 'Option Card Connection Fault',
    29: 'Safety A Trip',
    30: 'Safety B Trip',
    33: 'BX',
    34: 'LV',
    LOST_COMMAND: 'Lost Command',
    36: 'Keypad Lost Command',
    49: 'ADC Error',
    50: 'EEPROM Error',
    51: 'Watchdog-1 Error',
    52: 'Watchdog-2 Error',
    54: 'QueueFull',
    64: 'Internal Communication Error between the Inverter and the Option Card',
}

TRIPS: Mapping[int, StatusCode] = {
    number: StatusCode(number, name, kind=Kind.FAULT, requires_ack=True, description=name)
    for number, name in _NAMES.items()
}
