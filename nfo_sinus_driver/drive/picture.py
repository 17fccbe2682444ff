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

"""Puts together what is told of a drive at one moment."""

from __future__ import annotations

import time

from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.setpoint import Setpoint
from nfo_sinus_driver.drive.snapshot import NAN
from nfo_sinus_driver.drive.snapshot import NOT_MEASURED
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.drive.snapshot import Measured
from nfo_sinus_driver.drive.snapshot import Snapshot


def take_snapshot(
    inverter: DriveState,
    setpoint: Setpoint,
    seen: InverterStatus | None,
    frequency: Measured = NOT_MEASURED,
    speed: Measured = NOT_MEASURED,
    actual: float = NAN,
) -> Snapshot:
    """
    Return the snapshot of a poll.

    :param seen: the status, or ``None`` while the drive is not connected.
    """
    if seen is None:
        return Snapshot(
            at=time.monotonic(),
            connected=inverter.connected,
            enabled=setpoint.armed,
            control_method=inverter.settings.method,
        )
    code = seen.listed
    return Snapshot(
        at=seen.at,
        connected=inverter.connected,
        enabled=setpoint.armed,
        control_method=inverter.settings.method,
        status=seen,
        control_mode=inverter.control_mode,
        unit=inverter.unit,
        setpoint=setpoint.commanded,
        setpoint_age=setpoint.age,
        setpoint_clamped=setpoint.clamped,
        text=inverter.text_of(seen.code),
        description=code.description,
        remedy=code.remedy,
        kind=seen.kind,
        requires_ack=code.requires_ack,
        frequency=frequency.value,
        frequency_at=frequency.at,
        speed=speed.value,
        speed_at=speed.at,
        actual=actual,
    )
