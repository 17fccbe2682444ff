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
Run commands of a G2, and the control words that they are translated to.

[M0 §7.2] says that MODE and SCMD are translated for the generic state machine; the words here
are ours, since the manual does not print its own.
"""

from __future__ import annotations

from collections.abc import Mapping

from nfo_sinus_driver.families.sinus_g2.words import Control
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.sinus.control_unit import TERMINAL_SHARE

#: The motor is released: MODE = Stop.
RELEASED = Control(0)
#: Ready, waiting for a run command. From a run it stops the motor as StMode says.
STANDBY = Control.ENABLE_VOLTAGE | Control.DISABLE_QUICK_STOP | Control.AUTO_INIT
#: Runs, but for the direction.
RUNNING = (
    STANDBY | Control.SWITCH_ON | Control.ENABLE_RFG | Control.UNLOCK_RFG | Control.USE_REF_FOR_RFG
)

#: SCMD codes that run the motor.
RUN_COMMANDS = frozenset(code for code in Scmd if code & 1 and code < Scmd.FULL_TUNING)

#: The references that do not come over the bus, as shares of the nominal value.
_ANALOG_SHARE = 0.6
_FIXED_SHARES = (0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)


def local_share(code: int, fixed: Mapping[int, float]) -> float:
    """
    Return the reference of an SCMD run code other than Fieldbus, as a share of the nominal value.

    :param fixed: shares that the drive's own fixed references (1 to 7) have, where it has them.
    """
    if code in (Scmd.TERMINAL, Scmd.OP_MODE):
        return TERMINAL_SHARE
    sign = -1 if code & 4 else 1
    number = code >> 3
    if number == 0:
        return sign * _ANALOG_SHARE
    return sign * fixed.get(number, _FIXED_SHARES[number - 1])
