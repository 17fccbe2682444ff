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

"""Which settings of a drive are not changed over the bus, and what follows from a change."""

from __future__ import annotations

from collections.abc import Mapping

from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive.inverter import Inverter

#: The driver's own setting that goes with each setting of the line.
FOLLOWERS = {
    'serial.bus_type': 'protocol',
    'serial.address': 'address',
    'serial.si_baud': 'baud_rate',
    'serial.si_prot': 'char_format',
}
#: From this firmware on the codes of SiProt mean what the catalog says; before it code 1 is
#: another format ([C3], [C5]).
_KNOWN_SI_PROT = 4.28


def why_not(key: str, inverter: Inverter) -> str:
    """Return why a setting may not be changed, ``''`` if it may."""
    settings = inverter.settings
    if settings.control_method == 'monitor':
        return 'control_method is monitor: this driver only reads'
    if inverter.tuning:
        return 'the drive is tuning: wait for its end, or stop it'
    if not key.startswith('serial.'):
        return ''
    if not settings.allow_communication_changes:
        return (
            'communication settings are not changed unless allow_communication_changes is true, '
            'for the driver may lose the drive'
        )
    firmware = inverter.identity.firmware if inverter.identity else 0.0
    if key == 'serial.si_prot' and firmware < _KNOWN_SI_PROT:
        return (
            f'what its codes mean in firmware {firmware:.2f} is not known for sure: '
            'change it at the keypad'
        )
    return ''


def after_change(changed: Mapping[str, Value]) -> str:
    """Return how to follow a drive to new settings of the line, ``''`` if none was changed."""
    follow = [f'{FOLLOWERS[key]} ({value})' for key, value in changed.items() if key in FOLLOWERS]
    if not follow:
        return ''
    return (
        'the drive uses the new settings of the line from its next power-up on, or at once: '
        f'then start this driver with the {" and ".join(follow)} that it has'
    )
