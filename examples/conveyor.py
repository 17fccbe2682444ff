# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A conveyor: several drives of one bus, and all stop when one of them drops out.

Start the driver with a parameter file such as `config/conveyor.yaml`, and then::

    python3 examples/conveyor.py --drives /infeed /middle --frequency 20

A drive drops out when it has a fault, is disabled by another client, does not respond, or when
its status is older than `--status-timeout`. Name every drive of the bus that the driver may
command: `/nfo_sinus_bus/enable_all` enables those that are not named, too. Ctrl-C stops all.
Exit status 0: ended by Ctrl-C, and every stop is confirmed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import sys

from drive_client import (
    FOLLOW_TIMEOUT,
    ControlNode,
    Drive,
    control_node,
    find,
    first_problem,
    report,
)
from rclpy.client import Client
from rclpy.utilities import remove_ros_args
from std_srvs.srv import Trigger

#: How often set-points are sent, s; many times within the driver's `setpoint_timeout`.
PERIOD = 0.1


def run(
    node: ControlNode,
    drives: Sequence[Drive],
    enable_all: Client,
    frequency: float,
    status_timeout: float,
) -> str:
    """Enable all drives and send them a set-point, Hz, until Ctrl-C; return what ended it else."""
    success, message = node.call(enable_all, Trigger.Request())
    node.get_logger().info(f'{enable_all.srv_name}: {message}')
    if not success:
        return 'not every drive can be enabled'
    # a status from before may still be on its way
    node.spin_until(lambda: all(drive.status.enabled for drive in drives), FOLLOW_TIMEOUT)
    while not node.interrupted:
        if problem := first_problem(drives, status_timeout):
            return problem
        for drive in drives:
            drive.send(frequency)
        node.spin_until(lambda: first_problem(drives, status_timeout), PERIOD)
    return ''


def conveyor(node: ControlNode, arguments: argparse.Namespace) -> bool:
    """Do all of it; tell whether Ctrl-C ended it, and every stop is confirmed."""
    drives = [Drive(node, name) for name in arguments.drives]
    enable_all = node.create_client(Trigger, f'{arguments.bus}/enable_all')
    stop_all = node.create_client(Trigger, f'{arguments.bus}/stop_all')
    if problem := find(node, drives, enable_all, stop_all):
        node.get_logger().error(problem)
        return False
    try:
        problem = run(node, drives, enable_all, arguments.frequency, arguments.status_timeout)
    finally:
        # one call for all: it tells every drive to stop before it waits for the first
        stopped = node.stop(stop_all)
    if problem:
        report(node, problem, drives)
    return stopped and not problem


def main() -> int:
    """Read the command line and run the conveyor."""
    parser = argparse.ArgumentParser(description='All drives run, or all are stopped.')
    add = parser.add_argument
    add('--drives', nargs='+', required=True, metavar='NAME', help="names of the drives' nodes")
    add('--bus', default='/nfo_sinus_bus', help='name of the bus node (%(default)s)')
    add('--frequency', type=float, default=20.0, help='Hz, negative is reverse (%(default)s)')
    add('--status-timeout', type=float, default=1.0,
        help='a drive without a status for so long has dropped out, s (%(default)s)')
    arguments = parser.parse_args(remove_ros_args(sys.argv)[1:])
    with control_node('conveyor') as node:
        return 0 if conveyor(node, arguments) else 1


if __name__ == '__main__':
    sys.exit(main())
