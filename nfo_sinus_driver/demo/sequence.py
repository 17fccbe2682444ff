# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The demo sequence: what a client of the driver does and sees, from enable to stop."""

from __future__ import annotations

from collections.abc import Callable
import math
import threading
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nfo_sinus_msgs.msg import DriveStatus, InvSt, Telemetry
from rclpy.node import Node
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger

from nfo_sinus_driver.demo.bench import Bench
from nfo_sinus_driver.node.ros.qos import LATCHED, NEWEST, RELIABLE

#: A shared machine may be very slow; a step that takes longer has failed, s.
PATIENCE = 30.0
#: The line above what is printed.
HEADING = f'{"time":>8} {"set-point":>10} {"frequency":>10} {"speed":>9} {"current":>9}  inverter'

_OVERLOAD = 5
_BUS_STANDBY = 37
#: How close to the set-point counts as reached, Hz.
_NEAR = 0.3
_RUNS_FOR = 1.0
_LISTENS_FOR = 2.0
_STANDS_FOR = 1.5
_COASTS_FOR = 2.5

_LINE_PERIOD = 0.5
_PUBLISH_PERIOD = 0.1


class StepError(Exception):
    """A step of the sequence did not happen."""


class DomainTakenError(StepError):
    """There is another driver in the ROS domain."""


