# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A test run of one drive: up to a frequency, along, down again, and stop.

Start the driver, and then::

    python3 examples/ride.py --drive /nfo_sinus --frequency 20

The motor is stopped on every way out: at the end, on Ctrl-C, `kill` or a closed terminal, after
a fault, and on an error in this program. Set-points end with it, so that the driver's
`setpoint_timeout` stops the motor even if the program is killed. Exit status 0: the run went to
its end and the stop is confirmed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
import itertools
import math
import sys

from drive_client import FOLLOW_TIMEOUT, ControlNode, Drive, control_node, find, report_fault
from rclpy.utilities import remove_ros_args
from std_srvs.srv import SetBool, Trigger

#: How often a set-point is sent, s; many times within the driver's `setpoint_timeout`.
PERIOD = 0.1


def trapezoid(frequency: float, rate: float, hold: float) -> Iterator[float]:
    """Yield the set-points of a run, Hz, one every PERIOD: up by Hz/s, along for s, down to 0."""
    steps = max(1, math.ceil(abs(frequency) / (rate * PERIOD)))
    up = [frequency * step / steps for step in range(steps)]
    along = itertools.repeat(frequency, max(1, round(hold / PERIOD)))
    return itertools.chain(up, along, reversed(up))


def clear_fault(node: ControlNode, drive: Drive, acknowledge: bool) -> str:
    """Say what fault there is, and acknowledge it where that is wanted; return what is left."""
    if not drive.status.fault:
        return ''
    report_fault(node, drive)
    if not acknowledge:
        return 'remove the cause, then acknowledge the fault: --acknowledge'
    success, message = node.call(drive.fault_ack, Trigger.Request())
    node.get_logger().info(f'{drive.name}: {message}')
    return '' if success else 'the fault is still active'


def follow(
    node: ControlNode, drive: Drive, setpoints: Iterable[float], status_timeout: float
) -> str:
    """Enable the drive and send it the set-points, Hz; return what ended that too early."""
    success, message = node.call(drive.enable, SetBool.Request(data=True))
    node.get_logger().info(f'{drive.name}: {message}')
    if not success:
        return 'it cannot be enabled'
    # a status from before may still be on its way
    node.spin_until(lambda: drive.status.enabled, FOLLOW_TIMEOUT)
    for setpoint in setpoints:
        if node.interrupted:
            return 'interrupted'
        if problem := drive.problem(status_timeout):
            return problem
        drive.send(setpoint)
        node.spin_until(lambda: drive.problem(status_timeout), PERIOD)
        node.get_logger().info(
            f'set-point {setpoint:6.1f} Hz, actual {drive.status.actual:6.1f} Hz',
            throttle_duration_sec=1.0,
        )
    return ''


def ride(node: ControlNode, arguments: argparse.Namespace) -> bool:
    """Do all of it; tell whether it went to its end and the stop is confirmed."""
    drive = Drive(node, arguments.drive)
    problem = find(node, [drive], drive.stop) or clear_fault(node, drive, arguments.acknowledge)
    if problem:
        node.get_logger().error(problem)
        return False
    setpoints = trapezoid(arguments.frequency, arguments.rate, arguments.hold)
    try:
        problem = follow(node, drive, setpoints, arguments.status_timeout)
    finally:
        # also after an enable that was not answered: the driver may have had it all the same
        stopped = node.stop(drive.stop)
    if problem:
        node.get_logger().error(problem)
        # the motor stays stopped: only another run enables it again
        if left := clear_fault(node, drive, arguments.acknowledge):
            node.get_logger().error(left)
    return stopped and not problem


def number(text: str) -> float:
    """Return a number that is neither infinite nor NaN."""
    if not math.isfinite(value := float(text)):
        raise ValueError
    return value


def positive(text: str) -> float:
    """Return a number above 0."""
    if (value := number(text)) <= 0.0:
        raise ValueError
    return value


def main() -> int:
    """Read the command line and do the run."""
    parser = argparse.ArgumentParser(description='Up to a frequency, along, down, and stop.')
    add = parser.add_argument
    add('--drive', default='/nfo_sinus', help="name of the drive's node (%(default)s)")
    add('--frequency', type=number, default=20.0, help='Hz, negative is reverse (%(default)s)')
    add('--rate', type=positive, default=5.0, help='how fast set-points change, Hz/s (%(default)s)')
    add('--hold', type=positive, default=5.0, help='how long to stay there, s (%(default)s)')
    add('--acknowledge', action='store_true', help='acknowledge a fault, before or after the run')
    add('--status-timeout', type=positive, default=2.0,
        help='stop if there is no status for so long, s (%(default)s)')
    arguments = parser.parse_args(remove_ros_args(sys.argv)[1:])
    with control_node('ride') as node:
        return 0 if ride(node, arguments) else 1


if __name__ == '__main__':
    sys.exit(main())
