# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Stands in for rosbag2_py 0.26 where ROS comes from wheels, which have none.

What by_rosbag2.py calls, with the names, the order and the exceptions of its sources; the files
are written and read by rosbags.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
import yaml

from nfo_sinus_driver.node.bags.type_definitions import definition_of


@dataclass
class StorageOptions:
    uri: str
    storage_id: str = ''
    custom_data: dict[str, str] = field(default_factory=dict)
    storage_config_uri: str = ''


@dataclass
class ConverterOptions:
    input_serialization_format: str
    output_serialization_format: str


@dataclass
class TopicMetadata:
    id: int
    name: str
    type: str
    serialization_format: str
    offered_qos_profiles: list[Qos] = field(default_factory=list)
    type_description_hash: str = ''


def to_rclcpp_qos_vector(serialized: str, version: int) -> list[Qos]:
    assert version == 9

    def time(found: dict[str, int]) -> QosTime:
        return QosTime(found['sec'], found['nsec'])

    return [
        Qos(
            history=QosHistory[profile['history'].upper()],
            depth=profile['depth'],
            reliability=QosReliability[profile['reliability'].upper()],
            durability=QosDurability[profile['durability'].upper()],
            deadline=time(profile['deadline']),
            lifespan=time(profile['lifespan']),
            liveliness=QosLiveliness[profile['liveliness'].upper()],
            liveliness_lease_duration=time(profile['liveliness_lease_duration']),
            avoid_ros_namespace_conventions=profile['avoid_ros_namespace_conventions'],
        )
        for profile in yaml.safe_load(serialized)
    ]


class SequentialWriter:
    def open(self, storage: StorageOptions, converter: ConverterOptions, /) -> None:
        assert storage.storage_id == 'mcap'
        # it is read now, and not later
        options = yaml.safe_load(Path(storage.storage_config_uri).read_text(encoding='utf-8'))
        assert set(options) <= {'chunkSize'}
        assert converter.input_serialization_format == converter.output_serialization_format
        self._connections = {}
        try:
            self._writer = Writer(
                Path(storage.uri), version=9, storage_plugin=StoragePlugin.MCAP
            )
            for key, value in storage.custom_data.items():
                self._writer.set_custom_data(key, value)
            self._writer.open()
        except (OSError, WriterError) as error:
            raise RuntimeError(f'Failed to create bag directory ({storage.uri}).') from error

    def create_topic(self, topic: TopicMetadata, /) -> None:
        assert topic.serialization_format == 'cdr'
        self._connections[topic.name] = self._writer.add_connection(
            topic.name,
            topic.type,
            msgdef=definition_of(topic.type),
            rihs01=topic.type_description_hash,
            offered_qos_profiles=topic.offered_qos_profiles,
        )

    def write(self, topic: str, message: bytes, stamp: int, /) -> None:
        self._writer.write(self._connections[topic], stamp, message)

    def close(self) -> None:
        self._writer.close()


class SequentialReader:
    def open(self, storage: StorageOptions, converter: ConverterOptions, /) -> None:
        self._reader = AnyReader([Path(storage.uri)])
        self._reader.open()
        self._messages = self._reader.messages()
        self._next = next(self._messages, None)

    def get_all_topics_and_types(self) -> list[TopicMetadata]:
        return [
            TopicMetadata(connection.id, connection.topic, connection.msgtype, 'cdr')
            for connection in self._reader.connections
        ]

    def has_next(self) -> bool:
        return self._next is not None

    def read_next(self) -> tuple[str, bytes, int]:
        connection, stamp, data = self._next
        self._next = next(self._messages, None)
        return connection.topic, bytes(data), stamp


class SequentialCompressionReader(SequentialReader):
    pass