class DemoSequence(Node):
    """A client of the driver: it enables, runs, lets a fault happen, and prints what it sees."""

    def __init__(self) -> None:
        super().__init__('demo_sequence')
        self._status: DriveStatus | None = None
        self._inv_st: InvSt | None = None
        self._speed = 0.0
        self._current = 0.0
        self._ports: set[str] = set()
        #: What is published again and again.
        self._setpoint: float | None = None
        #: When the drive was connected, from when on time counts.
        self._started = time.monotonic()
        self._printed = -math.inf
        drive = '/nfo_sinus'
        self.create_subscription(DriveStatus, f'{drive}/status', self._on_status, RELIABLE)
        self.create_subscription(InvSt, f'{drive}/inv_st', self._on_inv_st, LATCHED)
        self.create_subscription(Float32, f'{drive}/actual_speed', self._on_speed, RELIABLE)
        self.create_subscription(Telemetry, f'{drive}/telemetry', self._on_telemetry, RELIABLE)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, RELIABLE)
        self._publisher = self.create_publisher(Float32, f'{drive}/setpoint', NEWEST)
        self.create_timer(_PUBLISH_PERIOD, self._publish)
        self._enable_client = self.create_client(SetBool, f'{drive}/enable')
        self._triggers = {
            name: self.create_client(Trigger, f'{drive}/{name}') for name in ('stop', 'fault_ack')
        }

    def run(self, bench: Bench) -> None:
        """Go through it, or a StepError."""

        def near(hertz: float) -> Callable[[], object]:
            return lambda: self._status and abs(self._status.actual - hertz) < _NEAR

        def reach(hertz: float) -> None:
            self._say(f'set-point {hertz:g} Hz')
            self._setpoint = hertz
            self._wait_for(f'{hertz:g} Hz', near(hertz))
            self._watch_for(_RUNS_FOR, f'{hertz:g} Hz', near(hertz))

        self._wait_for('our driver', lambda: bench.port in self._ports)
        self._wait_for('a drive', lambda: self._status and self._status.connected and self._inv_st)
        # before anything turns it is sure that nothing but ours will
        self._watch_for(_LISTENS_FOR, 'standstill', near(0.0))
        self._enable()
        reach(30.0)
        reach(-20.0)

        self._say('a fault happens: the simulated motor is overloaded')
        bench.inject('fault', str(_OVERLOAD))
        self._wait_for('the fault', lambda: self._inv_st and self._inv_st.code == _OVERLOAD)
        assert self._inv_st is not None
        self._say(f'{self._inv_st.text}: {self._inv_st.description}. {self._inv_st.remedy}')
        # the drive cannot measure the speed of a motor that coasts
        self._wait_for('a released motor', near(0.0))
        self._watch_for(_COASTS_FOR, 'a released motor', near(0.0))
        self._trigger('fault_ack')
        # control is released then, so nothing turns
        self._wait_for('no fault', lambda: self._inv_st and self._inv_st.kind == InvSt.STATUS)
        self._say('set-points keep coming, and nothing turns until it is enabled again')
        self._watch_for(_STANDS_FOR, 'standstill', near(0.0))
        # what is still asked for would be followed as soon as it is enabled
        self._say('set-point 0 Hz')
        self._setpoint = 0.0
        self._watch_for(_RUNS_FOR, 'standstill', near(0.0))

        self._enable()
        reach(15.0)
        self._trigger('stop')
        self._wait_for('standby', lambda: self._inv_st and self._inv_st.code == _BUS_STANDBY)
        self._setpoint = None
        # of what is published, the state may be newer than the frequency
        self._wait_for('standstill', near(0.0))
        self._watch_for(_STANDS_FOR, 'standstill', near(0.0))

    def _wait_for(self, what: str, condition: Callable[[], object]) -> None:
        """Print what is measured until a condition holds (StepError: it does not)."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > deadline:
                raise StepError(f'not within {PATIENCE:g} s: {what}')
            self._look_around()
        if self._now() > self._printed + _LINE_PERIOD / 5:
            self._print()

    def _watch_for(self, seconds: float, what: str, condition: Callable[[], object]) -> None:
        """
        Print what is measured for some time, in which a condition must hold.

        :raises StepError: it does not.
        """
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if not condition():
                raise StepError(f'did not stay so: {what}')
            self._look_around()

    def _enable(self) -> None:
        self._call(self._enable_client, SetBool.Request(data=True), 'enable')

    def _trigger(self, name: str) -> None:
        self._call(self._triggers[name], Trigger.Request(), name)

    def _say(self, text: str) -> None:
        """Print a line between those of the timeline."""
        print(f'{self._now():6.1f} s  -- {text}', flush=True)

    def _call(self, client: Any, request: Any, name: str) -> None:
        if not client.wait_for_service(PATIENCE):
            raise StepError(f'there is no service {name}')
        future = client.call_async(request)
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        if not done.wait(PATIENCE):
            raise StepError(f'{name} does not answer')
        response = future.result()
        self._say(f'{name}: {response.message}')
        if not response.success:
            raise StepError(f'{name} was refused: {response.message}')

    def _now(self) -> float:
        return time.monotonic() - self._started

    def _look_around(self) -> None:
        # it takes up to some seconds until one hears of another, so this is never over
        if self.count_publishers('/nfo_sinus/status') > 1:
            raise DomainTakenError(
                f'there is another driver in ROS domain {self.context.get_domain_id()}, and it '
                'may have a real motor'
            )
        if self._now() >= self._printed + _LINE_PERIOD:
            self._print()
        time.sleep(0.02)

    def _print(self) -> None:
        status = self._status
        if status is None or self._inv_st is None:
            return
        self._printed = self._now()
        setpoint = '--' if self._setpoint is None else f'{self._setpoint:.1f}'
        print(
            f'{self._now():6.1f} s {setpoint:>7} Hz {status.actual:7.1f} Hz {self._speed:5.0f} rpm '
            f'{self._current:7.2f} A  {self._inv_st.text}',
            flush=True,
        )

    def _publish(self) -> None:
        if self._setpoint is not None:
            self._publisher.publish(Float32(data=self._setpoint))

    def _on_status(self, message: DriveStatus) -> None:
        if message.connected and not (self._status and self._status.connected):
            self._started = time.monotonic()
            self._printed = -math.inf
        self._status = message

    def _on_inv_st(self, message: InvSt) -> None:
        self._inv_st = message

    def _on_speed(self, message: Float32) -> None:
        self._speed = message.data

    def _on_telemetry(self, message: Telemetry) -> None:
        self._current = message.output_current

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        pairs = (pair for status in message.status for pair in status.values)
        self._ports.update(pair.value for pair in pairs if pair.key == 'port')
