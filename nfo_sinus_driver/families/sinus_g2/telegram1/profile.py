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
How a G2 is commanded by telegram 1, through a PLC on PROFIBUS [M0 §6.3].

Nobody knows how the words of PROFIdrive are translated [C38]: they are taken for DriveControl and
DriveStatus, which they stand for [M0 §7.3, tables 14 to 16]. A G2 that has others gives no control
away by these, and so nothing runs.
"""

from __future__ import annotations

from nfo_sinus_driver.catalog.profile import Profile
from nfo_sinus_driver.catalog.profile import Steps
from nfo_sinus_driver.catalog.profile import Until
from nfo_sinus_driver.catalog.status import Fact
from nfo_sinus_driver.catalog.status import Role
from nfo_sinus_driver.catalog.status import State
from nfo_sinus_driver.families._telegram1 import method
from nfo_sinus_driver.families._telegram1.method import Telegram1
from nfo_sinus_driver.families._telegram1.method import Words
from nfo_sinus_driver.families.sinus_g2.words import STATUS_WORD
from nfo_sinus_driver.families.sinus_g2.words import Control
from nfo_sinus_driver.families.sinus_g2.words import Status
from nfo_sinus_driver.families.sinus_g2.words import state_of

_READY = (
    Control.ENABLE_VOLTAGE
    | Control.DISABLE_QUICK_STOP
    | Control.ENABLE_RFG
    | Control.UNLOCK_RFG
    | Control.USE_REF_FOR_RFG
    | Control.NET_CTRL
    | Control.NET_REF
)


class G2Telegram1(Telegram1):
    """Control by telegram 1: switched on, then enabled [C54]."""

    coasts = True
    ready = int(_READY)
    runs = int(Control.SWITCH_ON | Control.ENABLE_OP | Control.ENABLE_REV_OP)

    def take_control(self) -> Steps[None]:
        """Request control with bit 0 low, so that a run command is an edge later [C35]."""
        yield method.begin(self.ready)
        yield Until(lambda status: bool((status.word or 0) & self.control))

    def run(self) -> Steps[None]:
        """
        Switch on, then give the direction, each when the drive shows a state before it.

        The sign of the set-point reverses; both direction bits at once mean no change [C36].
        """
        yield Until(lambda status: status.state in (State.READY_TO_SWITCH_ON, State.STOPPING))
        yield method.following(self.ready | Control.SWITCH_ON, once=True)
        yield Until(lambda status: status.state in (State.SWITCHED_ON, State.STOPPING))
        run = self.ready | Control.SWITCH_ON | Control.ENABLE_OP
        yield method.following(int(run), once=True)

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Go to QUICK_STOP, which coasts [C96]; control is kept."""
        word = self.ready & ~Control.DISABLE_QUICK_STOP | Control.OVERRIDE_COAST
        yield method.begin(int(word))


PROFILE = Profile(
    title='NFO Sinus G2',
    status_word=Words(
        state=lambda word: state_of(word & 0xFFFF),
        # by the sign of the set-point it reverses under the forward run command, so that the bit
        # of the reverse one tells no direction
        by_bit={bit: fact & ~Fact.REVERSE for bit, fact in STATUS_WORD.by_bit.items()},
        by_state=STATUS_WORD.by_state,
        code=lambda word: method.code_of(word, state_of(word & 0xFFFF), fault=Status.FAULTED),
    ),
    holders={},
    methods={'telegram1': G2Telegram1},
    setpoints=method.setpoints(150.0),
    in_charge=method.in_charge,
    writes_and_reads=True,
    # a tenth above what a set-point may be, for a motor may be overhauled
    most={Role.ACTUAL_FREQUENCY: 165.0},
)
