# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Who gets which ROS arguments, and what nobody takes: a misspelt parameter or node."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import itertools
from pathlib import Path
import re
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rclpy.node import Node
from rclpy.parameter import Parameter, get_parameter_value, parameter_value_to_python
from rclpy.utilities import remove_ros_args
import yaml

from nfo_sinus_driver.node.settings import BUS_SETTINGS
from nfo_sinus_driver.version import VERSION

_PARAMS_FILE = '--params-file'
_PARAMETERS = 'ros__parameters'
#: A name, hidden from ``ros2 node list``, that no parameter file knows.
_NOBODY = '_nobody'


def bus_overrides(name: str) -> list[Parameter]:
    """
    Return the settings of the bus that were given to a name for the whole process.

    A launch file's ``name=`` and ``namespace=`` put all parameters of the process under that name,
    which becomes the drive's: the bus node, too, is to see what was meant for it. What is given to
    every node reaches it anyway.
    """
    for_all = _given_to(_NOBODY)
    given = _given_to(name)
    return [
        given[key]
        for key in BUS_SETTINGS
        if key in given and (key not in for_all or given[key].value != for_all[key].value)
    ]


def _given_to(name: str) -> dict[str, Parameter]:
    """Let ROS itself say what a node of a name gets: it knows files, wildcards and their order."""
    node = Node(name, enable_rosout=False, start_parameter_services=False)
    try:
        return dict(node._parameter_overrides)
    finally:
        node.destroy_node()


def unknown_parameters(nodes: Iterable[Node]) -> Iterator[str]:
    """Return a warning for each parameter that was given and that no node declares."""
    nodes = list(nodes)
    declared = {name for node in nodes for name in declared_names(node)}
    unknown: dict[str, set[str]] = {}
    for node in nodes:
        # rclpy has no other way to see the overrides that nobody declared
        for name in node._parameter_overrides:
            if name not in declared:
                unknown.setdefault(name, set()).add(node.get_name())
    for name, names in sorted(unknown.items()):
        yield (
            f'parameter {name} was given to {", ".join(sorted(names))}, but there is none of that '
            f'name{did_you_mean(name, declared)}'
        )
    for node in nodes:
        others = declared - declared_names(node)
        misplaced = set(node._parameter_overrides) & others
        # given to all of them, it reaches the right one too
        for name in sorted(misplaced):
            if not all(name in other._parameter_overrides for other in nodes):
                yield f'parameter {name} was given to {node.get_name()}, which has none such'


def declared_names(node: Node) -> set[str]:
    """Return the parameters that a node has, or will have once its drive is there."""
    # those of a drive are declared when it is there
    later: Iterable[str] = getattr(node, 'later_parameters', ())
    return set(node.get_parameters_by_prefix('')) | set(later)


def unknown_nodes(arguments: list[str], names: Iterable[str]) -> Iterator[str]:
    """Return a warning for each section of a parameter file that no node is named by."""
    names = set(names)
    for flag, path in itertools.pairwise(arguments):
        if flag == _PARAMS_FILE:
            for section in _sections(_load(path)):
                name = section.rsplit('/', 1)[-1]
                if '*' not in name and name not in names:
                    yield (
                        f'{path} has parameters for {section}, but the nodes here are '
                        f'{", ".join(sorted(names))}{did_you_mean(name, names)}'
                    )


def overruled_parameters(arguments: list[str], nodes: Iterable[Node]) -> Iterator[str]:
    """
    Return a warning for each ``-p name:=value`` that a node has another value for.

    To ROS the more specific name counts, wherever it stands, and of the same the later one: what a
    parameter file gives to a node goes before what the command line gives to all.
    """
    rules = list(_rules(arguments))
    given = {name: text for node_name, name, text in rules if not node_name}
    # where the command line names the node, too, it overrules itself
    specific = {(node_name.rsplit('/', 1)[-1], name) for node_name, name, _ in rules}
    for node in nodes:
        for name, text in given.items():
            if (node.get_name(), name) in specific:
                continue
            override = node._parameter_overrides.get(name) if name in declared_names(node) else None
            if override is not None and not _is_value(override, text):
                counts = parameter_value_to_python(override.get_parameter_value())
                yield (
                    f'parameter {name}:={text} of the command line does not count for '
                    f'{node.get_name()}: a parameter file overrules it by {counts!r}. Change the '
                    f'file, or give -p {node.get_name()}:{name}:={text} after --params-file'
                )


