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

"""What the words of an Fable mean."""

from __future__ import annotations

import enum

from nfo_sinus_driver.catalog.status import Fact
from nfo_sinus_driver.catalog.status import State
from nfo_sinus_driver.catalog.status import StatusWord

TITLE = 'Fable'
WRITES_AND_READS = False


class Mode(enum.IntEnum):
    """Who controls it: always the bus."""

    BUS = 1


class Command(enum.IntFlag):
    """The command register."""

    ENABLE = 1 << 8
    RUN = 1 << 9
    ACKNOWLEDGE = 1 << 15


class Status(enum.IntFlag):
    """The status register."""

    FAULT = 1 << 0
    TURNS = 1 << 4
    ENABLED = 1 << 8


def state_of(word: int) -> State:
    """Return the state that a status word shows."""
    if word & Status.FAULT:
        return State.FAULTED
    return State.OPERATION_ENABLED if word & Status.TURNS else State.SWITCHED_ON


STATUS_WORD = StatusWord(
    state=state_of,
    by_bit={Status.FAULT: Fact.FAULT, Status.TURNS: Fact.OPERATION_ENABLED},
    by_state={},
)
