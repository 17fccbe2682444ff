# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""A command that was given is answered, whatever its line in the log runs into."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation

from nfo_sinus_driver.node.callers import log_call


@pytest.mark.parametrize('error', [rclpy_implementation.RCLError('x'), InvalidHandle('x')])
def test_what_the_middleware_cannot_tell_spoils_no_answer(error: Exception) -> None:
    def fail(*_: Any) -> None:
        raise error

    logger = SimpleNamespace(info=lambda text: None)
    node: Any = SimpleNamespace(
        resolve_service_name=lambda name: name,
        get_node_names_and_namespaces=fail,
        get_logger=lambda: logger,
    )
    log_call(node, '~/stop')
