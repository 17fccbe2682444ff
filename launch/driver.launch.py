# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Start the driver: one serial line, one node for each drive on it.

    ros2 launch nfo_sinus_driver driver.launch.py port:=/dev/ttyUSB0
    ros2 launch nfo_sinus_driver driver.launch.py port:=/dev/ttyUSB0 \
        protocol:=movitrac model:=movitrac31
    ros2 launch nfo_sinus_driver driver.launch.py port:=can0 protocol:=canopen address:=1
    ros2 launch nfo_sinus_driver driver.launch.py params_file:=conveyor.yaml namespace:=line1

The node action has no ``name=``: it would rename every node of the process, and the process has
several, the bus node and one for each drive. The drives are named by the parameter ``drives`` of
``nfo_sinus_bus`` instead.

The driver ends, with its motors stopped, when this launch is gone, however that happened.

The driver is not respawned. When it ended, an operator ended it or something is wrong that an
operator should look at; and a new one lets no motor turn before it is enabled anyway. Where its
status was not 0, that of ``ros2 launch`` is 1; the rest of the launch goes on.
"""

import os
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from nfo_sinus_driver.launch_arguments import (
    exit_timeout,
    fail_with_driver,
    log_level,
    number,
    parameter_file,
    switch,
    written,
)

#: Launch arguments that overrule a parameter of the same name in the parameter file: for which
#: nodes, and what it is.
OVERRIDES = {
    'port': ('/**/nfo_sinus_bus', str, 'serial port, or a CAN interface'),
    'protocol': ('/**/nfo_sinus_bus', str, 'protocol of the line, such as movitrac'),
    'baud_rate': ('/**/nfo_sinus_bus', int, 'bit rate, bit/s'),
    'char_format': ('/**/nfo_sinus_bus', str, 'character format, such as 8E1'),
    'address': ('/**', int, 'address of the drive, where there is one'),
    'model': ('/**', str, 'family of the drives, such as movitrac31'),
    'family': ('/**', str, 'in place of model: a name, the path of a NAME.vfd.yaml, or package://'),
    'autostart': ('/**', bool, 'false: an operator or a lifecycle manager configures the drives'),
    'use_sim_time': ('/**', bool, 'true: stamps are of /clock'),
}

CONVERTED = {
    bool: switch,
    int: lambda name, given: number(name, given, whole=True),
    str: lambda _, given: given,
}


def generate_launch_description():
    """Return the launch description."""
    declare = DeclareLaunchArgument
    overrides = [
        declare(name, default_value='', description=f'{what}; empty: as the parameter file says')
        for name, (_, _, what) in OVERRIDES.items()
    ]
    return LaunchDescription(
        [
            declare(
                'params_file',
                default_value='single.yaml',
                description='parameter file: a path, or the name of one in config/',
            ),
            declare('namespace', default_value='', description='namespace of all nodes'),
            *overrides,
            declare(
                'log_level',
                default_value='info',
                description='debug, info, warn, error or fatal',
            ),
            declare(
                'exit_timeout',
                default_value='15',
                description='how long the driver may take to stop its motors before launch kills '
                'it, s; at least 10 more than the parameter shutdown_timeout',
            ),
            OpaqueFunction(function=_start_driver),
        ]
    )


def _start_driver(context):
    """Return the driver, with the overrides that were given."""

    def given(name):
        return LaunchConfiguration(name).perform(context)

    # all of it before the driver is started
    longest_end = str(exit_timeout(given('exit_timeout')))
    level = log_level(given('log_level'))
    share = FindPackageShare('nfo_sinus_driver').perform(context)
    params_file = parameter_file(given('params_file'), Path(share) / 'config')
    overrides = _overrides(context)
    return [
        Node(
            package='nfo_sinus_driver',
            executable='driver',
            namespace=LaunchConfiguration('namespace'),
            # a launch that fails or is killed leaves no process that stops the motors
            arguments=['--end-with', str(os.getpid())],
            parameters=[params_file, *overrides],
            ros_arguments=['--log-level', level],
            output='screen',
            respawn=False,
            # launch sends SIGINT, then SIGTERM, then SIGKILL, this far apart
            sigterm_timeout=longest_end,
            sigkill_timeout=longest_end,
            on_exit=fail_with_driver,
        )
    ]


def _overrides(context):
    """Return a parameter file with the overrides that were given, in a list; or an empty list."""
    sections = {}
    for name, (nodes, type_, _) in OVERRIDES.items():
        given = LaunchConfiguration(name).perform(context)
        if given:
            section = sections.setdefault(nodes, {'ros__parameters': {}})
            section['ros__parameters'][name] = CONVERTED[type_](name, given)
    return written(sections)
