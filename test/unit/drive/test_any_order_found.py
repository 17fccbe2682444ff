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

"""What ``test_any_order.py`` has found, each in the shortest history that shows it."""

from __future__ import annotations

from test_any_order import G2DriveControl
from test_any_order import G2ModeScmd

BUS_FAIL = 15


def test_a_fault_that_holds_the_stop_does_not_keep_the_line_busy_while_it_connects() -> None:
    state = G2DriveControl()
    state.begin(drive_timeout=2.0)
    try:
        state.fault(BUS_FAIL, standing=True)
        state.clean_up()
        state.run_by_another(wait=0.0)
        # the new driver takes the run command back, is refused, and must still get to connect
        state.kill(wait=0.1)
        assert state.rig.notes.snapshot is not None and state.rig.notes.snapshot.connected
    finally:
        state.teardown()


def test_a_start_that_the_run_input_ends_does_not_wait_for_it() -> None:
    state = G2ModeScmd()
    state.begin(delay=1)
    try:
        state.enable(wait=0.4)
        assert state.rig.far.inv_st_text == 'Wait...'
        state.run_input_off(wait=0.3)
        assert not state.laws.standing
        state.run_input_on(wait=3.0)
        assert not state.rig.far.motor.driven
    finally:
        state.teardown()