def _rules(arguments: list[str]) -> Iterator[tuple[str, str, str]]:
    """Return what the command line gives: to which node (empty: all), name and value."""
    in_ros = False
    for argument, following in itertools.pairwise([*arguments, '']):
        in_ros = argument == _ROS_ARGS or (in_ros and argument != _END)
        if in_ros and argument in _PARAM_FLAGS:
            rule = _RULE.fullmatch(following)
            if rule:
                yield rule[1] or '', rule[2], rule[3]


def _is_value(override: Parameter, text: str) -> bool:
    """Tell whether a parameter has the value that was given as text, as ROS reads it."""
    try:
        given = Parameter.from_parameter_msg(
            ParameterMessage(name=override.name, value=get_parameter_value(text))
        ).value
    except (ValueError, yaml.YAMLError):
        return True
    return bool(given == override.value or str(given) == str(override.value))


def _load(path: str) -> Any:
    try:
        return yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except (OSError, yaml.YAMLError):
        # ROS has said so itself by now
        return None


def _sections(tree: Any, prefix: str = '') -> Iterator[str]:
    """Return the names of the nodes that a parameter file speaks of."""
    if not isinstance(tree, dict):
        return
    for key, value in tree.items():
        name = f'{prefix}/{key}'.replace('//', '/') if prefix else str(key)
        if isinstance(value, dict) and _PARAMETERS in value:
            yield name
        else:
            yield from _sections(value, name)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence on an unknown name: those known that are most like it."""
    # loaded for a mistake alone: it takes 0.1 MB
    import difflib

    close = difflib.get_close_matches(name, list(known), n=2)
    return f'; did you mean {" or ".join(close)}?' if close else ''


_ROS_ARGS = '--ros-args'
_END = '--'
_PARAM_FLAGS = ('-p', '--param')
#: Node, if one is named, parameter and value.
_RULE = re.compile(r'(?:([^:=]+):)?([^:=]+):=(.*)', re.DOTALL)
_REMAP_FLAGS = ('-r', '--remap')
_NODE = re.compile(r'(?:__node|__name):=(.+)')


_END_WITH = '--end-with'
_HELP = """usage: driver [--version] [--end-with PID] [--ros-args ...]

Drives NFO Sinus inverters on one serial line. For example:

  driver --ros-args -p port:=/dev/ttyUSB0 -p address:=1
  driver --ros-args --params-file conveyor.yaml

  --end-with PID   stop the motors and end when that process has ended; launch files give their own
"""


def refuse_other_arguments(arguments: list[str]) -> None:
    """Refuse what is meant for nobody, saying how to give it; ``--help`` prints the usage."""
    others = remove_ros_args(arguments)[1:]
    if '-h' in others or '--help' in others:
        print(_HELP)
        raise SystemExit(0)
    if '--version' in others:
        print(f'nfo_sinus_driver {VERSION}')
        raise SystemExit(0)
    if others:
        raise ValueError(
            f'unknown argument {others[0]}: parameters are given as --ros-args -p name:=value'
        )


def take_out_end_with(arguments: list[str]) -> tuple[list[str], int | None]:
    """
    Split off the number of the process that this one is to end with.

    :returns: the other arguments, and the number if there was one.
    :raises ValueError: it is no number of a process.
    """
    if _END_WITH not in arguments:
        return arguments, None
    at = arguments.index(_END_WITH)
    given = arguments[at + 1] if at + 1 < len(arguments) else ''
    if not given.isdecimal() or not int(given):
        raise ValueError(f'{_END_WITH} {given!r}: the number of a process, such as 1234')
    return arguments[:at] + arguments[at + 2 :], int(given)


def take_out_node_name(arguments: list[str]) -> tuple[list[str], str | None]:
    """
    Split off a name that would be given to every node of the process.

    A launch file's ``name=`` does that, and with several nodes in one process all of them would
    get the same name. ``node:__node:=x`` renames one node and is left alone.

    :returns: the other arguments, and the name if there was one.
    """
    left: list[str] = []
    name = None
    in_ros = False
    waiting = iter(arguments)
    for argument in waiting:
        if argument == _ROS_ARGS:
            in_ros = True
        elif argument == _END:
            in_ros = False
        elif in_ros and argument in _REMAP_FLAGS:
            rule = next(waiting, None)
            match = _NODE.fullmatch(rule or '')
            if match:
                name = match.group(1)
            else:
                left += [argument] if rule is None else [argument, rule]
            continue
        left.append(argument)
    return left, name
