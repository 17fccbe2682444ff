# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a MOVITRAC 31.. is commanded, what it does, and what it says of it [M4 §4].

Where the manual leaves it open, its :class:`MovitracVariant` says.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence as Several
from dataclasses import replace
from typing import Any

from nfo_sinus_driver.simulator.control_unit import ControlUnit
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.motor import Nameplate
from nfo_sinus_driver.simulator.movitrac import Nack, ReturnCode
from nfo_sinus_driver.simulator.movitrac31.commands import (
    FUNCTION_BITS,
    KEYS,
    MANUAL,
    SETPOINT,
    Sequence,
    SerialCommands,
)
from nfo_sinus_driver.simulator.movitrac31.parameters import (
    AMBIENT,
    CARDS,
    DISPLAYS,
    ENABLE,
    EXTERNAL_FAULT,
    FAULTS,
    PC_TIMEOUT,
    Bit,
    Eeprom,
    FaultMemory,
    Flag,
    Input,
    Mode,
    MovitracFaults,
    MovitracVariant,
    Number,
    Output,
    Terminals,
    heat_sink,
)
from nfo_sinus_driver.simulator.timing import Timing

#: How its line is set, which nothing changes [M4 §2.3.3].
_TIMING = Timing(9600, '8N1')
_ADDRESS = 'serial.inverter_address'
_RESPONSE_TIME = 'serial.response_time'
_PC_TIMEOUT = 'serial.pc_timeout'
_MASTER_SLAVE = 'serial.master_slave'
FACTORY_SETTING = 'fieldbus.factory_setting'
_MILLI = 0.001
#: How long the factory setting takes (s). No manual says.
_FACTORY_TIME = 2.0
#: Raw number of "Yes".
_YES = 100
#: The slip of the simulated motor, as a share of f_base.
_SLIP = 0.04
#: The bits of the control word for manual operation, by the direction of the key; in which order
#: they stand [M4 §4] no longer shows.
_KEY_BITS: Mapping[int, int] = {-1: 1, 0: 0, 1: 2}
#: What an enable without a direction is shown as, however the drive is read [C105].
_STOPPED: Mapping[str, Number] = {'normal_stop': Number.NORMAL_STOP, 'enable': Number.ENABLE}


