# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus as a described drive speaks it: its registers word by word, and its coils."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import struct

from nfo_sinus_driver.catalog import Access, Parameter, to_bytes, to_words
from nfo_sinus_driver.catalog.declared import (
    PULSE_KEY,
    PULSES,
    STATUS_KEY,
    Copied,
    Description,
    Shown,
    place_of,
)
from nfo_sinus_driver.simulator import modbus
from nfo_sinus_driver.simulator._declared.control_unit import DeclaredControlUnit
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Reason, Refused

READ_COILS = 1
WRITE_COIL = 5
_ON = 0xFF00
_MOST_COILS = 2000


class Server(modbus.Requests):
    """What one drive does with requests; it knows nothing but its file."""

    functions = frozenset(
        (READ_COILS, modbus.READ, modbus.READ_INPUT, WRITE_COIL, modbus.WRITE_SINGLE,
         modbus.WRITE_MULTIPLE)
    )

    def __init__(self, drive: SimulatedDrive, file: Description) -> None:
        assert isinstance(drive.control_unit, DeclaredControlUnit)
        self.drive = drive
        self._unit = drive.control_unit
        self._file = file
        self._commands = self._unit.command_places
        self._at = self._places(file, 'register', 'input')
        self._coils = self._places(file, 'coil')
        if file.simulated.loopback:
            self.functions |= {modbus.DIAGNOSTICS}
        # what the file does not write by is refused
        self.functions -= {modbus.WRITE_SINGLE, modbus.WRITE_MULTIPLE} - set(file.line.write)

    @staticmethod
    def _places(file: Description, *kinds: str) -> Mapping[int, tuple[Parameter, int]]:
        """Return by its number which parameter a register or coil is of, and which part of it."""
        found: dict[int, tuple[Parameter, int]] = {}
        for key, parameter in file.parameters.items():
            kind, first = place_of(parameter.at('modbus'))
            if kind not in kinds or key == STATUS_KEY:
                continue
            for number in range(max(parameter.at('modbus').codec.size // 2, 1)):
                # a setting rather than the command that writes the same register
                found.setdefault(first + number, (parameter, number))
        return found

    # ---- registers ----

    def read(self, register: int, count: int) -> tuple[int, ...]:
        """Read registers, whatever stands in them; one that is none is refused."""
        self._check_count(count)
        return tuple(self._word(number) for number in range(register, register + count))

    def _word(self, register: int) -> int:
        status = self._file.status
        if register in status.registers and not status.coils:
            return self._unit.status_word >> status.shift(register) & 0xFFFF
        if register not in self._at:
            return self._word_for_others(register)
        parameter, part = self._at[register]
        raw = self.drive.read_raw(parameter.key)
        return to_words(parameter.at('modbus').number.encode(raw))[part]

    def _word_for_others(self, register: int) -> int:
        """Return what stands in a register that the driver does not read."""
        found = self._file.simulated.registers.get(register)
        if found is None:
            raise Refused(Reason.ADDRESS, f'there is no register {register:04X}h')
        if isinstance(found, Copied):
            return self._word(found.register) >> found.shift & found.mask
        return self._unit.shown(found) if isinstance(found, Shown) else found

    def write(self, register: int, words: Sequence[int]) -> None:
        """Write registers one after the other; of a parameter of two both are needed."""
        self._check_count(len(words))
        at = 0
        while at < len(words):
            at += self._write_at(register + at, words[at:])
        self.drive.advance(0.0)

    def _write_at(self, register: int, words: Sequence[int]) -> int:
        parameter, part = self._at.get(register, (None, 0))
        is_setting = parameter is not None and not parameter.key.startswith('line.r')
        if ('register', register) in self._commands and not is_setting:
            self._unit.take_word(('register', register), words[0])
            self.drive.command_writes[f'line.r{register:04x}'] += 1
            self._unit.settle()
            return 1
        if parameter is None or part or parameter.access is Access.READ:
            raise Refused(Reason.ADDRESS, f'nothing is written at register {register:04X}h')
        count = parameter.at('modbus').codec.size // 2
        if len(words) < count:
            raise Refused(Reason.ADDRESS, f'{parameter.key} takes {count} registers')
        raw = parameter.at('modbus').number.decode(to_bytes(words[:count]))
        self.drive.write_raw(parameter.key, raw)
        self._unit.written(parameter.key, 'modbus')
        return count

    def _check_count(self, count: int) -> None:
        if count > self._file.line.most_registers:
            raise Refused(Reason.VALUE, f'{count} registers are too many for a message')

    # ---- coils ----

    def _carry_out(self, function: int, data: bytes) -> bytes:
        if function == READ_COILS:
            return self._read_coils(data)
        if function == WRITE_COIL:
            return self._write_coil(data)
        return super()._carry_out(function, data)

    def _read_coils(self, data: bytes) -> bytes:
        first, count = struct.unpack('>HH', data)
        if not 1 <= count <= _MOST_COILS:
            raise Refused(Reason.VALUE, f'{count} coils are too many for a message')
        bits = 0
        for number in range(count):
            bits |= self._coil(first + number) << number
        size = (count + 7) // 8
        return bytes((READ_COILS, size)) + bits.to_bytes(size, 'little')

    def _coil(self, coil: int) -> int:
        status = self._file.status
        if status.coils and coil in status.registers:
            return self._unit.status_word >> status.shift(coil) & 1
        if ('coil', coil) in self._commands:
            return self._unit.word(('coil', coil)) & 1
        if coil in self._unit.pulses:
            return 0
        if coil not in self._coils:
            raise Refused(Reason.ADDRESS, f'there is no coil {coil}')
        return self.drive.read_raw(self._coils[coil][0].key) & 1

    def _write_coil(self, data: bytes) -> bytes:
        coil, value = struct.unpack('>HH', data)
        if value not in (0, _ON):
            raise Refused(Reason.VALUE, f'a coil is not written with {value:04X}h')
        if coil in self._unit.pulses:
            # setting it is the command, and clearing it is none
            if value == _ON:
                self._unit.take_word(PULSES, coil)
                self.drive.command_writes[PULSE_KEY] += 1
                self._unit.settle()
        elif ('coil', coil) in self._commands:
            self._unit.take_word(('coil', coil), int(value == _ON))
            self.drive.command_writes[f'line.coil_{coil}'] += 1
            self._unit.settle()
        elif coil in self._coils:
            self.drive.write_raw(self._coils[coil][0].key, int(value == _ON))
        else:
            raise Refused(Reason.ADDRESS, f'there is no coil {coil}')
        return bytes((WRITE_COIL,)) + data
