# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
``make soak``: one driver with four simulated drives for hours, and all that happens to them.

Faults, lost answers, drives without power, an adapter that is replugged, commands and clients that
come and go, in an order that a seed decides. Once a minute, with all motors enabled again, it
prints what the process of the driver has. It fails where memory, threads or descriptors have not
settled at the end, where a drive does not come back, or where the driver does not end as it should.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
import contextlib
import math
import os
from pathlib import Path
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from nfo_sinus_msgs.msg import DriveStatus, Measured, Telemetry
from nfo_sinus_msgs.srv import GetErrorLog
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger

from nfo_sinus_driver.demo.bench import own_domain
from nfo_sinus_driver.simulator.control import Client as Simulated

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from support.settled import LEAST, Sample, unsettled

DRIVES = 4
#: What no other drive is called: a set-point of this must never reach a motor.
NAMES = [f'simulated_for_soak_{number}' for number in range(1, DRIVES + 1)]
_BUS = 'nfo_sinus_bus'
_BAUD_RATE = 57600
#: How often a sample is taken, s; and how long nothing happens before it.
_PERIOD, _QUIET = 60.0, 3.0
#: How long each thing that happens has, s, and how long all drives have to be enabled again.
_EVENT, _BACK = 4.0, 120.0
#: How often set-points are published, s; they go up and down once in so many s.
_SETPOINTS, _WAVE = 0.1, 20.0
_PATIENCE = 30.0
_OVERLOAD = 5


class Client(Node):
    """What commands the drives, and hears what is published."""

    def __init__(self, context: Context) -> None:
        super().__init__('soak_client', context=context)
        self.status: dict[str, DriveStatus] = {}
        self._clients_of: dict[str, Any] = {}
        self._setpoints = []
        for name in NAMES:
            self.create_subscription(
                DriveStatus, f'/{name}/status',
                lambda message, name=name: self.status.update({name: message}), 10,
            )
            self._setpoints.append(self.create_publisher(Float32, f'/{name}/setpoint', 1))

    def publish(self) -> None:
        """Give each drive its set-point of now."""
        phase = 2 * math.pi * time.monotonic() / _WAVE
        for number, publisher in enumerate(self._setpoints):
            publisher.publish(Float32(data=20.0 * math.sin(phase + number)))

    def call(self, kind: type, service: str, **fields: object) -> Any:
        """Call a service; return its response, ``None`` if there was none in time."""
        # a client of its own for each call would be one more thing that comes and goes
        client = self._clients_of.get(service)
        if client is None:
            client = self._clients_of[service] = self.create_client(kind, service)
        if not client.wait_for_service(_PATIENCE):
            raise RuntimeError(f'there is no service {service}')
        return client.call(kind.Request(**fields), timeout_sec=_PATIENCE)

    def enabled(self, name: str) -> bool:
        """Return whether a drive is enabled, as was published last."""
        status = self.status.get(name)
        return status is not None and bool(status.connected and status.enabled)

    def enable(self, name: str) -> None:
        """Try to have a drive follow set-points again."""
        if self.status.get(name) is not None and self.status[name].fault:
            self.call(Trigger, f'/{name}/fault_ack')
        self.call(SetBool, f'/{name}/enable', data=True)


