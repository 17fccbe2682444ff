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


"""What a general part needs of a drive, whatever the family calls it."""

from __future__ import annotations

import enum


class Role(enum.Enum):
    """
    What a parameter is to the driver; a family without it lacks the feature.

    What is measured has the name of its field in the message Telemetry, but for ``actual_``.
    """

    STATUS_CODE = 'status_code'
    STATUS_WORD = 'status_word'
    #: Who controls the drive.
    CONTROL_SOURCE = 'control_source'
    FIRMWARE = 'firmware'
    MOTOR_FIRMWARE = 'motor_firmware'

    CONTROL_MODE = 'control_mode'
    PROCESS_UNIT = 'process_unit'
    STOP_MODE = 'stop_mode'
    START_DELAY = 'start_delay'

    ACTUAL_FREQUENCY = 'actual_frequency'
    ACTUAL_SPEED = 'actual_speed'
    ACTUAL_TORQUE = 'actual_torque'
    ACTUAL_PROCESS_VALUE = 'actual_process_value'
    OUTPUT_VOLTAGE = 'output_voltage'
    OUTPUT_CURRENT = 'output_current'
    OUTPUT_POWER = 'output_power'
    POWER_FACTOR = 'power_factor'
    DC_LINK_VOLTAGE = 'dc_link_voltage'
    MOTOR_TEMPERATURE = 'motor_temperature'
    PT1000_TEMPERATURE = 'pt1000_temperature'
    OPERATING_TIME = 'operating_time'
    RUNNING_TIME = 'running_time'
    BRAKE_TIME = 'brake_time'
    ENERGY = 'energy'
    TOTAL_ENERGY = 'total_energy'

    NOMINAL_POWER = 'nominal_power'
    NOMINAL_VOLTAGE = 'nominal_voltage'
    NOMINAL_FREQUENCY = 'nominal_frequency'
    NOMINAL_SPEED = 'nominal_speed'
    NOMINAL_CURRENT = 'nominal_current'
    NOMINAL_POWER_FACTOR = 'nominal_power_factor'

    #: After how long a silence of the line the drive stops the motor by itself, and if it does.
    COMMUNICATION_TIMEOUT = 'communication_timeout'
    STOP_AT_TIMEOUT = 'stop_at_timeout'
    BUS_PROTOCOL = 'bus_protocol'
    BUS_ADDRESS = 'bus_address'
    BAUD_RATE = 'baud_rate'
    CHARACTER_FORMAT = 'character_format'
