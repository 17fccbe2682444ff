# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A line of several drives that stops answering: every motor on it stops."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import itertools
import signal
import threading
import time

from bench import PATIENCE, Bench, wait_until
from connections import needs
from device_server import DeviceServer
from nfo_sinus_msgs.msg import DriveStatus
import pytest
from std_msgs.msg import Float32
from std_srvs.srv import Trigger
from support.writes import is_write

pytestmark = needs('rtu')

_SPEED = 20.0
#: By default, s.
_LOST_AFTER = 1.0
#: Until every motor of a line slows down: from what makes its stop due, s.
_SOON = 1.0
#: The units that hear nothing any more.
_DEAF = (1, 3, 5, 7)
#: Of answers that have 8 bytes: one in twenty of their bytes.
_DAMAGED = 1 - 0.95 ** 8
#: serial.sio_tot, whichever drive.
_READ_SIO_TOT = bytes.fromhex('0303DC')


class Line:
    """
    Drives on one line, their driver, and a client of all of them.

    No drive has a time-out of its own that stops it: what stops a motor here is the driver.
    """

    def __init__(self, bench: Bench, drives: int) -> None:
        self.units = range(1, drives + 1)
        self._bench = bench
        self.simulator = bench.simulator(
            *bench.drives.ramps(2.0, 20.0), *bench.drives.no_timeout,
            *(f'--address={unit}' for unit in self.units),
        )

    def start(self, *settings: str) -> None:
        """Start the driver, and what listens to it."""
        parameters = self._bench.folder / 'line.yaml'
        names = {unit: f'drive{unit}' for unit in self.units}
        parameters.write_text('\n'.join((
            f'nfo_sinus_bus: {{ros__parameters: {{drives: [{", ".join(names.values())}]}}}}',
            '/**: {ros__parameters: {drive_timeout: 0.0, setpoint_timeout: 0.0}}',
            *(f'{name}: {{ros__parameters: {{address: {unit}}}}}' for unit, name in names.items()),
        )))
        self.driver = self._bench.driver(
            '-p', 'telemetry_rate:=0.0', *settings, '--params-file', str(parameters)
        )
        self.client = self._bench.client('/nfo_sinus_bus')
        self.status: dict[int, DriveStatus] = {}
        for unit, name in names.items():
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
            # so that the driver ends soon
            self.simulator.inject('heal')

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


def test_a_port_that_is_back_soon_costs_one_look_for_each_stop(bench: Bench) -> None:
    line = Line(bench, 8)
    # an answer that is late on a busy machine makes no second look
    line.start('-p', 'response_timeout:=0.5')
    with line.turning():
        gone = time.monotonic()
        line.simulator.inject('hangup', 0.5)
        line.all_stop(0.5 + _SOON)
        for unit in line.units:
            sent = [
                bytes.fromhex(frame['hex'])
                for frame in bench.frames()
                if frame['direction'] == 'request' and frame['first'] > gone + 0.3
            ]
            own = [frame for frame in sent if frame[0] == unit]
            looks = list(itertools.takewhile(lambda frame: not is_write('modbus_rtu', frame), own))
            assert len(looks) <= 1 and len(looks) < len(own), [frame.hex() for frame in own]


def test_a_line_that_is_cut_loses_all_its_drives(bench: Bench) -> None:
    line = Line(bench, 8)
    line.start()
    with line.turning():
        line.simulator.inject('line-dead', 60.0)
        line.all_lost()
        assert line.on() == [*line.units], 'they hear nothing, which makes this a test'
        line.simulator.inject('heal')
        line.all_stop(3.0)


def test_a_read_that_fails_for_good_keeps_no_stop_back(bench: Bench) -> None:
    line = Line(bench, 1)
    server = DeviceServer(bench.port)
    bench.callback(server.close)
    bench.port = server.port
    line.start()
    with line.turning():
        line.simulator.inject('line-dead', 4.5)
        server.unheard = _READ_SIO_TOT
        line.all_stop(4.5 + 3.0)
        server.unheard = b''


def test_a_stop_goes_with_noise_on_the_line(bench: Bench) -> None:
    line = Line(bench, 3)
    line.start()
    with line.turning():
        line.simulator.inject('noise-rate', 'damage', _DAMAGED, 1)
        line.simulator.inject('line-dead', 4.5)
        time.sleep(4.5)
        answer = line.client.call_async('stop_all', Trigger)
        line.all_stop(5.0)
        wait_until(answer.done, 'it is answered')


def test_at_the_end_drives_that_answer_wait_for_none_that_do_not(bench: Bench) -> None:
    line = Line(bench, 8)
    line.start('-p', 'shutdown_timeout:=3.0', '-p', 'response_timeout:=0.5')
    with line.turning():
        for unit in _DEAF:
            line.simulator.inject('silence', 60.0, address=unit)
        line.driver.signal(signal.SIGTERM)
        line.all_stop(_SOON, *(set(line.units) - {*_DEAF}))
        assert line.driver.wait() == 1
