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

"""The rules for each model and each way to command it."""

from __future__ import annotations

from any_order_movitrac import MovitracOrder
from any_order_sinus import SinusOrder


class G2ModeScmd(SinusOrder):
    pass


class G2DriveControl(SinusOrder):
    method = 'drive_control'


class OptimalModeScmd(SinusOrder):
    model = 'sinus_optimal'


class OptimalDriveControl(SinusOrder):
    model = 'sinus_optimal'
    method = 'drive_control'
    reference = 'terminal'


class G2Monitor(SinusOrder):
    method = 'monitor'


class OptimalMonitor(SinusOrder):
    model = 'sinus_optimal'
    method = 'monitor'


class Movitrac(MovitracOrder):
    pass


class MovitracMonitor(MovitracOrder):
    method = 'monitor'


MACHINES = (
    G2ModeScmd,
    G2DriveControl,
    OptimalModeScmd,
    OptimalDriveControl,
    G2Monitor,
    OptimalMonitor,
    Movitrac,
    MovitracMonitor,
)
