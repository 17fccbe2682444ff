# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The view of all drives on the graph: ``ros2 run nfo_sinus_driver monitor``.

It subscribes to every drive and can stop them; nothing here starts a motor.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import contextlib
from dataclasses import dataclass, field, fields
import math
import os
import sys
import threading
import time
from typing import Any

from builtin_interfaces.msg import Time
from nfo_sinus_msgs.msg import BusStatistics, DriveStatus, ErrorLogEntry, InvSt, Telemetry
from nfo_sinus_msgs.srv import GetErrorLog
from rcl_interfaces.msg import Log
import rclpy
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.utilities import get_default_context
from std_srvs.srv import Trigger

from nfo_sinus_driver.node.ros.qos import KEPT, LATCHED, RELIABLE, ROSOUT
from nfo_sinus_driver.node.ros.start import init_ros
from nfo_sinus_driver.version import VERSION
from nfo_sinus_driver.view import show, why_unavailable
from nfo_sinus_driver.view.picture import (
    Condition,
    DriveView,
    Level,
    Measured,
    Note,
    Picture,
    error_line,
)

#: How often the graph is searched for nodes, s.
_DISCOVERY_PERIOD = 1.0
#: After how long without a message a driver has ended, s: each drive has one a second at least.
_GONE_AFTER = 3.5
#: The longest period of telemetry that is assumed, s.
_LONGEST_TELEMETRY = 30.0
#: How long the service of a stop that was requested may take to be discovered, s.
_FOUND_WITHIN = 3.0
#: After how long without an answer a stop is reported as not confirmed, s.
_ANSWER_TIME = 5.0
#: How long an answer may take before it is shown as missing, s.
_SOON = 1.0

_LEVELS = {
    Log.INFO: Level.INFO,
    Log.WARN: Level.WARNING,
    Log.ERROR: Level.ERROR,
    Log.FATAL: Level.ERROR,
}
_RUNS = (DriveStatus.OPERATION_ENABLED, DriveStatus.STOPPING, DriveStatus.QUICK_STOP)
_QOS = {
    DriveStatus: RELIABLE,
    InvSt: LATCHED,
    Telemetry: RELIABLE,
    BusStatistics: RELIABLE,
    ErrorLogEntry: KEPT,
}
_TYPES = {f'nfo_sinus_msgs/msg/{message_type.__name__}': message_type for message_type in _QOS}
_TRIGGER = 'std_srvs/srv/Trigger'
_GET_ERROR_LOG = 'nfo_sinus_msgs/srv/GetErrorLog'
#: So many entries of an error log are shown.
_MOST_ERRORS = 8
#: The name while it is not known yet which node a publisher belongs to.
_UNKNOWN = '_NODE_NAME_UNKNOWN_'
_NOT_KNOWN_YET = rclpy_implementation.RCLError
#: What lines about new entries of the error log begin with.
_ERROR_LOG = 'error log: '
#: For how long a line of the log waits for its node to be found, s.
_WAITS_FOR_NODE = 15.0


