# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Records a run: what its topics say goes to a rosbag2 bag (MCAP), byte for byte as it comes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nfo_sinus_msgs.msg import BusStatistics, DriveStatus, InvSt, Telemetry
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger

from nfo_sinus_driver.demo import bags
from nfo_sinus_driver.node.qos import LATCHED, NEWEST, RELIABLE

_EVENT = '_service_event'
_ROSOUT = QoSProfile(
    depth=1000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
#: How many messages may wait while the machine is busy with something else.
_DEPTH = 1000


def topics_of(drive: str) -> Iterator[tuple[str, type, QoSProfile]]:
    """Yield what is recorded of a drive: topic, type, and the quality that publishers offer."""
    line = drive.rpartition('/')[0]
    yield f'{drive}/setpoint', Float32, NEWEST
    yield f'{drive}/status', DriveStatus, RELIABLE
    yield f'{drive}/inv_st', InvSt, LATCHED
    yield f'{drive}/actual_speed', Float32, RELIABLE
    yield f'{drive}/actual_frequency', Float32, RELIABLE
    yield f'{drive}/telemetry', Telemetry, RELIABLE
    yield f'{drive}/enable/{_EVENT}', SetBool.Event, RELIABLE
    yield f'{drive}/stop/{_EVENT}', Trigger.Event, RELIABLE
    yield f'{drive}/fault_ack/{_EVENT}', Trigger.Event, RELIABLE
    yield f'{line}/nfo_sinus_bus/statistics', BusStatistics, RELIABLE
    yield '/diagnostics', DiagnosticArray, RELIABLE
    yield '/rosout', Log, _ROSOUT


def replay_warning(drive: str) -> str:
    """Return what an operator must know before a bag of this drive is played."""
    return (
        f'`ros2 bag play` publishes {drive}/setpoint, and an enabled drive follows it: play the '
        f'bag in another ROS_DOMAIN_ID, or with `--exclude-topics {drive}/setpoint`'
    )


class RecordingError(Exception):
    """What was to be recorded was not."""


class Recorder(Node):
    """
    Writes what it receives into a bag, which is whole once the context is left.

    By then nothing may be received any more.

    :param folder: the bag, a folder that does not exist.
    :param drive: the full name of the drive node.
    :param remarks: what the bag is to say of itself.
    :param heard: called once, when the first status of the drive is in the bag.
    :raises RecordingError: the bag cannot be made or, at the end, is not whole.
    """

    def __init__(
        self,
        folder: Path,
        drive: str,
        remarks: dict[str, str],
        heard: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__('recorder', enable_rosout=False)
        self._heard: Callable[[], None] | None = heard
        self._error: Exception | None = None
        self._count = 0
        self._began = time.monotonic()
        try:
            self._bag = bags.create(folder, remarks)
        except OSError as error:
            raise RecordingError(f'no bag can be written to {folder}: {error}') from error
        for topic, type_, qos in topics_of(drive):
            self._record(topic, type_, qos)

    @property
    def hears_drive(self) -> bool:
        """The status of the drive has been received."""
        return self._heard is None

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
                self._hear_drive()

        deep = QoSProfile(depth=_DEPTH, reliability=qos.reliability, durability=qos.durability)
        self.create_subscription(type_, topic, write, deep, raw=True)

    def _hear_drive(self) -> None:
        heard, self._heard = self._heard, None
        if heard is not None:
            heard()

    def _write(self, topic: str, stamp: int, data: bytes) -> None:
        if self._error is not None:
            return
        try:
            self._bag.write(topic, stamp, data)
            self._count += 1
        except OSError as error:
            # the run goes on, for it must come to its stop; the end reports it
            self._error = error
