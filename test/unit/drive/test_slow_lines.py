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

from memory_rig import MemoryRig
import pytest
from support.said import says

from nfo_sinus_driver.drive import Cause

SLOWEST = [
    ('modbus_rtu', 'sinus_g2', 1200),
    ('modbus_ascii', 'sinus_g2', 1200),
    ('modbus_ascii', 'sinus_optimal', 1200),
    ('classic', 'sinus_g2', 1200),
    ('movitrac', 'movitrac31', 9600),
]


@pytest.mark.parametrize(('protocol', 'model', 'baud'), SLOWEST)
def test_a_drive_is_identified_and_turns(protocol: str, model: str, baud: int) -> None:
    rig = MemoryRig(protocol, baud, model=model)
    rig.run()
    identity = rig.drive.identity
    assert identity is not None
    if model == 'sinus_g2' and protocol != 'classic':
        assert identity.serial
    rig.pass_time(10.0)
    assert abs(rig.far.motor.frequency - 20) < 0.2
    assert not any(says(text, Cause.LOST_IN_USE) for _, _, text in rig.notes.events)
    assert rig.bus.statistics().timeouts == rig.bus.statistics().damaged == 0
    rig.close()
