# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the driver needs of rclpy beyond its public interface: the private names are here alone.

A version of rclpy without them fails ``test/ros/test_rclpy_internals.py`` first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import contextlib

from rclpy.lifecycle import LifecycleNodeMixin
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.service import Service


def overrides_of(node: Node) -> Mapping[str, Parameter]:
    """Return the parameters that were given to a node, declared or not."""
    return dict(node._parameter_overrides)


def given_to(name: str) -> Mapping[str, Parameter]:
    """Have ROS itself find what a node of a name gets: it knows files, wildcards and order."""
    node = Node(name, enable_rosout=False, start_parameter_services=False)
    try:
        return overrides_of(node)
    finally:
        node.destroy_node()


def change_state_service(node: LifecycleNodeMixin) -> Service:
    """Return the service ``~/change_state``, whose callback raises on an invalid transition."""
    return node._service_change_state


def is_made_by_rcl(service: Service) -> bool:
    """Return whether rclpy does not know the type of a service, so that it publishes no calls."""
    package = service.srv_type.__module__.partition('.')[0]
    return package in ('lifecycle_msgs', 'type_description_interfaces')


@contextlib.contextmanager
def writable(node: Node, name: str) -> Iterator[None]:
    """Make a parameter that is read-only for clients writable meanwhile."""
    # rclpy keeps the object itself
    descriptor = node.describe_parameter(name)
    read_only, descriptor.read_only = descriptor.read_only, False
    try:
        yield
    finally:
        if node.has_parameter(name):
            node.describe_parameter(name).read_only = read_only


def state_label(node: LifecycleNodeMixin) -> str:
    """Return the lifecycle state of a node, such as ``active``."""
    label: str = node._state_machine.current_state[1]
    return label
