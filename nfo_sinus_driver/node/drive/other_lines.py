# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The drives of other lines that stop with the drive of a node."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import math
import time

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from nfo_sinus_driver.node.ros.publish_queue import PublishQueue
from nfo_sinus_driver.node.ros.qos import COMMANDS

#: How often their services are checked, s.
PERIOD = 1.0
#: How long the answer to a stop may take, s.
_LONGEST_ANSWER = 3.0


def is_elsewhere(name: str) -> bool:
    """Return whether a name in ``stop_with`` is of another line: it has a namespace."""
    return '/' in name


def stop_of(node: Node, name: str) -> str:
    """
    Return the full name of the ``~/stop`` of a drive of another line.

    :raises ValueError: it cannot be the name of a drive.
    """
    try:
        return node.resolve_service_name(f'{name}/stop')
    except Exception:
        raise ValueError(
            f'stop_with: {name!r} cannot be the name of a drive: write such as /line2/right'
        ) from None


class OtherLines:
    """
    Stops the drives of other lines that stop with the drive of a node.

    A line is a process of its own, so each of them is stopped by its ``~/stop``. All of it is done
    on the thread of the queue: no bus and no stop waits for it.

    :param names: the present ``stop_with``.
    :param enabled: whether the drive of the node is enabled.
    """

    def __init__(
        self,
        node: Node,
        queue: PublishQueue,
        names: Callable[[], Iterable[str]],
        enabled: Callable[[], bool],
    ) -> None:
        self._node = node
        self._queue = queue
        self._names = names
        self._enabled = enabled
        self._log = node.get_logger()
        self._group = MutuallyExclusiveCallbackGroup()
        #: By the name of the service.
        self._clients: dict[str, Client] = {}
        #: The calls that are not answered yet, and when that is reported.
        self._calls: dict[Future, tuple[str, float]] = {}
        #: Those that cannot be stopped, as reported.
        self._missing: set[str] = set()
        self.follow()
        queue.put_every(PERIOD, self._look)

    def follow(self) -> None:
        """Follow a change of ``stop_with``; may be called from any thread."""
        self._queue.put_first(self._follow)

    def stop(self) -> None:
        """Stop all of them; may be called from any thread."""
        self._queue.put_first(self._stop)

    def _follow(self) -> None:
        """Have a client for each that is named, and for no other."""
        wanted = {stop_of(self._node, name) for name in self._names() if is_elsewhere(name)}
        for service in self._clients.keys() - wanted:
            self._node.destroy_client(self._clients.pop(service))
        for service in wanted - self._clients.keys():
            self._clients[service] = self._node.create_client(
                Trigger, service, qos_profile=COMMANDS, callback_group=self._group
            )

    def _stop(self) -> None:
        for service, client in self._clients.items():
            try:
                if client.service_is_ready():
                    self._call(service, client)
                else:
                    self._complain(service, f'nothing offers {service}')
            except Exception as error:
                # the others have to be called all the same
                self._complain(service, f'error in the driver: {error!r}')

    def _call(self, service: str, client: Client) -> None:
        for before, (called, _) in tuple(self._calls.items()):
            if called == service:
                # it is not answered any more
                client.remove_pending_request(before)
                del self._calls[before]
        future = client.call_async(Trigger.Request())
        self._calls[future] = service, time.monotonic() + _LONGEST_ANSWER
        future.add_done_callback(lambda _: self._queue.put(lambda: self._take_answer(future)))

    def _take_answer(self, future: Future) -> None:
        if future not in self._calls:
            # it was called anew
            return
        service, _ = self._calls.pop(future)
        try:
            answer = future.result()
        except Exception as error:
            self._complain(service, f'no answer of {service}: {error!r}')
            return
        if answer is None:
            # its client is destroyed, for it is no longer named
            return
        if answer.success:
            self._log.info(f'{drive_of(service)} stops with it: {answer.message}')
        else:
            self._complain(service, answer.message)

    def _look(self) -> None:
        now = time.monotonic()
        for future, (service, until) in tuple(self._calls.items()):
            if now > until:
                # it may come yet
                self._calls[future] = service, math.inf
                self._complain(service, f'no answer of {service} in {_LONGEST_ANSWER:g} s')
        self._report_missing()

    def _report_missing(self) -> None:
        """Report each that is missing, once for each time that this drive is enabled."""
        if not self._enabled():
            self._missing = set()
            return
        missing = {name for name, client in self._clients.items() if not client.service_is_ready()}
        for service in sorted(missing - self._missing):
            self._log.warning(
                f'{drive_of(service)} does not stop with it: nothing offers {service}; start its '
                'driver, or correct stop_with'
            )
        for service in sorted(self._missing - missing):
            self._log.info(f'{drive_of(service)} is there now: it stops with this drive')
        self._missing = missing

    def _complain(self, service: str, why: str) -> None:
        self._log.error(
            f'{drive_of(service)} does NOT stop with it: {why}; use its enable input or the '
            'emergency stop'
        )


def drive_of(service: str) -> str:
    """Return the full name of the drive that has a service."""
    return service.rpartition('/')[0]
