# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Who serves a node sends an answer again that the middleware has dropped, and knows its end."""

from __future__ import annotations

from collections.abc import Iterator
import logging
import threading
from typing import Any
import warnings

from bench import Client, wait_until
import pytest
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from nfo_sinus_driver.node.ros.executor import NodeExecutor

# as rclpy says it
_DROPPED = 'failed to send response (timeout): client will not receive response'


class Served:
    """A node with one service, whose first answers are dropped as the middleware drops them."""

    def __init__(self, domain: int) -> None:
        rclpy.init(domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node('served')
        self.calls = 0
        #: How many answers more are dropped.
        self.to_drop = 0
        #: With which error rclpy tells of it, where it does not let the warning pass as such.
        self.error: Exception | None = None
        self.service = self.node.create_service(Trigger, '~/call', self._answer)
        self._send = self.service.send_response
        self.service.send_response = self._drop_or_send
        self.executor = NodeExecutor(self.node, 1)
        self.executor.start()

    def close(self) -> None:
        self.executor.end()
        self.executor.join(10.0)
        self.node.destroy_node()
        rclpy.try_shutdown()

    def _answer(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.calls += 1
        response.success = True
        return response

    def _drop_or_send(self, response: Any, header: Any) -> None:
        if self.to_drop:
            self.to_drop -= 1
            if self.error is not None:
                raise self.error from RuntimeWarning(_DROPPED)
            warnings.warn(_DROPPED, RuntimeWarning, stacklevel=2)
            return
        self._send(response, header)


@pytest.fixture
def served(domain: int) -> Iterator[Served]:
    with warnings.catch_warnings():
        served = Served(domain)
        yield served
        served.close()


@pytest.fixture
def client(domain: int, served: Served) -> Iterator[Client]:
    with Client(domain, '/served') as client:
        yield client


@pytest.mark.parametrize('error', [None, SystemError('returned a result with an exception set')])
def test_a_dropped_answer_is_sent_again(
    served: Served, client: Client, error: Exception | None
) -> None:
    served.error = error
    served.to_drop = 2
    assert client.call('call').success
    assert served.calls == 1
    assert served.to_drop == 0


def test_a_client_that_cannot_be_answered_delays_no_other(
    served: Served, client: Client, caplog: pytest.LogCaptureFixture
) -> None:
    served.to_drop = 4
    lost = client.call_async('call', Trigger)
    wait_until(lambda: not served.to_drop, 'it was tried four times')
    assert client.call('call').success
    assert served.calls == 2
    assert not lost.done()
    wait_until(lambda: ' /served/call was dropped' in caplog.text, 'it is reported')


def test_another_error_is_not_taken_for_a_dropped_answer(
    served: Served, client: Client, caplog: pytest.LogCaptureFixture
) -> None:
    def other(response: Any, header: Any) -> None:
        raise SystemError('something else')

    served.service.send_response = other
    client.call_async('call', Trigger)
    wait_until(lambda: 'something else' in caplog.text, 'it is reported')
    assert served.calls == 1


def test_nothing_is_said_again_and_again_once_rclpy_is_shut_down(
    served: Served, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR):
        rclpy.shutdown()
        served.executor.join(10.0)
    assert not served.executor.alive
    assert len(caplog.records) <= 1


def test_the_threads_of_a_node_that_is_ended_are_gone(served: Served) -> None:
    served.executor.end()
    served.executor.join(10.0)
    assert not served.executor.alive
    assert not [thread for thread in threading.enumerate() if thread.name == 'executor of served']
