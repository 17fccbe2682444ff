# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Bags (rosbag2, MCAP): by rosbag2_py where ROS has it, otherwise by the library rosbags.

Either writes the same bag, and reads that of the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import importlib
import importlib.util
import os
from pathlib import Path
from typing import Any

import yaml

from nfo_sinus_driver.node.bags import cut_off

#: Each imports its library; the first one that can be imported is taken.
_MODULES = ('by_rosbag2', 'by_rosbags')
_LIBRARIES = ('rosbag2_py', 'rosbags')
_INFORMATION = 'rosbag2_bagfile_information'


def why_none() -> str:
    """Return why no bag can be written or read here, and what to do; empty: it can."""
    if _module() is not None:
        return ''
    distribution = os.environ.get('ROS_DISTRO', 'jazzy')
    return (
        'neither rosbag2_py nor rosbags is installed '
        f'(apt install ros-{distribution}-rosbag2-py; without apt: pip install rosbags)'
    )


def is_installed() -> bool:
    """Return whether a library for bags is there, without the time that it takes to import it."""
    return any(importlib.util.find_spec(name) for name in _LIBRARIES)


def create(folder: Path, remarks: dict[str, str]) -> Any:
    """
    Return a new bag, which its library writes; an OSError where that fails.

    :param folder: the bag, a folder that does not exist.
    :param remarks: what the bag is to say of itself.
    """
    module = _module()
    if module is None:
        raise OSError(why_none())
    return module.Writer(folder, remarks)


def read(folder: Path, is_wanted: Callable[[str], bool]) -> Iterator[tuple[str, int, Any]]:
    """
    Yield topic, time of receipt (ns) and message, in the order of receipt.

    :param is_wanted: returns whether a topic is read.
    :raises ValueError: it is no bag, or one that cannot be read.
    """
    wanted = {topic for topic, _ in topics(folder) if is_wanted(topic)}
    with reading():
        if cut_off.files(folder):
            yield from _read_cut_off(folder, wanted)
            return
        yield from _module().read(folder, wanted)


def _read_cut_off(folder: Path, wanted: set[str]) -> Iterator[tuple[str, int, Any]]:
    # here and not above: only a reader needs rclpy
    from rclpy.serialization import deserialize_message

    from nfo_sinus_driver.node.bags.type_definitions import class_of

    for topic, type_, stamp, data in cut_off.messages(folder):
        if topic in wanted:
            yield topic, stamp, deserialize_message(data, class_of(type_))


@contextlib.contextmanager
def reading() -> Iterator[None]:
    """Have all that a damaged bag leads to be an OSError or a ValueError."""
    try:
        yield
    except (OSError, ValueError):
        raise
    except Exception as error:
        # PyYAML and the libraries for bags do not say what they raise
        raise ValueError(f'it is damaged ({type(error).__name__}: {error})') from error


def metadata(folder: Path) -> dict[str, Any]:
    """
    Return what a bag says of itself, or is in it where it was cut off.

    :raises ValueError: it is no bag.
    """
    path = folder / 'metadata.yaml'
    with reading():
        if cut_off.files(folder):
            return cut_off.metadata(folder)
        found = yaml.safe_load(path.read_bytes()) if path.is_file() else None
    if not isinstance(found, dict) or _INFORMATION not in found:
        raise ValueError('it is no bag: a folder with a metadata.yaml is one')
    return found[_INFORMATION]


def topics(folder: Path) -> list[tuple[str, str]]:
    """Return the topics of a bag that have messages, with their types."""
    with reading():
        return [
            (str(topic['topic_metadata']['name']), str(topic['topic_metadata']['type']))
            for topic in metadata(folder)['topics_with_message_count']
            if topic['message_count']
        ]


def _module() -> Any:
    # only when it is needed: the demo runs where there is neither
    for name in _MODULES:
        with contextlib.suppress(ImportError):
            return importlib.import_module(f'nfo_sinus_driver.node.bags.{name}')
    return None
