# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The driver process: one bus node and a managed node for each drive.

It owns its signals, so that ROS is still there when the motors are being stopped.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, TimeoutError as FutureTimeoutError, as_completed
import contextlib
import ctypes
import gc
import sys
import time
import traceback
from typing import Any

import rclpy
from rclpy.exceptions import InvalidNodeNameException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.validate_node_name import validate_node_name

from nfo_sinus_driver.drive import Cause, DriveError
from nfo_sinus_driver.node.drive.commands import CALLS_OF_ENABLE
from nfo_sinus_driver.node.drive.drive_node import DriveNode
from nfo_sinus_driver.node.line.bus_node import NAME as BUS_NAME, BusNode
from nfo_sinus_driver.node.parameters.parameter_names import (
    require_files,
    unknown_nodes,
    unknown_parameters,
)
from nfo_sinus_driver.node.process.arguments import process_to_end_with
from nfo_sinus_driver.node.process.single_name import bus_overrides, take_out_node_name
from nfo_sinus_driver.node.ros.executor import NodeExecutor, end_all
from nfo_sinus_driver.node.ros.log_limit import limit_errors
from nfo_sinus_driver.node.ros.nonblocking_stdio import NonblockingStdio
from nfo_sinus_driver.node.ros.start import init_ros
from nfo_sinus_driver.signals import ENDING, HeldSignals, OtherProcess, signal_name

#: Threads that callbacks of one drive may keep waiting: one for each of its callback groups, but
#: more for ``~/enable``.
_GROUPS_OF_A_DRIVE = 17 + CALLS_OF_ENABLE
_GROUPS_OF_THE_BUS = 6
#: With many threads and a busy one among them, this keeps the bus on time, s.
_SWITCH_INTERVAL = 0.0002
#: glibc has up to eight arenas a core, and each keeps the most that it ever had: with so many
#: threads, memory would grow in steps for hours.
_M_ARENA_MAX = -8
_ARENAS = 2
_POLL_SIGNALS = 0.5
#: What the last request of an exit may take beyond ``shutdown_timeout``, s.
_LAST_ANSWER = 0.5
#: How long callbacks may take to end once the bus is closed, s.
_LAST_CALLBACK = 2.0

#: What is logged by an end before the port is opened.
_NOT_STARTED = (
    'ended before the bus was opened, nothing was written; a motor that was left running before '
    'runs on: use the enable input or the emergency stop'
)

#: The same where a drive of another kind answers.
_NOTHING_TO_STOP = 'ending without a stop, for this driver has run no motor here'

#: What rclpy raises for ROS arguments that make no sense.
_ARGUMENT_ERRORS = (rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError)

