# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What terminals, line and keypad want of a MOVITRAC 31.., and which counts (P841, P870)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.movitrac31.codes import Bit, Input, Mode
from nfo_sinus_driver.simulator.movitrac31.parameter_set import ParameterSet, parameter_set
from nfo_sinus_driver.simulator.movitrac31.terminals import Terminals

FUNCTION_BITS = 'fieldbus.function_bits'
SETPOINT = 'fieldbus.remote_setpoint'
CONTROL_MODE = 'serial.control_mode'
MANUAL = 'serial.manual_operation'
_SETS = 'motor.enable_set_selection'

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


class Commands:
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
        """Take note that a setting has a new value; the keypad begins with no direction."""
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
        parameters = self._parameters()
        inhibited = self._terminals.opened(Input.NOT_INHIBIT) or bool(self.bits & Bit.INHIBIT)
        if self.manual:
            keypad = parameters.limited(_KEYPAD_SHARE * parameters.f_max)
            return Command(True, inhibited, self.key, keypad, parameters)
        if self.mode == Mode.FIELDBUS:
            # the simulated drive has none
            return Command(False, inhibited, 0, 0.0, parameters)
        turns = self._wanted(Bit.CW, Input.CW) - self._wanted(Bit.CCW, Input.CCW)
        setpoint = self._memory.number(SETPOINT) if self.follows_line else self._local(parameters)
        limited = parameters.limited(setpoint)
        return Command(self._enabled(), inhibited, turns, limited, parameters)

    def _parameters(self) -> ParameterSet:
        selects = bool(self._memory.raw(_SETS))
        second = selects and self._wanted(Bit.SECOND_SET, Input.SECOND_SET)
        second_ramp = self._wanted(Bit.SECOND_RAMP, Input.SECOND_RAMP)
        return parameter_set(self._memory, 2 if second else 1, second_ramp)

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
