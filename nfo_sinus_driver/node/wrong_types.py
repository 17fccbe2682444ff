# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Messages that never arrive, for they are of another type than the topic: the graph shows it."""

from __future__ import annotations

from collections.abc import Mapping

from nfo_sinus_msgs.msg import Setpoint
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32

#: How often the graph should be looked at, s.
PERIOD = 2.0
#: How a message of each type is written; the value is harmless to whatever follows it.
_WRITTEN = {
    Float32: '{data: 0.0}',
    Setpoint: '{value: 0.0, unit: 0}',
    JointState: '{name: [joint], velocity: [0.0]}',
}
#: What a node is called of which nothing but its publisher is known yet.
_UNKNOWN = '_NODE_NAME_UNKNOWN_'


class WrongTypes:
    """
    Warns of publishers of another type on the topics of a node, once of each.

    :param types: the topics that the node subscribes to, as they were named there.
    """

    def __init__(self, node: Node, types: Mapping[str, type]) -> None:
        self._node = node
        self._log = node.get_logger()
        self._types = types
        #: The publishers that there are and that were warned of.
        self._told: set[tuple[int, ...]] = set()

    def look(self) -> None:
        """Warn of those that were not there before."""
        found = set()
        for topic, type_ in self._types.items():
            wanted = _name(type_)
            for publisher in self._node.get_publishers_info_by_topic(topic):
                if publisher.topic_type == wanted or publisher.node_name == _UNKNOWN:
                    continue
                found.add(tuple(publisher.endpoint_gid))
                if tuple(publisher.endpoint_gid) not in self._told:
                    name = self._node.resolve_topic_name(topic)
                    node = f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
                    self._log.warning(
                        f'{node} publishes {name} as {publisher.topic_type}, which never arrives '
                        f'here: publish it as {wanted}, such as by ros2 topic pub -r 10 {name} '
                        f"{wanted} '{_WRITTEN[type_]}'"
                    )
        self._told = found


def _name(type_: type) -> str:
    """Return the name of a message type, such as ``std_msgs/msg/Float32``."""
    return f'{type_.__module__.partition(".")[0]}/msg/{type_.__name__}'
