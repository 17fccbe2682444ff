# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Commands for all drives of a bus at once."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, TimeoutError as FutureTimeoutError
import logging
import time

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger

from nfo_sinus_driver.drive import Cause, DriveError, Report
from nfo_sinus_driver.drive.broadcast import broadcast_stop
from nfo_sinus_driver.node.drive.bus_context import BusContext
from nfo_sinus_driver.node.drive.callers import Call
from nfo_sinus_driver.node.drive.managed_drive import ManagedDrive
from nfo_sinus_driver.node.messages.wording import NodeError
from nfo_sinus_driver.node.ros.executor import received_at
from nfo_sinus_driver.node.ros.qos import COMMANDS

_log = logging.getLogger(__name__)

#: How long all of them together may take, s. A start delay of a drive may last an hour.
_LONGEST_ENABLE = 3700.0
_LONGEST_STOP = 15.0

_Command = Callable[[ManagedDrive], Future[Report]]
#: Returns what failed, and what was done.
_Callback = Callable[[Call], tuple[list[str], list[str]]]


class AllDrives:
    """Offers ``~/stop_all`` and the like on the bus node, for all drives but monitored ones."""

    def __init__(self, node: Node, context: BusContext) -> None:
        self._node = node
        self._context = context
        for name, callback in (
            ('~/stop_all', self._stop),
            # the name of older versions
            ('~/disable_all', self._stop),
            ('~/enable_all', self._enable),
        ):
            group = MutuallyExclusiveCallbackGroup()
            answer = self._safe(name, callback)
            node.create_service(
                Trigger, name, answer, qos_profile=COMMANDS, callback_group=group
            )

    def _safe(
        self, name: str, callback: _Callback
    ) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            call = Call(self._node, name)
            try:
                failed, done = callback(call)
            except Exception as error:
                # an exception that leaves a service callback would end the executor
                _log.exception('error in a service of %s', self._node.get_fully_qualified_name())
                failed, done = [f'error in the driver: {error}'], []
            response.success = not failed
            response.message = '; '.join((*failed, *done)) or 'no drive is controlled here'
            call.log(response.message, success=response.success)
            return response

        return answer

    def _stop(self, call: Call) -> tuple[list[str], list[str]]:
        """Stop each drive by its address; broadcast to those out of reach, where allowed."""
        why = Report(Cause.STOP_ALL_REQUESTED, by=call)
        failed, done = self._command(lambda managed: _stop_one(managed, why), _LONGEST_STOP, call)
        if failed and self._context.bus.protocol.broadcast is not None:
            if any(managed.settings.method == 'monitor' for managed in self._context.drives):
                failed.append('no stop was broadcast, for a drive here is only monitored')
            else:
                failed.append(self._broadcast())
        return failed, done

    def _broadcast(self) -> str:
        try:
            bus, drives = self._context.bus, self._context.drives
            broadcast_stop(bus, [managed.drive for managed in drives]).result(_LONGEST_STOP)
        except DriveError as error:
            return drives[0].wording.say(error)
        except Exception as error:
            return f'a stop for all could not be broadcast: {error}'
        return 'a stop for all was broadcast, which releases every motor; no drive confirms it'

    def _enable(self, call: Call) -> tuple[list[str], list[str]]:
        requested_at = received_at()
        return self._command(
            lambda managed: managed.require_active().enable(requested_at), _LONGEST_ENABLE, call
        )

    def _command(
        self, command: _Command, timeout: float, call: Call
    ) -> tuple[list[str], list[str]]:
        """Send a command to every controlled drive; return what failed, and what was done."""
        failed: list[str] = []
        done: list[str] = []
        futures: list[tuple[ManagedDrive, Future[Report]]] = []
        with self._context.at_once():
            for managed in self._context.drives:
                if managed.settings.method == 'monitor':
                    continue
                try:
                    futures.append((managed, command(managed)))
                except NodeError as error:
                    failed.append(f'{managed.name}: {error}')
        deadline = time.monotonic() + timeout
        call.find()
        for managed, future in futures:
            name, say = managed.name, managed.wording.say
            try:
                answer = future.result(max(0.0, deadline - time.monotonic()))
            except DriveError as error:
                failed.append(f'{name}: {say(error)}')
            except FutureTimeoutError:
                failed.append(f'{name}: the bus did not get to it in time, but may do it yet')
            else:
                done.append(f'{name}: {say(answer)}')
        return failed, done


def _stop_one(managed: ManagedDrive, why: Report) -> Future[Report]:
    if managed.drive.identity is None:
        raise NodeError('it has never answered')
    return managed.drive.stop(why)
