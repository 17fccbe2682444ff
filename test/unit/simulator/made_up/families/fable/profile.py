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

"""What is to be known of a Fable beside its tables; nobody commands one."""

from __future__ import annotations

from nfo_sinus_driver.catalog.profile import Profile
from nfo_sinus_driver.catalog.profile import Status as DriveStatus
from nfo_sinus_driver.catalog.profile import Steps
from nfo_sinus_driver.catalog.status import Fact
from nfo_sinus_driver.catalog.status import StatusWord
from nfo_sinus_driver.families.fable.words import Status
from nfo_sinus_driver.families.fable.words import state_of


def in_charge(status: DriveStatus | None) -> Steps[str]:
    """Tell that no control method is."""
    yield from ()
    return ''


PROFILE = Profile(
    title='Fable',
    status_word=StatusWord(
        state=state_of,
        by_bit={Status.FAULT: Fact.FAULT, Status.TURNS: Fact.OPERATION_ENABLED},
        by_state={},
    ),
    holders={},
    methods={},
    setpoints={},
    in_charge=in_charge,
)
