# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Set-points, which cannot wait for an executor: one thread takes them as they come."""

from __future__ import annotations

from collections.abc import Callable
import logging
import threading
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.utilities import get_default_context

from nfo_sinus_driver.node.drive.setpoint_checks import Origin
from nfo_sinus_driver.node.ros.qos import NEWEST

_log = logging.getLogger(__name__)

_NO_TIMEOUT = -1


class _Apart(ReentrantCallbackGroup):
    """Keeps subscriptions out of the executor of their node."""

    def can_execute(self, entity: object) -> bool:
        return not isinstance(entity, Subscription)


class SetpointSubscriber:
    """
    Subscribes to a few topics for which an executor would be too slow.

    An executor of rclpy looks through everything of every node before it waits again, and hands a
    message from thread to thread. This waits for its subscriptions alone, as
    ``rclpy.wait_for_message`` does. They belong to the node like any other, under its name and
    with its remappings.
    """

    def __init__(self) -> None:
        self._context = get_default_context()
        self._subscriptions: list[tuple[Subscription, Callable[[Any, Origin], None]]] = []
        self._guard = GuardCondition(None, None, self._context)
        self._closing = False
        self._thread = threading.Thread(target=self._work, name='setpoint subscriber', daemon=True)

    def subscribe(
        self,
        node: Node,
        message_type: type,
        topic: str,
        callback: Callable[[Any, Origin], None],
    ) -> None:
        """Call a function with each message and its origin, once :meth:`start` was called."""
        subscription = node.create_subscription(
            message_type,
            topic,
            # not called: no executor takes its messages
            lambda _: None,
            NEWEST,
            callback_group=_Apart(),
            # rclpy's own would stay with the executor, and each message would wake it repeatedly
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self._subscriptions.append((subscription, callback))

    def start(self) -> None:
        """Start the thread; all topics have to be subscribed to by then."""
        self._thread.start()

    @property
    def alive(self) -> bool:
        """The thread works."""
        return self._thread.is_alive()

    def close(self, timeout: float = 2.0) -> None:
        """End the thread after its present message."""
        self._closing = True
        self._guard.trigger()
        if self._thread.is_alive():
            self._thread.join(timeout)

    def _work(self) -> None:
        try:
            with self._context.handle:
                self._take_all()
        except Exception:
            # a driver that cannot receive must not go on as if none came: the process ends, and
            # stops the motors
            _log.exception('set-points can no longer be received')

    def _take_all(self) -> None:
        wait_set = rclpy_implementation.WaitSet(
            len(self._subscriptions), 1, 0, 0, 0, 0, self._context.handle
        )
        while not self._closing:
            wait_set.clear_entities()
            wait_set.add_guard_condition(self._guard.handle)
            for subscription, _ in self._subscriptions:
                wait_set.add_subscription(subscription.handle)
            wait_set.wait(_NO_TIMEOUT)
            ready = wait_set.get_ready_entities('subscription')
            for subscription, callback in self._subscriptions:
                if subscription.handle.pointer in ready:
                    self._take(subscription, callback)

    def _take(self, subscription: Subscription, callback: Callable[[Any, Origin], None]) -> None:
        try:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is not None:
                message, facts = taken
                number = facts['publication_sequence_number']
                callback(message, Origin(subscription.topic_name, number))
        except Exception:
            # an error with one message must not keep out the next
            _log.exception('error in a callback; the driver goes on')
