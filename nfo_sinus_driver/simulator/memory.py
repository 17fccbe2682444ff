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

"""
The parameter memory of a simulated drive: raw numbers by catalog key, and what they may be.

A raw number is the one that Modbus carries, the finer of the two scalings [C14], or the Classic
one where a parameter has no register.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
import math

from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Parameter
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.simulator.refusal import Reason
from nfo_sinus_driver.simulator.refusal import Refused

#: The factory settings that matter, in engineering units; everything else starts at 0 or at the
#: least value allowed. The motor is a 1.5 kW one on 400 V; no manual prints these.
FACTORY: Mapping[str, Value] = {
    'motor.p_nom': 1.5,
    'motor.u_nom': 400,
    'motor.f_nom': 50,
    'motor.n_nom': 1440,
    'motor.i_nom': 3.4,
    'motor.cos_phi': 0.82,
    'motor.r_stat': 4.2,
    'motor.r_rot': 3.4,
    'motor.l_main': 0.36,
    'motor.sigma': 0.08,
    'motor.i_magn': 1.8,
    'motor.i_limt': 5.1,
    'control.mode': 'Freque',
    'control.accel': 5.0,
    'control.retard': 5.0,
    'control.ain_set': '0-10V',
    'control.auto_start': False,
    'control.st_mode': 'Brake',
    'control.kp_spd': 2.0,
    'control.ti_spd': 0.2,
    'serial.bus_type': 'MbusRtu',
    'serial.address': 1,
    'serial.si_baud': '19200bps',
    'serial.si_prot': '8b Ep 1s',
    'serial.sio_tot': 0,
    'serial.auto_reset': False,
    'serial.auto_stop': False,
    'pi_reg.reg_amp': 1,
    'freque.op_mode': 'Terminal',
    'freque.f_fix1': 10,
    'freque.f_fix2': 15,
    'freque.f_fix3': 20,
    'freque.f_fix4': 25,
    'freque.f_fix5': 30,
    'freque.f_fix6': 40,
    'freque.f_fix7': 50,
    'freque.fr_max': 50,
    'fieldbus.sw_ver': 4.38,
    'fieldbus.nfo_ver': 4018,
    'fieldbus.spd_scl_numerator': 1,
    'fieldbus.spd_scl_denominator': 1,
}


def home(parameter: Parameter) -> str:
    """Return the protocol whose raw number the memory keeps."""
    return 'modbus' if 'modbus' in parameter.addresses else 'classic'


def convert(parameter: Parameter, raw: int, protocol: str) -> int:
    """Return the number that ``protocol`` carries for one of the memory, the nearest it can."""
    source = home(parameter)
    if protocol is source:
        return raw
    exact = raw * parameter.factor(source) / parameter.factor(protocol)
    codec = parameter.at(protocol).number
    return min(max(math.floor(exact + Fraction(1, 2)), codec.minimum), codec.maximum)


class Memory:
    """
    The parameters of one drive, as raw numbers.

    :param model: the drive family, with all that a machine of it keeps.
    :param settings: values other than the factory's, in engineering units, by key.
    :raises ValueError: an unknown key, or a value that the drive would refuse.
    """

    def __init__(self, model: Family, settings: Mapping[str, Value]) -> None:
        self.model = model
        self._factors = {
            key: float(parameter.factor(home(parameter))) for key, parameter in model.items()
        }
        self._raw = {key: self._least(parameter) for key, parameter in model.items()}
        for key, value in FACTORY.items():
            if key in model:
                self.set(key, value)
        self._factory = dict(self._raw)
        for key, value in settings.items():
            self.set(key, value)

    def raw(self, key: str) -> int:
        """Return the raw number of a parameter."""
        return self._raw[key]

    def put(self, key: str, raw: int) -> None:
        """Store a raw number, unchecked."""
        self._raw[key] = raw

    def factory_raw(self, key: str) -> int:
        """Return the raw number that a parameter leaves the factory with."""
        return self._factory[key]

    def get(self, key: str) -> Value:
        """Return a parameter in engineering units."""
        parameter = self.model[key]
        return self.show(parameter, self._raw[key])

    def number(self, key: str, default: float = 0.0) -> float:
        """Return a numeric parameter; ``default`` when this model's table lacks it."""
        raw = self._raw.get(key)
        return default if raw is None else raw * self._factors[key]

    def set(self, key: str, value: Value) -> None:
        """
        Store a value in engineering units, as someone at the keypad would.

        :raises ValueError: an unknown key, or a value that the drive would refuse.
        """
        if key not in self.model:
            raise ValueError(f'{self.model.name} has no parameter {key!r}')
        parameter = self.model[key]
        data = parameter.encode(value, home(parameter))
        self._raw[key] = parameter.at(home(parameter)).number.decode(data)

    @staticmethod
    def show(parameter: Parameter, raw: int) -> Value:
        """Turn a raw number of this memory into engineering units."""
        protocol = home(parameter)
        return parameter.decode(parameter.at(protocol).number.encode(raw), protocol)

    @staticmethod
    def check(parameter: Parameter, raw: int) -> None:
        """
        Refuse a raw number that the manual does not allow.

        :raises Refused: VALUE.
        """
        if parameter.labels:
            if raw not in parameter.labels:
                raise Refused(Reason.VALUE, f'{parameter.key} has no code {raw}')
            return
        value = raw * parameter.factor(home(parameter))
        low = parameter.minimum is not None and value < parameter.minimum
        high = parameter.maximum is not None and value > parameter.maximum
        if low or high:
            raise Refused(Reason.VALUE, f'{parameter.key} = {float(value):g} is out of range')

    @staticmethod
    def _least(parameter: Parameter) -> int:
        """The raw number to start with: 0, or what is allowed and nearest to it."""
        if parameter.labels:
            return 0 if 0 in parameter.labels else min(parameter.labels)
        low = parameter.minimum
        if low is None or low <= 0:
            return 0
        return -int(-Fraction(low) / parameter.factor(home(parameter)) // 1)


class RegisterMap:
    """Which holding registers belong to which parameter [M0 table 4, table 5]."""

    def __init__(self, model: Family) -> None:
        self._by_base = {
            parameter.at('modbus').index: parameter
            for parameter in model.values()
            if 'modbus' in parameter.addresses
        }
        # the manual of the Optimal tells of none
        self._log = model.error_logs.get('modbus')

    def log_entry(self, register: int, count: int) -> int | None:
        """
        Return which entry of the error log stands at ``register``; ``None`` if it is none.

        :raises Refused: ADDRESS; not exactly one entry.
        """
        entry, rest = divmod(register - self._log.first, self._log.stride) if self._log else (-1, 0)
        if self._log is None or not 0 <= entry < self._log.limit:
            return None
        if rest or 2 * count != self._log.codec.size:
            raise Refused(Reason.ADDRESS, f'no entry of the error log is at {register:04X}h')
        return entry

    def find(self, register: int, count: int) -> Parameter:
        """
        Return the parameter that stands at ``register`` and has exactly ``count`` of them.

        One parameter in one message, the whole of it [M0 §6.2.3].

        :raises Refused: ADDRESS; nothing there, a part of a parameter, or more than one.
        """
        parameter = self._by_base.get(register)
        if parameter is None:
            raise Refused(Reason.ADDRESS, f'no parameter begins at register {register:04X}h')
        whole = parameter.at('modbus').codec.size // 2
        if count != whole:
            raise Refused(Reason.ADDRESS, f'{parameter.key} takes {whole} registers, not {count}')
        return parameter
