# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The settings of a Sinus H at its keypad, by the groups and numbers of [M3 §4].

No telegram reaches them. What [M3] does not print is marked; the maker's manual of the drive has
it, but its defaults are not known here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction

from nfo_sinus_driver.catalog import Access, Family, Parameter, Value
from nfo_sinus_driver.catalog.codec import codec_of
from nfo_sinus_driver.catalog.parameter import Address
from nfo_sinus_driver.simulator.sinus_h.trips import TRIPS

_KEYPAD = 'keypad'
_HUNDREDTH = Fraction(1, 100)
_TENTH = Fraction(1, 10)

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


def _settings() -> Iterator[Parameter]:
    yield _choice(CMD_SOURCE, 'Cmd Source', 'DRV', 6, _COMMANDS, 'M3 §5.2.1')
    yield _choice(FREQ_REF_SRC, 'Freq Ref Src', 'DRV', 7, _REFERENCES, 'M3 §5.2.2')
    yield _number(FREQUENCY, 'Cmd Frequency', 'DRV', 1, _HUNDREDTH, 'Hz', 0, 400, '')
    yield _number(MAX_FREQ, 'Max Freq', 'DRV', 20, _HUNDREDTH, 'Hz', 40, 400, '')
    yield _number(ACC_TIME, 'Acc Time', 'DRV', 3, _TENTH, 's', 0, 600, '')
    yield _number(DEC_TIME, 'Dec Time', 'DRV', 4, _TENTH, 's', 0, 600, '')
    yield _choice(STOP_MODE, 'Stop Mode', 'ADV', 8, _STOP_MODES, 'M3 §6')
    yield _choice(TELEGRAM, 'opt para-13', 'COM', 22, _TELEGRAMS, 'M3 §5.3.4')
    yield _number(TRIP_DEC_TIME, 'Trip Dec Time', 'PRT', 7, _TENTH, 's', 0, 600, 'M3 §5.4.1')
    yield _choice(LOST_CMD_MODE, 'Lost Cmd Mode', 'PRT', 12, _LOST, 'M3 §5.4.1')
    yield _number(
        LOST_CMD_TIME, 'Lost Cmd Time', 'PRT', 13, _TENTH, 's', Fraction(1, 10), 120, 'M3 §5.4.2'
    )
    # 0 is its default, and out of its range [C66]
    yield _number(LOST_PRESET_F, 'Lost Preset F', 'PRT', 14, _HUNDREDTH, 'Hz', 0, 60, 'M3 §5.4.3')


def with_keypad(model: Family) -> Family:
    """Return the tables of the family with the settings and the trips that its keypad shows."""
    own = {setting.key: setting for setting in _settings()}
    codes = {**model.status_codes, **TRIPS}
    return replace(model, parameters={**model, **own}, status_codes=codes)


def _choice(
    key: str, name: str, group: str, number: int, labels: Mapping[int, str], source: str
) -> Parameter:
    return _parameter(key, name, group, number, labels=labels, source=source)


def _number(
    key: str,
    name: str,
    group: str,
    number: int,
    factor: Fraction,
    unit: str,
    minimum: Fraction | int,
    maximum: int,
    source: str,
) -> Parameter:
    setting = _parameter(key, name, group, number, factor=factor, source=source)
    return replace(
        setting, unit=unit, minimum=Fraction(minimum), maximum=Fraction(maximum), decimals=2
    )


def _parameter(
    key: str,
    name: str,
    group: str,
    number: int,
    *,
    labels: Mapping[int, str] | None = None,
    factor: Fraction = Fraction(1),
    source: str,
) -> Parameter:
    codec = codec_of('uint16_be')
    address = Address(_KEYPAD, group, number, None, codec, factor, source)
    return Parameter(
        key=key,
        name=name,
        group=group,
        addresses={_KEYPAD: address},
        scale='',
        unit='',
        minimum=None,
        maximum=None,
        steps=(),
        decimals=0,
        labels=labels or {},
        access=Access.READ_WRITE,
        stopped=False,
        since=None,
        older=False,
        option='',
        description='',
        source=source,
    )
