# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Bags by rosbag2_py, of ROS 2 Jazzy and newer."""

from __future__ import annotations

from collections.abc import Iterator, Set
import contextlib
from pathlib import Path
import tempfile
from typing import Any

from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rosbag2_py import (
    ConverterOptions,
    SequentialCompressionReader,
    SequentialReader,
    SequentialWriter,
    StorageOptions,
    TopicMetadata,
    to_rclcpp_qos_vector,
)
import yaml

from nfo_sinus_driver.node.bags.bags import metadata
from nfo_sinus_driver.node.bags.type_definitions import class_of, hash_of, name_of

_CDR = 'cdr'
_AS_THEY_ARE = ConverterOptions(
    input_serialization_format=_CDR, output_serialization_format=_CDR
)
#: The version of the metadata in which profiles are written here: words, not numbers.
_VERSION = 9
#: A chunk is kept in memory until it is full: the factory setting holds minutes of a drive.
_SETTINGS = 'chunkSize: 1024'
_FOR_EVER = {'sec': 9223372036, 'nsec': 854775807}


class Writer:
    """A new bag; an OSError where it cannot be made or written."""

    def __init__(self, folder: Path, remarks: dict[str, str]) -> None:
        self._count = 0
        self._writer = SequentialWriter()
        with _writing(), tempfile.NamedTemporaryFile('w', suffix='.yaml') as settings:
            settings.write(_SETTINGS)
            settings.flush()
            options = StorageOptions(
                uri=str(folder), storage_id='mcap', custom_data=remarks,
                storage_config_uri=settings.name,
            )
            self._writer.open(options, _AS_THEY_ARE)

    def add_topic(self, topic: str, type_: type, offered: QoSProfile) -> None:
        """Announce a topic, and the quality of service that its publishers offer."""
        name = name_of(type_)
        self._count += 1
        self._writer.create_topic(
            TopicMetadata(
                id=self._count,
                name=topic,
                type=name,
                serialization_format=_CDR,
                offered_qos_profiles=to_rclcpp_qos_vector(_as_recorded(offered), _VERSION),
                type_description_hash=hash_of(name),
            )
        )

    def write(self, topic: str, stamp: int, data: bytes) -> None:
        """Write a message as it came, with the time of its receipt, ns."""
        with _writing():
            self._writer.write(topic, data, stamp)

    def flush(self) -> None:
        """Nothing: the small chunks are written as they fill."""

    def close(self) -> None:
        """Make the bag whole."""
        with _writing():
            self._writer.close()


def read(folder: Path, wanted: Set[str]) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, time of receipt (ns) and message."""
    compressed = metadata(folder).get('compression_format')
    reader = SequentialCompressionReader() if compressed else SequentialReader()
    reader.open(StorageOptions(uri=str(folder)), _AS_THEY_ARE)
    types = {
        listed.name: class_of(listed.type)
        for listed in reader.get_all_topics_and_types()
        if listed.name in wanted
    }
    while reader.has_next():
        topic, data, stamp = reader.read_next()
        if topic in types:
            yield topic, stamp, deserialize_message(data, types[topic])


@contextlib.contextmanager
def _writing() -> Iterator[None]:
    try:
        yield
    except RuntimeError as error:
        raise OSError(str(error)) from error


def _as_recorded(qos: QoSProfile) -> str:
    """Return a profile as rosbag2 finds it when it asks for what a publisher offers."""
    return yaml.safe_dump(
        [
            {
                'history': qos.history.name.lower(),
                'depth': qos.depth,
                'reliability': qos.reliability.name.lower(),
                'durability': qos.durability.name.lower(),
                'deadline': _FOR_EVER,
                'lifespan': _FOR_EVER,
                'liveliness': 'automatic',
                'liveliness_lease_duration': _FOR_EVER,
                'avoid_ros_namespace_conventions': False,
            }
        ]
    )
