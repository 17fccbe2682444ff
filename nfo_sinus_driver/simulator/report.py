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
    motor, runner = drive.motor, drive.runner
    return {
        'address': drive.address,
        'model': drive.model.name,
        'serial_number': drive.serial_number,
        'time': drive.time,
        'silent': not drive.listening,
        'mode': int(runner.mode),
        'source': runner.source.value,
        'scmd': int(runner.scmd),
        'run_input': runner.run_input,
        'inv_st': drive.inv_st,
        'inv_st_text': drive.inv_st_text,
        'fault': next(iter(drive.faults.codes), 0),
        'faults': drive.faults.codes,
        'alarms': drive.faults.alarms,
        'state': runner.state,
        'control_word': int(runner.control_word),
        'status_word': int(runner.status_word),
        'frequency': motor.frequency,
        'speed': motor.speed,
        'rotor_speed': motor.rotor_speed,
        'turning': motor.turning,
        'driven': motor.driven,
        'current': motor.current,
        'torque': 100 * motor.torque,
        'dc_link': motor.dc_link,
        'setpoint': drive.peek(runner.setpoint_key),
        'setpoint_raw': drive.memory.raw(runner.setpoint_key),
        'setpoint_key': runner.setpoint_key,
        'sio_err': int(drive.faults.sio_err),
        'ack_reads': drive.ack_reads,
        'sio_err_reads': drive.sio_err_reads,
        'mode_ext_writes': drive.mode_ext_writes,
        'writes': dict(drive.writes),
        'command_writes': dict(drive.command_writes),
        'error_log': [[entry.code, entry.op_time] for entry in drive.faults.log],
        'parameters': {
            key: drive.peek(key)
            for key, parameter in drive.memory.model.items()
            if parameter.access in (Access.READ, Access.READ_WRITE)
        },
    }
