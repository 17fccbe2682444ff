# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Which node gets which ROS arguments, and those that none takes: misspelt names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
import contextlib
import itertools
from pathlib import Path
import re
from typing import Any

from rclpy.exceptions import InvalidNodeNameException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.utilities import remove_ros_args
import yaml

from nfo_sinus_driver.node.rclpy_internals import overrides_of
from nfo_sinus_driver.node.settings import BUS_SETTINGS
from nfo_sinus_driver.version import VERSION

_PARAMS_FILE = '--params-file'
_PARAMETERS = 'ros__parameters'
#: A name, hidden from ``ros2 node list``, that no parameter file knows.
_NO_NODE = '_no_node'


def bus_overrides(name: str) -> list[Parameter]:
    """
    Return the settings of the bus that were given to a name for the whole process.

    A launch file's ``name=`` and ``namespace=`` put all parameters of the process under that name,
    which becomes the drive's: the bus node has to get those that are for it. What is given to
    every node reaches it anyway.
    """
    for_all = _given_to(_NO_NODE)
    given = _given_to(name)
    return [
        given[key]
        for key in BUS_SETTINGS
        if key in given and (key not in for_all or given[key].value != for_all[key].value)
    ]


def families_of(names: Iterable[str]) -> Mapping[str, object]:
    """Return the ``family`` that was given to the drives of these names, before they exist."""
    found: dict[str, object] = {}
    for name in names:
        # an invalid name is refused when its node is created
        with contextlib.suppress(InvalidNodeNameException):
            given = _given_to(name).get('family')
            found[name] = None if given is None else given.value
    return found


def _given_to(name: str) -> Mapping[str, Parameter]:
    """Have ROS itself find what a node of a name gets: it knows files, wildcards and order."""
    node = Node(name, enable_rosout=False, start_parameter_services=False)
    try:
        return overrides_of(node)
    finally:
        node.destroy_node()


def unknown_parameters(nodes: Iterable[Node]) -> Iterator[str]:
    """Return a warning for each parameter that was given to a node that does not have it."""
    nodes = list(nodes)
    given = {node.get_name(): overrides_of(node).keys() for node in nodes}
    known = {node.get_name(): declared_names(node) for node in nodes}
    unknown: dict[str, list[str]] = {}
    for node, names in given.items():
        for name in names - known[node]:
            # given to all of them, it reaches the right one, too
            if not all(name in others for others in given.values()) or not _owners(name, known):
                unknown.setdefault(name, []).append(node)
    for name, nodes_of in sorted(unknown.items()):
        owners = _owners(name, known)
        of_these = {one for node in nodes_of for one in known[node]}
        meant = f'; {owners[0]} has it' if owners else did_you_mean(name, of_these)
        yield (
            f'parameter {name} was given to {", ".join(sorted(nodes_of))}, but there is none of '
            f'that name{meant}'
        )


def _owners(name: str, known: Mapping[str, set[str]]) -> list[str]:
    """Return the nodes that have a parameter."""
    return [node for node, names in known.items() if name in names]


def declared_names(node: Node) -> set[str]:
    """Return the parameters that a node has, or will have once its drive is connected."""
    # those of a drive are declared when it is connected
    later: Iterable[str] = getattr(node, 'later_parameters', ())
    return set(node.get_parameters_by_prefix('')) | set(later)


def require_parameter(node: Node, name: str, hint: str = '') -> None:
    """
    Make sure that a node has a parameter.

    :param hint: added to the message about one that is missing.
    :raises ValueError: it does not; rclpy refuses it too, but suggests no other name.
    """
    if not node.has_parameter(name):
        near = did_you_mean(name, declared_names(node))
        raise ValueError(f'{name}: there is no such parameter{hint}{near}')


def unknown_nodes(arguments: list[str], names: Iterable[str]) -> Iterator[str]:
    """Return a warning for each section of a parameter file that is of no node here."""
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


def _load(path: str) -> Any:
    try:
        return yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except (OSError, yaml.YAMLError):
        # ROS has reported it by now
        return None


def _sections(tree: Any, prefix: str = '') -> Iterator[str]:
    """Return the names of the nodes in a parameter file."""
    if not isinstance(tree, dict):
        return
    for key, value in tree.items():
        name = f'{prefix}/{key}'.replace('//', '/') if prefix else str(key)
        if isinstance(value, dict) and _PARAMETERS in value:
            yield name
        else:
            yield from _sections(value, name)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence about an unknown name: the closest known ones."""
    # loaded only when needed: it takes 0.1 MB
    import difflib

    close = difflib.get_close_matches(name, list(known), n=2)
    return f'; did you mean {" or ".join(close)}?' if close else ''


_ROS_ARGS = '--ros-args'
_END = '--'
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
    """Refuse arguments that are for no node, and say how to write them; ``--help``: usage."""
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
    Split off the id of the process that this one is to end with.

    :returns: the other arguments, and the id if there was one.
    :raises ValueError: it is no id of a process.
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

    A launch file's ``name=`` does that, and with several nodes in one process all would get the
    same name. ``node:__node:=x`` renames one node and is left alone.

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
