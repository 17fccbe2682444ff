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

"""One inverter in engineering units. No ROS."""

from nfo_sinus_driver.catalog import InverterStatus
from nfo_sinus_driver.catalog import Procedure
from nfo_sinus_driver.drive.drive import Drive
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.events import Event
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.events import Severity
from nfo_sinus_driver.drive.identity import Identity
from nfo_sinus_driver.drive.parameter_writer import Change
from nfo_sinus_driver.drive.settings import CONTROL_METHODS
from nfo_sinus_driver.drive.settings import DriveSettings
from nfo_sinus_driver.drive.snapshot import Listener
from nfo_sinus_driver.drive.snapshot import LogEntry
from nfo_sinus_driver.drive.snapshot import Snapshot
from nfo_sinus_driver.drive.snapshot import Telemetry
from nfo_sinus_driver.drive.tuning import Tuned

__all__ = [
    'CONTROL_METHODS',
    'Cause',
    'Change',
    'Drive',
    'DriveError',
    'DriveSettings',
    'Event',
    'Identity',
    'InverterStatus',
    'Listener',
    'LogEntry',
    'Procedure',
    'Report',
    'Severity',
    'Snapshot',
    'Telemetry',
    'Tuned',
]
