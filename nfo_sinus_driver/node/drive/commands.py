# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The services of one drive, those of its error log and kWh counter too."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, TimeoutError as FutureTimeoutError
import contextlib
import functools
import logging
import math
import queue
import threading
import time
from typing import Any, TypeVar

from builtin_interfaces.msg import Time
from nfo_sinus_msgs.action import Tune
from nfo_sinus_msgs.srv import GetErrorLog
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import (
    CallbackGroup,
    MutuallyExclusiveCallbackGroup,
    ReentrantCallbackGroup,
)
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from nfo_sinus_driver.drive import (
    Cause,
    Drive,
    DriveError,
    LogEntry,
    Procedure,
    Report,
    Snapshot,
    Tuned,
)
from nfo_sinus_driver.node.drive.callers import Call
from nfo_sinus_driver.node.drive.managed_drive import ManagedDrive
from nfo_sinus_driver.node.messages import messages
from nfo_sinus_driver.node.messages.messages import inv_st
from nfo_sinus_driver.node.messages.wording import NodeError
from nfo_sinus_driver.node.ros.executor import received_at
from nfo_sinus_driver.node.ros.qos import COMMANDS

_log = logging.getLogger(__name__)

#: How long a service waits for the bus before it reports that, s. A start delay of the drive may
#: last an hour.
_LONGEST_COMMAND = 3700.0
_LONGEST_STOP = 10.0
_LONGEST_REFRESH = 300.0

#: How many calls of ``~/enable`` of one drive may wait for an answer at once.
CALLS_OF_ENABLE = 4

_T = TypeVar('_T')
_Command = Callable[[Drive, Call], Future[Report]]


class CommandServices:
    """Takes commands for the drive of a node, each kind in a callback group of its own."""

    def __init__(self, node: Node, managed: ManagedDrive) -> None:
        self._node = node
        self._managed = managed
        # several, for a disable must not wait for an enable that waits for a start delay; but not
        # any number, for each keeps a thread that other drives may need
        group = BoundedCallbackGroup(CALLS_OF_ENABLE)
        node.create_service(
            SetBool, '~/enable', self._on_enable, qos_profile=COMMANDS, callback_group=group
        )
        self.offer('~/stop', _stop, _LONGEST_STOP)
        self.offer('~/quick_stop', _quick_stop, _LONGEST_STOP)
        self.offer('~/rapid_stop', _rapid_stop, _LONGEST_STOP)
        self.offer('~/fault_ack', _acknowledge, _LONGEST_STOP)
        self.offer(
            '~/refresh_parameters',
            lambda *_: managed.require_kept().parameters.refresh(),
            _LONGEST_REFRESH,
        )

    def offer(self, name: str, command: _Command, timeout: float) -> None:
        """Offer a service that answers when a command is done, or after a time-out, s."""

        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            call = Call(self._node, name)
            return self._answer(
                response, call, lambda: command(self._managed.drive, call), timeout
            )

        group = MutuallyExclusiveCallbackGroup()
        self._node.create_service(
            Trigger, name, answer, qos_profile=COMMANDS, callback_group=group
        )

    def _answer(
        self, response: Any, call: Call, command: Callable[[], Future[Report]], timeout: float
    ) -> Any:
        """Send a command to the drive, and log its caller and its outcome."""
        self.answer(response, _and_find(call, command), timeout, self._managed.wording.say)
        call.log(response.message, success=response.success)
        return response

    def answer(
        self,
        response: Any,
        command: Callable[[], Future[_T]],
        timeout: float,
        describe: Callable[[_T], str],
    ) -> Any:
        """Send a command that may take ``timeout`` s, and answer with its result, described."""
        try:
            response.message = describe(command().result(timeout))
            response.success = True
        except (DriveError, NodeError) as error:
            response.message = self._managed.wording.say(error)
        except FutureTimeoutError:
            response.message = f'the bus did not get to it within {timeout:g} s, but may do it yet'
        except Exception as error:
            # an exception that leaves a service callback would end the executor
            _log.exception('error in a service of %s', self._node.get_fully_qualified_name())
            response.message = f'error in the driver: {error}'
        return response

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        call = Call(self._node, '~/enable', str(request.data).lower())

        def enable() -> Future[Report]:
            return self._managed.require_active().enable(received_at())

        def disable() -> Future[Report]:
            return self._managed.drive.stop(Report(Cause.DISABLE_REQUESTED, by=call))

        if request.data:
            return self._answer(response, call, enable, _LONGEST_COMMAND)
        return self._answer(response, call, disable, _LONGEST_STOP)


