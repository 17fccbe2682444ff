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

"""Takes a node name for the whole process (``-r __node:=x``) out of the ROS arguments."""

from __future__ import annotations

import re

from rclpy.utilities import remove_ros_args

_ROS_ARGS = '--ros-args'
_END = '--'
_REMAP_FLAGS = ('-r', '--remap')
_NODE = re.compile(r'(?:__node|__name):=(.+)')


_HELP = """usage: driver [--ros-args ...]

Drives NFO Sinus inverters on one serial line. For example:

  driver --ros-args -p port:=/dev/ttyUSB0 -p address:=1
  driver --ros-args --params-file conveyor.yaml
"""


def refuse_other_arguments(arguments: list[str]) -> None:
    """
    Look for what is meant for nobody; ``--help`` prints how to call the driver.

    :raises ValueError: an argument outside ``--ros-args``; the message says how to give it.
    :raises SystemExit: after ``--help``.
    """
    others = remove_ros_args(arguments)[1:]
    if '-h' in others or '--help' in others:
        print(_HELP)
        raise SystemExit(0)
    if others:
        raise ValueError(
            f'unknown argument {others[0]}: parameters are given as --ros-args -p name:=value'
        )


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
