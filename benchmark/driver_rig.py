# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A line whose master is the driver in a process of its own, with somebody who listens to it."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import Any

from nfo_sinus_msgs.msg import BusStatistics, DriveStatus, Telemetry
from rcl_interfaces.srv import ListParameters
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.subscription import Subscription
from rig import PATIENCE, Rig, executable
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger
import trace_file

from nfo_sinus_driver.catalog import load_family

#: Unlike any other drive's name: what is said to these must never reach a motor.
NAMES = [f'simulated_for_bench_{number}' for number in range(1, 33)]
_FORMATS = {'modbus_rtu': '8E1', 'modbus_ascii': '7E1', 'classic': '7E1', 'movitrac': '8N1'}
_DEPTH = 10
#: From the moment that every drive is polled until nothing is special any more, s.
_SETTLE = 2.0
#: How often drives are told to run at most.
_TRIES = 5


class Listener(Node):
    """
    A client of the driver, and an audience to everything that flows, as a plotting tool would be.

    The audience is a node that nobody spins: its messages arrive, and are dropped. So it costs the
    driver what any subscriber costs, and the benchmark next to nothing.
    """

    def __init__(self, names: list[str], context: Context) -> None:
        super().__init__('bench_listener', context=context)
        #: When each drive's node was seen to be active, s.
        self.active: dict[str, float] = {}
        self._waiting = {name: self._await_active(name) for name in names}
        self.audience = Node('bench_audience', context=context)
        for name in names:
            self._hear(DriveStatus, f'/{name}/status')
            self._hear(Telemetry, f'/{name}/telemetry')
            self._hear(Float32, f'/{name}/actual_speed')
            self._hear(Float32, f'/{name}/actual_frequency')
        self._hear(BusStatistics, '/nfo_sinus_bus/statistics')

    def destroy_node(self) -> None:
        """Leave, the audience too."""
        self.audience.destroy_node()
        super().destroy_node()

    def enable(self, name: str) -> None:
        """Let a drive run and follow set-points."""
        self._command(SetBool, f'/{name}/enable', data=True)

    def enable_all(self) -> None:
        """Let every drive run and follow set-points; on a busy machine not at the first try."""
        for _ in range(_TRIES - 1):
            with contextlib.suppress(RuntimeError):
                return self._command(Trigger, '/nfo_sinus_bus/enable_all')
            time.sleep(_SETTLE)
        return self._command(Trigger, '/nfo_sinus_bus/enable_all')

    def known(self, name: str) -> set[str]:
        """Return the names of a drive's parameters as its node has them now."""
        answer = self._call(ListParameters, f'/{name}/list_parameters')
        return set(answer.result.names)

    def _command(self, service_type: type, service: str, **fields: object) -> None:
        response = self._call(service_type, service, **fields)
        if not response.success:
            raise RuntimeError(f'{service}: {response.message}')

    def _call(self, service_type: type, service: str, **fields: object) -> Any:
        client = self.create_client(service_type, service)
        try:
            if not client.wait_for_service(PATIENCE):
                raise RuntimeError(f'there is no service {service}')
            response = client.call(service_type.Request(**fields), timeout_sec=PATIENCE)
        finally:
            self.destroy_client(client)
        if response is None:
            raise RuntimeError(f'{service} does not answer')
        return response

    def _await_active(self, name: str) -> Subscription:
        def active(_: Float32) -> None:
            if name not in self.active:
                self.active[name] = time.monotonic()
                self.destroy_subscription(self._waiting[name])

        # goes out only while the node is active
        return self.create_subscription(Float32, f'/{name}/actual_frequency', active, _DEPTH)

    def _hear(self, message_type: type, topic: str) -> None:
        self.audience.create_subscription(message_type, topic, lambda _: None, _DEPTH)


class DriverRig(Rig):
    """
    A simulated line with the driver on it, settled.

    :param settings: ROS parameters for all drives.

    :ivar startup: how long it took until every drive was active, with all its parameters known.
    """

    def __init__(
        self,
        baud_rate: int,
        drives: int,
        protocol: str = 'modbus_rtu',
        **settings: float,
    ) -> None:
        super().__init__(baud_rate, drives, _FORMATS[protocol], protocol)
        self.names = NAMES[:drives]
        with contextlib.ExitStack() as failing:
            failing.push(self)
            parameters = {
                'port': self.port,
                'protocol': protocol,
                'model': self.line.model,
                'baud_rate': baud_rate,
                **settings,
            }
            parameters['drives'] = f'[{",".join(self.names)}]'
            for address, name in enumerate(self.names, start=1):
                parameters[f'{name}:address'] = address
            arguments = [f'{name}:={value}' for name, value in parameters.items()]
            self.listener = self._start_listener()
            started = time.monotonic()
            self.driver = self.start(
                executable('driver'),
                '--ros-args',
                *(word for argument in arguments for word in ('-p', argument)),
            )
            self._while_starting()
            self.startup = self._started(started)
            time.sleep(_SETTLE)
            failing.pop_all()

    def _while_starting(self) -> None:
        """Do what has to be done while the driver starts."""

    def _started(self, started: float) -> dict[str, float]:
        """Wait until all drives are active and known; return what that took since the start."""
        active = self.listener.active
        self.wait_for(lambda: active.keys() >= set(self.names), self.driver)
        done = max(active.values())
        wanted = {
            parameter.key
            for parameter in load_family(self.line.model).settings
            # no drive here has an option card
            if self.line.space in parameter.addresses and not parameter.option
        }
        for name in self.names:
            if not self.listener.known(name) >= wanted:
                self.wait_for(lambda name=name: self.listener.known(name) >= wanted, self.driver)
                done = time.monotonic()
        frames = [frame for frame in self.frames() if frame.last <= done]
        on_wire = self.line.limit(trace_file.once(frames))
        return {
            'start': done - started,
            'start_line': done - frames[0].first,
            'start_wire': on_wire,
            'start_ratio': (done - started) / on_wire,
            'start_line_ratio': (done - frames[0].first) / on_wire,
        }

    def _start_listener(self) -> Listener:
        context = Context()
        rclpy.init(context=context)
        self.callback(context.try_shutdown)
        listener = Listener(self.names, context)
        self.callback(listener.destroy_node)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(listener)
        thread = threading.Thread(target=executor.spin, daemon=True)
        thread.start()
        self.callback(thread.join)
        self.callback(executor.shutdown)
        return listener
