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

"""Which control method there is for which model and settings."""

from __future__ import annotations

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.drive.control_method import ControlMethod
from nfo_sinus_driver.drive.drive_control import DriveControl
from nfo_sinus_driver.drive.drive_control import OptimalDriveControl
from nfo_sinus_driver.drive.inverter import Inverter
from nfo_sinus_driver.drive.mode_scmd import ModeScmd
from nfo_sinus_driver.drive.mode_scmd import ModeSmode
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.drive.settings import DriveSettings
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.families.sinus_optimal import words as words_optimal

#: The run command that each reference has; the fixed ones are made of their number.
_COMMANDS = {
    'fieldbus': Scmd.FIELDBUS,
    'terminal': Scmd.TERMINAL,
    'op_mode': Scmd.OP_MODE,
    'analog': Scmd.ANALOG_F,
    'analog_reverse': Scmd.ANALOG_R,
    **{f'fix{number}': Scmd[f'FIX_{number}_F'] for number in range(1, 8)},
    **{f'fix{number}_reverse': Scmd[f'FIX_{number}_R'] for number in range(1, 8)},
}


def make_control_method(settings: DriveSettings, registers: Registers) -> ControlMethod:
    """Return the way to command a drive as its settings say; there is none for ``monitor``."""
    optimal = settings.model == 'sinus_optimal'
    if settings.control_method == 'drive_control':
        if optimal:
            return OptimalDriveControl(registers)
        return DriveControl(registers, local_reference=not settings.follows_setpoints)
    # the two commands that the Optimal has are the same numbers on both
    method = ModeSmode if optimal else ModeScmd
    return method(registers, _COMMANDS[settings.reference])


async def method_in_charge(inverter: Inverter, registers: Registers, priority: Priority) -> str:
    """
    Return by which control method the bus has control of a drive, from whom was here before.

    On the Optimal what one has started the other does not stop ([M1] forbids to mix them).

    :param inverter: what was seen of the drive last.
    :returns: ``mode_scmd`` where the bus has no control.
    """
    if inverter.model.name == 'sinus_optimal':
        word = int(await registers.read_number('fieldbus.drive_control', priority))
        by_word = bool(word & words_optimal.Control.SWITCH_ON)
    elif inverter.seen is None or not inverter.seen.from_bus:
        by_word = False
    else:
        by_word = await registers.read('fieldbus.mode', priority) != Mode.BUS
    return 'drive_control' if by_word else 'mode_scmd'
