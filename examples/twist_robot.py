# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A robot with two wheels: from `geometry_msgs/Twist` to the set-points of two drives, in Hz.

Start the driver with two drives in the control mode Freque, a short `setpoint_timeout`, and each
in the `stop_with` of the other, then::

    python3 examples/twist_robot.py --ros-args -p wheel_radius:=0.1 -p track:=0.5 \
        -p "gear_ratios:=[20.0, -20.0]" -p pole_pairs:=2

and steer it, as `teleop_twist_keyboard` does, by the topic `cmd_vel`: `linear.x` in m/s, forward
is positive, and `angular.z` in rad/s, to the left is positive (REP 103). Every Twist is passed on
once. When they stay away nothing is sent, and the driver's `setpoint_timeout` ramps both motors
to 0; the next Twist moves them again. When a wheel drops out both are stopped and the program
ends, for a robot with one wheel turns on the spot. Exit status 0: ended by Ctrl-C, and both stops
are confirmed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
import sys

from drive_client import (
    FOLLOW_TIMEOUT,
    SETPOINT_QOS,
    ControlNode,
    Drive,
    control_node,
    find,
    first_problem,
    report,
)
from geometry_msgs.msg import Twist
from rcl_interfaces.msg import ParameterDescriptor
from std_srvs.srv import SetBool, Trigger

#: How long to handle messages before Ctrl-C is looked at again, s.
PERIOD = 0.1

#: The parameters, their defaults, and what they are.
PARAMETERS = {
    'left_drive': ('/left_wheel', "name of the left drive's node"),
    'right_drive': ('/right_wheel', "name of the right drive's node"),
    'bus': ('/nfo_sinus_bus', 'name of the bus node'),
    'wheel_radius': (0.1, 'm'),
    'track': (0.5, 'distance of the wheels, m'),
    'gear_ratios': ([20.0, -20.0], 'motor turns per wheel turn, left, right; negative: mirrored'),
    'pole_pairs': (2, 'of the motors: Hz per turn per second'),
    'max_frequency': (50.0, 'of a motor, Hz, in both directions'),
    'status_timeout': (1.0, 'a wheel without a status for so long has dropped out, s'),
}


@dataclass(frozen=True)
class Base:
    """The mechanics: what `PARAMETERS` says of them, by the same names."""

    wheel_radius: float
    track: float
    gear_ratios: Sequence[float]
    pole_pairs: int
    max_frequency: float

    def __post_init__(self) -> None:
        sizes = (self.wheel_radius, self.track, self.pole_pairs, self.max_frequency)
        if min(sizes) <= 0 or len(self.gear_ratios) != 2:
            raise ValueError('sizes are more than 0, and there are two gear ratios')

    def frequencies(self, linear: float, angular: float) -> list[float]:
        """
        Return the frequencies of the left and the right motor, Hz, without slip.

        :param linear: speed forward, m/s.
        :param angular: turning to the left, rad/s.
        """
        rims = (linear - angular * self.track / 2, linear + angular * self.track / 2)
        wanted = [
            rim / (2 * math.pi * self.wheel_radius) * gear_ratio * self.pole_pairs
            for rim, gear_ratio in zip(rims, self.gear_ratios, strict=True)
        ]
        # both are slowed down alike: the robot keeps to its curve
        excess = max(1.0, *(abs(frequency) / self.max_frequency for frequency in wanted))
        return [frequency / excess for frequency in wanted]


class Robot:
    """Passes Twists on to two drives."""

    def __init__(self, node: ControlNode) -> None:
        self._node = node
        fixed = {
            name: node.declare_parameter(
                name, default, ParameterDescriptor(description=text, read_only=True)
            ).value
            for name, (default, text) in PARAMETERS.items()
        }
        self._base = Base(**{name: fixed[name] for name in Base.__annotations__})
        self._status_timeout = fixed['status_timeout']
        self._wheels = [Drive(node, fixed['left_drive']), Drive(node, fixed['right_drive'])]
        self._stop_all = node.create_client(Trigger, f'{fixed["bus"]}/stop_all')

    def run(self) -> bool:
        """Do all of it; tell whether Ctrl-C ended it, and both stops are confirmed."""
        node = self._node
        if problem := find(node, self._wheels, self._stop_all):
            node.get_logger().error(problem)
            return False
        try:
            problem = self._enable() or self._drive()
        finally:
            # both at once: one after the other, the robot would turn
            stopped = node.stop(self._stop_all)
        if problem:
            report(node, problem, self._wheels)
        return stopped and not problem

    def _enable(self) -> str:
        """Enable both drives; return why that is not possible."""
        for wheel in self._wheels:
            success, message = self._node.call(wheel.enable, SetBool.Request(data=True))
            self._node.get_logger().info(f'{wheel.name}: {message}')
            if not success:
                return f'{wheel.name} cannot be enabled'
        # a status from before may still be on its way
        self._node.spin_until(lambda: all(w.status.enabled for w in self._wheels), FOLLOW_TIMEOUT)
        return ''

    def _drive(self) -> str:
        """Pass Twists on until Ctrl-C; return what ended it else."""
        # not before: with one wheel enabled the robot would turn
        self._node.create_subscription(Twist, 'cmd_vel', self._on_twist, SETPOINT_QOS)
        while not self._node.interrupted:
            if self._node.spin_until(self._problem, PERIOD):
                return self._problem()
        return ''

    def _problem(self) -> str:
        return first_problem(self._wheels, self._status_timeout)

    def _on_twist(self, twist: Twist) -> None:
        linear, angular = twist.linear.x, twist.angular.z
        if not (math.isfinite(linear) and math.isfinite(angular)):
            self._node.get_logger().warning('a Twist that is not finite is ignored')
            return
        for wheel, frequency in zip(
            self._wheels, self._base.frequencies(linear, angular), strict=True
        ):
            wheel.send(frequency)


def main() -> int:
    """Drive the robot."""
    with control_node('twist_robot') as node:
        return 0 if Robot(node).run() else 1


if __name__ == '__main__':
    sys.exit(main())
