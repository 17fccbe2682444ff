# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The command line of the driver, beside the arguments of ROS."""

from __future__ import annotations

import argparse

from rclpy.utilities import remove_ros_args

from nfo_sinus_driver.signals import OtherProcess
from nfo_sinus_driver.version import VERSION

_USAGE = 'driver [--version] [--end-with PID] [--ros-args ...]'
_EXAMPLES = """For example:

  driver --ros-args -p port:=/dev/ttyUSB0 -p address:=1
  driver --ros-args --params-file conveyor.yaml
"""


def process_to_end_with(arguments: list[str]) -> OtherProcess | None:
    """
    Return the process that this one is to end with, if there is one; ``--help``: only the usage.

    :raises ValueError: what was typed for no node makes no sense, and how to write it.
    """
    parser = argparse.ArgumentParser(
        usage=_USAGE,
        description='Drives NFO Sinus inverters on one serial line.',
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument('--version', action='version', version=f'nfo_sinus_driver {VERSION}')
    parser.add_argument(
        '--end-with', nargs='?', const='', metavar='PID',
        help='stop the motors and end when that process has ended; launch files give their own',
    )
    options, others = parser.parse_known_args(remove_ros_args(arguments)[1:])
    given = options.end_with
    if others:
        raise ValueError(
            f'unknown argument {others[0]}: parameters are given as --ros-args -p name:=value'
        )
    if given is None:
        return None
    if not given.isdecimal() or not int(given):
        raise ValueError(f'--end-with {given!r}: the number of a process, such as 1234')
    try:
        return OtherProcess(int(given))
    except ProcessLookupError:
        raise ValueError(f'--end-with {given}: that process has ended already') from None
