# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the examples share: a drive as its client sees it, and a node that outlives Ctrl-C.

Copy this file and put it beside your own program. It needs rclpy, nfo_sinus_msgs, std_msgs and
std_srvs. The other examples show how it is used; every one of them has this form::

    with control_node('my_client') as node:
        drive = Drive(node, '/nfo_sinus')
        try:
            ...                                # enable, and send set-points
        finally:
            stopped = node.stop(drive.stop)    # on every way out
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
import contextlib
import functools
import math
import signal
import time
from typing import NamedTuple

from nfo_sinus_msgs.msg import DriveStatus, InvSt
import rclpy
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger

#: What ends a program: Ctrl-C, `kill`, and the terminal that is closed.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

#: How long to look for the driver and its drives, s.
FIND_TIMEOUT = 30.0
#: How long to wait for the answer of a service, s; the driver answers a stop within about 2 s.
ANSWER_TIMEOUT = 10.0
#: How long the status may take to say what a service has answered already, s.
FOLLOW_TIMEOUT = 5.0
#: The longest sleep of a program that waits, s: so soon it hears of a signal.
_TICK = 0.1

#: For ~/status, which flows.
STATUS_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
#: For ~/inv_st, which comes on change: who joins late is told the last one.
INV_ST_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
#: For set-points: only the newest counts, and an old one is not sent again.
SETPOINT_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)


class Answer(NamedTuple):
    """What a service of the driver answers."""

    success: bool
    message: str


class ControlNode(Node):
    """
    A node that commands drives, and is told of Ctrl-C without being ended by it.

    The signal handlers of rclpy would shut ROS down before a motor can be stopped. Here a signal
    only sets `interrupted`: the program looks at that, stops its motors and ends.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.interrupted = False
        for number in ENDING:
            signal.signal(number, self._interrupt)
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)

    def _interrupt(self, *_: object) -> None:
        self.interrupted = True

    def spin_until(self, condition: Callable[[], object], seconds: float) -> bool:
        """Handle messages until a condition holds; False: not in this time, or interrupted."""
        end = time.monotonic() + seconds
        while not condition():
            left = end - time.monotonic()
            if self.interrupted or left <= 0.0:
                return False
            self._spinner.spin_once(timeout_sec=min(left, _TICK))
        return True

    def call(self, client: Client, request: SetBool.Request | Trigger.Request) -> Answer:
        """Call a service and wait for its answer, also when interrupted."""
        if not client.service_is_ready():
            return Answer(False, f'no service {client.srv_name}: the driver has ended')
        future = client.call_async(request)
        self._spinner.spin_until_future_complete(future, ANSWER_TIMEOUT)
        if not future.done():
            client.remove_pending_request(future)
            return Answer(False, f'no answer of {client.srv_name} in {ANSWER_TIMEOUT:g} s')
        return Answer(future.result().success, future.result().message)

    def stop(self, client: Client) -> bool:
        """Call a service that stops, and say how it went; False: the stop is not confirmed."""
        # the call comes before anything is said: a log can fail, and takes time
        success, message = self.call(client, Trigger.Request())
        if success:
            self.get_logger().info(f'{client.srv_name}: {message}')
        else:
            self.get_logger().fatal(
                f'THE STOP IS NOT CONFIRMED, use the RUN input or the emergency stop: {message}'
            )
        return success

    def close(self) -> None:
        """Leave ROS."""
        self._spinner.shutdown()
        self.destroy_node()


@contextlib.contextmanager
def control_node(name: str) -> Iterator[ControlNode]:
    """Have ROS and a node in it; `--ros-args` of the command line count."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = ControlNode(name)
        try:
            yield node
        finally:
            node.close()
    finally:
        rclpy.shutdown()


