# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What terminals, line and keypad want of a MOVITRAC 31.., and which counts (P841, P870)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.movitrac31.codes import Bit
from nfo_sinus_driver.simulator.movitrac31.codes import Input
from nfo_sinus_driver.simulator.movitrac31.codes import Mode
from nfo_sinus_driver.simulator.movitrac31.parameter_set import ParameterSet
from nfo_sinus_driver.simulator.movitrac31.parameter_set import parameter_set
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
    """

    enable: bool
    inhibited: bool
    direction: int
    setpoint: float


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
        self._sets: dict[tuple[int, bool], ParameterSet] = {}

    def changed(self, key: str) -> None:
        """Take note that a setting has a new value; the keypad begins with no direction."""
        self._sets.clear()
        if key == MANUAL:
            self.key = 0

    @property
    def mode(self) -> Mode:
        """The control mode, P841."""
        return Mode(round(self._memory.number(CONTROL_MODE)))

    @property
    def manual(self) -> bool:
        """Whether the keypad has control, P870."""
        return bool(self._memory.raw(MANUAL))

    @property
    def bits(self) -> Bit:
        """The function bits, as far as they count: in the mode Remote control alone."""
        remote = self.mode is Mode.REMOTE_CONTROL
        return Bit(self._memory.raw(FUNCTION_BITS)) if remote else Bit(0)

    @property
    def follows_line(self) -> bool:
        """Whether the set-point comes from the line, or all of it does."""
        return self.mode in (Mode.REMOTE_SETPOINT, Mode.REMOTE_CONTROL)

    @property
    def second_set(self) -> bool:
        """Whether parameter set 2 is chosen."""
        return bool(self._memory.raw(_SETS)) and self._wanted(Bit.SECOND_SET, Input.SECOND_SET)

    @property
    def parameters(self) -> ParameterSet:
        """The parameter set that is chosen, with its ramps."""
        chosen = 1 + self.second_set, self._wanted(Bit.SECOND_RAMP, Input.SECOND_RAMP)
        if chosen not in self._sets:
            self._sets[chosen] = parameter_set(self._memory, *chosen)
        return self._sets[chosen]

    def now(self, parameters: ParameterSet) -> Command:
        """Return what is wanted now, with a parameter set."""
        inhibited = self._terminals.opened(Input.NOT_INHIBIT) or bool(self.bits & Bit.INHIBIT)
        if self.manual:
            keypad = parameters.limited(_KEYPAD_SHARE * parameters.f_max)
            return Command(True, inhibited, self.key, keypad)
        if self.mode is Mode.FIELDBUS:
            # the simulated drive has none
            return Command(False, inhibited, 0, 0.0)
        turns = self._wanted(Bit.CW, Input.CW) - self._wanted(Bit.CCW, Input.CCW)
        setpoint = self._memory.number(SETPOINT) if self.follows_line else self._local(parameters)
        return Command(self._enabled(), inhibited, turns, parameters.limited(setpoint))

    def _enabled(self) -> bool:
        terminal = self._terminals.on(Input.ENABLE)
        if self.mode is not Mode.REMOTE_CONTROL:
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
