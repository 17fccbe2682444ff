# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Records runs: what topics say goes to a rosbag2 bag (MCAP), byte for byte as it comes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from pathlib import Path
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nfo_sinus_msgs.msg import BusStatistics, DriveStatus, InvSt, Telemetry
from rcl_interfaces.msg import Log
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger

from nfo_sinus_driver.node.bags import bags
from nfo_sinus_driver.node.bags.type_definitions import class_of
from nfo_sinus_driver.node.ros.qos import LATCHED, NEWEST, RELIABLE, ROSOUT, newest

_EVENT = '_service_event'
#: How many messages may wait while the machine is busy with something else.
_DEPTH = 1000
#: How long what was sent before the end may be on its way, s.
_ON_ITS_WAY = 0.5
#: How long what came may be in memory alone, s.
_FLUSH = 1.0


def topics_of(*drives: str) -> dict[str, tuple[type, QoSProfile]]:
    """Return what is recorded of drives: topics, types, and the quality that publishers offer."""
    found: dict[str, tuple[type, QoSProfile]] = {}
    for drive in drives:
        line = _line_of(drive)
        found |= {
            f'{drive}/setpoint': (Float32, NEWEST),
            f'{drive}/status': (DriveStatus, RELIABLE),
            f'{drive}/inv_st': (InvSt, LATCHED),
            f'{drive}/actual_speed': (Float32, RELIABLE),
            f'{drive}/actual_frequency': (Float32, RELIABLE),
            f'{drive}/telemetry': (Telemetry, RELIABLE),
            f'{drive}/enable/{_EVENT}': (SetBool.Event, RELIABLE),
            f'{drive}/stop/{_EVENT}': (Trigger.Event, RELIABLE),
            f'{drive}/quick_stop/{_EVENT}': (Trigger.Event, RELIABLE),
            f'{drive}/rapid_stop/{_EVENT}': (Trigger.Event, RELIABLE),
            f'{drive}/fault_ack/{_EVENT}': (Trigger.Event, RELIABLE),
            f'{line}/stop_all/{_EVENT}': (Trigger.Event, RELIABLE),
            f'{line}/disable_all/{_EVENT}': (Trigger.Event, RELIABLE),
            f'{line}/enable_all/{_EVENT}': (Trigger.Event, RELIABLE),
            f'{line}/statistics': (BusStatistics, RELIABLE),
        }
    return {**found, '/diagnostics': (DiagnosticArray, RELIABLE), '/rosout': (Log, ROSOUT)}


def _line_of(drive: str) -> str:
    """Return the full name of the bus node of a drive."""
    return f'{drive.rpartition("/")[0]}/nfo_sinus_bus'


def replay_warning(*drives: str) -> str:
    """Return what an operator must know before a bag of these drives is played."""
    obeyed = ' '.join(topic for topic, (_, qos) in topics_of(*drives).items() if qos is NEWEST)
    return (
        '`ros2 bag play` publishes set-points, and an enabled drive follows them: play the '
        f'bag in another ROS_DOMAIN_ID, or with `--exclude-topics {obeyed}`'
    )


class RecordingError(Exception):
    """What was to be recorded was not."""


class Recorder(Node):
    """
    Writes what it receives into a bag, which is whole once the context is left.

    By then nothing may be received any more.

    :param folder: the bag, a folder that does not exist.
    :param drives: the full names of the drive nodes.
    :param remarks: what the bag is to say of itself.
    :param heard: called with the name of each drive, when its first status is in the bag.
    :raises RecordingError: the bag cannot be made or, at the end, is not whole.
    """

    def __init__(
        self,
        folder: Path,
        drives: Sequence[str],
        remarks: dict[str, str],
        heard: Callable[[str], None] = lambda _: None,
    ) -> None:
        super().__init__('recorder', enable_rosout=False)
        self._heard = heard
        #: The drives of which no status has come yet.
        self._silent = dict.fromkeys(drives)
        self._error: Exception | None = None
        self._count = 0
        self._began = time.monotonic()
        #: When the last message was written that came before a moment, ns, of the system's clock.
        self._written = self._began
        self._until = math.inf
        try:
            self._bag = bags.create(folder, remarks)
        except OSError as error:
            raise RecordingError(f'no bag can be written to {folder}: {error}') from error
        known = topics_of(*drives)
        for topic, (type_, qos) in known.items():
            self._record(topic, type_, qos)
        #: The nodes whose calls are recorded, and the topics that are recorded already.
        self._nodes = {*drives, *map(_line_of, drives)}
        self._recorded = set(known)
        # not by the clock of a simulation, which may stand
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_FLUSH, self._flush, clock=steady)
        self.create_timer(_FLUSH, self._record_calls, clock=steady)

    @property
    def silent(self) -> list[str]:
        """The drives of which no status has been received."""
        return list(self._silent)

    def catch_up(self) -> None:
        """Wait until what was sent by now is in the bag: on a busy machine much of it waits."""
        self._written = time.monotonic() + _ON_ITS_WAY
        self._until = time.time_ns() + _ON_ITS_WAY * 1e9
        while (left := self._written + _ON_ITS_WAY - time.monotonic()) > 0:
            time.sleep(left)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *cause: object) -> None:
        try:
            self._bag.close()
        except OSError as error:
            self._error = self._error or error
        self.destroy_node()
        # a run that failed has more to report than its bag
        if cause[0] is None:
            self._judge()

    def _judge(self) -> None:
        if self._error is not None:
            raise RecordingError(f'the bag is not whole: {self._error}')
        if not self._count:
            seconds = time.monotonic() - self._began
            raise RecordingError(f'the bag is empty: nothing was heard in {seconds:.1f} s')

    def _record(self, topic: str, type_: type, qos: QoSProfile) -> None:
        self._bag.add_topic(topic, type_, qos)
        latest = 0

        def write(data: bytes, info: dict[str, Any]) -> None:
            nonlocal latest
            # some middlewares do not say when a message came; and the system's clock may be set
            # back, but a bag's must not
            latest = max(latest, info.get('received_timestamp') or time.time_ns())
            self._write(topic, latest, data)
            if type_ is DriveStatus:
                self._hear(topic.removesuffix('/status'))

        deep = newest(_DEPTH, qos.reliability, qos.durability)
        self.create_subscription(type_, topic, write, deep, raw=True)

    def _record_calls(self) -> None:
        """Record what nodes publish of their calls (``introspection``), as soon as it is found."""
        for topic, types in self.get_topic_names_and_types():
            service, _, last = topic.rpartition('/')
            of_these = last == _EVENT and service.rpartition('/')[0] in self._nodes
            if of_these and topic not in self._recorded:
                self._recorded.add(topic)
                self._record(topic, class_of(types[0]), RELIABLE)

    def _hear(self, drive: str) -> None:
        if drive in self._silent:
            del self._silent[drive]
            self._heard(drive)

    def _flush(self) -> None:
        """Have on disk what came, for a recorder that is killed."""
        try:
            self._bag.flush()
        except OSError as error:
            self._error = self._error or error

    def _write(self, topic: str, stamp: int, data: bytes) -> None:
        if stamp < self._until:
            self._written = max(self._written, time.monotonic())
        if self._error is not None:
            return
        try:
            self._bag.write(topic, stamp, data)
            self._count += 1
        except OSError as error:
            # the run goes on, for it must come to its stop; the end reports it
            self._error = error
