# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Errors that the graph shows: messages that never arrive, and another node of the name."""

from __future__ import annotations

from collections.abc import Mapping

from nfo_sinus_msgs.msg import Setpoint
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32

#: How often the graph should be checked, s.
PERIOD = 2.0
#: How a message of each type is written; the value is harmless.
_WRITTEN = {
    Float32: '{data: 0.0}',
    Setpoint: '{value: 0.0, unit: 0}',
    JointState: '{name: [joint], velocity: [0.0]}',
}
#: The name of a node of which only a publisher is known yet.
_UNKNOWN = '_NODE_NAME_UNKNOWN_'


class GraphWatch:
    """
    Warns of publishers of another type on the topics of a node, and of another node of its name.

    :param types: the topics that the node subscribes to, as they were named there.
    """

    def __init__(self, node: Node, types: Mapping[str, type]) -> None:
        self._node = node
        self._log = node.get_logger()
        self._types = types
        #: The present publishers that were warned of.
        self._known: set[tuple[int, ...]] = set()
        self._has_namesake = False

    def look(self) -> None:
        """Warn of what is new."""
        self._look_at_names()
        self._look_at_types()

    def _look_at_names(self) -> None:
        own = self._node.get_name(), self._node.get_namespace()
        several = self._node.get_node_names_and_namespaces().count(own) > 1
        if several and not self._has_namesake:
            self._log.warning(
                f'another node is called {self._node.get_fully_qualified_name()}, too: a command '
                'reaches one of both motors, or both; end one, give it another name or namespace, '
                'or another ROS_DOMAIN_ID'
            )
        self._has_namesake = several

    def _look_at_types(self) -> None:
        found = set()
        for topic, type_ in self._types.items():
            wanted = _name(type_)
            for publisher in self._node.get_publishers_info_by_topic(topic):
                if publisher.topic_type == wanted or publisher.node_name == _UNKNOWN:
                    continue
                found.add(tuple(publisher.endpoint_gid))
                if tuple(publisher.endpoint_gid) not in self._known:
                    name = self._node.resolve_topic_name(topic)
                    node = f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
                    self._log.warning(
                        f'{node} publishes {name} as {publisher.topic_type}, which never arrives '
                        f'here: publish it as {wanted}, such as by ros2 topic pub -r 10 {name} '
                        f"{wanted} '{_WRITTEN[type_]}'"
                    )
        self._known = found


def _name(type_: type) -> str:
    """Return the name of a message type, such as ``std_msgs/msg/Float32``."""
    return f'{type_.__module__.partition(".")[0]}/msg/{type_.__name__}'
