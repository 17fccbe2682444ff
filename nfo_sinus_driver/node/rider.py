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

"""The one who rides: a client of the driver that says what it sees."""

from __future__ import annotations

from collections.abc import Callable
import threading
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nfo_sinus_msgs.msg import DriveStatus
from nfo_sinus_msgs.msg import InvSt
from nfo_sinus_msgs.msg import Telemetry
from rclpy.node import Node
from rclpy.service_introspection import ServiceIntrospectionState
from std_msgs.msg import Float32
from std_srvs.srv import SetBool
from std_srvs.srv import Trigger

from nfo_sinus_driver.node.line import LATCHED
from nfo_sinus_driver.node.line import NEWEST
from nfo_sinus_driver.node.line import RELIABLE

#: A shared machine may be very slow; a step that takes longer has failed, s.
PATIENCE = 30.0
HEADING = f'{"time":>8} {"set-point":>10} {"frequency":>10} {"speed":>9} {"current":>9}  inverter'

_LINE_PERIOD = 0.5
_PUBLISH_PERIOD = 0.1


class StepError(Exception):
    """Something of the ride did not happen."""


class Rider(Node):
    """
    A client of the driver: publishes set-points, calls services, remembers what it hears.

    :ivar ports: on which lines there are drivers.
    """

    def __init__(self) -> None:
        super().__init__('demo_rider')
        self.status: DriveStatus | None = None
        self.inv_st: InvSt | None = None
        self.speed = 0.0
        self.current = 0.0
        self.ports: set[str] = set()
        self._setpoint: float | None = None
        self._started = time.monotonic()
        self._next_line = 0.0
        drive = '/nfo_sinus'
        self.create_subscription(DriveStatus, f'{drive}/status', self._on_status, RELIABLE)
        self.create_subscription(InvSt, f'{drive}/inv_st', self._on_inv_st, LATCHED)
        self.create_subscription(Float32, f'{drive}/actual_speed', self._on_speed, RELIABLE)
        self.create_subscription(Telemetry, f'{drive}/telemetry', self._on_telemetry, RELIABLE)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, RELIABLE)
        self._publisher = self.create_publisher(Float32, f'{drive}/setpoint', NEWEST)
        self.create_timer(_PUBLISH_PERIOD, self._publish)
        self._enable = self.create_client(SetBool, f'{drive}/enable')
        self._triggers = {
            name: self.create_client(Trigger, f'{drive}/{name}') for name in ('stop', 'fault_ack')
        }
        # what is asked and answered is told, so that it can be recorded
        for client in (self._enable, *self._triggers.values()):
            client.configure_introspection(
                self.get_clock(), RELIABLE, ServiceIntrospectionState.CONTENTS
            )

    def follow(self, hertz: float | None) -> None:
        """Publish this set-point from now on, or none."""
        self._setpoint = hertz

    def wait_for(self, what: str, condition: Callable[[], object]) -> None:
        """
        Print what is seen until a condition holds.

        :raises StepError: it does not.
        """
        deadline = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > deadline:
                raise StepError(f'not within {PATIENCE:g} s: {what}')
            self._look_around()
        self._print()

    def watch_for(self, seconds: float, what: str, condition: Callable[[], object]) -> None:
        """
        Print what is seen for some time, in which a condition must hold.

        :raises StepError: it does not.
        """
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if not condition():
                raise StepError(f'did not stay so: {what}')
            self._look_around()

    def enable(self) -> str:
        """Call ``~/enable``; return the answer or raise :class:`StepError` with it."""
        return self._call(self._enable, SetBool.Request(data=True), 'enable')

    def trigger(self, name: str) -> str:
        """Call ``~/stop`` or ``~/fault_ack``."""
        return self._call(self._triggers[name], Trigger.Request(), name)

    def say(self, text: str) -> None:
        """Print a line between those of the timeline."""
        print(f'{self._now():6.1f} s  -- {text}', flush=True)

    @property
    def actual(self) -> float:
        """Actual frequency, Hz."""
        return float('nan') if self.status is None else self.status.actual

    def _call(self, client: Any, request: Any, name: str) -> str:
        if not client.wait_for_service(PATIENCE):
            raise StepError(f'there is no service {name}')
        future = client.call_async(request)
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        if not done.wait(PATIENCE):
            raise StepError(f'{name} does not answer')
        response = future.result()
        self.say(f'{name}: {response.message}')
        if not response.success:
            raise StepError(f'{name} was refused: {response.message}')
        message: str = response.message
        return message

    def _now(self) -> float:
        return time.monotonic() - self._started

    def _look_around(self) -> None:
        # it takes up to some seconds until one hears of another, so this is never over
        if self.count_publishers('/nfo_sinus/status') > 1:
            raise StepError(
                'there is another driver in this ROS domain, and it may have a real motor: '
                'start again, which takes another domain'
            )
        if self._now() >= self._next_line:
            self._print()
        time.sleep(0.02)

    def _print(self) -> None:
        self._next_line = self._now() + _LINE_PERIOD
        status = self.status
        if status is None or self.inv_st is None:
            return
        setpoint = '--' if self._setpoint is None else f'{self._setpoint:.1f}'
        print(
            f'{self._now():6.1f} s {setpoint:>7} Hz {status.actual:7.1f} Hz {self.speed:5.0f} rpm '
            f'{self.current:7.2f} A  {self.inv_st.text}',
            flush=True,
        )

    def _publish(self) -> None:
        if self._setpoint is not None:
            self._publisher.publish(Float32(data=self._setpoint))

    def _on_status(self, message: DriveStatus) -> None:
        self.status = message

    def _on_inv_st(self, message: InvSt) -> None:
        self.inv_st = message

    def _on_speed(self, message: Float32) -> None:
        self.speed = message.data

    def _on_telemetry(self, message: Telemetry) -> None:
        self.current = message.output_current

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        # a bus tells its port as the hardware it is about
        self.ports.update(status.hardware_id for status in message.status)