class DriverProcess:
    """The nodes of one bus, spun until they are shut down."""

    def __init__(self, arguments: list[str], single_name: str | None) -> None:
        if single_name is None:
            self._bus_node = BusNode()
            names = self._bus_node.drive_names
        else:
            _check_name(single_name)
            self._bus_node = BusNode(bus_overrides(single_name), single_name)
            names = _renamed(self._bus_node.drive_names, single_name)
        _check_names(names)
        self._context = self._bus_node.bus_context
        self._context.expect(names)
        self._drives: list[DriveNode] = []
        for name in names:
            try:
                self._drives.append(DriveNode(name, self._context))
            except (ParameterException, ValueError) as error:
                raise ValueError(f'{name}: {error}') from error
        self._warn_of_unknown_names(arguments)
        self._executors = [
            NodeExecutor(self._bus_node, _GROUPS_OF_THE_BUS),
            *(NodeExecutor(node, _GROUPS_OF_A_DRIVE) for node in self._drives),
        ]

    def _warn_of_unknown_names(self, arguments: list[str]) -> None:
        nodes = (self._bus_node, *self._drives)
        names = [node.get_name() for node in nodes]
        for warning in (
            *unknown_nodes(arguments, names),
            *unknown_parameters(nodes),
        ):
            self._bus_node.get_logger().warning(warning)

    def start(self) -> None:
        """Open the port and let the nodes work."""
        # nearly all objects stay: a garbage collection that visits them again keeps every thread
        # waiting, the worker of the bus too, for 25 ms here and for longer on a small computer
        gc.collect()
        gc.freeze()
        self._bus_node.start()
        self._context.setpoint_subscriber.start()
        for executor in self._executors:
            executor.start()
        for node in self._drives:
            node.lifecycle.start()

    @property
    def alive(self) -> bool:
        """The nodes and the bus still work."""
        context = self._context
        threads = (context.bus, context.publish_queue, context.setpoint_subscriber)
        return all(part.alive for part in (*threads, *self._executors))

    def stop(self, why: str) -> bool:
        """Stop the motors, release control and end; false if a drive does not confirm it."""
        confirmed = self._stop_motors(why)
        # callbacks that wait for the bus get an error, so that none keeps the executor
        self._context.bus.close()
        self._context.publish_queue.close()
        self._context.black_box.close()
        records = [node.operating_record for node in self._drives]
        for record in records:
            record.end()
        self._context.setpoint_subscriber.close(_LAST_CALLBACK)
        end_all(self._executors, _LAST_CALLBACK)
        deadline = time.monotonic() + _LAST_CALLBACK
        for node in self._drives:
            node.lifecycle.join(max(0.0, deadline - time.monotonic()))
        for record in records:
            record.join(max(0.0, deadline - time.monotonic()))
        return confirmed

    def _stop_motors(self, why: str) -> bool:
        begun = time.monotonic()
        # all are requested before the first is awaited, and none can be enabled again
        with self._context.at_once():
            stops = {
                node.stop_for_good(node.managed.settings.shutdown_timeout, why): node
                for node in self._drives
            }
        self._bus_node.get_logger().info(f'{why}: stopping the motors')
        unconfirmed: list[DriveNode] = []
        releases: dict[Future[Any], DriveNode] = {}
        # the turn of one may come only after that of all others
        longest = 2 * max(node.managed.settings.shutdown_timeout for node in self._drives)
        for node, stop in _as_they_end(stops, longest):
            if self._may_be_there(node) and not _confirmed(node, stop):
                unconfirmed.append(node)
            elif node.managed.drive.ever_responded and _succeeded(stop):
                # a silent one must not take the time in which others are released
                releases[node.managed.drive.disconnect(_time_left(node, begun))] = node
        left = max(0.0, begun + longest - time.monotonic())
        unconfirmed += [
            node for node, release in _as_they_end(releases, left) if not _released(node, release)
        ]
        for node in unconfirmed:
            node.get_logger().error(node.managed.drive.end_unconfirmed)
        return not unconfirmed

    def _may_be_there(self, node: DriveNode) -> bool:
        """Return whether a drive may be there: one that never answered was never started."""
        return node.managed.drive.ever_responded or self._context.bus.port_error is None


def _time_left(node: DriveNode, begun: float) -> float:
    """Return how much of the node's ``shutdown_timeout`` is left, s."""
    return max(0.0, begun + node.managed.settings.shutdown_timeout - time.monotonic())


def _as_they_end(
    futures: dict[Future[Any], DriveNode], seconds: float
) -> Iterator[tuple[DriveNode, Future[Any]]]:
    """Yield nodes with their futures as these end; at last those that have not ended in time."""
    waiting = set(futures)
    with contextlib.suppress(FutureTimeoutError):
        for future in as_completed(futures, seconds + _LAST_ANSWER):
            waiting.remove(future)
            yield futures[future], future
    for future in waiting:
        yield futures[future], future


def _succeeded(future: Future[Any]) -> bool:
    return future.done() and future.exception() is None


def _confirmed(node: DriveNode, future: Future[Any]) -> bool:
    """
    Log the outcome of a stop; false if it failed.

    It has not where the drive has never answered, or where another one answers than is configured,
    and this driver has run no motor here.
    """
    log, drive = node.get_logger(), node.managed.drive
    try:
        answer = future.result(timeout=0)
    except FutureTimeoutError:
        log.error('the stop is NOT confirmed: the drive did not answer in time')
        return False
    except Exception as error:
        if not drive.ever_responded:
            log.warning('the drive has not answered yet: if its motor was left running, it runs on')
            return True
        # after any error, the other drives have to be waited for, too
        known = isinstance(error, DriveError)
        why = node.managed.wording.say(error) if known else f'error in the driver: {error!r}'
        another = known and error.cause is Cause.NOT_RECOGNISED and not drive.stop_owed
        if another and isinstance(error.__cause__, DriveError):
            log.warning(f'{_NOTHING_TO_STOP}: {why}')
            return True
        log.error(why)
        return False
    if answer is not None:
        log.info(node.managed.wording.say(answer))
    return True


