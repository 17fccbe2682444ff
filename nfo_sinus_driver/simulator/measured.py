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

"""What a simulated drive measures and counts: the group Status ([M0 table 4], [M1])."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass

from nfo_sinus_driver.catalog import Parameter
from nfo_sinus_driver.simulator.motor import Motor

_HOUR = 3600.0


@dataclass
class Counters:
    """
    The counters of a drive that has worked for a while; a power cycle does not reset them.

    :ivar op_time: hours live.
    :ivar rn_time: hours running.
    :ivar br_time: seconds with the brake chopper on.
    :ivar e_out: energy since the last reset (kWh).
    :ivar sigma_e_out: energy altogether (kWh).
    """

    op_time: float = 1234.5
    rn_time: float = 321.0
    br_time: float = 12.0
    e_out: float = 1.234
    sigma_e_out: float = 1520.0

    def advance(self, dt: float, motor: Motor) -> None:
        """Count ``dt`` seconds of what the motor does."""
        self.op_time += dt / _HOUR
        if motor.driven:
            self.rn_time += dt / _HOUR
            energy = max(motor.power, 0.0) / 1000 * dt / _HOUR
            self.e_out += energy
            self.sigma_e_out += energy
        if motor.chopper:
            self.br_time += dt

    def carry(self, parameter: Parameter) -> bool:
        """Let a counter go on to where its low word begins anew; ``False`` if it is none."""
        name = parameter.key.removeprefix('status.')
        if name not in self.__dict__:
            return False
        factor = float(parameter.factor('classic'))
        high = round(getattr(self, name) / factor) >> 16
        setattr(self, name, (high + 1 << 16) * factor)
        return True


def _process(motor: Motor) -> float:
    """The process that PI-Reg holds: 100 units at nominal speed, at once."""
    return 100 * abs(motor.frequency) / motor.plate.frequency


def _rpm(motor: Motor) -> float:
    return 60 * motor.demand / motor.plate.pole_pairs


#: In engineering units, by key.
_MEASURED: Mapping[str, Callable[[Motor, Counters], float]] = {
    'status.u_rms': lambda motor, _: motor.voltage,
    'status.i_rms': lambda motor, _: motor.current,
    'status.p_out': lambda motor, _: motor.power,
    'status.pf': lambda motor, _: motor.power_factor,
    'status.dc_link': lambda motor, _: motor.dc_link,
    'status.frq_act': lambda motor, _: motor.frequency,
    'status.spd_act': lambda motor, _: motor.speed,
    'status.trq_act': lambda motor, _: 100 * motor.torque,
    'status.reg_act': lambda motor, _: _process(motor),
    'status.pt1000': lambda motor, _: 25 + 0.6 * motor.temperature,
    'status.m_temp': lambda motor, _: motor.temperature,
    # of the Optimal: what it follows, and nothing while the motor is off
    'status.control_freq': lambda motor, _: motor.demand if motor.driven else 0.0,
    'status.control_speed': lambda motor, _: _rpm(motor) if motor.driven else 0.0,
    'status.op_time': lambda _, counters: counters.op_time,
    'status.rn_time': lambda _, counters: counters.rn_time,
    'status.br_time': lambda _, counters: counters.br_time,
    'status.e_out': lambda _, counters: counters.e_out,
    'status.sigma_e_out': lambda _, counters: counters.sigma_e_out,
}


def measure(
    parameter: Parameter, protocol: str, motor: Motor, counters: Counters
) -> int | None:
    """Return what ``protocol`` carries of a measured parameter; ``None`` for a stored one."""
    function = _MEASURED.get(parameter.key)
    if function is None:
        return None
    raw = round(function(motor, counters) / float(parameter.factor(protocol)))
    codec = parameter.at(protocol).number
    return min(max(raw, codec.minimum), codec.maximum)