class Soak(contextlib.ExitStack):
    """The processes, and what happens to them."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._random = random.Random(seed)
        folder = Path(self.enter_context(tempfile.TemporaryDirectory(prefix='nfo_sinus_soak_')))
        self.log = folder / 'log'
        # what it is to remember of its drives is none of the user's
        os.environ['XDG_STATE_HOME'] = str(folder / 'state')
        port = str(folder / 'line')
        self._start(
            'simulator', '--link', port, '--baud-rate', str(_BAUD_RATE), '--paced',
            *(f'--address={number}' for number in range(1, DRIVES + 1)),
        )
        self._wait_for(lambda: 'serving' in self.text, 'the simulator')
        self.far = Simulated.at_link(port)
        parameters = {
            'port': port, 'baud_rate': _BAUD_RATE, 'drives': f'[{",".join(NAMES)}]',
            **{f'{name}:address': number for number, name in enumerate(NAMES, start=1)},
        }
        words = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
        self.driver = self._start('driver', '--ros-args', *words)
        self.context = Context()
        rclpy.init(context=self.context)
        self.callback(self.context.try_shutdown)
        self.client = Client(self.context)
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self.client)
        thread = threading.Thread(target=executor.spin, daemon=True)
        thread.start()
        self.callback(thread.join)
        self.callback(executor.shutdown)
        self._ended = threading.Event()
        self._publisher = threading.Thread(target=self._publish, daemon=True)
        self._publisher.start()
        self.callback(self._publisher.join)
        self.callback(self._ended.set)

    @property
    def text(self) -> str:
        """All that the processes have said."""
        return self.log.read_text(errors='replace')

    def _start(self, name: str, *arguments: str) -> subprocess.Popen[bytes]:
        path = shutil.which(name)
        if path is None:
            raise SystemExit(f'there is no {name}: run this by make soak, or by tools/run')
        with self.log.open('ab') as log:
            process = subprocess.Popen(
                [path, *arguments],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
            )
        self.callback(_end, process)
        return process

    def _publish(self) -> None:
        while not self._ended.wait(_SETPOINTS):
            self.client.publish()

    def _wait_for(self, condition: Callable[[], object], what: str) -> None:
        deadline = time.monotonic() + _BACK
        while not condition():
            if time.monotonic() > deadline:
                raise RuntimeError(f'{what}: not within {_BACK:.0f} s')
            time.sleep(0.1)

    def bring_back(self) -> None:
        """
        Have all drives enabled again.

        :raises RuntimeError: one does not come back.
        """
        deadline = time.monotonic() + _BACK
        while missing := [name for name in NAMES if not self.client.enabled(name)]:
            if time.monotonic() > deadline:
                raise RuntimeError(f'not enabled within {_BACK:.0f} s: {", ".join(missing)}')
            for name in missing:
                self.client.enable(name)
            time.sleep(0.2)

    def happen(self) -> str:
        """Let one thing happen; return which."""
        chosen = self._random.choice(sorted(_EVENTS))
        number = self._random.randrange(DRIVES)
        _EVENTS[chosen](self, number)
        return chosen

    def listen_for_a_while(self, number: int) -> None:
        """Let a client come and go."""
        node = Node(f'soak_visitor_{number}', context=self.context)
        for kind, topic in ((DriveStatus, 'status'), (Telemetry, 'telemetry'),
                            (Measured, 'measured')):
            for name in NAMES:
                node.create_subscription(kind, f'/{name}/{topic}', lambda _: None, 10)
        time.sleep(1.0)
        node.destroy_node()

    def set_parameter(self, number: int) -> None:
        """Write a parameter of a drive."""
        seconds = self._random.choice([3.0, 4.0, 5.0])
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=seconds)
        self.client.call(
            SetParameters, f'/{NAMES[number]}/set_parameters',
            parameters=[Parameter(name='control.accel', value=value)],
        )

    def change_state(self, number: int) -> None:
        """Deactivate the node of a drive, and activate it again."""
        for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
            self.client.call(
                ChangeState, f'/{NAMES[number]}/change_state',
                transition=Transition(id=transition),
            )


def _injected(verb: str, *values: object) -> Callable[[Soak, int], None]:
    return lambda soak, number: soak.far.inject(verb, *values, address=number + 1)


def _of_line(verb: str, *values: object) -> Callable[[Soak, int], None]:
    return lambda soak, _: soak.far.inject(verb, *values)


#: What may happen, to the drive of a number or to the line.
_EVENTS: dict[str, Callable[[Soak, int], None]] = {
    'fault': _injected('fault', _OVERLOAD),
    'silence': _injected('silence', 2.5),
    'silence for long': _injected('silence', 6.0),
    'power cycle': _injected('power-cycle', 2.0),
    'keypad': _injected('keypad', 'stop'),
    'changed at the keypad': _injected('set', 'control.retard', 3.0),
    'adapter replugged': _of_line('hangup', 1.0),
    'adapter away': _of_line('hangup', 5.0),
    'line dead': _of_line('line-dead', 2.0),
    'answers damaged': _of_line('damage', 30),
    'answers lost': _of_line('drop', 10),
    'answers twice': _of_line('double', 10),
    'answers late': _of_line('delay', 5),
    'stop_all': lambda soak, _: soak.client.call(Trigger, f'/{_BUS}/stop_all'),
    'error log': lambda soak, number: soak.client.call(
        GetErrorLog, f'/{NAMES[number]}/get_error_log'
    ),
    'parameter': Soak.set_parameter,
    'lifecycle': Soak.change_state,
    'client': Soak.listen_for_a_while,
}


def _end(process: subprocess.Popen[bytes]) -> int:
    """End a process, gently first; return its exit status."""
    if process.poll() is None:
        process.terminate()
    try:
        return process.wait(_PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def _samples(soak: Soak, seconds: float) -> Iterator[Sample]:
    """Let things happen for so long, s; print and yield what the driver has, once a minute."""
    begun = time.monotonic()
    soak.bring_back()
    happened = 0
    print('minute  memory, MB  threads  descriptors  happened', flush=True)
    for minute in range(1, int(seconds / _PERIOD) + 1):
        until = begun + minute * _PERIOD
        while time.monotonic() < until - _EVENT - _QUIET:
            soak.happen()
            happened += 1
            time.sleep(_EVENT)
            soak.bring_back()
        time.sleep(max(_QUIET, until - time.monotonic()))
        sample = Sample.of(soak.driver.pid)
        print(
            f'{minute:6}  {sample.memory:10.1f}  {sample.threads:7}  {sample.descriptors:11}  '
            f'{happened:8}',
            flush=True,
        )
        yield sample


def main() -> int:
    """Run it; return 1 if something has not settled, or went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    how_long = parser.add_mutually_exclusive_group()
    how_long.add_argument('--hours', type=float, default=2.0, help='how long (default: 2)')
    how_long.add_argument('--minutes', type=float)
    parser.add_argument('--seed', type=int, default=1, help='what happens when (default: 1)')
    options = parser.parse_args()
    minutes = options.hours * 60 if options.minutes is None else options.minutes
    if minutes < LEAST:
        parser.error(f'--minutes: at least {LEAST}, for a quarter of them is compared')
    # end what was started, however this ends
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    with own_domain() as domain:
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        with Soak(options.seed) as soak:
            wrong: list[str] = []
            try:
                wrong += unsettled(list(_samples(soak, minutes * 60)))
            except (RuntimeError, OSError) as error:
                wrong.append(str(error))
            status = _end(soak.driver)
            if status:
                wrong.append(f'the driver ended with exit status {status}')
            if 'Traceback' in soak.text:
                wrong.append('the driver had an error of its own')
            if wrong:
                print(soak.text[-4000:], file=sys.stderr)
    for complaint in wrong:
        print(f'FAILED: {complaint}')
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())
