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


"""The ways into a drive: which protocol, dialect and model a test is run over."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from nfo_sinus_driver.catalog import Protocol

#: What only some of the ways have, and why the others go without; see :func:`needs`.
WITHOUT = {
    'rtu': 'it reads frames of Modbus RTU by hand',
    'modbus': 'it is about requests of Modbus',
    'serial': 'it is about a serial port',
    'fine': 'its values are finer than the steps of Classic',
    'fast': 'this dialect knows no more than 9600 bit/s',
    'parameters': 'this model has no drive parameters',
    'states': 'this model has no state machine that the words of the test are about',
    'identity': 'this way has no question who the drive is',
}


@dataclass(frozen=True)
class Way:
    """
    One way in.

    :ivar baud_rate: bit/s, of both ends.
    :ivar dialect: the manual that describes the Classic protocol; of the simulator.
    :ivar features: those of :data:`WITHOUT` that it has.
    """

    name: str
    protocol: str
    features: frozenset[str]
    model: str = 'sinus_g2'
    dialect: str = ''
    baud_rate: int = 57600

    @property
    def bus(self) -> Protocol:
        """How parameters are addressed."""
        return Protocol.CLASSIC if self.protocol == 'classic' else Protocol.MODBUS

    @property
    def simulator(self) -> dict[str, str | int]:
        """The settings of a simulated line, as `Simulator` names them."""
        settings: dict[str, str | int] = {
            'protocol': self.protocol, 'model': self.model, 'baud': self.baud_rate
        }
        return {**settings, 'dialect': self.dialect} if self.dialect else settings

    @property
    def driver(self) -> dict[str, str | int]:
        """The settings of the driver."""
        settings: dict[str, str | int] = {
            'protocol': self.protocol, 'model': self.model, 'baud_rate': self.baud_rate
        }
        # v2.03 is what a driver takes a drive for that is not said to be older
        return {**settings, 'classic_dialect': 'v5.0'} if self.dialect == '5.0' else settings


_G2 = frozenset(('fast', 'parameters', 'states'))
_MODBUS = frozenset(('modbus', 'fine', 'identity'))
_SERIAL = frozenset(('serial',))
_RTU = frozenset(('rtu',))

WAYS = {
    way.name: way
    for way in (
        Way('modbus_rtu', 'modbus_rtu', _G2 | _MODBUS | _SERIAL | _RTU),
        Way('modbus_ascii', 'modbus_ascii', _G2 | _MODBUS | _SERIAL),
        Way('modbus_tcp', 'modbus_tcp', _G2 | _MODBUS),
        Way('classic_v2', 'classic', _G2 | _SERIAL, dialect='2.03'),
        Way('classic_v5', 'classic', _G2 - {'fast'} | _SERIAL, dialect='5.0', baud_rate=9600),
        Way('optimal_rtu', 'modbus_rtu', _MODBUS | _SERIAL | {'fast'}, 'sinus_optimal'),
        Way('optimal_ascii', 'modbus_ascii', _MODBUS | _SERIAL | {'fast'}, 'sinus_optimal'),
    )
}
DEFAULT = 'modbus_rtu'


def needs(*features: str) -> pytest.MarkDecorator:
    """Mark a test, or a module, that makes sense only over ways with all of these features."""
    assert WITHOUT.keys() >= set(features), features
    return pytest.mark.needs(*features)


def why_not(way: Way, features: tuple[str, ...]) -> str:
    """Return why a test with a mark is not run over a way; ``''``: it is."""
    missing = [feature for feature in features if feature not in way.features]
    return f'not over {way.name}: {WITHOUT[missing[0]]}' if missing else ''
