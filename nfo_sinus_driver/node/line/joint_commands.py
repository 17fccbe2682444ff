# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Set-points for several drives of a line in one message: all that it names get theirs, or none does.

A robot with one wheel that follows turns on the spot. But a joint that follows takes a 0 whatever
the others do: otherwise it goes on turning, for as long as its set-points may be old.
``control_msgs/JointCommand`` is in control_msgs from 5.10 on; where it is not installed, there is
no such topic.
"""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import importlib
import math
import time
from typing import Any

from rclpy.node import Node

from nfo_sinus_driver.node.drive.bus_context import BusContext, JointInput
from nfo_sinus_driver.node.drive.setpoint_checks import Freshness, Origin
from nfo_sinus_driver.node.ros.log_limit import LogLimit

_TOPIC = '~/joint_command'
#: The one interface of a joint that a drive has: rad/s of its output shaft.
_INTERFACE = 'velocity'


def message_type() -> type | None:
    """Return ``control_msgs/JointCommand``, or ``None`` where it is not installed."""
    with contextlib.suppress(ImportError, AttributeError):
        return importlib.import_module('control_msgs.msg').JointCommand
    return None


class JointCommands:
    """Takes ``~/joint_command`` of the bus node, for the joints of all drives of its line."""

    def __init__(self, node: Node, context: BusContext, type_: type) -> None:
        self._context = context
        self._log = node.get_logger()
        self._topic = node.resolve_topic_name(_TOPIC)
        self._freshness = Freshness(lambda: node.get_clock().now().nanoseconds)
        self._limit = LogLimit()
        self._logged_idle = False
        context.subscribe(node, {_TOPIC: (type_, self._on_message)})

    def _on_message(self, message: Any, origin: Origin) -> None:
        try:
            values = self._understood(message)
        except ValueError as error:
            if self._limit.left_out('ignored', time.monotonic()) is not None:
                self._log.warning(f'a message of {self._topic} is ignored, for all joints: {error}')
            return
        idle = [joint for joint, _ in values if not joint.follows]
        if not idle:
            self._logged_idle = False
        for joint, value in values:
            if not idle or (value == 0 and joint.follows):
                joint.take(value, origin)
        if idle and not self._logged_idle:
            self._logged_idle = True
            self._log.info(
                f'messages of {self._topic} arrive, but no joint that they name moves before all '
                f'are enabled: {", ".join(joint.how_to_enable for joint in idle)}'
            )

    def _understood(self, message: Any) -> list[tuple[JointInput, float]]:
        """Return the set-point of each joint of a message, or a ValueError why none gets one."""
        names: Sequence[str] = message.joint_names
        if message.interface_name != _INTERFACE:
            raise ValueError(f'its interface_name is {message.interface_name!r}, not {_INTERFACE}')
        if len(names) != len(message.values):
            raise ValueError(f'it has {len(names)} joint_names, but {len(message.values)} values')
        if not names:
            raise ValueError('it names no joint')
        joints = self._joints(names)
        if len(set(names)) != len(names):
            raise ValueError(f'a joint stands twice in {", ".join(names)}')
        timeouts = [joint.setpoint_timeout for joint in joints if joint.setpoint_timeout]
        stamp = message.header.stamp
        old = self._freshness.why_not(stamp.sec * 10**9 + stamp.nanosec, min(timeouts, default=0.0))
        if old is not None:
            raise ValueError(old.text)
        return [
            (joint, self._setpoint(joint, velocity))
            for joint, velocity in zip(joints, message.values, strict=True)
        ]

    def _joints(self, names: Sequence[str]) -> list[JointInput]:
        """Return the joints of these names, or a ValueError which one is none of this line."""
        here: dict[str, list[JointInput]] = {}
        for joint in self._context.joints:
            here.setdefault(joint.joint_name, []).append(joint)
        for name in names:
            found = here.get(name, ())
            if len(found) != 1:
                raise ValueError(
                    f'there is {"more than one" if found else "no"} joint {name} on this line, '
                    f'which has {", ".join(here)}: joint_name of a drive is the name to use'
                )
        return [here[name][0] for name in names]

    def _setpoint(self, joint: JointInput, velocity: float) -> float:
        if not math.isfinite(velocity):
            raise ValueError(f'the velocity of {joint.joint_name} is {velocity}, no finite number')
        try:
            return joint.setpoint(velocity)
        except ValueError as error:
            raise ValueError(f'{joint.joint_name}: {error}') from error
