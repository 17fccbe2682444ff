# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Errors that the graph shows: messages that never arrive, and another node of the name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from rclpy.node import Node

#: How often the graph should be checked, s.
PERIOD = 5.0
#: How a message of each type is written; the value is harmless.
_WRITTEN = {
    'std_msgs/msg/Float32': '{data: 0.0}',
    'nfo_sinus_msgs/msg/Setpoint': '{value: 0.0, unit: 0}',
    'sensor_msgs/msg/JointState': '{name: [joint], velocity: [0.0]}',
    'control_msgs/msg/JointCommand':
        '{joint_names: [joint], interface_name: velocity, values: [0.0]}',
}
#: The name of a node of which only a publisher is known yet.
_UNKNOWN = '_NODE_NAME_UNKNOWN_'


class GraphWatch:
    """
    Warns of publishers of another type on the topics of nodes, and of other nodes of their names.

    One look at the graph is for all nodes of the process: it has hundreds of topics with many
    drives, and is the same for each of them.
    """

    def __init__(self) -> None:
        #: The topics that each node subscribes to, with their whole names.
        self._topics: list[tuple[Node, Mapping[str, type]]] = []
        #: The present publishers that were warned of.
        self._known: set[tuple[int, ...]] = set()
        self._have_namesake: set[Node] = set()

    def add(self, node: Node, types: Mapping[str, type]) -> None:
        """Watch over a node, and the topics that it subscribes to."""
        whole = {node.resolve_topic_name(topic): type_ for topic, type_ in types.items()}
        self._topics.append((node, whole))

    def look_at_graph(self) -> None:
        """Warn of what is new."""
        if not self._topics:
            return
        any_node, _ = self._topics[0]
        names = Counter(any_node.get_node_names_and_namespaces())
        present = dict(any_node.get_topic_names_and_types())
        found: set[tuple[int, ...]] = set()
        for node, types in self._topics:
            self._look_at_name(node, names)
            for topic, type_ in types.items():
                # of each topic all types that are published or subscribed to
                if len(present.get(topic, ())) > 1:
                    found |= self._look_at_publishers(node, topic, type_)
        self._known = found

    def _look_at_name(self, node: Node, names: Counter[tuple[str, str]]) -> None:
        if names[node.get_name(), node.get_namespace()] <= 1:
            self._have_namesake.discard(node)
        elif node not in self._have_namesake:
            self._have_namesake.add(node)
            node.get_logger().warning(
                f'another node is called {node.get_fully_qualified_name()}, too: a command '
                'reaches one of both motors, or both; end one, give it another name or namespace, '
                'or another ROS_DOMAIN_ID'
            )

    def _look_at_publishers(self, node: Node, topic: str, type_: type) -> set[tuple[int, ...]]:
        found = set()
        wanted = _name(type_)
        for publisher in node.get_publishers_info_by_topic(topic):
            if publisher.topic_type == wanted or publisher.node_name == _UNKNOWN:
                continue
            found.add(tuple(publisher.endpoint_gid))
            if tuple(publisher.endpoint_gid) not in self._known:
                other = f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
                node.get_logger().warning(
                    f'{other} publishes {topic} as {publisher.topic_type}, which never arrives '
                    f'here: publish it as {wanted}, such as by ros2 topic pub -r 10 {topic} '
                    f"{wanted} '{_WRITTEN[wanted]}'"
                )
        return found


def _name(type_: type) -> str:
    """Return the name of a message type, such as ``std_msgs/msg/Float32``."""
    return f'{type_.__module__.partition(".")[0]}/msg/{type_.__name__}'
