# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a MOVITRAC 31.. is commanded, and what its output stage does for it.

Which of terminals, line and keypad counts is set by P841 and P870.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.motor import Motor
from nfo_sinus_driver.simulator.movitrac31.parameters import (
    Bit,
    Input,
    Mode,
    Number,
    ParameterSet,
    Terminals,
)

FUNCTION_BITS = 'fieldbus.function_bits'
SETPOINT = 'fieldbus.remote_setpoint'
CONTROL_MODE = 'serial.control_mode'
MANUAL = 'serial.manual_operation'

#: The set-points of the analog input and of the keypad, as shares of the greatest frequency.
_ANALOG_SHARE = 0.5
_KEYPAD_SHARE = 0.2
#: Which directions the keys of the keypad give.
KEYS: Mapping[str, int] = {'cw': 1, 'ccw': -1, 'stop': 0}


@dataclass(frozen=True)
class Command:
    """
    What is wanted now.

    :ivar enable: the enable is there.
    :ivar inhibited: the controller inhibit is.
    :ivar direction: 1 is clockwise, -1 counter-clockwise; 0 where none or both are wanted.
    :ivar setpoint: the frequency to run at (Hz), within the limits of the parameter set.
    :ivar parameters: the parameter set that is chosen, with its ramps.
    """

    enable: bool
    inhibited: bool
    direction: int
    setpoint: float
    parameters: ParameterSet


class SerialCommands:
    """
    Joins what the terminals, the line and the keypad want.

    :param enable_bit: how the bit for the enable and the terminals go together.

    :ivar key: the direction that was last chosen at the keypad.
    """

    def __init__(self, memory: Memory, terminals: Terminals, enable_bit: str) -> None:
        self._memory = memory
        self._terminals = terminals
        self._enable_bit = enable_bit
        self.key = 0
        #: What the last command was made of, but for the settings.
        self._made_of: tuple[object, ...] = ()
        self._command: Command | None = None

    def changed(self, key: str) -> None:
        """Record that a setting has a new value; the keypad begins with no direction."""
        self._command = None
        if key == MANUAL:
            self.key = 0

    @property
    def mode(self) -> int:
        """The control mode, P841."""
        return round(self._memory.number(CONTROL_MODE))

    @property
    def manual(self) -> bool:
        """Whether the keypad has control, P870."""
        return bool(self._memory.raw(MANUAL))

    @property
    def bits(self) -> int:
        """The function bits, as far as they count: in the mode Remote control alone."""
        return self._memory.raw(FUNCTION_BITS) if self.mode == Mode.REMOTE_CONTROL else 0

    @property
    def follows_line(self) -> bool:
        """Whether the set-point comes from the line, or all of it does."""
        return self.mode in (Mode.REMOTE_SETPOINT, Mode.REMOTE_CONTROL)

    @property
    def now(self) -> Command:
        """What is wanted now."""
        raw = self._memory.raw
        made_of = (raw(FUNCTION_BITS), raw(SETPOINT), self._terminals.closed, self.key)
        if self._command is None or made_of != self._made_of:
            self._made_of = made_of
            self._command = self._made()
        return self._command

    def _made(self) -> Command:
        wanted = self._wanted
        selects = bool(self._memory.raw('motor.enable_set_selection'))
        second = selects and wanted(Bit.SECOND_SET, Input.SECOND_SET)
        second_ramp = wanted(Bit.SECOND_RAMP, Input.SECOND_RAMP)
        parameters = ParameterSet.of(self._memory, 2 if second else 1, second_ramp)
        inhibited = self._terminals.opened(Input.NOT_INHIBIT) or bool(self.bits & Bit.INHIBIT)
        if self.manual:
            keypad = parameters.limited(_KEYPAD_SHARE * parameters.f_max)
            return Command(True, inhibited, self.key, keypad, parameters)
        if self.mode == Mode.FIELDBUS:
            # the simulated drive has none
            return Command(False, inhibited, 0, 0.0, parameters)
        turns = wanted(Bit.CW, Input.CW) - wanted(Bit.CCW, Input.CCW)
        setpoint = self._memory.number(SETPOINT) if self.follows_line else self._local(parameters)
        limited = parameters.limited(setpoint)
        return Command(self._enabled(), inhibited, turns, limited, parameters)

    def _enabled(self) -> bool:
        terminal = self._terminals.on(Input.ENABLE)
        if self.mode != Mode.REMOTE_CONTROL:
            return terminal
        bit = bool(self.bits & Bit.ENABLE)
        if self._enable_bit == 'either':
            return terminal or bit
        return terminal and (bit or self._enable_bit == 'ored')

    def _local(self, parameters: ParameterSet) -> float:
        """Return the set-point of the terminals: a fixed one, or the analog input's (Hz)."""
        fixed = self._terminals.on(Input.FIXED_1) + 2 * self._terminals.on(Input.FIXED_2)
        if fixed:
            return self._memory.number(f'setpoint.n{parameters.number}{fixed}')
        return _ANALOG_SHARE * parameters.f_max

    def _wanted(self, bit: Bit, function: Input) -> bool:
        return bool(self.bits & bit) or self._terminals.on(function)


