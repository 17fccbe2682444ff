# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A client of the action Tune."""

from __future__ import annotations

from bench import Client, wait_until
from nfo_sinus_msgs.action import Tune
from rclpy.action import ActionClient


class Tuner:
    """
    A client of the action.

    An action client of rclpy knows of a request only once it is sent, and drops an answer that
    another thread hears before: all requests are sent by the thread that hears the answers. That
    one ends with an error if what it waits for is destroyed by another.
    """

    def __init__(self, client: Client, name: str = '/nfo_sinus') -> None:
        self._client = client
        self._action = client.where_it_spins(
            lambda: ActionClient(client.node, Tune, f'{name}/tune')
        )
        client.callback(client.where_it_spins, self._action.destroy)
        wait_until(self._action.server_is_ready, 'there is an action server')
        self.feedback: list[Tune.Feedback] = []

    def begin(self, procedure: int):
        """Send a goal, and return its handle when it is accepted."""
        handle = self.ask(procedure)
        assert handle.accepted
        return handle

    def ask(self, procedure: int):
        """Send a goal, and return its handle, accepted or not."""
        return self._answer(
            lambda: self._action.send_goal_async(
                Tune.Goal(procedure=procedure),
                feedback_callback=lambda message: self.feedback.append(message.feedback),
            ),
            'the goal is answered',
        )

    def cancel(self, handle) -> None:
        """Cancel a goal."""
        self._answer(handle.cancel_goal_async, 'the cancel is answered')

    def result(self, handle):
        """Wait for the end; return status and result."""
        answer = self._answer(handle.get_result_async, 'there is a result')
        return answer.status, answer.result

    def _answer(self, send, what: str):
        future = self._client.where_it_spins(send)
        wait_until(future.done, what)
        return future.result()
