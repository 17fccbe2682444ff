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

"""What a simulated drive measures and counts, whatever its family calls it."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass

from nfo_sinus_driver.catalog import Parameter
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.simulator.motor import Motor

_HOUR = 3600.0


@dataclass
class Counters:
    """
    The counters of a drive that has worked for a while; a power cycle does not reset them.

    :ivar operating_time: hours live.
    :ivar running_time: hours running.
    :ivar brake_time: seconds with the brake chopper on.
    :ivar energy: since the last reset (kWh).
    :ivar total_energy: altogether (kWh).
    """

    operating_time: float = 1234.5
    running_time: float = 321.0
    brake_time: float = 12.0
    energy: float = 1.234
    total_energy: float = 1520.0

    def advance(self, dt: float, motor: Motor) -> None:
        """Count ``dt`` seconds of what the motor does."""
        self.operating_time += dt / _HOUR
        if motor.driven:
            self.running_time += dt / _HOUR
            energy = max(motor.power, 0.0) / 1000 * dt / _HOUR
            self.energy += energy
            self.total_energy += energy
        if motor.chopper:
            self.brake_time += dt

    def carry(self, role: Role | None, factor: float) -> bool:
        """
        Let a counter go on to where its low word begins anew; ``False`` if it is none.

        :param factor: how much one count of its low word is.
        """
        if role is None or role.value not in self.__dict__:
            return False
        high = round(getattr(self, role.value) / factor) >> 16
        setattr(self, role.value, (high + 1 << 16) * factor)
        return True


def _process(motor: Motor) -> float:
    """The process that a regulator holds: 100 units at nominal speed, at once."""
    return 100 * abs(motor.frequency) / motor.plate.frequency


#: In engineering units, by what it is to the driver.
_MEASURED: Mapping[Role, Callable[[Motor, Counters], float]] = {
    Role.OUTPUT_VOLTAGE: lambda motor, _: motor.voltage,
    Role.OUTPUT_CURRENT: lambda motor, _: motor.current,
    Role.OUTPUT_POWER: lambda motor, _: motor.power,
    Role.POWER_FACTOR: lambda motor, _: motor.power_factor,
    Role.DC_LINK_VOLTAGE: lambda motor, _: motor.dc_link,
    Role.ACTUAL_FREQUENCY: lambda motor, _: motor.frequency,
    Role.ACTUAL_SPEED: lambda motor, _: motor.speed,
    Role.ACTUAL_TORQUE: lambda motor, _: 100 * motor.torque,
    Role.ACTUAL_PROCESS_VALUE: lambda motor, _: _process(motor),
    Role.PT1000_TEMPERATURE: lambda motor, _: 25 + 0.6 * motor.temperature,
    Role.MOTOR_TEMPERATURE: lambda motor, _: motor.temperature,
    Role.OPERATING_TIME: lambda _, counters: counters.operating_time,
    Role.RUNNING_TIME: lambda _, counters: counters.running_time,
    Role.BRAKE_TIME: lambda _, counters: counters.brake_time,
    Role.ENERGY: lambda _, counters: counters.energy,
    Role.TOTAL_ENERGY: lambda _, counters: counters.total_energy,
}


def measure(
    role: Role | None, parameter: Parameter, protocol: str, motor: Motor, counters: Counters
) -> int | None:
    """Return what ``protocol`` carries of a measured parameter; ``None`` for a stored one."""
    function = _MEASURED.get(role) if role else None
    if function is None:
        return None
    return nearest(parameter, function(motor, counters), protocol)


def nearest(parameter: Parameter, value: float, protocol: str) -> int:
    """Return the number that ``protocol`` carries for a value, the nearest it can."""
    raw = round(value / float(parameter.factor(protocol)))
    codec = parameter.at(protocol).number
    return min(max(raw, codec.minimum), codec.maximum)
