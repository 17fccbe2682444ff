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

"""
Long life: the driver at full rate for an hour, its memory and descriptors counted.

A simulated drive, the driver, and a client that enables, publishes changing set-points and listens
to everything. Says at the end how memory and descriptors grew after the first minutes, and what the
log said; ends with 1 if they grew or the log went on and on.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import signal
import sys
import tempfile
import threading
import time

from nfo_sinus_msgs.msg import DriveStatus
from nfo_sinus_msgs.msg import Telemetry
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float32
from std_srvs.srv import SetBool

from nfo_sinus_driver.node.bench import Bench

_PAGE = os.sysconf('SC_PAGE_SIZE')
_PUBLISH_PERIOD = 0.1
#: Caches and pools fill up in this time, s.
_WARM_UP = 300.0
#: More than this is growth, kB and descriptors an hour.
_MOST_GROWTH = 1024
_MOST_LINES = 20
_SETPOINTS = (10.0, 30.0, -20.0, 0.0)
_SETPOINT_LASTS = 15.0


class Rider(Node):
    """Publishes set-points and counts what comes back."""

    def __init__(self) -> None:
        super().__init__('soak_rider')
        self.heard = 0
        self.moved = 0.0
        self.create_subscription(DriveStatus, '/nfo_sinus/status', self._on_status, 10)
        self.create_subscription(Telemetry, '/nfo_sinus/telemetry', self._on_telemetry, 10)
        self._publisher = self.create_publisher(Float32, '/nfo_sinus/setpoint', 1)
        self._enable = self.create_client(SetBool, '/nfo_sinus/enable')
        self._started = time.monotonic()
        self.create_timer(_PUBLISH_PERIOD, self._publish)

    def enable(self) -> None:
        """Enable the drive, as soon as that is possible."""
        self._enable.wait_for_service()
        while True:
            answer = self._enable.call(SetBool.Request(data=True))
            if answer.success:
                return
            time.sleep(1.0)

    def _publish(self) -> None:
        step = int((time.monotonic() - self._started) / _SETPOINT_LASTS)
        self._publisher.publish(Float32(data=_SETPOINTS[step % len(_SETPOINTS)]))

    def _on_status(self, message: DriveStatus) -> None:
        self.heard += 1
        self.moved = max(self.moved, abs(message.actual))

    def _on_telemetry(self, message: Telemetry) -> None:
        self.heard += 1


def main() -> int:
    """Run, sample, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=60.0)
    minutes = parser.parse_args().minutes
    # end what was started, however this ends
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ.setdefault('ROS_DOMAIN_ID', '101')
    with tempfile.TemporaryFile() as log, Bench(log) as bench:
        bench.start_simulator()
        driver = bench.start_driver()
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        rider = Rider()
        executor = SingleThreadedExecutor()
        executor.add_node(rider)
        thread = threading.Thread(target=executor.spin, daemon=True)
        thread.start()
        rider.enable()
        samples = _sample(driver.pid, rider, 60.0 * minutes)
        executor.shutdown()
        thread.join()
        rclpy.shutdown()
        log.seek(0)
        lines = log.read().decode().splitlines()
    return _judge(samples, lines)


def _sample(pid: int, rider: Rider, seconds: float) -> list[tuple[float, int, int, float]]:
    """Return time (s), memory (kB), descriptors and processor time (s), sampled regularly."""
    samples = []
    started = time.monotonic()
    period = max(1.0, seconds / 60)
    while (now := time.monotonic() - started) < seconds:
        samples.append((now, _memory(pid), len(os.listdir(f'/proc/{pid}/fd')), _cpu(pid)))
        print(
            f'{now:7.0f} s {samples[-1][1]:8} kB {samples[-1][2]:4} descriptors '
            f'{samples[-1][3]:8.1f} s of a core, {rider.heard} messages',
            flush=True,
        )
        time.sleep(period)
    return samples


def _judge(samples: list[tuple[float, int, int, float]], lines: list[str]) -> int:
    warm = [sample for sample in samples if sample[0] >= min(_WARM_UP, samples[-1][0] / 2)]
    first, last = warm[0], warm[-1]
    memory, descriptors = last[1] - first[1], last[2] - first[2]
    core = 100 * (last[3] - first[3]) / max(1e-9, last[0] - first[0])
    print(f'after the warm-up: {memory:+} kB, {descriptors:+} descriptors, {core:.1f} % of a core')
    print(f'{len(lines)} lines in the log:')
    print('\n'.join(lines))
    return int(memory > _MOST_GROWTH or descriptors > 0 or len(lines) > _MOST_LINES)


def _memory(pid: int) -> int:
    return int(Path(f'/proc/{pid}/statm').read_text().split()[1]) * _PAGE // 1024


def _cpu(pid: int) -> float:
    fields = Path(f'/proc/{pid}/stat').read_text().rsplit(') ', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


if __name__ == '__main__':
    sys.exit(main())
