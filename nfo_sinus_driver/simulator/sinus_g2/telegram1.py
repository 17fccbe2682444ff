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
Telegram 1 as a G2 takes it over PROFIBUS [M0 §6.3, tables 10 and 14 to 16].

The words are DriveControl and DriveStatus, for nobody knows how those of PROFIdrive are translated
[C38]; set-point and actual value are scaled as the parameters are.
"""

from __future__ import annotations

from nfo_sinus_driver.simulator import telegram1
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.sinus_g2.control_unit import G2ControlUnit


class Server(telegram1.Server):
    """The fieldbus side of one G2."""

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, G2ControlUnit)
        self._unit = drive.control_unit

    def exchange(self, stw1: int, setpoint: int) -> tuple[int, int]:
        """Take control word and set-point; return status word and actual value."""
        self._unit.take_telegram(stw1, setpoint)
        return int(self._unit.status_word), self._unit.actual
