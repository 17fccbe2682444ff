# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the driver needs of rclpy and rclpy does not promise: its private names are here alone.

A version of rclpy that has them no longer fails ``test/ros/test_rclpy_internals.py`` first.
"""

from __future__ import annotations

from collections.abc import Mapping

from rclpy.lifecycle import LifecycleNodeMixin
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.service import Service


def overrides_of(node: Node) -> Mapping[str, Parameter]:
    """Return the parameters that were given to a node, declared or not; rclpy shows only those."""
    return dict(node._parameter_overrides)


def change_state_service(node: LifecycleNodeMixin) -> Service:
    """Return the service ``~/change_state``, whose callback raises on an invalid transition."""
    return node._service_change_state


def state_label(node: LifecycleNodeMixin) -> str:
    """Return the lifecycle state of a node, such as ``active``."""
    label: str = node._state_machine.current_state[1]
    return label
