# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The settings of the nodes as ROS parameters: description, unit, range, and no surprises."""

from __future__ import annotations

from dataclasses import dataclass
import math

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from nfo_sinus_driver.catalog import families, usual_family
from nfo_sinus_driver.drive import CONTROL_METHODS
from nfo_sinus_driver.drive.settings import (
    AUTO,
    CONTROL_MODES,
    LAST_BLOCK,
    LONGEST_DRIVE_TIMEOUT,
    REFERENCES,
    TELEGRAM_WORDS,
)
from nfo_sinus_driver.link import BIT_RATES, PROTOCOLS

#: What YAML makes of a character format without quotes.
_FORMATS_THAT_ARE_NUMBERS = {float(text): text for text in ('7E1', '8E1', '7E2', '8E2')}

SettingValue = bool | int | float | str | list[str]

#: What the types are called, and how to write one of each.
_TYPES = {
    bool: ('a boolean', 'true or false'),
    int: ('an integer', 'a whole number'),
    float: ('a double', 'a number'),
    str: ('a string', 'a text in quotes'),
    list: ('a list', 'a list of names, such as [left, right]'),
}


@dataclass(frozen=True)
class Setting:
    """One setting of a node; its range, if it has one, has a unit. A fixed one stays as it is."""

    name: str
    default: SettingValue
    description: str
    low: float | None = None
    high: float = 0.0
    constraints: str = ''
    fixed: bool = False
    unit: str = ''

    def coerce(self, given: object) -> SettingValue:
        """Take what was given for what was meant: 5 for 5.0, and 8E1, eighty in YAML, for text."""
        value = given
        if type(given) is int and isinstance(self.default, float):
            value = float(given)
        elif type(given) is float and self.name == 'char_format':
            value = _FORMATS_THAT_ARE_NUMBERS.get(given, given)
        if type(value) is not type(self.default) or not _only_strings(value):
            what = 'is empty' if given is None else f'is {given!r} ({_type_of(given)})'
            raise ValueError(f'{self.name} {what}: write {_as(type(self.default), given)}')
        if self.low is not None and not self.low <= value <= self.high:
            span = f'{self.low:g} to {self.high:g} {self.unit}'.rstrip()
            raise ValueError(f'{self.name} {value:g}: allowed are {span}')
        return value

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
        'Serial port: a device path, or a pyserial URL such as socket://host:port; '
        'for modbus_tcp host:port of the gateway; for canopen a CAN interface such as can0, too',
        fixed=True,
    ),
    Setting(
        'protocol',
        'modbus_rtu',
        'Protocol on the line, the one that the drive is set to',
        constraints=f'one of {", ".join(PROTOCOLS)}',
        fixed=True,
    ),
    Setting(
        'baud_rate',
        0,
        'Bit rate of the line, bit/s, that of the drive; 0: the factory default of the protocol',
        constraints=f'0 or one of {", ".join(str(rate) for rate in BIT_RATES)}, as '
        'the protocol has it',
        fixed=True,
    ),
    Setting(
        'char_format',
        '',
        "Data bits, parity and stop bits, those of the drive; '': the factory default of the "
        'protocol',
        constraints='such as 8E1, 8O1, 8N2; with 7 for modbus_ascii',
        fixed=True,
    ),
    Setting(
        'response_timeout',
        0.2,
        'From the last byte sent to the first byte of the answer, s',
        0.01,
        10.0,
        fixed=True,
        unit='s',
    ),
    Setting(
        'retries',
        2,
        'How often a request is repeated when there is no response and repeating is safe',
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
    Setting(
        'max_requests',
        50.0,
        'With modbus_tcp: how many requests the PLC or gateway is sent a second at most, stops '
        'aside, Hz; 0: no limit',
        0,
        10000,
        fixed=True,
        unit='Hz',
    ),
    Setting('drives', ['nfo_sinus'], 'Names of the drive nodes', fixed=True),
)

