# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Bags by the library rosbags, which needs no ROS."""

from __future__ import annotations

from collections.abc import Iterator, Set
from pathlib import Path
from typing import Any

from rclpy.qos import QoSProfile
from rosbags.highlevel import AnyReader
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer as RosbagsWriter, WriterError

from nfo_sinus_driver.node.bags.type_definitions import definition_of, hash_of, name_of

#: How rosbag2 writes "for ever", s and ns.
_FOR_EVER = QosTime(9223372036, 854775807)


class Writer:
    """A new bag; an OSError where it cannot be made or written."""

    def __init__(self, folder: Path, remarks: dict[str, str]) -> None:
        self._connections: dict[str, Connection] = {}
        self._unwritten = False
        try:
            self._writer = RosbagsWriter(
                folder, version=RosbagsWriter.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP
            )
        except WriterError as error:
            raise OSError(str(error)) from error
        for key, value in remarks.items():
            self._writer.set_custom_data(key, value)
        self._writer.open()

    def add_topic(self, topic: str, type_: type, offered: QoSProfile) -> None:
        """Announce a topic, and the quality of service that its publishers offer."""
        name = name_of(type_)
        self._connections[topic] = self._writer.add_connection(
            topic,
            name,
            msgdef=definition_of(name),
            rihs01=hash_of(name),
            offered_qos_profiles=[_as_recorded(offered)],
        )

    def write(self, topic: str, stamp: int, data: bytes) -> None:
        """Write a message as it came, with the time of its receipt, ns."""
        self._writer.write(self._connections[topic], stamp, data)
        self._unwritten = True

    def flush(self) -> None:
        """Hand all that was written to the system: rosbags itself gathers a megabyte."""
        if self._unwritten:
            self._writer.storage.close_chunk()
            self._writer.storage.bio.flush()
            self._unwritten = False

    def close(self) -> None:
        """Make the bag whole."""
        self._writer.close()


def read(folder: Path, wanted: Set[str]) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, time of receipt (ns) and message."""
    with AnyReader([folder]) as reader:
        chosen = [connection for connection in reader.connections if connection.topic in wanted]
        for connection, stamp, data in reader.messages(chosen):
            yield connection.topic, stamp, reader.deserialize(data, connection.msgtype)


def _as_recorded(qos: QoSProfile) -> Qos:
    """Return a profile as rosbag2 finds it when it asks for what a publisher offers."""
    return Qos(
        history=QosHistory[qos.history.name],
        depth=qos.depth,
        reliability=QosReliability[qos.reliability.name],
        durability=QosDurability[qos.durability.name],
        deadline=_FOR_EVER,
        lifespan=_FOR_EVER,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=_FOR_EVER,
        avoid_ros_namespace_conventions=False,
    )
