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
"""A line whose master is the driver in a process of its own, with somebody who listens to it."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import threading
import time

from nfo_sinus_msgs.msg import BusStatistics
from nfo_sinus_msgs.msg import DriveStatus
from nfo_sinus_msgs.msg import Telemetry
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rig import PATIENCE
from rig import Rig
from rig import executable
from std_msgs.msg import Float32
from std_srvs.srv import SetBool

#: Unlike any other drive's name: what is said to these must never reach a motor.
NAMES = [f'simulated_for_bench_{number}' for number in range(1, 9)]
_FORMATS = {'modbus_rtu': '8E1', 'modbus_ascii': '7E1', 'classic': '7E1'}
#: From the moment that every drive is polled until nothing is special any more, s.
_SETTLE = 2.0


class Listener(Node):
    """Subscribes to everything that flows, as a plotting tool would."""

    def __init__(self, names: list[str], context: Context) -> None:
        super().__init__('bench_listener', context=context)
        self.measured: set[str] = set()
        self._cycle_times: list[float] = []
        for name in names:
            self._listen(DriveStatus, f'/{name}/status')
            self._listen(Telemetry, f'/{name}/telemetry')
            self._listen(Float32, f'/{name}/actual_speed')
            # goes out only while the node is active
            self.create_subscription(
                Float32,
                f'/{name}/actual_frequency',
                lambda _, name=name: self.measured.add(name),
                10,
            )
        self.create_subscription(
            BusStatistics, '/nfo_sinus_bus/statistics', self._on_statistics, 10
        )

    @contextlib.contextmanager
    def cycle_times(self) -> Iterator[list[float]]:
        """Collect what the driver says of its own cycle time, s."""
        self._cycle_times = times = []
        yield times
        self._cycle_times = []

    def enable(self, name: str) -> None:
        """Let a drive run and follow set-points."""
        client = self.create_client(SetBool, f'/{name}/enable')
        if not client.wait_for_service(PATIENCE):
            raise RuntimeError(f'{name} cannot be enabled: there is no service')
        response = client.call(SetBool.Request(data=True), timeout_sec=PATIENCE)
        if response is None or not response.success:
            raise RuntimeError(f'{name} cannot be enabled: {response}')

    def _listen(self, message_type: type, topic: str) -> None:
        self.create_subscription(message_type, topic, lambda _: None, 10)

    def _on_statistics(self, message: BusStatistics) -> None:
        self._cycle_times.append(message.cycle_time)


class DriverRig(Rig):
    """
    A simulated line with the driver on it, settled.

    :param settings: ROS parameters for all drives.
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
                'baud_rate': baud_rate,
                **settings,
            }
            parameters['drives'] = f'[{",".join(self.names)}]'
            for address, name in enumerate(self.names, start=1):
                parameters[f'{name}:address'] = address
            arguments = [f'{name}:={value}' for name, value in parameters.items()]
            self.listener = self._start_listener()
            self.driver = self.start(
                *self._program(),
                '--ros-args',
                *(word for argument in arguments for word in ('-p', argument)),
            )
            self._while_starting()
            self.wait_for(lambda: self.listener.measured >= set(self.names), self.driver)
            time.sleep(_SETTLE)
            failing.pop_all()

    def _program(self) -> tuple[str, ...]:
        """Return how the driver is started."""
        return (executable('driver'),)

    def _while_starting(self) -> None:
        """Do what has to be done while the driver starts."""

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