class _Topics:
    """Topics of one node, read when it is time to draw: no executor is woken by them."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._subscriptions: dict[tuple[type, str], Subscription] = {}

    def add(self, type_: type, topic: str, qos: QoSProfile) -> None:
        """Subscribe to a topic from now on, even if it is remapped."""
        if (type_, topic) not in self._subscriptions:
            subscription = self._node.create_subscription(type_, topic, _nothing, qos)
            self._subscriptions[type_, topic] = subscription

    def has(self, type_: type) -> bool:
        """Return whether there is a topic of a type."""
        return any(known is type_ for known, _ in self._subscriptions)

    def take_messages(self) -> Iterator[Any]:
        """Return the messages since the last call, oldest of each topic first."""
        for subscription in self._subscriptions.values():
            while True:
                with subscription.handle:
                    taken = subscription.handle.take_message(subscription.msg_type, False)
                if taken is None:
                    break
                yield taken[0]


def _nothing(_: object) -> None:
    """Never called: the node is not spun."""


@dataclass
class _DriverNode:
    """A node of a drive, or of a line: what it published last."""

    name: str
    topics: _Topics
    updated_at: float
    #: The service that stops its drive, or all drives of its line; None: it offers none yet.
    stop: Client | None = None
    #: The same of that which acknowledges the fault of its drive.
    acknowledge: Client | None = None
    #: The same of that which reads the error log of its drive, and what has come of that.
    error_log: Client | None = None
    errors: Sequence[str] = ()
    status: DriveStatus = field(default_factory=DriveStatus)
    inv_st: InvSt = field(default_factory=InvSt)
    telemetry: Telemetry | None = None
    telemetry_at: float = -math.inf
    #: The time from the one before to it, s.
    telemetry_gap: float = 0.0
    statistics: BusStatistics | None = None

    @property
    def is_drive(self) -> bool:
        """It is the node of a drive, and not that of a line."""
        return self.topics.has(DriveStatus)

    @property
    def is_line(self) -> bool:
        """It is the node of a line."""
        return self.topics.has(BusStatistics) and not self.is_drive


@dataclass
class _Call:
    """A call of a service, and which node it is about."""

    who: str
    service: str
    future: Future
    requested_at: float
    reported_late: bool = False


class GraphSource:
    """
    Every drive on the graph, by what their nodes publish.

    :param spaces: only drives in these namespaces; none: all.
    """

    only_looks = ''

    def __init__(self, context: Context, spaces: Sequence[str] = ()) -> None:
        options: dict[str, Any] = {
            'context': context,
            'enable_rosout': False,
            'start_parameter_services': False,
        }
        self._spaces = tuple(f'/{space.strip("/")}' for space in spaces)
        self._node = Node(f'monitor_{os.getpid()}', **options)
        self._caller = Node(f'monitor_{os.getpid()}_calls', **options)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._caller)
        self._thread = threading.Thread(target=self._spin, name='answers', daemon=True)
        self._thread.start()
        self._driver_nodes: dict[str, _DriverNode] = {}
        self._rosout = _Topics(self._node)
        self._rosout.add(Log, '/rosout', ROSOUT)
        self._log_lines: list[tuple[float, Log]] = []
        #: The stops that were requested and wait for their service, and since when.
        self._unsent: list[tuple[_DriverNode, float]] = []
        self._calls: list[_Call] = []
        #: Acknowledgements that are not answered yet.
        self._acknowledging: list[_Call] = []
        #: Error logs that are being read.
        self._reading: list[_Call] = []
        #: Why the last stop of a node is not confirmed, by its name.
        self._failed: dict[str, str] = {}
        self._notes: list[Note] = []
        self._looked_around_at = -math.inf
        self.title = f'ROS domain {context.get_domain_id()}'
        where = f' in {" ".join(self._spaces)}' if self._spaces else ''
        self.advice = (
            f'No drive{where} yet. Start one:\n\n    ros2 run nfo_sinus_driver driver\n\n'
            'If one runs, ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE have to be the same for '
            'it and here.'
        )

    def close(self) -> None:
        """End the subscriptions."""
        self._executor.shutdown(timeout_sec=1.0)
        self._thread.join(1.0)
        self._caller.destroy_node()
        self._node.destroy_node()

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()

    # --- as a source of pictures --------------------------------------------------------------

    def next_picture(self) -> Picture:
        """Return what the nodes have published."""
        now = time.monotonic()
        if now - self._looked_around_at >= _DISCOVERY_PERIOD:
            self._looked_around_at = now
            self._look_around(now)
        for node in self._driver_nodes.values():
            for message in node.topics.take_messages():
                self._take(node, message, now)
        self._read_log(now)
        self._send_stops(now)
        self._look_after_calls(now)
        self._look_after_acknowledgements(now)
        self._look_after_error_logs(now)
        notes, self._notes = self._notes, []
        nodes = self._driver_nodes.values()
        return Picture(
            [_drive_view(node, now) for node in nodes if node.is_drive],
            {
                node.name: node.statistics
                for node in nodes
                if node.is_line and node.statistics and not _is_gone(node, now)
            },
            sorted(notes, key=lambda note: -math.inf if math.isnan(note.at) else note.at),
            self.stops(now),
        )

    def stop(self, name: str) -> None:
        """Call ``~/stop`` of a drive."""
        self._call(self._driver_nodes[name])

    def stop_all(self) -> None:
        """Call ``~/stop_all`` of every line, and ``~/stop`` of every drive."""
        # the lines first: they have the best order
        known = [node for node in self._driver_nodes.values() if node.is_drive or node.is_line]
        for node in sorted(known, key=lambda node: node.is_drive):
            self._call(node)
        if not known:
            self._note(Level.ERROR, '', 'there is no drive to be stopped')

    def acknowledge(self, name: str) -> None:
        """Call ``~/fault_ack`` of a drive; nothing turns by it."""
        client, now = self._driver_nodes[name].acknowledge, time.monotonic()
        if client is None or not client.service_is_ready():
            why = 'not acknowledged: it offers no such service. Has its driver ended?'
            self._note(Level.ERROR, name, why)
            return
        future = client.call_async(Trigger.Request())
        self._acknowledging.append(_Call(name, client.srv_name, future, now))

    def read_errors(self, name: str) -> None:
        """Call ``~/get_error_log`` of a drive."""
        node, now = self._driver_nodes[name], time.monotonic()
        client = node.error_log
        if client is None or not client.service_is_ready():
            node.errors = ('its driver offers no error log',)
            return
        node.errors = ()
        request = GetErrorLog.Request(max_entries=_MOST_ERRORS)
        self._reading.append(_Call(name, client.srv_name, client.call_async(request), now))

    def stops(self, now: float) -> list[str]:
        """Return the stops that are not confirmed, as sentences, failures first."""
        waiting = [
            f'{call.service} called {now - call.requested_at:.0f} s ago, not answered yet'
            for call in self._calls
            if now - call.requested_at > _SOON
        ]
        return [f'{who}: {why}' for who, why in self._failed.items()] + waiting

    # --- what comes in ------------------------------------------------------------------------

    def _look_around(self, now: float) -> None:
        for topic, types in self._node.get_topic_names_and_types():
            type_ = next((_TYPES[offered] for offered in types if offered in _TYPES), None)
            if type_ is None:
                continue
            for publisher in self._node.get_publishers_info_by_topic(topic):
                name = f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
                if publisher.node_name == _UNKNOWN or not self._wanted(name):
                    continue
                # a node that is just being created shows one topic after the other
                node = self._driver_nodes.get(name) or self._driver_nodes.setdefault(
                    name, _DriverNode(name, _Topics(self._node), now)
                )
                node.topics.add(type_, topic, _QOS[type_])
        for node in self._driver_nodes.values():
            if node.stop is None or (
                node.is_drive and (node.acknowledge is None or node.error_log is None)
            ):
                with contextlib.suppress(_NOT_KNOWN_YET):
                    self._find_services(node)

    def _wanted(self, name: str) -> bool:
        return not self._spaces or any(
            name == space or name.startswith(f'{space.rstrip("/")}/') for space in self._spaces
        )

    def _find_services(self, node: _DriverNode) -> None:
        space, _, name = node.name.rpartition('/')
        stop = 'stop' if node.is_drive else 'stop_all'
        for service, types in self._node.get_service_names_and_types_by_node(name, space or '/'):
            verb = service.rpartition('/')[2]
            # now, so that both ends have discovered each other before the first call
            if _TRIGGER in types and verb == stop and node.stop is None:
                node.stop = self._caller.create_client(Trigger, service)
            if _TRIGGER in types and verb == 'fault_ack' and node.acknowledge is None:
                node.acknowledge = self._caller.create_client(Trigger, service)
            if _GET_ERROR_LOG in types and node.error_log is None:
                node.error_log = self._caller.create_client(GetErrorLog, service)

    def _take(self, node: _DriverNode, message: object, now: float) -> None:
        if _is_gone(node, now):
            # another driver has started: what the one before published is over
            node.status, node.telemetry, node.statistics = DriveStatus(), None, None
        if isinstance(message, DriveStatus):
            node.status, node.updated_at = message, now
        elif isinstance(message, InvSt):
            node.inv_st = message
        elif isinstance(message, Telemetry):
            node.telemetry_gap = min(now - node.telemetry_at, _LONGEST_TELEMETRY)
            node.telemetry, node.telemetry_at = message, now
        elif isinstance(message, BusStatistics):
            node.statistics, node.updated_at = message, now
        elif isinstance(message, ErrorLogEntry):
            text = error_line(message.code, message.text, message.operating_time, math.nan)
            self._note(Level.WARNING, node.name, f'{_ERROR_LOG}{text}', _seconds(message.stamp))
            if node.errors:
                self.read_errors(node.name)

    def _read_log(self, now: float) -> None:
        lines = self._rosout.take_messages()
        self._log_lines += [(now, line) for line in lines if line.level in _LEVELS]
        names = {name.lstrip('/').replace('/', '.'): name for name in self._driver_nodes}
        waiting = []
        for came_at, line in self._log_lines:
            name = names.get(line.name)
            if name is not None and line.msg.startswith(_ERROR_LOG):
                # it came by its topic
                continue
            if name is not None:
                at = line.stamp.sec + line.stamp.nanosec / 1e9
                self._note(_LEVELS[line.level], name, line.msg, at)
            elif now - came_at < _WAITS_FOR_NODE:
                waiting.append((came_at, line))
        self._log_lines = waiting

    # --- what goes out ------------------------------------------------------------------------

    def _call(self, node: _DriverNode) -> None:
        now = time.monotonic()
        self._unsent.append((node, now))
        self._send_stops(now)

    def _send_stops(self, now: float) -> None:
        waiting: list[tuple[_DriverNode, float]] = []
        for node, requested_at in self._unsent:
            client = node.stop
            if client is not None and client.service_is_ready():
                future = client.call_async(Trigger.Request())
                self._calls.append(_Call(node.name, client.srv_name, future, requested_at))
            elif now - requested_at < _FOUND_WITHIN and not _is_gone(node, now):
                waiting.append((node, requested_at))
            else:
                why = 'NOT stopped: it offers no such service. Has its driver ended?'
                self._fail(node.name, why)
        self._unsent = waiting

    def _look_after_calls(self, now: float) -> None:
        waiting: list[_Call] = []
        for call in self._calls:
            if call.future.done():
                answer = call.future.result()
                if answer.success:
                    # earlier calls, which will perhaps never be answered, are settled by it
                    self._failed.pop(call.who, None)
                    waiting = [earlier for earlier in waiting if earlier.who != call.who]
                    self._note(Level.INFO, call.who, f'{call.service}: {answer.message}')
                else:
                    self._fail(call.who, f'{call.service}: {answer.message}')
                continue
            if not call.reported_late and now - call.requested_at > _ANSWER_TIME:
                call.reported_late = True
                text = (
                    f'{call.service} has not answered for {_ANSWER_TIME:.0f} s: the stop is NOT '
                    'confirmed. Stop the motor by other means'
                )
                self._fail(call.who, text)
            waiting.append(call)
        self._calls = waiting

    def _look_after_acknowledgements(self, now: float) -> None:
        waiting: list[_Call] = []
        for call in self._acknowledging:
            if call.future.done():
                answer = call.future.result()
                level = Level.INFO if answer.success else Level.ERROR
                self._note(level, call.who, f'{call.service}: {answer.message}')
            elif now - call.requested_at > _ANSWER_TIME:
                text = f'{call.service} has not answered for {_ANSWER_TIME:.0f} s'
                self._note(Level.ERROR, call.who, text)
            else:
                waiting.append(call)
        self._acknowledging = waiting

    def _look_after_error_logs(self, now: float) -> None:
        waiting: list[_Call] = []
        for call in self._reading:
            node = self._driver_nodes[call.who]
            if call.future.done():
                node.errors = _errors(call.future.result())
            elif now - call.requested_at > _ANSWER_TIME:
                node.errors = (f'not read: {call.service} has not answered',)
            else:
                waiting.append(call)
        self._reading = waiting

    def _fail(self, who: str, why: str) -> None:
        self._failed[who] = why
        self._note(Level.ERROR, who, why)

    def _note(self, level: Level, who: str, text: str, at: float | None = None) -> None:
        self._notes.append(Note(time.time() if at is None else at, level, who, text))


def _errors(answer: GetErrorLog.Response) -> Sequence[str]:
    """Return an error log for people."""
    if not answer.success:
        return (answer.message,)
    return tuple(
        error_line(entry.code, entry.text, entry.operating_time, _seconds(entry.stamp))
        for entry in answer.entries
    ) or ('empty',)


def _seconds(stamp: Time) -> float:
    """Return a time in s; NaN: it is not known."""
    return stamp.sec + stamp.nanosec / 1e9 or math.nan


def _is_gone(node: _DriverNode, now: float) -> bool:
    return now - node.updated_at > _GONE_AFTER


def _drive_view(node: _DriverNode, now: float) -> DriveView:
    status, inv_st = node.status, node.inv_st
    condition = _condition(node, now)
    if condition is Condition.GONE:
        return DriveView(node.name, condition, 'its driver is gone', age=now - node.updated_at)
    if condition is Condition.SILENT:
        return DriveView(node.name, condition, 'not connected', line=node.statistics)
    measured = Measured()
    fresh = max(_GONE_AFTER, 2 * node.telemetry_gap)
    if node.telemetry is not None and now - node.telemetry_at <= fresh:
        names = [quantity.name for quantity in fields(Measured)]
        values = {name: getattr(node.telemetry, name) for name in names}
        measured = Measured(**values)
    return DriveView(
        node.name,
        condition,
        f'{inv_st.code} {inv_st.text}' if inv_st.text else 'connected',
        # a normal status needs no explanation
        inv_st.description if inv_st.kind != InvSt.STATUS else '',
        inv_st.remedy,
        inv_st.requires_ack,
        status.enabled,
        status.setpoint,
        status.actual,
        status.unit,
        now - node.updated_at,
        measured,
        node.statistics,
        node.errors,
    )


def _condition(node: _DriverNode, now: float) -> Condition:
    status, inv_st = node.status, node.inv_st
    if _is_gone(node, now):
        return Condition.GONE
    if not status.connected:
        return Condition.SILENT
    if status.fault or inv_st.kind == InvSt.FAULT:
        return Condition.FAULT
    if status.alarm or inv_st.kind == InvSt.ALARM:
        return Condition.ALARM
    # without a status word there is no state: whether the motor turns decides
    measured = node.telemetry
    turns = measured is not None and any(
        abs(value) > 0 for value in (measured.frequency, measured.speed)
    )
    runs = status.operation_enabled or status.stopping or status.state in _RUNS or turns
    return Condition.RUNS if runs else Condition.STANDS


# --- the program ----------------------------------------------------------------------------------


def main(args: list[str] | None = None) -> int:
    """Show the view until the operator ends it; return the exit status."""
    given = sys.argv[1:] if args is None else args
    options = _parser().parse_args(rclpy.utilities.remove_ros_args(['', *given])[1:])
    missing = why_unavailable()
    if missing:
        print(f'monitor: {missing}', file=sys.stderr)
        return 2
    # ROS would print across the view
    logging = ['--ros-args', '--disable-stdout-logs', '--']
    try:
        init_ros([*given, *logging])
    except ValueError as error:
        print(f'monitor: {error}', file=sys.stderr)
        return 2
    source = GraphSource(get_default_context(), options.namespaces)
    try:
        show(source)
    finally:
        left = source.stops(time.monotonic())
        source.close()
        rclpy.try_shutdown()
    for text in left:
        # the view is gone, and its log with it
        print(f'monitor: {text}', file=sys.stderr)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='monitor',
        description='Shows every drive on the graph, in a terminal, and can stop them.',
        epilog='Keys: s stops the drive that is chosen, a stops all, k acknowledges, n goes '
        'to the next trouble, e shows the error log, p plots another quantity, q quits. None of it '
        'is a safety function.',
    )
    parser.add_argument(
        'namespaces', nargs='*', metavar='NAMESPACE', help='only drives in these (default: all)'
    )
    parser.add_argument('--version', action='version', version=f'nfo_sinus_driver {VERSION}')
    return parser


if __name__ == '__main__':
    sys.exit(main())
