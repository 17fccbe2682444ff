# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Start a robot with two driven wheels: the driver, and ros2_control with diff_drive_controller.

    ros2 launch nfo_sinus_driver diff_drive.launch.py folder:=my_robot port:=/dev/ttyUSB0

What it needs beside this package, and what the files of the folder mean: docs/ros2_control.md.
No motor turns before the drives are enabled.
"""

from ament_index_python.packages import get_package_prefix
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.substitutions import FileContent, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from nfo_sinus_driver.launch_arguments import require_packages

#: What is started here, and what it is for.
NEEDED = {
    'robot_state_publisher': 'the frames of the robot',
    'controller_manager': 'ros2_control',
    'diff_drive_controller': 'the velocities of the wheels',
    'joint_state_broadcaster': 'the positions of the wheels',
    'joint_state_topic_hardware_interface': 'the way from ros2_control to the drives',
}


def generate_launch_description():
    """Return the launch description."""
    share = FindPackageShare('nfo_sinus_driver')
    folder = LaunchConfiguration('folder')
    driver = IncludeLaunchDescription(
        PathJoinSubstitution([share, 'launch', 'driver.launch.py']),
        launch_arguments={
            'params_file': PathJoinSubstitution([folder, 'drives.yaml']),
            'port': LaunchConfiguration('port'),
        }.items(),
    )
    controllers = PathJoinSubstitution([folder, 'controllers.yaml'])
    robot = FileContent(PathJoinSubstitution([folder, 'robot.urdf']))
    robot_state_publisher = Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        parameters=[{'robot_description': ParameterValue(robot, value_type=str)}],
        output='screen',
    )
    # it waits for the robot's description on the topic robot_description
    controller_manager = Node(
        package='controller_manager',
        executable='ros2_control_node',
        parameters=[controllers],
        output='screen',
    )
    spawner = Node(
        package='controller_manager',
        executable='spawner',
        arguments=[
            'joint_state_broadcaster',
            'diff_drive_controller',
            '--param-file',
            controllers,
        ],
        output='screen',
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'folder',
                default_value=PathJoinSubstitution([share, 'config', 'diff_drive']),
                description='folder of drives.yaml, robot.urdf and controllers.yaml',
            ),
            DeclareLaunchArgument(
                'port', default_value='', description='serial port; empty: as drives.yaml says'
            ),
            # before the driver: a launch that fails half-way would leave half a robot
            OpaqueFunction(function=_require_packages),
            driver,
            robot_state_publisher,
            controller_manager,
            spawner,
        ]
    )


def _require_packages(context):
    """Refuse to start anything where a package is missing."""
    require_packages(NEEDED, get_package_prefix)
