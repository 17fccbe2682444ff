# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The settings of a Sinus H at its keypad, by the groups and numbers of [M3 §4].

No telegram reaches them. What [M3] does not print is marked; the maker's manual of the drive has
it, but its defaults are not known here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from nfo_sinus_driver.catalog import Access, Family, Parameter, Value
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

#: The fault message of a trip that the drive makes itself [M3 §9].
LOST_COMMAND = 35


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
        access=Access.READ_WRITE,
        unit=unit,
        minimum=Fraction(span[0]) if span else None,
        maximum=Fraction(span[1]) if span else None,
        decimals=2 if span else 0,
        labels=labels or {},
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


#: The settings by communication address; these are made up, for [M3] prints none.
KEYS = {0x1100 + number: setting.key for number, setting in enumerate(_SETTINGS, 1)}


def with_keypad(model: Family) -> Family:
    """Return the tables of the family with the settings that its keypad shows."""
    return replace(model, parameters={**model, **{setting.key: setting for setting in _SETTINGS}})
