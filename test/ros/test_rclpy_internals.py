# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The private names of rclpy that the driver uses are there, in one file of it, and do it."""

from __future__ import annotations

from pathlib import Path
import re

from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import ParameterDescriptor
import rclpy
from rclpy.lifecycle import LifecycleNode
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from nfo_sinus_driver.node.ros import rclpy_internals

FOLDER = Path(rclpy_internals.__file__).parent


def test_they_are_there(domain: int) -> None:
    rclpy.init(domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    given = [Parameter('never_declared', value=5)]
    node = LifecycleNode('internals', parameter_overrides=given)
    try:
        assert rclpy_internals.overrides_of(node)['never_declared'].value == 5
        assert rclpy_internals.change_state_service(node).srv_type is ChangeState
        assert callable(rclpy_internals.change_state_service(node).callback)
        assert rclpy_internals.state_label(node) == 'unconfigured'
        # to let one of these publish its calls fails, and may end the process in C
        assert {
            service.service_name.rpartition('/')[2]
            for service in filter(rclpy_internals.is_made_by_rcl, node.services)
        } == {
            'change_state', 'get_state', 'get_available_states', 'get_available_transitions',
            'get_transition_graph', 'get_type_description',
        }
        node.declare_parameter('shown', 1, ParameterDescriptor(read_only=True))
        with rclpy_internals.writable(node, 'shown'):
            assert node.set_parameters([Parameter('shown', value=2)])[0].successful
        assert not node.set_parameters([Parameter('shown', value=3)])[0].successful
        assert node.get_parameter('shown').value == 2
        with rclpy_internals.writable(node, 'shown'):
            node.undeclare_parameter('shown')
    finally:
        node.destroy_node()
        rclpy.shutdown()


def test_no_other_file_has_private_names_of_another_object() -> None:
    private = re.compile(r'(?<![\w.)\]])(?!self\b|cls\b)\w+\._(?!_)[a-z]\w*')
    found = [
        f'{path.name}: {match[0]}'
        for path in FOLDER.glob('*.py')
        if path.name != 'rclpy_internals.py'
        for match in private.finditer(path.read_text(encoding='utf-8'))
    ]
    assert found == []
