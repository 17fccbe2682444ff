# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The set-points of one drive, from three topics of its own and one for all drives of its line: the
newest valid one counts, from whichever topic.
"""

from __future__ import annotations

from collections.abc import Collection
import math
import time

from builtin_interfaces.msg import Time
from nfo_sinus_msgs.msg import Setpoint
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32

from nfo_sinus_driver.catalog.status import FREQUENCY, PROCESS_VALUE, SPEED, TORQUE
from nfo_sinus_driver.drive import Cause, DriveError, Report
from nfo_sinus_driver.drive.known.settings import MONITOR
from nfo_sinus_driver.node.drive.bus_context import BusContext
from nfo_sinus_driver.node.drive.managed_drive import ManagedDrive
from nfo_sinus_driver.node.drive.setpoint_checks import Freshness, Origin, Sources
from nfo_sinus_driver.node.messages.messages import Joint, control_mode, require_whole
from nfo_sinus_driver.node.messages.serialized import float32
from nfo_sinus_driver.node.ros.log_limit import LogLimit
from nfo_sinus_driver.node.ros.qos import NEWEST

#: The control mode that each unit is for, and what it is called.
_UNITS = {
    Setpoint.HZ: (FREQUENCY.mode, 'Hz'),
    Setpoint.RPM: (SPEED.mode, 'rpm'),
    Setpoint.PERCENT_TORQUE: (TORQUE.mode, '% of nominal torque'),
    Setpoint.PROCESS: (PROCESS_VALUE.mode, 'the process unit'),
}


class Setpoints:
    """Passes set-points to the drive of a node; logs those that make no sense."""

    def __init__(
        self, node: Node, context: BusContext, managed: ManagedDrive, joint: Joint
    ) -> None:
        self._log = node.get_logger()
        self._managed = managed
        self._joint = joint
        self._logged_idle = False
        self._warned_of_joint = False
        self._limit = LogLimit()
        #: The last stamp was one that is to come, and that was reported.
        self._was_ahead = False
        self._joint_command = node.resolve_topic_name('~/joint_command')
        #: The publishers of a topic are looked up there, which takes longer than a set-point has.
        self._queue = context.publish_queue
        self._node = node
        self._sources = Sources()
        self._keep = context.black_box.stream(
            node.resolve_topic_name('~/setpoint'), Float32, NEWEST, lambda _, value: float32(value)
        )
        self._freshness = Freshness(lambda: node.get_clock().now().nanoseconds)
        context.subscribe(
            node,
            {
                '~/setpoint': (Float32, self._on_setpoint),
                '~/setpoint_stamped': (Setpoint, self._on_stamped),
                '~/joint_command': (JointState, self._on_joint_command),
            },
        )
        context.on_setpoint_all.append(self._on_setpoint_all)
        context.joints.append(self)

    def be_quiet(self, quiet: bool) -> None:
        """Log, or do not log, that set-points arrive while the drive is not enabled."""
        self._logged_idle = quiet

    def _on_setpoint(self, message: Float32, origin: Origin) -> None:
        self.take(self._managed.scale.of_drive(message.data), origin)

    def _on_setpoint_all(self, message: Float32, origin: Origin) -> None:
        # a monitored drive takes no part in commands for all
        if self._managed.settings.method != MONITOR:
            self._on_setpoint(message, origin)

    def _on_stamped(self, message: Setpoint, origin: Origin) -> None:
        if not self._managed.active:
            return
        try:
            mode = control_mode(self._managed.drive)
        except ValueError as error:
            self._ignore('mode', f'set-point ignored: {error}')
            return
        meant, unit = _UNITS.get(message.unit, ('', f'unit {message.unit}'))
        if mode != meant:
            self._ignore('unit', f'set-point in {unit} ignored: the control mode is {mode}')
            return
        if self._is_of_now(message.header.stamp):
            self.take(message.value, origin)

    def _on_joint_command(self, message: JointState, origin: Origin) -> None:
        if not self._managed.active:
            return
        try:
            require_whole(message)
        except ValueError as error:
            self._ignore('arrays', f'joint command ignored: {error}')
            return
        if self._joint.name not in message.name:
            if not self._warned_of_joint:
                self._warned_of_joint = True
                self._log.warning(
                    f'{self._joint_command} has no joint {self._joint.name}, only '
                    f'{", ".join(message.name) or "none"}: ignored; joint_name is the name to use'
                )
            return
        if not message.velocity:
            self._ignore('no velocity', 'joint command ignored: it has no velocity')
            return
        velocity = message.velocity[message.name.index(self._joint.name)]
        try:
            value = self._joint.setpoint(velocity, self._managed.drive)
        except ValueError as error:
            self._ignore('joint', f'joint command ignored: {error}')
            return
        self.take(value, origin)

    def _is_of_now(self, stamp: Time) -> bool:
        """
        Return whether a stamp is within ``setpoint_timeout`` of the node's clock; log why not.

        A clock that is wrong is reported once, until a stamp is right again.
        """
        made = stamp.sec * 10**9 + stamp.nanosec
        old = self._freshness.why_not(made, self.setpoint_timeout)
        if old is None or old.kind == 'repeated':
            self._was_ahead = False
        if old is not None and not (old.kind == 'ahead' and self._was_ahead):
            is_logged = self._ignore(old.kind, f'set-point ignored: {old.text}')
            self._was_ahead = self._was_ahead or (old.kind == 'ahead' and is_logged)
        return old is None

    # --- as one of the joints of the line -----------------------------------------------------

    @property
    def joint_name(self) -> str:
        """The name of the output shaft in messages."""
        return self._joint.name

    @property
    def setpoint_timeout(self) -> float:
        """After how long a set-point is old, s; 0: never."""
        return self._managed.settings.setpoint_timeout

    @property
    def follows(self) -> bool:
        """The motor follows set-points."""
        return self._managed.active and self._managed.drive.following

    @property
    def how_to_enable(self) -> str:
        """What to call so that the motor follows set-points."""
        return self._managed.wording.enable

    def setpoint(self, velocity: float) -> float:
        """Return the set-point for a velocity, rad/s; a ValueError says why there is none."""
        settings = self._managed.settings
        if not settings.follows_setpoints:
            why = Report(Cause.OWN_REFERENCE, reference=settings.reference)
            raise ValueError(self._managed.wording.say(why))
        return self._joint.setpoint(velocity, self._managed.drive)

    def take(self, value: float, origin: Origin) -> None:
        """Take a set-point in the unit of the drive, or log why it is ignored."""
        if not self._managed.active:
            return
        if not math.isfinite(value):
            self._ignore('number', f'set-point {value} ignored: it is not a finite number')
            return
        try:
            self._managed.drive.set_setpoint(value)
        except DriveError as error:
            self._ignore('refused', self._managed.wording.say(error))
            return
        self._keep(time.monotonic(), self._managed.scale.shown(value))
        if self._managed.drive.following:
            self._logged_idle = False
            self._warn_of_two(self._sources.take_setpoint(origin, value, time.monotonic()))
        elif not self._logged_idle and self._managed.drive.snapshot.connected:
            # before that an enable would be refused
            self._logged_idle = True
            enable = self._managed.wording.enable
            self._log.info(
                f'set-points arrive, but the drive is not enabled: {enable} to follow them'
            )

    def _warn_of_two(self, topics: Collection[str]) -> None:
        """Warn of two sources of set-points at once, unless there is but one."""
        if not topics or self._limit.left_out('sources', time.monotonic()) is None:
            return

        def warn() -> None:
            named = ' and '.join(
                f'{topic} (published by {self._publishers(topic)})' for topic in sorted(topics)
            )
            self._log.warning(
                f'different set-points come from two sources at once, and the motor follows each '
                f'in turn: {named}; let one of them publish at a time'
            )

        self._queue.put(warn)

    def _publishers(self, topic: str) -> str:
        found = self._node.get_publishers_info_by_topic(topic)
        names = {
            f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}' for publisher in found
        }
        return ' and '.join(sorted(names)) or 'a node that has ended'

    def _ignore(self, kind: str, text: str) -> bool:
        """Log why something is ignored, unless its kind was logged just now; return whether."""
        if self._limit.left_out(kind, time.monotonic()) is None:
            return False
        self._log.warning(text)
        return True
