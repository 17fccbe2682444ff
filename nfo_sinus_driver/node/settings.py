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

"""The settings of the nodes as ROS parameters: description, unit, range, and no surprises."""

from __future__ import annotations

from dataclasses import dataclass

from rcl_interfaces.msg import FloatingPointRange
from rcl_interfaces.msg import IntegerRange
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.node import Node
from rclpy.parameter import Parameter

from nfo_sinus_driver.drive import CONTROL_METHODS
from nfo_sinus_driver.drive.settings import CONTROL_MODES
from nfo_sinus_driver.link.open import PROTOCOLS
from nfo_sinus_driver.link.settings import BAUD_RATES

#: What YAML makes of a character format without quotes.
_FORMATS_THAT_ARE_NUMBERS = {float(text): text for text in ('7E1', '8E1', '7E2', '8E2')}

SettingValue = bool | int | float | str | list[str]


@dataclass(frozen=True)
class Setting:
    """
    One setting of a node.

    :ivar low: the least value; ``None`` where there is no range.
    :ivar fixed: it cannot be changed while the process runs.
    """

    name: str
    default: SettingValue
    description: str
    low: float | None = None
    high: float = 0.0
    constraints: str = ''
    fixed: bool = False

    def descriptor(self) -> ParameterDescriptor:
        """Return what ``ros2 param describe`` shows."""
        descriptor = ParameterDescriptor(
            name=self.name,
            description=self.description,
            additional_constraints=self.constraints,
            read_only=self.fixed,
        )
        if self.low is None:
            return descriptor
        if isinstance(self.default, float):
            span = FloatingPointRange(from_value=float(self.low), to_value=float(self.high))
            descriptor.floating_point_range = [span]
        else:
            span = IntegerRange(from_value=int(self.low), to_value=int(self.high), step=1)
            descriptor.integer_range = [span]
        return descriptor


BUS_SETTINGS = (
    Setting(
        'port',
        '/dev/ttyUSB0',
        'Serial port: a device path, or a pyserial URL such as socket://host:port',
        fixed=True,
    ),
    Setting(
        'protocol',
        'modbus_rtu',
        'Protocol on the line, as BusType in the drive says',
        constraints=f'one of {", ".join(PROTOCOLS)}',
        fixed=True,
    ),
    Setting(
        'baud_rate',
        0,
        'Bit rate, bit/s, as SiBaud in the drive says; 0: the factory default of the protocol',
        constraints=f'0 or one of {", ".join(str(rate) for rate in BAUD_RATES)}',
        fixed=True,
    ),
    Setting(
        'char_format',
        '',
        'Data bits, parity and stop bits, as SiProt in the drive says; '
        "'': the factory default of the protocol",
        constraints='such as 8E1, 8O1, 8N2',
        fixed=True,
    ),
    Setting(
        'response_timeout',
        0.2,
        'From the last byte sent to the first byte of the answer, s',
        0.01,
        10.0,
        fixed=True,
    ),
    Setting(
        'retries',
        2,
        'How often a request is repeated when nobody answers and repeating is safe',
        0,
        10,
        fixed=True,
    ),
    Setting(
        'rs485',
        False,
        'Let the port itself switch the RS-485 transmitter, where it can; most adapters do it '
        'by themselves',
        fixed=True,
    ),
    Setting('drives', ['nfo_sinus'], 'Names of the drive nodes', fixed=True),
)

DRIVE_SETTINGS = (
    Setting('address', 1, "The drive's address on the bus; Modbus 1 to 247", 1, 247),
    Setting('model', 'sinus_g2', 'The drive family', constraints='one of sinus_g2'),
    Setting(
        'control_method',
        'mode_scmd',
        'How the drive is commanded; monitor: not one write to it',
        constraints=f'one of {", ".join(CONTROL_METHODS)}',
    ),
    Setting(
        'autostart',
        True,
        'Configure and activate by itself, and try until it works',
        fixed=True,
    ),
    Setting(
        'poll_rate', 0.0, 'Status and actual value, Hz; 0: as fast as the bus allows', 0, 1000
    ),
    Setting('telemetry_rate', 2.0, 'Measured values, Hz; 0: off', 0, 100),
    Setting(
        'setpoint_timeout',
        2.5,
        'No fresh set-point for this long, s: ramp to a stop and warn; 0: off',
        0,
        3600,
    ),
    Setting(
        'setpoint_max',
        0.0,
        'Set-points are clamped to this, in the unit of the control mode; '
        "0: the drive's own limit",
        0,
        32767,
    ),
    Setting(
        'expected_control_mode',
        '',
        "Enable is refused when the drive is in another control mode; '': any",
        constraints=f"'' or one of {', '.join(CONTROL_MODES)}",
    ),
    Setting(
        'drive_timeout',
        0.0,
        "The drive's own time-out (SioTot, with AutoStop = ON), s, in steps of 0.1: it stops the "
        'motor when this driver dies; 0: leave it as it is',
        0,
        25,
        constraints='0 or at least 1.0',
    ),
    Setting(
        'shutdown_timeout',
        4.0,
        'How long an exit waits for the drive to confirm that it stops, s',
        0,
        600,
    ),
    Setting('frame_id', '', 'frame_id of the headers'),
)


def declare(node: Node, settings: tuple[Setting, ...]) -> dict[str, SettingValue]:
    """
    Declare settings on a node and return their values; an integer is taken for a double.

    :raises rclpy.exceptions.ParameterException: an override has a wrong type or is out of range.
    """
    for setting in settings:
        try:
            node.declare_parameter(setting.name, setting.default, setting.descriptor())
        except InvalidParameterTypeException:
            _declare_from_number(node, setting)
    return {setting.name: node.get_parameter(setting.name).value for setting in settings}


def _declare_from_number(node: Node, setting: Setting) -> None:
    """
    Take an override of 5 for 5.0, and of 8E1 for '8E1'.

    The types of ROS parameters are stricter than people, and YAML takes 8E1 for eighty.

    :raises InvalidParameterTypeException: the override is of another type altogether.
    """
    dynamic = ParameterDescriptor(dynamic_typing=True)
    given = node.declare_parameter(setting.name, setting.default, dynamic).value
    node.undeclare_parameter(setting.name)
    meant: SettingValue
    if isinstance(setting.default, float) and type(given) is int:
        meant = float(given)
    elif setting.name == 'char_format' and given in _FORMATS_THAT_ARE_NUMBERS:
        meant = _FORMATS_THAT_ARE_NUMBERS[given]
    else:
        node.declare_parameter(setting.name, setting.default, setting.descriptor())
        return
    node.declare_parameter(setting.name, meant, setting.descriptor(), ignore_override=True)


def integers_to_doubles(
    parameters: list[Parameter], settings: tuple[Setting, ...]
) -> list[Parameter]:
    """Return parameters to set with integers turned into doubles where doubles are declared."""
    doubles = {setting.name for setting in settings if isinstance(setting.default, float)}
    return [
        Parameter(parameter.name, Parameter.Type.DOUBLE, float(parameter.value))
        if parameter.name in doubles and parameter.type_ is Parameter.Type.INTEGER
        else parameter
        for parameter in parameters
    ]
