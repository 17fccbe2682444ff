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

"""A line as slow as it can be: what is still coming is not late, and a drive is used."""

from __future__ import annotations

import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause

SLOWEST = {'rtu': 1200, 'ascii': 1200, 'optimal ascii': 1200, 'classic': 1200, 'movitrac': 9600}


@pytest.mark.parametrize('way', SLOWEST)
def test_a_drive_is_identified_and_turns(way: str) -> None:
    with Rig(way, line={'baud': SLOWEST[way]}) as rig:
        rig.turn()
        assert rig.drive.identity is not None
        assert rig.drive.identity.serial or way not in ('rtu', 'ascii')
        rig.pass_time(10.0)
        assert abs(rig.far.motor.frequency - 20) < 0.2
        assert not rig.notes.said(Cause.LOST_IN_USE)
        assert rig.bus.statistics().timeouts == rig.bus.statistics().damaged == 0
