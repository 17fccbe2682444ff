# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Which client has called a service, and the outcome: one line in the log for each command."""

from __future__ import annotations

from concurrent.futures import Future
import contextlib
import threading
import time

from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.service_introspection import ServiceIntrospectionState

from nfo_sinus_driver.node.ros.qos import RELIABLE
from nfo_sinus_driver.node.ros.rclpy_internals import is_made_by_rcl

#: Within what time the middleware knows of a new client, s, and how often that is checked.
_KNOWN_WITHIN = 0.5
_LOOK_PERIOD = 0.02
#: The services that start or stop a motor, or may: what `plot --explain` tells of.
COMMANDS = frozenset((
    'enable', 'stop', 'quick_stop', 'rapid_stop', 'fault_ack',
    'stop_all', 'disable_all', 'enable_all',
))
_STATES = {
    'off': ServiceIntrospectionState.OFF,
    'metadata': ServiceIntrospectionState.METADATA,
    'contents': ServiceIntrospectionState.CONTENTS,
}


class Call:
    """
    A call of a command; as text, with its caller, as far as that is known by now.

    rclpy does not give a request the name of its client. So these are the nodes that have a client
    of the service: more than one if several have. No search begins before :meth:`find`: a stop
    never waits for it.

    :param service: its name as it was created, such as ``~/stop``; an action is named with the
        service of it that was called.
    :param detail: what was requested, where the name does not say it.
    """

    def __init__(self, node: Node, service: str, detail: str = '') -> None:
        self._node = node
        self._service = node.resolve_service_name(service)
        self._detail = detail
        self._by: Future[str] = Future()

    def __str__(self) -> str:
        called = self._service.partition('/_action/')[0]
        detail = self._detail and f' ({self._detail})'
        by = self._by.result() if self._by.done() else 'a client'
        return f'{called}{detail} called by {by}'

    def find(self) -> None:
        """Find the caller, once the command is given; a new client may take a moment."""
        if not self._look():
            threading.Thread(target=self._keep_looking, daemon=True).start()

    def log(self, outcome: str = '', *, success: bool = True) -> None:
        """Log the call and its outcome, as soon as the caller is known."""
        answered = outcome and f': {outcome}'
        log = self._node.get_logger()
        # one call site for each level: rclpy forbids another level at the same place
        if success:
            self._by.add_done_callback(lambda _: log.info(f'{self}{answered}'))
        else:
            self._by.add_done_callback(lambda _: log.warning(f'{self}{answered}'))

    def _keep_looking(self) -> None:
        deadline = time.monotonic() + _KNOWN_WITHIN
        while not self._look():
            if time.monotonic() > deadline:
                self._by.set_result('a client that the middleware does not name')
                return
            time.sleep(_LOOK_PERIOD)

    def _look(self) -> bool:
        """Find the nodes that have a client of the service; return whether there is one."""
        node, found = self._node, []
        # the node may be destroyed meanwhile; the command is given already, whatever happens here
        with contextlib.suppress(InvalidHandle, rclpy_implementation.RCLError):
            for name, namespace in sorted(set(node.get_node_names_and_namespaces())):
                # one may have ended meanwhile
                with contextlib.suppress(NodeNameNonExistentError):
                    clients = node.get_client_names_and_types_by_node(name, namespace)
                    if any(called == self._service for called, _ in clients):
                        found.append(f'{namespace.rstrip("/")}/{name}')
        if found:
            self._by.set_result(' or '.join(found))
        return bool(found)


def publish_calls(node: Node, others: str) -> None:
    """
    Publish the calls of the services that a node has by now, so that a bag has them.

    Those of commands are published whole, those of the others as the setting ``introspection``
    says, but for services that rcl makes itself: of the lifecycle and ``~/get_type_description``.
    A service whose calls are not published has no publisher for them.
    """
    for service in node.services:
        name = service.service_name.rpartition('/')[2]
        state = _STATES['contents' if name in COMMANDS else others]
        if state is not ServiceIntrospectionState.OFF and not is_made_by_rcl(service):
            service.configure_introspection(node.get_clock(), RELIABLE, state)
