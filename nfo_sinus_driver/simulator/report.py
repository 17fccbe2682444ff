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

"""The state of a simulated drive as plain data, for tests and for people; it has no effects."""

from __future__ import annotations

from typing import Any

from nfo_sinus_driver.catalog import Access
from nfo_sinus_driver.simulator.drive import SimulatedDrive


def describe(drive: SimulatedDrive) -> dict[str, Any]:
    """Return everything about a drive, in engineering units; it can be written as JSON."""
    motor = drive.motor
    return {
        'address': drive.address,
        'model': drive.model.name,
        'serial_number': drive.serial_number,
        'time': drive.time,
        'silent': not drive.listening,
        'run_input': drive.control_unit.run_input,
        **drive.control_unit.report(),
        'fault': next(iter(drive.faults.codes), 0),
        'faults': drive.faults.codes,
        'alarms': drive.faults.alarms,
        'frequency': motor.frequency,
        'speed': motor.speed,
        'rotor_speed': motor.rotor_speed,
        'turning': motor.turning,
        'driven': motor.driven,
        'current': motor.current,
        'torque': 100 * motor.torque,
        'dc_link': motor.dc_link,
        'writes': dict(drive.writes),
        'command_writes': dict(drive.command_writes),
        'error_log': [[entry.code, entry.op_time] for entry in drive.faults.log],
        'parameters': {
            key: drive.peek(key)
            for key, parameter in drive.memory.model.items()
            if parameter.access in (Access.READ, Access.READ_WRITE)
        },
    }
