# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the tests with ROS share: processes, and a client that sees and commands them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import ctypes
import itertools
import json
import math
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading
import time
from typing import Any
import warnings

from ament_index_python.packages import get_package_prefix
from builtin_interfaces.msg import Time
from connections import UNFRAMED, Connection
from diagnostic_msgs.msg import DiagnosticArray
import forks
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from nfo_sinus_msgs.msg import BusStatistics, DriveStatus, InvSt, Telemetry
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParametersAtomically,
)
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger
from support import ports, telegram_laws, trace_laws
from support.drives import Drives
from support.terminal import Terminal

from nfo_sinus_driver.link import LineSettings
from nfo_sinus_driver.simulator.control import Client as Simulated

#: Machines are shared and slow: a condition that does not come true in this time never will, s.
PATIENCE = 90.0
#: All settings of a drive are read before its node is active, of some over 9600 bit/s.
_STARTING = 3 * PATIENCE
#: After how long a question is asked anew, s, and the first call of a client made anew.
_ASK_ANEW = 10.0
_CALL_ANEW = 40.0
#: How long a process may take to say where its threads are, s.
_STACKS_PATIENCE = 5.0
#: For how long something must not happen, s; longer than a few polls and a ramp's first step.
A_WHILE = 2.0

#: How often a drive is polled and measured where a test does not want it otherwise, Hz.
_RATES = {'poll_rate': 10.0, 'telemetry_rate': 0.5}
#: For how long a PLC misses the driver, or the drive, before it stops the motor, s.
_PLC_TIME = 5.0
#: For a test that does.
FULL_RATE = ('-p', 'poll_rate:=0.0')
#: For a test that wants the command itself, and no fork.
EXECUTED = ('env',)

TOPICS = {
    'status': (DriveStatus, 10),
    'inv_st': (InvSt, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)),
    'actual_speed': (Float32, 10),
    'actual_frequency': (Float32, 10),
    'telemetry': (Telemetry, 10),
}


def wait_until(
    condition: Callable[[], Any], what: str, timeout: float = PATIENCE, period: float = 0.02
) -> Any:
    """Wait for a condition and return what it returned; not while a driver has crashed."""
    deadline = time.monotonic() + timeout
    while True:
        result = condition()
        if result:
            return result
        for process in _watched:
            process.has_not_crashed(what)
        assert time.monotonic() < deadline, (
            f'not within {timeout:g} s: {what}; '
            f'{"; ".join([*map(_last_words, _watched), *map(_last_seen, _views)])}'
        )
        time.sleep(period)