class MovitracControlUnit(ControlUnit):
    """
    Takes what terminals, line and keypad want.

    :raises ValueError: the address is given as a setting.

    :ivar terminals: the binary terminals.
    :ivar eeprom: what is saved.
    :ivar ambient: the temperature around the drive (°C); set it at any time.
    :ivar factory_left: how long the factory setting still runs (s).
    """

    line_settings = frozenset({_ADDRESS, _RESPONSE_TIME})
    keys = ('manual', 'automatic', 'reset', *KEYS)

    faults: MovitracFaults
    variant: MovitracVariant

    def __init__(self, memory: Memory, address: int, variant: MovitracVariant) -> None:
        if _ADDRESS in memory.given:
            raise ValueError(f'{_ADDRESS} is given with --address')
        memory.set(_ADDRESS, address)
        self.terminals = Terminals(memory, variant.option_card)
        self.eeprom = Eeprom(memory)
        self.ambient = AMBIENT
        self.factory_left = 0.0
        self._commands = SerialCommands(memory, self.terminals, variant.enable_bit)
        self._parameters = self._commands.now.parameters
        super().__init__(memory, address, variant, MovitracFaults(memory.model))
        self._fault_memory = FaultMemory()
        self._sequence = Sequence(self.motor)
        self._clockwise = True
        #: A terminal said so when it was last looked at.
        self._external_fault = False
        #: How long no frame has come, and how long a fault has been without a cause (s).
        self._silence = 0.0
        self._without_cause = 0.0

    # ---- the line ----

    @property
    def address(self) -> int:
        """The address that is in effect, P842."""
        return round(self.memory.number(_ADDRESS))

    @property
    def response_time(self) -> float:
        """How long it waits before it answers (s), P843."""
        return _MILLI * self.memory.number(_RESPONSE_TIME)

    def set_to(self, lines: Several[tuple[str, Timing]]) -> None:
        """Look whether lines are as the drive has them: there is nothing to set."""
        for protocol, timing in lines:
            if timing != _TIMING:
                usual = f'{_TIMING.baud} {_TIMING.char_format}'
                raise ValueError(f'{protocol} has {usual}, not {timing.baud} {timing.char_format}')

    def hears(self, protocol: str, timing: Timing) -> bool:
        """Whether it hears a master: not in master-slave operation on RS-485 [M4 §2.3.2]."""
        return self.variant.interface == 'rs232' or not self.memory.raw(_MASTER_SLAVE)

    def note_frame(self) -> None:
        """Record a valid frame: the cause of a PC time-out is gone."""
        self._silence = 0.0
        self.faults.end_cause(PC_TIMEOUT)

    @property
    def _watches(self) -> bool:
        """Whether a silence of the line is a fault: where the line has a say."""
        return bool(self.memory.raw(_PC_TIMEOUT)) and self._commands.follows_line

    # ---- what it takes ----

    def write(self, key: str, raw: int) -> bool:
        """Take function bits and set-point, and start the factory setting."""
        if key == FACTORY_SETTING:
            self._start_factory_setting(raw)
        elif key == FUNCTION_BITS:
            self._take(key, raw, self._commands.mode == Mode.REMOTE_CONTROL)
        elif key == SETPOINT:
            self._take(key, raw, self._commands.follows_line)
        else:
            return False
        return True

    def validate(self, key: str) -> None:
        """Refuse a setting that needs what is not so; record the others."""
        needs = self.variant.settings_need
        if needs == 'output_off' and self.motor.driven:
            raise Nack(ReturnCode.NOT_INHIBITED, 'the motor is driven')
        if needs == 'inhibit' and not self._commands.now.inhibited:
            raise Nack(ReturnCode.NEEDS_INHIBIT, 'there is no controller inhibit')
        self.eeprom.before(key)

    def stored(self, key: str) -> None:
        """Record a setting that has a new value."""
        self.eeprom.after(key)
        self._commands.changed(key)

    def _take(self, key: str, raw: int, of_use: bool) -> None:
        if not of_use and self.variant.outside_remote_control == 'ignored':
            return
        if not of_use and self.variant.outside_remote_control == 'refused':
            raise Nack(ReturnCode.UNAUTHORIZED, f'{key} is of no use in this control mode')
        before = self._commands.bits
        self.memory.put(key, raw)
        if self._commands.bits & ~before & Bit.RESET:
            self.reset()

    def _start_factory_setting(self, raw: int) -> None:
        if raw and self.motor.driven:
            raise Nack(ReturnCode.NOT_INHIBITED, 'the motor is driven')
        if raw:
            self.factory_left = _FACTORY_TIME

    def _set_to_factory(self) -> None:
        for key, parameter in self.memory.model.items():
            if parameter.is_setting and key not in self.line_settings:
                self.memory.put(key, self.memory.factory_raw(key))
                self.stored(key)

    # ---- terminals and keypad ----

    @property
    def run_input(self) -> bool:
        """The terminal that is the enable from the factory."""
        return ENABLE in self.terminals.closed

    @run_input.setter
    def run_input(self, active: bool) -> None:
        self._switch(ENABLE, active)

    def switch(self, number: int, closed: bool) -> None:
        """Close or open a binary input (ValueError: there is no such input)."""
        self._switch(number, closed)
        self.settle()

    def _switch(self, number: int, closed: bool) -> None:
        before = self.terminals.on(Input.RESET)
        self.terminals.switch(number, closed)
        if self.terminals.on(Input.RESET) and not before:
            self.reset()

    def press(self, key: str) -> None:
        """Press a key of the keypad on X4: those for a direction count in manual operation."""
        if key in KEYS:
            self._commands.key = KEYS[key]
        elif key == 'reset':
            if self.memory.raw('special.keypad_reset'):
                self.reset()
        else:
            self.memory.put(MANUAL, _YES if key == 'manual' else 0)
            self.stored(MANUAL)
        self.settle()

    # ---- faults ----

    def reset(self) -> None:
        """Reset the faults whose cause is gone."""
        self.faults.acknowledge()

    def trip(self, code: int, *, cause_present: bool = False) -> None:
        """Let a fault happen, and remember it with what is measured."""
        new = code not in self.faults.codes
        super().trip(code, cause_present=cause_present)
        if new:
            words = {
                '': 100 * (code - FAULTS),
                'inverter_status': self.status_word,
                'terminal_status': self._terminal_word,
            }
            self._fault_memory.add(self.motor, self.ambient, words)
        if self.variant.bits_in_fault == 'cleared':
            self.memory.put(FUNCTION_BITS, 0)

    def _watch_external_fault(self) -> None:
        opened = self.terminals.opened(Input.NOT_EXTERNAL_FAULT)
        if opened and EXTERNAL_FAULT not in self.faults.codes:
            self.trip(EXTERNAL_FAULT, cause_present=True)
        if self._external_fault and not opened:
            self.faults.end_cause(EXTERNAL_FAULT)
        self._external_fault = opened

    @property
    def _resets_itself(self) -> bool:
        """Whether a fault is waiting for P861 to go by."""
        auto = bool(self.memory.raw('special.auto_reset'))
        return auto and bool(self.faults) and not self.faults.lasting

    # ---- what it does ----

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass, of silence too."""
        self._sequence.wait(dt)
        self._silence += dt
        lost = self._watches and self._silence >= self.memory.number(_PC_TIMEOUT)
        if lost and PC_TIMEOUT not in self.faults.codes:
            self.trip(PC_TIMEOUT, cause_present=True)
        self._without_cause = self._without_cause + dt if self._resets_itself else 0.0
        if self._without_cause >= self.memory.number('special.restart_time'):
            self.reset()
        if self.factory_left:
            self.factory_left = max(0.0, self.factory_left - dt)
            if not self.factory_left:
                self._set_to_factory()

    @property
    def settled(self) -> bool:
        """Whether nothing happens by the clock alone."""
        watches = self._watches and PC_TIMEOUT not in self.faults.codes
        return not (watches or self._sequence.waiting or self._resets_itself or self.factory_left)

    def settle(self) -> None:
        """Let the output stage do what is wanted, unless something keeps it off."""
        self._watch_external_fault()
        command = self._commands.now
        if command.parameters is not self._parameters:
            self._parameters = command.parameters
            self.motor.plate = self.nameplate()
        if command.inhibited or self.factory_left or (self.faults and not self._ramps_in_fault):
            self._sequence.off()
        else:
            self._sequence.follow(replace(command, enable=False) if self.faults else command)
        turns = self.motor.ramp or self.motor.demand
        if self.motor.driven and turns:
            self._clockwise = turns > 0

    def restart(self) -> None:
        """Begin as after power-on: from the EEPROM, with bits and set-point as the variant says."""
        self.initialised = False
        self.eeprom.restore()
        self._commands.changed(MANUAL)
        self.factory_left = 0.0
        self._sequence.off()
        if self.variant.bits_after_power_on == 'cleared':
            self.memory.put(FUNCTION_BITS, 0)
            self.memory.put(SETPOINT, 0)

    def nameplate(self) -> Nameplate:
        """Return the data of a usual motor that fits the parameter set."""
        chosen, number = self._parameters, self.memory.number
        usual = Nameplate()
        return replace(
            usual,
            voltage=number(f'motor.voltage_{chosen.number}'),
            frequency=chosen.f_base,
            speed=60 * (1 - _SLIP) * chosen.f_base / number(f'motor.pole_pairs_{chosen.number}'),
            limit=usual.current * number(f'motor.i_max_{chosen.number}') / 100,
        )

    @property
    def _ramps_in_fault(self) -> bool:
        """Whether the fault lets the motor ramp down first, and it still does."""
        alone = self.faults.codes == [PC_TIMEOUT]
        return alone and self.variant.timeout_stop == 'ramps' and self._sequence.moving

    # ---- what it shows ----

    def show(self, key: str) -> int | None:
        """Return the raw number of what is measured, of a status, or of a remembered fault."""
        if key in DISPLAYS:
            return DISPLAYS[key](self.motor)
        if key == 'status.heat_sink_temperature':
            return heat_sink(self.motor, self.ambient)
        if key == 'fieldbus.inverter_status':
            return self.status_word
        if key == 'status.terminals':
            return self._terminal_word
        if key == 'status.options':
            x20, x21 = CARDS[self.variant.option_card]
            return x20 << 16 | x21 << 8
        if key == 'status.manual_control_word':
            return _KEY_BITS[self._commands.key] if self._commands.manual else 0
        if key == FACTORY_SETTING:
            return _YES if self.factory_left else 0
        return self._fault_memory.raw(key)

    @property
    def number(self) -> int:
        """The inverter status."""
        command = self._commands.now
        if command.inhibited or self.factory_left or (self.faults and not self._sequence.moving):
            return Number.INHIBIT
        number = self._sequence.number
        stops = number in (Number.NO_ENABLE, Number.NORMAL_STOP)
        if stops and command.enable and not command.direction:
            return _STOPPED.get(self.variant.stop_status, number)
        return number

    @property
    def status_code(self) -> int:
        """The fault if one is active, else the inverter status."""
        return int(self.faults.shown or self.number)

    @property
    def status_word(self) -> int:
        """Index 284: fault, status, option cards and flags, a byte each."""
        fault = self.faults.shown - FAULTS if self.faults else 0
        x20, x21 = CARDS[self.variant.option_card]
        flags = Flag.VOLTAGE_SIGNAL
        flags |= Flag.SECOND_SET if self._second_set else Flag(0)
        flags |= Flag.CW if self._clockwise else Flag(0)
        shown = (self._coded(fault), self._coded(self.number), x21 << 4 | x20, flags)
        return int.from_bytes(bytes(shown), 'big')

    @property
    def _second_set(self) -> bool:
        return self._commands.now.parameters.number == 2

    def _coded(self, number: int) -> int:
        """Return a number as a byte shows it: binary, or as two decimal digits [C105]."""
        return int(str(number), 16) if self.variant.status_numbers == 'bcd' else number

    @property
    def _terminal_word(self) -> int:
        return self.terminals.word(frozenset(self._outputs()))

    def _outputs(self) -> Iterator[Output]:
        driven, fault = self.motor.driven, bool(self.faults)
        yield Output.FIELD_ON if driven else Output.FIELD_OFF
        yield Output.BRAKE_RELEASED if driven else Output.BRAKE_APPLIED
        if not fault:
            yield Output.READY
            yield Output.NOT_FAULT
        if self._commands.manual:
            yield Output.MANUAL
        if self._second_set:
            yield Output.SECOND_SET
        if self.motor.reached:
            yield Output.AT_SETPOINT
        if not self.motor.frequency:
            yield Output.STANDING

    def report(self) -> dict[str, Any]:
        """Return what it shows and what is wanted of it."""
        command = self._commands.now
        return {
            'mode': int(self._commands.mode),
            'manual': self._commands.manual,
            'inv_st': self.status_code,
            'inv_st_text': self.memory.model.status_code(self.status_code).text,
            'status_word': self.status_word,
            'phase': self._sequence.phase.name.lower(),
            'function_bits': self.memory.raw(FUNCTION_BITS),
            'setpoint': self.memory.get(SETPOINT),
            'enable': command.enable,
            'inhibited': command.inhibited,
            'direction': command.direction,
            'terminals': {
                str(number): number in self.terminals.closed for number in self.terminals.inputs
            },
        }
