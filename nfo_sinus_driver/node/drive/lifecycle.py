# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What moves a managed node through its states: an operator, or autostart."""

from __future__ import annotations

import logging
import threading

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin

from nfo_sinus_driver.node.ros.rclpy_internals import change_state_service, state_label

_log = logging.getLogger(__name__)

#: How long autostart rests after a failed try, at first and at last, s: meanwhile an operator may
#: change the lifecycle, and the drives that do respond have the bus.
_REST = 1.0
_LONGEST_REST = 4.0


class Lifecycle:
    """
    The state of a managed node; autostart changes it until an operator does.

    A try of autostart waits for the bus; so every drive has a thread for it, which ends when the
    drive has started, and all are tried at once.

    :param node: one that is not served yet.
    """

    def __init__(self, node: LifecycleNodeMixin) -> None:
        self._node = node
        name = f'autostart of {node.get_name()}'
        self._autostart = threading.Thread(target=self._try_to_start, name=name, daemon=True)
        #: Autostart has started the drive, or has given up.
        self._over = threading.Event()
        #: Why autostart could not configure the node so far; ``''`` if it could or never tried.
        self.complaint = ''
        # autostart changes the state from a thread of its own
        self._in_transition = threading.Lock()
        _reject_invalid_transitions(node, self._in_transition)

    @property
    def state(self) -> str:
        """Its label, such as ``active``."""
        return state_label(self._node)

    def why_not(self, transition: str) -> str:
        """Return why the node is not where a transition leads, and what to do."""
        if self.state == 'finalized':
            return 'the node was shut down: start the driver again'
        if self.complaint:
            return f'the drive has not answered yet: {self.complaint}'
        if transition == 'activate' and self.state == 'unconfigured':
            transition = 'configure and activate'
        return f'the node is {self.state}: {transition} it first'

    @property
    def wanted(self) -> bool:
        """A client has configured the node, or autostart is trying to."""
        trying = self._autostart.is_alive() and not self._over.is_set()
        return self.state not in ('unconfigured', 'finalized') or trying

    @property
    def by_operator(self) -> bool:
        """The transition that runs on this thread was not requested by autostart."""
        return threading.current_thread() is not self._autostart

    def start(self) -> None:
        """With ``autostart``, configure and activate the node as soon as the drive responds."""
        if self._node.get_parameter('autostart').value:
            self._autostart.start()

    def end(self) -> None:
        """End autostart; a try under way goes on."""
        self._over.set()

    def join(self, timeout: float) -> None:
        """Wait for the last try of autostart after :meth:`end`, for a limited time (s)."""
        if self._autostart.is_alive():
            self._autostart.join(timeout)

    def note_transition(self) -> None:
        """Note a transition that works; one by an operator ends autostart."""
        self.complaint = ''
        if self.by_operator:
            self.end()

    def complain(self, why: str, *, known: bool) -> None:
        """Log why the drive cannot be configured, unless ``known``; in autostart each once."""
        log = self._node.get_logger()
        if self.by_operator:
            log.error(why)
            return
        news, self.complaint = why != self.complaint, why
        if news and not known:
            log.error(f'{why}; retrying')

    def _try_to_start(self) -> None:
        """Configure and activate, again and again until the node is active or it is over."""
        rest = 0.0
        while not self._over.wait(rest):
            rest = min(rest + _REST, _LONGEST_REST)
            try:
                with self._in_transition:
                    # meanwhile a client may have taken the lifecycle over
                    if not self._over.is_set() and self.state == 'unconfigured':
                        self._node.trigger_configure()
                    if not self._over.is_set() and self.state == 'inactive':
                        self._node.trigger_activate()
                    if self.state == 'active':
                        self.end()
            except Exception:
                _log.exception('error in an autostart; it is tried again')


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
