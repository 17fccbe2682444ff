# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Many calls at once are all answered, and the motor stops."""

from __future__ import annotations

from typing import Any

from bench import PATIENCE, Bench, wait_until
import pytest
from rclpy.qos import QoSProfile
from std_srvs.srv import SetBool, Trigger

#: The answers must not be lost where they arrive, either.
_QUALITY = QoSProfile(depth=1000)


@pytest.mark.parametrize(
    ('service', 'request_', 'calls'),
    [
        ('/nfo_sinus/stop', Trigger.Request(), 500),
        ('/nfo_sinus/quick_stop', Trigger.Request(), 100),
        ('/nfo_sinus/enable', SetBool.Request(data=False), 100),
        ('/nfo_sinus/fault_ack', Trigger.Request(), 100),
        ('/nfo_sinus_bus/stop_all', Trigger.Request(), 100),
    ],
    ids=['stop', 'quick_stop', 'enable_false', 'fault_ack', 'stop_all'],
)
def test_many_calls_at_once_are_all_answered(
    bench: Bench, service: str, request_: Any, calls: int
) -> None:
    drive = bench.simulator(*bench.drives.ramps(1))
    bench.driver()
    client = bench.client().connected()
    type_ = SetBool if isinstance(request_, SetBool.Request) else Trigger
    many = client.node.create_client(type_, service, qos_profile=_QUALITY)
    wait_until(many.service_is_ready, 'there is a service')
    with client.run_at(20.0):
        answers = [many.call_async(request_) for _ in range(calls)]
        wait_until(lambda: all(answer.done() for answer in answers), 'all are answered')
    assert all(answer.result().message for answer in answers)
    if service.endswith('stop'):
        drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
