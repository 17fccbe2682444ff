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

"""What a simulated machine keeps: the parameters of the catalog, and those that this leaves out."""

from __future__ import annotations

from dataclasses import replace

from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import load_family

#: What the simulation needs of any drive.
_NEEDED = (
    'motor.p_nom',
    'motor.u_nom',
    'motor.f_nom',
    'motor.n_nom',
    'motor.i_nom',
    'motor.i_magn',
    'motor.i_limt',
    'motor.r_stat',
    'control.mode',
    'control.accel',
    'control.retard',
    'control.run_dly',
    'control.st_mode',
    'control.auto_start',
    'control.f_sleep',
    'serial.bus_type',
    'serial.address',
    'serial.si_baud',
    'serial.si_prot',
    'serial.sio_tot',
    'serial.auto_reset',
    'serial.auto_stop',
)
#: [M1] speaks of a Frequency mode and a Speed mode.
_OPTIMAL_MODES = {0: 'Freque', 3: 'Speed'}


def machine_of(model: Family) -> Family:
    """
    Return the model with every parameter that a simulated machine of it needs.

    No manual lists the settings of the Optimal [C58], though it has some: those that the
    simulation needs are taken from the G2. They are at its keypad only, and no bus reaches them.
    """
    if all(key in model for key in _NEEDED):
        return model
    g2 = load_family('sinus_g2')
    hidden = {key: g2[key] for key in _NEEDED}
    hidden['control.mode'] = replace(hidden['control.mode'], labels=_OPTIMAL_MODES)
    return replace(model, parameters={**hidden, **model})
