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

"""A drive without a status word: only its inverter status tells what it does [C21]."""

from __future__ import annotations

from drive_rig import PATIENCE
from drive_rig import Notes
from drive_rig import wait_until

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.link.open import line_settings
from nfo_sinus_driver.simulator.simulator import Simulator


def test_stop_down_a_long_ramp_is_confirmed_and_said_once() -> None:
    settings = {'control.accel': 2.0, 'control.retard': 20.0}
    line = line_settings('classic', response_timeout=2.0)
    with Simulator(protocol='classic', dialect='5.0', boot_time=0.2, settings=settings) as far:
        bus = Bus(open_link('classic', far.port, line))
        notes = Notes()
        drive = Drive(bus, DriveSettings(classic_dialect='v5.0'), notes)
        bus.start()
        try:
            drive.connect().result(PATIENCE)
            drive.activate()
            drive.enable().result(PATIENCE)
            drive.set_setpoint(40.0)
            wait_until(lambda: far.drives[1].motor.frequency > 30.0)
            assert drive.stop().result(PATIENCE) == 'stopping: it ramps down'
            polls = len(notes.snapshots)
            wait_until(lambda: len(notes.snapshots) > polls + 20)
            assert far.drives[1].motor.driven, 'the ramp was too short to see anything'
            assert not notes.told('nobody enabled it')
            assert not notes.told('CANNOT STOP')
            assert not drive.stop_unconfirmed
        finally:
            bus.close()
