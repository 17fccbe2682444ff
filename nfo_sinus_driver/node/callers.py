# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Which client has called a service: one line in the log for each command."""

from __future__ import annotations

import contextlib
import threading
import time

from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node, NodeNameNonExistentError

#: Within what time the middleware knows of a new client, s, and how often it is looked for.
_KNOWN_WITHIN = 0.5
_LOOK_PERIOD = 0.02


def log_call(node: Node, service: str, detail: str = '') -> None:
    """
    Log that a command was called, and by whom.

    rclpy does not give a request the name of its client. So these are the nodes that have a client
    of the service: more than one if several have.

    :param service: its name as it was created, such as ``~/stop``; an action is named with the
        service of it that was called.
    :param detail: what was called for, where the name does not say it.
    """
    name = node.resolve_service_name(service)
    if clients := _clients(node, name):
        _log(node, name, detail, clients)
        return
    # who has just come may be known a moment later; its answer must not wait for that
    threading.Thread(target=_log_later, args=(node, name, detail), daemon=True).start()


def _log_later(node: Node, name: str, detail: str) -> None:
    deadline = time.monotonic() + _KNOWN_WITHIN
    while not (clients := _clients(node, name)) and time.monotonic() < deadline:
        time.sleep(_LOOK_PERIOD)
    _log(node, name, detail, clients)


def _log(node: Node, name: str, detail: str, clients: list[str]) -> None:
    called = name.partition('/_action/')[0]
    by = ' or '.join(clients) or 'a client that the middleware does not name'
    node.get_logger().info(f'{called}{detail and f" ({detail})"} called by {by}')


def _clients(node: Node, service: str) -> list[str]:
    found = []
    # the node may be destroyed meanwhile; and its command is given, so nothing spoils the answer
    with contextlib.suppress(InvalidHandle, rclpy_implementation.RCLError):
        for name, namespace in sorted(set(node.get_node_names_and_namespaces())):
            # one may have ended meanwhile
            with contextlib.suppress(NodeNameNonExistentError):
                clients = node.get_client_names_and_types_by_node(name, namespace)
                if any(called == service for called, _ in clients):
                    found.append(f'{namespace.rstrip("/")}/{name}')
    return found
