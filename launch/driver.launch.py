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
"""
Start the driver: one serial line, one node for each drive on it.

    ros2 launch nfo_sinus_driver driver.launch.py port:=/dev/ttyUSB0
    ros2 launch nfo_sinus_driver driver.launch.py params_file:=conveyor.yaml namespace:=line1

The node has no ``name=``. It would rename every node of the process, and the process has several:
the bus node and one for each drive. Name the drives by the parameter ``drives`` of
``nfo_sinus_bus`` in the parameter file.

It is not respawned. A driver that ended did so because somebody ended it, or for a reason that
should be looked at; a new one would not run the motors anyway until they are enabled.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.actions import OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

#: Launch arguments that override a parameter of the parameter file, and where it belongs.
OVERRIDES = {
    'port': '/**/nfo_sinus_bus:port',
    'baud_rate': '/**/nfo_sinus_bus:baud_rate',
    'char_format': '/**/nfo_sinus_bus:char_format',
    'address': 'address',
    'drive_timeout': 'drive_timeout',
}


def generate_launch_description():
    """Return the launch description."""
    single = PathJoinSubstitution([FindPackageShare('nfo_sinus_driver'), 'config', 'single.yaml'])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'params_file', default_value=single, description='parameter file (YAML)'
            ),
            DeclareLaunchArgument(
                'namespace', default_value='', description='namespace of all nodes'
            ),
            DeclareLaunchArgument(
                'port', default_value='', description="serial port; '': as the parameter file says"
            ),
            DeclareLaunchArgument(
                'baud_rate', default_value='', description="bit/s; '': as the parameter file says"
            ),
            DeclareLaunchArgument(
                'char_format',
                default_value='',
                description="such as 8E1; '': as the parameter file says",
            ),
            DeclareLaunchArgument(
                'address',
                default_value='',
                description="address of a single drive; '': as the parameter file says",
            ),
            DeclareLaunchArgument(
                'drive_timeout',
                default_value='',
                description="of every drive, s; '': as the parameter file says",
            ),
            DeclareLaunchArgument(
                'log_level', default_value='info', description='debug, info, warn or error'
            ),
            DeclareLaunchArgument(
                'exit_timeout',
                default_value='15',
                description='how long the driver may take to stop the motors before launch kills '
                'it, s; more than shutdown_timeout and 5',
            ),
            OpaqueFunction(function=_driver),
        ]
    )


def _driver(context):
    """Return the driver with the overrides that were given."""
    overrides = []
    for argument, parameter in OVERRIDES.items():
        value = LaunchConfiguration(argument).perform(context)
        if value:
            overrides += ['-p', f'{parameter}:={value}']
    return [
        Node(
            package='nfo_sinus_driver',
            executable='driver',
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('params_file')],
            ros_arguments=['--log-level', LaunchConfiguration('log_level'), *overrides],
            output='screen',
            respawn=False,
            # the time between the signals by which launch ends a process
            sigterm_timeout=LaunchConfiguration('exit_timeout'),
            sigkill_timeout=LaunchConfiguration('exit_timeout'),
        )
    ]
