# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Many calls at once are all answered, and the motor stops."""

from __future__ import annotations

from typing import Any

from bench import PATIENCE, Bench, wait_until
from nfo_sinus_msgs.action import Tune
from nfo_sinus_msgs.srv import GetErrorLog
import pytest
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile
from std_srvs.srv import SetBool, Trigger

#: The answers must not be lost where they arrive, either.
_QUALITY = QoSProfile(depth=1000)
_TYPES = SetBool, Trigger, GetErrorLog


@pytest.mark.parametrize(
    ('service', 'request_', 'calls'),
    [
        ('/nfo_sinus/stop', Trigger.Request(), 500),
        ('/nfo_sinus/quick_stop', Trigger.Request(), 100),
        ('/nfo_sinus/enable', SetBool.Request(data=False), 100),
        ('/nfo_sinus/fault_ack', Trigger.Request(), 100),
        ('/nfo_sinus_bus/stop_all', Trigger.Request(), 100),
        ('/nfo_sinus/tune_full', Trigger.Request(), 40),
        ('/nfo_sinus/get_error_log', GetErrorLog.Request(max_entries=1), 40),
    ],
    ids=['stop', 'quick_stop', 'enable_false', 'fault_ack', 'stop_all', 'tune', 'error_log'],
)
def test_many_calls_at_once_are_all_answered(
    bench: Bench, service: str, request_: Any, calls: int
) -> None:
    drive = bench.simulator(*bench.drives.ramps(1))
    bench.driver()
    client = bench.client().connected()
    type_ = next(type_ for type_ in _TYPES if isinstance(request_, type_.Request))
    many = client.node.create_client(type_, service, qos_profile=_QUALITY)
    wait_until(many.service_is_ready, 'there is a service')
    with client.run_at(20.0):
        answers = [many.call_async(request_) for _ in range(calls)]
        wait_until(lambda: all(answer.done() for answer in answers), 'all are answered')
    assert all(answer.result().message for answer in answers)
    if service.endswith('stop'):
        drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)


def test_many_goals_at_once_are_all_answered(bench: Bench) -> None:
    bench.simulator()
    bench.driver()
    client = bench.client().connected()
    tune = ActionClient(
        client.node, Tune, '/nfo_sinus/tune',
        goal_service_qos_profile=_QUALITY, result_service_qos_profile=_QUALITY,
    )
    wait_until(tune.server_is_ready, 'there is an action')

    def goal() -> Any:
        # rclpy drops an answer that another thread takes before the call has kept its number
        return client.where_it_spins(
            lambda: tune.send_goal_async(Tune.Goal(procedure=Tune.Goal.FULL))
        )

    # the middleware drops an answer while it does not know yet where it goes
    first: list[Any] = []

    def is_answered() -> bool:
        first.append(goal())
        return any(sent.done() for sent in first)

    wait_until(is_answered, 'the first is answered', period=1.0)
    goals = [goal() for _ in range(40)]
    wait_until(lambda: all(sent.done() for sent in goals), 'all are answered')
    results = [client.where_it_spins(sent.result().get_result_async) for sent in goals]
    assert client.call('stop').message
    wait_until(lambda: all(result.done() for result in results), 'all have an end')
    assert all(result.result().result.message for result in results)
