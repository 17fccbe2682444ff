# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""Tuning through ROS: four services that answer at the end, and an action."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import TimeoutError as FutureTimeoutError
import contextlib
import queue

from builtin_interfaces.msg import Time
from nfo_sinus_msgs.action import Tune
from rclpy.action import ActionServer
from rclpy.action import CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.drive import Report
from nfo_sinus_driver.drive import Snapshot
from nfo_sinus_driver.drive import Tuned
from nfo_sinus_driver.node.managed_drive import ManagedDrive
from nfo_sinus_driver.node.messages import inv_st
from nfo_sinus_driver.node.wording import NodeError

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
#: How often it is looked whether there is something new, s.
_LOOK_PERIOD = 0.05


class TuningServices:
    """
    Offers ``~/tune_full`` and its like, and the action ``~/tune``.

    :param stamp: gives the node's time of a moment of ``time.monotonic``.
    """

    def __init__(self, node: Node, managed: ManagedDrive, stamp: Callable[[float], Time]) -> None:
        self._node = node
        self._managed = managed
        self._stamp = stamp
        # reentrant, so that a second one is refused at once and a cancel need not wait
        group = ReentrantCallbackGroup()
        for name, procedure in _SERVICES.items():
            node.create_service(Trigger, name, self._service_of(procedure), callback_group=group)
        self._server = ActionServer(
            node,
            Tune,
            '~/tune',
            self._execute,
            callback_group=group,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def _service_of(
        self, procedure: Procedure
    ) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            tuned = self._result(lambda: self._managed.require_active().tune(procedure).result())
            response.success = tuned.success
            response.message = self._managed.wording.say(tuned.report)
            return response

        return answer

    def _result(self, tune: Callable[[], Tuned]) -> Tuned:
        try:
            return tune()
        except DriveError as error:
            return Tuned(False, error.report, ())
        except NodeError as error:
            return Tuned(False, Report(Cause.NOT_POSSIBLE, why=str(error)), ())
        except Exception as error:
            # an exception that leaves a callback would end the executor
            self._node.get_logger().error(f'error in a tuning: {error!r}')
            return Tuned(False, Report(Cause.DRIVER_ERROR, error=str(error)), ())

    def _execute(self, goal: ServerGoalHandle) -> Tune.Result:
        tuned = self._result(lambda: self._followed(goal))
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

    def _followed(self, goal: ServerGoalHandle) -> Tuned:
        procedure = _PROCEDURES.get(goal.request.procedure)
        if procedure is None:
            raise NodeError(f'there is no procedure {goal.request.procedure}: 0 to 3')
        drive = self._managed.require_active()
        # the bus reports how far it is, and nobody may keep it waiting
        reports: queue.SimpleQueue[tuple[Snapshot, float]] = queue.SimpleQueue()
        future = drive.tune(procedure, lambda *report: reports.put(report))
        cancelling = False
        while True:
            ended = future.done()
            while not reports.empty():
                self._report(goal, *reports.get())
            if ended:
                return future.result()
            if goal.is_cancel_requested and not cancelling:
                cancelling = True
                drive.cancel_tuning()
            with contextlib.suppress(FutureTimeoutError):
                future.exception(_LOOK_PERIOD)

    def _report(self, goal: ServerGoalHandle, snapshot: Snapshot, elapsed: float) -> None:
        stamp = self._stamp(snapshot.at)
        status = inv_st(snapshot, stamp, self._node.get_parameter('frame_id').value)
        goal.publish_feedback(Tune.Feedback(status=status, elapsed=elapsed))