def _released(node: DriveNode, future: Future[Any]) -> bool:
    """
    Log the outcome of a release; false if the motor may run.

    Its stop was confirmed before, if there was one to stop. What is not put back in time leaves no
    motor running, unless the stop has to be written again.
    """
    if _succeeded(future) or node.managed.drive.stop_waits:
        return _confirmed(node, future)
    error = future.exception() if future.done() else None
    why = 'there was no time left for it'
    if error is not None:
        known = isinstance(error, DriveError)
        why = node.managed.wording.say(error) if known else f'error in the driver: {error!r}'
    node.get_logger().warning(
        'nothing is left to stop, but control of the drive is not released, and what was set for '
        f'this run (drive_timeout) may not be put back: {why}; if time was short, raise '
        'shutdown_timeout'
    )
    return True


def _renamed(names: list[str], single_name: str) -> list[str]:
    if len(names) != 1:
        raise ValueError(
            f'a node name ({single_name}) was given to the whole process, but it has '
            f'{len(names)} drives: name them by the parameter drives of nfo_sinus_bus instead'
        )
    return [single_name]


def _check_names(names: list[str]) -> None:
    if not names:
        raise ValueError('drives names no drive: write at least one name, such as [nfo_sinus]')
    for name in names:
        _check_name(name)
        if names.count(name) > 1:
            raise ValueError(f'drives names {name} more than once: every drive needs its own name')


def _check_name(name: str) -> None:
    try:
        validate_node_name(name)
    except InvalidNodeNameException:
        raise ValueError(
            f'{name!r} (in drives, or as __node) is no name for a drive node: it has letters, '
            'digits and underscores only, and begins with no digit'
        ) from None
    if name == BUS_NAME:
        raise ValueError(f'a drive cannot be named {BUS_NAME}: that is the bus node')


def main(signals: HeldSignals, parent: OtherProcess | None, args: list[str] | None = None) -> int:
    """
    Run the driver until a signal ends it; returns 1 if a stop was not confirmed.

    :param signals: held already.
    :param parent: the ``ros2`` command that started this process; the driver ends with it.
    """
    sys.setswitchinterval(_SWITCH_INTERVAL)
    _limit_arenas()
    stdio = NonblockingStdio()
    limit_errors()
    try:
        return _run(signals, parent, *take_out_node_name(sys.argv if args is None else args))
    except Exception:
        # while it can still be logged
        traceback.print_exc()
        return 1
    finally:
        stdio.close()


def _limit_arenas() -> None:
    try:
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, _ARENAS)
    except (OSError, AttributeError):
        # another C library has no such option
        return


def _run(
    signals: HeldSignals,
    parent: OtherProcess | None,
    arguments: list[str],
    single_name: str | None,
) -> int:
    try:
        # before ROS reads them
        require_files(arguments)
        possible = (parent, process_to_end_with(arguments))
        starters = [starter for starter in possible if starter is not None]
        init_ros(arguments)
        process = DriverProcess(arguments, single_name)
    except (ParameterException, ValueError, *_ARGUMENT_ERRORS) as error:
        text = ' '.join(str(error).split())
        rclpy.logging.get_logger('nfo_sinus_driver').fatal(f'cannot start: {text}')
        rclpy.try_shutdown()
        return 2
    log = rclpy.logging.get_logger('nfo_sinus_driver')
    if parent is not None and parent.pid == 1:
        log.warning(
            'ros2 is process 1 of this container: ros2 run passes no signal on, and the end of '
            'the container leaves the motors running; see docs/container.md'
        )
    if (why := _reason_to_end(signals, starters, 0.0)) is not None:
        log.info(f'{why}: {_NOT_STARTED}')
        rclpy.shutdown()
        return 0
    process.start()
    why = 'error in the driver'
    try:
        why = _await_end(process, signals, starters)
    finally:
        confirmed = process.stop(why)
        rclpy.shutdown()
    return 0 if confirmed else 1


def _await_end(
    process: DriverProcess, signals: HeldSignals, starters: list[OtherProcess]
) -> str:
    """Wait until the driver has to end; return why."""
    while process.alive:
        why = _reason_to_end(signals, starters, _POLL_SIGNALS)
        if why is not None:
            return why
    return 'a part of the driver has ended by itself'


def _reason_to_end(
    signals: HeldSignals, starters: list[OtherProcess], timeout: float
) -> str | None:
    """Take the next signal within ``timeout`` s; return why the driver has to end, if it has."""
    number = signals.next(timeout)
    for starter in starters:
        if starter.ended:
            return f'process {starter.pid}, which this driver ends with, has ended'
    if number is None:
        return None
    name = signal_name(number)
    if number in ENDING:
        return name
    rclpy.logging.get_logger('nfo_sinus_driver').warning(
        f'{name} ignored: a suspended driver would leave the motors running'
    )
    return None
