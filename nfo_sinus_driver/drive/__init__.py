# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

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
