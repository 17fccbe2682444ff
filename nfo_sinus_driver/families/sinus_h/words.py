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
The status word of the Sinus H [M3 §7.2].

Bits 1, 2, 4, 5 and 9 of ZSW1 come back as they were sent [C104]: that they stand says that the
drive has heard, and nothing of the motor, for which the actual value speaks.
"""

from __future__ import annotations

from nfo_sinus_driver.catalog.status import Fact
from nfo_sinus_driver.catalog.status import State
from nfo_sinus_driver.families._telegram1 import method
from nfo_sinus_driver.families._telegram1.method import Words
from nfo_sinus_driver.families._telegram1.profidrive import Status
from nfo_sinus_driver.families._telegram1.profidrive import state_of

STATUS_WORD = Words(
    state=state_of,
    by_bit={
        Status.READY_ON: Fact.READY,
        Status.FAULT: Fact.FAULT,
        Status.SWITCHING_ON_INHIBITED: Fact.SWITCH_ON_DISABLED,
        Status.WARNING: Fact.ALARM,
        Status.SETPOINT_REACHED: Fact.SETPOINT_REACHED,
        # the drive has received that the PLC commands it
        Status.CONTROL_REQUESTED: Fact.NETWORK_CONTROL,
    },
    # bit 2 is what the driver has commanded: with the state it tells that [C63]
    by_state={State.OPERATION_ENABLED: Fact.OPERATION_ENABLED},
    stateless=True,
    code=lambda word: method.code_of(
        word, state_of(word & 0xFFFF), fault=Status.FAULT, warning=Status.WARNING
    ),
    by_frequency=True,
    only_frequency=True,
)
