# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The controllers of ros2_control are active only while all drives are enabled.

Start the driver and the controller manager, with the controllers inactive, and then::

    python3 examples/controller_stopper.py --ros-args -p "drives:=[/left_wheel, /right_wheel]" \
        -p "controllers:=[diff_drive_controller]"

When a drive stops, for whatever reason, the controllers are deactivated: they no longer integrate
a command that no motor follows, and begin at 0 when they are activated again, as soon as all
drives are enabled. A drive without a status for `status_timeout` counts as not enabled. This
program stops and enables no motor: the driver does, by `stop_with` and `enable_all`.
"""

from __future__ import annotations

from functools import partial
import math
import time

from builtin_interfaces.msg import Duration
from controller_manager_msgs.srv import SwitchController
from drive_client import STATUS_QOS
from nfo_sinus_msgs.msg import DriveStatus
from rcl_interfaces.msg import ParameterDescriptor
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future

#: How often it is looked whether a status is too old, s.
PERIOD = 0.1
#: How long the controller manager may take to answer, and a switch that failed rests, s.
ANSWER_TIMEOUT = 5.0
REST = 1.0

#: The parameters, their defaults, and what they are.
PARAMETERS = {
    'drives': (['/left_wheel', '/right_wheel'], 'names of the nodes of the drives'),
    'controllers': (['diff_drive_controller'], 'what is active while all drives are enabled'),
    'controller_manager': ('/controller_manager', 'name of its node'),
    'status_timeout': (1.0, 'a drive without a status for so long is not enabled, s'),
}


class ControllerStopper(Node):
    """Switches controllers by what drives say of themselves."""

    def __init__(self) -> None:
        super().__init__('controller_stopper')
        given = {
            name: self.declare_parameter(
                name, default, ParameterDescriptor(description=text, read_only=True)
            ).value
            for name, (default, text) in PARAMETERS.items()
        }
        self._controllers: list[str] = given['controllers']
        self._timeout: float = given['status_timeout']
        #: Until when each drive is enabled, if it says nothing more, s.
        self._until = dict.fromkeys(given['drives'], -math.inf)
        #: What the controllers are, as far as is known: active, or inactive.
        self._active: bool | None = None
        self._call: Future | None = None
        #: When the call that is under way is given up, or the next one may be made, s.
        self._patience = -math.inf
        self._switch = self.create_client(
            SwitchController, f'{given["controller_manager"]}/switch_controller'
        )
        for drive in self._until:
            self.create_subscription(
                DriveStatus, f'{drive}/status', partial(self._on_status, drive), STATUS_QOS
            )
        # not by the clock of a simulation, which may stand
        self.create_timer(PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_status(self, drive: str, status: DriveStatus) -> None:
        is_enabled = status.connected and status.enabled
        self._until[drive] = time.monotonic() + self._timeout if is_enabled else -math.inf
        self._look()

    def _look(self) -> None:
        """Have the controllers switched, if they are not what the drives are."""
        now = time.monotonic()
        wanted = all(now < until for until in self._until.values())
        if not self._switch.service_is_ready():
            # one that is started again has its controllers as it was told
            self._active = None
            return
        if wanted == self._active or now < self._patience:
            return
        if self._call is not None:
            self.get_logger().error(f'no answer of {self._switch.srv_name}')
            self._switch.remove_pending_request(self._call)
        request = SwitchController.Request(
            # what is as it should be already is no failure then
            strictness=SwitchController.Request.BEST_EFFORT, timeout=Duration(sec=1),
        )
        if wanted:
            request.activate_controllers = self._controllers
        else:
            request.deactivate_controllers = self._controllers
        self._patience = now + ANSWER_TIMEOUT
        self._call = self._switch.call_async(request)
        self._call.add_done_callback(partial(self._on_answer, wanted))

    def _on_answer(self, wanted: bool, call: Future) -> None:
        if call is not self._call:
            return
        self._call, self._patience = None, -math.inf
        what = f'{", ".join(self._controllers)} {"" if wanted else "de"}activated'
        if call.result().ok:
            self._active = wanted
            self.get_logger().info(what)
        else:
            self._active, self._patience = None, time.monotonic() + REST
            self.get_logger().warning(f'not {what}: retrying', throttle_duration_sec=10.0)


def main() -> None:
    """Watch the drives until Ctrl-C."""
    rclpy.init()
    node = ControllerStopper()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        # nothing is left to do: the controllers stay as they are
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
