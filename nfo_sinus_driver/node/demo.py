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

"""
``make demo``: a short ride, as any ROS client would do it.

It starts a simulated drive and the driver, enables the drive, runs it forward and backward, lets
a fault happen, acknowledges it, enables again and stops, and prints what it sees. It ends with 0
only if every step happened.
"""

from __future__ import annotations

from collections.abc import Callable
import os
import random
import signal
import sys
import tempfile
import threading
import time
from typing import Any

from nfo_sinus_msgs.msg import DriveStatus
from nfo_sinus_msgs.msg import InvSt
from nfo_sinus_msgs.msg import Telemetry
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float32
from std_srvs.srv import SetBool
from std_srvs.srv import Trigger

from nfo_sinus_driver.node.bench import Bench
from nfo_sinus_driver.node.line import LATCHED
from nfo_sinus_driver.node.line import NEWEST
from nfo_sinus_driver.node.line import RELIABLE

_LINE_PERIOD = 0.5
_PUBLISH_PERIOD = 0.1
#: A shared machine may be very slow; a step that takes longer has failed, s.
_PATIENCE = 30.0
_OVERLOAD = 5
_BUS_STANDBY = 37
#: How close to the set-point counts as reached, Hz.
_NEAR = 0.3
_STANDS_FOR = 1.5
_COASTS_FOR = 2.0
_DOMAINS = range(1, 102)

_HEADING = f'{"time":>8} {"set-point":>10} {"frequency":>10} {"speed":>9} {"current":>9}  inverter'


class StepError(Exception):
    """Something of the ride did not happen."""


class Rider(Node):
    """A client of the driver: publishes set-points, calls services, remembers what it hears."""

    def __init__(self) -> None:
        super().__init__('demo_rider')
        self.status: DriveStatus | None = None
        self.inv_st: InvSt | None = None
        self.speed = 0.0
        self.current = 0.0
        self._setpoint: float | None = None
        self._started = time.monotonic()
        self._next_line = 0.0
        drive = '/nfo_sinus'
        self.create_subscription(DriveStatus, f'{drive}/status', self._on_status, RELIABLE)
        self.create_subscription(InvSt, f'{drive}/inv_st', self._on_inv_st, LATCHED)
        self.create_subscription(Float32, f'{drive}/actual_speed', self._on_speed, RELIABLE)
        self.create_subscription(Telemetry, f'{drive}/telemetry', self._on_telemetry, RELIABLE)
        self._publisher = self.create_publisher(Float32, f'{drive}/setpoint', NEWEST)
        self.create_timer(_PUBLISH_PERIOD, self._publish)
        self._enable = self.create_client(SetBool, f'{drive}/enable')
        self._triggers = {
            name: self.create_client(Trigger, f'{drive}/{name}') for name in ('stop', 'fault_ack')
        }

    def follow(self, hertz: float | None) -> None:
        """Publish this set-point from now on, or none."""
        self._setpoint = hertz

    def wait_for(self, what: str, condition: Callable[[], object]) -> None:
        """
        Print what is seen until a condition holds.

        :raises StepError: it does not.
        """
        deadline = time.monotonic() + _PATIENCE
        while not condition():
            if time.monotonic() > deadline:
                raise StepError(f'not within {_PATIENCE:g} s: {what}')
            self._print_when_due()
            time.sleep(0.02)
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
            self._print_when_due()
            time.sleep(0.02)

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
        if not client.wait_for_service(_PATIENCE):
            raise StepError(f'there is no service {name}')
        future = client.call_async(request)
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        if not done.wait(_PATIENCE):
            raise StepError(f'{name} does not answer')
        response = future.result()
        self.say(f'{name}: {response.message}')
        if not response.success:
            raise StepError(f'{name} was refused: {response.message}')
        message: str = response.message
        return message

    def _now(self) -> float:
        return time.monotonic() - self._started

    def _print_when_due(self) -> None:
        if self._now() >= self._next_line:
            self._print()

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


def ride(rider: Rider, bench: Bench) -> None:
    """
    Do the ride.

    :raises StepError: a step did not happen.
    """

    def near(hertz: float) -> Callable[[], bool]:
        return lambda: abs(rider.actual - hertz) < _NEAR

    def reach(hertz: float) -> None:
        rider.say(f'set-point {hertz:g} Hz')
        rider.follow(hertz)
        rider.wait_for(f'{hertz:g} Hz', near(hertz))

    rider.wait_for('a drive', lambda: rider.status and rider.status.connected and rider.inv_st)
    rider.enable()
    reach(30.0)
    reach(-20.0)

    rider.say('a fault happens: the simulated motor is overloaded')
    bench.inject('fault', str(_OVERLOAD))
    rider.wait_for('the fault', lambda: rider.inv_st and rider.inv_st.code == _OVERLOAD)
    assert rider.inv_st is not None
    rider.say(f'{rider.inv_st.text}: {rider.inv_st.description}. {rider.inv_st.remedy}')
    # the drive cannot measure the speed of a motor that coasts
    rider.watch_for(_COASTS_FOR, 'a released motor', near(0.0))
    rider.trigger('fault_ack')
    # what still coasts is caught and ramped down
    rider.wait_for('standby', lambda: rider.inv_st and rider.inv_st.code == _BUS_STANDBY)
    rider.say('set-points keep coming, and nothing turns until it is enabled again')
    rider.watch_for(_STANDS_FOR, 'standstill', near(0.0))

    rider.enable()
    reach(15.0)
    rider.trigger('stop')
    rider.wait_for('standstill', near(0.0))
    rider.follow(None)


def main() -> int:
    """Start everything, ride, and end everything."""
    # a domain of its own: whatever else runs on this machine is not disturbed
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = str(random.choice(_DOMAINS))
    with tempfile.TemporaryFile() as log, Bench(log) as bench:
        try:
            print(bench.start_simulator())
            driver = bench.start_driver()
            print(_HEADING, flush=True)
            _ride_with_ros(bench)
            driver.send_signal(signal.SIGINT)
            if driver.wait(_PATIENCE) != 0:
                raise StepError('the driver did not end as it should')
        except (StepError, RuntimeError) as error:
            log.seek(0)
            print(f'\nWhat driver and simulator said:\n{log.read().decode()}', file=sys.stderr)
            print(f'FAILED: {error}', file=sys.stderr)
            return 1
    print('The ride is done: every step happened.')
    return 0


def _ride_with_ros(bench: Bench) -> None:
    rclpy.init()
    executor = SingleThreadedExecutor()
    rider = Rider()
    executor.add_node(rider)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        ride(rider, bench)
    finally:
        executor.shutdown()
        thread.join()
        rider.destroy_node()
        rclpy.shutdown()


if __name__ == '__main__':
    sys.exit(main())
