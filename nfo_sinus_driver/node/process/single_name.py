# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
One name for all nodes of the process, as the ``name=`` of a launch file gives it: the drive's.

With several nodes in one process all would get it, and all parameters be put under it.
"""

from __future__ import annotations

import re

from rclpy.parameter import Parameter

from nfo_sinus_driver.node.parameters.settings import BUS_SETTINGS
from nfo_sinus_driver.node.ros.rclpy_internals import given_to

_ROS_ARGS = '--ros-args'
_END = '--'
_REMAP_FLAGS = ('-r', '--remap')
_NODE = re.compile(r'(?:__node|__name):=(.+)')
#: A name, hidden from ``ros2 node list``, that no parameter file knows.
_NO_NODE = '_no_node'


def take_out_node_name(arguments: list[str]) -> tuple[list[str], str | None]:
    """
    Return the other arguments, and the name if there is one.

    ``node:__node:=x`` renames one node and is left alone.
    """
    left: list[str] = []
    name = None
    in_ros = False
    for argument in arguments:
        in_ros = argument == _ROS_ARGS or (in_ros and argument != _END)
        rule = _NODE.fullmatch(argument)
        if in_ros and rule and left[-1] in _REMAP_FLAGS:
            left.pop()
            name = rule.group(1)
        else:
            left.append(argument)
    return left, name


def bus_overrides(name: str) -> list[Parameter]:
    """
    Return the settings of the bus that were given under the name; the bus node has to get them.

    What is given to every node reaches it anyway.
    """
    for_all = given_to(_NO_NODE)
    given = given_to(name)
    return [
        given[key]
        for key in BUS_SETTINGS
        if key in given and (key not in for_all or given[key].value != for_all[key].value)
    ]