DRIVE_SETTINGS = (
    Setting(
        'address',
        1,
        "The drive's address on the bus: Modbus 1 to 247; Classic 1 to 94, 0 for one alone; "
        'CANopen (node id) 1 to 127',
        0,
        247,
    ),
    Setting(
        'block_address',
        0,
        'With control_method telegram1: the first of the registers that the PLC shows for this '
        'drive',
        0,
        LAST_BLOCK,
    ),
    Setting(
        'telegram_words',
        '',
        "With control_method telegram1: which words the PLC maps, where the model has several; '': "
        f'{TELEGRAM_WORDS[0]}',
        constraints=f"'' or one of {', '.join(TELEGRAM_WORDS)}, as far as the model has it",
    ),
    Setting(
        'model',
        usual_family(),
        'The drive family; auto: find out',
        constraints=f'one of {", ".join((*families(), AUTO))}',
    ),
    Setting(
        'control_method',
        '',
        "How the drive is commanded; '': as usual for its family; monitor: not one write to it",
        constraints=f"'' or one of {', '.join(CONTROL_METHODS)}",
    ),
    Setting(
        'reference',
        'fieldbus',
        'Where a running drive takes its reference from; with any but fieldbus it follows no '
        'set-points',
        constraints=f'one of {", ".join(REFERENCES)}, as far as model and control_method have it',
    ),
    Setting(
        'autostart',
        True,
        'Configure and activate by itself, and try until it works; read at the start only',
    ),
    Setting(
        'poll_rate',
        50.0,
        'Status and actual value, Hz; 0: as fast as the bus allows',
        0,
        1000,
        unit='Hz',
    ),
    Setting(
        'idle_poll_rate',
        0.0,
        'As poll_rate, but while the motor stands and is not enabled, Hz; 0: as poll_rate',
        0,
        1000,
        unit='Hz',
    ),
    Setting('telemetry_rate', 2.0, 'Measured values, Hz; 0: off', 0, 100, unit='Hz'),
    Setting(
        'lost_after',
        1.0,
        'No valid frame from the drive for this long although it is asked, s: it is lost and '
        'stopped; any valid answer, a refusal too, begins it anew',
        0.2,
        60,
        unit='s',
    ),
    Setting(
        'setpoint_timeout',
        2.5,
        'No fresh set-point for this long, s: ramp to a stop and warn; 0: off',
        0,
        3600,
        unit='s',
    ),
    Setting(
        'setpoint_max',
        0.0,
        'Set-points are clamped to this, in the unit of the control mode; 0: what is nominal for '
        "the motor, or the drive's own limit where it does not tell that",
        0,
        32767,
        unit='in the unit of the control mode',
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
        "The drive's own time-out, s: it stops the motor when this driver dies; 0: leave it as it "
        'is',
        0,
        LONGEST_DRIVE_TIMEOUT,
        unit='s',
        constraints='0 or at least lost_after + 0.5; the most and the step are those of the drive',
    ),
    Setting(
        'shutdown_timeout',
        4.0,
        'How long an exit waits for the drive to confirm that it stops, s',
        0,
        600,
        unit='s',
    ),
    Setting(
        'gear_ratio',
        1.0,
        'Motor turns per turn of the output shaft; negative inverts the direction of joint_states '
        'and joint_command',
    ),
    Setting(
        'scale',
        1.0,
        'How much of `unit` 1 Hz of the drive is (1 rpm, 1 %, as its control mode has it), such as '
        'm/s of a belt, in ~/setpoint and ~/status; negative turns the direction',
        constraints='not 0; not while the drive is enabled',
    ),
    Setting(
        'unit',
        '',
        "What ~/setpoint and ~/status are in, such as m/s; '': the unit of the control mode",
    ),
    Setting('joint_name', '', "Name of the output shaft in joint_states; '': the node's name"),
    Setting(
        'apply_parameters',
        True,
        'At the first configure, write the parameters of the drive that were given to this node '
        'and that it has otherwise; false: only report them',
    ),
    Setting(
        'frequency_scale',
        0.1,
        'What one count of a frequency is, Hz, where the drive has a scale that no bus tells',
        1e-6,
        1e6,
        unit='Hz',
    ),
    Setting(
        'torque_scale',
        1.0,
        'The same of a torque, % of the nominal one',
        1e-6,
        1e6,
        unit='%',
    ),
    Setting(
        'process_scale',
        0.1,
        'The same of a process value, in its unit',
        1e-6,
        1e6,
    ),
    Setting(
        'allow_communication_changes',
        False,
        'Let the parameters serial.* be changed: the driver may lose the drive by that',
    ),
    Setting(
        'classic_dialect',
        '',
        'Which manual of the Classic protocol the drive follows: v2.03, or v5.0 for firmware '
        "before 4.28; '': ask the drive, while the bus does not control it",
        constraints="'', v2.03 or v5.0",
    ),
    Setting('frame_id', '', 'frame_id of the headers'),
)


def _only_strings(value: object) -> bool:
    return not isinstance(value, list) or all(isinstance(one, str) for one in value)


def _type_of(value: object) -> str:
    return _TYPES.get(type(value), ('a list', ''))[0]


def _as(wanted: type, given: object) -> str:
    """Return how to write what was given in the type that is wanted, or any of that type."""
    if isinstance(given, str):
        if wanted is list:
            return f'[{given}]'
        plain = _plain(wanted, given)
        if plain:
            # launch takes 2e0 for a text, ROS 1_0: there were no quotes to leave out
            return f'{given} without quotes' if given == plain else plain
    if wanted is str and type(given) in (int, float):
        return f"'{given}' with quotes"
    if wanted is int and isinstance(given, float) and given.is_integer():
        return f'{given:.0f}'
    return _TYPES[wanted][1]


def _plain(wanted: type, text: str) -> str:
    """Return how a value of the wanted type that a text names is written; ``''``: it names none."""
    if wanted is bool:
        return text if text in ('true', 'false') else ''
    try:
        value = wanted(text)
    except ValueError:
        return ''
    return str(value) if math.isfinite(value) else ''


def declare(node: Node, settings: tuple[Setting, ...]) -> dict[str, SettingValue]:
    """Declare settings on a node and return their values; a ValueError says which is wrong."""
    for setting in settings:
        # rclpy has no other way to see an override first, and its own complaints name no remedy
        given = node._parameter_overrides.get(setting.name)
        value = setting.default if given is None else setting.coerce(given.value)
        node.declare_parameter(setting.name, value, setting.descriptor(), ignore_override=True)
    return {setting.name: node.get_parameter(setting.name).value for setting in settings}


def coerce(parameter: Parameter, settings: tuple[Setting, ...]) -> Parameter:
    """Take what somebody sets for what is meant, if it is one of the settings."""
    for setting in settings:
        if setting.name == parameter.name and parameter.type_ is not Parameter.Type.NOT_SET:
            return Parameter(parameter.name, value=setting.coerce(parameter.value))
    return parameter
