# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Start simulated drives and the driver for them, to try things without hardware.

    ros2 launch nfo_sinus_driver simulation.launch.py
    ros2 run nfo_sinus_driver simulator inject --link /tmp/nfo_sinus fault 5

    ros2 launch nfo_sinus_driver simulation.launch.py drives:=8
    ros2 topic echo /drive_8/status

    ros2 launch nfo_sinus_driver simulation.launch.py protocol:=movitrac model:=movitrac31 \
        baud_rate:=9600

The driver needs not wait for the simulated drives: it tries the port until it is there. At the end
they have to outlast the driver, which stops the motors first; see below.
"""

import os
import signal

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnProcessExit
from launch.events import matches_action
from launch.events.process import SignalProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

from nfo_sinus_driver.launch_arguments import fail_with_driver, number, simulated_drives, written

_EXIT_TIMEOUT = '15'
#: Runs a command that Ctrl-C does not end, whether terminal or launch pass it on; SIGTERM does.
_OUTLASTS_INTERRUPTS = (
    'sh',
    '-c',
    'trap "" INT; setsid "$0" "$@" & pid=$!; trap "kill $pid" TERM; wait $pid || wait $pid',
)


def generate_launch_description():
    """Return the launch description."""
    # no node, so not to be given ROS arguments
    simulator = ExecuteProcess(
        cmd=[
            *_OUTLASTS_INTERRUPTS,
            ExecutableInPackage('simulator', 'nfo_sinus_driver'),
            '--link',
            LaunchConfiguration('link'),
            '--protocol',
            LaunchConfiguration('protocol'),
            '--model',
            LaunchConfiguration('model'),
            '--baud-rate',
            LaunchConfiguration('baud_rate'),
            '--address',
            ['1-', LaunchConfiguration('drives')],
            '--paced',
        ],
        name='simulator',
        output='screen',
        sigterm_timeout=_EXIT_TIMEOUT,
        sigkill_timeout=_EXIT_TIMEOUT,
        on_exit=Shutdown(reason='the simulated drive has ended'),
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'link', default_value='/tmp/nfo_sinus', description='port to serve and to use'
            ),
            DeclareLaunchArgument(
                'baud_rate', default_value='57600', description='bit rate of the line, bit/s'
            ),
            DeclareLaunchArgument(
                'protocol', default_value='modbus_rtu', description='protocol of the line'
            ),
            DeclareLaunchArgument(
                'model', default_value='sinus_g2', description='family of the simulated drive'
            ),
            DeclareLaunchArgument(
                'namespace', default_value='', description='namespace of all nodes'
            ),
            DeclareLaunchArgument(
                'drives',
                default_value='1',
                description='how many; one is nfo_sinus, several are drive_1, drive_2 and so on',
            ),
            OpaqueFunction(function=_require_numbers),
            simulator,
            OpaqueFunction(function=_start_driver, args=[simulator]),
        ]
    )


def _start_driver(context, simulator):
    """Return the driver, with whose end the simulated drives end."""
    sections = simulated_drives(LaunchConfiguration('drives').perform(context))
    driver = Node(
        package='nfo_sinus_driver',
        executable='driver',
        namespace=LaunchConfiguration('namespace'),
        # a launch that fails or is killed stops no motor
        arguments=['--end-with', str(os.getpid())],
        parameters=[
            {
                **{name: LaunchConfiguration(name) for name in ('baud_rate', 'protocol', 'model')},
                'port': LaunchConfiguration('link'),
                'drive_timeout': 2.0,
            },
            *written(sections),
        ],
        output='screen',
        respawn=False,
        sigterm_timeout=_EXIT_TIMEOUT,
        sigkill_timeout=_EXIT_TIMEOUT,
        on_exit=_end,
    )
    end_simulator = EmitEvent(
        event=SignalProcess(
            signal_number=signal.SIGTERM, process_matcher=matches_action(simulator)
        )
    )
    return [
        driver,
        RegisterEventHandler(OnProcessExit(target_action=driver, on_exit=[end_simulator])),
    ]


def _end(event, context):
    """End the launch with the driver."""
    fail_with_driver(event, context)
    return Shutdown(reason='the driver has ended')


def _require_numbers(context):
    """Refuse what is no number before anything is started."""
    number('baud_rate', LaunchConfiguration('baud_rate').perform(context), whole=True)
    simulated_drives(LaunchConfiguration('drives').perform(context))
