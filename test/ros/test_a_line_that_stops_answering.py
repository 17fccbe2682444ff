# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A line of several drives that stops answering: every motor on it stops."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from dataclasses import replace
import signal
import threading
import time

from bench import FULL_RATE, PATIENCE, Bench, wait_until
from connections import CONNECTIONS, Connection, needs
from device_server import DeviceServer
from nfo_sinus_msgs.msg import DriveStatus
import pytest
from std_msgs.msg import Float32
from std_srvs.srv import Trigger

pytestmark = needs('rtu')

_SPEED = 20.0
#: By default, s.
_LOST_AFTER = 1.0
#: Until every motor of a line slows down: from what makes its stop due, s.
_SOON = 1.0


@pytest.fixture(scope='module')
def connection(request: pytest.FixtureRequest) -> Connection:
    """Return a connection over a line that is slow enough to be full with eight drives."""
    return replace(CONNECTIONS[request.param], baud_rate=19200)


class Line:
    """
    Some drives on a line, their driver, and a client of all of them.

    No drive has a time-out of its own that stops it: what stops a motor here is the driver.
    """

    def __init__(self, bench: Bench, drives: int) -> None:
        self.units = range(1, drives + 1)
        self._bench = bench
        self.simulator = bench.simulator(
            *bench.drives.ramps(2.0, 20.0), *bench.drives.no_timeout,
            *(f'--address={unit}' for unit in self.units), paced=True,
        )

    def start(self, *settings: str) -> None:
        """Start the driver, and wait until all motors turn."""
        parameters = self._bench.folder / 'line.yaml'
        names = [f'drive{unit}' for unit in self.units]
        parameters.write_text('\n'.join((
            f'nfo_sinus_bus: {{ros__parameters: {{drives: [{", ".join(names)}]}}}}',
            '/**: {ros__parameters: {drive_timeout: 0.0, setpoint_timeout: 0.0}}',
            *(f'{names[unit - 1]}: {{ros__parameters: {{address: {unit}}}}}' for unit in self.units),
        )))
        self.driver = self._bench.driver(
            *FULL_RATE, '-p', 'telemetry_rate:=0.0', *settings, '--params-file', str(parameters)
        )
        self.client = self._bench.client('/nfo_sinus_bus')
        self.status: dict[int, DriveStatus] = {}
        for unit, name in zip(self.units, names, strict=True):
            self.client.node.create_subscription(
                DriveStatus, f'/{name}/status',
                lambda status, unit=unit: self.status.__setitem__(unit, status), 10,
            )
        self._setpoint = self.client.node.create_publisher(
            Float32, '/nfo_sinus_bus/setpoint_all', 1
        )

    @contextlib.contextmanager
    def turning(self) -> Iterator[None]:
        """Enable all, and give set-points until all turn and all through the block."""

        def enabled() -> bool:
            return self.client.call('enable_all').success

        wait_until(enabled, 'all are enabled', 3 * PATIENCE, period=0.5)
        ended = threading.Event()

        def publish() -> None:
            while not ended.wait(0.1):
                self._setpoint.publish(Float32(data=_SPEED))

        thread = threading.Thread(target=publish, daemon=True)
        thread.start()
        try:
            wait_until(
                lambda: all(
                    state['frequency'] > 0.9 * _SPEED for state in self.simulator.states().values()
                ),
                'all turn',
            )
            yield
        finally:
            ended.set()
            thread.join()

    def on(self) -> list[int]:
        """Return the units whose motors are not being stopped."""
        stopping = self._bench.drives.stopping
        return [
            unit
            for unit, state in self.simulator.states().items()
            if state['turning'] and not stopping(state)
        ]

    def all_stop(self, seconds: float, *units: int) -> None:
        """Fail unless all motors, or some, slow down within some time."""
        end = time.monotonic() + seconds
        while on := set(self.on()) & set(units or self.units):
            assert time.monotonic() < end, f'{on} run on after {seconds} s: {self.driver.text}'
            time.sleep(0.02)

    def all_lost(self) -> None:
        """Wait until every drive is told as lost."""
        wait_until(
            lambda: all(
                unit in self.status
                and not self.status[unit].connected and not self.status[unit].enabled
                for unit in self.units
            ),
            'each is told as lost', 5.0,
        )


@pytest.mark.parametrize(
    ('drives', 'called'), [(3, ''), (8, 'stop_all'), (8, 'SIGTERM')]
)
def test_answers_are_lost_and_every_motor_stops(
    bench: Bench, drives: int, called: str
) -> None:
    line = Line(bench, drives)
    line.start('-p', 'shutdown_timeout:=3.0')
    with line.turning():
        line.simulator.inject('noise-rate', 'drop', 1.0)
        if called:
            time.sleep(0.3)
        if called == 'stop_all':
            line.client.call_async('stop_all', Trigger)
        elif called == 'SIGTERM':
            line.driver.signal(signal.SIGTERM)
        line.all_stop(_SOON if called else _LOST_AFTER + _SOON)
        if called == 'SIGTERM':
            assert line.driver.wait() == 1
        else:
            line.all_lost()
