# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A command that was given is answered, whatever its line in the log runs into."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from bench import wait_until
import pytest
from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation

from nfo_sinus_driver.node.drive.callers import Call


@pytest.mark.parametrize('error', [rclpy_implementation.RCLError('x'), InvalidHandle('x')])
def test_what_the_middleware_does_not_know_spoils_no_answer(error: Exception) -> None:
    def fail(*_: Any) -> None:
        raise error

    lines: list[str] = []
    logger = SimpleNamespace(info=lines.append)
    node: Any = SimpleNamespace(
        resolve_service_name=lambda name: name,
        get_node_names_and_namespaces=fail,
        get_logger=lambda: logger,
    )
    call = Call(node, '~/stop')
    call.find()
    call.log('stopped')
    # looked for no longer than a moment
    wait_until(lambda: lines, 'the line')
    assert lines == ['~/stop called by a client that the middleware does not name: stopped']