def _stop(drive: Drive, call: Call) -> Future[Report]:
    return drive.stop(Report(Cause.STOP_REQUESTED, by=call))


def _quick_stop(drive: Drive, call: Call) -> Future[Report]:
    return drive.quick_stop(Report(Cause.QUICK_STOP_REQUESTED, by=call))


def _rapid_stop(drive: Drive, call: Call) -> Future[Report]:
    return drive.rapid_stop(Report(Cause.STOP_REQUESTED, by=call))


def _acknowledge(drive: Drive, call: Call) -> Future[Report]:
    return drive.acknowledge(Report(Cause.ACKNOWLEDGE_REQUESTED, by=call))


def _and_find(call: Call, command: Callable[[], _T]) -> Callable[[], _T]:
    """Return a command after which its caller is looked for: a stop never waits."""

    def given() -> _T:
        try:
            return command()
        finally:
            call.find()

    return given


class BoundedCallbackGroup(CallbackGroup):
    """Lets a number of callbacks run at once; further calls wait in their queue."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most
        self._running = 0
        self._lock = threading.Lock()

    def can_execute(self, entity: object) -> bool:
        """Return whether one more may run."""
        return self._running < self._most

    def beginning_execution(self, entity: object) -> bool:
        """Let one begin, if it may."""
        with self._lock:
            begins = self._running < self._most
            self._running += begins
            return begins

    def ending_execution(self, entity: object) -> None:
        """Note that one has ended."""
        with self._lock:
            self._running -= 1


#: How long a busy line may take, s.
_LONGEST = 60.0


class ErrorLogServices:
    """Offers ``~/get_error_log``, ``~/erase_error_log`` and ``~/reset_energy``."""

    def __init__(
        self,
        node: Node,
        managed: ManagedDrive,
        commands: CommandServices,
        stamp: Callable[[float], Time],
    ) -> None:
        self._managed = managed
        self._commands = commands
        self._stamp = stamp
        node.create_service(
            GetErrorLog,
            '~/get_error_log',
            self._on_get,
            qos_profile=COMMANDS,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
        commands.offer('~/erase_error_log', lambda drive, _: drive.erase_error_log(), _LONGEST)
        commands.offer('~/reset_energy', lambda drive, _: drive.reset_energy(), _LONGEST)

    def _on_get(
        self, request: GetErrorLog.Request, response: GetErrorLog.Response
    ) -> GetErrorLog.Response:
        def fill_in(entries: Sequence[LogEntry]) -> str:
            response.entries = [
                messages.error_log_entry(entry, self._stamp(entry.at)) for entry in entries
            ]
            return self._summary(entries)

        return self._commands.answer(
            response, lambda: self._managed.drive.error_log(request.max_entries), _LONGEST, fill_in
        )

    def _summary(self, entries: Sequence[LogEntry]) -> str:
        undated = sum(math.isnan(entry.at) for entry in entries)
        count = '1 entry' if len(entries) == 1 else f'{len(entries)} entries'
        if not undated:
            return count
        if all(math.isnan(entry.operating_time) for entry in entries):
            return f'{count}; the drive does not say when they came'
        since = self._managed.drive.log.powered_since
        return (
            f'{count}, {undated} of them without the wall time: that is known only as long as the '
            f'drive is known to have had power, from operating hour {since:.1f} on'
        )


_SERVICES = {
    '~/tune_full': Procedure.FULL,
    '~/tune_basic': Procedure.BASIC,
    '~/measure_rs': Procedure.STATOR_RESISTANCE,
    '~/calculate_parameters': Procedure.CALCULATE,
}
#: By the codes of the action.
_PROCEDURES = {
    Tune.Goal.FULL: Procedure.FULL,
    Tune.Goal.BASIC: Procedure.BASIC,
    Tune.Goal.STATOR_RESISTANCE: Procedure.STATOR_RESISTANCE,
    Tune.Goal.CALCULATE: Procedure.CALCULATE,
}
#: How often progress and cancellation are checked, s.
_LOOK_PERIOD = 0.05


class TuningServices:
    """Offers ``~/tune_full`` and the like, and the action ``~/tune``."""

    def __init__(self, node: Node, managed: ManagedDrive, stamp: Callable[[float], Time]) -> None:
        self._node = node
        self._managed = managed
        self._stamp = stamp
        # reentrant, so that a second one is refused at once and a cancel need not wait
        group = ReentrantCallbackGroup()
        for name, procedure in _SERVICES.items():
            answer = self._service_of(name, procedure)
            node.create_service(
                Trigger, name, answer, qos_profile=COMMANDS, callback_group=group
            )
        self._server = ActionServer(
            node,
            Tune,
            '~/tune',
            functools.partial(self._execute, math.inf),
            callback_group=group,
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            goal_service_qos_profile=COMMANDS,
            result_service_qos_profile=COMMANDS,
            cancel_service_qos_profile=COMMANDS,
        )

    def _service_of(
        self, name: str, procedure: Procedure
    ) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            requested_at = received_at()
            call = Call(self._node, name)
            tuned = self._tune(call, procedure, requested_at)
            response.success = tuned.success
            response.message = self._managed.wording.say(tuned.report)
            return response

        return answer

    def _tune(
        self,
        call: Call,
        procedure: Procedure,
        requested_at: float,
        goal: ServerGoalHandle | None = None,
    ) -> Tuned:
        """Tune, and log the call: as it begins, for it may take minutes, or why it does not."""
        try:
            return self._followed(call, procedure, requested_at, goal)
        except DriveError as error:
            why = error.report
        except NodeError as error:
            why = Report(Cause.NOT_POSSIBLE, why=str(error))
        except Exception as error:
            # an exception that leaves a callback would end the executor
            _log.exception('error in a tuning of %s', self._node.get_fully_qualified_name())
            why = Report(Cause.DRIVER_ERROR, error=str(error))
        call.log(self._managed.wording.say(why), success=False)
        return Tuned(False, why, ())

    def _on_goal(self, request: Tune.Goal) -> GoalResponse:
        if request.procedure in _PROCEDURES:
            return GoalResponse.ACCEPT
        # the client only learns that it is rejected
        self._node.get_logger().error(
            f'goal of {self._node.resolve_service_name("~/tune")} rejected: there is no procedure '
            f'{request.procedure}, only 0 to 3'
        )
        return GoalResponse.REJECT

    def _on_accepted(self, goal: ServerGoalHandle) -> None:
        goal.execute(functools.partial(self._execute, time.monotonic()))

    def _execute(self, requested_at: float, goal: ServerGoalHandle) -> Tune.Result:
        procedure = _PROCEDURES[goal.request.procedure]
        call = Call(self._node, '~/tune/_action/send_goal', procedure.name.lower())
        tuned = self._tune(call, procedure, requested_at, goal)
        if tuned.success:
            goal.succeed()
        elif goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        return Tune.Result(
            success=tuned.success,
            message=self._managed.wording.say(tuned.how),
            changed=[str(change) for change in tuned.changes],
        )

    def _followed(
        self,
        call: Call,
        procedure: Procedure,
        requested_at: float,
        goal: ServerGoalHandle | None,
    ) -> Tuned:
        # the bus reports progress, and must not be kept waiting
        reports: queue.SimpleQueue[tuple[Snapshot, float]] = queue.SimpleQueue()

        def tune() -> tuple[Drive, Future[Tuned]]:
            drive = self._managed.require_active()
            return drive, drive.tune(procedure, lambda *report: reports.put(report), requested_at)

        drive, future = _and_find(call, tune)()
        begun = cancelling = False
        while True:
            ended = future.done()
            while not reports.empty():
                report = reports.get()
                if not begun:
                    begun = True
                    call.log()
                if goal is not None:
                    self._report(goal, *report)
            if ended:
                return future.result()
            if goal is not None and goal.is_cancel_requested and not cancelling:
                cancelling = True
                drive.cancel_tuning()
            with contextlib.suppress(FutureTimeoutError):
                future.exception(_LOOK_PERIOD)

    def _report(self, goal: ServerGoalHandle, snapshot: Snapshot, elapsed: float) -> None:
        stamp = self._stamp(snapshot.at)
        status = inv_st(snapshot, stamp, self._node.get_parameter('frame_id').value)
        goal.publish_feedback(Tune.Feedback(status=status, elapsed=elapsed))
