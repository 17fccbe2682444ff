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

"""The inverter status codes: what the display shows and what to do about it [M0 table 19]."""

from __future__ import annotations

from dataclasses import dataclass
import enum


class Kind(enum.Enum):
    """How grave an inverter status is; the drive's fault bit has the last word [C95]."""

    STATUS = 'status'
    ALARM = 'alarm'
    FAULT = 'fault'


@dataclass(frozen=True)
class InvStCode:
    """One inverter status code of one model."""

    code: int
    text: str
    #: The text that firmware before 4.28 shows [C3].
    old_text: str
    kind: Kind
    requires_ack: bool
    description: str
    remedy: str


#: Standby under bus control: motor off, waiting for a command over the bus ([M0 table 19], [C3]).
BUS_STANDBY = frozenset({37, 41})
#: Running under bus control ([M0 table 19], [C3]).
BUS_RUNNING = frozenset({38, 39, 40, 42, 43, 44})
#: Of these, those in which the speed decreases towards the reference, or to a stop.
BUS_SLOWING = frozenset({40, 44})
#: Standing by or running under terminal control ([M0 table 19], [M1]).
TERMINALS = frozenset({33, 34, 35, 36})
#: Running under keypad control, be it at standstill [M0 table 19].
KEYPAD = frozenset({29, 30, 31, 32})
#: Of both, those in which the motor is driven.
LOCAL_RUNNING = KEYPAD | TERMINALS - {33}
#: The motor is driven, but these do not say on whose command [M0 table 19].
BRAKE_CHOPPER = 26
CURRENT_LIMIT = 27
START_DELAY = 25
TUNING = 28
#: A tuning of any kind is finished ([M0 table 19], [M1]).
TUNED = frozenset({44, 45, 46, 47})
SIO_FAIL = 14
BUS_FAIL = 15
