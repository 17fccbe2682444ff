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

"""What is told of one poll is of one moment: a status does not lag behind the commands."""

from __future__ import annotations

import pytest
from virtual_rig import MakeVirtual

from nfo_sinus_driver.drive.snapshot import Snapshot

_OVERLOAD = 5


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
def test_a_fault_that_was_acknowledged_is_not_told_any_more(
    make_virtual: MakeVirtual, method: str
) -> None:
    rig = make_virtual(control_method=method)
    rig.connect()
    told: list[Snapshot] = []
    rig.notes.on_snapshot = told.append  # type: ignore[method-assign]
    for phase in range(40):
        rig.far.trip(_OVERLOAD)
        rig.pass_time(0.5 + phase / 1000.0)
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
        told.clear()
        assert 'enabled' in rig.answer(rig.drive.enable())
        rig.pass_time(0.2)
        assert any(one.enabled for one in told)
        assert not any(one.status and one.status.faulted for one in told), phase
        rig.answer(rig.drive.stop())
        rig.pass_time(0.5)
