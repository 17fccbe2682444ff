# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Records a run: what its topics say goes to a rosbag2 bag (MCAP), byte for byte as it comes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import json
from pathlib import Path
import re
import time
from typing import TYPE_CHECKING, Any

from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray
from nfo_sinus_msgs.msg import BusStatistics, DriveStatus, InvSt, Telemetry
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger

from nfo_sinus_driver.node.qos import LATCHED, NEWEST, RELIABLE

if TYPE_CHECKING:
    from rosbags.interfaces import Connection, Qos

_EVENT = '_service_event'
_ROSOUT = QoSProfile(
    depth=1000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
#: How many messages may wait while the machine is busy with something else.
_DEPTH = 1000
#: How rosbag2 writes "for ever", s and ns.
_FOR_EVER = (9223372036, 854775807)


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
        # here and not above: the demo runs where there is only ROS
        from rosbags.rosbag2 import StoragePlugin, Writer

        super().__init__('recorder', enable_rosout=False)
        self._heard: Callable[[], None] | None = heard
        self._error: Exception | None = None
        self._count = 0
        self._began = time.monotonic()
        self._writer = Writer(
            folder, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP
        )
        for key, value in remarks.items():
            self._writer.set_custom_data(key, value)
        try:
            self._writer.open()
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
            self._writer.close()
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
        name = name_of(type_)
        connection = self._writer.add_connection(
            topic,
            name,
            msgdef=definition_of(name),
            rihs01=hash_of(name),
            offered_qos_profiles=[_as_recorded(qos)],
        )
        latest = 0

        def write(data: bytes, info: dict[str, Any]) -> None:
            nonlocal latest
            # some middlewares do not say when a message came; and the system's clock may be set
            # back, but a bag's must not
            latest = max(latest, info.get('received_timestamp') or time.time_ns())
            self._write(connection, latest, data)
            if type_ is DriveStatus:
                self._hear_drive()

        deep = QoSProfile(depth=_DEPTH, reliability=qos.reliability, durability=qos.durability)
        self.create_subscription(type_, topic, write, deep, raw=True)

    def _hear_drive(self) -> None:
        heard, self._heard = self._heard, None
        if heard is not None:
            heard()

    def _write(self, connection: Connection, stamp: int, data: bytes) -> None:
        if self._error is not None:
            return
        try:
            self._writer.write(connection, stamp, data)
            self._count += 1
        except OSError as error:
            # the run goes on, for it must come to its stop; the end reports it
            self._error = error


def _as_recorded(qos: QoSProfile) -> Qos:
    """Return a profile as rosbag2 finds it when it asks for what a publisher offers."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    for_ever = QosTime(*_FOR_EVER)
    return Qos(
        history=QosHistory[qos.history.name],
        depth=qos.depth,
        reliability=QosReliability[qos.reliability.name],
        durability=QosDurability[qos.durability.name],
        deadline=for_ever,
        lifespan=for_ever,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=for_ever,
        avoid_ros_namespace_conventions=False,
    )


_RULE = '=' * 80 + '\n'
#: The type of a field that is a message of some package, at the beginning of a line.
_NESTED = re.compile(r'^\s*([A-Za-z]\w*(?:/\w+)+|[A-Z]\w*)(?:\[[^\]]*\])?\s+\w', re.MULTILINE)
_INCLUDE = re.compile(r'^#include .*\n', re.MULTILINE)

#: What ROS makes of a service for its introspection; no package installs it as a file.
_EVENT_TYPE = """\
module {package} {{
  module srv {{
    struct {service}_Event {{
      service_msgs::msg::ServiceEventInfo info;
      sequence<{package}::srv::{service}_Request, 1> request;
      sequence<{package}::srv::{service}_Response, 1> response;
    }};
  }};
}};
"""


def name_of(type_: type) -> str:
    """Return the name of a message class, such as ``std_msgs/msg/Float32``."""
    return '/'.join([*type_.__module__.split('.')[:2], type_.__name__])


def definition_of(name: str) -> str:
    """Return the whole definition of a type, in the two ways that rosbag2 lays down."""
    if '/srv/' in name:
        return _event_definition(name)
    return _message_definition(name, {name})


def hash_of(name: str) -> str:
    """Return the hash of a type, ``RIHS01_…``."""
    described = json.loads(_file(name.removesuffix('_Event'), '.json').read_text())
    hashes = {one['type_name']: one['hash_string'] for one in described['type_hashes']}
    return str(hashes[name])


def _message_definition(name: str, seen: set[str]) -> str:
    text = _file(name, '.msg').read_text()
    package = name.split('/')[0]
    parts = [text]
    for found in _NESTED.findall(text):
        nested = found if '/' in found else f'{package}/{found}'
        if nested.count('/') == 1:
            nested = nested.replace('/', '/msg/')
        if nested not in seen:
            seen.add(nested)
            parts.append(f'{_RULE}MSG: {nested}\n{_message_definition(nested, seen)}')
    return '\n'.join(parts)


def _event_definition(name: str) -> str:
    package, _, event = name.split('/')
    service = event.removesuffix('_Event')
    parts = {name: _EVENT_TYPE.format(package=package, service=service)}
    for used in (
        f'{package}/srv/{service}',
        'service_msgs/msg/ServiceEventInfo',
        'builtin_interfaces/msg/Time',
    ):
        # all that is included is here, and not every reader skips the line
        parts[used] = _INCLUDE.sub('', _file(used, '.idl').read_text())
    return ''.join(f'{_RULE}IDL: {used}\n{text}\n' for used, text in parts.items())


def _file(name: str, suffix: str) -> Path:
    package, kind, type_ = name.split('/')
    return Path(get_package_share_directory(package)) / kind / f'{type_}{suffix}'
