# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The bond of a drive's node with nav2's lifecycle manager, which resets its nodes when one is gone.

Of the protocol of bondcpp this is the end that is watched: it says ten times a second that it is
there, and once that it ends. bondpy is not used: it starts a thread for every heartbeat that it
receives, from each node on the topic, and what it would tell, that the manager is gone, is nothing
that a node of nav2 goes by either.
"""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import importlib
import os
from typing import Any
import uuid

from rclpy.node import Node

from nfo_sinus_driver.node.ros.publish_queue import PublishQueue
from nfo_sinus_driver.node.ros.qos import RELIABLE

#: What nav2_util::LifecycleNode has, s.
_PERIOD, _TIMEOUT = 0.1, 4.0


def message_type() -> Any:
    """Return ``bond/Status``; a ValueError says what to do where it is not installed."""
    with contextlib.suppress(ImportError, AttributeError):
        return importlib.import_module('bond.msg').Status
    distribution = os.environ.get('ROS_DISTRO', 'jazzy')
    raise ValueError(
        f'bond is true, but the package bond is not installed: apt install ros-{distribution}-bond'
    )


class Bond:
    """
    Tells that a node is there, as long as it is so.

    All of it is published by the queue, on the thread that publishes the status: where that no
    longer does so, the bond breaks.

    :param is_there: returns whether there is a bond.
    """

    def __init__(self, node: Node, queue: PublishQueue, is_there: Callable[[], bool]) -> None:
        self._node = node
        self._queue = queue
        self._is_there = is_there
        self._type = message_type()
        self._publisher = node.create_publisher(self._type, 'bond', RELIABLE)
        #: A bond that is formed again is another one; ``''``: there is none.
        self._instance = ''
        queue.put_every(_PERIOD, self._beat)

    def beat(self) -> None:
        """Tell a change now, before all that waits to be published; from any thread."""
        self._queue.put_first(self._beat)

    def _beat(self) -> None:
        if self._is_there():
            self._instance = self._instance or str(uuid.uuid4())
            self._publish(active=True)
        elif self._instance:
            self._publish(active=False)
            self._instance = ''

    def _publish(self, *, active: bool) -> None:
        message = self._type(
            id=self._node.get_name(), instance_id=self._instance, active=active,
            heartbeat_period=_PERIOD, heartbeat_timeout=_TIMEOUT,
        )
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
