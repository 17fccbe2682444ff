# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Settings as ROS parameters: declared with full descriptors, and coerced to their types."""

from __future__ import annotations

from collections.abc import Mapping
import math

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from nfo_sinus_driver.node.ros.rclpy_internals import overrides_of
from nfo_sinus_driver.setting import FIXED, Setting

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


def declare(node: Node, settings: Mapping[str, Setting]) -> dict[str, SettingValue]:
    """Declare settings on a node and return their values; a ValueError says which is wrong."""
    overrides = overrides_of(node)
    for name, setting in settings.items():
        # the messages of rclpy name no remedy
        given = overrides.get(name)
        value = setting.default if given is None else _coerced(setting, given.value)
        node.declare_parameter(name, value, _descriptor(setting), ignore_override=True)
    return {name: node.get_parameter(name).value for name in settings}


def coerce(parameter: Parameter, settings: Mapping[str, Setting]) -> Parameter:
    """Return a parameter in the type of its setting, if it is one of the settings."""
    setting = settings.get(parameter.name)
    if setting is None or parameter.type_ is Parameter.Type.NOT_SET:
        return parameter
    return Parameter(parameter.name, value=_coerced(setting, parameter.value))


def _descriptor(setting: Setting) -> ParameterDescriptor:
    """Return what ``ros2 param describe`` shows."""
    unit = f' ({setting.unit})' if setting.unit else ''
    descriptor = ParameterDescriptor(
        name=setting.name,
        description=f'{setting.description[0].upper()}{setting.description[1:]}{unit}',
        additional_constraints=setting.allowed,
        read_only=setting.change == FIXED,
    )
    if setting.low is None:
        return descriptor
    if isinstance(setting.default, float):
        span = FloatingPointRange(from_value=float(setting.low), to_value=float(setting.high))
        descriptor.floating_point_range = [span]
    else:
        span = IntegerRange(from_value=int(setting.low), to_value=int(setting.high), step=1)
        descriptor.integer_range = [span]
    return descriptor


def _coerced(setting: Setting, given: object) -> SettingValue:
    """
    Return a value in the type of its setting.

    An integer for a double is taken, and so is 5.0 for 5; 8E1, eighty in YAML, is a text, and so
    is off, which is false in YAML.
    """
    value = given
    wanted = type(setting.default)
    # a list without elements has no type in ROS, and of a file rcl gives nothing for it
    if setting.default == [''] and given in (None, []):
        value = setting.default
    if type(given) is int and wanted is float:
        value = float(given)
    elif isinstance(given, float) and wanted is int and given.is_integer():
        value = int(given)
    elif type(given) is float and setting.name == 'char_format':
        value = _FORMATS_THAT_ARE_NUMBERS.get(given, given)
    elif given is False and 'off' in setting.choices:
        value = 'off'
    if type(value) is not wanted or not _only_strings(value):
        what = 'is empty' if given is None else f'is {given!r} ({_type_of(given)})'
        raise ValueError(f'{setting.name} {what}: write {_as(wanted, given)}')
    setting.check(value)
    return value


def _only_strings(value: object) -> bool:
    return not isinstance(value, list) or all(isinstance(element, str) for element in value)


def _type_of(value: object) -> str:
    return _TYPES.get(type(value), ('a list', ''))[0]


def _as(wanted: type, given: object) -> str:
    """Return how to write a value in the wanted type, or any value of that type."""
    if isinstance(given, str):
        if wanted is list:
            return f'[{given}]'
        plain = _plain(wanted, given)
        if plain:
            # launch takes 2e0 for a text, ROS 1_0: there were no quotes to leave out
            return f'{given} without quotes' if given == plain else plain
    if wanted is str and type(given) in (int, float):
        return f"'{given}' with quotes"
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
