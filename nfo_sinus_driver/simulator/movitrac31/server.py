# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a MOVITRAC 31.. does with the parameters that it is asked for ([M4 §2.1.2], [M4 §3]).

Of what is wrong with a request it tells the first thing that it comes to.
"""

from __future__ import annotations

from nfo_sinus_driver.catalog import Access, Parameter
from nfo_sinus_driver.catalog.codec import Bcd
from nfo_sinus_driver.simulator import movitrac
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.movitrac import Nack
from nfo_sinus_driver.simulator.movitrac31.commands import FUNCTION_BITS, SETPOINT
from nfo_sinus_driver.simulator.movitrac31.control_unit import MovitracControlUnit
from nfo_sinus_driver.simulator.movitrac31.option_cards import suffices
from nfo_sinus_driver.simulator.movitrac31.rules import broken
from nfo_sinus_driver.simulator.movitrac_frames import ReturnCode

_PROTOCOL = 'movitrac'
_LOCK = 'special.parameter_lock'
#: What the parameter lock leaves alone: itself, and what is no parameter.
_NEVER_LOCKED = frozenset({_LOCK, FUNCTION_BITS, SETPOINT})
#: What only the keypad can switch on: "On only with FBG 31".
_KEYPAD_ONLY = 'special.user_menu'


class Server(movitrac.Server):
    """The serial side of one MOVITRAC 31.., by the index of its parameters."""

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, MovitracControlUnit)
        self.any_address = drive.control_unit.any_address
        self._drive = drive
        self._unit = drive.control_unit
        self._memory = drive.memory
        self._negative = int(self._unit.variant.negative_nibble, 16)
        self._by_index = {
            parameter.at(_PROTOCOL).index: parameter for parameter in drive.memory.model.values()
        }

    def enquiry(self, index: int) -> bytes:
        """Return the bytes of a parameter."""
        parameter = self._find(index)
        return self._bytes(parameter, self._drive.read_raw(parameter.key))

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
        if not suffices(self._unit.variant.option_card, parameter.option):
            raise Nack(ReturnCode.OPTION_MISSING, f'{parameter.key} needs {parameter.option}')
        return parameter

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

    def _bytes(self, parameter: Parameter, raw: int) -> bytes:
        """Return the bytes of a raw number; a negative one has a sign in place of a digit [C70]."""
        table = self._drive.model[parameter.key].at(_PROTOCOL).number
        data = table.encode(abs(raw) if isinstance(table, Bcd) else raw)
        return self._signed(data) if isinstance(table, Bcd) and raw < 0 else data

    def _number(self, parameter: Parameter, value: bytes) -> int:
        """Return the raw number of bytes (Nack: they mean none)."""
        table = self._drive.model[parameter.key].at(_PROTOCOL).number
        codec = parameter.at(_PROTOCOL).number
        negative = codec.signed and isinstance(table, Bcd) and value[0] >> 4 == self._negative
        try:
            size = table.decode(bytes([value[0] & 0x0F]) + value[1:] if negative else value)
        except ValueError as error:
            raise Nack(ReturnCode.INVALID_VALUE, str(error)) from None
        return -size if negative else size

    def _signed(self, data: bytes) -> bytes:
        return bytes([self._negative << 4 | data[0]]) + data[1:]