def holds_for(seconds: float, condition: Callable[[], Any], what: str) -> None:
    """Fail if a condition ceases to hold within some time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        assert condition(), f'did not hold: {what}'
        time.sleep(0.02)


def start(
    command: list[str], environment: dict[str, str], log: Path
) -> subprocess.Popen[bytes]:
    """Start any command; what it says goes to the end of a file."""
    with log.open('ab') as stream:
        return subprocess.Popen(
            command,
            env=environment,
            stdout=stream,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )


class Process:
    """A process whose output goes to a file."""

    def __init__(
        self, command: list[str], environment: dict[str, str], log: Path, start: Any = start
    ) -> None:
        self._log = log
        self._may_end = False
        self._process = start(command, environment, log)

    @property
    def text(self) -> str:
        """What it said so far."""
        return self._log.read_text(errors='replace')

    @property
    def running(self) -> bool:
        """It has not ended."""
        return self._process.poll() is None

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid

    def stacks(self) -> str:
        """Return where its threads are, if it can be asked."""
        if not isinstance(self._process, forks.Fork) or not self.running:
            return ''
        before = len(self.text)
        self._process.send_signal(forks.TELL_STACKS)
        deadline = time.monotonic() + _STACKS_PATIENCE
        # the one that got the signal, which is named last, is called the current one
        while 'Current thread' not in self.text[before:] and time.monotonic() < deadline:
            time.sleep(0.1)
        return self.text[before:]

    def signal(self, number: int, thread: int | None = None) -> None:
        """Send it, or one of its threads, a signal, which may end it."""
        self._may_end = True
        if thread is None:
            self._process.send_signal(number)
        else:
            assert ctypes.CDLL(None).tgkill(self.pid, thread, number) == 0

    def wait(self) -> int:
        """Wait for its end; return its exit status."""
        self._may_end = True
        return self._process.wait(PATIENCE)

    def has_not_crashed(self, waiting_for: str) -> None:
        """Fail, with what it said, if it has ended and the test did not end it."""
        assert self.running or self._may_end, (
            f'ended by itself ({self._process.returncode}), no use waiting for {waiting_for}:\n'
            f'{self.text}'
        )

    def end(self) -> None:
        """End it, gently first."""
        if self.running:
            self.signal(signal.SIGINT)
        try:
            self.wait()
        except subprocess.TimeoutExpired as late:
            said = _last_words(self)
            self._process.kill()
            self._process.wait()
            raise AssertionError(f'{late}: {said}') from None


def _last_words(process: Process) -> str:
    said = process.text[-2000:]
    return f'it says at last:\n{said}\nand its threads are at\n{process.stacks()[:20000]}'


def _last_seen(view: Terminal) -> str:
    return f'the view shows:\n{view.text}'


#: The drivers at work: what a test waits for will not come when one of them has ended by itself.
_watched: list[Process] = []
#: The views at work, of which a screen tells what they were asked for.
_views: list[Terminal] = []


class Bench(contextlib.ExitStack):
    """A simulated line, drivers on it and a client, all in one ROS domain."""

    def __init__(self, domain: int, folder: Path, connection: Connection) -> None:
        super().__init__()
        self.folder = folder
        self.connection = connection
        #: What `Simulator` is given of the line, by the names of its arguments.
        self.line: dict[str, Any] = {**connection.simulator, 'control': str(folder / 'control')}
        if connection.protocol == 'modbus_tcp':
            number = self.enter_context(ports.reserved())
            self.port = f'127.0.0.1:{number}'
            self.line['tcp'] = number
        else:
            self.port = self.line['link'] = str(folder / 'line')
        self.trace = folder / 'trace.jsonl'
        self._environment = {
            **os.environ, 'ROS_DOMAIN_ID': str(domain), 'XDG_STATE_HOME': str(folder / 'state'),
        }
        if connection.method == 'telegram1':
            self._environment[forks.PLC_TIME] = str(_PLC_TIME)
        self.domain = domain
        self._drivers: list[Process] = []

    @property
    def drives(self) -> Drives:
        """What a test over every connection knows of its drives."""
        return self.connection.drives

    def simulator(self, *arguments: str, paced: bool = False) -> Simulated:
        """
        Start a simulated line, and return what looks into it.

        :param paced: it is as slow as a real one, for which both ends run at each byte.
        """
        command = [_executable('simulator'), '--trace', str(self.trace)]
        command += [word for name, value in self.line.items() for word in (f'--{name}', str(value))]
        if self.connection.method == 'telegram1':
            command += ['--ros-time', str(_PLC_TIME), '--drive-time', str(_PLC_TIME)]
            # each drive at the same place of another unit
            units = [n for word, n in itertools.pairwise(arguments) if word == '--address'] or ['1']
            command += [
                word for unit in units for word in ('--block', f'{unit}:{self.connection.block}')
            ]
        command += [*(['--paced'] if paced else []), *arguments]
        log = self.folder / 'simulator.log'
        process = Process(command, self._environment, log, forks.start)
        self.callback(process.end)
        wait_until(lambda: 'serving' in process.text or not process.running, 'the simulator')
        assert process.running, process.text
        return self.enter_context(Simulated(self.line['control']))

    def driver(
        self, *arguments: str, through: tuple[str, ...] = (), fails: bool = False
    ) -> Process:
        """
        Start a driver on the line; ``-p name:=value`` arguments may follow.

        It polls at a modest rate unless they say otherwise: tests share the processors.
        """
        given = {'port': self.port, **self.connection.driver}
        if not any('black_box' in argument for argument in arguments):
            # tests share the processors
            given['black_box'] = 0.0
        for name, rate in _RATES.items():
            if not any(name in argument for argument in arguments):
                given[name] = rate
        settings = [word for name, value in given.items() for word in ('-p', f'{name}:={value}')]
        return self.bare_driver(*settings, *arguments, through=through, fails=fails)

    def bare_driver(
        self, *arguments: str, through: tuple[str, ...] = (), fails: bool = False
    ) -> Process:
        """
        Start a driver with ROS arguments alone, by way of another command if need be.

        With one it is a process that was executed as such, and else a fork.

        :param fails: it has errors of its own, which the test is about.
        """
        command = [*through, _executable('driver'), '--ros-args', *arguments]
        log = self.folder / f'driver{len(self._drivers)}.log'
        process = Process(command, self._environment, log, start if through else forks.start)
        self._drivers.append(process)
        _watched.append(process)
        self.callback(_watched.remove, process)
        if not fails:
            self.callback(_no_traceback, process)
        self.callback(process.end)
        return process

    def view(self, *arguments: str, columns: int = 80, rows: int = 24) -> Terminal:
        """Start the view of all drives on a terminal of its own."""
        command = [sys.executable, '-m', 'nfo_sinus_driver.node.monitor', *arguments]
        view = self.enter_context(Terminal(command, columns, rows, self._environment))
        _views.append(view)
        self.callback(_views.remove, view)
        return view

    @property
    def log(self) -> str:
        """What the newest driver said so far."""
        return self._drivers[-1].text

    def client(self, name: str = '/nfo_sinus') -> Client:
        """Return a client of one drive node."""
        return self.enter_context(Client(self.domain, name))

    def frames(self) -> list[dict[str, Any]]:
        """Return what the simulator's line has traced so far."""
        lines = self.trace.read_text().splitlines()
        return [json.loads(line) for line in lines if line.endswith('}')]

    def violations(self) -> list[str]:
        """Return what breaks the laws of the house in the trace."""
        connection, frames = self.connection, self.frames()
        if connection.method == 'telegram1':
            units = {bytes.fromhex(frame['hex'])[6] for frame in frames}
            return [
                complaint
                for unit in sorted(units)
                for complaint in telegram_laws.violations(
                    frames, connection.model, unit, connection.block
                )
            ]
        gap = LineSettings(connection.baud_rate).frame_gap
        return trace_laws.violations(
            frames, gap, connection.model, connection.protocol, may_stand_still=True
        )

    def requests(self) -> list[str]:
        """Return what Modbus requests arrived so far: unit and PDU in hexadecimal."""
        arrived = [frame['hex'] for frame in self.frames() if frame['direction'] == 'request']
        return [UNFRAMED[self.connection.protocol](bytes.fromhex(hex_)).hex() for hex_ in arrived]


