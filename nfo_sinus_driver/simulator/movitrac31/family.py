# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the simulator has to know of a MOVITRAC 31..: its tables, its serial side, what happens to it.

Of what is wrong with a request its serial side reports the first thing that it comes to
([M4 §2.1.2], [M4 §3]).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from nfo_sinus_driver.catalog import Access, Family, Parameter, Value
from nfo_sinus_driver.catalog.codec import BitField, SignedBcd, codec_of
from nfo_sinus_driver.simulator import movitrac
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.injections import Injection, argument, assign, finite
from nfo_sinus_driver.simulator.movitrac import Nack, ReturnCode
from nfo_sinus_driver.simulator.movitrac31.commands import FUNCTION_BITS, SETPOINT
from nfo_sinus_driver.simulator.movitrac31.control_unit import MovitracControlUnit
from nfo_sinus_driver.simulator.movitrac31.parameters import MovitracVariant, broken

_PROTOCOL = 'movitrac'
_LOCK = 'special.parameter_lock'
#: What the parameter lock leaves alone: itself, and what is no parameter.
_NEVER_LOCKED = frozenset({_LOCK, FUNCTION_BITS, SETPOINT})
#: What only the keypad can switch on: "On only with FBG 31".
_KEYPAD_ONLY = 'special.user_menu'
#: What [M4 §4] lets a master write though the tables do not: they say what a driver may.
_WRITTEN = frozenset(
    {
        'setpoint.n2_offset',
        'control.frs_slave_counter',
        'control.frs_offset_1',
        'control.frs_offset_2',
        'control.frs_offset_3',
        'ipos.feedforward',
        'ipos.reference_offset',
        'ipos.limit_switch_cw',
        'ipos.limit_switch_ccw',
        'ipos.x_setpoint',
        'ipos.code_value',
        'ipos.data_value',
        'ipos.pc_position_setpoint',
    }
)

#: What takes values between its steps: the manual's own example is one ([M4 §3.1], [C70]).
_BETWEEN_STEPS = frozenset({'setpoint.n2_offset'})

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
    writes no sign [C70], only the server knows.
    """
    own = {}
    for key, parameter in model.items():
        address = parameter.at(_PROTOCOL)
        if isinstance(address.codec, SignedBcd):
            address = replace(address, codec=codec_of('sint32_be'))
        access = Access.READ_WRITE if key in _WRITTEN else parameter.access
        steps = () if key in _BETWEEN_STEPS else parameter.steps
        there = {_PROTOCOL: address}
        own[key] = replace(parameter, access=access, steps=steps, addresses=there)
    return replace(model, parameters=own)


class Server(movitrac.Server):
    """The serial side of one MOVITRAC 31.., by the index of its parameters."""

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, MovitracControlUnit)
        self._drive = drive
        self._unit = drive.control_unit
        self._memory = drive.memory
        #: The first half-byte of a negative number [C70].
        self._sign = int(self._unit.variant.negative_sign, 16)
        self.any_address = self._unit.variant.interface == 'rs232'
        #: What stands there as a whole; some bits of it may have a name of their own.
        self._by_index = {
            parameter.at(_PROTOCOL).index: parameter
            for parameter in drive.memory.model.values()
            if not isinstance(parameter.at(_PROTOCOL).codec, BitField)
        }

    def enquiry(self, index: int) -> bytes:
        """Return the bytes of a parameter; a negative number has a sign in place of a digit."""
        parameter = self._find(index)
        raw = self._drive.read_raw(parameter.key)
        table = self._drive.model[parameter.key].at(_PROTOCOL).number
        if not isinstance(table, SignedBcd) or raw >= 0:
            return table.encode(raw)
        data = table.encode(-raw)
        return bytes([self._sign << 4 | data[0]]) + data[1:]

    def select(self, index: int, value: bytes) -> None:
        """Set a parameter."""
        parameter = self._find(index)
        key = parameter.key
        if len(value) != parameter.at(_PROTOCOL).codec.size:
            raise Nack(ReturnCode.ILLEGAL_MESSAGE, f'{key} does not have {len(value)} bytes')
        if parameter.access is not Access.READ_WRITE:
            raise Nack(ReturnCode.READ_ONLY, f'{key} cannot be written')
        if self._unit.factory_left:
            raise Nack(ReturnCode.FACTORY_SETTING_RUNNING, 'the factory setting is running')
        if self._memory.raw(_LOCK) and key not in _NEVER_LOCKED:
            raise Nack(ReturnCode.LOCKED, 'the parameters are locked')
        raw = self._number(parameter, value)
        self._check(parameter, raw)
        self._drive.write_raw(key, raw)
        if self._unit.factory_left:
            raise Nack(ReturnCode.FACTORY_SETTING_STARTED, 'the factory setting begins')
        if self._unit.eeprom.lacks(key):
            raise Nack(ReturnCode.VOLATILE, f'{key} is lost when power is off')

    def _find(self, index: int) -> Parameter:
        parameter = self._by_index.get(index)
        if parameter is None:
            raise Nack(ReturnCode.ILLEGAL_INDEX, f'there is no index {index}')
        # the cards of which it needs one, as the tables name them; empty: none
        cards = parameter.option.split(' or ')
        if parameter.option and self._unit.variant.option_card.upper() not in cards:
            raise Nack(ReturnCode.OPTION_MISSING, f'{parameter.key} needs {parameter.option}')
        return parameter

    def _number(self, parameter: Parameter, value: bytes) -> int:
        """Return the raw number of bytes (Nack: they mean none)."""
        table = self._drive.model[parameter.key].at(_PROTOCOL).number
        negative = isinstance(table, SignedBcd) and value[0] >> 4 == self._sign
        try:
            size = table.decode(bytes([value[0] & 0x0F]) + value[1:] if negative else value)
        except ValueError as error:
            raise Nack(ReturnCode.INVALID_VALUE, str(error)) from None
        return -size if negative else size

    def _check(self, parameter: Parameter, raw: int) -> None:
        """Look whether a parameter can have a raw number."""
        key = parameter.key
        value = raw * parameter.factor(_PROTOCOL)
        codes = list(parameter.labels)
        low = min(codes) if codes else parameter.minimum
        high = max(codes) if codes else parameter.maximum
        if high is not None and value > high:
            raise Nack(ReturnCode.TOO_LARGE, f'{key} cannot be so large')
        if low is not None and value < low:
            raise Nack(ReturnCode.TOO_SMALL, f'{key} cannot be so small')
        if not (value in codes if codes else parameter.on_step(float(value))):
            raise Nack(ReturnCode.INVALID_VALUE, f'{key} has no such value in between')
        if key == _KEYPAD_ONLY and not raw and self._memory.raw(key):
            raise Nack(ReturnCode.NOT_BY_THIS_INTERFACE, f'{key} is switched on by the keypad')
        if code := broken(self._memory, key, raw):
            raise Nack(code, f'{key} does not go with the other settings')


_INJECTIONS = {
    'terminal': Injection('close or open a binary input',
        lambda at, given: at.unit.switch(given.number, given.state == 'closed'),
        argument('number', 'of the terminal, such as 41', type=int),
        argument('state', 'closed or open', choices=('closed', 'open'))),
    'ambient': Injection('change the temperature around the drive',
        lambda at, given: assign(at.unit, ambient=given.temperature),
        argument('temperature', 'in °C, such as -15', type=finite)),
}

FAMILY = SimulatedFamily(
    control_unit=MovitracControlUnit,
    variant=MovitracVariant,
    factory=_FACTORY,
    machine=_machine,
    servers={_PROTOCOL: Server},
    injections=_INJECTIONS,
)