class Drive:
    """
    One drive: what its node says, its services, and its set-points.

    :param name: of the drive's node, such as `/nfo_sinus`.
    :ivar status: the newest message of ~/status; at first an empty one, not connected.
    :ivar inv_st: the newest message of ~/inv_st: what the drive's display says.
    """

    def __init__(self, node: ControlNode, name: str) -> None:
        self.name = name
        self.status = DriveStatus()
        self.inv_st = InvSt()
        self._status_at = -math.inf
        node.create_subscription(DriveStatus, f'{name}/status', self._on_status, STATUS_QOS)
        node.create_subscription(InvSt, f'{name}/inv_st', self._on_inv_st, INV_ST_QOS)
        self._node = node
        self._setpoint = node.create_publisher(Float32, f'{name}/setpoint', SETPOINT_QOS)
        self.enable = node.create_client(SetBool, f'{name}/enable')
        self.fault_ack = node.create_client(Trigger, f'{name}/fault_ack')

    @functools.cached_property
    def stop(self) -> Client:
        """The service that stops the motor; there is no client of it before it is needed."""
        return self._node.create_client(Trigger, f'{self.name}/stop')

    def send(self, setpoint: float) -> None:
        """Publish a set-point, in the unit of the drive's control mode; negative is reverse."""
        self._setpoint.publish(Float32(data=setpoint))

    @property
    def display(self) -> str:
        """What the drive's display says, what it means, and what to do about it."""
        shown = self.inv_st
        return f'{shown.code} {shown.text}: {shown.description}. {shown.remedy}'.strip()

    def problem(self, status_timeout: float) -> str:
        """
        Return why the motor does not follow its set-points; empty if it does.

        :param status_timeout: how old the newest status may be, s.
        """
        # by the steady clock and not by the stamps: no client can set it
        age = time.monotonic() - self._status_at
        if age > status_timeout:
            return f'{self.name}: no status for {age:.1f} s'
        if not self.status.connected:
            return f'{self.name}: the drive does not respond'
        if self.status.fault:
            return f'{self.name}: the drive has a fault'
        if not self.status.enabled:
            why = self.status.stop_text or 'it was not enabled'
            return f'{self.name}: {why}'
        return ''

    def _on_status(self, status: DriveStatus) -> None:
        self.status = status
        self._status_at = time.monotonic()

    def _on_inv_st(self, inv_st: InvSt) -> None:
        self.inv_st = inv_st


def first_problem(drives: Iterable[Drive], status_timeout: float) -> str:
    """Return the problem of the first drive that has one, see `Drive.problem`."""
    return next(filter(None, (drive.problem(status_timeout) for drive in drives)), '')


def find(node: ControlNode, drives: Iterable[Drive], *clients: Client) -> str:
    """
    Wait for drives, and for services beside theirs; return what is missing or wrong, or nothing.

    Nothing is enabled by it.
    """

    def missing(what: str) -> str:
        return 'interrupted' if node.interrupted else what

    node.get_logger().info('waiting for the driver and its drives')
    for drive in drives:
        if not node.spin_until(lambda drive=drive: drive.status.connected, FIND_TIMEOUT):
            return missing(f'{drive.name}: no driver runs there, or the drive does not respond')
        if drive.status.control_mode != DriveStatus.FREQUE:
            return f'{drive.name}: its set-points are in {drive.status.unit}, not in Hz'
        clients = (*clients, drive.enable, drive.fault_ack)
    for client in clients:
        if not node.spin_until(client.service_is_ready, FIND_TIMEOUT):
            return missing(f'there is no service {client.srv_name}')
    return ''


def report_fault(node: ControlNode, drive: Drive) -> None:
    """Say what the fault of a drive is and what to do, as soon as it is told."""
    node.spin_until(lambda: drive.inv_st.kind == InvSt.FAULT, FOLLOW_TIMEOUT)
    node.get_logger().error(f'{drive.name}: {drive.display}')


def report(node: ControlNode, problem: str, drives: Iterable[Drive]) -> None:
    """Say what ended it, and what the faults are; the motors are stopped before."""
    node.get_logger().error(problem)
    for drive in drives:
        if drive.status.fault:
            report_fault(node, drive)