class Client(contextlib.ExitStack):
    """A ROS client of one drive node, with its own context."""

    def __init__(self, domain: int, name: str) -> None:
        super().__init__()
        self._name = name
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.callback(rclpy.shutdown, context=self._context)
        self.node = Node(
            f'test_client_{os.getpid()}_{id(self)}', context=self._context,
            start_parameter_services=False, enable_rosout=False,
        )
        self.callback(self.node.destroy_node)
        self.messages: dict[str, list[Any]] = {}
        for topic, (type_, qos) in TOPICS.items():
            self.listen(topic, type_, f'{name}/{topic}', qos)
        self.listen('diagnostics', DiagnosticArray, '/diagnostics', 10)
        self.listen('statistics', BusStatistics, '/nfo_sinus_bus/statistics', 10)
        self._setpoint = self.node.create_publisher(Float32, f'{name}/setpoint', 1)
        self._clients: dict[str, Any] = {}
        #: The services that have answered a call.
        self._answered: set[str] = set()
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        # the thread ends by itself before what it waits for is gone
        ended = threading.Event()

        def spin() -> None:
            while not ended.is_set():
                self._executor.spin_once()

        thread = threading.Thread(target=spin, daemon=True)
        thread.start()
        self.callback(self._executor.shutdown, PATIENCE)
        self.callback(thread.join, PATIENCE)
        self.callback(self._executor.create_task, ended.set)

    def where_it_spins(self, call: Callable[[], Any]) -> Any:
        """Call something in the thread that hears the answers; return what it returned."""
        task = self._executor.create_task(call)
        wait_until(task.done, 'the thread that spins has called it')
        return task.result()

    # --- seeing -------------------------------------------------------------------------------

    def listen(self, key: str, type_: type, topic: str, qos: Any) -> None:
        """Collect the messages of a topic under a key."""
        self.messages[key] = []
        self.node.create_subscription(type_, topic, self.messages[key].append, qos)

    def latest(self, key: str) -> Any:
        """Return the newest message of a topic, or ``None``."""
        messages = self.messages[key]
        return messages[-1] if messages else None

    def newest(self, key: str) -> Any:
        """Return the newest message of a topic; wait for the first."""
        wait_until(lambda: self.messages[key], f'a message of {key}')
        return self.messages[key][-1]

    def wait_for(
        self, key: str, condition: Callable[[Any], Any], what: str, timeout: float = PATIENCE
    ) -> Any:
        """
        Wait until the newest message of a topic, or one after it, fulfils a condition; return it.

        Every message counts that comes meanwhile: what lasts for a moment is not missed.
        """
        messages = self.messages[key]
        looked = max(0, len(messages) - 1)

        def seen() -> Any:
            nonlocal looked
            while looked < len(messages):
                looked += 1
                if condition(messages[looked - 1]):
                    return messages[looked - 1]
            return None

        return wait_until(seen, what, timeout)

    def connected(self) -> Client:
        """Wait until the drive is connected and its node is active."""
        self.wait_for(
            'status', lambda status: status.connected, 'the drive is connected', _STARTING
        )
        wait_until(lambda: self.state() == 'active', 'the node is active', _STARTING)
        return self

    # --- commanding ---------------------------------------------------------------------------

    @contextlib.contextmanager
    def setpoints(self, value: float, period: float = 0.05) -> Iterator[None]:
        """Publish a set-point over and over."""
        ended = threading.Event()

        def publish() -> None:
            while not ended.wait(period):
                self._setpoint.publish(Float32(data=float(value)))

        thread = threading.Thread(target=publish, daemon=True)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()

    def publish(self, value: float) -> None:
        """Publish one set-point, once there is a subscriber."""
        wait_until(lambda: self._setpoint.get_subscription_count(), 'there is a subscriber')
        self._setpoint.publish(Float32(data=float(value)))

    def call_async(self, service: str, type_: type, **fields: Any) -> Any:
        """Call a service of the node; return the future."""
        path = service if service.startswith('/') else f'{self._name}/{service}'
        client = self._clients.get(path)
        if client is None:
            # ten, rclpy's own depth, loses requests of many at once on a slow machine
            client = self.where_it_spins(
                lambda: self.node.create_client(type_, path, qos_profile=QoSProfile(depth=1000))
            )
            self._clients[path] = client
        wait_until(client.service_is_ready, f'there is a service {path}')
        return client.call_async(type_.Request(**fields))

    def call(self, service: str, type_: type = Trigger, **fields: Any) -> Any:
        """
        Call a service of the node and return its response.

        A client is notified that it is matched before the server knows of it, and then Fast DDS can
        lose its first request (Fast-DDS issues 2641 and 3009). So that is made anew when it is
        not answered for long, and the run says so; every other one has to be answered.
        """
        anew = math.inf if service in self._answered else _CALL_ANEW
        response = self._call(service, type_, fields, anew)
        self._answered.add(service)
        return response

    def ask(self, service: str, type_: type, **fields: Any) -> Any:
        """Call a service that only tells something, anew if need be, and return its response."""
        return self._call(service, type_, fields, _ASK_ANEW)

    def _call(self, service: str, type_: type, fields: dict[str, Any], anew: float) -> Any:
        futures = []

        def answered() -> Any:
            if not futures or time.monotonic() > futures[-1][0] + anew:
                if futures:
                    warnings.warn(f'{service} is called anew: no answer in {anew} s', stacklevel=2)
                futures.append((time.monotonic(), self.call_async(service, type_, **fields)))
            return next((future for _, future in futures if future.done()), None)

        return wait_until(answered, f'{service} answers').result()

    def enable(self, on: bool = True) -> Any:
        """Call ``~/enable``."""
        return self.call('enable', SetBool, data=on)

    @contextlib.contextmanager
    def run_at(self, value: float) -> Iterator[None]:
        """Enable, and publish a set-point until the motor is there and all through the block."""
        response = wait_until(self._enable_when_possible, 'it can be enabled', period=0.05)
        assert response.success, response.message
        with self.setpoints(value):
            self.wait_for('status', lambda status: abs(status.actual - value) < 1, f'{value}')
            yield

    def _enable_when_possible(self) -> Any:
        """
        Enable; nothing while what a driver has found under control is being stopped, and where the
        simulator has answered too late, on a machine that has more to do.
        """
        response = self.enable()
        not_yet = ('a stop is on its way', 'did not answer')
        return None if any(reason in response.message for reason in not_yet) else response

    def change_state(self, transition: int) -> bool:
        """Ask for a lifecycle transition."""
        request = Transition(id=transition)
        success: bool = self.call('change_state', ChangeState, transition=request).success
        return success

    def state(self) -> str:
        """Return the label of the lifecycle state."""
        label: str = self.ask('get_state', GetState).current_state.label
        return label

    def parameter(self, name: str) -> Any:
        """Return the value of a parameter."""
        values = self.ask('get_parameters', GetParameters, names=[name]).values
        return parameter_value_to_python(values[0])

    def parameter_names(self) -> set[str]:
        """Return the names of all parameters."""
        return set(self.ask('list_parameters', ListParameters).result.names)

    def descriptor(self, name: str) -> Any:
        """Return the descriptor of a parameter."""
        return self.ask('describe_parameters', DescribeParameters, names=[name]).descriptors[0]

    def set_parameters(self, **values: Any) -> Any:
        """Set parameters atomically; return the result."""
        future = self.set_parameters_async(**values)
        wait_until(future.done, 'set_parameters answers')
        return future.result().result

    def set_parameters_async(self, **values: Any) -> Any:
        """Begin to set parameters; return the future."""
        messages = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        return self.call_async(
            'set_parameters_atomically', SetParametersAtomically, parameters=messages
        )


def seconds(stamp: Time) -> float:
    """Return a time stamp as a number."""
    return stamp.sec + stamp.nanosec * 1e-9


def _no_traceback(process: Process) -> None:
    """Fail if the driver met an error of its own, which it survives but must not have."""
    assert 'Traceback' not in process.text, process.text


def _executable(name: str) -> str:
    # as ros2 run finds it
    return f'{get_package_prefix("nfo_sinus_driver")}/lib/nfo_sinus_driver/{name}'
