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
How a Sinus H is commanded: by telegram 1, through a PLC on PROFINET [M3].

Every word has bit 10 set, for without it all of it is ignored. OperationDisable stops the motor as
ADV-8 says; out of S4 there is no other way than that, QuickStop and CoastStop [C107].
"""

from __future__ import annotations

from nfo_sinus_driver.catalog.profile import Profile
from nfo_sinus_driver.catalog.profile import Read
from nfo_sinus_driver.catalog.profile import Steps
from nfo_sinus_driver.catalog.profile import Until
from nfo_sinus_driver.catalog.status import Role
from nfo_sinus_driver.catalog.status import State
from nfo_sinus_driver.families._telegram1 import method
from nfo_sinus_driver.families._telegram1.method import Telegram1
from nfo_sinus_driver.families.sinus_h import words
from nfo_sinus_driver.families.sinus_h.words import Control

#: SwitchOFF, which leads to S2.
_OFF = (
    Control.NO_COAST_STOP
    | Control.NO_QUICK_STOP
    | Control.ENABLE_RAMP
    | Control.UNFREEZE_RAMP
    | Control.ENABLE_SETPOINT
    | Control.CONTROL_BY_PLC
)
#: SwitchON, or OperationDisable: S3. OperationEnable: S4.
_ON = _OFF | Control.ON
_RUN = _ON | Control.ENABLE_OPERATION


class HTelegram1(Telegram1):
    """Control by telegram 1: switched on, then enabled."""

    coasts = True
    caution = (
        'at its keypad set PRT-12 Lost Cmd Mode to Free-Run or Dec (from the factory it is None, '
        'and the motor runs on), and PRT-13 to the time after which it does that'
    )
    ready = int(_OFF)
    runs = int(Control.ENABLE_OPERATION)

    def take_control(self) -> Steps[None]:
        """Go to S2, from S4 by way of S3."""
        word = int((yield Read(method.STATUS)))
        if words.state_of(word) is State.OPERATION_ENABLED:
            yield method.begin(int(_ON))
            yield Until(lambda status: status.state is not State.OPERATION_ENABLED)
        yield method.begin(self.ready)
        yield Until(
            lambda status: status.state is State.READY_TO_SWITCH_ON and status.from_bus
        )

    def run(self) -> Steps[None]:
        """SwitchON, then OperationEnable when the drive shows S3."""
        yield method.following(int(_ON))
        yield Until(lambda status: status.state is State.SWITCHED_ON)
        yield method.following(int(_RUN), once=True)

    def standing(self, word: int) -> int:
        """Return OperationDisable where it may be in S4, which SwitchOFF does not leave."""
        state = words.state_of(word)
        return int(_ON) if state in (State.OPERATION_ENABLED, State.SWITCHED_ON) else self.ready

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Release the motor at once, by CoastStop; control is kept."""
        yield method.begin(int(_OFF & ~Control.NO_COAST_STOP))


PROFILE = Profile(
    title='Sinus H',
    status_word=words.STATUS_WORD,
    holders={},
    methods={'telegram1': HTelegram1},
    setpoints=method.setpoints(327.67, forward_only=True),
    in_charge=method.in_charge,
    writes_and_reads=True,
    most={Role.ACTUAL_FREQUENCY: 327.67},
)
