# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The settings and trips of a Sinus H at its keypad, by the groups and numbers of [M3 §4, §9].

No telegram reaches them, and none tells which trip it is. What [M3] does not print is marked; the
maker's manual of the drive has it, but its defaults are not known here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from nfo_sinus_driver.catalog import Access, Family, Kind, Parameter, StatusCode, Value
from nfo_sinus_driver.catalog.codec import codec_of
from nfo_sinus_driver.catalog.parameter import Address

_KEYPAD = 'keypad'

CMD_SOURCE = 'drv.cmd_source'
FREQ_REF_SRC = 'drv.freq_ref_src'
FREQUENCY = 'drv.frequency'
MAX_FREQ = 'drv.max_freq'
ACC_TIME = 'drv.acc_time'
DEC_TIME = 'drv.dec_time'
STOP_MODE = 'adv.stop_mode'
TELEGRAM = 'com.opt_para_13'
TRIP_DEC_TIME = 'prt.trip_dec_time'
LOST_CMD_MODE = 'prt.lost_cmd_mode'
LOST_CMD_TIME = 'prt.lost_cmd_time'
LOST_PRESET_F = 'prt.lost_preset_f'

FIELDBUS_COMMANDS = 4
FIELDBUS_REFERENCE = 8
DEC = 0
STANDARD_TELEGRAM = 0

#: Lost Cmd Mode [M3 §5.4.1].
NONE, FREE_RUN, DECELERATE, HOLD_INPUT, HOLD_OUTPUT, PRESET = range(6)

_COMMANDS = {
    0: 'Keypad',
    1: 'Fx/Rx-1',
    2: 'Fx/Rx-2',
    3: 'Int 485',
    FIELDBUS_COMMANDS: 'Fieldbus',
    5: 'UserSeqLink',
}
_REFERENCES = {
    0: 'Keypad-1',
    1: 'Keypad-2',
    2: 'V1',
    4: 'V2',
    5: 'I2',
    6: 'Int 485',
    FIELDBUS_REFERENCE: 'FieldBus',
    9: 'UserSeqLink',
    12: 'Pulse',
}
_STOP_MODES = {DEC: 'Dec', 2: 'Free-Run'}
_TELEGRAMS = {STANDARD_TELEGRAM: 'STD Telegram1', 1: 'Vendor Specific Telegram'}
_LOST = {
    NONE: 'None',
    FREE_RUN: 'Free-Run',
    DECELERATE: 'Dec',
    HOLD_INPUT: 'Hold Input',
    HOLD_OUTPUT: 'Hold Output',
    PRESET: 'Lost Preset',
}

#: What leaves the factory, but for the two that a drive behind a PLC needs otherwise, and the
#: ramps, which [M3] does not print.
FACTORY: Mapping[str, Value] = {
    CMD_SOURCE: 'Fieldbus',
    FREQ_REF_SRC: 'FieldBus',
    MAX_FREQ: 60.0,
    ACC_TIME: 5.0,
    DEC_TIME: 5.0,
    TRIP_DEC_TIME: 3.0,
    LOST_CMD_TIME: 1.0,
}

#: By their fault messages. The bit positions behind them are not printed [C69].
LOST_COMMAND = 35
_TRIPS: Mapping[int, str] = {
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


def _setting(
    key: str,
    place: str,
    name: str,
    source: str,
    labels: Mapping[int, str] | None = None,
    *,
    decimals: int = 0,
    unit: str = '',
    span: tuple[Fraction | int, int] | None = None,
) -> Parameter:
    """Return a setting; ``place`` is its group and number, as the keypad shows them."""
    group, _, number = place.partition('-')
    factor = Fraction(1, 10**decimals)
    codec = codec_of('uint16_be')
    return Parameter(
        key=key,
        name=name,
        group=group,
        addresses={_KEYPAD: Address(_KEYPAD, group, int(number), None, codec, factor, source)},
        scale='',
        unit=unit,
        minimum=Fraction(span[0]) if span else None,
        maximum=Fraction(span[1]) if span else None,
        steps=(),
        decimals=2 if span else 0,
        labels=labels or {},
        access=Access.READ_WRITE,
        stopped=False,
        since=None,
        older=False,
        option='',
        description='',
        source=source,
    )


_SECONDS: Any = {'decimals': 1, 'unit': 's'}
_HERTZ: Any = {'decimals': 2, 'unit': 'Hz'}
_SETTINGS = (
    _setting(CMD_SOURCE, 'DRV-6', 'Cmd Source', 'M3 §5.2.1', _COMMANDS),
    _setting(FREQ_REF_SRC, 'DRV-7', 'Freq Ref Src', 'M3 §5.2.2', _REFERENCES),
    _setting(FREQUENCY, 'DRV-1', 'Cmd Frequency', '', span=(0, 400), **_HERTZ),
    _setting(MAX_FREQ, 'DRV-20', 'Max Freq', '', span=(40, 400), **_HERTZ),
    _setting(ACC_TIME, 'DRV-3', 'Acc Time', '', span=(0, 600), **_SECONDS),
    _setting(DEC_TIME, 'DRV-4', 'Dec Time', '', span=(0, 600), **_SECONDS),
    _setting(STOP_MODE, 'ADV-8', 'Stop Mode', 'M3 §6', _STOP_MODES),
    _setting(TELEGRAM, 'COM-22', 'opt para-13', 'M3 §5.3.4', _TELEGRAMS),
    _setting(TRIP_DEC_TIME, 'PRT-7', 'Trip Dec Time', 'M3 §5.4.1', span=(0, 600), **_SECONDS),
    _setting(LOST_CMD_MODE, 'PRT-12', 'Lost Cmd Mode', 'M3 §5.4.1', _LOST),
    _setting(
        LOST_CMD_TIME,
        'PRT-13',
        'Lost Cmd Time',
        'M3 §5.4.2',
        span=(Fraction(1, 10), 120),
        **_SECONDS,
    ),
    # 0 is its default, and out of its range [C66]
    _setting(LOST_PRESET_F, 'PRT-14', 'Lost Preset F', 'M3 §5.4.3', span=(0, 60), **_HERTZ),
)


def with_keypad(model: Family) -> Family:
    """Return the tables of the family with the settings and the trips that its keypad shows."""
    trips = {
        number: StatusCode(number, name, kind=Kind.FAULT, requires_ack=True, description=name)
        for number, name in _TRIPS.items()
    }
    return replace(
        model,
        parameters={**model, **{setting.key: setting for setting in _SETTINGS}},
        status_codes={**model.status_codes, **trips},
    )
