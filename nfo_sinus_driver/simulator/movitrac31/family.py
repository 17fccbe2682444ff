# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the simulator has to know of a MOVITRAC 31.."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from nfo_sinus_driver.catalog import Access, Family, Parameter, Value
from nfo_sinus_driver.catalog.codec import Bcd, codec_of
from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.injections import Argument, Target, Verb
from nfo_sinus_driver.simulator.movitrac31.commands import KEYS
from nfo_sinus_driver.simulator.movitrac31.control_unit import MovitracControlUnit
from nfo_sinus_driver.simulator.movitrac31.server import Server
from nfo_sinus_driver.simulator.movitrac31.variant import OPTIONS

_PROTOCOL = 'movitrac'
#: What [M4 §4] lets a master write though the tables do not: they say what a driver may.
_WRITTEN = frozenset(
    {
        'setpoint.n2_offset',
        'monitoring.frs_alert',
        'monitoring.frs_lag_error',
        'control.frs_master_gear_ratio',
        'control.frs_slave_gear_ratio',
        'control.frs_slave_counter',
        'control.frs_offset_1',
        'control.frs_offset_2',
        'control.frs_offset_3',
        'ipos.feedforward',
        'ipos.reference_offset',
        'ipos.limit_switch_cw',
        'ipos.limit_switch_ccw',
        'ipos.lag_error_window',
        'ipos.x_setpoint',
        'ipos.code_value',
        'ipos.data_value',
        'ipos.pc_position_setpoint',
    }
)

#: What leaves the factory, in engineering units. But for terminal 43 [M4 §4] does not print these.
_FACTORY: Mapping[str, Value] = {
    **{f'ramp.t{number}1_{way}': 1.0 for number in (1, 2) for way in ('up', 'down')},
    **{f'ramp.t{number}2_up_down': 5.0 for number in (1, 2)},
    **{f'ramp.t{number}3_stop': 0.5 for number in (1, 2)},
    **{f'frequency.f_max_{number}': 50.0 for number in (1, 2, 3)},
    'frequency.f_base_3': 50.0,
    'frequency.vf_pattern_1': 'V/f pattern 1',
    'frequency.vf_pattern_2': 'V/f pattern 2',
    **{f'motor.voltage_{number}': 400.0 for number in (1, 2)},
    **{f'motor.pole_pairs_{number}': 2.0 for number in (1, 2)},
    **{f'motor.i_max_{number}': 150.0 for number in (1, 2)},
    **{f'motor.rated_current_{number}': 100.0 for number in (1, 2)},
    'terminal.input_42': 'CCW/Stop',
    'terminal.input_43': 'Enable/Stop',
    'terminal.input_47': 'n11 (n21)',
    **{f'terminal.input_{number}': 'No function' for number in (48, 49, 50, 51, 52, 53, 54)},
    'terminal.output_61': 'Brake released',
    'special.keypad_reset': True,
    'special.restart_time': 3.0,
    'setpoint.n11': 5.0,
    'setpoint.n12': 25.0,
    'setpoint.n13': 50.0,
    'status.external_current_limit': 100.0,
    # the example of [M4 §4]: 821 123 4.11
    'special.software_system': 0x21123411,
    'status.inverter_type': 'MOVITRAC 31..',
    'status.output_stage': '31C015-503-4-00',
}


def _machine(model: Family) -> Family:
    """
    Return the model with what a drive itself allows.

    A drive has negative numbers and writes all that [M4 §4] says; of the line's own codec, which
    has no sign [C70], only the server knows.
    """
    return replace(model, parameters={key: _own(key, model[key]) for key in model})


def _own(key: str, parameter: Parameter) -> Parameter:
    address = parameter.at(_PROTOCOL)
    negative = parameter.minimum is not None and parameter.minimum < 0
    # the fault memory prints no ranges
    negative = negative or key.endswith('heat_sink_temperature')
    if negative and isinstance(address.codec, Bcd):
        address = replace(address, codec=codec_of('sint32_be'))
    access = Access.READ_WRITE if key in _WRITTEN else parameter.access
    return replace(parameter, access=access, addresses={_PROTOCOL: address})


def _unit(target: Target) -> MovitracControlUnit:
    unit = target.one.control_unit
    assert isinstance(unit, MovitracControlUnit)
    return unit


def _ambient(target: Target, given: dict[str, Any]) -> None:
    _unit(target).ambient = given['temperature']


def _terminal(target: Target, given: dict[str, Any]) -> None:
    _unit(target).switch(given['number'], given['state'] == 'closed')


FAMILY = SimulatedFamily(
    control_unit=MovitracControlUnit,
    factory=_FACTORY,
    machine=_machine,
    servers={_PROTOCOL: Server},
    options=OPTIONS,
    verbs={
        'terminal': Verb(
            'close or open a binary input',
            _terminal,
            (
                Argument('number', int, 'of the terminal, such as 41'),
                Argument('state', str, 'closed or open', choices=('closed', 'open')),
            ),
        ),
        'keypad': Verb(
            'press a key: manual and automatic choose who commands, cw, ccw and stop count in '
            'manual operation; reset',
            lambda target, given: _unit(target).press(given['key']),
            (Argument('key', str, 'the key', choices=('manual', 'automatic', 'reset', *KEYS)),),
        ),
        'ambient': Verb(
            'change the temperature around the drive',
            _ambient,
            (Argument('temperature', float, 'in °C, such as -15'),),
        ),
    },
)
