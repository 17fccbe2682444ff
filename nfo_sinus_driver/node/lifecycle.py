# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What moves a managed node through its states, and what rclpy lacks for that."""

from __future__ import annotations

import threading

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin

from nfo_sinus_driver.node.autostart import Autostart
from nfo_sinus_driver.node.rclpy_internals import change_state_service, state_label


class Lifecycle:
    """
    The state of a managed node; autostart changes it until an operator does.

    :param node: one that is not served yet.
    """

    def __init__(self, node: LifecycleNodeMixin) -> None:
        self._node = node
        self._autostart = Autostart(node.get_name(), self._try_to_start)
        #: Why the last try of autostart failed.
        self._complaint = ''
        # autostart changes the state from a thread of its own
        self._in_transition = threading.Lock()
        _reject_invalid_transitions(node, self._in_transition)

    @property
    def state(self) -> str:
        """Its label, such as ``active``."""
        return state_label(self._node)

    @property
    def why_not_active(self) -> str:
        """Why the node is not active, and what to do."""
        if self.state == 'finalized':
            return 'the node was shut down: start the driver again'
        if self._complaint:
            return f'the drive has not answered yet: {self._complaint}'
        return f'the node is {self.state}: activate it first'

    @property
    def wanted(self) -> bool:
        """A client has configured the node, or autostart is trying to."""
        return self.state != 'unconfigured' or self._autostart.going_on

    @property
    def complaint(self) -> str:
        """Why autostart could not configure the node so far; ``''`` if it could or never tried."""
        return self._complaint

    @property
    def by_operator(self) -> bool:
        """The transition that runs on this thread was not requested by autostart."""
        return not self._autostart.trying

    def start(self) -> None:
        """With ``autostart``, configure and activate the node as soon as the drive responds."""
        if self._node.get_parameter('autostart').value:
            self._autostart.start()

    def end(self) -> None:
        """End autostart; a try under way goes on."""
        self._autostart.give_up()

    def join(self, timeout: float) -> None:
        """Wait for the last try of autostart after :meth:`end`, for a limited time (s)."""
        self._autostart.join(timeout)

    def note_transition(self) -> None:
        """Note a transition that works; one by an operator ends autostart."""
        self._complaint = ''
        if self.by_operator:
            self._autostart.give_up()

    def complain(self, why: str, *, known: bool) -> None:
        """Log why the drive cannot be configured, unless ``known``; in autostart each once."""
        log = self._node.get_logger()
        if self.by_operator:
            log.error(why)
            return
        news, self._complaint = why != self._complaint, why
        if news and not known:
            log.error(f'{why}; retrying')

    def _try_to_start(self) -> bool:
        """Configure and activate; return whether the node is active."""
        with self._in_transition:
            # meanwhile a client may have taken the lifecycle over
            if not self._autostart.over and self.state == 'unconfigured':
                self._node.trigger_configure()
            if not self._autostart.over and self.state == 'inactive':
                self._node.trigger_activate()
            return self.state == 'active'


def _reject_invalid_transitions(node: LifecycleNodeMixin, in_transition: threading.Lock) -> None:
    """
    Have ``~/change_state`` wait for other transitions, and reject those that are not possible.

    rclpy raises an error then and never answers, and nav2's lifecycle manager would wait
    without end.

    :param in_transition: held while the state of the node changes.
    """
    service = change_state_service(node)
    change = service.callback

    def answer(
        request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        try:
            with in_transition:
                return change(request, response)
        except rclpy_implementation.RCLError:
            # rcl has logged the reason
            response.success = False
            return response

    service.callback = answer
