# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What rclpy leaves out of managed nodes."""

from __future__ import annotations

import threading

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin


def answer_transitions(node: LifecycleNodeMixin, in_transition: threading.Lock) -> None:
    """
    Have ``~/change_state`` wait for others, and answer also what the node's state does not have.

    rclpy raises an error then and never answers, and nav2's lifecycle manager would wait for ever.

    :param in_transition: held by whoever changes the state of the node.
    """
    service = node._service_change_state
    change = service.callback

    def answer(
        request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        try:
            with in_transition:
                return change(request, response)
        except rclpy_implementation.RCLError:
            # what is wrong has been logged by rcl
            response.success = False
            return response

    service.callback = answer
