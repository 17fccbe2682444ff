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

"""Which settings of a drive are not changed over the bus, and what follows from a change."""

from __future__ import annotations

from collections.abc import Mapping

from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import Report

#: The driver's own setting that goes with each setting of the line.
_FOLLOWERS = {
    Role.BUS_PROTOCOL: 'protocol',
    Role.BUS_ADDRESS: 'address',
    Role.BAUD_RATE: 'baud_rate',
    Role.CHARACTER_FORMAT: 'char_format',
}


def followers(model: Family) -> Mapping[str, str]:
    """Return the driver's own setting that goes with each setting of the line."""
    named = {model.key(role): setting for role, setting in _FOLLOWERS.items()}
    return {key: setting for key, setting in named.items() if key}


def why_not(key: str, inverter: DriveState) -> Report | None:
    """Return why a setting may not be changed, ``None`` if it may."""
    settings = inverter.settings
    if settings.method == 'monitor':
        return Report(Cause.MONITOR_ONLY)
    if inverter.tuning:
        return Report(Cause.CHANGE_WHILE_TUNING)
    if key not in inverter.model.communication:
        return None
    if not settings.allow_communication_changes:
        return Report(Cause.COMMUNICATION_PROTECTED)
    firmware = inverter.identity.firmware if inverter.identity else 0.0
    if firmware < inverter.model.profile.uncertain.get(key, 0.0):
        return Report(Cause.CODES_UNCERTAIN, firmware=firmware)
    return None


def after_change(changed: Mapping[str, Value], model: Family) -> Report | None:
    """Return how to follow a drive to new settings of the line, ``None`` if none was changed."""
    settings = followers(model)
    follow = [f'{settings[key]} ({value})' for key, value in changed.items() if key in settings]
    return Report(Cause.FOLLOW_THE_LINE, settings=' and '.join(follow)) if follow else None