_OFF, _RUNNING = Number.NO_ENABLE, Number.ENABLE
_MOVING = frozenset({_RUNNING, Number.NORMAL_STOP, Number.RAPID_STOP, Number.DC_BRAKING})


class Sequence:
    """
    From standstill to a run and back: what the output stage does, in phases.

    :ivar phase: the one it is in, as the inverter status shows it.
    """

    def __init__(self, motor: Motor) -> None:
        self._motor = motor
        self.phase = _OFF
        #: Of magnetizing, before a run and after it (s).
        self._left = 0.0

    def off(self) -> None:
        """Switch the output stage off: the motor coasts."""
        self.phase = _OFF
        self._motor.release()

    def follow(self, command: Command) -> None:
        """Do what is wanted now."""
        parameters, motor = command.parameters, self._motor
        phase = self._next(command)
        if phase is not self.phase:
            times = {
                Number.START_MAGNETIZATION: parameters.premagnetization,
                Number.STOP_MAGNETIZATION: parameters.postmagnetization,
            }
            self._left = times.get(phase, 0.0)
            self.phase = phase
        if phase is _OFF:
            motor.release()
            return
        retards = {Number.RAPID_STOP: parameters.stop, Number.DC_BRAKING: parameters.dc_braking}
        motor.energise()
        motor.accel = parameters.up
        motor.retard = retards.get(phase, parameters.down)
        motor.demand = command.direction * command.setpoint if phase is _RUNNING else 0.0

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass."""
        self._left = max(0.0, self._left - dt)

    @property
    def waiting(self) -> bool:
        """Whether a phase goes on for a time."""
        return self._left > 0

    @property
    def moving(self) -> bool:
        """Whether it turns the motor, or stops it."""
        return self.phase in _MOVING

    @property
    def number(self) -> Number:
        """What the inverter status shows of it."""
        turns_over = self.phase is _RUNNING and self._motor.ramp * self._motor.demand < 0
        return Number.CHANGE_DIRECTION if turns_over else self.phase

    def _next(self, command: Command) -> Number:
        parameters = command.parameters
        if command.enable and command.direction:
            starts = self.phase is _OFF and parameters.premagnetization
            if starts or (self.phase is Number.START_MAGNETIZATION and self._left):
                return Number.START_MAGNETIZATION
            return _RUNNING
        if self.moving and not self._motor.at_zero:
            if not command.enable:
                return Number.RAPID_STOP
            return Number.DC_BRAKING if parameters.dc_braking else Number.NORMAL_STOP
        ends = self.moving and parameters.postmagnetization
        if ends or (self.phase is Number.STOP_MAGNETIZATION and self._left):
            return Number.STOP_MAGNETIZATION
        if command.enable:
            return Number.DC_HOLDING_CURRENT if parameters.holds else _OFF
        return Number.HEATING_CURRENT if parameters.heats else _OFF
