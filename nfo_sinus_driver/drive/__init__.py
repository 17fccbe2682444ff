# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One drive in engineering units. No ROS."""

from nfo_sinus_driver.catalog import InverterStatus, Procedure
from nfo_sinus_driver.drive.drive import Drive
from nfo_sinus_driver.drive.events import Cause, DriveError, Event, Report, Severity
from nfo_sinus_driver.drive.identity import Identity
from nfo_sinus_driver.drive.parameter_writer import ParameterChange
from nfo_sinus_driver.drive.settings import CONTROL_METHODS, DriveSettings
from nfo_sinus_driver.drive.snapshot import Listener, LogEntry, Snapshot, Telemetry
from nfo_sinus_driver.drive.stop_reason import StopReason
from nfo_sinus_driver.drive.tuning import Tuned

__all__ = [
    'CONTROL_METHODS',
    'Cause',
    'Drive',
    'DriveError',
    'DriveSettings',
    'Event',
    'Identity',
    'InverterStatus',
    'Listener',
    'LogEntry',
    'ParameterChange',
    'Procedure',
    'Report',
    'Severity',
    'Snapshot',
    'StopReason',
    'Telemetry',
    'Tuned',
]
